// What the force above the surface says of the sensor's offset: a prior F₀ ~ N(mean, deviation²).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace palpate::detail {

struct OffsetPrior {
  double mean;
  double deviation;  // 0: nothing is known
};

class FreeAir {
 public:
  // A sample counts as free after ten in a row this far above the surface, in units of
  // penetration: a surface is not known better, and a material that recovers may still touch.
  static constexpr double clearance = 0.02;
  static constexpr std::uint32_t fewest = 10;

  void add(double penetration, double force, double forgetting_factor) noexcept {
    if (!(penetration < -clearance)) {
      run_ = 0;
      return;
    }
    if (run_ < fewest) {
      ++run_;
      last_ = 0.0;
      return;
    }
    forget(forgetting_factor);
    weight_ += 1.0;
    const double away = force - mean_;
    mean_ += away / weight_;
    const double rest = force - mean_;
    squares_ += away * rest;
    products_ += last_ * rest;
    last_ = rest;
  }

  void forget(double factor) noexcept {
    weight_ *= factor;
    squares_ *= factor;
    products_ *= factor;
  }

  bool known() const noexcept { return weight_ >= static_cast<double>(fewest); }
  double mean() const noexcept { return known() ? mean_ : 0.0; }

  // s² = σ²/N (1 + r)/(1 − r) + δ²: of the mean of noise whose neighbours correlate by r, and what
  // rounding to steps Δ leaves beside it however many there are, δ = (Δ/π) exp(−2π²σ²/Δ²).
  OffsetPrior prior(double step) const noexcept {
    const double variance = std::max(squares_, 0.0) / weight_;
    const double correlation = squares_ > 0.0 ? std::clamp(products_ / squares_, 0.0, 0.999) : 0.0;
    const double of_mean = variance / weight_ * (1.0 + correlation) / (1.0 - correlation);
    constexpr double pi = std::numbers::pi;
    double rounding = 0.0;
    if (step > 0.0) {
      const double before = std::max(variance / (step * step) - 1.0 / 12.0, 0.0);
      rounding = step / pi * std::exp(-2.0 * pi * pi * before);
    }
    constexpr double least = 1e-6;  // of the unit: no force sensor is better than 1e-5
    return {mean_, std::max(std::sqrt(of_mean + rounding * rounding), least)};
  }

 private:
  double weight_ = 0.0;
  double mean_ = 0.0;
  double squares_ = 0.0;   // Σ (F − mean)²
  double products_ = 0.0;  // the same of neighbours
  double last_ = 0.0;
  std::uint32_t run_ = 0;
};

// Of a fit's offset beside its prior, in deviations: from the one a tare is flagged, beyond the
// other the prior is dropped. A surface 10 µm off moves the offset by four of what a pause leaves:
// dropped at three, the ball under the paper's sensors for 20 s has 0.92 of the bound, at five
// 0.70.
inline constexpr double suspect_offset = 3.0;
inline constexpr double largest_offset = 5.0;

struct Tare {
  OffsetPrior prior;
  bool of_air;   // free air or an earlier answer says it, not a tare
  bool refuted;  // a tare was made, and free air is beyond it
};

// The tighter of what a tare, of this deviation where it is not 0, and free air say; free air where
// it contradicts the tare.
inline Tare measured_offset(bool offset, double declared, const FreeAir& air,
                            double step) noexcept {
  const bool told = declared > 0.0;
  if (!offset || !air.known()) return {{0.0, declared}, !told, false};
  const OffsetPrior said = air.prior(step);
  const bool refuted =
      told && std::abs(said.mean) > suspect_offset * std::hypot(declared, said.deviation);
  const bool tare = told && !refuted && declared < said.deviation;
  return {tare ? OffsetPrior{0.0, declared} : said, !tare, refuted};
}

}  // namespace palpate::detail
