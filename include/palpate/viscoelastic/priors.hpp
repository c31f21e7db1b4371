// What is known beside the samples.
#pragma once

#include <algorithm>
#include <cstdint>

#include "palpate/projection/free_air.hpp"

namespace palpate::viscoelastic {

// In scaled units.
struct Priors {
  double variance = 0.0;  // σ² of the force, by which they weigh
  double exponent = 0.0;  // where it is known; 0 where it is looked for
  double centre = 1.3;    // n ~ N(1.3, 1), between a spring and a cone
  double deviation = 1.0;
  detail::OffsetPrior air{0.0, 0.0};  // F₀ ~ N(mean, deviation²); 0: nothing is known
  std::uint64_t offset = 1;  // whether there is one; a word, so that no saved state has padding

  // c/k ~ N(0, 1): damping as large as the spring at the scale's speed.
  static constexpr double dissipation = 1.0;

  // ρ_F = σ²/s² in samples. Where nothing is known the offset may be as large as the forces are,
  // one unit; where the unit is small beside the residual, 20 σ.
  double offset_weight() const noexcept {
    if (air.deviation > 0.0) return variance / (air.deviation * air.deviation);
    return std::min(variance, 1.0 / (20.0 * 20.0));
  }
};

}  // namespace palpate::viscoelastic
