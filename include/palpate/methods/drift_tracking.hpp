// Drift tracking: the law of a slowly changing material, and a test of whether it changes faster
// than assumed.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "palpate/methods/regression.hpp"
#include "palpate/methods/variable_projection.hpp"

namespace palpate::detail {

// Tests whether the truth drifts faster than the random walk that a filter assumes.
//
// If it drifts as assumed, the prediction errors are uncorrelated. If it drifts r times as far in a
// second, the filter lags behind, and successive errors are correlated:
//
//   E[e_k e_{k−1}] = P (r² − 1)/2,   where P is the variance of the predicted force
//
// so the ratio of their means, over about the last thousand samples, gives r for any white noise.
// Correlated noise has the same effect and cannot be distinguished from drift by the errors.
class WalkCheck {
 public:
  // error: of the prediction, as the filter used it; predicted: P; whole: P plus the noise
  // variance.
  constexpr void observe(double error, double predicted, double whole) noexcept {
    samples_ = std::min(samples_ + 1, window);
    const double gain = 1.0 / static_cast<double>(samples_);
    product_ += gain * (error * previous_ - product_);
    predicted_ += gain * (predicted - predicted_);
    whole_ += gain * (whole - whole_);
    previous_ = error;
  }

  // Whether the mean product exceeds that of a truth three times faster than the walk by five
  // standard deviations for white errors.
  bool too_slow() const noexcept {
    const double scatter = whole_ / std::sqrt(static_cast<double>(window));
    return samples_ == window && product_ > most_lag * predicted_ + 5.0 * scatter;
  }

 private:
  static constexpr std::uint64_t window = 1000;
  // (3² − 1)/2. Up to a ratio of two the standard errors are √1.25 too small, which needs no flag.
  static constexpr double most_lag = 4.0;

  std::uint64_t samples_ = 0;
  double previous_ = 0.0, product_ = 0.0, predicted_ = 0.0, whole_ = 0.0;
};

}  // namespace palpate::detail

namespace palpate {

// A drifting material: an extended Kalman filter on (ln k, b, n, F₀) of
//
//   F = k ξⁿ (1 + b w) + F₀,   d(ln k), db, dn random walks, F₀ constant,
//
// started from the estimate, covariance and noise of variable projection. From arbitrary values the
// filter diverges in one start of ten, so it has no other start: until the standard error of the
// exponent is below 0.05, the estimate is that of variable projection.
//
// The filter assumes white noise. If the errors of the start suggest noise e_k = a e_{k−1} + white,
// the covariance of the filter's own errors is P + X with
//
//   u = a (I − K sᵀ) c,  c ← u + K σ²,
//   X ← (I − K sᵀ) X (I − K sᵀ)ᵀ + u Kᵀ + K uᵀ + (σ² − R) K Kᵀ,
//
// where s is the slope, K the gain, c the covariance between the errors of the state and the noise,
// and R the filter's own σ². The estimates do not change.
class DriftTrackingMethod {
 public:
  using Law = HuntCrossley;
  static constexpr std::size_t order = 3;
  using Start = VariableProjectionMethod<detail::ProjectionSolver>;

  bool sound() const noexcept { return start_.sound(); }
  using Row = Start::Row;

  struct Settings {
    // Few motions identify an offset together with a drifting stiffness; default: off.
    ProjectionSettings projection{.offset = false};
    // Standard deviations of the random walks of ln k, b (scaled) and n after one second, 1/√s.
    // 0.02 follows ±30 % at 0.1 Hz to a few tenths of a percent; with 0.3 the exponent would not be
    // identifiable.
    Vector<3> drift{0.02, 0.0, 0.0};

    bool operator==(const Settings&) const = default;
  };

  static constexpr Forgetting::Settings default_forgetting = no_forgetting;
  static constexpr Scale default_scale = Start::default_scale;
  static constexpr bool forgets = false;
  static constexpr bool perturbs = false;
  static constexpr double largest_input = Start::largest_input;

  DriftTrackingMethod(const Settings& settings, const Units& units) noexcept
      : settings_(settings), start_(settings.projection, units), units_(units) {}

  bool in_range(const Sample& s) const noexcept { return start_.in_range(s); }

  Row prepare(const Sample& sample, double dt) noexcept {
    if (!tracking_) return start_.prepare(sample, dt);
    return {sample, force(sample)};
  }

  double predict(const Row& row) const noexcept { return row.predicted; }

  Status learn(const Row& row, double dt, double, double) noexcept {
    if (tracking_) return filter(row.sample, dt, row.sample.force - row.predicted);
    const Status status = start_.learn(row, dt, 1.0, 0.0);
    track_if_known();
    return status;
  }

  void reinitialise() noexcept {
    start_.reinitialise();
    start_again();
  }

  void reinitialise_after_transient() noexcept {
    start_.reinitialise_after_transient();
    start_again();
  }

  Law law(const Units& units) const noexcept {
    return tracking_ ? tracked_law(units) : start_.law(units);
  }

  double force(const Units& units, double x, double v) const noexcept {
    return tracking_ ? latest(units).force(x, v) : start_.force(units, x, v);
  }

  Snapshot<Law> latest(const Units& units) const noexcept {
    if (!tracking_) return start_.latest(units);
    return {tracked_law(units), {}, state_[3] * units.force};
  }

  Fit<Law> fit(const Units& units) const noexcept {
    if (!tracking_) {
      Fit<Law> fit = start_.fit(units);
      fit.flags |= still_starting;
      return fit;
    }
    const Law law = tracked_law(units);
    Matrix<4> joint = detail::congruence(jacobian(law, units), detail::cholesky(known()));
    detail::bound_variances(joint, detail::largest_variance);
    return fit_of(law, joint, state_[3] * units.force, walk_.too_slow() ? walk_too_slow : 0);
  }

  Snapshot<Law> snapshot(const Units& units) const noexcept {
    if (!tracking_) return start_.snapshot(units);
    const Law law = tracked_law(units);
    const Vector<4> variances = detail::congruent_diagonal(jacobian(law, units), known());
    return {law,
            {detail::bounded_variance(variances[0]), detail::bounded_variance(variances[1]),
             detail::bounded_variance(variances[2])}};
  }

 private:
  // An estimate costs ten updates, so the start is tested every 32 samples, and not before 192: the
  // standard errors of a fit to few samples are too small.
  static constexpr std::uint64_t samples_between_looks = 32;
  static constexpr std::uint64_t fewest_samples = 192;
  // Standard error of the exponent: a tenth of the step from punch to sphere to cone, within which
  // the linearisation of the filter is accurate.
  static constexpr double largest_start_error = 0.05;

  void start_again() noexcept {
    tracking_ = false;
    learned_ = 0;
  }

  bool exponent_known() const noexcept { return settings_.projection.exponent > 0.0; }

  // The reported covariance: a known exponent has no error.
  Matrix<4> known() const noexcept {
    Matrix<4> result = covariance_;
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) result[i][j] += excess_[i][j];
    }
    if (exponent_known()) result[2][2] = 0.0;
    return result;
  }

  void track_if_known() noexcept {
    if (++learned_ % samples_between_looks != 0 || learned_ < fewest_samples) return;
    // A drift increases the widened standard errors of a constant law, so that with them tracking
    // would never start.
    const Fit<Law> fit = start_.fit_in_white_noise(units_);
    constexpr double most_variance = largest_start_error * largest_start_error;
    const bool known = fit.flags == 0 && fit.law.K > 0.0 && fit.covariance[2][2] < most_variance;
    if (!known) return;
    // Converts (K, B, n) to (ln k, b, n) in scaled units: ln k = ln K + n ln x_r − ln F_s, b = V
    // B/K.
    const double dissipation = fit.law.B / fit.law.K;
    const double per_stiffness = 1.0 / fit.law.K;
    const Matrix<4> to_state{{{per_stiffness, 0.0, units_.log_penetration, 0.0},
                              {-dissipation * per_stiffness * units_.velocity,
                               per_stiffness * units_.velocity, 0.0, 0.0},
                              {0.0, 0.0, 1.0, 0.0},
                              {0.0, 0.0, 0.0, units_.per_force}}};
    // The material drifted while it was assumed constant: a factor of ten on the deviation covers
    // that.
    covariance_ =
        detail::multiply(detail::congruence(to_state, detail::cholesky(joint(fit))), 100.0);
    // A fixed entry of the state has the variance 1e-30, which keeps the matrix positive definite.
    if (!settings_.projection.offset) covariance_[3][3] = 1e-30;
    if (exponent_known()) covariance_[2][2] = 1e-30;
    if (!detail::is_positive_definite(covariance_)) return;
    const Vector<4> state{
        std::log(fit.law.K) + fit.law.n * units_.log_penetration - units_.log_force,
        dissipation * units_.velocity, fit.law.n, fit.offset.value * units_.per_force};
    // Beyond these limits filter() would refuse every sample.
    for (std::size_t i = 0; i < 4; ++i) {
      const bool bounded = std::abs(state[i]) < largest_input && covariance_[i][i] < largest_input;
      if (!bounded) return;
    }
    state_ = state;
    noise_variance_ = start_.noise_variance();
    measure_correlation();
    walk_ = {};
    tracking_ = true;
  }

  // Estimates a and σ² of AR(1) noise. Differences of successive errors have the variance d = σ² (1
  // − a), and sums over long times have D = σ² (1 + a)/(1 − a) per sample, so both together
  // determine a and σ². R is smaller, because the fit absorbs slow noise.
  void measure_correlation() noexcept {
    excess_ = {};
    shared_ = {};
    correlation_ = 0.0;
    const detail::LevelNoise levels(start_.noise_levels(), noise_variance_, {4.0});
    if (levels.measured == 0) return;
    const double quick = start_.noise_levels()[0].residual_variance();
    const double ratio = levels.ratio[levels.used] * noise_variance_ / quick;  // (1 + a)/(1 − a)²
    const double a = 1.0 + (1.0 - std::sqrt(1.0 + 8.0 * ratio)) / (2.0 * ratio);
    // A few hundred samples of white noise seldom seem to have a larger correlation.
    constexpr double least = 0.35;
    if (!(a > least && a < 1.0)) return;
    correlation_ = a;
    correlated_variance_ = std::max(noise_variance_, quick / (1.0 - a));
  }

  static Matrix<4> joint(const Fit<Law>& fit) noexcept {
    Matrix<4> result{};
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) result[i][j] = fit.covariance[i][j];
      result[i][3] = result[3][i] = fit.offset.covariance[i];
    }
    result[3][3] = fit.offset.variance;
    return result;
  }

  double force(const Sample& s) const noexcept {
    return detail::bounded_exp(state_[0] + state_[2] * std::log(s.penetration)) *
               (1.0 + state_[1] * s.velocity) +
           state_[3];
  }

  // One step of the filter; a sample is refused if the covariance would not stay positive definite.
  Status filter(const Sample& s, double dt, double error) noexcept {
    Matrix<4> predicted = covariance_;
    for (std::size_t i = 0; i < 3; ++i) {
      predicted[i][i] += settings_.drift[i] * settings_.drift[i] * dt;
    }
    const double depth = std::log(s.penetration);
    const double elastic = detail::bounded_exp(state_[0] + state_[2] * depth);
    const double whole = elastic * (1.0 + state_[1] * s.velocity);
    const Vector<4> slope{whole, elastic * s.velocity, exponent_known() ? 0.0 : whole * depth,
                          settings_.projection.offset ? 1.0 : 0.0};
    const Vector<4> g = detail::multiply(predicted, slope);
    const double innovation = detail::dot(slope, g) + noise_variance_;
    // An error beyond five standard deviations, which white noise reaches once in two million
    // samples, counts as five.
    const double limit = 5.0 * std::sqrt(innovation);
    const double bounded = std::clamp(error, -limit, limit);
    Vector<4> next = state_;
    for (std::size_t i = 0; i < 4; ++i) {
      next[i] += g[i] / innovation * bounded;
      if (!(std::abs(next[i]) < largest_input)) return Status::out_of_range;
      for (std::size_t j = i; j < 4; ++j) {
        predicted[i][j] = predicted[j][i] = predicted[i][j] - g[i] * g[j] / innovation;
      }
    }
    for (std::size_t i = 0; i < 4; ++i) {
      if (!(predicted[i][i] < largest_input)) return Status::out_of_range;
    }
    if (!detail::is_positive_definite(predicted)) return Status::out_of_range;
    walk_.observe(bounded, innovation - noise_variance_, innovation);
    state_ = next;
    covariance_ = predicted;
    if (correlation_ > 0.0) correlate(slope, g, innovation);
    return Status::updated;
  }

  void correlate(const Vector<4>& slope, const Vector<4>& g, double innovation) noexcept {
    const Vector<4> xs = detail::multiply(excess_, slope);
    const double sxs = detail::dot(slope, xs), felt = correlation_ * detail::dot(slope, shared_);
    Vector<4> gain, u;
    for (std::size_t i = 0; i < 4; ++i) {
      gain[i] = g[i] / innovation;
      u[i] = correlation_ * shared_[i] - gain[i] * felt;
      shared_[i] = u[i] + gain[i] * correlated_variance_;
    }
    const double more = sxs + correlated_variance_ - noise_variance_;
    for (std::size_t i = 0; i < 4; ++i) {
      const double across = u[i] - xs[i] + gain[i] * more;
      for (std::size_t j = i; j < 4; ++j) {
        excess_[i][j] += across * gain[j] + gain[i] * (u[j] - xs[j]);
        excess_[j][i] = excess_[i][j];
      }
    }
  }

  Law tracked_law(const Units& u) const noexcept {
    const double stiffness =
        detail::bounded_exp(state_[0] + u.log_force - state_[2] * u.log_penetration);
    return {stiffness, detail::saturate(stiffness * state_[1] / u.velocity), state_[2]};
  }

  // Derivative of (K, B, n, F₀) in SI with respect to (ln k, b, n, F₀) in scaled units.
  static Matrix<4> jacobian(const Law& law, const Units& u) noexcept {
    Matrix<4> result = detail::among_known<4>(HuntCrossleyLogRegression::jacobian(law, u));
    result[3][3] = u.force;
    return result;
  }

  Settings settings_;
  Start start_;
  Units units_;
  Vector<4> state_{};
  Matrix<4> covariance_{};
  double noise_variance_ = 0.0;
  double correlation_ = 0.0;          // a; 0 for white noise
  double correlated_variance_ = 0.0;  // σ²
  Matrix<4> excess_{};                // X
  Vector<4> shared_{};                // c
  detail::WalkCheck walk_;
  std::uint64_t learned_ = 0;
  bool tracking_ = false;
};

constexpr const char* validate(const DriftTrackingMethod::Settings& settings) noexcept {
  if (const char* fault = validate(settings.projection)) return fault;
  for (const double drift : settings.drift) {
    if (!(drift >= 0.0 && drift <= 1e60)) return "method.drift must be in [0, 1e60] 1/√s";
  }
  if (settings.projection.exponent > 0.0 && settings.drift[2] > 0.0) {
    return "method.drift of the exponent must be 0 for a known exponent";
  }
  return nullptr;
}

}  // namespace palpate
