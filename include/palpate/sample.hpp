// A sample, the units of the arithmetic, and the status of one update.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "palpate/language.hpp"

namespace palpate {

// One sample, in units defined by its user.
struct Sample {
  double penetration;
  double velocity;
  double force;
};

// A setting that is true or false and fills a word: unused bytes would differ between equal saved
// states.
class Flag {
 public:
  constexpr Flag(bool value) noexcept : value_(value) {}
  constexpr operator bool() const noexcept { return value_ != 0; }

 private:
  std::uint64_t value_;
};

// The units of the arithmetic. An estimator divides its inputs by these and returns its law in SI,
// so the same initial covariance suits nanonewtons and kilonewtons.
struct Scale {
  double penetration = 1.0;  // m
  double velocity = 1.0;     // m/s
  double force = 1.0;        // N

  bool operator==(const Scale&) const = default;
};

namespace detail {

// A condition on settings, and the message if they violate it.
struct Requirement {
  bool met;
  const char* words;
};

constexpr const char* first_fault(std::initializer_list<Requirement> requirements) noexcept {
  for (const auto& [met, words] : requirements) {
    if (!met) return words;
  }
  return nullptr;
}

// False for NaN.
constexpr bool lies_in(double value, double least, double most) noexcept {
  return value >= least && value <= most;
}

}  // namespace detail

// The scale of a hand-sized robot.
inline constexpr Scale probing_scale{.penetration = 10e-3, .velocity = 20e-3, .force = 1.0};

// The error in these settings as a message; null if they are valid.
constexpr const char* validate(const Scale& scale) noexcept {
  // Products and quotients of three units stay within the range of a double.
  const auto unit = [](double value) noexcept { return detail::lies_in(value, 1e-30, 1e30); };
  return detail::first_fault(
      {{unit(scale.penetration), "scale.penetration must be in [1e-30, 1e30] m"},
       {unit(scale.velocity), "scale.velocity must be in [1e-30, 1e30] m/s"},
       {unit(scale.force), "scale.force must be in [1e-30, 1e30] N"}});
}

// A scale with precomputed conversion factors.
struct Units : Scale {
  explicit Units(const Scale& scale) noexcept : Scale(scale) {}

  double per_penetration = 1.0 / penetration;
  double per_velocity = 1.0 / velocity;
  double per_force = 1.0 / force;
  double log_penetration = std::log(penetration);
  double log_force = std::log(force);
};

namespace detail {

inline bool finite(const Sample& s) noexcept {
  return std::isfinite(s.penetration) && std::isfinite(s.velocity) && std::isfinite(s.force);
}

inline Sample scaled(const Sample& s, const Units& u) noexcept {
  return {s.penetration * u.per_penetration, s.velocity * u.per_velocity, s.force * u.per_force};
}

inline bool within(const Sample& s, double limit) noexcept {
  return std::abs(s.penetration) < limit && std::abs(s.velocity) < limit &&
         std::abs(s.force) < limit;
}

// Range of inputs for the logarithm.
inline bool touching(const Sample& s) noexcept { return s.penetration > 0.0 && s.force > 0.0; }

}  // namespace detail

// Result of one update.
enum class Status : std::uint8_t {
  waiting,       // no contact so far
  updated,       // in contact; the sample was taken
  guarded,       // taken, but without forgetting, to keep the covariance positive definite
  held,          // contact was lost; the estimate is held until the next contact
  restarted,     // taken; the material has changed, and the estimate restarted from the latest
                 // samples
  not_finite,    // refused: penetration, velocity or force is NaN or infinite
  invalid_step,  // refused: dt is not a positive, finite time
  out_of_range,  // refused: finite, but too large for the arithmetic
  rejected,      // rejected as an outlier
};

inline constexpr std::size_t status_count = static_cast<std::size_t>(Status::rejected) + 1;

constexpr bool taken(Status status) noexcept {
  return status == Status::updated || status == Status::guarded || status == Status::restarted;
}

}  // namespace palpate
