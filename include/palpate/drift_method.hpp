// A material that drifts: an extended Kalman filter on (ln k, b, n, F₀) of
//
//   F = k ξⁿ (1 + b w) + F₀,   d(ln k), db, dn random walks, F₀ constant,
//
// started by variable projection, from its answer, its covariance and its noise. Started cold it
// diverges in one start of ten, so there is no way to start it cold: until variable projection
// knows the exponent to 0.05, its answer is this method's.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "palpate/projection_method.hpp"

namespace palpate {

class DriftMethod {
 public:
  using Law = HuntCrossley;
  static constexpr std::size_t order = 3;
  static constexpr bool prediction_lags = false;
  static constexpr bool takes_approach = false;
  static constexpr double largest_input = 1e8;

  struct Settings {
    VariableProjection::Settings projection;
    Vector<3> drift;  // of ln k, b (scaled) and n: deviation after one second of random walk, 1/√s
  };

  DriftMethod(const Settings& settings, const Units& units) noexcept
      : settings_(settings), start_(settings.projection, units), units_(units) {}

  double largest_penetration() const noexcept { return start_.largest_penetration(); }

  template <class Adapt>
  Status learn(const Sample& sample, double dt, Adapt&& adapt) noexcept {
    if (!tracking_) {
      const Status status = start_.learn(sample, dt, adapt);
      begin_if_known();
      return status;
    }
    const double predicted = force(sample);
    adapt([&]() noexcept { return predicted; });
    return follow(sample, dt, sample.force - predicted);
  }

  void restart() noexcept {
    start_.restart();
    tracking_ = false;
    learned_ = 0;
  }

  void restart_again() noexcept {
    start_.restart_again();
    tracking_ = false;
    learned_ = 0;
  }

  Law law(const Units& units) const noexcept {
    return tracking_ ? tracked_law(units) : start_.law(units);
  }

  double force(const Units& units, double x, double v) const noexcept {
    if (!tracking_) return start_.force(units, x, v);
    return law(units).force(x, v) + state_[3] * units.force;
  }

  Fit<Law> fit(const Units& units) const noexcept {
    if (!tracking_) {
      Fit<Law> fit = start_.fit(units);
      fit.doubts |= still_starting;
      return fit;
    }
    const Law law = tracked_law(units);
    Matrix<4> joint = congruence(jacobian(law, units), cholesky(covariance_));
    bound_variances(joint, largest_variance);
    Fit<Law> fit{.law = law,
                 .covariance = {},
                 .offset = {state_[3] * units.force, joint[3][3], {}},
                 .surface = {},
                 .doubts = 0};
    for (std::size_t i = 0; i < order; ++i) {
      for (std::size_t j = 0; j < order; ++j) fit.covariance[i][j] = joint[i][j];
      fit.offset.covariance[i] = joint[3][i];
    }
    return fit;
  }

  Moment<Law> moment(const Units& units) const noexcept {
    if (!tracking_) return start_.moment(units);
    const Law law = tracked_law(units);
    const Vector<4> variances = congruent_diagonal(jacobian(law, units), covariance_);
    return {law,
            {bounded_variance(variances[0]), bounded_variance(variances[1]),
             bounded_variance(variances[2])}};
  }

 private:
  void begin_if_known() noexcept {
    if (++learned_ % 32 != 0 || learned_ < 192) return;
    const Fit<Law> fit = start_.fit(units_);
    const bool known = fit.doubts == 0 && fit.law.stiffness > 0.0 && fit.covariance[2][2] < 0.0025;
    if (!known) return;
    // From (K, B, n) to (ln k, b, n) in scaled units: ln k = ln K + n ln x_r − ln F_s, b = V B/K.
    const double dissipation = fit.law.damping / fit.law.stiffness;
    const double per_stiffness = 1.0 / fit.law.stiffness;
    const Matrix<4> to_state{{{per_stiffness, 0.0, units_.log_penetration, 0.0},
                              {-dissipation * per_stiffness * units_.velocity,
                               per_stiffness * units_.velocity, 0.0, 0.0},
                              {0.0, 0.0, 1.0, 0.0},
                              {0.0, 0.0, 0.0, units_.per_force}}};
    covariance_ = congruence(to_state, cholesky(joint(fit)));
    // The material drifted while it was taken for constant: ten times the deviation covers that.
    for (auto& row : covariance_) {
      for (double& entry : row) entry *= 100.0;
    }
    // Without an offset its place in the state stays empty.
    if (!settings_.projection.offset) covariance_[3][3] = 1e-30;
    if (!is_positive_definite(covariance_)) return;
    const Vector<4> state{
        std::log(fit.law.stiffness) + fit.law.exponent * units_.log_penetration - units_.log_force,
        dissipation * units_.velocity, fit.law.exponent, fit.offset.value * units_.per_force};
    // follow() would refuse every sample beyond it.
    for (std::size_t i = 0; i < 4; ++i) {
      const bool bounded = std::abs(state[i]) < largest_input && covariance_[i][i] < largest_input;
      if (!bounded) return;
    }
    state_ = state;
    noise_variance_ = start_.noise_variance();
    tracking_ = true;
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
    return bounded_exp(state_[0] + state_[2] * std::log(s.penetration)) *
               (1.0 + state_[1] * s.velocity) +
           state_[3];
  }

  // One step of the filter; a sample that would leave the covariance unsound is not taken.
  Status follow(const Sample& s, double dt, double error) noexcept {
    Matrix<4> predicted = covariance_;
    for (std::size_t i = 0; i < 3; ++i) {
      predicted[i][i] += settings_.drift[i] * settings_.drift[i] * dt;
    }
    const double depth = std::log(s.penetration);
    const double elastic = bounded_exp(state_[0] + state_[2] * depth);
    const double whole = elastic * (1.0 + state_[1] * s.velocity);
    const Vector<4> slope{whole, elastic * s.velocity, whole * depth,
                          settings_.projection.offset ? 1.0 : 0.0};
    const Vector<4> g = multiply(predicted, slope);
    const double innovation = dot(slope, g) + noise_variance_;
    // An error beyond five deviations moves the state as one of five would.
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
    if (!is_positive_definite(predicted)) return Status::out_of_range;
    state_ = next;
    covariance_ = predicted;
    return Status::updated;
  }

  Law tracked_law(const Units& u) const noexcept {
    const double stiffness = bounded_exp(state_[0] + u.log_force - state_[2] * u.log_penetration);
    return {stiffness, saturate(stiffness * state_[1] / u.velocity), state_[2]};
  }

  // Of (K, B, n, F₀) in SI by (ln k, b, n, F₀) in scaled units.
  static Matrix<4> jacobian(const Law& law, const Units& u) noexcept {
    const double depth = -u.log_penetration;
    return {
        {{law.stiffness, 0.0, saturate(law.stiffness * depth), 0.0},
         {law.damping, saturate(law.stiffness / u.velocity), saturate(law.damping * depth), 0.0},
         {0.0, 0.0, 1.0, 0.0},
         {0.0, 0.0, 0.0, u.force}}};
  }

  Settings settings_;
  ProjectionMethod<VariableProjection> start_;
  Units units_;
  Vector<4> state_{};
  Matrix<4> covariance_{};
  double noise_variance_ = 0.0;
  std::uint64_t learned_ = 0;
  bool tracking_ = false;
};

}  // namespace palpate
