// Relaxing branches ġ = d(ξⁿ)/dt − g/τ for every exponent of the grid and a ladder of relaxation
// times: exact for ξⁿ linear between samples, whatever the time step.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/viscoelastic/power_table.hpp"

namespace palpate::viscoelastic {

// Times τᵢ = τ₀ rⁱ with r = 2^Doublings and τ₀ = two time steps: what relaxes sooner is over
// before the next sample.
template <std::size_t Count, std::size_t Doublings>
class Ladder {
 public:
  static constexpr std::size_t count = Count;
  static constexpr double ratio = static_cast<double>(1U << Doublings);

  explicit Ladder(double sample_time) noexcept : shortest_(2.0 * sample_time) { set(sample_time); }

  double time(double rung) const noexcept { return shortest_ * std::pow(ratio, rung); }

  // What is left of a branch after a step, and what it takes of a change of ξⁿ during it.
  struct Step {
    std::array<double, Count> kept;
    std::array<double, Count> gain;
  };

  const Step& over(double dt) noexcept {
    if (dt != dt_) set(dt);
    return step_;
  }

  Step step_over(double dt) const noexcept {
    Ladder other = *this;
    return other.over(dt);
  }

 private:
  // 1 − e^(−dt/τ) of the longest by expm1; half the time doubles the exponent, e ← e (2 − e).
  void set(double dt) noexcept {
    dt_ = dt;
    double time = this->time(static_cast<double>(Count - 1));
    double lost = -std::expm1(-dt / time);
    for (std::size_t i = Count; i-- > 0;) {
      step_.kept[i] = 1.0 - lost;
      step_.gain[i] = lost * time / dt;
      for (std::size_t doubling = 0; doubling < Doublings; ++doubling) lost *= 2.0 - lost;
      time /= ratio;
    }
  }

  double shortest_;
  double dt_ = 0.0;
  Step step_{};
};

// The state of all branches. It is what penetration made it, whatever the force said: it is carried
// through loss of contact, where ξⁿ counts as 0.
template <class Times>
class Branches {
 public:
  using Row = std::array<double, Grid::exponents>;

  explicit Branches(double sample_time) noexcept : times_(sample_time) {}

  // Null where there is no depth.
  void advance(const Powers* powers, double dt) noexcept {
    const auto& step = times_.over(dt);
    Row change;
    for (std::size_t j = 0; j < Grid::exponents; ++j) {
      const double now = powers ? (*powers)[Grid::first_exponent + j] : 0.0;
      change[j] = now - elastic_[j];
      elastic_[j] = now;
    }
    for (std::size_t i = 0; i < Times::count; ++i) {
      const double kept = step.kept[i], gain = step.gain[i];
      // What decays would end in subnormal numbers, on which processors are slow: below 1e-76 it
      // is rounded away.
      for (std::size_t j = 0; j < Grid::exponents; ++j) {
        states_[i][j] = (states_[i][j] * kept + gain * change[j] + 1e-60) - 1e-60;
      }
    }
  }

  // Relaxed, at this depth.
  void rest(const Powers* powers) noexcept {
    states_ = {};
    for (std::size_t j = 0; j < Grid::exponents; ++j) {
      elastic_[j] = powers ? (*powers)[Grid::first_exponent + j] : 0.0;
    }
  }

  const Times& times() const noexcept { return times_; }
  const std::array<Row, Times::count>& states() const noexcept { return states_; }
  const Row& elastic() const noexcept { return elastic_; }

 private:
  Times times_;
  Row elastic_{};  // ξⁿ at the last sample
  std::array<Row, Times::count> states_{};
};

}  // namespace palpate::viscoelastic
