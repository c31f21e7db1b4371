// The parts of the loop of recursive_estimator.hpp: contact gate, forgetting, self-perturbation,
// and the interface of a method.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "palpate/estimate.hpp"
#include "palpate/sample.hpp"

namespace palpate {

// Decides which samples are in contact. Logarithms need x > 0 and F > 0, and noise near the surface
// biases them (E ln(F + ε) ≈ ln F − σ²/2F²), so thresholds should be about ten times the noise.
class ContactGate {
 public:
  struct Settings {
    double minimum_penetration = 0.0;  // m; at or below it there is no contact
    double make_force = 0.0;           // N; contact is made above it …
    double break_force = 0.0;          // N; … and lost at or below it (≤ make_force)

    bool operator==(const Settings&) const = default;
  };

  enum class Phase : std::uint8_t { waiting, contact, held };

  constexpr explicit ContactGate(const Settings& settings) noexcept : settings_(settings) {}

  constexpr Phase phase() const noexcept { return phase_; }

  // The phase after this sample; the gate changes only in enter().
  constexpr Phase next(double penetration, double force) const noexcept {
    const bool touching = phase_ == Phase::contact;
    const double threshold = touching ? settings_.break_force : settings_.make_force;
    if (penetration > settings_.minimum_penetration && force > threshold) return Phase::contact;
    return without_contact();
  }

  // The phase after the end of contact.
  constexpr Phase without_contact() const noexcept {
    return phase_ == Phase::waiting ? Phase::waiting : Phase::held;
  }

  constexpr void enter(Phase phase) noexcept { phase_ = phase; }

 private:
  Settings settings_;
  Phase phase_ = Phase::waiting;
};

constexpr const char* validate(const ContactGate::Settings& settings) noexcept {
  const auto& [minimum_penetration, make_force, break_force] = settings;
  return detail::first_fault({
      {detail::lies_in(minimum_penetration, 0.0, 1e100),
       "gate.minimum_penetration must be in [0, 1e100] m"},
      {detail::lies_in(make_force, 0.0, 1e100), "gate.make_force must be in [0, 1e100] N"},
      {detail::lies_in(break_force, 0.0, make_force),
       "gate.break_force must be in [0, make_force]"},
  });
}

// The forgetting factor λ = 1 − (1 − λ₀) e^(−α t), with t since the start of contact. α = 0 makes
// it constant.
class Forgetting {
 public:
  struct Settings {
    double initial_factor = 1.0;  // λ₀, in (0, 1]
    double rate = 0.0;            // α, 1/s

    bool operator==(const Settings&) const = default;
  };

  Forgetting(const Settings& settings, double sample_time) noexcept
      : settings_(settings), sample_time_(sample_time) {}

  double factor() const noexcept { return 1.0 - departure_; }

  void rearm() noexcept { departure_ = 1.0 - settings_.initial_factor; }

  void advance(double dt) noexcept {
    departure_ *= dt == sample_time_ ? decay_ : std::exp(-settings_.rate * dt);
    // 1 − λ below ε/2 ≈ 1e-16 has no effect on λ; 1e-20 is well below that, and far above subnormal
    // numbers, which are slow.
    if (departure_ < 1e-20) departure_ = 0.0;
  }

 private:
  Settings settings_;
  double sample_time_;
  double decay_ = std::exp(-settings_.rate * sample_time_);
  double departure_ = 1.0 - settings_.initial_factor;  // 1 − λ
};

constexpr const char* validate(const Forgetting::Settings& settings) noexcept {
  const double factor = settings.initial_factor;
  return detail::first_fault(
      {{factor > 0.0 && factor <= 1.0, "forgetting.initial_factor must be in (0, 1]"},
       {detail::lies_in(settings.rate, 0.0, 1e6), "forgetting.rate must be in [0, 1e6] 1/s"}});
}

// No forgetting.
inline constexpr Forgetting::Settings no_forgetting{};

// The choice of the paper (section V-A-3): λ₀ = 0.99, and the smallest of its good rates, 5 to 8
// 1/s.
inline constexpr Forgetting::Settings fading_forgetting{.initial_factor = 0.99, .rate = 5.0};

// Self-perturbing RLS (Park & Jun 1992; the paper's section VII): β·NINT(γ e²) is added to the
// diagonal of P, and λ is reset to λ₀ whenever that is not zero.
//
// The paper's 0.05 and 2.5, read in the only way that reproduces its Fig. 19: √(0.5/γ) = 0.45 N
// lies between the sensor's noise band (0.05 N) and the error after a switch (0.5 N).
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
  return detail::first_fault(
      {{detail::lies_in(settings.gain, 0.0, 1e20), "perturbation.gain must be in [0, 1e20]"},
       {detail::lies_in(settings.sensitivity, 0.0, 1e40),
        "perturbation.sensitivity must be in [0, 1e40] 1/N²"}});
}

// The interface of a method for the loop of recursive_estimator.hpp.
//
// A method identifies one force law. It is a trivially copyable object with state that neither
// allocates nor throws. It receives only samples in contact and within its range, in scaled units,
// and returns SI.
//
// The loop also calls, if the method defines them, `free(sample, dt, λ)` for a finite sample out of
// contact, `interrupt()` if contact ends without one, `pass(dt)` for a refused or rejected sample,
// and `gate(given, units)` for the gate to use, if the method needs more samples than the given
// gate passes. For a sample whose contact is undecided learn() returns `held`, even if the method
// stores it.
template <class M>
concept Method =
    std::is_trivially_copyable_v<M> &&
    requires(M method, const M known, const Sample& sample, const Units& units, double number,
             const typename M::Settings& settings, const typename M::Row& row) {
      // The force law that it identifies, of M::Law::size parameters.
      typename M::Law;
      // Constructed from settings, whose defaults are those of the named estimator, and the units.
      // `validate` returns the error in the settings as a message, or null if they are valid.
      requires std::constructible_from<M, const typename M::Settings&, const Units&>;
      { validate(settings) } -> std::same_as<const char*>;
      { M::default_forgetting } -> std::convertible_to<Forgetting::Settings>;
      { M::default_scale } -> std::convertible_to<Scale>;

      // Whether it uses the forgetting factor and the self-perturbation that learn() gets.
      // `validate` refuses settings that would have no effect.
      { M::forgets } -> std::convertible_to<bool>;
      { M::perturbs } -> std::convertible_to<bool>;

      // Whether a sample is within the range of its arithmetic.
      { known.in_range(sample) } -> std::same_as<bool>;

      // The sample as the method uses it, such as a regressor and an output.
      { method.prepare(sample, number /* dt */) } -> std::same_as<typename M::Row>;
      // The one-step prediction of the force in scaled units, before the sample is learned.
      { known.predict(row) } -> std::same_as<double>;
      // Learns a prepared sample, `dt` [s] after the one before it, with the forgetting factor λ
      // and the perturbation π: completely (updated, guarded) or not at all (any other status).
      {
        method.learn(row, number /* dt */, number /* λ */, number /* π */)
      } -> std::same_as<Status>;

      // Restarts from the present estimate as a prior, after a change of the material …
      { method.reinitialise() };
      // … and again from the same prior when the transient is over.
      { method.reinitialise_after_transient() };

      // The present estimate, in SI: the predicted force [N] of the sensor, the law, the complete
      // estimate, and the part of it that a trace contains.
      { known.force(units, number /* x, m */, number /* v, m/s */) } -> std::same_as<double>;
      { known.law(units) } -> std::same_as<typename M::Law>;
      { known.fit(units) } -> std::same_as<Fit<typename M::Law>>;
      { known.snapshot(units) } -> std::same_as<Snapshot<typename M::Law>>;
    };

// A method may also define `withdraw(count)`, which removes up to eight of the latest samples that
// turned out to be outliers; methods without it keep these few. And it may define `latest(units)`,
// if an estimate at each sample costs too much: the estimate of a few samples ago, without its
// errors, which predict() uses.

}  // namespace palpate
