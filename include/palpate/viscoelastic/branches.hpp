// The relaxation state: branches ġ = d(ξⁿ)/dt − g/τ for a ladder of relaxation times and every
// exponent of the grid. They depend on the penetration only, not on the force.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/viscoelastic/power_table.hpp"

namespace palpate::viscoelastic {

// The number of relaxation times on the ladder. With twelve an update takes a fifth longer, and the
// errors are the same.
inline constexpr std::size_t rungs = 10;

// Two columns model the unknown state of samples that begin in contact: e^(−t/4Δt) and
// e^(−t/longest). With four columns, K′ of a silicone pad was 30 % too low.
inline constexpr std::size_t start_columns = 2;
inline constexpr double first_start_steps = 4.0;

// The ladder of relaxation times. It begins at two time steps, because a faster relaxation is over
// before the next sample. The times are a factor of two apart and end at the longest. If ten such
// times do not reach the longest, the factor is larger: 2.3 for a longest time of 4096 steps.
class Ladder {
 public:
  Ladder(double sample_time, double longest) noexcept
      : sample_time_(sample_time), longest_(longest) {
    constexpr double most = static_cast<double>(rungs - 1);
    // `longest` is at least four steps; the 1e-9 keeps rounding from excluding a rung.
    const double doublings = std::log2(longest / (2.0 * sample_time)) + 1e-9;
    ratio_ = doublings > most + 1e-6 ? std::exp2(doublings / most) : 2.0;
    open_ = doublings < most ? static_cast<std::size_t>(std::max(doublings, 1.0)) + 1 : rungs;
    double time = 2.0 * sample_time;
    for (double& each : times_) {
      each = time;
      time *= ratio_;
    }
    set(sample_time);
  }

  double sample_time() const noexcept { return sample_time_; }
  double longest() const noexcept { return longest_; }
  double ratio() const noexcept { return ratio_; }
  const std::array<double, rungs>& times() const noexcept { return times_; }
  // The number of relaxation times that do not exceed the longest.
  std::size_t open() const noexcept { return open_; }

  // The factors of one step: the decay of a branch, and its response to a change of ξⁿ during the
  // step.
  struct Step {
    std::array<double, rungs> kept;
    std::array<double, rungs> gain;
    std::array<double, start_columns> start_kept;
  };

  const Step& over(double dt) noexcept {
    if (dt != dt_) set(dt);
    return step_;
  }

 private:
  void set(double dt) noexcept {
    dt_ = dt;
    // Over a step below rounding nothing relaxes; over a still smaller one time/step would
    // overflow.
    const double bounded = std::max(dt, 1e-18 * sample_time_);
    for (std::size_t i = 0; i < rungs; ++i) {
      const double lost = -std::expm1(-bounded / times_[i]);
      step_.kept[i] = 1.0 - lost;
      step_.gain[i] = lost * (times_[i] / bounded);
    }
    step_.start_kept = {std::exp(-bounded / (first_start_steps * sample_time_)),
                        std::exp(-bounded / longest_)};
  }

  double sample_time_;
  double longest_;
  double ratio_;
  std::size_t open_;
  double dt_ = 0.0;
  std::array<double, rungs> times_{};
  Step step_{};
};

// The states of all branches. Out of contact ξⁿ counts as 0 and the branches continue to relax.
class Branches {
 public:
  Branches(double sample_time, double longest) noexcept : ladder_(sample_time, longest) {}

  // Advances by a time to a depth (0 out of contact): exact if ξⁿ changes linearly over the step.
  void advance(double depth, double dt) noexcept {
    const Ladder::Step& step = ladder_.over(dt);
    for (std::size_t i = 0; i < start_columns; ++i) {
      start_[i] = (start_[i] * step.start_kept[i] + 1e-60) - 1e-60;
    }
    if (depth == depth_) return decay(step);
    const NodeRow before = elastic_of(depth_), now = elastic_of(depth);
    depth_ = depth;
    NodeRow change;
    for (std::size_t j = 0; j < change.size(); ++j) change[j] = now[j] - before[j];
    for (std::size_t i = 0; i < rungs; ++i) {
      const double kept = step.kept[i], gain = step.gain[i];
      for (std::size_t j = 0; j < change.size(); ++j) {
        states_[i][j] = states_[i][j] * kept + gain * change[j];
      }
    }
  }

  // Sets the state to fully relaxed at this depth.
  void rest(double depth) noexcept {
    states_ = {};
    start_ = {};
    depth_ = depth;
  }

  // Begins at this depth with an unknown state, which the start columns model.
  void begin_in_contact(double depth) noexcept {
    rest(depth);
    start_.fill(1.0);
  }

  const Ladder& ladder() const noexcept { return ladder_; }
  const std::array<NodeRow, rungs>& states() const noexcept { return states_; }
  const std::array<double, start_columns>& start() const noexcept { return start_; }
  // Whether the unknown state of the start still has an effect.
  bool starting() const noexcept { return start_[start_columns - 1] > 1e-9; }
  double depth() const noexcept { return depth_; }

 private:
  // Sets decaying values below 1e-76 to zero, because arithmetic on subnormal numbers is slow.
  void decay(const Ladder::Step& step) noexcept {
    for (std::size_t i = 0; i < rungs; ++i) {
      for (double& state : states_[i]) state = (state * step.kept[i] + 1e-60) - 1e-60;
    }
  }

  Ladder ladder_;
  double depth_ = 0.0;  // at the last sample
  std::array<NodeRow, rungs> states_{};
  std::array<double, start_columns> start_{};
};

}  // namespace palpate::viscoelastic
