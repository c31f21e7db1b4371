// The sums over samples that a viscoelastic estimator keeps, at every exponent of the grid.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/sample.hpp"
#include "palpate/viscoelastic/branches.hpp"
#include "palpate/viscoelastic/power_table.hpp"

namespace palpate::viscoelastic {

template <std::size_t Rows>
void scale_rows(std::array<NodeRow, Rows>& rows, double factor) noexcept {
  for (NodeRow& row : rows) {
    for (double& sum : row) sum *= factor;
  }
}

// Sums of products with the branches gᵢ.
class BranchSums {
 public:
  // The factor that gᵢ is multiplied by. The sums with 1, F and w grow from exponent to exponent as
  // one power of ξ does, the others as the product of two powers.
  enum Kind : std::size_t { one, force, speed, power, power_speed, slope_speed, kinds };

  void add(const Branches& branches, const Powers& p, const Sample& s, double weight) noexcept {
    const double wf = weight * s.force, wv = weight * s.velocity;
    const double* power_of = p.data() + Grid::first_exponent;
    const double* slope_of = power_of - Grid::one;  // ξⁿ⁻¹
    const auto& states = branches.states();
    std::size_t pair = 0;
    for (std::size_t i = 0; i < rungs; ++i) {
      const NodeRow& g = states[i];
      auto& sums = crossed_[i];
      NodeRow weighted;
      for (std::size_t j = 0; j < Grid::exponents; ++j) {
        const double moving = wv * g[j];
        weighted[j] = weight * g[j];
        sums[one][j] += weighted[j];
        sums[force][j] += wf * g[j];
        sums[speed][j] += moving;
        sums[power][j] += weighted[j] * power_of[j];
        sums[power_speed][j] += moving * power_of[j];
        sums[slope_speed][j] += moving * slope_of[j];
      }
      for (std::size_t other = i; other < rungs; ++other, ++pair) {
        for (std::size_t j = 0; j < Grid::exponents; ++j) {
          pairs_[pair][j] += weighted[j] * states[other][j];
        }
      }
    }
  }

  const NodeRow& crossed(std::size_t rung, Kind kind) const noexcept {
    return crossed_[rung][kind];
  }
  // Σ gᵢ gⱼ for i ≤ j; the rows of the triangle are stored one after the other.
  const NodeRow& pair(std::size_t i, std::size_t j) const noexcept {
    return pairs_[i * (2 * rungs - i + 1) / 2 + j - i];
  }

  void scale(double factor) noexcept {
    for (auto& crossed : crossed_) scale_rows(crossed, factor);
    scale_rows(pairs_, factor);
  }

 private:
  std::array<std::array<NodeRow, kinds>, rungs> crossed_{};
  std::array<NodeRow, rungs*(rungs + 1) / 2> pairs_{};
};

// Sums of products with the columns z, which model the unknown state at a start in contact.
class StartSums {
 public:
  struct Column {
    double one, force, speed;
    NodeRow power, power_speed, slope_speed;  // products with ξⁿ, ξⁿw, ξⁿ⁻¹w
    std::array<NodeRow, rungs> branch;
    std::array<double, start_columns> start;
  };

  void add(const Branches& branches, const Powers& p, const Sample& s, double weight) noexcept {
    const double* power_of = p.data() + Grid::first_exponent;
    const double* slope_of = power_of - Grid::one;
    for (std::size_t a = 0; a < start_columns; ++a) {
      Column& sums = columns_[a];
      const double z = weight * branches.start()[a], moving = z * s.velocity;
      sums.one += z;
      sums.force += z * s.force;
      sums.speed += moving;
      for (std::size_t j = 0; j < Grid::exponents; ++j) {
        sums.power[j] += z * power_of[j];
        sums.power_speed[j] += moving * power_of[j];
        sums.slope_speed[j] += moving * slope_of[j];
      }
      for (std::size_t i = 0; i < rungs; ++i) {
        for (std::size_t j = 0; j < Grid::exponents; ++j) {
          sums.branch[i][j] += z * branches.states()[i][j];
        }
      }
      for (std::size_t b = 0; b < start_columns; ++b) sums.start[b] += z * branches.start()[b];
    }
  }

  const Column& column(std::size_t a) const noexcept { return columns_[a]; }
  // Whether any sample was taken before the effect of an unknown start had decayed.
  bool any() const noexcept { return columns_[0].one > 0.0 || columns_[1].one > 0.0; }

  void scale(double factor) noexcept {
    for (Column& column : columns_) {
      column.one *= factor;
      column.force *= factor;
      column.speed *= factor;
      for (NodeRow* row : {&column.power, &column.power_speed, &column.slope_speed}) {
        for (double& sum : *row) sum *= factor;
      }
      scale_rows(column.branch, factor);
      for (double& sum : column.start) sum *= factor;
    }
  }

 private:
  std::array<Column, start_columns> columns_{};
};

class Samples {
 public:
  Samples(double sample_time, double longest) noexcept : branches_(sample_time, longest) {}

  // Advances the branches by `dt` to a depth, 0 out of contact. Every sample advances them.
  [[gnu::noinline]] void advance(double depth, double dt) noexcept { branches_.advance(depth, dt); }

  // Sets the branches to a depth when the motion before it is unknown.
  void begin(double depth) noexcept {
    const bool first = !(table_.weight() > 0.0);
    depth > 0.0 && first ? branches_.begin_in_contact(depth) : branches_.rest(depth);
  }

  // Adds to the sums the sample to whose depth the branches were just advanced.
  [[gnu::noinline]] void take(const Sample& s, double forgetting_factor) noexcept {
    if (forgetting_factor != 1.0) fade(forgetting_factor);
    force_squared_ += scale_ * s.force * s.force;
    const Powers powers = powers_of(s.penetration);
    table_.add(powers, s, scale_);
    sums_.add(branches_, powers, s, scale_);
    if (branches_.starting()) start_sums_.add(branches_, powers, s, scale_);
  }

  void clear() noexcept {
    scale_ = 1.0;
    force_squared_ = 0.0;
    table_ = {};
    sums_ = {};
    start_sums_ = {};
  }

  double weight() const noexcept { return table_.weight() / scale_; }        // Σ 1
  double force_squared() const noexcept { return force_squared_ / scale_; }  // Σ F²
  // The weight of the latest sample in the sums.
  double scale() const noexcept { return scale_; }
  const PowerTable& table() const noexcept { return table_; }
  const BranchSums& sums() const noexcept { return sums_; }
  const StartSums& start_sums() const noexcept { return start_sums_; }
  const Branches& branches() const noexcept { return branches_; }
  const Ladder& ladder() const noexcept { return branches_.ladder(); }
  bool touching() const noexcept { return branches_.depth() > 0.0; }

  // Statistics of the motion: mean depth; squared angular frequency, which is the mean square
  // velocity over the variance of the depth; and mean velocity over rms velocity, which is ±1 for
  // motion in one direction at constant speed.
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
  // Forgetting raises the weight of new samples instead of scaling every sum down. At e⁶⁰ (1e26)
  // all sums are rescaled.
  void fade(double factor) noexcept {
    scale_ /= factor;
    constexpr double largest = 1e26;
    if (scale_ < largest) return;
    const double per = 1.0 / scale_;
    table_.scale(per);
    sums_.scale(per);
    start_sums_.scale(per);
    force_squared_ *= per;
    scale_ = 1.0;
  }

  Branches branches_;
  double scale_ = 1.0;
  double force_squared_ = 0.0;
  PowerTable table_{};
  BranchSums sums_{};
  StartSums start_sums_{};
};

}  // namespace palpate::viscoelastic
