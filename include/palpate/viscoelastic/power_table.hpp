// Sums over samples of ξ^q by q alone: one table serves every exponent n and damping exponent p.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"
#include "palpate/viscoelastic/window.hpp"

namespace palpate::viscoelastic {

// The grid of q, and of the exponents n on it.
struct Grid {
  static constexpr double lowest_power = -1.0;  // q: 2p of n = 0.5, p = n − 1
  static constexpr double step = 0.25;
  static constexpr std::size_t powers = 33;  // up to 7: two of 3.25, and half a window beyond
  static constexpr double lowest_exponent = 0.5;
  static constexpr double highest_exponent = 3.25;
  static constexpr std::size_t exponents = 12;
  static constexpr std::size_t first_exponent = 6;  // its place among the powers

  static constexpr double exponent(std::size_t node) noexcept {
    return lowest_exponent + step * static_cast<double>(node);
  }
  static constexpr double place_of_power(double q) noexcept { return (q - lowest_power) / step; }
  static constexpr double place_of_exponent(double n) noexcept {
    return (n - lowest_exponent) / step;
  }
};

// ξ^q at the grid's nodes.
using Powers = std::array<double, Grid::powers + 3>;

inline Powers powers_of(double depth) noexcept {
  // Steps of a quarter: two square roots in place of an exponential.
  const double half = std::sqrt(depth), quarter = std::sqrt(half);
  Powers p;
  p[0] = 1.0 / depth;
  p[1] = p[0] * quarter;
  p[2] = p[0] * half;
  p[3] = p[1] * half;
  for (std::size_t j = 4; j < p.size(); ++j) p[j] = p[j - 4] * depth;
  return p;
}

class PowerTable {
 public:
  // Of ξ^q, ξ^q w, ξ^q w², ξ^q F, ξ^q w F.
  enum Kind : std::size_t { plain, speed, speed_squared, force, power, kinds };

  void add(const Powers& p, const Sample& s, double weight) noexcept {
    const double w = weight * s.velocity;
    const std::array<double, kinds> factors{weight, w, w * s.velocity, weight * s.force,
                                            w * s.force};
    for (std::size_t kind = 0; kind < kinds; ++kind) {
      for (std::size_t j = 0; j < Grid::powers; ++j) sums_[kind][j] += factors[kind] * p[j];
    }
  }

  double at(Kind kind, const Window& window) const noexcept {
    return window.of(sums_[kind].data());
  }

  // How Σ ξ^q grows by the step at q.
  double growth_rate(double q) const noexcept {
    const double place = Grid::place_of_power(q);
    const std::size_t node = place > 1.0 ? static_cast<std::size_t>(place) : 1;
    const std::size_t last = node + 1 < Grid::powers ? node : Grid::powers - 2;
    const double growth = sums_[plain][last + 1] / sums_[plain][last];
    const bool known = growth > 1e-30 && growth < 1e30;
    return known ? std::log(growth) : 0.0;
  }

  void scale(double factor) noexcept {
    for (auto& column : sums_) {
      for (double& sum : column) sum *= factor;
    }
  }

 private:
  std::array<std::array<double, Grid::powers>, kinds> sums_{};
};

}  // namespace palpate::viscoelastic
