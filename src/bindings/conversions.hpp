// How the core's values look from Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>

namespace palpate::bindings {

namespace nb = nanobind;

using InputArray = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using InputRows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using OutputArray = nb::ndarray<double, nb::c_contig, nb::device::cpu>;
using StatusArray = nb::ndarray<std::uint8_t, nb::c_contig, nb::device::cpu>;
using RowArray = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using LabelArray = nb::ndarray<std::int64_t, nb::c_contig, nb::device::cpu>;

inline nb::object copied_array(const double* data, std::initializer_list<std::size_t> shape) {
  return nb::ndarray<nb::numpy, const double>(data, shape).cast(nb::rv_policy::copy);
}

// Calls work(row, spare) for each row, on so many threads, this one among them, without the
// interpreter's lock; `spare` holds so many numbers, which are the thread's own.
void each_row(std::size_t rows, std::size_t size, std::size_t threads,
              const std::function<void(std::size_t row, double* spare)>& work);

void bind_face(nb::module_& module);
void bind_estimators(nb::module_& module);
void bind_projection(nb::module_& module);
void bind_curves(nb::module_& module);
void bind_least_squares(nb::module_& module);
void bind_online_preparation(nb::module_& module);
void bind_rows(nb::module_& module);
void bind_viscoelastic(nb::module_& module);

}  // namespace palpate::bindings
