// Eight-point Lagrange interpolation on an even grid, of values that grow from node to node.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"

namespace palpate::viscoelastic {

inline constexpr std::size_t window_points = 8;

// Σ weights[i] values[first + i], i < count, is the value at the place that it was made for.
struct Window {
  std::uint32_t first;
  std::uint32_t count;
  Vector<window_points> weights;

  // Of values from the node `origin` on.
  double of(const double* values, std::size_t origin = 0) const noexcept {
    const double* v = values + (first - origin);
    if (count == 1) return v[0];
    return (weights[0] * v[0] + weights[1] * v[1]) + (weights[2] * v[2] + weights[3] * v[3]) +
           (weights[4] * v[4] + weights[5] * v[5]) + (weights[6] * v[6] + weights[7] * v[7]);
  }
};

// How values grow from node to node: e^rate, which a polynomial would follow badly.
struct Growth {
  double rate = 0.0;
  double ahead = 1.0;  // e^rate
  double back = 1.0;   // e^−rate

  static Growth by(double ratio) noexcept { return {std::log(ratio), ratio, 1.0 / ratio}; }
};

// Π (t − j)/(i − j) over j ≠ i, for each of the points i = 0 … 7.
inline Vector<window_points> lagrange_weights(double t) noexcept {
  Vector<window_points> d;
  for (std::size_t i = 0; i < window_points; ++i) d[i] = t - static_cast<double>(i);
  const double a = d[0] * d[1], b = d[2] * d[3], c = d[4] * d[5], e = d[6] * d[7];
  const double low = a * b, high = c * e;
  return {d[1] * b * high * (-1.0 / 5040.0), d[0] * b * high * (1.0 / 720.0),
          a * d[3] * high * (-1.0 / 240.0),  a * d[2] * high * (1.0 / 144.0),
          low * d[5] * e * (-1.0 / 144.0),   low * d[4] * e * (1.0 / 240.0),
          low * c * d[7] * (-1.0 / 720.0),   low * c * d[6] * (1.0 / 5040.0)};
}

// The windows about a position, in steps of a grid, and about those that are whole steps from it.
class Interpolation {
 public:
  explicit Interpolation(double position, const Growth& growth = {}) noexcept : growth_(growth) {
    // Not a number is as good as none.
    const double place = position > 0.0 ? std::min(position, 1e6) : 0.0;
    const double nearest = std::round(place);
    // At a node it is the node's own value: 1e-9 of a step moves no sum by more than rounding.
    exact_ = std::abs(place - nearest) < 1e-9;
    const double node = exact_ ? nearest : std::floor(place);
    node_ = static_cast<std::size_t>(node);
    if (exact_) return;
    fraction_ = place - node;
    grown_ = growth.rate == 0.0 ? 1.0 : std::exp(growth.rate * fraction_);
    centred_ = weights(centre, grown_, growth_);
  }

  // `lower` nodes below the position, on a grid of so many; beyond its ends the end itself.
  Window at(std::size_t lower, std::size_t nodes) const noexcept {
    return at(lower, nodes, grown_, growth_);
  }

  // The same for values that grow as the squares do.
  Window square_at(std::size_t lower, std::size_t nodes) const noexcept {
    const Growth& g = growth_;
    return at(lower, nodes, grown_ * grown_, {2.0 * g.rate, g.ahead * g.ahead, g.back * g.back});
  }

 private:
  static constexpr std::size_t centre = 3;  // points before the position

  Window at(std::size_t lower, std::size_t nodes, double grown,
            const Growth& growth) const noexcept {
    const std::size_t node = node_ > lower ? node_ - lower : 0;
    if (exact_ || node_ < lower || node + 1 >= nodes) {
      return {static_cast<std::uint32_t>(std::min(node, nodes - 1)), 1, {1.0}};
    }
    const std::size_t first = node < centre ? 0 : std::min(node - centre, nodes - window_points);
    const bool known = node - first == centre && growth.rate == growth_.rate;
    return {static_cast<std::uint32_t>(first), window_points,
            known ? centred_ : weights(node - first, grown, growth)};
  }

  // With the position between the points `before` and `before` + 1.
  Vector<window_points> weights(std::size_t before, double grown,
                                const Growth& growth) const noexcept {
    Vector<window_points> result = lagrange_weights(static_cast<double>(before) + fraction_);
    if (growth.rate == 0.0) return result;
    double factor = grown;
    for (std::size_t i = before; i < window_points; ++i, factor *= growth.back) {
      result[i] *= factor;
    }
    factor = grown * growth.ahead;
    for (std::size_t i = before; i-- > 0; factor *= growth.ahead) result[i] *= factor;
    return result;
  }

  Growth growth_;
  std::size_t node_ = 0;  // at or below the position
  double fraction_ = 0.0;
  double grown_ = 1.0;  // e^(rate · fraction)
  bool exact_ = false;
  Vector<window_points> centred_{};
};

// Around a position alone, of values that do not grow.
inline Window window(double position, std::size_t nodes) noexcept {
  return Interpolation(position).at(0, nodes);
}

}  // namespace palpate::viscoelastic
