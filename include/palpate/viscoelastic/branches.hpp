// The relaxation state: branches ġ = d(ξⁿ)/dt − g/τ for a ladder of relaxation times and every
// exponent of the grid. They depend on the penetration only, not on the force.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/viscoelastic/power_table.hpp"

namespace palpate::viscoelastic {

// Relaxation times on the ladder. With twelve an update costs a fifth more, for the same errors.
inline constexpr std::size_t rungs = 10;

// Columns for the unknown state of samples that begin in contact, e^(−t/4Δt) and e^(−t/longest).
// With four, K′ of a silicone pad was 30 % too low.
inline constexpr std::size_t start_columns = 2;
inline constexpr double first_start_steps = 4.0;

// Relaxation times from two time steps on, since what relaxes sooner is over before the next
// sample. They are a factor of two apart and end at the longest; if all do not reach it, they are
// further apart: 2.3 with a longest of 4096 steps.
class Ladder {
 public:
  Ladder(double sample_time, double longest) noexcept
      : sample_time_(sample_time), longest_(longest) {
    constexpr double most = static_cast<double>(rungs - 1);
    // The longest is four steps at least; rounding may not exclude a rung.
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
  // How many of the times are not above the longest.
  std::size_t open() const noexcept { return open_; }

  // What is left of a branch after a step, and what it takes of a change of ξⁿ during the step.
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
    // In a step below rounding nothing relaxes; time over step would overflow in a still smaller.
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

// All branches. Out of contact ξⁿ counts as 0 and they go on relaxing.
class Branches {
 public:
  Branches(double sample_time, double longest) noexcept : ladder_(sample_time, longest) {}

  // Advances to a depth (0 out of contact) by a time: exact for ξⁿ linear in between.
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

  // Fully relaxed at this depth.
  void rest(double depth) noexcept {
    states_ = {};
    start_ = {};
    depth_ = depth;
  }

  // At this depth, with a state that the columns of the start stand for.
  void begin_in_contact(double depth) noexcept {
    rest(depth);
    start_.fill(1.0);
  }

  const Ladder& ladder() const noexcept { return ladder_; }
  const std::array<NodeRow, rungs>& states() const noexcept { return states_; }
  const std::array<double, start_columns>& start() const noexcept { return start_; }
  // Whether the unknown state of the start is still felt.
  bool starting() const noexcept { return start_[start_columns - 1] > 1e-9; }
  double depth() const noexcept { return depth_; }

 private:
  // Decaying values below 1e-76 are set to zero: subnormal numbers would be slow.
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
