// Sums over samples of ξ^q on a grid of q. One table serves every exponent n and damping exponent
// p. Between the nodes of the grid eight-point Lagrange interpolation applies, to values that are
// rescaled by their growth from node to node.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"

namespace palpate::viscoelastic {

inline constexpr std::size_t window_points = 8;

// Interpolation weights: Σ weights[i] values[first + i] is the value at the position of this
// window.
struct Window {
  std::size_t first;
  Vector<window_points> weights;

  // Interpolates `values`, whose first element belongs to the node `origin`.
  double of(const double* values, std::size_t origin = 0) const noexcept {
    const double* v = values + (first - origin);
    // Separate sums of even and odd terms let the processor add two at the same time.
    double even = weights[0] * v[0], odd = weights[1] * v[1];
    for (std::size_t i = 2; i < window_points; i += 2) {
      even += weights[i] * v[i];
      odd += weights[i + 1] * v[i + 1];
    }
    return even + odd;
  }
};

// The growth factor e^rate of values from node to node. A polynomial alone would follow such growth
// badly.
struct Growth {
  double ahead = 1.0;  // e^rate
  double back = 1.0;   // e^−rate
  double rate = 0.0;

  static Growth by(double ratio) noexcept { return {ratio, 1.0 / ratio, std::log(ratio)}; }
};

// Interpolation weights at a position a fraction beyond the point `before`. For each point i the
// weight is the product of (t − j)/(i − j) over j ≠ i, times the growth from the point to the
// position, e^(rate (t − i)). `grown` is e^(rate fraction).
inline Vector<window_points> window_weights(std::size_t before, double fraction, double grown,
                                            const Growth& growth) noexcept {
  constexpr Vector<window_points> per_denominator{-1.0 / 5040.0, 1.0 / 720.0,  -1.0 / 240.0,
                                                  1.0 / 144.0,   -1.0 / 144.0, 1.0 / 240.0,
                                                  -1.0 / 720.0,  1.0 / 5040.0};
  Vector<window_points> away;
  for (std::size_t i = 0; i < window_points; ++i) {
    away[i] = static_cast<double>(before) + fraction - static_cast<double>(i);
  }
  double first = grown;
  for (std::size_t i = 0; i < before; ++i) first *= growth.ahead;
  const double second = first * growth.back, back = growth.back * growth.back;
  const double a = away[0] * away[1], b = away[2] * away[3];
  const double c = away[4] * away[5], d = away[6] * away[7];
  Vector<window_points / 2> others{b * (c * d), a * (c * d), (a * b) * d, (a * b) * c};
  double shrunk = 1.0;
  for (double& other : others) {
    other *= shrunk;
    shrunk *= back;
  }
  Vector<window_points> result;
  for (std::size_t i = 0; i < window_points; i += 2) {
    const double other = others[i / 2];
    result[i] = away[i + 1] * other * (first * per_denominator[i]);
    result[i + 1] = away[i] * other * (second * per_denominator[i + 1]);
  }
  return result;
}

// A position on a grid, in steps: the node at or below it, and the fraction of a step beyond it.
struct GridPosition {
  std::size_t node;
  double fraction;
  bool exact;  // at a node, whose value is used: 1e-9 of a step is below rounding

  explicit GridPosition(double position) noexcept {
    // NaN counts as 0.
    const double place = position > 0.0 ? std::min(position, 1e6) : 0.0;
    node = static_cast<std::size_t>(place + 1e-9);
    fraction = place - static_cast<double>(node);
    exact = fraction < 1e-9;
  }

  // The position `lower` nodes further down on a grid of `nodes` nodes, clamped to the ends of the
  // grid.
  GridPosition below(std::size_t lower, std::size_t nodes) const noexcept {
    GridPosition result = *this;
    result.node = std::min(node > lower ? node - lower : 0, nodes - 1);
    result.exact = exact || node < lower || result.node == nodes - 1;
    return result;
  }

  // The first point of the window around this position.
  std::size_t first(std::size_t nodes) const noexcept {
    return node < centre ? 0 : std::min(node - centre, nodes - window_points);
  }

  static constexpr std::size_t centre = 3;  // points before a position
};

// The window around a position on the grid.
inline Window window_at(const GridPosition& at, std::size_t nodes, double grown,
                        const Growth& growth) noexcept {
  Window window{at.first(nodes), {}};
  const std::size_t before = at.node - window.first;
  if (at.exact) {
    window.weights[before] = 1.0;
  } else {
    window.weights = window_weights(before, at.fraction, grown, growth);
  }
  return window;
}

// The window for values that do not grow.
inline Window window(double position, std::size_t nodes) noexcept {
  return window_at(GridPosition(position).below(0, nodes), nodes, 1.0, {});
}

// The windows around a position, and around positions that are whole steps below it.
class Interpolation {
 public:
  Interpolation(double position, const Growth& growth) noexcept
      : position_(position), growth_(growth) {
    if (position_.exact) return;
    grown_ = std::exp(growth.rate * position_.fraction);
    centred_ = window_weights(GridPosition::centre, position_.fraction, grown_, growth);
  }

  Window at(std::size_t lower, std::size_t nodes) const noexcept {
    const GridPosition at = position_.below(lower, nodes);
    const std::size_t first = at.first(nodes);
    if (!at.exact && at.node - first == GridPosition::centre) return {first, centred_};
    return window_at(at, nodes, grown_, growth_);
  }

  // The same window for values that grow as the squares do.
  Window square_at(std::size_t lower, std::size_t nodes) const noexcept {
    const Growth twice{growth_.ahead * growth_.ahead, growth_.back * growth_.back, 0.0};
    return window_at(position_.below(lower, nodes), nodes, grown_ * grown_, twice);
  }

 private:
  GridPosition position_;
  Growth growth_;
  double grown_ = 1.0;
  Vector<window_points> centred_{};
};

// The grid of powers q, and the grid of exponents n, which is part of it.
struct Grid {
  static constexpr double lowest_power = -1.0;  // q: 2p of n = 0.5, p = n − 1
  static constexpr double step = 0.25;
  static constexpr std::size_t powers = 33;  // up to 7: twice the exponent 3.25, plus half a window
  static constexpr double lowest_exponent = 0.5;
  static constexpr double highest_exponent = 3.25;
  static constexpr std::size_t exponents = 12;
  static constexpr std::size_t first_exponent = 6;  // index of the lowest exponent among the powers
  static constexpr std::size_t zero = 4;            // index of q = 0
  static constexpr std::size_t one = 4;             // nodes from q to q + 1

  static constexpr double exponent_at(double place) noexcept {
    return lowest_exponent + step * place;
  }
  static constexpr double place_of_power(double q) noexcept { return (q - lowest_power) / step; }
  static constexpr double place_of_exponent(double n) noexcept {
    return (n - lowest_exponent) / step;
  }
};

// ξ^q at the nodes of the grid, and at three nodes beyond.
using Powers = std::array<double, Grid::powers + 3>;
// One number for each exponent of the grid.
using NodeRow = std::array<double, Grid::exponents>;

// Fills the powers from `begin` on: each is ξ times the power that is one unit of q lower.
template <std::size_t Size>
void raise(std::array<double, Size>& powers, std::size_t begin, double depth) noexcept {
  for (std::size_t j = begin; j < Size; ++j) powers[j] = powers[j - Grid::one] * depth;
}

inline Powers powers_of(double depth) noexcept {
  // The steps are a quarter: two square roots replace an exponential.
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

// ξⁿ at the exponents of the grid; 0 at depth 0.
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
  // Sums of ξ^q, ξ^q w, ξ^q w², ξ^q F, ξ^q w F.
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

  // The growth of Σ ξ^q per step at q.
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
  // The range of nodes that the laws need, with a window around each. Sums of ξ^q are needed at n
  // and 2n; those of ξ^q w and ξ^q w² also at n − 1, 2n − 1 and 2n − 2; those with F at n, and
  // those with wF also at n − 1.
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
