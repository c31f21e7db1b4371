// The median of sizes that come one at a time, in a few bytes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace palpate::detail {

// The median of sizes: up by a ratio where one is larger, down where it is smaller. No size moves
// it far, however large; a size of zero is that of a held or rounded value and says nothing.
class RunningMedian {
 public:
  double value() const noexcept { return value_; }

  // What it is to be multiplied by to be relied on: the median of 30 normal sizes is within a
  // quarter, that of the first few within four times.
  double doubt() const noexcept { return seen_ >= few ? 1.0 : seen_ >= 4 ? 4.0 : unknown; }
  // Whether one outlier moves it by little.
  bool settled() const noexcept { return seen_ >= 2 * few; }

  void learn(double size) noexcept {
    if (!(size > smallest)) return;
    if (seen_ >= slow) [[likely]] {
      // Looked up: which way it goes no processor can guess, and a wrong guess costs 5 ns.
      value_ *= steps[size > value_];
      return;
    }
    if (++seen_ == 1) value_ = std::min(size, largest);
    const double part = (seen_ < few ? 8.0 : 2.0) / static_cast<double>(seen_);
    const double ratio = 1.0 + std::min(1.0, part);
    value_ = size > value_ ? value_ * ratio : value_ / ratio;
  }

  // What it was learned from is no longer so.
  void raise_to(double size) noexcept { value_ = std::clamp(size, value_, largest); }

 private:
  // The first sizes move it twofold, as a motion may begin slowly, then the k-th by 8/k, from the
  // thirtieth on by 2/k, and in the end by a 256th: a burst of outliers moves it little.
  static constexpr std::uint32_t few = 30, slow = 512;
  static constexpr double steps[2] = {1.0 / (1.0 + 2.0 / slow), 1.0 + 2.0 / slow};
  static constexpr double smallest = 1e-150, largest = 1e150;
  static constexpr double unknown = std::numeric_limits<double>::infinity();

  double value_ = 0.0;
  std::uint32_t seen_ = 0;
};

}  // namespace palpate::detail
