// Whole curves, many in one call: rows shared out among threads, without the interpreter's lock.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "compiled_curve_kernels.hpp"
#include "conversions.hpp"
#include "palpate/curves/curve_fit.hpp"

namespace palpate::bindings {
namespace {

using Pair = std::array<double, 2>;
using Triple = std::array<double, 3>;
using Curves = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Where the answers go, a row a curve.
struct CurveColumns {
  double* numbers;  // K, B, n, F₀, d, noise, cost, scale (3), prior of F₀ (2), σ²
  double* covariance;
  std::int64_t* taken;
  std::uint8_t* codes;  // flags, status
  std::uint8_t* roles;  // null where nobody asks
};
constexpr std::size_t numbers_per_curve = 13;

// The quickest that this processor has, or the one of this name.
const lanes::CurveKernels& kernels_named(const std::string& name) {
  const lanes::CurveKernels* quickest = nullptr;
  for (const lanes::InstructionSet set : lanes::instruction_sets) {
    const lanes::CurveKernels* kernels = lanes::curve_kernels_of(set);
    if (kernels && (name.empty() || name == lanes::name_of(set))) quickest = kernels;
  }
  if (!quickest) throw nb::value_error(("there is no instruction set " + name).c_str());
  return *quickest;
}

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

void fit_curves(const Curves& penetration, const Curves& velocity, const Curves& force,
                const Pair& exponents, bool offset, double noise, const InputArray& offsets,
                const InputArray& surfaces, const std::optional<Pair>& surface_range,
                const Triple& scale, const OutputArray& numbers, const OutputArray& covariance,
                const LabelArray& taken, const StatusArray& codes,
                const std::optional<StatusArray>& roles, std::size_t threads,
                const std::string& instruction_set) {
  const lanes::CurveKernels& kernels = kernels_named(instruction_set);
  const std::size_t curves = penetration.shape(0), samples = penetration.shape(1);
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
  const std::size_t workers = std::clamp<std::size_t>(threads, 1, std::max<std::size_t>(curves, 1));
  const std::size_t size = curve_memory(samples);
  std::vector<double> memory(workers * size);

  const nb::gil_scoped_release release;
  std::atomic<std::size_t> next = 0;
  const auto work = [&](std::size_t worker) noexcept {
    // So many rows at once that threads do not meet at the counter, or in a cache line.
    constexpr std::size_t rows = 16;
    while (true) {
      const std::size_t first = next.fetch_add(rows, std::memory_order_relaxed);
      if (first >= curves) return;
      for (std::size_t row = first; row < std::min(first + rows, curves); ++row) {
        const std::size_t at = row * samples;
        CurveSettings settings = shared;
        settings.offset_deviation = offsets.data()[row];
        settings.surface_deviation = surfaces.data()[row];
        write(fit_curve({penetration.data() + at, velocity.data() + at, force.data() + at, samples},
                        settings, memory.data() + worker * size, to.roles ? to.roles + at : nullptr,
                        kernels),
              row, to);
      }
    }
  };
  std::vector<std::jthread> others;
  others.reserve(workers - 1);
  for (std::size_t worker = 1; worker < workers; ++worker) others.emplace_back(work, worker);
  work(0);
}

}  // namespace

void bind_curves(nb::module_& module) {
  module.def("fit_curves", &fit_curves, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
             nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg(), nb::arg(), nb::arg(),
             nb::arg(), nb::arg(), nb::arg().none(), nb::arg(), nb::arg() = "",
             "What palpate.curves.fit_curves calls, a row a curve.");
}

}  // namespace palpate::bindings
