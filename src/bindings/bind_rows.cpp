// What the samples of contacts say before anything is fitted: rows of arrays, without the
// interpreter's lock.
#include <nanobind/stl/array.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <thread>
#include <utility>
#include <vector>

#include "conversions.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/outliers.hpp"
#include "rows.hpp"

namespace palpate::bindings {
namespace {

void check(bool agree) {
  if (!agree) throw nb::value_error("the arrays must have as many rows, and samples in them");
}

double noise_of(const InputArray& values) {
  std::vector<double> spare(values.size() + 1);
  return rows::noise_of({values.data(), values.size()}, spare.data());
}

double step_of(const InputArray& values) {
  std::vector<double> spare(2 * values.size() + 1);
  return rows::step_of({values.data(), values.size()}, spare.data());
}

void resolutions(const InputRows& penetration, const OutputArray& result, std::size_t threads) {
  const std::size_t samples = penetration.shape(1);
  check(result.size() == penetration.shape(0));
  each_row(penetration.shape(0), 2 * samples, threads, [&](std::size_t row, double* spare) {
    result.data()[row] = rows::resolution_of({penetration.data() + row * samples, samples}, spare);
  });
}

double largest_of(const InputArray& values) {
  std::vector<double> spare(values.size() + 1);
  return rows::largest_of({values.data(), values.size()}, spare.data());
}

// Only of rows that may hold one where they are screened.
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

double end_of_range(const InputArray& time, const InputArray& penetration,
                    const InputArray& velocity, const InputArray& force,
                    const std::array<double, 3>& parameters) {
  const std::size_t count = penetration.size();
  check(time.size() == count && velocity.size() == count && force.size() == count);
  const HuntCrossley model{parameters[0], parameters[1], parameters[2]};
  const auto law = [&](double x, double v) noexcept { return model.force(x, v); };
  OutlierRejection rejection{OutlierRejection::Settings{}};
  double before = NAN;
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
  std::vector<double> spare(2 * count);
  const ContactGate::Settings gate = rows::gate_of(contact, touching, spare.data());
  return {gate.minimum_penetration, gate.make_force, gate.break_force};
}

void working_depths(const InputRows& penetration, const InputRows& force,
                    const InputArray& surfaces, const OutputArray& result, std::size_t threads) {
  const std::size_t count = penetration.shape(0), samples = penetration.shape(1);
  check(force.size() == penetration.size() && surfaces.size() == count &&
        result.size() == 2 * count);
  each_row(count, 3 * samples, threads, [&](std::size_t row, double* spare) {
    const double* place = penetration.data() + row * samples;
    double* depth = spare + 2 * samples;
    for (std::size_t k = 0; k < samples; ++k) depth[k] = place[k] - surfaces.data()[row];
    const std::array<double, 2> found =
        rows::working_depths({depth, force.data() + row * samples, samples}, spare);
    std::copy(found.begin(), found.end(), result.data() + 2 * row);
  });
}

}  // namespace

void each_row(std::size_t rows, std::size_t size, std::size_t threads,
              const std::function<void(std::size_t row, double* spare)>& work) {
  // So many rows at once that threads do not meet at the counter, or in a cache line.
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
  std::vector<std::jthread> others;
  others.reserve(workers - 1);
  for (std::size_t worker = 1; worker < workers; ++worker) others.emplace_back(run, worker);
  run(0);
}

void bind_rows(nb::module_& module) {
  module.def("noise_of", &noise_of, nb::arg("values"),
             "Standard deviation of white noise on a smooth signal, from its fourth differences.");
  module.def("step_of", &step_of, nb::arg("values"),
             "Median gap between the distinct values of a channel; 0 of a constant one.");
  module.def("resolutions", &resolutions, nb::arg("penetration"), nb::arg("result"),
             nb::arg("threads"),
             "Fills, for contacts as rows, twice the noise of the penetration, its rounding "
             "included, m; NaN where it has neither.");
  module.def("largest_of", &largest_of, nb::arg("values"),
             "99.9th percentile of the values' size; 0 of none.");
  module.def("mark_spikes", &mark_spikes, nb::arg("values"), nb::arg("screened"), nb::arg("marks"),
             nb::arg("threads"),
             "Marks the spikes of each row: where they are screened, only of rows in which one "
             "leaves its two neighbours as a spike does.");
  module.def("end_of_range", &end_of_range, nb::arg("time"), nb::arg("penetration"),
             nb::arg("velocity"), nb::arg("force"), nb::arg("parameters"),
             "The force at which the range of its sensor ends; infinite where none does: of a "
             "contact below its surface, whose Hunt-Crossley law has these parameters.");
  module.def("gate_of", &gate_of, nb::arg("penetration"), nb::arg("velocity"), nb::arg("force"),
             "The three settings of a gate for a contact, SI.");
  module.def("working_depths", &working_depths, nb::arg("penetration"), nb::arg("force"),
             nb::arg("surfaces"), nb::arg("result"), nb::arg("threads"),
             "Fills, for contacts as rows, median and largest penetration beyond its surface where "
             "the gate of each holds contact for firm, m; NaN where it never is.");
}

}  // namespace palpate::bindings
