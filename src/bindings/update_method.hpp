// What an update() as a plain C method needs: a call costs about half of one through the binding
// library's dispatcher, and it is made a thousand times a second.
#pragma once

#include <array>
#include <cstddef>

#include "conversions.hpp"
#include "palpate/sample.hpp"

namespace palpate::bindings {

// The members of the Python enumeration, by value; filled when the enumeration is bound.
inline std::array<PyObject*, status_count> status_members{};

inline PyObject* member_of(Status status) noexcept {
  PyObject* member = status_members[static_cast<std::size_t>(status)];
  Py_INCREF(member);
  return member;
}

// Puts positional and keyword arguments into their places; false, with a Python error set, where
// they are not so many by these names. The last may be left out.
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

// False, with a Python error set, where it is no number.
inline bool number_of(PyObject* object, double& number) noexcept {
  if (PyFloat_CheckExact(object)) [[likely]] {
    number = PyFloat_AS_DOUBLE(object);
    return true;
  }
  number = PyFloat_AsDouble(object);
  return number != -1.0 || !PyErr_Occurred();
}

}  // namespace palpate::bindings
