// Lost positions: single samples that leave their neighbours, as where one packet or one count is
// lost. In a velocity filter one of them would spoil a whole window.
//
//   away > max(8 σ, 2 % of the largest position, 1.5 steps)   and   away > 3 range
//
// `away` is how far a sample is from the median of itself and the two before and after it, `range`
// what those four span. The top of a sine at 66 Hz is 2 % above its neighbours, and a lever that
// shakes is no noise of all the recording: hence the range. σ is that of white noise by the running
// median of the fourth differences, which suppress a motion as (ωT)⁴ and have 70 times its
// variance. The offline rule is the same, with σ, the largest position and the step of the whole
// recording in place of those so far.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "palpate/running_median.hpp"

namespace palpate {

class LostPositions {
 public:
  // How many samples have to come after one before it can be judged.
  static constexpr std::size_t ahead = 2;

  // Takes a position [m], and says whether the one of two samples ago is lost. The first two after
  // a break have no neighbours before them, and are taken.
  bool observe(double position) noexcept {
    for (std::size_t age = size - 1; age > 0; --age) recent_[age] = recent_[age - 1];
    recent_[0] = position;
    if (held_ > 0) learn_step(std::abs(recent_[0] - recent_[1]));
    if (held_ < size && ++held_ < size) return false;
    if (seen_ < few) ++seen_;

    const double difference =
        recent_[0] + recent_[4] - 4.0 * (recent_[1] + recent_[3]) + 6.0 * recent_[2];
    const bool lost = leaves(limit());
    noise_.learn(std::abs(difference));
    if (!lost) largest_ = std::max(fading * largest_, std::abs(recent_[2]));
    return lost;
  }

  // The next position does not follow the latest.
  void interrupt() noexcept { held_ = 0; }

 private:
  static constexpr std::size_t size = 2 * ahead + 1;
  static constexpr double beyond = 8.0;  // σ
  static constexpr double least = 0.02;  // of the largest position
  static constexpr double steps = 1.5;   // a value that rounds up and down is not lost
  static constexpr double alone = 3.0;   // times the range of its neighbours
  // Median of |Δ⁴| of normal noise, over its deviation: 0.6745 √70.
  static constexpr double difference_median = 5.6432;
  // Noise is known from so many samples on, though all were rounded alike.
  static constexpr std::uint32_t few = 30;
  // A position that was no position is no longer the largest some ten thousand samples later.
  static constexpr double fading = 1.0 - 1e-4;
  static constexpr double unlimited = std::numeric_limits<double>::infinity();

  void learn_step(double step) noexcept {
    if (step > 0.0) step_ = std::min(step_, step);
  }

  double limit() const noexcept {
    const double doubt = seen_ >= few ? 1.0 : noise_.doubt();
    if (doubt == unlimited) return unlimited;
    const double rounding = step_ < unlimited ? steps * step_ : 0.0;
    const double noise = beyond / difference_median * doubt * noise_.value();
    return std::max({noise, least * largest_, rounding});
  }

  bool leaves(double limit) const noexcept {
    const auto [after, next, own, before, first] = recent_;
    // Of the many samples that hardly leave their neighbours' mean none is lost.
    if (!(std::abs(own - 0.5 * (next + before)) > 0.5 * limit)) [[likely]]
      return false;
    std::array<double, size> sorted = recent_;
    std::sort(sorted.begin(), sorted.end());
    const double away = std::abs(own - sorted[size / 2]);
    const auto [low, high] = std::minmax({after, next, before, first});
    return away > limit && away > alone * (high - low);
  }

  std::array<double, size> recent_{};  // the newest first
  std::size_t held_ = 0;
  detail::RunningMedian noise_;  // |Δ⁴|
  std::uint32_t seen_ = 0;
  double largest_ = 0.0;
  double step_ = unlimited;  // the least that is not zero
};

}  // namespace palpate
