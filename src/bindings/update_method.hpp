// update(penetration, velocity, force, dt=None) as a plain C method: a call costs about half of one
// through the binding library's dispatcher, and it is made a thousand times a second.
#pragma once

#include <array>
#include <cstddef>
#include <stdexcept>

#include "conversions.hpp"
#include "palpate/status.hpp"

namespace palpate::bindings {

// The members of the Python enumeration, by value; filled when the enumeration is bound.
inline std::array<PyObject*, status_count> status_members{};

inline PyObject* member_of(Status status) noexcept {
  PyObject* member = status_members[static_cast<std::size_t>(status)];
  Py_INCREF(member);
  return member;
}

inline constexpr const char* update_doc =
    R"(update(self, penetration, velocity, force, dt=None)
--

Take one sample, and say with a :class:`Status` what was done with it.

Never raises on data and never allocates; the sample is taken whole or not at all.

Parameters
----------
penetration : float
    m, positive inside the material.
velocity : float
    m/s, positive while penetrating.
force : float
    N, compression positive.
dt : float, optional
    Time since the previous sample, s; ``sample_time`` unless given.)";

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

template <class Handle>
PyObject* update_method(PyObject* self, PyObject* const* args, Py_ssize_t positional,
                        PyObject* names) noexcept {
  static constexpr std::array<const char*, 4> parameters{"penetration", "velocity", "force", "dt"};
  std::array<PyObject*, 4> placed{};
  if (positional == 3 && !names) [[likely]] {
    placed = {args[0], args[1], args[2], nullptr};
  } else if (!place_arguments(args, positional, names, parameters, placed)) {
    return nullptr;
  }
  const bool default_step = !placed[3] || placed[3] == Py_None;
  std::array<double, 4> numbers{};
  for (std::size_t i = 0; i < (default_step ? 3U : 4U); ++i) {
    if (!number_of(placed[i], numbers[i])) return nullptr;
  }
  if (!nb::inst_ready(self)) {
    PyErr_SetString(PyExc_TypeError, "update() of an estimator that was never initialised");
    return nullptr;
  }
  Handle& handle = *nb::inst_ptr<Handle>(self);
  try {
    handle.wait_until_free();
  } catch (const std::runtime_error& fault) {
    PyErr_SetString(PyExc_RuntimeError, fault.what());
    return nullptr;
  }
  return member_of(handle.with([&](auto& core) {
    const double dt = default_step ? core.settings().sample_time : numbers[3];
    return core.update(numbers[0], numbers[1], numbers[2], dt);
  }));
}

template <class Handle>
inline PyMethodDef update_methods[] = {
    {"update", reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(&update_method<Handle>)),
     METH_FASTCALL | METH_KEYWORDS, update_doc},
    {nullptr, nullptr, 0, nullptr}};

template <class Handle>
inline PyType_Slot update_slots[] = {{Py_tp_methods, update_methods<Handle>}, {0, nullptr}};

}  // namespace palpate::bindings
