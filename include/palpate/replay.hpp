// The recursion over arrays, written sample by sample into memory that the caller owns.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/estimate.hpp"
#include "palpate/matrix.hpp"
#include "palpate/status.hpp"

namespace palpate {

// `count` samples. `time_steps` has `count` entries, or one where `one_time_step` says so, or is
// null for the estimator's own sample time.
struct Signals {
  const double* penetration;
  const double* velocity;
  const double* force;
  const double* time_steps;
  std::size_t count;
  bool one_time_step = false;
};

// Row-major, `count` rows; parameters and errors have as many columns as the law has parameters.
struct TraceColumns {
  double* parameters;
  double* standard_errors;
  double* predicted_force;
  double* validity_margin;
  std::uint8_t* status;
};

// Flattened: one body without calls is a tenth quicker than what the inliner chooses.
template <class Estimator>
[[gnu::flatten]] void replay(Estimator& estimator, const Signals& in,
                             const TraceColumns& out) noexcept {
  constexpr std::size_t size = Estimator::Law::size;
  const double sample_time = estimator.settings().sample_time;
  for (std::size_t k = 0; k < in.count; ++k) {
    const double dt = in.time_steps ? in.time_steps[in.one_time_step ? 0 : k] : sample_time;
    const Status status = estimator.update({in.penetration[k], in.velocity[k], in.force[k]}, dt,
                                           out.predicted_force[k]);
    const auto now = estimator.snapshot();
    const Vector<size> parameters = now.law.parameters();
    for (std::size_t i = 0; i < size; ++i) {
      out.parameters[k * size + i] = parameters[i];
      out.standard_errors[k * size + i] = std::sqrt(std::max(now.variances[i], 0.0));
    }
    out.validity_margin[k] = validity_margin(now.law, estimator.last_velocity());
    out.status[k] = static_cast<std::uint8_t>(status);
  }
}

}  // namespace palpate
