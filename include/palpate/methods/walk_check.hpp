// Whether what a filter of a random walk sees moves faster than the walk allows.
//
// A walk as fast as assumed leaves errors without correlation. Where the truth walks r times as far
// in a second, the filter lags, and one error tells the next:
//
//   E[e_k e_{k−1}] = P (r² − 1)/2,   P the variance of the predicted force
//
// so the ratio of their means, over the last thousand samples or so, says r whatever the noise.
// Noise that is correlated itself does the same: the two cannot be told apart by the errors.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace palpate::detail {

class WalkCheck {
 public:
  // error: of the prediction, as the filter learned from it; predicted: P; whole: P and the noise.
  constexpr void observe(double error, double predicted, double whole) noexcept {
    samples_ = std::min(samples_ + 1, window);
    const double gain = 1.0 / static_cast<double>(samples_);
    product_ += gain * (error * previous_ - product_);
    predicted_ += gain * (predicted - predicted_);
    whole_ += gain * (whole - whole_);
    previous_ = error;
  }

  // Five deviations of the mean product of white errors beyond what a truth three times faster than
  // the walk would give.
  bool too_slow() const noexcept {
    const double scatter = whole_ / std::sqrt(static_cast<double>(window));
    return samples_ == window && product_ > most_lag * predicted_ + 5.0 * scatter;
  }

 private:
  static constexpr std::uint64_t window = 1000;
  // (3² − 1)/2. Up to twice as fast the bars are √1.25 too narrow, and no flag is worth it.
  static constexpr double most_lag = 4.0;

  std::uint64_t samples_ = 0;
  double previous_ = 0.0, product_ = 0.0, predicted_ = 0.0, whole_ = 0.0;
};

}  // namespace palpate::detail
