// What the samples of contacts say before anything is fitted: rows of arrays, without the
// interpreter's lock.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "gate.hpp"
#include "replay_many.hpp"
#include "spikes.hpp"

namespace palpate::bindings {
namespace {

using InputMask = nb::ndarray<const bool, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Calls work(row, spare) for each row, on so many threads; `spare` holds so many numbers.
template <class Work>
void each_row(std::size_t rows, std::size_t size, std::size_t threads, const Work& work) {
  const nb::gil_scoped_release release;
  in_parts(rows, std::max<std::size_t>(threads, 1), [&](std::size_t first, std::size_t last) {
    std::vector<double> spare(size + 1);
    for (std::size_t row = first; row < last; ++row) work(row, spare.data());
  });
}

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

void percentiles(const InputRows& values, const InputMask& used, double part,
                 const OutputArray& result) {
  const std::size_t samples = values.shape(1);
  check(used.size() == values.size() && result.size() == values.shape(0));
  each_row(values.shape(0), samples, 1, [&](std::size_t row, double* spare) {
    const bool* counts = used.data() + row * samples;
    const auto holds = [&](std::size_t k) noexcept { return counts[k]; };
    const double* own = values.data() + row * samples;
    result.data()[row] = rows::percentile(rows::chosen(own, samples, spare, holds), part);
  });
}

// Calls work(row, contact, velocity, touching, spare) for each row.
template <class Work>
void each_contact(const InputRows& penetration, const InputRows& velocity, const InputRows& force,
                  const OutputArray& result, const Work& work) {
  const std::size_t count = penetration.shape(0), samples = penetration.shape(1);
  check(velocity.size() == penetration.size() && force.size() == penetration.size() &&
        result.size() == 3 * count);
  each_row(count, 2 * samples, 1, [&](std::size_t row, double* spare) {
    const std::size_t start = row * samples;
    const rows::Pressed contact{penetration.data() + start, force.data() + start, samples};
    const double* speed = velocity.data() + start;
    const auto touching = [&](std::size_t k) noexcept {
      return contact.touches(k) & (std::abs(speed[k]) < rows::largest);
    };
    const std::array<double, 3> found = work(contact, speed, touching, spare);
    std::copy(found.begin(), found.end(), result.data() + 3 * row);
  });
}

void gates(const InputRows& penetration, const InputRows& velocity, const InputRows& force,
           const OutputArray& result) {
  each_contact(penetration, velocity, force, result,
               [](const rows::Pressed& contact, const double*, const auto& touching,
                  double* spare) -> std::array<double, 3> {
                 const ContactGate::Settings gate = rows::gate_of(contact, touching, spare);
                 return {gate.minimum_penetration, gate.make_force, gate.break_force};
               });
}

void scales(const InputRows& penetration, const InputRows& velocity, const InputRows& force,
            const OutputArray& result) {
  each_contact(
      penetration, velocity, force, result,
      [](const rows::Pressed& contact, const double* speed, const auto& touching,
         double*) -> std::array<double, 3> { return rows::units_of(contact, speed, touching); });
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
  module.def("percentiles", &percentiles, nb::arg("values"), nb::arg("used"), nb::arg("part"),
             nb::arg("result"),
             "Fills, as NumPy's, a percentile of those of each row that are used, the part in "
             "[0, 1]; NaN of none.");
  module.def("gates", &gates, nb::arg("penetration"), nb::arg("velocity"), nb::arg("force"),
             nb::arg("result"),
             "Fills, for contacts as rows, a gate of each: its three settings, SI.");
  module.def("scales", &scales, nb::arg("penetration"), nb::arg("velocity"), nb::arg("force"),
             nb::arg("result"), "Fills, for contacts as rows, units for the arithmetic of each.");
  module.def("working_depths", &working_depths, nb::arg("penetration"), nb::arg("force"),
             nb::arg("surfaces"), nb::arg("result"), nb::arg("threads"),
             "Fills, for contacts as rows, median and largest penetration beyond its surface where "
             "the gate of each holds contact for firm, m; NaN where it never is.");
}

}  // namespace palpate::bindings
