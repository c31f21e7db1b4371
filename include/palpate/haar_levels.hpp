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

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"

namespace palpate::detail {

// What fades without new energy would end in subnormal numbers, on which processors are slow.
template <class Number>
constexpr Number faded(double sum) noexcept {
  constexpr double smallest = sizeof(Number) < sizeof(double) ? 1e-30 : 1e-150;
  return sum < smallest && sum > -smallest ? Number{0} : static_cast<Number>(sum);
}

template <class Number, std::size_t Size>
constexpr void fade_out(std::array<std::array<Number, Size>, Size>& sums, double fade) noexcept {
  for (auto& row : sums) {
    for (Number& entry : row) entry = faded<Number>(entry * fade);
  }
}

// `Number` is what is kept: of floats, sums of |slope| < 1e10 and |residual| < 1e10 stay finite.
template <std::size_t Size, class Number = double>
struct HaarLevel {
  std::array<std::array<Number, Size>, Size> information{};  // D_k, its upper triangle
  std::array<Number, Size> half{};                           // ΣJ of the first block of a pair …
  Number half_residual = 0;                                  // … and its Σe
  Number older = 0;  // Σ (Σe − Σe′)²/2b since the last renewal but one
  Number newer = 0;  // … since the last
  Number older_pairs = 0;
  Number newer_pairs = 0;

  HaarLevel() = default;
  template <class Other>
  explicit HaarLevel(const HaarLevel<Size, Other>& other) noexcept
      : half_residual(static_cast<Number>(other.half_residual)),
        older(static_cast<Number>(other.older)),
        newer(static_cast<Number>(other.newer)),
        older_pairs(static_cast<Number>(other.older_pairs)),
        newer_pairs(static_cast<Number>(other.newer_pairs)) {
    for (std::size_t i = 0; i < Size; ++i) {
      half[i] = static_cast<Number>(other.half[i]);
      for (std::size_t j = i; j < Size; ++j) {
        information[i][j] = static_cast<Number>(other.information[i][j]);
      }
    }
  }

  double residual_variance() const noexcept { return older / older_pairs; }  // d_k

  void keep(const Vector<Size>& sum, double error) noexcept {
    for (std::size_t i = 0; i < Size; ++i) half[i] = static_cast<Number>(sum[i]);
    half_residual = static_cast<Number>(error);
  }

  void take(const Vector<Size>& sum, double error, double per_pair, double fade) noexcept {
    if (fade != 1.0) forget(fade);
    Vector<Size> apart;
    for (std::size_t i = 0; i < Size; ++i) apart[i] = half[i] - sum[i];
    for (std::size_t i = 0; i < Size; ++i) {
      const double scaled = apart[i] * per_pair;
      for (std::size_t j = i; j < Size; ++j) add(information[i][j], scaled * apart[j]);
    }
    const double errors_apart = half_residual - error;
    const double square = errors_apart * errors_apart * per_pair;
    add(older, square);
    add(newer, square);
    older_pairs += 1;
    newer_pairs += 1;
  }

  void forget(double fade) noexcept {
    fade_out(information, fade);
    for (Number* sum : {&older, &newer, &older_pairs, &newer_pairs}) {
      *sum = faded<Number>(*sum * fade);
    }
  }

  void scale_residuals(double factor, double weight) noexcept {
    half_residual = static_cast<Number>(half_residual * factor);
    const double energy = weight * factor * factor;
    older = faded<Number>(older * energy);
    newer = faded<Number>(newer * energy);
    older_pairs = static_cast<Number>(older_pairs * weight);
    newer_pairs = static_cast<Number>(newer_pairs * weight);
  }

  void renew() noexcept {
    older = newer;
    older_pairs = newer_pairs;
    newer = newer_pairs = 0;
  }

 private:
  static void add(Number& sum, double term) noexcept { sum = static_cast<Number>(sum + term); }
};

template <std::size_t Size, class Number = double>
class HaarLevels {
 public:
  // Blocks of up to 2¹⁹ samples, 9 min at 1 kHz; slower noise counts as it is there.
  static constexpr std::size_t most = 20;

  HaarLevels() = default;

  // The same in another number.
  template <class Other>
  explicit HaarLevels(const HaarLevels<Size, Other>& other) noexcept
      : rest_(other.rest_),
        used_(other.used_),
        waiting_(other.waiting_),
        samples_(other.samples_),
        renewal_(other.renewal_) {
    for (std::size_t k = 0; k < most; ++k) levels_[k] = HaarLevel<Size, Number>(other[k]);
  }

  // What these multiply to must be finite: |slope| < 1e20, |residual| ≤ 1e100. Amortised, one pair
  // of blocks is closed a sample.
  void add(const Vector<Size>& slope, double residual, double forgetting_factor) noexcept {
    if (++samples_ == renewal_) renew();
    if (forgetting_factor == 1.0) used_ = most;
    Vector<Size> sum = slope;
    double error = residual, per_pair = 0.5, fade = forgetting_factor * forgetting_factor;
    for (std::size_t k = 0; k < most; ++k) {
      if (fade < least_fade) return end(sum, 2.0 * per_pair, k, fade);
      HaarLevel<Size, Number>& level = levels_[k];
      waiting_ ^= 1U << k;
      if (waiting(k)) return level.keep(sum, error);
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
    for (HaarLevel<Size, Number>& level : levels_) level.scale_residuals(factor, weight);
  }

  // Of the residuals that count, about their mean: their energy is that of all levels.
  double residual_variance() const noexcept {
    double energy = 0.0;
    for (const HaarLevel<Size, Number>& level : levels_) energy += level.older;
    const double samples = 2.0 * levels_[0].older_pairs;
    return samples > 0.0 ? energy / samples : 0.0;
  }

  std::size_t used() const noexcept { return used_; }
  const HaarLevel<Size, Number>& operator[](std::size_t k) const noexcept { return levels_[k]; }
  HaarLevel<Size, Number>& operator[](std::size_t k) noexcept { return levels_[k]; }

  // Whether a first block of this level waits for the second; and that it does.
  bool waiting(std::size_t k) const noexcept { return ((waiting_ >> k) & 1U) != 0; }
  void wait(std::size_t k) noexcept { waiting_ |= 1U << k; }

  // Σ (ΣJ)(ΣJ)ᵀ/b of blocks without a partner: those that wait for one, and what ends the levels.
  // With all D_k it is Σ JJᵀ. The upper triangle.
  Matrix<Size> rest() const noexcept {
    Matrix<Size> result = rest_;
    double per_block = 1.0;
    for (std::size_t k = 0; k < used_; ++k, per_block *= 0.5) {
      if (waiting(k)) add_square(result, levels_[k].half, per_block);
    }
    return result;
  }

 private:
  template <std::size_t, class>
  friend class HaarLevels;

  // With forgetting, blocks are no longer than the memory: where a pair fades below it while it is
  // made, levels end.
  static constexpr double least_fade = 0.6;

  template <class Sum>
  static void add_square(Matrix<Size>& m, const Sum& sum, double per_block) noexcept {
    for (std::size_t i = 0; i < Size; ++i) {
      for (std::size_t j = i; j < Size; ++j) m[i][j] += per_block * sum[i] * sum[j];
    }
  }

  void end(const Vector<Size>& sum, double per_block, std::size_t level, double fade) noexcept {
    used_ = static_cast<std::uint32_t>(level);
    if (fade != 1.0) fade_out(rest_, fade);
    add_square(rest_, sum, per_block);
  }

  // Only the later half of the residuals counts, and none of the first sixteen: errors of a fit
  // that was still on its way say nothing of the noise.
  void renew() noexcept {
    for (HaarLevel<Size, Number>& level : levels_) {
      level.renew();
      if (renewal_ == first_renewal) level.renew();
      // What is never renewed must not grow beyond it either; it counts by its fractions alone.
      if (renewal_ > longest_renewal) fade_out(level.information, 0.5);
    }
    if (renewal_ > longest_renewal) fade_out(rest_, 0.5);
    renewal_ += std::min(renewal_, longest_renewal);
  }

  static constexpr std::uint64_t first_renewal = 16;
  // Floats do not add up more than 2²⁴ of a kind; 2²³ samples are 2 h at 1 kHz.
  static constexpr std::uint64_t longest_renewal = 1ULL << (sizeof(Number) < 8 ? 23 : 63);

  std::array<HaarLevel<Size, Number>, most> levels_{};
  Matrix<Size> rest_{};
  std::uint32_t used_ = most;
  std::uint32_t waiting_ = 0;  // a bit each level
  std::uint64_t samples_ = 0;
  std::uint64_t renewal_ = first_renewal;
};

}  // namespace palpate::detail
