// Recursive least squares with forgetting (eq. 13), for any linear regression y = φᵀθ.
//
//   g = P φ;  L = g / (λ + φᵀ g);  e = y − φᵀ θ;  θ ← θ + L e;  P ← (P − L gᵀ + π I) / λ
//
// π is the self-perturbation. While the signal excites every direction, exactly these equations
// hold. If they would wind P up or make it indefinite, the guard takes the sample with λ = 1 and π
// = 0. If one sample holds so much more information than P that P lacks the digits for both, its
// weight is limited to what P can represent. If even that fails, P stays and only θ changes, which
// contracts the error in the norm of P⁻¹ and so is stable for every φ. See
// docs/reference/numerics.md.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"

namespace palpate {

namespace detail {

// Forgetting may raise a direction's variance at most by this factor over its initial value.
inline constexpr double largest_windup = 1e6;
// Products of four variances, in the minors of P, stay above subnormal numbers.
inline constexpr double smallest_variance = 1e-70;
// A guarded sample may reduce its direction's variance at most by this factor.
// (2⁻³⁶: with 52 bits, sixteen are left for the other directions.)
inline constexpr double largest_gain = 0x1p36;
// Samples beyond these limits are refused. Within them J P Jᵀ times the noise variance is finite
// for every law and scale.
inline constexpr double largest_coefficient = 1e100;
inline constexpr double largest_residual = 1e70;
inline constexpr double largest_innovation = 1e300;

}  // namespace detail

template <std::size_t Order>
class LeastSquares {
 public:
  struct Settings {
    Vector<Order> initial{};             // θ₀
    Matrix<Order> initial_covariance{};  // P₀, positive definite

    bool operator==(const Settings&) const = default;
  };

  constexpr explicit LeastSquares(const Settings& settings) noexcept
      : settings_(settings),
        initial_information_(detail::inverse(settings.initial_covariance)),
        state_{settings.initial, settings.initial_covariance} {
    for (std::size_t i = 0; i < Order; ++i) {
      ceiling_ = std::max(ceiling_, detail::largest_windup * settings.initial_covariance[i][i]);
    }
  }

  constexpr const Settings& settings() const noexcept { return settings_; }
  constexpr const Vector<Order>& parameters() const noexcept { return state_.parameters; }
  constexpr const Matrix<Order>& covariance() const noexcept { return state_.covariance; }
  constexpr std::uint64_t samples() const noexcept { return state_.samples; }

  constexpr double predict(const Vector<Order>& regressor) const noexcept {
    return detail::dot(regressor, state_.parameters);
  }

  // Learns the sample (updated, guarded) or refuses it without any change (out_of_range).
  constexpr Status update(const Vector<Order>& regressor, double output, double forgetting_factor,
                          double perturbation = 0.0) noexcept {
    const Vector<Order> g = detail::multiply(state_.covariance, regressor);
    // Only rounding can make φᵀPφ negative, where cancellation leaves no valid digit.
    const double spread = std::max(detail::dot(regressor, g), 0.0);
    const double error = output - predict(regressor);
    const Step step = renewed(g, forgetting_factor + spread, forgetting_factor, perturbation);
    if (sound(step.covariance)) [[likely]]
      return commit(step, error, Status::updated);
    return guarded(g, spread, error);
  }

  // Variance of y about φᵀθ: the weighted residual sum of the data (without the initial values'
  // part) over its degrees of freedom; 1 until there are more samples than coefficients.
  constexpr double noise_variance() const noexcept {
    const double freedom = state_.weight - static_cast<double>(Order);
    if (freedom < 1.0) return 1.0;
    Vector<Order> moved{};
    for (std::size_t i = 0; i < Order; ++i) moved[i] = state_.parameters[i] - settings_.initial[i];
    const double information = detail::dot(moved, detail::multiply(initial_information_, moved));
    const double prior = state_.prior_weight * information;
    return std::max(state_.residual - prior, 0.0) / freedom;
  }

  // The state without the settings, which allows a sample to be undone.
  struct State {
    Vector<Order> parameters;   // θ
    Matrix<Order> covariance;   // P
    double residual = 0.0;      // Σ wᵢ (yᵢ − φᵢᵀθ)² and the initial values' part
    double weight = 0.0;        // Σ wᵢ
    double prior_weight = 1.0;  // remaining weight of the initial values after forgetting
    std::uint64_t samples = 0;
  };

  constexpr const State& state() const noexcept { return state_; }
  constexpr void restore(const State& state) noexcept { state_ = state; }

  // Covariance of θ: the noise variance times P.
  constexpr Matrix<Order> scaled_covariance() const noexcept {
    return detail::multiply(state_.covariance, noise_variance());
  }

  // The lower triangle L of scaled_covariance() = L Lᵀ.
  Matrix<Order> scaled_root() const noexcept {
    return detail::multiply(detail::cholesky(state_.covariance), std::sqrt(noise_variance()));
  }

 private:
  // One application of eq. 13, not yet committed.
  struct Step {
    Vector<Order> gain;  // L
    Matrix<Order> covariance;
    double innovation;  // λ + φᵀ g, or more where guarded
    double forgetting_factor;
    double perturbation;
  };

  constexpr Step renewed(const Vector<Order>& g, double innovation, double lambda,
                         double perturbation) const noexcept {
    Step step{{}, {}, innovation, lambda, perturbation};
    for (std::size_t i = 0; i < Order; ++i) step.gain[i] = g[i] / step.innovation;
    for (std::size_t i = 0; i < Order; ++i) {
      for (std::size_t j = i; j < Order; ++j) {
        double entry = state_.covariance[i][j] - step.gain[i] * g[j];
        if (i == j) entry += perturbation;
        if (lambda != 1.0) entry /= lambda;
        step.covariance[i][j] = step.covariance[j][i] = entry;
      }
    }
    return step;
  }

  // The step without forgetting if P would not stay positive definite, and with a smaller gain if
  // that is not enough. A separate function, so that the step of every sample stays in registers.
  [[gnu::cold, gnu::noinline]] constexpr Status guarded(const Vector<Order>& g, double spread,
                                                        double error) noexcept {
    const double noise = std::max(spread / detail::largest_gain, 1.0);
    Step step = renewed(g, 1.0 + spread, 1.0, 0.0);
    if (noise > 1.0 && !sound(step.covariance)) step = renewed(g, noise + spread, 1.0, 0.0);
    if (!sound(step.covariance)) step.covariance = state_.covariance;
    return commit(step, error, Status::guarded);
  }

  constexpr bool sound(const Matrix<Order>& p) const noexcept {
    bool within = true;
    for (std::size_t i = 0; i < Order; ++i) {
      within &= p[i][i] >= detail::smallest_variance && p[i][i] <= ceiling_;
    }
    return within && detail::is_positive_definite(p);
  }

  constexpr Status commit(const Step& step, double error, Status status) noexcept {
    Vector<Order> moved = state_.parameters;
    bool within = step.innovation <= detail::largest_innovation;
    for (std::size_t i = 0; i < Order; ++i) {
      moved[i] += step.gain[i] * error;
      within &= moved[i] >= -detail::largest_coefficient && moved[i] <= detail::largest_coefficient;
    }
    const double lambda = step.forgetting_factor;
    const double residual = lambda * (state_.residual + error * (error / step.innovation));
    if (!(within && residual <= detail::largest_residual)) return Status::out_of_range;
    state_.parameters = moved;
    state_.covariance = step.covariance;
    state_.residual = residual;
    state_.weight = lambda * state_.weight + 1.0;
    // A smaller value changes no digit and would become a subnormal number, on which arithmetic is
    // slow.
    state_.prior_weight *= step.perturbation != 0.0 || state_.prior_weight < 1e-30 ? 0.0 : lambda;
    ++state_.samples;
    return status;
  }

  Settings settings_;
  Matrix<Order> initial_information_;
  double ceiling_ = 0.0;
  State state_;
};

}  // namespace palpate
