// Many contacts and whole curves in one call, as rows of arrays: threads share the rows, without
// the interpreter's lock.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "conversions.hpp"
#include "palpate/batch_fit/curve_fit.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/outliers.hpp"
#include "palpate/smoothing_spline.hpp"
#include "palpate/touching_loop.hpp"
#include "rows.hpp"

namespace palpate::curves {

extern const CurveKernels compiled_baseline, compiled_avx2, compiled_avx512;

}  // namespace palpate::curves

namespace palpate::bindings {
namespace {

void check(bool agree) {
  if (!agree)
    throw nb::value_error("the arrays must have the same number of rows, and of samples per row");
}

// Properties of one channel.
template <double (*Of)(rows::Channel, double*) noexcept>
double of_channel(const InputArray& values) {
  std::vector<double> spare(2 * values.size() + 1);
  return Of({values.data(), values.size()}, spare.data());
}

void resolutions(const InputRows& penetration, const OutputArray& result, std::size_t threads) {
  const std::size_t samples = penetration.shape(1);
  check(result.size() == penetration.shape(0));
  each_row(penetration.shape(0), 2 * samples, threads, [&](std::size_t row, double* spare) {
    result.data()[row] = rows::resolution_of({penetration.data() + row * samples, samples}, spare);
  });
}

// With screening, only in rows that may contain one.
void mark_spikes(const InputRows& values, bool screened, const StatusArray& marks,
                 std::size_t threads) {
  const std::size_t samples = values.shape(1);
  check(marks.size() == values.size());
  each_row(values.shape(0), 3 * samples, threads, [&](std::size_t row, double* spare) {
    const rows::Channel own{values.data() + row * samples, samples};
    if (screened && !rows::may_hold_a_spike(own, spare)) return;
    rows::mark_spikes(own, marks.data() + row * samples, spare);
  });
}

void add_spline_changes(const InputArray& time, const InputArray& position, double step,
                        const OutputArray& sums) {
  constexpr std::size_t pairs = SplineLadder::size - 1;
  check(time.size() == position.size() && time.size() >= 6 && sums.size() == 2 * pairs);
  palpate::add_spline_changes(time.data(), position.data(), time.size(), step, sums.data(),
                              sums.data() + pairs);
}

std::array<std::size_t, 2> find_knots(const InputArray& position) {
  const Knots knots = palpate::find_knots(position.data(), position.size());
  return {knots.beat, knots.first};
}

double choose_spline(const InputArray& sums, double longest) {
  constexpr std::size_t pairs = SplineLadder::size - 1;
  check(sums.size() == 2 * pairs);
  return palpate::choose_spline(sums.data(), sums.data() + pairs, longest);
}

void spline_velocity(const InputArray& time, const InputArray& position, double step,
                     double penalty, const OutputArray& velocity) {
  check(time.size() == position.size() && time.size() == velocity.size() && time.size() >= 6);
  palpate::spline_velocity(time.data(), position.data(), time.size(), step, penalty,
                           velocity.data());
}

void spline_rows(const InputArray& time, const InputRows& position, double step, double longest,
                 const OutputArray& velocity, const OutputArray& penalty, std::size_t threads) {
  constexpr std::size_t pairs = SplineLadder::size - 1;
  const std::size_t samples = position.shape(1);
  check(time.size() == samples && samples >= 6 && velocity.size() == position.size());
  check(penalty.size() == position.shape(0));
  each_row(position.shape(0), 2 * pairs, threads, [&](std::size_t row, double* sums) {
    const double* const own = position.data() + row * samples;
    if (palpate::find_knots(own, samples).beat > 1) {
      penalty.data()[row] = rows::unknown;
      std::fill_n(velocity.data() + row * samples, samples, rows::unknown);
      return;
    }
    std::fill_n(sums, 2 * pairs, 0.0);
    palpate::add_spline_changes(time.data(), own, samples, step, sums, sums + pairs);
    const double chosen = palpate::choose_spline(sums, sums + pairs, longest);
    penalty.data()[row] = chosen;
    palpate::spline_velocity(time.data(), own, samples, step, chosen,
                             velocity.data() + row * samples);
  });
}

double end_of_range(const InputArray& time, const InputArray& penetration,
                    const InputArray& velocity, const InputArray& force,
                    const std::array<double, 3>& parameters) {
  const std::size_t count = penetration.size();
  check(time.size() == count && velocity.size() == count && force.size() == count);
  const HuntCrossley model{.K = parameters[0], .B = parameters[1], .n = parameters[2]};
  const auto law = [&](double x, double v) noexcept { return model.force(x, v); };
  OutlierRejection rejection{OutlierRejection::Settings{}};
  double before = rows::unknown;
  for (std::size_t k = 0; k < count; ++k) {
    const Sample sample{penetration.data()[k], velocity.data()[k], force.data()[k]};
    if (!detail::finite(sample)) continue;
    const double now = time.data()[k];
    rejection.rejects(sample, now - std::exchange(before, now), detail::touching(sample), law);
  }
  return rejection.range();
}

std::array<double, 3> gate_of(const InputArray& penetration, const InputArray& velocity,
                              const InputArray& force) {
  const std::size_t count = penetration.size();
  check(velocity.size() == count && force.size() == count);
  const rows::Pressed contact{penetration.data(), force.data(), count};
  const auto touching = [&, speed = velocity.data()](std::size_t k) noexcept {
    return contact.touches(k) & (std::abs(speed[k]) < rows::largest);
  };
  std::vector<double> spare(count);
  const ContactGate::Settings gate = rows::gate_of(contact, touching, spare.data());
  return {gate.minimum_penetration, gate.make_force, gate.break_force};
}

void working_depths(const InputRows& penetration, const InputRows& force,
                    const InputArray& surfaces, const OutputArray& result, std::size_t threads) {
  const std::size_t count = penetration.shape(0), samples = penetration.shape(1);
  check(force.size() == penetration.size() && surfaces.size() == count &&
        result.size() == 2 * count);
  each_row(count, 2 * samples, threads, [&](std::size_t row, double* spare) {
    const double* place = penetration.data() + row * samples;
    double* depth = spare + samples;
    for (std::size_t k = 0; k < samples; ++k) depth[k] = place[k] - surfaces.data()[row];
    const std::array<double, 2> found =
        rows::working_depths({depth, force.data() + row * samples, samples}, spare);
    std::copy(found.begin(), found.end(), result.data() + 2 * row);
  });
}

// One touch a row; `forces` has room for every sample of the longest, or is empty.
void simulate_touches(const InputRows& loops, const InputArray& times, const InputArray& weights,
                      const OutputArray& outcomes, const OutputArray& forces, std::size_t threads) {
  using detail::TouchingLoop;
  using detail::TouchOutcome;
  const std::size_t count = loops.shape(0);
  check(loops.shape(1) == TouchingLoop::size && outcomes.size() == count * TouchOutcome::size &&
        times.size() == weights.size());
  const std::size_t kept = count > 0 ? forces.size() / count : 0;
  std::size_t commands = 2;
  for (std::size_t row = 0; row < count; ++row) {
    const TouchingLoop loop = TouchingLoop::from(loops.data() + row * TouchingLoop::size);
    if (!loop.is_valid()) throw nb::value_error("a number of a loop is outside its range");
    check(kept == 0 || loop.samples() <= kept);
    commands = std::max(commands, loop.whole_delay() + 2);
  }
  const viscoelastic::RelaxationBranches branches{{times.data(), times.size()},
                                                  {weights.data(), weights.size()}};
  each_row(count, commands, threads, [&](std::size_t row, double* spare) {
    const TouchingLoop loop = TouchingLoop::from(loops.data() + row * TouchingLoop::size);
    double* const force = kept > 0 ? forces.data() + row * kept : nullptr;
    const TouchOutcome outcome = detail::Touch{loop, branches, spare}.run(force);
    const std::array<double, TouchOutcome::size> numbers = outcome.numbers();
    std::copy(numbers.begin(), numbers.end(), outcomes.data() + row * TouchOutcome::size);
  });
}

// The named instruction set, or the fastest; null if this build or processor does not have it.
const curves::CurveKernels* kernels_of(std::string_view name) noexcept {
  const auto asked = [name](std::string_view set) { return name.empty() || name == set; };
#if defined(PALPATE_COMPILED_AVX512)
  if (asked("avx512") && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw")) {
    return &curves::compiled_avx512;
  }
#endif
#if defined(PALPATE_COMPILED_AVX2)
  if (asked("avx2") && __builtin_cpu_supports("avx2")) return &curves::compiled_avx2;
#endif
  return asked("baseline") ? &curves::compiled_baseline : nullptr;
}

using Pair = std::array<double, 2>;
using Triple = std::array<double, 3>;

// The output arrays, one row per curve.
struct CurveColumns {
  double* numbers;  // K, B, n, F₀, d, noise, cost, scale (3), prior of F₀ (2), σ²
  double* covariance;
  std::int64_t* taken;
  std::uint8_t* codes;  // flags, status
  std::uint8_t* roles;  // null if not requested
};
constexpr std::size_t numbers_per_curve = 13;

void write(const CurveFit& fit, std::size_t row, const CurveColumns& to) {
  double* numbers = to.numbers + numbers_per_curve * row;
  const bool found = fit.status != CurveStatus::no_contact;
  for (std::size_t i = 0; i < 5; ++i) {
    numbers[i] = found ? fit.parameters[i] : rows::unknown;
    for (std::size_t j = 0; j < 5; ++j) {
      to.covariance[25 * row + 5 * i + j] = found ? fit.covariance[i][j] : rows::unknown;
    }
  }
  numbers[5] = found ? fit.noise : rows::unknown;
  numbers[6] = found ? fit.cost : rows::unknown;
  const Triple scale{fit.scale.penetration, fit.scale.velocity, fit.scale.force};
  std::copy(scale.begin(), scale.end(), numbers + 7);
  numbers[10] = fit.offset_mean;
  numbers[11] = fit.offset_deviation;
  numbers[12] = fit.prior_variance;
  to.taken[row] = static_cast<std::int64_t>(fit.taken);
  to.codes[2 * row] = fit.flags;
  to.codes[2 * row + 1] = static_cast<std::uint8_t>(fit.status);
}

void fit_curves(const InputRows& penetration, const InputRows& velocity, const InputRows& force,
                const Pair& exponents, bool offset, double noise, const InputArray& offsets,
                const InputArray& surfaces, const std::optional<Pair>& surface_range,
                const Triple& scale, const OutputArray& numbers, const OutputArray& covariance,
                const LabelArray& taken, const StatusArray& codes,
                const std::optional<StatusArray>& roles, std::size_t threads,
                const std::string& instruction_set) {
  const curves::CurveKernels* kernels = kernels_of(instruction_set);
  if (!kernels) throw nb::value_error(("there is no instruction set " + instruction_set).c_str());
  const std::size_t count = penetration.shape(0), samples = penetration.shape(1);
  CurveSettings shared;
  shared.noise = noise;
  shared.lowest_exponent = exponents[0];
  shared.highest_exponent = exponents[1];
  shared.offset = offset;
  shared.find_surface = surface_range.has_value();
  if (surface_range) {
    shared.lowest_surface = (*surface_range)[0];
    shared.highest_surface = (*surface_range)[1];
  }
  shared.scale = {scale[0], scale[1], scale[2]};
  const CurveColumns to{numbers.data(), covariance.data(), taken.data(), codes.data(),
                        roles ? roles->data() : nullptr};
  each_row(count, curve_memory(samples), threads, [&](std::size_t row, double* memory) noexcept {
    const std::size_t at = row * samples;
    CurveSettings settings = shared;
    settings.offset_deviation = offsets.data()[row];
    settings.surface_deviation = surfaces.data()[row];
    const CurveArrays arrays{penetration.data() + at, velocity.data() + at, force.data() + at,
                             samples};
    write(fit_curve(arrays, settings, memory, to.roles ? to.roles + at : nullptr, *kernels), row,
          to);
  });
}

// Fits without sample selection and priors, in the units of the data, from each start.
detail::CurvePoint fit_samples(const InputRows& samples, const InputRows& starts,
                               const Pair& exponents, const Pair& surfaces) {
  using namespace detail;
  constexpr double unknown = std::numeric_limits<double>::infinity();
  const std::size_t count = samples.shape(1), padded = CurveSamples::padded(count);
  std::vector<double> memory(5 * padded);
  for (std::size_t row = 0; row < 3; ++row) {
    std::copy_n(samples.data() + row * count, count, memory.data() + row * padded);
  }
  double* const own = memory.data();
  const CurveSamples held{own,  own + padded, own + 2 * padded, own + 3 * padded, own + 4 * padded,
                          count};
  held.pad();
  const CurveData data{{held}, 1, std::inner_product(held.f, held.f + count, held.f, 0.0)};
  CurveModel model{{}, kernels_of(""), surfaces[0], surfaces[1]};
  ProjectionSettings& s = model.settings;
  if (!(exponents[1] > exponents[0])) s.exponent = exponents[0];
  s.lowest_exponent = exponents[0];
  s.highest_exponent = exponents[1];
  s.offset_deviation = s.prior_exponent_deviation = s.prior_dissipation_deviation = unknown;
  std::vector<CurvePoint> from(starts.shape(0));
  for (std::size_t i = 0; i < from.size(); ++i) {
    std::copy_n(starts.data() + 5 * i, 5, from[i].begin());
  }
  return lowest_of(model, data, from).at;
}

}  // namespace

void each_row(std::size_t rows, std::size_t size, std::size_t threads,
              const std::function<void(std::size_t row, double* spare)>& work) {
  // Rows per block: enough that threads rarely share the counter or a cache line.
  constexpr std::size_t at_once = 16;
  const nb::gil_scoped_release release;
  const std::size_t parts = (rows + at_once - 1) / at_once;
  const std::size_t workers = std::clamp<std::size_t>(threads, 1, std::max<std::size_t>(parts, 1));
  std::vector<double> spare(workers * size);
  std::atomic<std::size_t> next = 0;
  const auto run = [&](std::size_t worker) noexcept {
    for (std::size_t first; (first = next.fetch_add(at_once)) < rows;) {
      const std::size_t last = std::min(first + at_once, rows);
      for (std::size_t row = first; row < last; ++row) work(row, spare.data() + worker * size);
    }
  };
#ifndef __EMSCRIPTEN__  // Pyodide has one thread
  std::vector<std::jthread> others;
  others.reserve(workers - 1);
  for (std::size_t worker = 1; worker < workers; ++worker) others.emplace_back(run, worker);
#endif
  run(0);
}

void bind_rows(nb::module_& module) {
  module.def("noise_of", &of_channel<rows::noise_of>, nb::arg("values"),
             "Standard deviation of white noise on a smooth signal, from its fourth differences.");
  module.def("step_of", &of_channel<rows::step_of>, nb::arg("values"),
             "Median gap between the distinct values of a channel; 0 for a constant one.");
  module.def("resolutions", &resolutions, nb::arg("penetration"), nb::arg("result"),
             nb::arg("threads"),
             "Fills, for contacts as rows, twice the noise of the penetration including its "
             "rounding, m; NaN without noise and rounding.");
  module.def("largest_of", &of_channel<rows::largest_of>, nb::arg("values"),
             "99.9th percentile of the absolute values; 0 if there are none.");
  module.def("mark_spikes", &mark_spikes, nb::arg("values"), nb::arg("screened"), nb::arg("marks"),
             nb::arg("threads"),
             "Marks the spikes of each row; with screening, only in rows where a sample differs "
             "from its two neighbours as a spike does.");
  module.def("simulate_touches", &simulate_touches, nb::arg("loops"), nb::arg("times"),
             nb::arg("weights"), nb::arg("outcomes"), nb::arg("forces"), nb::arg("threads"),
             "Runs a control loop that touches a material, one a row of the numbers of "
             "TouchingLoop; fills the five numbers of TouchOutcome, and the force at each sample.");
  module.attr("SPLINE_WINDOW") = spline_window;
  module.attr("SPLINE_PAIRS") = SplineLadder::size - 1;
  module.def("add_spline_changes", &add_spline_changes, nb::arg("time"), nb::arg("position"),
             nb::arg("step"), nb::arg("sums"),
             "Adds how much the velocities of a smoothing spline change from each penalty of the "
             "ladder to the next, and then their own size, as sums of squares per usual step.");
  module.def("choose_spline", &choose_spline, nb::arg("sums"), nb::arg("longest"),
             "Penalty, over the cube of the usual step, by these sums; as smooth at most as a "
             "parabola through so many samples.");
  module.def(
      "spline_velocity", &spline_velocity, nb::arg("time"), nb::arg("position"), nb::arg("step"),
      nb::arg("penalty"), nb::arg("velocity"),
      "Fills the slopes, m/s, at the samples of the cubic smoothing spline of a penalty over "
      "the cube of the usual step, s.");
  module.def(
      "spline_rows", &spline_rows, nb::arg("time"), nb::arg("position"), nb::arg("step"),
      nb::arg("longest"), nb::arg("velocity"), nb::arg("penalty"), nb::arg("threads"),
      "Chooses the spline of each row, and fills velocities and penalties; NaN for a row that "
      "is interpolated.");
  module.def("find_knots", &find_knots, nb::arg("position"),
             "Every how many samples a position was measured, 1 unless it is interpolated linearly "
             "between; and the first such sample.");
  module.def("end_of_range", &end_of_range, nb::arg("time"), nb::arg("penetration"),
             nb::arg("velocity"), nb::arg("force"), nb::arg("parameters"),
             "Force at which the sensor saturates, infinite if it does not, from a contact below "
             "its surface and the parameters of its Hunt-Crossley law.");
  module.def("gate_of", &gate_of, nb::arg("penetration"), nb::arg("velocity"), nb::arg("force"),
             "The three settings of a contact gate for a contact, SI.");
  module.def("working_depths", &working_depths, nb::arg("penetration"), nb::arg("force"),
             nb::arg("surfaces"), nb::arg("result"), nb::arg("threads"),
             "Fills, for contacts as rows, median and largest penetration below the surface in "
             "firm contact by each one's gate, m; NaN if there is none.");
}

void bind_curves(nb::module_& module) {
  module.def("fit_curves", &fit_curves, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
             nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg(), nb::arg(), nb::arg(),
             nb::arg(), nb::arg(), nb::arg().none(), nb::arg(), nb::arg() = "",
             "The core of palpate.method.estimators.batch_fit.fit_curves, one row per curve.");
  module.def("fit_samples", &fit_samples, nb::arg(), nb::arg(), nb::arg(), nb::arg(),
             "(k, c, n, F₀, d) of the least squares of samples, rows of x, v and F.");
}

}  // namespace palpate::bindings
