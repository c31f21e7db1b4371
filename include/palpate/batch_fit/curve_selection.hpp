// Selects which samples of a whole curve are firm contact, light contact or free air, and measures
// the offset in free air: the selection of variable projection (contact_samples.hpp), one sample at
// a time.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/batch_fit/curve_cost.hpp"
#include "palpate/projection/contact_samples.hpp"
#include "palpate/projection/covariance.hpp"
#include "palpate/sample.hpp"

namespace palpate {

// The arrays of one curve, SI.
struct CurveArrays {
  const double* penetration;
  const double* velocity;
  const double* force;
  std::size_t count;
};

// In SI, the same for all curves; a unit of the scale that is 0 is chosen from the curve.
struct CurveSettings {
  double noise = 0.0;  // standard deviation of the force; 0: from the residual
  double lowest_exponent = ProjectionSettings{}.lowest_exponent;
  double highest_exponent = ProjectionSettings{}.highest_exponent;  // equal to the lowest: known
  bool offset = true;
  double offset_deviation = 0.0;   // as in ProjectionSettings
  double surface_deviation = 0.0;  // the same
  bool find_surface = false;
  double lowest_surface = 0.0;   // both 0: a fifth of the unit of penetration each way,
  double highest_surface = 0.0;  // and again a wider range if that is too narrow
  Scale scale{0.0, 0.0, 0.0};
};

enum class CurveStatus : std::uint8_t { fitted, no_contact, unsettled, surface_at_edge };

// The role of a sample in a fit.
enum class CurveRole : std::uint8_t { absent, free, firm, light, left_out };

struct CurveFit {
  Vector<5> parameters{};  // K, B, n, F₀, d, SI
  Matrix<5> covariance{};
  double noise = 0.0;  // standard deviation of the force, N
  double cost = 0.0;   // J, N²
  std::uint64_t taken = 0;
  std::uint8_t flags = 0;
  CurveStatus status = CurveStatus::no_contact;
  // The quantities that define the cost: its units, the prior of F₀, N (deviation 0: none), and σ²
  // of the priors, N².
  Scale scale{1.0, 1.0, 1.0};
  double offset_mean = 0.0;
  double offset_deviation = 0.0;
  double prior_variance = 0.0;
};

namespace detail {

// The working memory of a fit, provided by its caller: `size` doubles.
class CurveMemory {
 public:
  static constexpr std::size_t columns = 14;

  static constexpr std::size_t size(std::size_t samples) noexcept {
    return columns * stride(samples);
  }

  CurveMemory(double* from, std::size_t samples) noexcept : from_(from), stride_(stride(samples)) {}

  double* column(std::size_t i) const noexcept { return from_ + i * stride_; }

 private:
  // Room for two parts, each padded to whole blocks, and for an empty one.
  static constexpr std::size_t stride(std::size_t samples) noexcept {
    return CurveSamples::padded(samples) + 2 * CurveSamples::block;
  }

  double* from_;
  std::size_t stride_;
};

// Units near the largest values in contact, the same as `suggest_scale` in Python.
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
        index_(memory.column(4)),
        role_(reinterpret_cast<unsigned char*>(memory.column(5))) {}

  // Selects samples at a known surface; `largest_depth` is in scaled units.
  void choose(const CurveArrays& curve, const Units& units, double largest_depth) noexcept {
    constexpr std::size_t side = ContactSamples::side;
    ContactSamples recent;
    // All but the last samples are classified again once they have neighbours after them.
    std::size_t last = curve.count;
    for (std::size_t left = side; last > 0 && left > 0; --last) {
      left -= usable(sample(curve, units, last - 1), largest_depth) ? 1 : 0;
    }
    const auto settle = [&](std::size_t age) noexcept {
      if (count_ <= age || at(count_ - 1 - age) == Role::free) return;
      give(count_ - 1 - age, recent.pressed(age, air_.mean()) ? Role::sure : Role::light);
    };
    for (std::size_t i = 0; i < curve.count; ++i) {
      const Sample s = sample(curve, units, i);
      if (!usable(s, largest_depth)) continue;
      const Role role = curve.penetration[i] > 0.0 ? Role::light : Role::free;
      recent.push(s, role, false);
      push(s, role, i);
      if (role == Role::free) air_.add(s.penetration, s.force, 1.0);
      if (i >= last) settle(0);
      settle(side);
    }
    least_step_ = recent.least_step();
    resolution_ = recent.resolution();
  }

  // Selects all samples from a depth on if the surface is unknown, including the approach.
  void take_all(const CurveArrays& curve, const Units& units, double from,
                double largest_depth) noexcept {
    for (std::size_t i = 0; i < curve.count; ++i) {
      const Sample s = sample(curve, units, i);
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
  double least_step() const noexcept { return least_step_; }
  double resolution() const noexcept { return resolution_; }

  // Copies the samples of a role into arrays, with forces relative to `zero`; `place` gets their
  // indices.
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
  static Sample sample(const CurveArrays& curve, const Units& units, std::size_t i) noexcept {
    return scaled({curve.penetration[i], curve.velocity[i], curve.force[i]}, units);
  }

  static bool usable(const Sample& s, double largest_depth) noexcept {
    return s.penetration < largest_depth && within(s, 1e8);  // false for NaN
  }

  void give(std::size_t i, Role role) noexcept { role_[i] = static_cast<unsigned char>(role); }

  void push(const Sample& s, Role role, std::size_t i) noexcept {
    x_[count_] = s.penetration;
    w_[count_] = s.velocity;
    f_[count_] = s.force;
    index_[count_] = static_cast<double>(i);
    give(count_++, role);
  }

  double *x_, *w_, *f_;
  double* index_;  // index in the curve
  unsigned char* role_;
  std::size_t count_ = 0;
  double least_step_ = 0.0;
  double resolution_ = 0.0;
  FreeAir air_;
};

}  // namespace detail

// The number of doubles that a fit of `samples` samples needs as memory.
constexpr std::size_t curve_memory(std::size_t samples) noexcept {
  return detail::CurveMemory::size(samples);
}

}  // namespace palpate
