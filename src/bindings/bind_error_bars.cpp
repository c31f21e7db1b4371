#include <algorithm>
#include <array>
#include <cstddef>

#include "conversions.hpp"
#include "palpate/error_widening.hpp"

namespace palpate::bindings {
namespace {

// Variances of influence · Σ J e over all samples, J and e of this order in time.
template <std::size_t Size>
void variances(const InputRows& slopes, const InputArray& residual, const InputRows& influence,
               const OutputArray& result) {
  detail::HaarLevels<Size> levels;
  double energy = 0.0;
  for (std::size_t i = 0; i < residual.size(); ++i) {
    Vector<Size> slope{};
    std::copy_n(slopes.data() + i * Size, Size, slope.begin());
    levels.add(slope, residual.data()[i], 1.0);
    energy += residual.data()[i] * residual.data()[i];
  }
  const double count = static_cast<double>(residual.size()), size = static_cast<double>(Size);
  const double variance = std::max(energy / std::max(count - size, 1.0), 1e-300);
  const detail::ErrorWidening<Size, 1> widening(levels, {}, variance);
  for (std::size_t i = 0; i < Size; ++i) {
    Vector<Size> row{};
    std::copy_n(influence.data() + i * Size, Size, row.begin());
    result.data()[i] = widening.variance(row);
  }
}

void correlated_variances(const InputRows& slopes, const InputArray& residual,
                          const InputRows& influence, const OutputArray& result) {
  const std::size_t size = slopes.shape(1);
  if ((size != 2 && size != 3) || slopes.shape(0) != residual.size() ||
      influence.shape(0) != size || influence.shape(1) != size || result.size() != size) {
    throw nb::value_error("slopes must have two or three columns, influence as many squared");
  }
  (size == 2 ? variances<2> : variances<3>)(slopes, residual, influence, result);
}

}  // namespace

void bind_error_bars(nb::module_& module) {
  module.def("correlated_variances", &correlated_variances, nb::arg("slopes"), nb::arg("residual"),
             nb::arg("influence"), nb::arg("result"),
             "Fills the variances of influence · Σ J e, where the residual e is correlated: J by "
             "rows, influence too.");
}

}  // namespace palpate::bindings
