// A gate for one contact, chosen from its samples.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "channel.hpp"
#include "palpate/method.hpp"

namespace palpate::rows {

// Of as many samples each.
struct Pressed {
  const double* penetration;
  const double* force;
  std::size_t count;

  // Whether the probe presses at a sample, by the signs.
  bool touches(std::size_t k) const noexcept {
    const double x = penetration[k], f = force[k];
    return (x > 0.0) & (f > 0.0) & (x < largest) & (f < largest);
  }
};

// F ≥ 10 σ keeps the bias of the logarithm, σ²/2F², under 0.5 %.
constexpr double noise_factor = 10.0;
// Of the contact within 3 σ of the gate; deep probing has under 0.5 %.
constexpr double most_undecided = 0.03;

// Those of a channel where this holds of the sample's number, in order.
template <class Holds>
Numbers chosen(const double* channel, std::size_t count, double* to, const Holds& holds) noexcept {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < count; ++k) {
    to[kept] = channel[k];  // there is no branch to foresee
    kept += static_cast<std::size_t>(holds(k));
  }
  return {to, kept};
}

// Ten times the noise, between 1 % and 10 % of the 99th percentile: so that a spike sets nothing.
inline double threshold(double noise, double top) noexcept {
  return std::min(std::max(noise_factor * noise, 0.01 * top), 0.10 * top);
}

// Thresholds for contact, of samples `touching`; `spare` holds twice as many numbers as there are
// samples.
//
// A force near its threshold is taken where noise made it large, which biases: probing near the
// surface costs a soft material 10 % of K. Where that is more than 3 % of the contact the depth
// decides instead, where it separates them: contact is then what is deeper than where the force
// falls short of its threshold, but for one force in a thousand; not beyond half way.
template <class Touching>
ContactGate::Settings gate_of(const Pressed& in, const Touching& touching, double* spare) noexcept {
  double* const forces = spare + in.count;
  std::size_t touched = 0;
  for (std::size_t k = 0; k < in.count; ++k) {
    spare[touched] = in.penetration[k];  // there is no branch to foresee
    forces[touched] = in.force[k];
    touched += static_cast<std::size_t>(touching(k));
  }
  if (touched == 0) return {};
  const double deepest = percentile({spare, touched}, 0.99);
  const double highest = percentile({forces, touched}, 0.99);
  const double noise = noise_of({in.force, in.count}, spare);
  const double make = threshold(noise, highest);
  const double least = threshold(noise_of({in.penetration, in.count}, spare), deepest);
  std::size_t inside = 0, undecided = 0;
  for (std::size_t k = 0; k < in.count; ++k) {
    const bool deep = touching(k) & (in.penetration[k] > least);
    inside += static_cast<std::size_t>(deep);
    undecided += static_cast<std::size_t>(deep & (std::abs(in.force[k] - make) < 3.0 * noise));
  }
  if (static_cast<double>(undecided) > most_undecided * static_cast<double>(inside)) {
    const Numbers light = chosen(in.penetration, in.count, spare, [&](std::size_t k) noexcept {
      const double x = in.penetration[k];
      return (x > least) & (x < largest) & (in.force[k] <= make);
    });
    const std::size_t spared = touched / 1000;
    if (light.count > spared) {
      const double depth = two_in_order(light, light.count - 1 - spared)[0];
      if (depth <= 0.5 * deepest) return {depth, make, 0.0};
    }
  }
  return {least, make, 0.8 * make};
}

// Median and largest penetration where contact is firm, as its gate says; NaN where it never is.
// `spare` holds twice as many numbers as there are samples.
inline std::array<double, 2> working_depths(const Pressed& in, double* spare) noexcept {
  const auto touching = [&](std::size_t k) noexcept { return in.touches(k); };
  const ContactGate::Settings gate = gate_of(in, touching, spare);
  const Numbers firm = chosen(in.penetration, in.count, spare, [&](std::size_t k) noexcept {
    return (in.penetration[k] > gate.minimum_penetration) & (in.force[k] > gate.make_force);
  });
  if (firm.count == 0) return {NAN, NAN};
  const double deepest = detail::ends_of(firm)[1];
  return {percentile(firm, 0.5), deepest};
}

}  // namespace palpate::rows
