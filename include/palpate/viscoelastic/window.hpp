// Eight-point Lagrange interpolation on an even grid, of values that grow from node to node.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"

namespace palpate::viscoelastic {

inline constexpr std::size_t window_points = 8;

// Σ weights[i] values[first + i], i < count, is the value at the place that it was made for.
struct Window {
  std::size_t first;
  std::size_t count;
  Vector<window_points> weights;

  double of(const double* values) const noexcept {
    if (count == 1) return values[first];
    const double* v = values + first;
    return (weights[0] * v[0] + weights[1] * v[1]) + (weights[2] * v[2] + weights[3] * v[3]) +
           (weights[4] * v[4] + weights[5] * v[5]) + (weights[6] * v[6] + weights[7] * v[7]);
  }
};

// How values grow from node to node: e^rate, which a polynomial would follow badly.
struct Growth {
  double rate = 0.0;
  double back = 1.0;  // e^−rate

  static Growth of(double rate) noexcept { return {rate, std::exp(-rate)}; }
  Growth squared() const noexcept { return {2.0 * rate, back * back}; }
};

// The window around a position, in steps from the first of `nodes` nodes.
[[gnu::noinline]] inline Window window(double position, std::size_t nodes,
                                       const Growth& growth) noexcept {
  const double last = static_cast<double>(nodes - 1);
  const double place = std::clamp(position, 0.0, last);
  const double nearest = std::round(place);
  // At a node it is the node's own value: 1e-9 of a step moves no sum by more than rounding.
  if (std::abs(place - nearest) < 1e-9) return {static_cast<std::size_t>(nearest), 1, {1.0}};
  const double centred = std::floor(place) - 3.0;
  const std::size_t first =
      centred <= 0.0 ? 0 : std::min(static_cast<std::size_t>(centred), nodes - window_points);
  // Π (t − j)/(i − j) over j ≠ i, from products of what lies before and after i.
  constexpr Vector<window_points> denominators{-5040.0, 720.0, -240.0, 144.0,
                                               -144.0,  240.0, -720.0, 5040.0};
  const double t = place - static_cast<double>(first);
  Window result{first, window_points, {}};
  double before = growth.rate == 0.0 ? 1.0 : std::exp(growth.rate * t);
  for (std::size_t i = 0; i < window_points; ++i) {
    result.weights[i] = before / denominators[i];
    before *= (t - static_cast<double>(i)) * growth.back;
  }
  double after = 1.0;
  for (std::size_t i = window_points; i-- > 0;) {
    result.weights[i] *= after;
    after *= t - static_cast<double>(i);
  }
  return result;
}

}  // namespace palpate::viscoelastic
