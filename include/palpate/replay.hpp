// The recursion over arrays, written sample by sample into memory that the caller owns.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "palpate/estimate.hpp"
#include "palpate/projection/contact_solver.hpp"
#include "palpate/projection/replay_abreast.hpp"
#include "palpate/sample.hpp"
#include "palpate/status.hpp"
#include "palpate/trace_columns.hpp"

namespace palpate {

namespace detail {

// Whether an estimate is a solution that can be kept from one sample to the next.
template <class Estimator>
concept Solves = requires(const typename Estimator::Method& method) { method.solution(); };

// Whether it is that of a known surface, of which there is one set of sums.
template <class Estimator>
concept SolvesAbreast = Solves<Estimator> && requires(const typename Estimator::Method& method) {
  { method.solver() } -> std::same_as<const ContactSolver&>;
};

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
    out.validity_margin[k] =
        detail::write_estimate(estimator.snapshot(), estimator.last_velocity(), out, k);
    out.status[k] = static_cast<std::uint8_t>(status);
  }
}

// Where an estimate is a solution, which costs several samples: one a sample, that of the sample
// before being the prediction, and what a search is due for.
template <detail::Solves Estimator>
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
    out.validity_margin[k] = detail::write_estimate(before, estimator.last_velocity(), out, k);
  }
}

// Of a surface that is known: eight answers abreast.
template <detail::SolvesAbreast Estimator>
void replay(Estimator& estimator, const Signals& in, const TraceColumns& out) noexcept {
  detail::ReplayAbreast<Estimator>(estimator, in, out).run();
}

// The same with the estimate after some samples only. Where the a-priori force costs a solution of
// its own it is NaN, and so is the margin at the others.
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
    if constexpr (everywhere) {
      status = estimator.update({in.penetration[k], in.velocity[k], in.force[k]}, dt,
                                out.predicted_force[k]);
    } else {
      status = estimator.update(in.penetration[k], in.velocity[k], in.force[k], dt);
      out.predicted_force[k] = unknown;
    }
    out.status[k] = static_cast<std::uint8_t>(status);
    if (written) {
      out.validity_margin[k] =
          detail::write_estimate(estimator.snapshot(), estimator.last_velocity(), out, row++);
    } else {
      out.validity_margin[k] =
          everywhere ? validity_margin(estimator.law(), estimator.last_velocity()) : unknown;
    }
  }
}

}  // namespace palpate
