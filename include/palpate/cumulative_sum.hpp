// A cumulative sum of squared errors over their variance (Page 1954), which alarms only beyond what
// it has come back from before:
//
//   z = min(e²/s², 25);  g ← max(0, g + z − drift);  alarm at g > threshold and g > 3 × its peaks
//
// s² follows the clipped e² slowly.
#pragma once

#include <algorithm>
#include <cstdint>

namespace palpate::detail {

class CumulativeSum {
 public:
  // Where s² begins, and what it never falls below.
  void set_variance(double variance, double least) noexcept {
    variance_ = std::max(variance, least);
    least_ = least;
    per_variance_ = 1.0 / variance_;
  }
  double variance() const noexcept { return variance_; }

  // Lets s² follow a squared error, by `gain` of the way.
  void learn(double square, double gain) noexcept { follow(square * per_variance_, gain); }

  // The same; true beyond the threshold and thrice its peaks. What is withheld counts as a peak
  // instead.
  bool add(double square, double gain, double drift, double threshold, bool withheld) noexcept {
    const double ratio = square * per_variance_;
    follow(ratio, gain);
    // z beyond 25 is an outlier, of which it takes three to reach 60.
    sum_ = std::max(0.0, sum_ + std::min(ratio, 25.0) - drift);
    if (zero()) {
      highest_ = std::max(highest_, peak_);
      peak_ = 0.0;
    }
    peak_ = std::max(peak_, sum_);
    if (withheld) highest_ = std::max(highest_, sum_);
    return sum_ > threshold && sum_ > 3.0 * highest_;
  }
  bool zero() const noexcept { return sum_ == 0.0; }

  // After an alarm, from which it did not come back.
  void restart() noexcept { sum_ = peak_ = 0.0; }

 private:
  // e² counts up to three deviations: 99.7 % of white noise, and little of a change. Every eighth
  // is early enough for a variance, and saves a division.
  void follow(double ratio, double gain) noexcept {
    growth_ += gain * (std::min(ratio, 9.0) - 1.0);
    if (++followed_ % 8 != 0) return;
    // With a gain near one eight of them would take it below zero.
    set_variance(variance_ * std::max(1.0 + growth_, 0.1), least_);
    growth_ = 0.0;
  }

  double variance_ = 0.0;
  double least_ = 0.0;
  double per_variance_ = 0.0;
  double growth_ = 0.0;         // of the variance since it was last renewed, relative
  std::uint32_t followed_ = 0;  // errors
  double sum_ = 0.0;
  double peak_ = 0.0;     // of the sum since it was last zero
  double highest_ = 0.0;  // of the peaks that it came back from
};

}  // namespace palpate::detail
