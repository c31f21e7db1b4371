// How much less than white noise's the samples say: what a verdict and error bars ask of errors.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "palpate/error_widening.hpp"
#include "palpate/haar_levels.hpp"

namespace palpate::viscoelastic {

class ResidualNoise {
 public:
  // The a-priori error of a fit at a depth. Where a fit meets new ground errors are no noise:
  // beyond four deviations they count as four.
  void add(double depth, double error, double variance, double forgetting_factor) noexcept {
    const double limit = variance > 0.0 ? std::min(4.0 * std::sqrt(variance), largest) : largest;
    levels_.add({depth}, std::clamp(error, -limit, limit), forgetting_factor);
  }

  void clear() noexcept { levels_.clear(); }

  // By the variance of the residual.
  [[gnu::noinline]] void measure(double variance) noexcept {
    const detail::HaarLevels<1> levels(levels_);
    const detail::LevelNoise noise(levels, variance, detail::ResidualOf::earlier_samples);
    // Slower than the slowest that was measured, it is taken for that: error bars guess how it goes
    // on, but a criterion that did would find no law of a short record.
    const std::size_t slowest = noise.measured > 0 ? noise.measured - 1 : 0;
    double whole = levels.rest()[0][0], wider = whole * noise.ratio[slowest];
    for (std::size_t k = 0; k < noise.used; ++k) {
      const double information = levels[k].information[0][0];
      whole += information;
      wider += information * noise.ratio[std::min(k, slowest)];
    }
    const bool measured = noise.measured > 0 && whole > 0.0;
    inflation_ = measured ? std::max(wider / whole, 1.0) : 1.0;
    const detail::ErrorWidening<1, 1> widening(levels, {0.0}, variance);
    const double root = widening.root({{{1.0}}})[0][0];
    widening_ = std::max(root * root, 1.0);
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
