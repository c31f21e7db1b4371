// Which samples of a whole curve are firm contact, light contact or free air, and what free air
// says of the offset: the choice of variable projection (contact_samples.hpp), a sample at a time
// with the noise and the offset known by then, but without its sums.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "palpate/curves/curve_sums.hpp"
#include "palpate/projection/contact_samples.hpp"
#include "palpate/projection/free_air.hpp"
#include "palpate/sample.hpp"

namespace palpate {

// The arrays of one curve, SI.
struct CurveArrays {
  const double* penetration;
  const double* velocity;
  const double* force;
  std::size_t count;
};

namespace detail {

// Memory that a fit works in, handed in by its caller: `size` doubles.
class CurveMemory {
 public:
  static constexpr std::size_t columns = 14;

  static constexpr std::size_t size(std::size_t samples) noexcept {
    return columns * stride(samples);
  }

  CurveMemory(double* from, std::size_t samples) noexcept : from_(from), stride_(stride(samples)) {}

  double* column(std::size_t i) const noexcept { return from_ + i * stride_; }

 private:
  // Two parts, each up to whole blocks; and a sum of none.
  static constexpr std::size_t stride(std::size_t samples) noexcept {
    return CurveSamples::padded(samples) + 2 * CurveSamples::block;
  }

  double* from_;
  std::size_t stride_;
};

// Units near the largest values in contact, as `suggest_scale` chooses them in Python.
inline Scale suggested_scale(const CurveArrays& curve) noexcept {
  constexpr double largest = 1e100;
  double depth = 0.0, speed = 0.0, push = 0.0;
  for (std::size_t i = 0; i < curve.count; ++i) {
    const double x = curve.penetration[i], v = std::abs(curve.velocity[i]), f = curve.force[i];
    const bool touching = x > 0.0 && f > 0.0 && x < largest && v < largest && f < largest;
    depth = touching && x > depth ? x : depth;
    speed = touching && v > speed ? v : speed;
    push = touching && f > push ? f : push;
  }
  const auto unit = [](double value) noexcept {
    return value > 0.0 ? std::clamp(value, 1e-30, 1e30) : 1.0;
  };
  return {unit(depth), unit(speed), unit(push)};
}

class CurveSelection {
 public:
  explicit CurveSelection(const CurveMemory& memory) noexcept
      : x_(memory.column(0)),
        w_(memory.column(1)),
        f_(memory.column(2)),
        force_(memory.column(3)),
        index_(memory.column(4)),
        role_(reinterpret_cast<unsigned char*>(memory.column(5))) {}

  // With the surface known; `largest_depth` in its unit.
  void choose(const CurveArrays& curve, const Units& units, double largest_depth) noexcept {
    constexpr std::size_t side = ContactSamples::side;
    force_[0] = 0.0;
    const std::size_t end = last_ones(curve, units, largest_depth, side);
    std::array<Known, side> recent{};
    for (std::size_t i = 0; i < curve.count; ++i) {
      const Sample given{curve.penetration[i], curve.velocity[i], curve.force[i]};
      const Sample s = scaled(given, units);
      if (!usable(s, largest_depth)) continue;
      const bool below = given.penetration > 0.0;
      push(s, below ? Role::light : Role::free, i);
      if (!below) air_.add(s.penetration, s.force, 1.0);
      if (i >= end) recent[(count_ - 1) % side] = {noise_.margin(), air_.mean()};
      if (count_ > side && at(count_ - 1 - side) != Role::free) {
        settle(count_ - 1 - side, count_ - 1, {noise_.margin(), air_.mean()});
      }
    }
    // The last ones never had all their neighbours: what was known of each at its own time counts.
    for (std::size_t i = count_ - std::min(count_, side); i < count_; ++i) {
      settle(i, i, recent[i % side]);
    }
  }

  // With the surface unknown all of them count, from a depth on: the approach too.
  void take_all(const CurveArrays& curve, const Units& units, double from,
                double largest_depth) noexcept {
    for (std::size_t i = 0; i < curve.count; ++i) {
      const Sample s = scaled({curve.penetration[i], curve.velocity[i], curve.force[i]}, units);
      if (!usable(s, largest_depth) || !(s.penetration > from)) continue;
      push(s, Role::sure, i);
    }
  }

  std::size_t count() const noexcept { return count_; }
  std::size_t count(Role role) const noexcept {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < count_; ++i) sum += at(i) == role ? 1 : 0;
    return sum;
  }
  Role at(std::size_t i) const noexcept { return static_cast<Role>(role_[i]); }
  std::size_t index(std::size_t i) const noexcept { return static_cast<std::size_t>(index_[i]); }

  const FreeAir& air() const noexcept { return air_; }
  double least_step() const noexcept { return noise_.least(); }

  // The samples of a role into arrays of their own, forces from `zero` on; `place` their indices.
  void copy(Role role, double zero, CurveSamples& to, double* place) const noexcept {
    std::size_t count = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      to.x[count] = x_[i];
      to.w[count] = w_[i];
      to.f[count] = f_[i] - zero;
      place[count] = index_[i];
      count += at(i) == role ? 1 : 0;
    }
    to.count = count;
    to.pad();
  }

 private:
  struct Known {
    double margin;
    double zero;
  };

  // From where on there are no more than so many usable samples.
  static std::size_t last_ones(const CurveArrays& curve, const Units& units, double largest_depth,
                               std::size_t count) noexcept {
    std::size_t i = curve.count;
    while (i > 0 && count > 0) {
      --i;
      const Sample s = scaled({curve.penetration[i], curve.velocity[i], curve.force[i]}, units);
      if (usable(s, largest_depth)) --count;
    }
    return i;
  }

  static bool usable(const Sample& s, double largest_depth) noexcept {
    return s.penetration < largest_depth && within(s, 1e8);  // NaN is not
  }

  void push(const Sample& s, Role role, std::size_t i) noexcept {
    if (count_ > 0) noise_.learn(std::abs(s.force - f_[count_ - 1]));
    x_[count_] = s.penetration;
    w_[count_] = s.velocity;
    f_[count_] = s.force;
    index_[count_] = static_cast<double>(i);
    role_[count_] = static_cast<unsigned char>(role);
    force_[count_ + 1] = force_[count_] + s.force;
    ++count_;
  }

  // The role of sample i by its neighbours up to `newest`.
  void settle(std::size_t i, std::size_t newest, const Known& known) noexcept {
    if (at(i) == Role::free) return;
    constexpr std::size_t side = ContactSamples::side;
    const std::size_t first = i - std::min(i, side), last = std::min(newest, i + side);
    const auto press = [&](std::size_t from, std::size_t to) noexcept {
      const Neighbours them{force_[to] - force_[from], static_cast<double>(to - from)};
      return ForceNoise::press(them, known.zero, known.margin);
    };
    const bool pressed = press(first, i) && press(i + 1, last + 1);
    role_[i] = static_cast<unsigned char>(pressed ? Role::sure : Role::light);
  }

  double *x_, *w_, *f_;
  double* force_;  // Σ F of all before
  double* index_;  // in the curve
  unsigned char* role_;
  std::size_t count_ = 0;
  ForceNoise noise_;
  FreeAir air_;
};

}  // namespace detail
}  // namespace palpate
