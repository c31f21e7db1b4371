// All that a viscoelastic estimator keeps of its samples: the states of the branches, the sums, and
// the least-squares problem of any candidate from them.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"
#include "palpate/viscoelastic/branches.hpp"
#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/memory_sums.hpp"
#include "palpate/viscoelastic/power_table.hpp"

namespace palpate::viscoelastic {

// The linear part: k, c, m, F₀.
enum Part : std::size_t { stiffness, damping, memory, offset, parts };

struct Normal {
  Matrix<parts> a{};
  Vector<parts> b{};
};

template <class Sums>
class Samples {
 public:
  using Times = typename Sums::Times;

  explicit Samples(double sample_time) noexcept : branches_(sample_time) {}

  // A depth, 0 for none, after so much time. The branches feel every one.
  [[gnu::noinline]] void advance(double depth, double dt) noexcept {
    touching_ = depth > 0.0 ? 1 : 0;
    if (touching_ == 0) return branches_.advance(nullptr, dt);
    const Powers powers = powers_of(depth);
    branches_.advance(&powers, dt);
  }

  // The same where nothing is known of what came before: as if it had always been there.
  void begin(double depth) noexcept {
    touching_ = depth > 0.0 ? 1 : 0;
    if (touching_ == 0) return branches_.rest(nullptr);
    const Powers powers = powers_of(depth);
    branches_.rest(&powers);
  }

  // Takes the sample whose depth was advanced to.
  [[gnu::noinline]] void take(const Sample& s, double forgetting_factor) noexcept {
    if (forgetting_factor != 1.0) fade(forgetting_factor);
    weight_ += scale_;
    force_ += scale_ * s.force;
    force_squared_ += scale_ * s.force * s.force;
    // Once more: two square roots and some products are cheaper than to keep 36 numbers.
    const Powers powers = powers_of(s.penetration);
    table_.add(powers, s, scale_);
    sums_.add(branches_, powers, s, scale_);
  }

  void clear() noexcept {
    scale_ = 1.0;
    weight_ = force_ = force_squared_ = 0.0;
    table_ = {};
    sums_ = {};
  }

  double weight() const noexcept { return weight_ / scale_; }                // Σ 1
  double force_squared() const noexcept { return force_squared_ / scale_; }  // Σ F²
  const Branches<Times>& branches() const noexcept { return branches_; }
  bool touching() const noexcept { return touching_ != 0; }

  // Of a candidate at an exponent; `second` as of spectrum_of().
  [[gnu::noinline]] Normal normal(const Candidate& law, double n, double second) const noexcept {
    const auto [a, b] = unscaled(law, n, second);
    Normal result{};
    const double per = 1.0 / scale_;
    for (std::size_t i = 0; i < parts; ++i) {
      result.b[i] = b[i] * per;
      for (std::size_t j = 0; j < parts; ++j) result.a[i][j] = a[i][j] * per;
    }
    return result;
  }

  // Where the motion was, and how quick: its mean depth, and the square of its frequency, mean
  // square speed over mean square way from there.
  struct Motion {
    double depth;
    double frequency_squared;
  };
  Motion motion() const noexcept {
    const auto at = [&](PowerTable::Kind kind, double q) noexcept {
      return table_.at(kind, window(Grid::place_of_power(q), Grid::powers, {}));
    };
    if (!(weight_ > 0.0)) return {0.0, 0.0};
    const double depth = at(PowerTable::plain, 1.0) / weight_;
    const double way = at(PowerTable::plain, 2.0) - weight_ * depth * depth;
    return {depth, way > 0.0 ? at(PowerTable::speed_squared, 0.0) / way : 0.0};
  }

 private:
  // In place of every sum, what is new weighs more: e⁶⁰ and all are brought back.
  void fade(double factor) noexcept {
    scale_ /= factor;
    constexpr double largest = 1e26;
    if (scale_ < largest) return;
    const double per = 1.0 / scale_;
    table_.scale(per);
    sums_.scale(per);
    weight_ *= per;
    force_ *= per;
    force_squared_ *= per;
    scale_ = 1.0;
  }

  Normal unscaled(const Candidate& law, double n, double second) const noexcept {
    const double rate = table_.growth_rate(2.0 * n);
    const Growth growth = Growth::of(rate);
    const auto around = [&](double q) noexcept {
      return window(Grid::place_of_power(q), Grid::powers, growth);
    };
    using enum PowerTable::Kind;
    const Window once = around(n), twice = around(2.0 * n);
    Normal s{};
    s.a[offset][offset] = weight_;
    s.b[offset] = force_;
    s.a[stiffness][stiffness] = table_.at(plain, twice);
    s.a[stiffness][offset] = table_.at(plain, once);
    s.b[stiffness] = table_.at(force, once);
    if (law.damping == Damping::hunt_crossley) {
      s.a[stiffness][damping] = table_.at(speed, twice);
      s.a[damping][damping] = table_.at(speed_squared, twice);
      s.a[damping][offset] = table_.at(speed, once);
      s.b[damping] = table_.at(power, once);
    } else if (law.damping == Damping::half_space) {
      const Window below = around(n - 1.0);
      s.a[stiffness][damping] = table_.at(speed, around(2.0 * n - 1.0));
      s.a[damping][damping] = table_.at(speed_squared, around(2.0 * n - 2.0));
      s.a[damping][offset] = table_.at(speed, below);
      s.b[damping] = table_.at(power, below);
    }
    if (law.memory != Memory::none) add_memory(s, law, n, second, growth);
    for (std::size_t i = 0; i < parts; ++i) {
      for (std::size_t j = 0; j < i; ++j) s.a[i][j] = s.a[j][i];
    }
    return s;
  }

  void add_memory(Normal& s, const Candidate& law, double n, double second,
                  const Growth& growth) const noexcept {
    // From exponent to exponent a sum of one power grows as from q to q, one of two powers twice.
    const double place = Grid::place_of_exponent(n);
    const MemoryWindows windows{window(place, Grid::exponents, growth),
                                window(place, Grid::exponents, growth.squared())};
    const MemoryColumn column = sums_.column(windows, spectrum_of<Times>(law.memory, second));
    s.a[memory][memory] = column.square;
    s.a[stiffness][memory] = column.power;
    s.a[memory][offset] = column.one;
    s.b[memory] = column.force;
    if (law.damping == Damping::hunt_crossley) s.a[damping][memory] = column.power_speed;
    if (law.damping == Damping::half_space) s.a[damping][memory] = column.slope_speed;
  }

  Branches<Times> branches_;
  std::uint64_t touching_ = 0;  // whether there was a depth
  double scale_ = 1.0;          // what the latest sample weighs in the sums
  double weight_ = 0.0;
  double force_ = 0.0;
  double force_squared_ = 0.0;
  PowerTable table_{};
  Sums sums_{};
};

}  // namespace palpate::viscoelastic
