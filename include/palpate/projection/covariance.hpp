// What the samples say of (k, c, n, F₀): JᵀJ, and the covariance from it and the priors.
#pragma once

#include <algorithm>
#include <cmath>

#include "palpate/matrix.hpp"
#include "palpate/projection/linear_solve.hpp"

namespace palpate::detail {

// A solution for one exponent, with the sums that it comes from.
struct ProjectionPoint {
  double n;
  PowerSums::Local sums;
  LinearSolution linear;
};

// JᵀJ, from the sums and their derivatives: Σ ln ξ · p² = (Σ p²)'/2, and so on.
inline Matrix<4> information(const ProjectionProblem& problem, const ProjectionPoint& point,
                             double variance) noexcept {
  const PowerSums::Values &v = point.sums.value, &d = point.sums.first;
  const Vector<3>& dd = point.sums.second;
  const double k = point.linear.k, c = point.linear.c;
  Matrix<4> m{};
  m[0] = {v[pp], v[ppw], 0.5 * (k * d[pp] + c * d[ppw]), v[p1]};
  m[1] = {v[ppw], v[ppww], 0.5 * (k * d[ppw] + c * d[ppww]), v[pw]};
  m[2] = {m[0][2], m[1][2], 0.25 * (k * k * dd[pp] + 2.0 * k * c * dd[ppw] + c * c * dd[ppww]),
          k * d[p1] + c * d[pw]};
  m[3] = {v[p1], v[pw], m[2][3], problem.sums.weight() + problem.offset_weight(variance)};
  return m;
}

// R, R Rᵀ being the covariance of (k, c, n, F₀). The error bars take the priors in with the
// variance that they scale by, so that what is not identifiable from the motion is as uncertain as
// it was before, whatever the noise.
inline InverseRoot<4> covariance_root(const ProjectionProblem& problem,
                                      const ProjectionPoint& point, double variance) noexcept {
  const double prior = problem.settings.prior_dissipation;
  const double weight = problem.damping_weight(point.linear.k, variance);
  const double exponent_weight = problem.exponent_weight(variance);
  Matrix<4> m = information(problem, point, variance);
  m[0][0] += weight * prior * prior;
  m[0][1] = m[1][0] = m[0][1] - weight * prior;
  m[1][1] += weight;
  m[2][2] += exponent_weight;
  // What is known, or not there, is apart from the rest.
  const auto part = [&](std::size_t known) noexcept {
    for (std::size_t i = 0; i < 4; ++i) {
      if (i != known) m[i][known] = m[known][i] = 0.0;
    }
  };
  if (!problem.settings.offset) part(3);
  if (problem.exponent_known()) part(2);
  constexpr double unknown_stiffness = 1e-12;  // k ~ N(0, 1e6²): nothing is known of it
  Vector<4> priors{unknown_stiffness * variance, weight, exponent_weight,
                   problem.offset_weight(variance)};
  // Scaled to a unit diagonal, so that the inverse does not overflow.
  Vector<4> unit{};
  for (std::size_t i = 0; i < 4; ++i) {
    unit[i] = m[i][i] > 0.0 ? 1.0 / std::sqrt(m[i][i]) : 1.0;
    priors[i] = std::max(priors[i] * unit[i] * unit[i], tiny);
  }
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) m[i][j] = m[i][j] * unit[i] * unit[j];
  }
  InverseRoot<4> inverse = guarded_inverse_root(m, priors);
  const double deviation = std::sqrt(variance);
  for (std::size_t i = 0; i < 4; ++i) {
    for (double& entry : inverse.root[i]) entry = saturate(entry * (unit[i] * deviation));
  }
  if (!problem.settings.offset) inverse.root[3] = {};
  if (problem.exponent_known()) inverse.root[2] = {};
  return inverse;
}

}  // namespace palpate::detail
