// The arrays that a replay reads, and the memory that it writes a trace into, owned by the caller.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "palpate/estimate.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"
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

// The samples after which a thinned trace writes the estimate down: their numbers, rising.
struct TraceRows {
  const std::int64_t* samples;
  std::size_t count;
};

// Row-major. A row of parameters and errors, of as many columns as the law has parameters, for each
// sample or for each of the TraceRows; the others have an entry for each sample.
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

// Writes an estimate down, and gives its validity margin at the velocity of the last sample taken.
template <class Law>
double write_estimate(const Snapshot<Law>& now, double velocity, const TraceColumns& out,
                      std::size_t row) noexcept {
  constexpr std::size_t size = Law::size;
  const Vector<size> parameters = now.law.parameters();
  for (std::size_t i = 0; i < size; ++i) {
    out.parameters[row * size + i] = parameters[i];
    out.standard_errors[row * size + i] = std::sqrt(std::max(now.variances[i], 0.0));
  }
  return validity_margin(now.law, velocity);
}

// The a-priori force of a sample that an estimator has been given, by its estimate before. Where it
// was left out others may have been with it, before it was predicted.
template <class Estimator>
double predicted_by(const Estimator& estimator, const Snapshot<typename Estimator::Law>& before,
                    const Sample& sample, Status status) noexcept {
  if (status == Status::not_finite) return std::numeric_limits<double>::quiet_NaN();
  if (status == Status::rejected) return estimator.predict(sample.penetration, sample.velocity);
  return before.force(sample.penetration, sample.velocity);
}

}  // namespace detail
}  // namespace palpate
