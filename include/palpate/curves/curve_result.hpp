// What the law of a whole curve is fitted under (curve_fit.hpp), and what that gives.
#pragma once

#include <cstddef>
#include <cstdint>

#include "palpate/curves/curve_selection.hpp"
#include "palpate/projection/priors.hpp"
#include "palpate/sample.hpp"

namespace palpate {

// In SI, for all curves alike; a unit of the scale that is 0 is chosen from the curve.
struct CurveSettings {
  double noise = 0.0;  // standard deviation of the force; 0: from the residual
  double lowest_exponent = ProjectionSettings{}.lowest_exponent;
  double highest_exponent = ProjectionSettings{}.highest_exponent;
  bool exponent_fixed = false;  // at lowest_exponent, which is highest_exponent then
  bool offset = true;
  double offset_deviation = 0.0;   // as ProjectionSettings has it
  double surface_deviation = 0.0;  // the same
  bool find_surface = false;
  double lowest_surface = 0.0;   // both 0: a fifth of the unit of penetration each way,
  double highest_surface = 0.0;  // and once more in a wider range where that is too narrow
  Scale scale{0.0, 0.0, 0.0};
};

enum class CurveStatus : std::uint8_t { fitted, no_contact, unsettled, surface_at_edge };

// What a sample was to a fit.
enum class CurveRole : std::uint8_t { absent, free, firm, light, left_out };

struct CurveFit {
  Vector<5> parameters{};  // K, B, n, F₀, d, SI
  Matrix<5> covariance{};
  double noise = 0.0;  // standard deviation of the force, N
  double cost = 0.0;   // J, N²
  std::uint64_t taken = 0;
  std::uint8_t flags = 0;
  CurveStatus status = CurveStatus::no_contact;
  // By which the cost may be written down: its units, the prior of F₀, N (a deviation of 0: none),
  // and σ² of the priors, N².
  Scale scale{1.0, 1.0, 1.0};
  double offset_mean = 0.0;
  double offset_deviation = 0.0;
  double prior_variance = 0.0;
};

// Doubles of memory that a fit of so many samples works in.
constexpr std::size_t curve_memory(std::size_t samples) noexcept {
  return detail::CurveMemory::size(samples);
}

}  // namespace palpate
