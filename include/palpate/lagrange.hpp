// Six-point Lagrange interpolation on an even grid: value, first and second derivative.
#pragma once

#include <array>
#include <cstddef>

#include "palpate/matrix.hpp"

namespace palpate {

struct LagrangeWeights {
  static constexpr std::size_t points = 6;
  Vector<points> value;
  Vector<points> first;   // per grid step
  Vector<points> second;  // per grid step squared
};

namespace detail {

// Coefficients of the six basis polynomials at the points 0 … 5, lowest power first.
constexpr std::array<Vector<6>, 6> lagrange_basis() noexcept {
  std::array<Vector<6>, 6> basis{};
  for (std::size_t i = 0; i < 6; ++i) {
    Vector<6> polynomial{1.0};
    std::size_t degree = 0;
    double scale = 1.0;
    for (std::size_t j = 0; j < 6; ++j) {
      if (j == i) continue;
      Vector<6> product{};
      for (std::size_t k = 0; k <= degree; ++k) {
        product[k + 1] += polynomial[k];
        product[k] -= static_cast<double>(j) * polynomial[k];
      }
      polynomial = product;
      ++degree;
      scale *= static_cast<double>(i) - static_cast<double>(j);
    }
    for (double& coefficient : polynomial) coefficient /= scale;
    basis[i] = polynomial;
  }
  return basis;
}

inline constexpr std::array<Vector<6>, 6> lagrange_coefficients = lagrange_basis();

}  // namespace detail

// Weights at t, in grid steps from the first of the six points; best for 2 ≤ t ≤ 3.
constexpr LagrangeWeights lagrange_weights(double t) noexcept {
  LagrangeWeights weights{};
  for (std::size_t i = 0; i < 6; ++i) {
    const Vector<6>& c = detail::lagrange_coefficients[i];
    weights.value[i] = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))));
    weights.first[i] =
        c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5])));
    weights.second[i] = 2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5]));
  }
  return weights;
}

}  // namespace palpate
