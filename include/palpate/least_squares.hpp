// Recursive least squares with forgetting (eq. 13), for any linear regression y = φᵀθ.
//
//   g = P φ;  L = g / (λ + φᵀ g);  e = y − φᵀ θ;  θ ← θ + L e;  P ← (P − L gᵀ + π I) / λ
//
// π is the self-perturbation. While the signal excites every direction these are the equations, bit
// for bit. Where they would wind P up or make it indefinite, the guard takes the sample with λ = 1
// and π = 0; where even that cannot be represented, P stays and only θ moves, which contracts the
// error in the norm of P⁻¹ and so is stable for every φ. See docs/numerics.md.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/status.hpp"

namespace palpate {

// Forgetting may not make a direction more than this much less certain than it was at the start.
inline constexpr double largest_windup = 1e6;
inline constexpr double smallest_variance = 1e-70;
inline constexpr double largest_coefficient = 1e150;
inline constexpr double largest_residual = 1e250;
inline constexpr double largest_innovation = 1e300;
// Reported at most, so that its product with P and with two derivatives of a law stays finite.
inline constexpr double largest_noise_variance = 1e60;

template <std::size_t Order>
class LeastSquares {
 public:
  struct Settings {
    Vector<Order> initial{};             // θ₀
    Matrix<Order> initial_covariance{};  // P₀, positive definite
  };

  constexpr explicit LeastSquares(const Settings& settings) noexcept
      : settings_(settings),
        initial_information_(inverse(settings.initial_covariance)),
        parameters_(settings.initial),
        covariance_(settings.initial_covariance) {
    for (std::size_t i = 0; i < Order; ++i) {
      ceiling_ = std::max(ceiling_, largest_windup * settings.initial_covariance[i][i]);
    }
  }

  constexpr const Vector<Order>& parameters() const noexcept { return parameters_; }
  constexpr const Matrix<Order>& covariance() const noexcept { return covariance_; }
  constexpr std::uint64_t samples() const noexcept { return samples_; }

  constexpr double predict(const Vector<Order>& regressor) const noexcept {
    return dot(regressor, parameters_);
  }

  // Takes the sample whole (updated, guarded) or not at all (out_of_range).
  constexpr Status update(const Vector<Order>& regressor, double output, double forgetting_factor,
                          double perturbation = 0.0) noexcept {
    const Vector<Order> g = multiply(covariance_, regressor);
    // Rounding alone can make φᵀPφ negative, and only where cancellation has eaten every digit.
    const double spread = std::max(dot(regressor, g), 0.0);
    const double error = output - predict(regressor);
    Step step = renewed(g, spread, forgetting_factor, perturbation);
    if (sound(step.covariance)) [[likely]]
      return commit(step, error, Status::updated);
    if (forgetting_factor != 1.0 || perturbation != 0.0) step = renewed(g, spread, 1.0, 0.0);
    if (!sound(step.covariance)) step.covariance = covariance_;
    return commit(step, error, Status::guarded);
  }

  // Variance of y about φᵀθ: the weighted residual sum of the data alone (the initial values' share
  // is taken out) over its degrees of freedom; 1 until there are more samples than coefficients.
  constexpr double noise_variance() const noexcept {
    const double freedom = weight_ - static_cast<double>(Order);
    if (freedom < 1.0) return 1.0;
    Vector<Order> moved{};
    for (std::size_t i = 0; i < Order; ++i) moved[i] = parameters_[i] - settings_.initial[i];
    const double prior = prior_weight_ * dot(moved, multiply(initial_information_, moved));
    return std::min(largest_noise_variance, std::max(0.0, residual_ - prior) / freedom);
  }

  // Covariance of θ: the noise variance times P.
  constexpr Matrix<Order> scaled_covariance() const noexcept {
    Matrix<Order> result = covariance_;
    const double noise = noise_variance();
    for (auto& line : result) {
      for (double& entry : line) entry *= noise;
    }
    return result;
  }

 private:
  // One application of eq. 13, not yet committed.
  struct Step {
    Vector<Order> gain;  // L
    Matrix<Order> covariance;
    double innovation;  // λ + φᵀ g
    double forgetting_factor;
    double perturbation;
  };

  constexpr Step renewed(const Vector<Order>& g, double spread, double lambda,
                         double perturbation) const noexcept {
    Step step{{}, {}, lambda + spread, lambda, perturbation};
    for (std::size_t i = 0; i < Order; ++i) step.gain[i] = g[i] / step.innovation;
    for (std::size_t i = 0; i < Order; ++i) {
      for (std::size_t j = i; j < Order; ++j) {
        double entry = covariance_[i][j] - step.gain[i] * g[j];
        if (i == j) entry += perturbation;
        if (lambda != 1.0) entry /= lambda;
        step.covariance[i][j] = step.covariance[j][i] = entry;
      }
    }
    return step;
  }

  constexpr bool sound(const Matrix<Order>& p) const noexcept {
    bool within = true;
    for (std::size_t i = 0; i < Order; ++i) {
      within &= p[i][i] >= smallest_variance && p[i][i] <= ceiling_;
    }
    return within && is_positive_definite(p);
  }

  constexpr Status commit(const Step& step, double error, Status status) noexcept {
    Vector<Order> moved = parameters_;
    bool within = true;
    for (std::size_t i = 0; i < Order; ++i) {
      moved[i] += step.gain[i] * error;
      within &= std::abs(moved[i]) <= largest_coefficient;
    }
    const double lambda = step.forgetting_factor;
    const double residual = lambda * (residual_ + error * (error / step.innovation));
    within &= residual <= largest_residual && step.innovation <= largest_innovation;
    if (!within) return Status::out_of_range;
    parameters_ = moved;
    covariance_ = step.covariance;
    residual_ = residual;
    weight_ = lambda * weight_ + 1.0;
    // What is left below this changes no digit, and would end as a subnormal, which is slow.
    prior_weight_ *= step.perturbation != 0.0 || prior_weight_ < 1e-30 ? 0.0 : lambda;
    ++samples_;
    return status;
  }

  Settings settings_;
  Matrix<Order> initial_information_;
  Vector<Order> parameters_;
  Matrix<Order> covariance_;
  double ceiling_ = 0.0;
  double residual_ = 0.0;      // Σ wᵢ (yᵢ − φᵢᵀθ)² and the initial values' share
  double weight_ = 0.0;        // Σ wᵢ
  double prior_weight_ = 1.0;  // what forgetting left of the initial values
  std::uint64_t samples_ = 0;
};

}  // namespace palpate
