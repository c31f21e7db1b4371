// Changes that are too small to show in single errors: the score of the errors against what a
// change of stiffness or of damping would look like, over blocks of 32, 64 … 4096 samples.
//
//   q = sᵀ M⁻¹ s / σ²,   s = Σ φ e,   M = Σ φ φᵀ,   φ = (F̂, F̂ v)
//
// is χ² with two degrees of freedom while nothing changes and errors are white.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"

namespace palpate::detail {

class ScoreBlocks {
 public:
  // Changes that show in fewer samples the cumulative sum finds.
  static constexpr std::size_t shortest = 32;
  static constexpr std::size_t levels = 8;  // the longest block: 4096

  // Takes an error and its regressors, all white, and σ². Gives the length of a block whose score
  // is beyond all that came before; else 0.
  std::size_t add(double error, const Vector<2>& regressor, double variance,
                  bool withheld) noexcept {
    // An outlier counts as one of four deviations.
    const double most = 16.0 * variance;
    const bool beyond = error * error > most;
    const double bounded = beyond ? std::copysign(std::sqrt(most), error) : error;
    const double a = regressor[0], b = regressor[1];
    block_.score[0] += a * bounded;
    block_.score[1] += b * bounded;
    block_.information[0] += a * a;
    block_.information[1] += a * b;
    block_.information[2] += b * b;
    if (++samples_ % shortest != 0) return 0;
    return close(variance, withheld);
  }

  // Begins new blocks; what earlier ones were like is kept.
  void restart() noexcept {
    samples_ = 0;
    block_ = {};
    for (Level& level : levels_) level.waiting = false;
  }

 private:
  // White noise exceeds 40 in e⁻²⁰ = 2e-9 of blocks: once in 600 h.
  static constexpr double threshold = 40.0;
  // Scores of errors that are not quite white, or outside the model class, have been large before.
  static constexpr double over_largest = 3.0;
  // Far beyond any threshold; it keeps the mean finite.
  static constexpr double largest_score = 1e6;

  struct Block {
    Vector<2> score{};
    Vector<3> information{};  // Σ a², Σ ab, Σ b²
  };

  struct Level {
    Block half{};          // the first of the two blocks that make the next longer one
    double sum = 0.0;      // of the scores of its blocks
    double largest = 0.0;  // of them, slowly forgotten
    std::uint32_t blocks = 0;
    bool waiting = false;
  };

  std::size_t close(double variance, bool withheld) noexcept {
    Block block = block_;
    block_ = {};
    std::size_t found = 0;
    for (std::size_t i = 0; i < levels; ++i) {
      Level& level = levels_[i];
      const double ratio = squared(block) / variance;
      // Not what sums beyond a double make.
      const double score = ratio >= 0.0 ? std::min(ratio, largest_score) : 0.0;
      if (!withheld && beyond(i, score)) {
        found = shortest << i;
      } else {
        ++level.blocks;
        level.sum += score;
        level.largest = std::max(level.largest * (1.0 - 1.0 / 512.0), score);
      }
      level.waiting = !level.waiting;
      if (level.waiting) {
        level.half = block;
        return found;
      }
      for (std::size_t j = 0; j < 2; ++j) block.score[j] += level.half.score[j];
      for (std::size_t j = 0; j < 3; ++j) block.information[j] += level.half.information[j];
    }
    return found;
  }

  // sᵀ M⁻¹ s; of the first regressor alone where the second says nothing else.
  static double squared(const Block& b) noexcept {
    const auto& [aa, ab, bb] = b.information;
    if (!(aa > 0.0)) return 0.0;
    const double first = b.score[0] * b.score[0] / aa;
    const double pivot = bb - ab * ab / aa;
    if (!(pivot > 1e-9 * bb)) return first;
    const double rest = b.score[1] - b.score[0] * ab / aa;
    return first + rest * rest / pivot;
  }

  // A length with fewer than eight blocks goes by the next shorter one with as many, at most three
  // below; without any it says nothing.
  bool beyond(std::size_t index, double score) const noexcept {
    constexpr std::uint32_t fewest = 8;
    double mean = 2.0, largest = 0.0;
    for (std::size_t down = 0; down <= std::min<std::size_t>(index, 3); ++down) {
      const Level& level = levels_[index - down];
      largest = std::max(largest, level.largest);
      if (level.blocks < fewest) continue;
      mean = std::max(mean, level.sum / static_cast<double>(level.blocks));
      return score > threshold * 0.5 * mean && score > over_largest * largest;
    }
    return false;
  }

  Block block_{};
  std::uint64_t samples_ = 0;
  std::array<Level, levels> levels_{};
};

}  // namespace palpate::detail
