#include <algorithm>
#include <array>
#include <cstddef>

#include "conversions.hpp"
#include "palpate/error_widening.hpp"

namespace palpate::bindings {
namespace {

// Variances of influence · Σ J e over all samples, J and e of this order in time.
template <std::size_t Size>
nb::object variances(const InputArray& slopes, const InputArray& residual,
                     const InputArray& influence) {
  detail::HaarLevels<Size> levels;
  double energy = 0.0;
  for (std::size_t i = 0; i < residual.size(); ++i) {
    Vector<Size> slope{};
    std::copy_n(slopes.data() + i * Size, Size, slope.begin());
    const double error = residual.data()[i];
    levels.add(slope, error, 1.0);
    energy += error * error;
  }
  const double freedom =
      std::max(static_cast<double>(residual.size()) - static_cast<double>(Size), 1.0);
  const detail::ErrorWidening<Size, 1> widening(levels, {}, std::max(energy / freedom, 1e-300));
  Vector<Size> result{};
  for (std::size_t i = 0; i < Size; ++i) {
    Vector<Size> row{};
    std::copy_n(influence.data() + i * Size, Size, row.begin());
    result[i] = widening.variance(row);
  }
  return copied_array(result.data(), {Size});
}

}  // namespace

void bind_error_bars(nb::module_& module) {
  module.def(
      "correlated_variances",
      [](const InputArray& slopes, const InputArray& residual, const InputArray& influence) {
        const std::size_t count = residual.size();
        if (slopes.size() == 2 * count && influence.size() == 4) {
          return variances<2>(slopes, residual, influence);
        }
        if (slopes.size() == 3 * count && influence.size() == 9) {
          return variances<3>(slopes, residual, influence);
        }
        throw nb::value_error("slopes must have two or three columns, influence as many squared");
      },
      nb::arg("slopes"), nb::arg("residual"), nb::arg("influence"),
      "Variances of influence · Σ J e where the residual e is correlated: J by rows, influence "
      "too.");
}

}  // namespace palpate::bindings
