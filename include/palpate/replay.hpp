// The recursion over arrays, written sample by sample into memory that the caller owns.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/estimate.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"

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

// The samples after which a thinned trace writes the estimate down: their numbers, rising. Null
// writes it down after every sample.
struct TraceRows {
  const std::int64_t* samples = nullptr;
  std::size_t count = 0;
};

// Row-major. A row of parameters and errors, of as many columns as the law has parameters, for each
// of the TraceRows; the others have an entry for each sample, the same whichever rows are written.
struct TraceColumns {
  double* parameters;
  double* standard_errors;
  double* predicted_force;
  double* validity_margin;
  std::uint8_t* status;
};

namespace detail {

inline double time_step(const Signals& in, std::size_t k, double sample_time) noexcept {
  return in.time_steps ? in.time_steps[in.one_time_step ? 0 : k] : sample_time;
}

}  // namespace detail

template <class Estimator>
void replay(Estimator& estimator, const Signals& in, const TraceColumns& out,
            const TraceRows& rows = {}) noexcept {
  constexpr std::size_t size = Estimator::Law::size;
  const double sample_time = estimator.settings().sample_time;
  std::size_t row = 0;
  for (std::size_t k = 0; k < in.count; ++k) {
    const double dt = detail::time_step(in, k, sample_time);
    const Status status = estimator.update({in.penetration[k], in.velocity[k], in.force[k]}, dt,
                                           out.predicted_force[k]);
    out.status[k] = static_cast<std::uint8_t>(status);
    const bool written =
        !rows.samples || (row < rows.count && static_cast<std::size_t>(rows.samples[row]) == k);
    const double velocity = estimator.last_velocity();
    if (!written || Estimator::solves) {
      out.validity_margin[k] = validity_margin(estimator.latest_law(), velocity);
    }
    if (!written) continue;
    const auto now = estimator.snapshot();
    if (!Estimator::solves) out.validity_margin[k] = validity_margin(now.law, velocity);
    const Vector<size> parameters = now.law.parameters();
    for (std::size_t i = 0; i < size; ++i) {
      out.parameters[row * size + i] = parameters[i];
      out.standard_errors[row * size + i] = std::sqrt(std::max(now.variances[i], 0.0));
    }
    ++row;
  }
}

}  // namespace palpate
