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

    bool operator==(const Settings&) const = default;
  };

  Forgetting(const Settings& settings, double sample_time) noexcept
      : settings_(settings),
        sample_time_(sample_time),
        decay_(std::exp(-settings.rate * sample_time)),
        departure_(1.0 - settings.initial_factor) {}

  double factor() const noexcept { return 1.0 - departure_; }

  void rearm() noexcept { departure_ = initial_departure(); }

  void advance(double dt) noexcept {
    departure_ *= dt == sample_time_ ? decay_ : std::exp(-settings_.rate * dt);
    // 1 − λ below ε/2 ≈ 1e-16 is lost in λ; 1e-20 is well below that, and far above the subnormals
    // that it would end in, which are slow.
    if (departure_ < 1e-20) departure_ = 0.0;
  }

 private:
  double initial_departure() const noexcept { return 1.0 - settings_.initial_factor; }

  Settings settings_;
  double sample_time_;
  double decay_;
  double departure_;  // 1 − λ
};

constexpr const char* validate(const Forgetting::Settings& settings) noexcept {
  const double factor = settings.initial_factor;
  if (!(factor > 0.0 && factor <= 1.0)) return "forgetting.initial_factor must be in (0, 1]";
  if (!(settings.rate >= 0.0 && settings.rate <= 1e6)) {
    return "forgetting.rate must be in [0, 1e6] 1/s";
  }
  return nullptr;
}

// Nothing is forgotten.
inline constexpr Forgetting::Settings no_forgetting{};

// The paper's choice (section V-A-3): λ₀ = 0.99, and of the rates 5 to 8 1/s that it found good the
// least.
inline constexpr Forgetting::Settings fading_forgetting{.initial_factor = 0.99, .rate = 5.0};

// Self-perturbing RLS (Park & Jun 1992; the paper's section VII): β·NINT(γ e²) is added to the
// diagonal of P, and λ returns to λ₀ whenever that is not zero.
//
// The paper's 0.05 and 2.5 in the only reading that reproduces its Fig. 19: √(0.5/γ) = 0.45 N lies
// between the sensor's noise band (0.05 N) and the error after a switch (0.5 N).
struct SelfPerturbation {
  double gain = 0.05;        // β, units of P; 0 switches it off
  double sensitivity = 2.5;  // γ, 1/N²

  constexpr bool active() const noexcept { return gain > 0.0 && sensitivity > 0.0; }

  double operator()(double prediction_error) const noexcept {
    if (!active()) return 0.0;
    return gain * std::round(sensitivity * prediction_error * prediction_error);
  }

  bool operator==(const SelfPerturbation&) const = default;
};

inline constexpr SelfPerturbation no_perturbation{.gain = 0.0, .sensitivity = 0.0};

constexpr const char* validate(const SelfPerturbation& settings) noexcept {
  if (!(settings.gain >= 0.0 && settings.gain <= 1e20)) {
    return "perturbation.gain must be in [0, 1e20]";
  }
  if (!(settings.sensitivity >= 0.0 && settings.sensitivity <= 1e40)) {
    return "perturbation.sensitivity must be in [0, 1e40] 1/N²";
  }
  return nullptr;
}

}  // namespace palpate
