// The estimate of an estimator, and the recursion over arrays, which writes into memory of the
// caller.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/force_laws.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"

namespace palpate {

// Condition 10, |v| < 0.1 K/B, as a margin 1 − |v B/K| / 0.1: 1 at rest, 0 at the limit, negative
// beyond it. It concerns the logarithm of the Hunt–Crossley law; for other laws it is always 1.
inline double validity_margin(const HuntCrossley& law, double velocity) noexcept {
  const double viscous = std::abs(velocity) * std::abs(law.B);
  const double ratio = viscous > 0.0 ? viscous / std::abs(law.K) : 0.0;  // not 0/0 at rest
  return std::max(-largest_parameter, 1.0 - ratio / 0.1);
}

template <class Law>
constexpr double validity_margin(const Law&, double) noexcept {
  return 1.0;
}

// The bits of `Estimate::flags`: parameters that a motion does not identify, and other warnings.
enum IdentifiabilityFlag : std::uint16_t {
  exponent_not_identifiable = 1,
  damping_not_identifiable = 2,
  exponent_at_edge = 4,
  surface_at_edge = 8,
  still_starting = 16,
  walk_too_slow = 32,
  tare_refuted = 64,
  light_contact = 256,
};

// At twice this error a sphere (1.5) cannot be distinguished from a cone (2) or a spring (1).
inline constexpr double largest_exponent_error = 0.2;
// Fraction of the elastic force: B v is uncertain by a quarter of K at the reference speed.
inline constexpr double largest_damping_error = 0.25;

// A force offset that is estimated together with the law: the sensor's remaining bias.
template <std::size_t Size>
struct Offset {
  double value = 0.0;         // N
  double variance = 0.0;      // N²
  Vector<Size> covariance{};  // with the law's parameters, SI
};

// The estimated surface position, in the coordinate of the penetration.
struct Surface {
  double value = 0.0;     // m
  double variance = 0.0;  // m²
};

// The fit of a method.
template <class Law>
struct Fit {
  Law law;
  Matrix<Law::size> covariance;  // of the law's parameters, SI
  Offset<Law::size> offset{};
  Surface surface{};
  std::uint16_t flags = 0;
};

// The fit from the joint covariance of the law's parameters and, last, the offset.
template <class Law, std::size_t Size>
Fit<Law> fit_of(const Law& law, const Matrix<Size>& joint, double offset,
                std::uint16_t flags) noexcept {
  static_assert(Size > Law::size);
  Fit<Law> fit{law, {}, {offset, joint[Law::size][Law::size], {}}, {}, flags};
  for (std::size_t i = 0; i < Law::size; ++i) {
    std::copy_n(joint[i].begin(), Law::size, fit.covariance[i].begin());
    fit.offset.covariance[i] = joint[Law::size][i];
  }
  return fit;
}

// The part of an estimate that does not depend on the law.
struct AnyEstimate {
  Surface surface;
  std::uint16_t flags;  // bits of IdentifiabilityFlag
  double validity_margin;
  Status status;           // of the last sample that was neither refused nor rejected
  std::uint64_t samples;   // samples taken
  std::uint64_t guarded;   // samples at which the covariance guard acted
  std::uint64_t restarts;  // restarts after a detected change
  std::uint64_t rejected;  // samples rejected as outliers

  constexpr bool valid() const noexcept { return validity_margin > 0.0; }
};

template <std::size_t Size>
struct Estimate : AnyEstimate {
  Vector<Size> parameters;  // of the law, SI
  Matrix<Size> covariance;  // of the parameters, SI
  Offset<Size> offset;
};

// The part of an estimate that a trace and a prediction need.
template <class Law>
struct Snapshot {
  Law law;
  Vector<Law::size> variances;  // of the law's parameters, SI
  double offset = 0.0;          // N
  double surface = 0.0;         // m

  // The predicted force of the sensor, N, including the offset.
  double force(double penetration, double velocity) const noexcept {
    return law.force(penetration - surface, velocity) + offset;
  }
};

// `count` samples. `time_steps` has `count` entries, or a single one if `one_time_step` is set, or
// is null for the estimator's own sample time.
struct Signals {
  const double* penetration;
  const double* velocity;
  const double* force;
  const double* time_steps;
  std::size_t count;
  bool one_time_step = false;
};

// The indices of the samples at which a thinned trace has the estimate, in rising order. Null: all
// samples.
struct TraceRows {
  const std::int64_t* samples = nullptr;
  std::size_t count = 0;
};

// Row-major. Parameters and errors have a row for each entry of TraceRows and a column for each of
// the law's parameters; the others have an entry for each sample, whichever rows are written.
struct TraceColumns {
  double* parameters;
  double* standard_errors;
  double* predicted_force;
  double* validity_margin;
  std::uint8_t* status;
};

template <class Estimator>
void replay(Estimator& estimator, const Signals& in, const TraceColumns& out,
            const TraceRows& rows = {}) noexcept {
  constexpr std::size_t size = Estimator::Law::size;
  const double sample_time = estimator.settings().sample_time;
  std::size_t row = 0;
  for (std::size_t k = 0; k < in.count; ++k) {
    const double dt = in.time_steps ? in.time_steps[in.one_time_step ? 0 : k] : sample_time;
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
