// All that a viscoelastic estimator keeps of its samples: the states of the branches, and the sums.
#pragma once

#include <cmath>
#include <cstddef>

#include "palpate/sample.hpp"
#include "palpate/viscoelastic/branches.hpp"
#include "palpate/viscoelastic/memory_sums.hpp"
#include "palpate/viscoelastic/power_table.hpp"

namespace palpate::viscoelastic {

template <class Sums>
class Samples {
 public:
  using Times = typename Sums::Times;

  explicit Samples(double sample_time) noexcept : branches_(sample_time) {}

  // A depth, 0 for none, after so much time. The branches feel every one.
  [[gnu::noinline]] void advance(double depth, double dt) noexcept { branches_.advance(depth, dt); }

  // The same where nothing is known of what came before: as if it had always been there.
  void begin(double depth) noexcept { branches_.rest(depth); }

  // Takes the sample whose depth was advanced to.
  [[gnu::noinline]] void take(const Sample& s, double forgetting_factor) noexcept {
    if (forgetting_factor != 1.0) fade(forgetting_factor);
    force_squared_ += scale_ * s.force * s.force;
    const Powers powers = powers_of(s.penetration);
    table_.add(powers, s, scale_);
    sums_.add(branches_, powers, s, scale_);
  }

  void clear() noexcept {
    scale_ = 1.0;
    force_squared_ = 0.0;
    table_ = {};
    sums_ = {};
  }

  double weight() const noexcept { return table_.weight() / scale_; }        // Σ 1
  double force_squared() const noexcept { return force_squared_ / scale_; }  // Σ F²
  // What the latest sample weighs in the sums.
  double scale() const noexcept { return scale_; }
  const PowerTable& table() const noexcept { return table_; }
  const Sums& sums() const noexcept { return sums_; }
  const Branches<Times>& branches() const noexcept { return branches_; }
  bool touching() const noexcept { return branches_.depth() > 0.0; }

  // Where the motion was, and how quick: its mean depth; the square of its frequency, mean square
  // speed over mean square way from there; and its mean velocity over the root of that mean square
  // speed, ±1 where it went one way at one speed.
  struct Motion {
    double depth;
    double frequency_squared;
    double one_way;
  };
  Motion motion() const noexcept {
    using enum PowerTable::Kind;
    constexpr std::size_t zero = Grid::zero, one = zero + Grid::one, two = one + Grid::one;
    const double weight = table_.weight();
    if (!(weight > 0.0)) return {0.0, 0.0, 0.0};
    const double depth = table_.at_node(plain, one) / weight;
    const double way = table_.at_node(plain, two) - weight * depth * depth;
    const double squared = table_.at_node(speed_squared, zero);
    return {depth, way > 0.0 ? squared / way : 0.0,
            squared > 0.0 ? table_.at_node(speed, zero) / std::sqrt(weight * squared) : 0.0};
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
    force_squared_ *= per;
    scale_ = 1.0;
  }

  Branches<Times> branches_;
  double scale_ = 1.0;
  double force_squared_ = 0.0;
  PowerTable table_{};
  Sums sums_{};
};

}  // namespace palpate::viscoelastic
