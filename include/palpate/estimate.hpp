// What an estimator knows now.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "palpate/force_laws.hpp"
#include "palpate/matrix.hpp"
#include "palpate/status.hpp"

namespace palpate {

// Condition 10, |v| < 0.1 K/B, as a margin 1 − |v B/K| / 0.1: 1 at rest, 0 at the limit, negative
// beyond it. It concerns the logarithm of the Hunt–Crossley law; other laws always hold it.
inline double validity_margin(const HuntCrossley& law, double velocity) noexcept {
  const bool moving = velocity != 0.0 && law.damping != 0.0;
  const double share =
      moving ? std::abs(velocity) * std::abs(law.damping) / std::abs(law.stiffness) : 0.0;
  // Without stiffness the limit is no speed at all; where that leaves 0/0, max keeps its first.
  return std::max(-largest_parameter, 1.0 - share / 0.1);
}

template <class Law>
constexpr double validity_margin(const Law&, double) noexcept {
  return 1.0;
}

template <std::size_t Size>
struct Estimate {
  Vector<Size> parameters;  // of the law, SI
  Matrix<Size> covariance;  // of the parameters, SI
  double validity_margin;
  Status status;          // of the last sample that was not refused
  std::uint64_t samples;  // taken
  std::uint64_t guarded;  // of them, how many the covariance guard touched

  constexpr bool valid() const noexcept { return validity_margin > 0.0; }
};

// The part of an estimate that a trace writes down.
template <std::size_t Size>
struct Moment {
  Vector<Size> parameters;  // of the law, SI
  Vector<Size> variances;   // of the parameters, SI
  double validity_margin;
};

}  // namespace palpate
