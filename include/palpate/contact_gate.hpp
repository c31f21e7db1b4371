// Which samples are contact. Logarithms need x > 0 and F > 0, and noise near the surface biases
// them (E ln(F + ε) ≈ ln F − σ²/2F²), so thresholds belong at about ten times the noise.
#pragma once

#include <cstdint>

namespace palpate {

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

  // The phase that this sample leads to; nothing changes until it is entered.
  constexpr Phase next(double penetration, double force) const noexcept {
    const bool touching = phase_ == Phase::contact;
    const double threshold = touching ? settings_.break_force : settings_.make_force;
    if (penetration > settings_.minimum_penetration && force > threshold) return Phase::contact;
    return without_contact();
  }

  // The phase that the end of contact leads to.
  constexpr Phase without_contact() const noexcept {
    return phase_ == Phase::waiting ? Phase::waiting : Phase::held;
  }

  constexpr void enter(Phase phase) noexcept { phase_ = phase; }

 private:
  Settings settings_;
  Phase phase_ = Phase::waiting;
};

constexpr const char* validate(const ContactGate::Settings& settings) noexcept {
  if (!(settings.minimum_penetration >= 0.0 && settings.minimum_penetration <= 1e100)) {
    return "gate.minimum_penetration must be in [0, 1e100] m";
  }
  if (!(settings.make_force >= 0.0 && settings.make_force <= 1e100)) {
    return "gate.make_force must be in [0, 1e100] N";
  }
  if (!(settings.break_force >= 0.0 && settings.break_force <= settings.make_force)) {
    return "gate.break_force must be in [0, make_force]";
  }
  return nullptr;
}

}  // namespace palpate
