// What samples and priors say of (k, c, n, F₀, d): JᵀJ, the covariance from it, what widens that
// where errors are no white noise, what it leaves open, and all of it in SI.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "palpate/error_widening.hpp"
#include "palpate/estimate.hpp"
#include "palpate/matrix.hpp"
#include "palpate/projection/priors.hpp"
#include "palpate/sample.hpp"

namespace palpate::detail {

// A solution for one exponent, with the sums that it comes from.
struct ProjectionPoint {
  double n;
  PowerSums::Local sums;
  LinearSolution linear;
};

// JᵀJ by the sums and their derivatives: Σ ln ξ · p² = (Σ p²)'/2, and so on; none of a surface.
inline Matrix<5> information(const ProjectionProblem& problem,
                             const ProjectionPoint& point) noexcept {
  const PowerSums::Values &v = point.sums.value, &d = point.sums.first;
  const Vector<3>& dd = point.sums.second;
  const double k = point.linear.k, c = point.linear.c;
  Matrix<5> m{};
  m[0] = {v[pp], v[ppw], 0.5 * (k * d[pp] + c * d[ppw]), v[p1]};
  m[1] = {v[ppw], v[ppww], 0.5 * (k * d[ppw] + c * d[ppww]), v[pw]};
  m[2] = {m[0][2], m[1][2], 0.25 * (k * k * dd[pp] + 2.0 * k * c * dd[ppw] + c * c * dd[ppww]),
          k * d[p1] + c * d[pw]};
  m[3] = {v[p1], v[pw], m[2][3], problem.sums.weight()};
  return m;
}

// The samples' JᵀJ at a stiffness k, with what priors add to it. The error bars take the priors in
// with the variance that they scale by, so that what is not identifiable from the motion is as
// uncertain as it was before, whatever the noise. `surface_range` is 0 where the surface is known.
class Information {
 public:
  Information(const Matrix<5>& samples, const Priors& priors, double k, double variance,
              double surface_range) noexcept
      : samples_(samples),
        ratio_(priors.settings.prior_dissipation),
        variance_(variance),
        open_{true, true, !priors.exponent_known(), priors.settings.offset, surface_range > 0.0} {
    constexpr double unknown_stiffness = 1e-12;  // k ~ N(0, 1e6²): nothing is known of it
    prior_ = {unknown_stiffness * variance, priors.damping_weight(k, variance),
              priors.exponent_weight(variance), priors.offset_weight(variance),
              open_[4] ? variance / (surface_range * surface_range) : 1.0};
  }

  // R, R Rᵀ being the covariance.
  InverseRoot<5> covariance_root() const noexcept {
    Matrix<5> m = samples_;
    m[0][0] += prior_[1] * ratio_ * ratio_;
    m[0][1] = m[1][0] = m[0][1] - prior_[1] * ratio_;
    m[1][1] += prior_[1];
    // What is known, or not there, is apart from the rest.
    for (std::size_t i = 2; i < 5; ++i) {
      m[i][i] += prior_[i];
      for (std::size_t j = 0; j < 5; ++j) {
        if (!open_[i] && i != j) m[i][j] = m[j][i] = 0.0;
      }
    }
    // Scaled to a unit diagonal, so that the inverse does not overflow.
    Vector<5> unit{}, priors = prior_;
    for (std::size_t i = 0; i < 5; ++i) {
      unit[i] = m[i][i] > 0.0 ? 1.0 / std::sqrt(m[i][i]) : 1.0;
      priors[i] = std::max(priors[i] * unit[i] * unit[i], tiny);
    }
    for (std::size_t i = 0; i < 5; ++i) {
      for (std::size_t j = 0; j < 5; ++j) m[i][j] = m[i][j] * unit[i] * unit[j];
    }
    InverseRoot<5> inverse = guarded_inverse_root(m, priors);
    const double deviation = std::sqrt(variance_);
    for (std::size_t i = 0; i < 5; ++i) {
      for (double& entry : inverse.root[i]) entry = saturate(entry * (unit[i] * deviation));
      if (!open_[i]) inverse.root[i] = {};
    }
    return inverse;
  }

  // What the priors of (k, c, n, F₀) weigh, over what the samples do. What is not fitted is known.
  Vector<4> prior_fractions() const noexcept {
    Vector<4> result{};
    for (std::size_t i = 1; i < 4; ++i) {
      const double fraction = prior_[i] / (samples_[i][i] + tiny);
      result[i] = open_[i] ? std::clamp(fraction, 0.0, largest_parameter) : largest_parameter;
    }
    return result;
  }

 private:
  const Matrix<5>& samples_;
  double ratio_;
  double variance_;
  std::array<bool, 5> open_;
  Vector<5> prior_{};
};

// Which of c and n the samples tell apart, but for rounding; `depth_spread` is that of ln ξ.
inline void say_identifiable(ProjectionSolution& p, const std::array<bool, 5>& guarded,
                             const Priors& priors, double depth_spread) noexcept {
  constexpr double smallest_spread = 1e-4;  // 1 µm at 10 mm, beyond any sensor
  p.damping_identifiable = !guarded[1];
  p.exponent_identifiable =
      priors.exponent_known() || (!guarded[2] && !guarded[3] && depth_spread > smallest_spread);
}

// What widens the root of a solution's covariance, as the levels of its errors tell: by how sure K,
// B and n are, in SI but for their units. The surface, whose slope is not kept, is as much wider as
// the widest of the others.
[[gnu::noinline]] inline Matrix<5> projection_widening(const HaarLevels<4>& levels,
                                                       const Vector<4>& prior_fractions,
                                                       const ProjectionSolution& p,
                                                       double log_penetration,
                                                       bool of_all_samples = false) noexcept {
  std::array<Vector<4>, 3> rows{};
  for (std::size_t j = 0; j < 4; ++j) {
    rows[0][j] = p.root[0][j] - p.k * log_penetration * p.root[2][j];
    rows[1][j] = p.root[1][j] - p.c * log_penetration * p.root[2][j];
    rows[2][j] = p.root[2][j];
  }
  const Matrix<4> root =
      ErrorWidening<4, 3>(levels, prior_fractions, p.root_variance, of_all_samples).root(rows);
  Matrix<5> widening{};
  double widest = 1.0;
  for (std::size_t i = 0; i < 4; ++i) {
    std::copy_n(root[i].begin(), 4, widening[i].begin());
    widest = std::max(widest, dot(root[i], root[i]));
  }
  widening[4][4] = std::sqrt(widest);
  return widening;
}

// What a solution leaves open, by the root of the covariance that is printed.
inline std::uint8_t open_flags(const ProjectionSolution& p, const Matrix<5>& root) noexcept {
  const double exponent = std::sqrt(dot(root[2], root[2]));
  const double damping = std::sqrt(dot(root[1], root[1]));
  std::uint8_t found = p.at_edge ? exponent_at_edge : 0;
  if (!(exponent < largest_exponent_error) || !p.exponent_identifiable) {
    found |= exponent_not_identifiable;
  }
  if (!(damping < largest_damping_error * std::abs(p.k)) || !p.damping_identifiable) {
    found |= damping_not_identifiable;
  }
  if (!p.surface_found) found |= surface_at_edge;
  if (p.tare_refuted) found |= tare_refuted;
  return found;
}

// K = k F₀ x_r⁻ⁿ, B = (c/V) F₀ x_r⁻ⁿ.
inline HuntCrossley law_in_si(const ProjectionSolution& p, const Units& u) noexcept {
  const double unit = u.force * bounded_exp(-p.n * u.log_penetration);
  return {saturate(p.k * unit), saturate(p.c * unit / u.velocity), p.n};
}

// The root of the covariance of (K, B, n, F₀, d) in SI, from that of (k, c, n, F₀, d) in scaled
// units: dK = U (dk − k ln x_r dn), dB = (U/V) (dc − c ln x_r dn), at U = F_s x_r⁻ⁿ.
inline Matrix<5> root_in_si(const Matrix<5>& root, const HuntCrossley& law,
                            const Units& u) noexcept {
  const double unit = saturate(u.force * bounded_exp(-law.exponent * u.log_penetration));
  const double damping_unit = saturate(unit / u.velocity);
  const double by_stiffness = saturate(-law.stiffness * u.log_penetration);
  const double by_damping = saturate(-law.damping * u.log_penetration);
  Matrix<5> result{};
  for (std::size_t j = 0; j < 5; ++j) {
    result[0][j] = unit * root[0][j] + by_stiffness * root[2][j];
    result[1][j] = damping_unit * root[1][j] + by_damping * root[2][j];
    result[2][j] = root[2][j];
    result[3][j] = u.force * root[3][j];
    result[4][j] = u.penetration * root[4][j];
  }
  return result;
}

inline Matrix<5> covariance_in_si(const Matrix<5>& root, const HuntCrossley& law,
                                  const Units& u) noexcept {
  Matrix<5> joint = squared(root_in_si(root, law, u));
  bound_variances(joint, largest_variance);
  return joint;
}

}  // namespace palpate::detail
