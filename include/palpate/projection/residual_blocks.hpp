// How much wider error bars must be because residuals are not white.
//
// Sums of residuals over blocks of 1, 2, 4 … samples: for white residuals their variance grows as
// the length of the block; where neighbours agree (a law that does not quite hold, a quantised
// sensor) it grows faster, up to the length of the correlation (Flyvbjerg & Petersen 1989).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace palpate::detail {

class ResidualBlocks {
 public:
  // Amortised two additions a sample: a block of length 2L is the sum of two of length L.
  void add(double residual) noexcept {
    double sum = residual;
    for (Level& level : levels_) {
      level.squares += sum * sum;
      ++level.blocks;
      if (level.blocks % 2 != 0) {
        level.half = sum;
        return;
      }
      sum += level.half;
    }
  }

  // Factor on variances, ≥ 1. A length counts with at least 16 blocks, which tell a variance to a
  // third, and only by what exceeds the scatter of white residuals (two standard deviations of the
  // variance of as many blocks, each √(2/blocks) of it).
  double inflation() const noexcept {
    const Level& single = levels_[0];
    if (single.blocks < fewest_blocks || !(single.squares > 0.0)) return 1.0;
    const double variance = single.squares / static_cast<double>(single.blocks);
    double largest = 1.0, length = 1.0;
    for (const Level& level : levels_) {
      if (level.blocks < fewest_blocks) break;
      const double blocks = static_cast<double>(level.blocks);
      const double scatter = 1.0 + 2.0 * std::sqrt(2.0 / blocks);
      largest = std::max(largest, level.squares / (blocks * length * variance * scatter));
      length *= 2.0;
    }
    return largest;
  }

  void clear() noexcept { *this = ResidualBlocks(); }

 private:
  static constexpr std::uint64_t fewest_blocks = 16;

  struct Level {
    double squares = 0.0;  // Σ (block sum)²
    double half = 0.0;     // the first of the two blocks that make the next longer one
    std::uint64_t blocks = 0;
  };

  // Blocks of up to 2³¹ samples: 25 days at 1 kHz.
  std::array<Level, 32> levels_{};
};

// The same over the later part of the samples only, at least their latter half: the errors of an
// estimate that was still on its way say nothing of the residuals of the one that it became.
class LatterResiduals {
 public:
  void add(double residual) noexcept {
    if (++samples_ == renewal_) {
      older_ = newer_;
      newer_.clear();
      renewal_ *= 2;
    }
    older_.add(residual);
    newer_.add(residual);
  }

  double inflation() const noexcept { return older_.inflation(); }

  void clear() noexcept { *this = LatterResiduals(); }

 private:
  ResidualBlocks older_;  // since the last renewal but one
  ResidualBlocks newer_;  // since the last
  std::uint64_t samples_ = 0;
  std::uint64_t renewal_ = 32;  // twice the fewest blocks, then twice as many each time
};

}  // namespace palpate::detail
