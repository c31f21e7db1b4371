// Sums over samples that hold the branches' states, at every exponent of the grid.
#pragma once

#include <array>
#include <cstddef>

#include "palpate/sample.hpp"
#include "palpate/viscoelastic/branches.hpp"
#include "palpate/viscoelastic/power_table.hpp"
#include "palpate/viscoelastic/spectrum.hpp"
#include "palpate/viscoelastic/window.hpp"

namespace palpate::viscoelastic {

// Of one column G = Σ wᵢ gᵢ at one exponent: the sums of G, GF, Gξⁿ, Gξⁿw, Gξⁿ⁻¹w and G².
struct MemoryColumn {
  double one, force, power, power_speed, slope_speed, square;
};

// Where a memory column is wanted: windows of sums of one power of ξⁿ, and of two; of the same
// nodes.
struct MemoryWindows {
  Window single;
  Window square;
};

// The five sums of a branch with what is no branch.
using Crossed = std::array<NodeRow, 5>;

inline void add_crossed(Crossed& sums, const NodeRow& g, const Powers& p, const Sample& s,
                        double weight) noexcept {
  const double wf = weight * s.force, wv = weight * s.velocity;
  const double* power = p.data() + Grid::first_exponent;
  const double* slope = power - Grid::one;  // ξⁿ⁻¹
  for (std::size_t j = 0; j < Grid::exponents; ++j) {
    const double once = weight * g[j], moving = wv * g[j];
    sums[0][j] += once;
    sums[1][j] += wf * g[j];
    sums[2][j] += once * power[j];
    sums[3][j] += moving * power[j];
    sums[4][j] += moving * slope[j];
  }
}

template <std::size_t Rows>
void scale_rows(std::array<NodeRow, Rows>& rows, double factor) noexcept {
  for (NodeRow& row : rows) {
    for (double& sum : row) sum *= factor;
  }
}

// The everyday tier: six times, four apart, and their mean alone.
class FlatSums {
 public:
  using Times = Ladder<6, 2>;
  static constexpr bool full = false;

  void add(const Branches<Times>& branches, const Powers& p, const Sample& s,
           double weight) noexcept {
    NodeRow mean{};
    for (const NodeRow& state : branches.states()) {
      for (std::size_t j = 0; j < Grid::exponents; ++j) mean[j] += state[j];
    }
    constexpr double each = 1.0 / static_cast<double>(Times::count);
    for (double& value : mean) value *= each;
    add_crossed(crossed_, mean, p, s, weight);
    for (std::size_t j = 0; j < Grid::exponents; ++j) square_[j] += weight * mean[j] * mean[j];
  }

  MemoryColumn column(const MemoryWindows& at, const Spectrum<Times::count>&) const noexcept {
    return {at.single.of(crossed_[0].data()), at.single.of(crossed_[1].data()),
            at.square.of(crossed_[2].data()), at.square.of(crossed_[3].data()),
            at.square.of(crossed_[4].data()), at.square.of(square_.data())};
  }

  void scale(double factor) noexcept {
    scale_rows(crossed_, factor);
    for (double& sum : square_) sum *= factor;
  }

 private:
  Crossed crossed_{};
  NodeRow square_{};
};

// The full tier: twelve times, two apart, and all pairs of them.
class PairSums {
 public:
  using Times = Ladder<12, 1>;
  static constexpr bool full = true;

  void add(const Branches<Times>& branches, const Powers& p, const Sample& s,
           double weight) noexcept {
    const auto& states = branches.states();
    std::size_t pair = 0;
    for (std::size_t i = 0; i < Times::count; ++i) {
      add_crossed(crossed_[i], states[i], p, s, weight);
      NodeRow weighted;
      for (std::size_t j = 0; j < Grid::exponents; ++j) weighted[j] = weight * states[i][j];
      for (std::size_t other = i; other < Times::count; ++other, ++pair) {
        for (std::size_t j = 0; j < Grid::exponents; ++j) {
          pairs_[pair][j] += weighted[j] * states[other][j];
        }
      }
    }
  }

  MemoryColumn column(const MemoryWindows& at,
                      const Spectrum<Times::count>& spectrum) const noexcept {
    // Rows are mixed before they are interpolated: one window serves them all.
    std::array<Vector<window_points>, 6> mixed{};
    const auto mix = [](Vector<window_points>& sum, double weight, const double* row) noexcept {
      for (std::size_t k = 0; k < window_points; ++k) sum[k] += weight * row[k];
    };
    const std::size_t first = at.single.first;
    for (std::size_t i = spectrum.first; i < spectrum.end; ++i) {
      const double weight = spectrum.weight[i];
      for (std::size_t j = 0; j < 5; ++j) mix(mixed[j], weight, crossed_[i][j].data() + first);
      const double twice = 2.0 * weight;
      mix(mixed[5], weight * weight, pairs_[pair_of(i, i)].data() + first);
      for (std::size_t other = i + 1; other < spectrum.end; ++other) {
        mix(mixed[5], twice * spectrum.weight[other], pairs_[pair_of(i, other)].data() + first);
      }
    }
    const auto of = [first](const Window& window, const Vector<window_points>& values) noexcept {
      return window.of(values.data(), first);
    };
    return {of(at.single, mixed[0]), of(at.single, mixed[1]), of(at.square, mixed[2]),
            of(at.square, mixed[3]), of(at.square, mixed[4]), of(at.square, mixed[5])};
  }

  void scale(double factor) noexcept {
    for (Crossed& crossed : crossed_) scale_rows(crossed, factor);
    scale_rows(pairs_, factor);
  }

 private:
  // Rows of a triangle one after the other: i (2 count − i + 1)/2 stand before row i.
  static constexpr std::size_t pair_of(std::size_t i, std::size_t other) noexcept {
    return i * (2 * Times::count - i + 1) / 2 + other - i;
  }

  std::array<Crossed, Times::count> crossed_{};
  std::array<NodeRow, Times::count*(Times::count + 1) / 2> pairs_{};
};

}  // namespace palpate::viscoelastic
