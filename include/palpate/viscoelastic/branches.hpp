// Relaxing branches ġ = d(ξⁿ)/dt − g/τ for every exponent of the grid and a ladder of relaxation
// times: exact for ξⁿ linear between samples, whatever the time step.
#pragma once

#include <algorithm>
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

  double sample_time() const noexcept { return 0.5 * shortest_; }
  double time(double rung) const noexcept { return shortest_ * std::pow(ratio, rung); }

  // What is left of a branch after a step, and what it takes of a change of ξⁿ during it.
  struct Step {
    std::array<double, Count> kept;
    std::array<double, Count> gain;
  };

  Step over(double dt) noexcept {
    if (dt != dt_) set(dt);
    // In a step below rounding nothing relaxes; time over step would overflow in a still smaller.
    double per_step = shortest_ / std::max(dt, 1e-18 * shortest_);
    Step step;
    for (std::size_t i = 0; i < Count; ++i, per_step *= ratio) {
      step.kept[i] = 1.0 - lost_[i];
      step.gain[i] = lost_[i] * per_step;
    }
    return step;
  }

 private:
  // 1 − e^(−dt/τ) of the longest by expm1; half the time doubles the
  // exponent, e ← e (2 − e) = e (1 + a), and squares what is left, a ← a².
  void set(double dt) noexcept {
    constexpr double longest = static_cast<double>(1ULL << Doublings * (Count - 1));
    dt_ = dt;
    double lost = -std::expm1(-std::max(dt, 1e-18 * shortest_) / (longest * shortest_));
    double kept = 1.0 - lost;
    for (std::size_t i = Count; i-- > 0;) {
      lost_[i] = lost;
      for (std::size_t doubling = 0; doubling < Doublings; ++doubling) {
        lost *= 1.0 + kept;
        kept *= kept;
      }
    }
  }

  double shortest_;
  double dt_ = 0.0;
  std::array<double, Count> lost_{};
};

// The state of all branches. It is what penetration made it, whatever the force said: it is carried
// through loss of contact, where ξⁿ counts as 0.
template <class Times>
class Branches {
 public:
  explicit Branches(double sample_time) noexcept : times_(sample_time) {}

  // To a depth, 0 for none, after so much time.
  void advance(double depth, double dt) noexcept {
    const auto step = times_.over(dt);
    if (depth == depth_) return decay(step);
    const NodeRow before = elastic_of(depth_), now = elastic_of(depth);
    depth_ = depth;
    NodeRow change;
    for (std::size_t j = 0; j < change.size(); ++j) change[j] = now[j] - before[j];
    for (std::size_t i = 0; i < Times::count; ++i) {
      const double kept = step.kept[i], gain = step.gain[i];
      for (std::size_t j = 0; j < change.size(); ++j) {
        states_[i][j] = states_[i][j] * kept + gain * change[j];
      }
    }
  }

  // Relaxed, at this depth.
  void rest(double depth) noexcept {
    states_ = {};
    depth_ = depth;
  }

  const Times& times() const noexcept { return times_; }
  const std::array<NodeRow, Times::count>& states() const noexcept { return states_; }
  double depth() const noexcept { return depth_; }

 private:
  // What decays would end in subnormal numbers, on which processors are slow: below 1e-76 it is
  // rounded away.
  void decay(const typename Times::Step& step) noexcept {
    for (std::size_t i = 0; i < Times::count; ++i) {
      for (double& state : states_[i]) state = (state * step.kept[i] + 1e-60) - 1e-60;
    }
  }

  Times times_;
  double depth_ = 0.0;  // at the last sample
  std::array<NodeRow, Times::count> states_{};
};

}  // namespace palpate::viscoelastic
