// Sums over samples of ξ^q by q alone: one table serves every exponent n and damping exponent p.
#pragma once

#include <algorithm>
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
  static constexpr std::size_t zero = 4;            // where q = 0
  static constexpr std::size_t one = 4;             // nodes from q to q + 1

  static constexpr double exponent_at(double place) noexcept {
    return lowest_exponent + step * place;
  }
  static constexpr double place_of_power(double q) noexcept { return (q - lowest_power) / step; }
  static constexpr double place_of_exponent(double n) noexcept {
    return (n - lowest_exponent) / step;
  }
};

// ξ^q at the grid's nodes, and a few beyond.
using Powers = std::array<double, Grid::powers + 3>;
// A number at each exponent of the grid.
using NodeRow = std::array<double, Grid::exponents>;

// Each ξ times what stands a step of one before it.
template <std::size_t Size>
void raise(std::array<double, Size>& powers, std::size_t begin, double depth) noexcept {
  for (std::size_t j = begin; j < Size; ++j) powers[j] = powers[j - Grid::one] * depth;
}

inline Powers powers_of(double depth) noexcept {
  // Steps of a quarter: two square roots in place of an exponential.
  const double half = std::sqrt(depth), quarter = std::sqrt(half), inverse = 1.0 / depth;
  const std::array<double, Grid::one> starts{inverse, half * inverse, 1.0, half};
  Powers p;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    p[2 * i] = starts[i];
    p[2 * i + 1] = starts[i] * quarter;
  }
  raise(p, 8, depth);
  return p;
}

// ξⁿ at the grid's exponents alone; 0 where there is no depth.
inline NodeRow elastic_of(double depth) noexcept {
  const double half = std::sqrt(depth), quarter = std::sqrt(half);
  NodeRow row;
  row[0] = half;
  row[1] = half * quarter;
  row[2] = depth;
  row[3] = quarter * depth;
  raise(row, 4, depth);
  return row;
}

class PowerTable {
 public:
  // Of ξ^q, ξ^q w, ξ^q w², ξ^q F, ξ^q w F.
  enum Kind : std::size_t { plain, speed, speed_squared, force, power, kinds };

  void add(const Powers& p, const Sample& s, double weight) noexcept {
    const double w = weight * s.velocity;
    add_kind<plain>(p, weight);
    add_kind<speed>(p, w);
    add_kind<speed_squared>(p, w * s.velocity);
    add_kind<force>(p, weight * s.force);
    add_kind<power>(p, w * s.force);
  }

  double at(Kind kind, const Window& window) const noexcept {
    return window.of(sums_.data() + begins[kind], lowest[kind]);
  }

  double at_node(Kind kind, std::size_t node) const noexcept {
    return sums_[begins[kind] + node - lowest[kind]];
  }

  double weight() const noexcept { return at_node(plain, Grid::zero); }     // Σ 1
  double force_sum() const noexcept { return at_node(force, Grid::zero); }  // Σ F

  // How Σ ξ^q grows by the step at q.
  Growth growth(double q) const noexcept {
    const double place = Grid::place_of_power(q);
    const std::size_t node = place > 1.0 ? static_cast<std::size_t>(place) : 1;
    const std::size_t last = std::clamp(node, lowest[plain], Grid::powers - 2);
    const double ratio = at_node(plain, last + 1) / at_node(plain, last);
    const bool known = ratio > 1e-30 && ratio < 1e30;
    return known ? Growth::by(ratio) : Growth{};
  }

  void scale(double factor) noexcept {
    for (double& sum : sums_) sum *= factor;
  }

 private:
  // Nodes that some law asks for, each with a window about it: of ξ^q those of n and 2n, of ξ^q w
  // and ξ^q w² also of n − 1, 2n − 1 and 2n − 2; those with F of n, and with wF of n − 1 too.
  static constexpr std::array<std::size_t, kinds> lowest{2, 0, 0, 2, 0};
  static constexpr std::array<std::size_t, kinds> highest{32, 32, 32, 21, 21};
  static constexpr std::array<std::size_t, kinds + 1> begins = [] {
    std::array<std::size_t, kinds + 1> places{};
    for (std::size_t kind = 0; kind < kinds; ++kind) {
      places[kind + 1] = places[kind] + highest[kind] - lowest[kind] + 1;
    }
    return places;
  }();

  template <Kind kind>
  void add_kind(const Powers& p, double factor) noexcept {
    constexpr std::size_t count = begins[kind + 1] - begins[kind];
    for (std::size_t j = 0; j < count; ++j) sums_[begins[kind] + j] += factor * p[lowest[kind] + j];
  }

  std::array<double, begins[kinds]> sums_{};
};

}  // namespace palpate::viscoelastic
