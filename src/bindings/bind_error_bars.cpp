#include <algorithm>
#include <array>
#include <cstddef>

#include "conversions.hpp"
#include "palpate/error_widening.hpp"

namespace palpate::bindings {
namespace {

// Variances of influence · Σ J e over all samples, J and e of this order in time.
template <std::size_t Size>
void variances(const double* slopes, const double* residual, const bool* used, std::size_t samples,
               const double* influence, double* result) {
  detail::HaarLevels<Size> levels;
  double energy = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < samples; ++i) {
    if (!used[i]) continue;
    Vector<Size> slope{};
    std::copy_n(slopes + i * Size, Size, slope.begin());
    levels.add(slope, residual[i], 1.0);
    energy += residual[i] * residual[i];
    ++count;
  }
  const double freedom = std::max(static_cast<double>(count) - static_cast<double>(Size), 1.0);
  const detail::ErrorWidening<Size, 1> widening(levels, {}, std::max(energy / freedom, 1e-300));
  for (std::size_t i = 0; i < Size; ++i) {
    Vector<Size> row{};
    std::copy_n(influence + i * Size, Size, row.begin());
    result[i] = widening.variance(row);
  }
}

using UsedRows = nb::ndarray<const bool, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Stack = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// A contact a row, without the interpreter's lock.
void correlated_variances(const Stack& slopes, const Rows& residual, const UsedRows& used,
                          const Stack& influence, const OutputArray& result) {
  const std::size_t count = residual.shape(0), samples = residual.shape(1), size = slopes.shape(2);
  if ((size != 2 && size != 3) || slopes.size() != size * residual.size() ||
      used.size() != residual.size() || influence.size() != size * size * count ||
      result.size() != size * count) {
    throw nb::value_error("slopes must have two or three columns, influence as many squared");
  }
  const nb::gil_scoped_release release;
  const auto some = size == 2 ? &variances<2> : &variances<3>;
  for (std::size_t row = 0; row < count; ++row) {
    const std::size_t start = row * samples;
    some(slopes.data() + start * size, residual.data() + start, used.data() + start, samples,
         influence.data() + row * size * size, result.data() + row * size);
  }
}

}  // namespace

void bind_error_bars(nb::module_& module) {
  module.def(
      "correlated_variances", &correlated_variances, nb::arg("slopes"), nb::arg("residual"),
      nb::arg("used"), nb::arg("influence"), nb::arg("result"),
      "Fills, for contacts as rows, the variances of influence · Σ J e over the samples used, "
      "where the residual e is correlated: J by rows, influence too.");
}

}  // namespace palpate::bindings
