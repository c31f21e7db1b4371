// A relaxation spectrum as branches, for a law that is given: what identification answers, and what
// a laboratory presses.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/force_laws.hpp"

namespace palpate::viscoelastic {

// Of wᵢ ∝ τ^−α between the shortest and the longest time: two a factor of two, each in the middle
// of its part of ln τ. Ripples of K′ and B′ are then below 1e-10 of them, but near the ends of the
// spectrum, where they are below 1e-3.
struct RelaxationBranches {
  static constexpr std::size_t most = 128;

  std::array<double, most> times{};  // s
  std::array<double, most> weights{};
  std::size_t count = 0;

  explicit RelaxationBranches(const GeneralisedHuntCrossley& law) noexcept {
    if (!(law.relaxation_stiffness != 0.0 && law.longest_time > 0.0)) return;
    const double shortest = law.shortest_time > 0.0 ? law.shortest_time : law.longest_time;
    const double width = std::log(std::max(law.longest_time / shortest, 1.0));
    const double wanted = std::ceil(2.0 * width / std::log(2.0) - 1e-9);
    count = static_cast<std::size_t>(std::clamp(wanted, 1.0, static_cast<double>(most)));
    const double step = width / static_cast<double>(count);
    double total = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double place = step * (static_cast<double>(i) + 0.5);
      times[i] = shortest * std::exp(place);
      weights[i] = std::exp(-law.spectrum_exponent * place);
      total += weights[i];
    }
    for (std::size_t i = 0; i < count; ++i) weights[i] /= total;
  }
};

// Goes `dt` on to a penetration: `state` is xⁿ at the last one and then a number for each branch.
// Exact where xⁿ is linear in between.
inline void relax(const GeneralisedHuntCrossley& law, const RelaxationBranches& branches, double x,
                  double dt, double* state) noexcept {
  const double elastic = x > 0.0 ? std::pow(x, law.exponent) : 0.0;
  const double change = elastic - state[0];
  state[0] = elastic;
  for (std::size_t i = 0; i < branches.count; ++i) {
    const double lost = -std::expm1(-dt / branches.times[i]);
    const double gain = dt > 0.0 ? lost * branches.times[i] / dt : 1.0;
    // Below 1e-76 a branch is rounded to zero: it would end in subnormal numbers, which are slow.
    state[1 + i] = (state[1 + i] * (1.0 - lost) + gain * change + 1e-60) - 1e-60;
  }
}

// The force at a penetration that the state has gone to.
inline double relaxing_force(const GeneralisedHuntCrossley& law, const RelaxationBranches& branches,
                             double x, double v, const double* state) noexcept {
  if (x <= 0.0) return 0.0;
  double memory = 0.0;
  for (std::size_t i = 0; i < branches.count; ++i) memory += branches.weights[i] * state[1 + i];
  return law.force(x, v) + law.relaxation_stiffness * memory;
}

}  // namespace palpate::viscoelastic
