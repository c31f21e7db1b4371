// The settings of variable projection and the weights of its weak priors; the linear part by least
// squares; and the information on (k, c, n, F₀, d): JᵀJ, the covariance, its widening for errors
// that are not white noise, the identifiability flags, and the conversion to SI.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "palpate/error_widening.hpp"
#include "palpate/estimate.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/matrix.hpp"
#include "palpate/projection/contact_samples.hpp"
#include "palpate/projection/power_sums.hpp"
#include "palpate/sample.hpp"

namespace palpate {

struct ProjectionSettings {
  double noise = 0.0;  // standard deviation of the force in scaled units; 0: from the residual
  // Below a third the law is nearly a step; 3.6 is 33 steps of 0.1 above, well beyond the cone's 2.
  double lowest_exponent = 0.3;
  double highest_exponent = 3.6;
  double exponent = 0.0;  // known n, for a tip of known shape; 0: estimated
  bool offset = true;
  double offset_deviation = 0.0;  // of the prior F₀ ~ N(0, ·²) after a tare; 0: no tare
  // Standard deviation of the surface position, in scaled units. A wrong surface looks like an
  // offset (times the unit of force over that of penetration), so no offset prior is tighter than
  // this.
  double surface_deviation = 0.0;
  // Weak priors: n ~ N(1.3, 1), between a spring and a cone; c/k ~ N(0, 1), where 1 means that the
  // damping force at the reference speed is as large as the elastic force.
  double prior_exponent = 1.3;
  double prior_exponent_deviation = 1.0;
  double prior_dissipation = 0.0;  // c/k
  double prior_dissipation_deviation = 1.0;

  bool operator==(const ProjectionSettings&) const = default;
};

constexpr const char* validate(const ProjectionSettings& s) noexcept {
  using detail::lies_in;
  return detail::first_fault({
      {lies_in(s.noise, 0.0, 1e60), "method.noise must be in [0, 1e60] units of force"},
      {lies_in(s.offset_deviation, 0.0, 1e60),
       "method.offset_deviation must be in [0, 1e60] units of force"},
      {lies_in(s.surface_deviation, 0.0, 1e60),
       "method.surface_deviation must be in [0, 1e60] units of penetration"},
      {s.lowest_exponent >= 0.1 && s.highest_exponent <= 10.0,
       "method.lowest_exponent and highest_exponent must be in [0.1, 10]"},
      {s.exponent == 0.0 || lies_in(s.exponent, 0.1, 10.0),
       "method.exponent must be in [0.1, 10], or 0 if it is not known"},
      // The sums are interpolated to 1e-7 up to steps of 0.15; at steps below 0.006 rounding
      // dominates their differences.
      {lies_in(s.highest_exponent - s.lowest_exponent, 0.2, 5.0),
       "method.highest_exponent must be 0.2 to 5 above lowest_exponent"},
      {s.prior_exponent_deviation > 0.0 && s.prior_dissipation_deviation > 0.0,
       "method.prior deviations must be > 0"},
      {lies_in(s.prior_exponent, -1e3, 1e3) && lies_in(s.prior_dissipation, -1e60, 1e60),
       "method.prior values must be finite and small: an exponent, and c/k"},
  });
}

namespace detail {

// F = k (ξ − d)ⁿ (1 + c/k w) + F₀ in scaled units.
struct ScaledLaw {
  double k, c, offset, n, surface;

  double force(const Sample& s) const noexcept {
    const double depth = s.penetration - surface;
    const double power = depth > 0.0 ? std::pow(depth, n) : 0.0;
    return power * (k + c * s.velocity) + offset;
  }
};

struct ProjectionSolution : ScaledLaw {
  double noise_variance;  // of the force
  double prior_variance;  // the same, as used to weight the priors
  double root_variance;   // the same, as used in the root below, with its lower bound
  Matrix<5> root;   // R Rᵀ is the covariance of (k, c, n, offset, surface) for white residuals
  double cost;      // J: the weighted residual sum less Σ F², with the priors
  double residual;  // the weighted residual sum
  bool damping_identifiable;   // false if v carries no information beyond ξ
  bool exponent_identifiable;  // false if the depth hardly varies
  bool at_edge;                // the exponent is at the edge of its range
  bool surface_found;          // false if the estimated surface is at the edge of its range
  bool lost_above;             // contact is lost above the surface: light samples are excluded
  bool tare_refuted;           // F₀ is beyond the prior that a tare gave
  double prior_mean;           // of the prior of F₀ that was used …
  double prior_deviation;      // … and the deviation by which it was weighed
  double inflation = 1.0;      // f: its variance is f times that; f samples in contact count as one
};

// Added to a denominator to keep it above zero; it changes no sum of squares.
inline constexpr double tiny = 1e-300;

// Empty sums over the grid of exponents, or for the known exponent.
inline PowerSums empty_sums(const ProjectionSettings& settings) noexcept {
  if (settings.exponent > 0.0) return {settings.exponent, settings.exponent};
  return {settings.lowest_exponent, settings.highest_exponent};
}

// Replaces the weak priors of exponent and dissipation by an old solution with these deviations.
inline void centre_priors(ProjectionSettings& settings, const ProjectionSolution& old,
                          double exponent_deviation, double dissipation_deviation) noexcept {
  settings.prior_exponent = old.n;
  settings.prior_exponent_deviation = exponent_deviation;
  settings.prior_dissipation = old.k > 0.0 ? old.c / old.k : 0.0;
  settings.prior_dissipation_deviation = dissipation_deviation;
}

// The rms of the offset in an old solution: √(F₀² + Var F₀).
inline double offset_deviation(const ProjectionSolution& old) noexcept {
  return std::sqrt(old.offset * old.offset + dot(old.root[3], old.root[3]));
}

// The weights of the priors relative to samples with noise variance σ².
struct Priors {
  const ProjectionSettings& settings;

  bool exponent_known() const noexcept { return settings.exponent > 0.0; }

  double offset_weight(double variance) const noexcept {
    return offset_weight_of(settings.offset_deviation, variance);
  }

  // ρ_b = σ²/(s k)² for a prior on c/k of deviation s.
  double damping_weight(double k, double variance) const noexcept {
    const double deviation = settings.prior_dissipation_deviation * k;
    return std::min(variance / (deviation * deviation + tiny), largest_parameter);
  }

  double exponent_weight(double variance) const noexcept {
    return variance / (settings.prior_exponent_deviation * settings.prior_exponent_deviation);
  }

  // The contribution of the prior to J at an estimated exponent.
  double exponent_penalty(double n, double variance) const noexcept {
    if (exponent_known()) return 0.0;
    const double away = (n - settings.prior_exponent) / settings.prior_exponent_deviation;
    return variance * away * away;
  }

  // σ² for the weight of the priors, from the least Σ r². A fit to few samples is exact: two
  // additional samples with an error of 1 % of the rms force keep the priors from vanishing.
  double variance(double residual, double force_squared, double count) const noexcept {
    if (settings.noise > 0.0) return settings.noise * settings.noise;
    if (!(force_squared > 0.0)) return 1.0;
    const double floor = 1e-4 * force_squared / std::max(count, 1.0);
    return (residual + 2.0 * floor) / (std::max(count - 4.0, 0.0) + 2.0);
  }

  // σ² for error bars: from the residual, once ten degrees of freedom determine it to about a
  // quarter (1/√20). `rounding` is a lower bound on the residual, which keeps the error bars above
  // zero.
  double noise_variance(double residual, double rounding, double freedom,
                        double otherwise) const noexcept {
    constexpr double fewest_degrees = 10.0;
    if (settings.noise != 0.0 || freedom < fewest_degrees) return otherwise;
    return std::max(residual, rounding) / freedom;
  }

  // Within a quarter of a step from an end of the range: the minimum may lie beyond it.
  bool at_edge(double n) const noexcept {
    const double low = settings.lowest_exponent, high = settings.highest_exponent;
    const double margin = 0.25 * (high - low) / static_cast<double>(PowerSums::nodes - 1);
    return !exponent_known() && (n < low + margin || n > high - margin);
  }
};

// The relative error of a force sensor is at least 1e-5; with no force the variance is one unit.
inline double least_variance(double force_squared, double count) noexcept {
  return force_squared > 0.0 ? 1e-10 * force_squared / count : 1.0;
}

// The sums and the priors of one least-squares problem.
struct ProjectionProblem : Priors {
  ProjectionProblem(const PowerSums& of, const ProjectionSettings& under) noexcept
      : Priors{under}, sums(of) {}

  // 1 / (Σ1 + ρ_F), which eliminates the offset; 0 if no offset is fitted.
  double offset_fraction(double variance) const noexcept {
    return settings.offset ? 1.0 / (sums.weight() + offset_weight(variance) + tiny) : 0.0;
  }

  double prior_variance(double cost) const noexcept {
    const double squares = sums.force_squared();
    return variance(std::max(squares + cost, 0.0), squares, sums.weight());
  }

  const PowerSums& sums;
};

// At one exponent the law is linear in (k, c, F₀): least squares from the sums, which eliminates F₀
// first and then solves for (k, c) by determinants.
//
// A pivot below this fraction of its diagonal is rounding error: sums of 1e3 samples carry 1e3 ε.
inline constexpr double smallest_fraction = 1e-13;
// A sum of squares below this counts as an absent column. Its square is still a normal number.
inline constexpr double smallest_sum = 1e-150;

// [a11 a12; a12 a22] (k, c)ᵀ = (b1, b2)ᵀ, after the elimination of F₀ = f (ΣF − k Σp − c Σpw).
struct NormalEquations {
  double a11, a12, a22, b1, b2;
};

// The sums at one exponent as separate arguments; `total` is Σ F, `fraction` is f = 1/(Σ1 + ρ_F).
constexpr NormalEquations normal_equations(double spp, double sppw, double sppww, double sp,
                                           double spw, double spf, double spwf, double total,
                                           double fraction) noexcept {
  return {spp - sp * sp * fraction, sppw - sp * spw * fraction, sppww - spw * spw * fraction,
          spf - sp * total * fraction, spwf - spw * total * fraction};
}

struct LinearSolution {
  double k, c, offset;
  double cost;  // −bᵀÃ⁻¹b
  bool damped;  // the damping column has a valid pivot
};

// Solves with the prior on c/k, whose weight is ρ_b.
inline LinearSolution solve_linear(const ProjectionProblem& problem, const PowerSums::Values& s,
                                   double damping_weight, double fraction) noexcept {
  const double total = problem.sums.force();
  const double prior = problem.settings.prior_dissipation;
  auto [a11, a12, a22, b1, b2] =
      normal_equations(s[pp], s[ppw], s[ppww], s[p1], s[pw], s[pf], s[pwf], total, fraction);
  a11 += damping_weight * prior * prior;
  a12 -= damping_weight * prior;
  a22 += damping_weight;
  const double determinant = a11 * a22 - a12 * a12;
  const bool damped =
      determinant > smallest_fraction * (a11 * a22) && a11 > smallest_sum && a22 > smallest_sum;
  LinearSolution r{};
  r.damped = damped;
  r.k = damped ? (a22 * b1 - a12 * b2) / determinant : a11 > smallest_sum ? b1 / a11 : 0.0;
  r.c = damped ? (a11 * b2 - a12 * b1) / determinant : 0.0;
  r.offset = fraction * (total - r.k * s[p1] - r.c * s[pw]);
  r.cost = -(r.k * b1 + r.c * b2) - fraction * total * total;
  return r;
}

using GridCosts = std::array<double, PowerSums::nodes>;

// J over the grid without the priors on (k, c), in straight-line arithmetic that the compiler
// vectorises. The constant term −f (ΣF)² is omitted.
inline GridCosts grid_costs(const PowerSums& sums, double fraction) noexcept {
  GridCosts cost;
  const auto &spp = sums.column(pp), &sppw = sums.column(ppw), &sppww = sums.column(ppww),
             &sp = sums.column(p1), &spw = sums.column(pw), &spf = sums.column(pf),
             &spwf = sums.column(pwf);
  const double total = sums.force();
  for (std::size_t j = 0; j < PowerSums::nodes; ++j) {
    const auto [a11, a12, a22, b1, b2] = normal_equations(spp[j], sppw[j], sppww[j], sp[j], spw[j],
                                                          spf[j], spwf[j], total, fraction);
    // b₁²/a₁₁ plus the reduction by damping, with one division. The ridge excludes an absent
    // column, where sppww[j] is zero too and the 1e-30 prevents a division by zero.
    const double ridge = smallest_fraction * a22 + 1e-30 * a11;
    const double rest = b2 * a11 - b1 * a12;
    const double determinant = a11 * (a22 + ridge) - a12 * a12;
    cost[j] = -(b1 * b1 * determinant + rest * rest) / (a11 * determinant + tiny);
  }
  return cost;
}

// The solution at one exponent, with the sums that it was computed from.
struct ProjectionPoint {
  double n;
  PowerSums::Local sums;
  LinearSolution linear;
};

// JᵀJ from the sums and their derivatives: Σ ln ξ · p² = (Σ p²)'/2, and so on; the row of the
// surface is 0.
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

// The samples' JᵀJ at a stiffness k, plus the weights of the priors. The error bars include the
// priors with the same variance that weights them, so that a parameter that the motion does not
// identify stays as uncertain as its prior, whatever the noise. `surface_range` is 0 if the surface
// is known.
class Information {
 public:
  Information(const Matrix<5>& samples, const Priors& priors, double k, double variance,
              double surface_range) noexcept
      : samples_(samples),
        ratio_(priors.settings.prior_dissipation),
        variance_(variance),
        open_{true, true, !priors.exponent_known(), priors.settings.offset, surface_range > 0.0} {
    constexpr double unknown_stiffness = 1e-12;  // k ~ N(0, 1e6²): no information
    prior_ = {unknown_stiffness * variance, priors.damping_weight(k, variance),
              priors.exponent_weight(variance), priors.offset_weight(variance),
              open_[4] ? variance / (surface_range * surface_range) : 1.0};
  }

  // R, where R Rᵀ is the covariance.
  InverseRoot<5> covariance_root() const noexcept {
    Matrix<5> m = samples_;
    m[0][0] += prior_[1] * ratio_ * ratio_;
    m[0][1] = m[1][0] = m[0][1] - prior_[1] * ratio_;
    m[1][1] += prior_[1];
    // Parameters that are known or not fitted are decoupled from the others.
    for (std::size_t i = 2; i < 5; ++i) {
      m[i][i] += prior_[i];
      for (std::size_t j = 0; j < 5; ++j) {
        if (!open_[i] && i != j) m[i][j] = m[j][i] = 0.0;
      }
    }
    // Scaling to a unit diagonal keeps the inverse from overflowing.
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

  // The weights of the priors of (k, c, n, F₀) relative to the samples. A parameter that is not
  // fitted counts as known.
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

// Sets whether the samples identify c and n beyond rounding; `depth_spread` is the deviation of ln
// ξ.
inline void say_identifiable(ProjectionSolution& p, const std::array<bool, 5>& guarded,
                             const Priors& priors, double depth_spread) noexcept {
  constexpr double smallest_spread = 1e-4;  // 1 µm at 10 mm, finer than any sensor
  p.damping_identifiable = !guarded[1];
  p.exponent_identifiable =
      priors.exponent_known() || (!guarded[2] && !guarded[3] && depth_spread > smallest_spread);
}

// The factor that widens the root of a solution's covariance for correlated errors, from the levels
// of the errors. It uses the uncertainties of K, B and n, in SI except for their units. The slope
// for the surface is not stored: its factor is the largest of the others.
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
      ErrorWidening<4, 3>(levels, prior_fractions, p.root_variance, of_all_samples)
          .root(rows, p.inflation);
  Matrix<5> widening{};
  double widest = 1.0;
  for (std::size_t i = 0; i < 4; ++i) {
    std::copy_n(root[i].begin(), 4, widening[i].begin());
    widest = std::max(widest, dot(root[i], root[i]));
  }
  widening[4][4] = std::sqrt(widest);
  return widening;
}

// The flags for parameters that are not identified, from the root of the reported covariance.
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

// K = k F_s x_r⁻ⁿ, B = (c/V) F_s x_r⁻ⁿ.
inline HuntCrossley law_in_si(const ProjectionSolution& p, const Units& u) noexcept {
  const double unit = u.force * bounded_exp(-p.n * u.log_penetration);
  return {saturate(p.k * unit), saturate(p.c * unit / u.velocity), p.n};
}

// The root of the covariance of (K, B, n, F₀, d) in SI, from the root for (k, c, n, F₀, d) in
// scaled units: dK = U (dk − k ln x_r dn), dB = (U/V) (dc − c ln x_r dn), with U = F_s x_r⁻ⁿ.
inline Matrix<5> root_in_si(const Matrix<5>& root, const HuntCrossley& law,
                            const Units& u) noexcept {
  const double unit = saturate(u.force * bounded_exp(-law.n * u.log_penetration));
  const double damping_unit = saturate(unit / u.velocity);
  const double by_stiffness = saturate(-law.K * u.log_penetration);
  const double by_damping = saturate(-law.B * u.log_penetration);
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

}  // namespace detail
}  // namespace palpate
