// How the core's values look from Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <type_traits>

namespace palpate::bindings {

namespace nb = nanobind;

using InputArray = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using OutputArray = nb::ndarray<double, nb::c_contig, nb::device::cpu>;
using StatusArray = nb::ndarray<std::uint8_t, nb::c_contig, nb::device::cpu>;

inline nb::object copied_array(const double* data, std::initializer_list<std::size_t> shape) {
  return nb::ndarray<nb::numpy, const double>(data, shape).cast(nb::rv_policy::copy);
}

// The whole state of a trivially copyable estimator, and back. Both ends are the same build.
template <class T>
nb::bytes state_of(const T& estimator) {
  if constexpr (requires { estimator.with([](auto&) {}); }) {
    return estimator.with([](auto& core) { return state_of(core); });
  } else {
    static_assert(std::is_trivially_copyable_v<T>);
    return nb::bytes(reinterpret_cast<const char*>(&estimator), sizeof(T));
  }
}

template <class T>
void restore(T& estimator, const nb::bytes& state) {
  if constexpr (requires { estimator.with([](auto&) {}); }) {
    estimator.with([&](auto& core) { restore(core, state); });
  } else {
    static_assert(std::is_trivially_copyable_v<T>);
    if (state.size() != sizeof(T)) {
      throw nb::value_error("this saved state was made by another version of palpate");
    }
    std::memcpy(static_cast<void*>(&estimator), state.c_str(), sizeof(T));
  }
}

void bind_force_laws(nb::module_& module);
void bind_estimate(nb::module_& module);
void bind_estimators(nb::module_& module);
void bind_projection(nb::module_& module);
void bind_least_squares(nb::module_& module);

}  // namespace palpate::bindings
