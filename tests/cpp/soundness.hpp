// What no data may break: every number finite, every P symmetric and positive definite.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "check.hpp"
#include "palpate/palpate.hpp"

namespace palpate {

// By elimination with more digits than the recursion has.
template <std::size_t Size>
void check_positive_definite(const Matrix<Size>& matrix) {
  std::array<std::array<long double, Size>, Size> reduced{};
  for (std::size_t i = 0; i < Size; ++i) {
    for (std::size_t j = 0; j < Size; ++j) reduced[i][j] = matrix[i][j];
  }
  for (std::size_t k = 0; k < Size; ++k) {
    CHECK(reduced[k][k] > 0.0L);
    for (std::size_t i = k + 1; i < Size; ++i) {
      const long double ratio = reduced[k][i] / reduced[k][k];
      for (std::size_t j = i; j < Size; ++j) reduced[i][j] -= ratio * reduced[k][j];
    }
  }
}

template <std::size_t Order>
void check_sound(const LeastSquares<Order>& recursion) {
  for (const double theta : recursion.parameters()) CHECK(std::isfinite(theta));
  check_positive_definite(recursion.covariance());
  CHECK(std::isfinite(recursion.noise_variance()) && recursion.noise_variance() >= 0.0);
  for (std::size_t i = 0; i < Order; ++i) {
    for (std::size_t j = 0; j < Order; ++j) {
      CHECK(std::isfinite(recursion.covariance()[i][j]));
      CHECK(recursion.covariance()[i][j] == recursion.covariance()[j][i]);
    }
  }
}

template <class Regression>
void check_sound(const RegressionMethod<Regression>& method) {
  check_sound(method.least_squares());
}

inline void check_sound(const DoubleStageMethod& method) {
  check_sound(method.stage_one());
  check_sound(method.stage_two());
}

// The law's covariance is semidefinite by its form; variances below the normal range are lost.
template <std::size_t Size>
void check_covariance(const Matrix<Size>& covariance) {
  for (std::size_t i = 0; i < Size; ++i) {
    CHECK(std::isfinite(covariance[i][i]));
    CHECK(covariance[i][i] >= 0.0);
    for (std::size_t j = 0; j < i; ++j) {
      CHECK(covariance[i][j] == covariance[j][i]);
      const auto deviation = [&](std::size_t k) {
        return std::sqrt(std::max(covariance[k][k], std::numeric_limits<double>::min()));
      };
      const double bound = deviation(i) * deviation(j);
      CHECK(std::abs(covariance[i][j]) <= bound * (1.0 + 1e-14));
    }
  }
}

template <class Method, class Detector, class Rejection>
void check_sound(const RecursiveEstimator<Method, Detector, Rejection>& estimator) {
  check_sound(estimator.method());
  const auto now = estimator.estimate();
  for (const double parameter : now.parameters) CHECK(std::isfinite(parameter));
  CHECK(std::isfinite(now.validity_margin));
  CHECK(now.guarded <= now.samples);
  check_covariance(now.covariance);
  for (const double variance : estimator.snapshot().variances) CHECK(std::isfinite(variance));
}

}  // namespace palpate
