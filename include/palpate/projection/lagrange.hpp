// Ten-point Lagrange interpolation on an even grid: value, first and second derivative.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"

namespace palpate::detail {

// Even, so that the point lies in the middle interval. At steps of 0.1 and 0.005 N of noise eight
// leave up to 0.01 standard errors where the depth varies by a factor of 3 and 1 where it varies by
// 30; ten leave 0.002 and 0.07.
inline constexpr std::size_t lagrange_points = 10;

struct LagrangeWeights {
  static constexpr std::size_t points = lagrange_points;
  Vector<points> value;
  Vector<points> first;   // per grid step
  Vector<points> second;  // per grid step squared
};

// Polynomials are written about the middle of the points, where they are evaluated: about the first
// one, terms of 1e5 would cancel and leave 3e-11 of a sum.
inline constexpr double lagrange_middle = 0.5 * static_cast<double>(lagrange_points - 1);

// [k][i]: the coefficient of (t − middle)ᵏ in the basis polynomial of point i = 0, 1, 2 ….
constexpr Matrix<lagrange_points> lagrange_basis() noexcept {
  Matrix<lagrange_points> basis{};
  for (std::size_t i = 0; i < lagrange_points; ++i) {
    Vector<lagrange_points> polynomial{1.0};
    std::size_t degree = 0;
    double scale = 1.0;
    for (std::size_t j = 0; j < lagrange_points; ++j) {
      if (j == i) continue;
      Vector<lagrange_points> product{};
      for (std::size_t k = 0; k <= degree; ++k) {
        product[k + 1] += polynomial[k];
        product[k] -= (static_cast<double>(j) - lagrange_middle) * polynomial[k];
      }
      polynomial = product;
      ++degree;
      scale *= static_cast<double>(i) - static_cast<double>(j);
    }
    for (std::size_t k = 0; k < lagrange_points; ++k) basis[k][i] = polynomial[k] / scale;
  }
  return basis;
}

inline constexpr Matrix<lagrange_points> lagrange_coefficients = lagrange_basis();

// Weights at t, in grid steps from the first of the points; best about the middle.
constexpr LagrangeWeights lagrange_weights(double t) noexcept {
  // Horner's scheme for the polynomials and their derivatives at once, all points abreast.
  const double u = t - lagrange_middle;
  LagrangeWeights weights{lagrange_coefficients[lagrange_points - 1], {}, {}};
  for (std::size_t k = lagrange_points - 1; k-- > 0;) {
    const Vector<lagrange_points>& c = lagrange_coefficients[k];
    for (std::size_t i = 0; i < lagrange_points; ++i) {
      weights.second[i] = weights.second[i] * u + 2.0 * weights.first[i];
      weights.first[i] = weights.first[i] * u + weights.value[i];
      weights.value[i] = weights.value[i] * u + c[i];
    }
  }
  return weights;
}

// Weights for values that grow by about e^rate a step, exponentially rescaled: those of
// S e^(−rate t), which hardly grows, put back to S. Value, first and second derivative of S at t.
inline LagrangeWeights rescaled(const LagrangeWeights& level, double t, double rate) noexcept {
  LagrangeWeights weights;
  double growth = std::exp(rate * t);  // from point i to t
  const double back = std::exp(-rate);
  for (std::size_t i = 0; i < lagrange_points; ++i) {
    const double value = level.value[i], first = level.first[i];
    weights.value[i] = value * growth;
    weights.first[i] = (first + rate * value) * growth;
    weights.second[i] = (level.second[i] + rate * (2.0 * first + rate * value)) * growth;
    growth *= back;
  }
  return weights;
}

}  // namespace palpate::detail
