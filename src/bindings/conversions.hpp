// Conversion of the core's values to Python, saved states, and update() as a method.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "palpate/sample.hpp"

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

// Calls work(row, spare) for each row, on several threads including this one, without the
// interpreter's lock; `spare` is each thread's own workspace.
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

// A saved state: a line that identifies it, and the memory of a trivially copyable core, or of its
// parts.
//
//   palpate-state 3;0.1.0;VariableProjection.0;4320;1f0c…\n<bytes>
//
// A restored state must have the same version, class, size and settings, and a matching checksum;
// otherwise an error names the difference.
using Memory = std::string_view;

// `name` distinguishes classes of the same size.
nb::bytes saved(const std::string& name, std::span<const Memory> parts);

// The bytes of the parts, one after the other, in a state like that of `present`.
Memory opened(const std::string& name, const nb::bytes& state, std::span<const Memory> present);

void check_settings(bool same);
void check_ranges(bool sound);

// The bytes of an optional part.
template <class Part>
Memory memory_of(const Part* part) noexcept {
  static_assert(std::is_trivially_copyable_v<Part>);
  return part ? Memory(reinterpret_cast<const char*>(part), sizeof(Part)) : Memory();
}

// Removes a part from the front. A checksum can be right by intent, so a part with indices checks
// them.
template <class Part>
Part taken(Memory& memory) {
  std::array<std::byte, sizeof(Part)> bytes;
  std::memcpy(bytes.data(), memory.data(), sizeof(Part));
  memory.remove_prefix(sizeof(Part));
  const Part part = std::bit_cast<Part>(bytes);
  if constexpr (requires { part.sound(); }) check_ranges(part.sound());
  return part;
}

template <class Core>
nb::bytes saved(const Core& core, const std::string& name) {
  return saved(name, std::array{memory_of(&core)});
}

template <class Core>
void restore(Core& core, const std::string& name, const nb::bytes& state) {
  Memory memory = opened(name, state, std::array{memory_of(&core)});
  const Core candidate = taken<Core>(memory);
  check_settings(candidate.settings() == core.settings());
  core = candidate;
}

// update() is a plain C method: at a thousand calls a second it takes half the time of one through
// the binding library's dispatcher.
// The members of the Python enumeration by value; filled when the enumeration is bound.
inline std::array<PyObject*, status_count> status_members{};

inline PyObject* member_of(Status status) noexcept {
  PyObject* member = status_members[static_cast<std::size_t>(status)];
  Py_INCREF(member);
  return member;
}

// Sorts positional and keyword arguments by parameter; false, with a Python error set, if they do
// not match. The last argument is optional.
template <std::size_t Size>
bool place_arguments(PyObject* const* args, Py_ssize_t positional, PyObject* names,
                     const std::array<const char*, Size>& parameters,
                     std::array<PyObject*, Size>& placed) noexcept {
  if (positional > static_cast<Py_ssize_t>(Size)) {
    PyErr_Format(PyExc_TypeError, "update() takes at most %zu arguments", Size);
    return false;
  }
  for (Py_ssize_t i = 0; i < positional; ++i) placed[static_cast<std::size_t>(i)] = args[i];
  const Py_ssize_t named = names ? PyTuple_Size(names) : 0;
  for (Py_ssize_t i = 0; i < named; ++i) {
    PyObject* name = PyTuple_GetItem(names, i);
    std::size_t place = 0;
    while (place < Size && PyUnicode_CompareWithASCIIString(name, parameters[place]) != 0) ++place;
    if (place == Size || placed[place]) {
      PyErr_Format(PyExc_TypeError, "update() got an unexpected or repeated argument '%U'", name);
      return false;
    }
    placed[place] = args[positional + i];
  }
  for (std::size_t place = 0; place + 1 < Size; ++place) {
    if (placed[place]) continue;
    PyErr_Format(PyExc_TypeError, "update() missing argument '%s'", parameters[place]);
    return false;
  }
  return true;
}

// False, with a Python error set, if it is not a number.
inline bool number_of(PyObject* object, double& number) noexcept {
  number = PyFloat_AsDouble(object);
  return number != -1.0 || !PyErr_Occurred();
}

}  // namespace palpate::bindings
