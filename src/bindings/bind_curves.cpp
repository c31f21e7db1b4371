// Whole curves, many in one call: rows shared out among threads, without the interpreter's lock.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "compiled_curve_kernels.hpp"
#include "conversions.hpp"
#include "palpate/curves/curve_fit.hpp"

namespace palpate::bindings {
namespace {

using Pair = std::array<double, 2>;
using Triple = std::array<double, 3>;

// Where the answers go, a row a curve.
struct CurveColumns {
  double* numbers;  // K, B, n, F₀, d, noise, cost, scale (3), prior of F₀ (2), σ²
  double* covariance;
  std::int64_t* taken;
  std::uint8_t* codes;  // flags, status
  std::uint8_t* roles;  // null where nobody asks
};
constexpr std::size_t numbers_per_curve = 13;

void write(const CurveFit& fit, std::size_t row, const CurveColumns& to) {
  double* numbers = to.numbers + numbers_per_curve * row;
  const bool found = fit.status != CurveStatus::no_contact;
  for (std::size_t i = 0; i < 5; ++i) {
    numbers[i] = found ? fit.parameters[i] : NAN;
    for (std::size_t j = 0; j < 5; ++j) {
      to.covariance[25 * row + 5 * i + j] = found ? fit.covariance[i][j] : NAN;
    }
  }
  numbers[5] = found ? fit.noise : NAN;
  numbers[6] = found ? fit.cost : NAN;
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
  const curves::CurveKernels* kernels = curves::kernels_of(instruction_set);
  if (!kernels) throw nb::value_error(("there is no instruction set " + instruction_set).c_str());
  const std::size_t count = penetration.shape(0), samples = penetration.shape(1);
  CurveSettings shared;
  shared.noise = noise;
  shared.lowest_exponent = exponents[0];
  shared.highest_exponent = exponents[1];
  shared.exponent_fixed = !(exponents[1] > exponents[0]);
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

// Without a choice of samples and without priors: in the units that they come in, from each start.
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
  CurveModel model{{}, curves::kernels_of(""), surfaces[0], surfaces[1]};
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

void bind_curves(nb::module_& module) {
  module.def("fit_curves", &fit_curves, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
             nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg(), nb::arg(), nb::arg(),
             nb::arg(), nb::arg(), nb::arg().none(), nb::arg(), nb::arg() = "",
             "What palpate.estimators.curves.fit_curves calls, a row a curve.");
  module.def("fit_samples", &fit_samples, nb::arg(), nb::arg(), nb::arg(), nb::arg(),
             "(k, c, n, F₀, d) of the least squares of samples, rows of x, v and F.");
}

}  // namespace palpate::bindings
