// A candidate's force at the next sample, in scaled units.
#pragma once

#include <cmath>
#include <cstddef>

#include "palpate/sample.hpp"
#include "palpate/viscoelastic/branches.hpp"
#include "palpate/viscoelastic/solution.hpp"
#include "palpate/viscoelastic/spectrum.hpp"
#include "palpate/viscoelastic/window.hpp"

namespace palpate::viscoelastic {

inline double force_without_memory(const Fitted& fit, const Sample& s) noexcept {
  const double power = std::exp(fit.n * std::log(s.penetration));
  const bool half_space = fit.law().damping == Damping::half_space;
  const double damped = half_space ? power / s.penetration : power;
  return fit.value[offset] + fit.value[stiffness] * power +
         fit.value[damping] * s.velocity * damped;
}

inline bool remembers(const Fitted& fit) noexcept { return fit.value[memory] != 0.0; }

// Once the branches have been advanced to the sample.
template <class Times>
[[gnu::noinline]] double force_of(const Fitted& fit, const Branches<Times>& branches,
                                  const Sample& s) noexcept {
  if (!(s.penetration > 0.0)) return fit.value[offset];
  const double force = force_without_memory(fit, s);
  if (!remembers(fit)) return force;
  const Window around = window(Grid::place_of_exponent(fit.n), Grid::exponents);
  const auto spectrum = spectrum_of<Times>(fit.law().memory, fit.second());
  Vector<window_points> mean{};
  for (std::size_t i = spectrum.first; i < spectrum.end; ++i) {
    const double* states = branches.states()[i].data() + around.first;
    for (std::size_t k = 0; k < window_points; ++k) mean[k] += spectrum.weight[i] * states[k];
  }
  return force + fit.value[memory] * detail::dot(around.weights, mean);
}

// As if the sample came `dt` after the last one.
template <class Times>
[[gnu::noinline]] double force_after(const Fitted& fit, const Branches<Times>& branches,
                                     const Sample& s, double dt) noexcept {
  Branches<Times> then = branches;
  then.advance(s.penetration > 0.0 ? s.penetration : 0.0, dt);
  return force_of(fit, then, s);
}

}  // namespace palpate::viscoelastic
