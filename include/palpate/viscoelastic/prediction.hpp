// A candidate's force at the next sample, in scaled units.
#pragma once

#include <cmath>
#include <cstddef>

#include "palpate/sample.hpp"
#include "palpate/viscoelastic/branches.hpp"
#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/samples.hpp"
#include "palpate/viscoelastic/spectrum.hpp"
#include "palpate/viscoelastic/window.hpp"

namespace palpate::viscoelastic {

template <class Times>
class Prediction {
 public:
  Prediction() = default;
  Prediction(std::size_t candidate, double n, double second, const Vector<parts>& value) noexcept
      : candidate_(candidate),
        n_(n),
        value_(value),
        around_(window(Grid::place_of_exponent(n), Grid::exponents, {})),
        spectrum_(spectrum_of<Times>(candidates[candidate].memory, second)) {}

  // Once the branches have been advanced to the sample.
  [[gnu::noinline]] double force(const Branches<Times>& branches, const Sample& s) const noexcept {
    if (!(s.penetration > 0.0)) return value_[offset];
    double force = without_memory(s);
    if (!remembers()) return force;
    for (std::size_t i = spectrum_.first; i < spectrum_.end; ++i) {
      force += weight(i) * around_.of(branches.states()[i].data());
    }
    return force;
  }

  // As if the sample came `dt` after the last one.
  [[gnu::noinline]] double force_after(const Branches<Times>& branches, const Sample& s,
                                       double dt) const noexcept {
    if (!(s.penetration > 0.0)) return value_[offset];
    double force = without_memory(s);
    if (!remembers()) return force;
    const auto step = branches.times().step_over(dt);
    const Powers powers = powers_of(s.penetration);
    const double change =
        around_.of(powers.data() + Grid::first_exponent) - around_.of(branches.elastic().data());
    for (std::size_t i = spectrum_.first; i < spectrum_.end; ++i) {
      const double state = around_.of(branches.states()[i].data());
      force += weight(i) * (state * step.kept[i] + step.gain[i] * change);
    }
    return force;
  }

 private:
  bool remembers() const noexcept { return value_[memory] != 0.0; }
  double weight(std::size_t i) const noexcept { return value_[memory] * spectrum_.weight[i]; }

  double without_memory(const Sample& s) const noexcept {
    const double power = std::exp(n_ * std::log(s.penetration));
    const bool half_space = candidates[candidate_].damping == Damping::half_space;
    const double damped = half_space ? power / s.penetration : power;
    return value_[offset] + value_[stiffness] * power + value_[damping] * s.velocity * damped;
  }

  std::size_t candidate_ = 1;
  double n_ = 1.0;
  Vector<parts> value_{};
  Window around_{};
  Spectrum<Times::count> spectrum_{};
};

}  // namespace palpate::viscoelastic
