// A fit's slopes and residuals by how quickly they change: what online error bars keep of the past.
//
// The sum of a block of b = 2ᵏ samples less that of the next is a coefficient of the Haar wavelet.
// Over the pairs of blocks of each level k, of the slopes J and of the residuals e,
//
//   D_k = Σ (ΣJ − ΣJ′)(ΣJ − ΣJ′)ᵀ/2b,    d_k = mean (Σe − Σe′)²/2b.
//
// Coefficients hang together little from level to level and within one, whatever the noise is like
// (Wornell 1990), so that the scores Σ J e have the covariance Σ d_k D_k. See error_widening.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"

namespace palpate::detail {

// What fades without new energy would end in subnormal numbers, on which processors are slow.
constexpr double faded(double sum) noexcept {
  constexpr double smallest = 1e-150;
  return sum < smallest && sum > -smallest ? 0.0 : sum;
}

template <std::size_t Size>
constexpr void fade_out(Matrix<Size>& sums, double fade) noexcept {
  for (auto& row : sums) {
    for (double& entry : row) entry = faded(entry * fade);
  }
}

template <std::size_t Size>
struct HaarLevel {
  Matrix<Size> information{};  // D_k, its upper triangle
  Vector<Size> half{};         // ΣJ of the first block of a pair …
  double half_residual = 0.0;  // … and its Σe
  double older = 0.0;          // Σ (Σe − Σe′)²/2b since the last renewal but one
  double newer = 0.0;          // … since the last
  double older_pairs = 0.0;
  double newer_pairs = 0.0;
  bool waiting = false;  // for the second block

  double residual_variance() const noexcept { return older / older_pairs; }  // d_k

  void take(const Vector<Size>& sum, double error, double per_pair, double fade) noexcept {
    if (fade != 1.0) forget(fade);
    Vector<Size> apart;
    for (std::size_t i = 0; i < Size; ++i) apart[i] = half[i] - sum[i];
    for (std::size_t i = 0; i < Size; ++i) {
      const double scaled = apart[i] * per_pair;
      for (std::size_t j = i; j < Size; ++j) information[i][j] += scaled * apart[j];
    }
    const double errors_apart = half_residual - error;
    const double square = errors_apart * errors_apart * per_pair;
    older += square;
    newer += square;
    older_pairs += 1.0;
    newer_pairs += 1.0;
  }

  void forget(double fade) noexcept {
    fade_out(information, fade);
    for (double* sum : {&older, &newer, &older_pairs, &newer_pairs}) *sum = faded(*sum * fade);
  }

  void scale_residuals(double factor, double weight) noexcept {
    half_residual *= factor;
    const double energy = weight * factor * factor;
    older = faded(older * energy);
    newer = faded(newer * energy);
    older_pairs *= weight;
    newer_pairs *= weight;
  }

  void renew() noexcept {
    older = newer;
    older_pairs = newer_pairs;
    newer = newer_pairs = 0.0;
  }
};

template <std::size_t Size>
class HaarLevels {
 public:
  // Blocks of up to 2¹⁹ samples, 9 min at 1 kHz; slower noise counts as it is there.
  static constexpr std::size_t most = 20;

  // What these multiply to must be finite: |slope| < 1e20, |residual| ≤ 1e100. Amortised, one pair
  // of blocks is closed a sample.
  void add(const Vector<Size>& slope, double residual, double forgetting_factor) noexcept {
    if (++samples_ == renewal_) renew();
    if (forgetting_factor == 1.0) used_ = most;
    Vector<Size> sum = slope;
    double error = residual, per_pair = 0.5, fade = forgetting_factor * forgetting_factor;
    for (std::size_t k = 0; k < most; ++k) {
      if (fade < least_fade) return end(sum, 2.0 * per_pair, k, fade);
      HaarLevel<Size>& level = levels_[k];
      level.waiting = !level.waiting;
      if (level.waiting) {
        level.half = sum;
        level.half_residual = error;
        return;
      }
      level.take(sum, error, per_pair, fade);
      for (std::size_t i = 0; i < Size; ++i) sum[i] += level.half[i];
      error += level.half_residual;
      per_pair *= 0.5;
      fade *= fade;
    }
    end(sum, 2.0 * per_pair, most, fade);
  }

  void clear() noexcept { *this = HaarLevels(); }

  // As if all residuals so far had been so many times as large, and counted so much.
  void scale_residuals(double factor, double weight) noexcept {
    for (HaarLevel<Size>& level : levels_) level.scale_residuals(factor, weight);
  }

  // Of the residuals that count, about their mean: their energy is that of all levels.
  double residual_variance() const noexcept {
    double energy = 0.0;
    for (const HaarLevel<Size>& level : levels_) energy += level.older;
    const double samples = 2.0 * levels_[0].older_pairs;
    return samples > 0.0 ? energy / samples : 0.0;
  }

  std::size_t used() const noexcept { return used_; }
  const HaarLevel<Size>& operator[](std::size_t k) const noexcept { return levels_[k]; }
  HaarLevel<Size>& operator[](std::size_t k) noexcept { return levels_[k]; }

  // Σ (ΣJ)(ΣJ)ᵀ/b of blocks without a partner: those that wait for one, and what ends the levels.
  // With all D_k it is Σ JJᵀ. The upper triangle.
  Matrix<Size> rest() const noexcept {
    Matrix<Size> result = rest_;
    double per_block = 1.0;
    for (std::size_t k = 0; k < used_; ++k, per_block *= 0.5) {
      if (levels_[k].waiting) add_square(result, levels_[k].half, per_block);
    }
    return result;
  }

 private:
  // With forgetting, blocks are no longer than the memory: where a pair fades below it while it is
  // made, levels end.
  static constexpr double least_fade = 0.6;

  static void add_square(Matrix<Size>& m, const Vector<Size>& sum, double per_block) noexcept {
    for (std::size_t i = 0; i < Size; ++i) {
      for (std::size_t j = i; j < Size; ++j) m[i][j] += per_block * sum[i] * sum[j];
    }
  }

  void end(const Vector<Size>& sum, double per_block, std::size_t level, double fade) noexcept {
    used_ = level;
    if (fade != 1.0) fade_out(rest_, fade);
    add_square(rest_, sum, per_block);
  }

  // Only the later half of the residuals counts, and none of the first sixteen: errors of a fit
  // that was still on its way say nothing of the noise.
  void renew() noexcept {
    for (HaarLevel<Size>& level : levels_) {
      level.renew();
      if (renewal_ == first_renewal) level.renew();
    }
    renewal_ *= 2;
  }

  static constexpr std::uint64_t first_renewal = 16;

  std::array<HaarLevel<Size>, most> levels_{};
  Matrix<Size> rest_{};
  std::size_t used_ = most;
  std::uint64_t samples_ = 0;
  std::uint64_t renewal_ = first_renewal;
};

}  // namespace palpate::detail
