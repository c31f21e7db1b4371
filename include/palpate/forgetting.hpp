// How fast the past is forgotten, and how an abrupt change reopens the covariance.
#pragma once

#include <cmath>

namespace palpate {

// λ = 1 − (1 − λ₀) e^(−α t), t since contact was made. α = 0 is a constant factor.
class Forgetting {
 public:
  struct Settings {
    double initial_factor = 1.0;  // λ₀, in (0, 1]
    double rate = 0.0;            // α, 1/s
  };

  Forgetting(const Settings& settings, double sample_time) noexcept
      : settings_(settings),
        sample_time_(sample_time),
        decay_(std::exp(-settings.rate * sample_time)),
        departure_(1.0 - settings.initial_factor) {}

  double factor() const noexcept { return 1.0 - departure_; }

  void rearm() noexcept { departure_ = 1.0 - settings_.initial_factor; }

  void advance(double dt) noexcept {
    departure_ *= dt == sample_time_ ? decay_ : std::exp(-settings_.rate * dt);
    // 1 − λ this small is lost in λ, and would end as a subnormal, which is slow.
    if (departure_ < 1e-20) departure_ = 0.0;
  }

 private:
  Settings settings_;
  double sample_time_;
  double decay_;
  double departure_;  // 1 − λ
};

// Self-perturbing RLS (Park & Jun 1992; the paper's section VII): β·NINT(γ e²) is added to the
// diagonal of P, and λ returns to λ₀ whenever that is not zero.
struct SelfPerturbation {
  double gain = 0.0;         // β, units of P; 0 switches it off
  double sensitivity = 0.0;  // γ, 1/N²

  constexpr bool active() const noexcept { return gain > 0.0 && sensitivity > 0.0; }

  double operator()(double prediction_error) const noexcept {
    if (!active()) return 0.0;
    return gain * std::round(sensitivity * prediction_error * prediction_error);
  }
};

}  // namespace palpate
