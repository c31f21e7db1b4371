// Units of the arithmetic. An estimator divides its inputs by these and gives its law back in SI,
// so that nanonewtons and kilonewtons meet the same covariance.
#pragma once

#include <cmath>

namespace palpate {

struct Scale {
  double penetration = 1.0;  // m
  double velocity = 1.0;     // m/s
  double force = 1.0;        // N
};

// A scale with what the way there and back needs, worked out once.
struct Units : Scale {
  explicit Units(const Scale& scale) noexcept
      : Scale(scale),
        per_penetration(1.0 / scale.penetration),
        per_velocity(1.0 / scale.velocity),
        per_force(1.0 / scale.force),
        log_penetration(std::log(scale.penetration)),
        log_force(std::log(scale.force)) {}

  double per_penetration;
  double per_velocity;
  double per_force;
  double log_penetration;
  double log_force;
};

// One sample, in whichever units its holder says.
struct Sample {
  double penetration;
  double velocity;
  double force;
};

inline Sample scaled(const Sample& s, const Units& u) noexcept {
  return {s.penetration * u.per_penetration, s.velocity * u.per_velocity, s.force * u.per_force};
}

}  // namespace palpate
