// Eight-point Lagrange interpolation on an even grid, of values that grow from node to node.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"

namespace palpate::viscoelastic {

inline constexpr std::size_t window_points = 8;

// Σ weights[i] values[first + i] is the value at the place that it was made for.
struct Window {
  std::size_t first;
  Vector<window_points> weights;

  // Of values from the node `origin` on.
  double of(const double* values, std::size_t origin = 0) const noexcept {
    const double* v = values + (first - origin);
    // Even and odd ones apart, so that two are added at once.
    double even = weights[0] * v[0], odd = weights[1] * v[1];
    for (std::size_t i = 2; i < window_points; i += 2) {
      even += weights[i] * v[i];
      odd += weights[i + 1] * v[i + 1];
    }
    return even + odd;
  }
};

// How values grow from node to node: e^rate, which a polynomial would follow badly.
struct Growth {
  double ahead = 1.0;  // e^rate
  double back = 1.0;   // e^−rate
  double rate = 0.0;

  static Growth by(double ratio) noexcept { return {ratio, 1.0 / ratio, std::log(ratio)}; }
};

// With a position a fraction beyond the point `before`: for each point i the product of
// (t − j)/(i − j) over j ≠ i, and by how much more than there values are at the position,
// e^(rate (t − i)). `grown` is e^(rate fraction).
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

// A position in steps of a grid: the node at or below it, and what lies between.
struct GridPosition {
  std::size_t node;
  double fraction;
  bool exact;  // a node: its own value counts. 1e-9 of a step moves no sum by more than rounding

  explicit GridPosition(double position) noexcept {
    // Not a number is as good as none.
    const double place = position > 0.0 ? std::min(position, 1e6) : 0.0;
    node = static_cast<std::size_t>(place + 1e-9);
    fraction = place - static_cast<double>(node);
    exact = fraction < 1e-9;
  }

  // The same `lower` nodes further down, on a grid of so many; beyond its ends the end itself.
  GridPosition below(std::size_t lower, std::size_t nodes) const noexcept {
    GridPosition result = *this;
    result.node = std::min(node > lower ? node - lower : 0, nodes - 1);
    result.exact = exact || node < lower || result.node == nodes - 1;
    return result;
  }

  // The first point of a window.
  std::size_t first(std::size_t nodes) const noexcept {
    return node < centre ? 0 : std::min(node - centre, nodes - window_points);
  }

  static constexpr std::size_t centre = 3;  // points before a position
};

inline constexpr Matrix<window_points> one_point =
    diagonal(Vector<window_points>{1, 1, 1, 1, 1, 1, 1, 1});

// Around a position alone, of values that do not grow.
inline Window window(double position, std::size_t nodes) noexcept {
  const GridPosition at = GridPosition(position).below(0, nodes);
  const std::size_t first = at.first(nodes);
  if (at.exact) return {first, one_point[at.node - first]};
  return {first, window_weights(at.node - first, at.fraction, 1.0, {})};
}

// The windows about a position, and about those that are whole steps below it.
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
    if (at.exact) return {first, one_point[at.node - first]};
    if (at.node - first == GridPosition::centre) return {first, centred_};
    return {first, window_weights(at.node - first, at.fraction, grown_, growth_)};
  }

  // The same for values that grow as the squares do.
  Window square_at(std::size_t lower, std::size_t nodes) const noexcept {
    const GridPosition at = position_.below(lower, nodes);
    const std::size_t first = at.first(nodes);
    if (at.exact) return {first, one_point[at.node - first]};
    const Growth twice{growth_.ahead * growth_.ahead, growth_.back * growth_.back, 0.0};
    return {first, window_weights(at.node - first, at.fraction, grown_ * grown_, twice)};
  }

 private:
  GridPosition position_;
  Growth growth_;
  double grown_ = 1.0;
  Vector<window_points> centred_{};
};

}  // namespace palpate::viscoelastic
