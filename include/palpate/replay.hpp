// The recursion over arrays, written sample by sample into memory that the caller owns.
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

// Writes the estimate down, and gives its validity margin.
template <class Estimator>
double write_estimate(const Estimator& estimator, const Snapshot<typename Estimator::Law>& now,
                      const TraceColumns& out, std::size_t row) noexcept {
  constexpr std::size_t size = Estimator::Law::size;
  const Vector<size> parameters = now.law.parameters();
  for (std::size_t i = 0; i < size; ++i) {
    out.parameters[row * size + i] = parameters[i];
    out.standard_errors[row * size + i] = std::sqrt(std::max(now.variances[i], 0.0));
  }
  return validity_margin(now.law, estimator.last_velocity());
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

// Flattened: one body without calls is a tenth quicker than what the inliner chooses.
template <class Estimator>
[[gnu::flatten]] void replay(Estimator& estimator, const Signals& in,
                             const TraceColumns& out) noexcept {
  const double sample_time = estimator.settings().sample_time;
  for (std::size_t k = 0; k < in.count; ++k) {
    const double dt = detail::time_step(in, k, sample_time);
    const Status status = estimator.update({in.penetration[k], in.velocity[k], in.force[k]}, dt,
                                           out.predicted_force[k]);
    out.validity_margin[k] = detail::write_estimate(estimator, estimator.snapshot(), out, k);
    out.status[k] = static_cast<std::uint8_t>(status);
  }
}

// Where an estimate is a solution, which costs several samples: one a sample, that of the sample
// before being the prediction, and what a search is due for.
template <class Estimator>
  requires requires(const typename Estimator::Method& method) { method.solution(); }
void replay(Estimator& estimator, const Signals& in, const TraceColumns& out) noexcept {
  const double sample_time = estimator.settings().sample_time;
  const auto& method = estimator.method();
  auto known = method.solution();
  auto before = method.snapshot(known, estimator.units());
  for (std::size_t k = 0; k < in.count; ++k) {
    const Sample sample{in.penetration[k], in.velocity[k], in.force[k]};
    const double dt = detail::time_step(in, k, sample_time);
    const Status status = estimator.update_knowing(sample, dt, known);
    out.status[k] = static_cast<std::uint8_t>(status);
    out.predicted_force[k] = detail::predicted_by(estimator, before, sample, status);
    known = method.solution();
    before = method.snapshot(known, estimator.units());
    out.validity_margin[k] = detail::write_estimate(estimator, before, out, k);
  }
}

// The same with the estimate after some samples only. Where the a-priori force and the margin cost
// a solution of their own they are NaN at the others.
template <class Estimator>
void replay(Estimator& estimator, const Signals& in, const TraceColumns& out,
            const TraceRows& rows) noexcept {
  constexpr bool everywhere = Estimator::Method::predicts_exactly;
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  const double sample_time = estimator.settings().sample_time;
  std::size_t row = 0;
  for (std::size_t k = 0; k < in.count; ++k) {
    const double dt = detail::time_step(in, k, sample_time);
    const bool written = row < rows.count && static_cast<std::size_t>(rows.samples[row]) == k;
    Status status;
    if (everywhere || written) {
      status = estimator.update({in.penetration[k], in.velocity[k], in.force[k]}, dt,
                                out.predicted_force[k]);
    } else {
      status = estimator.update(in.penetration[k], in.velocity[k], in.force[k], dt);
      out.predicted_force[k] = unknown;
    }
    out.status[k] = static_cast<std::uint8_t>(status);
    if (written) {
      out.validity_margin[k] = detail::write_estimate(estimator, estimator.snapshot(), out, row++);
    } else {
      out.validity_margin[k] =
          everywhere ? validity_margin(estimator.law(), estimator.last_velocity()) : unknown;
    }
  }
}

}  // namespace palpate
