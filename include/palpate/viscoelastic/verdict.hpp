// Which law it is, of candidates that are fitted to the same samples:
//
//   score = N_eff ln(RSS/N) + 2 p ln N_eff
//
// The least wins: Schwarz's criterion with twice the penalty, and as many samples as noise of the
// residual's correlation leaves (docs/viscoelastic.md).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/error_widening.hpp"
#include "palpate/haar_levels.hpp"
#include "palpate/viscoelastic/law.hpp"

namespace palpate::viscoelastic {

template <std::size_t Count>
struct Verdict {
  std::array<double, Count> mean_square{};  // RSS/N; 0 of what does not compete
  double effective = 0.0;                   // N_eff

  // The candidate that leaves least, and that of the least score; `Count` where none competes.
  std::size_t closest() const noexcept {
    return least([this](std::size_t i) noexcept { return mean_square[i]; });
  }
  std::size_t chosen() const noexcept {
    const std::size_t by = closest();
    return least([this, by](std::size_t i) noexcept { return score(i, by); });
  }

  // The score less N_eff ln of the least RSS/N.
  double score(std::size_t candidate, std::size_t by) const noexcept {
    return effective * std::log(mean_square[candidate] / mean_square[by]) +
           2.0 * candidates[candidate].parameters() * std::log(effective);
  }

 private:
  template <class Of>
  std::size_t least(Of of) const noexcept {
    std::size_t result = Count;
    double smallest = 0.0;
    for (std::size_t i = 0; i < Count; ++i) {
      if (!(mean_square[i] > 0.0)) continue;
      const double value = of(i);
      if (result != Count && !(value < smallest)) continue;
      result = i;
      smallest = value;
    }
    return result;
  }
};

// How much less than white noise's the samples say: what a verdict and error bars ask of errors.
class ResidualNoise {
 public:
  // The a-priori error of a fit at a depth. Where a fit meets new ground errors are no noise:
  // beyond four deviations they count as four.
  void add(double depth, double error, double variance, double forgetting_factor) noexcept {
    const double limit = variance > 0.0 ? std::min(4.0 * std::sqrt(variance), largest) : largest;
    levels_.add({depth}, std::clamp(error, -limit, limit), forgetting_factor);
  }

  void clear() noexcept { levels_.clear(); }

  // Another fit has become the best, whose residual has so many times the variance. How slow its
  // noise is shows only in errors to come: it is taken for as slow as the noise so far, which
  // counts a quarter, so that its own soon weigh more. Taken for white, it had ten times the
  // evidence.
  void succeed(double ratio) noexcept { levels_.scale_residuals(std::sqrt(ratio), 0.25); }

  // By the variance of the residual; or of the errors themselves where they are smaller: how slow
  // noise is does not depend on where in the samples the law fits worst, as at the touch before a
  // long hold.
  [[gnu::noinline]] void measure(double whole_variance) noexcept {
    const detail::HaarLevels<1> levels(levels_);
    const double own = levels.residual_variance();
    const double variance = own > 0.0 ? std::min(whole_variance, own) : whole_variance;
    const detail::LevelNoise noise(levels, variance, {1.0});
    // Slower than the slowest that was measured, the few pairs that there are count together, less
    // the deviation of so few: error bars guess how it goes on, but a criterion that did would find
    // no law of a short record.
    double energy = 0.0, pairs = 0.0;
    for (std::size_t k = noise.measured; k < noise.used; ++k) {
      energy += levels[k].older;
      pairs += levels[k].older_pairs;
    }
    const double few = pairs > 0.0 ? energy / (variance * (pairs + std::sqrt(2.0 * pairs))) : 1.0;
    const double slowest =
        std::max(noise.measured > 0 ? noise.ratio[noise.measured - 1] : 1.0, few);
    // What has no partner, the mean of all, is not in it: that is what the offset takes.
    double whole = 0.0, wider = 0.0;
    for (std::size_t k = 0; k < noise.used; ++k) {
      const double information = levels[k].information[0][0];
      whole += information;
      wider += information * (k < noise.measured ? noise.ratio[k] : slowest);
    }
    const bool measured = noise.measured > 0 && whole > 0.0;
    inflation_ = measured ? std::max(wider / whole, 1.0) : 1.0;
    const detail::ErrorWidening<1, 1> widening(levels, {0.0}, variance);
    const double root = widening.root({{{1.0}}})[0][0];
    widening_ = std::max(root * root, inflation_);
  }

  // Σ d_k D_k / σ² Σ D_k with the depth as the only slope: so many times fewer samples of white
  // noise would say the same.
  double inflation() const noexcept { return inflation_; }

  // Of variances: the same, and by how few blocks it is known from.
  double widening() const noexcept { return widening_; }

 private:
  // In units of force; what floats still square.
  static constexpr double largest = 1e10;

  // Sums of squares that are looked at to a hundredth: floats are enough.
  detail::HaarLevels<1, float> levels_;
  double inflation_ = 1.0;
  double widening_ = 1.0;
};

}  // namespace palpate::viscoelastic
