// OnlinePreparation, and its samples: tuples that estimator.update takes as arguments; and
// PayloadCompensation, which may precede it.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <tuple>
#include <utility>

#include "conversions.hpp"
#include "palpate/online_preparation.hpp"
#include "palpate/payload_compensation.hpp"

namespace palpate::bindings {
namespace {

// The longest window, in samples: a quarter of a second at 1 kHz.
constexpr std::size_t longest_window = 255;
using Online = OnlinePreparation<longest_window>;

// The result of update(). `time` is not in the tuple, so *sample are the estimator's arguments.
PyTypeObject* sample_type = nullptr;

constexpr const char* sample_doc =
    R"(A delayed sample with its velocity, for ``estimator.update(*sample)``.

Attributes
----------
penetration, force : float
    m and N, as measured; the force minus the tare.
velocity : float
    m/s, positive while penetrating.
dt : float
    Time since the previous returned sample, s.
time : float
    By the times passed to ``update``, otherwise since the first call, s; not in the tuple.

Examples
--------
>>> import palpate
>>> online = palpate.OnlinePreparation(sample_time=0.001)
>>> samples = [online.update(1e-5 * k, 0.02 * k) for k in range(100)]
>>> round(samples[-1].velocity, 6), round(samples[-1].dt, 6)  # m/s and s
(0.01, 0.001))";

void bind_sample(nb::module_& module) {
  static PyStructSequence_Field fields[] = {
      {"penetration", "m, as measured."},
      {"velocity", "m/s, positive while penetrating."},
      {"force", "N, as measured, minus the tare."},
      {"dt", "s, since the previous returned sample."},
      {"time", "s, by the times passed to update(), otherwise since the first call."},
      {nullptr, nullptr}};
  static PyStructSequence_Desc description = {"palpate._core.PreparedSample", sample_doc, fields,
                                              4};
  sample_type = PyStructSequence_NewType(&description);
  if (!sample_type) throw nb::python_error();
  module.attr("PreparedSample") = nb::handle(reinterpret_cast<PyObject*>(sample_type));
}

PyObject* prepared_sample(const Online& core) noexcept {
  PyObject* made = PyStructSequence_New(sample_type);
  if (!made) return nullptr;
  const FilteredSample sample = core.sample();
  const double values[] = {sample.penetration, sample.velocity, sample.force, sample.dt,
                           core.time()};
  for (std::size_t i = 0; i < std::size(values); ++i) {
    PyObject* value = PyFloat_FromDouble(values[i]);
    if (!value) {
      Py_DECREF(made);
      return nullptr;
    }
    PyStructSequence_SetItem(made, static_cast<Py_ssize_t>(i), value);
  }
  return made;
}

constexpr const char* online_update_doc =
    R"(update(self, position, force, time=None)
--

Take one measured sample, and return the one that is now ready, of :attr:`delay` ago.

Returns None if none is ready; :attr:`status` has the reason. Never raises on data; a refused
sample changes nothing.

Parameters
----------
position : float or sequence of 3 floats
    m, along the contact normal and growing into the material; with a ``direction`` a vector.
force : float or sequence of 3 floats
    N, compression positive; with a ``direction`` a vector.
time : float, optional
    s, by any clock. Default: ``sample_time`` after the previous call.)";

using bindings::number_of;

// `numbers` gets the numbers of a sequence of this length.
template <std::size_t Size>
bool number_of(PyObject* object, std::array<double, Size>& numbers) noexcept {
  PyObject* sequence = PySequence_Tuple(object);
  if (!sequence) {
    if (PyErr_ExceptionMatches(PyExc_TypeError)) {
      PyErr_SetString(PyExc_TypeError, "with a direction, position and force must be vectors");
    }
    return false;
  }
  bool good = PyTuple_Size(sequence) == static_cast<Py_ssize_t>(Size);
  if (!good) PyErr_Format(PyExc_TypeError, "a vector must have %zu numbers", Size);
  for (std::size_t i = 0; good && i < Size; ++i) {
    good = number_of(PyTuple_GetItem(sequence, static_cast<Py_ssize_t>(i)), numbers[i]);
  }
  Py_DECREF(sequence);
  return good;
}

bool directed(const Online& core) noexcept {
  return core.settings().direction != std::array<double, 3>{};
}

PyObject* online_update(PyObject* self, PyObject* const* args, Py_ssize_t positional,
                        PyObject* names) noexcept {
  static constexpr std::array<const char*, 3> parameters{"position", "force", "time"};
  std::array<PyObject*, 3> placed{};
  if (positional == 2 && !names) [[likely]] {
    placed = {args[0], args[1], nullptr};
  } else if (!place_arguments(args, positional, names, parameters, placed)) {
    return nullptr;
  }
  if (!nb::inst_ready(self)) {
    PyErr_SetString(PyExc_TypeError, "update() of a preparation that was never initialised");
    return nullptr;
  }
  Online& core = *nb::inst_ptr<Online>(self);
  const bool timed = placed[2] && placed[2] != Py_None;
  double time = 0.0;
  if (timed && !number_of(placed[2], time)) return nullptr;
  const auto update = [&]<class Number>(Number position, Number force) noexcept {
    if (!number_of(placed[0], position) || !number_of(placed[1], force)) return false;
    timed ? core.update_at(position, force, time) : core.update(position, force);
    return true;
  };
  using Vector3 = std::array<double, 3>;
  if (!(directed(core) ? update(Vector3{}, Vector3{}) : update(0.0, 0.0))) return nullptr;
  if (core.status() != Status::updated) Py_RETURN_NONE;
  return prepared_sample(core);
}

PyMethodDef online_methods[] = {
    {"update", reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(&online_update)),
     METH_FASTCALL | METH_KEYWORDS, online_update_doc},
    {nullptr, nullptr, 0, nullptr}};
PyType_Slot online_slots[] = {{Py_tp_methods, online_methods}, {0, nullptr}};

// The recursion over arrays: its samples, and their number. A segment ends where the window
// restarts.
std::size_t replay_online(Online& core, const InputArray& position, const InputArray& force,
                          const std::optional<InputArray>& time, const OutputArray& given_time,
                          const OutputArray& penetration, const OutputArray& velocity,
                          const OutputArray& given_force, const LabelArray& segment) {
  const bool vectors = directed(core);
  const std::size_t samples = vectors ? position.size() / 3 : position.size();
  const auto vector_at = [](const InputArray& array, std::size_t k) noexcept {
    const double* row = array.data() + 3 * k;
    return std::array<double, 3>{row[0], row[1], row[2]};
  };
  const auto update = [&](std::size_t k, const auto& p, const auto& f) noexcept {
    return time ? core.update_at(p, f, time->data()[k]) : core.update(p, f);
  };
  std::size_t given = 0;
  std::int64_t label = 0;
  for (std::size_t k = 0; k < samples; ++k) {
    const Status status = vectors ? update(k, vector_at(position, k), vector_at(force, k))
                                  : update(k, position.data()[k], force.data()[k]);
    if (status == Status::restarted) ++label;
    if (status != Status::updated) continue;
    const FilteredSample sample = core.sample();
    given_time.data()[given] = core.time();
    penetration.data()[given] = sample.penetration;
    velocity.data()[given] = sample.velocity;
    given_force.data()[given] = sample.force;
    segment.data()[given++] = label;
  }
  return given;
}

void make_online(Online* self, double sample_time, std::uint32_t samples, double longest_gap,
                 bool lost_positions, double surface, double force_offset, double tare_time,
                 bool flip_penetration, bool flip_force, const std::array<double, 3>& direction,
                 double force_delay) {
  const VelocityFilterSettings filter{sample_time, samples, longest_gap, lost_positions,
                                      force_delay};
  const OnlinePreparationSettings settings{filter,           surface,    force_offset, tare_time,
                                           flip_penetration, flip_force, direction};
  if (const char* fault = validate(settings, longest_window)) throw nb::value_error(fault);
  new (self) Online(settings);
}

// The longest window, in samples: 0.1 s at 1.5 kHz.
constexpr std::size_t longest_motion = 151;
using Compensation = PayloadCompensation<longest_motion>;

constexpr const char* compensation_update_doc =
    R"(update(self, position, orientation, wrench, time)
--

Take one measured sample. If the result is ``UPDATED``, :attr:`position`, :attr:`force`,
:attr:`torque` and :attr:`time` are those of :attr:`delay` ago.

Never raises on data; a refused sample changes nothing.

Parameters
----------
position : sequence of 3 floats
    Origin of the pose in the base, m.
orientation : sequence of 4 floats or of 3 rows
    Unit quaternion x, y, z, w, or rotation matrix, of the pose in the base.
wrench : sequence of 6 or 3 floats
    Force, N, and torque, N·m, as the sensor reads them, in its axes; the torque may be missing.
time : float
    s, by any clock.

Returns
-------
Status
    ``UPDATED``; ``WAITING`` (no sample is ready); ``RESTARTED`` (the first sample of a new window,
    after a gap of ten ``sample_time`` or a jump of the clock); ``NOT_FINITE``, ``INVALID_STEP`` or
    ``OUT_OF_RANGE`` (refused).)";

bool is_long(PyObject* object, Py_ssize_t size) noexcept {
  const Py_ssize_t length = PySequence_Size(object);
  if (length < 0) PyErr_Clear();
  return length == size;
}

bool orientation_of(PyObject* object, Vector<4>& orientation) noexcept {
  if (!is_long(object, 3)) return number_of(object, orientation);
  Matrix<3> rows{};
  for (std::size_t i = 0; i < 3; ++i) {
    PyObject* row = PySequence_GetItem(object, static_cast<Py_ssize_t>(i));
    const bool good = row && number_of(row, rows[i]);
    Py_XDECREF(row);
    if (!good) return false;
  }
  orientation = quaternion_of(rows);
  return true;
}

bool wrench_of(PyObject* object, Vector<6>& wrench) noexcept {
  if (!is_long(object, 3)) return number_of(object, wrench);
  Vector<3> force{};
  const bool good = number_of(object, force);
  wrench = {force[0], force[1], force[2], 0.0, 0.0, 0.0};
  return good;
}

PyObject* compensation_update(PyObject* self, PyObject* const* args, Py_ssize_t positional,
                              PyObject* names) noexcept {
  static constexpr std::array<const char*, 4> parameters{"position", "orientation", "wrench",
                                                         "time"};
  std::array<PyObject*, 4> placed{};
  if (!place_arguments(args, positional, names, parameters, placed)) return nullptr;
  if (!placed[3] || !nb::inst_ready(self)) {
    PyErr_SetString(PyExc_TypeError,
                    placed[3] ? "update() before __init__()" : "update() missing argument 'time'");
    return nullptr;
  }
  Vector<3> position{};
  Vector<4> orientation{};
  Vector<6> wrench{};
  double time = 0.0;
  if (!number_of(placed[0], position) || !orientation_of(placed[1], orientation) ||
      !wrench_of(placed[2], wrench) || !number_of(placed[3], time)) {
    return nullptr;
  }
  return member_of(nb::inst_ptr<Compensation>(self)->update(position, orientation, wrench, time));
}

PyMethodDef compensation_methods[] = {
    {"update", reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(&compensation_update)),
     METH_FASTCALL | METH_KEYWORDS, compensation_update_doc},
    {nullptr, nullptr, 0, nullptr}};
PyType_Slot compensation_slots[] = {{Py_tp_methods, compensation_methods}, {0, nullptr}};

void make_compensation(Compensation* self, double sample_time, std::uint32_t samples, bool in_base,
                       double delay, double sign, double mass, const Vector<3>& centre,
                       const Vector<3>& lever, const Matrix<3>& inertia, const Matrix<3>& mount,
                       const Vector<6>& bias) {
  const PayloadCompensationSettings settings{
      sample_time,          samples, in_base, delay, sign, mass, centre, lever, inertia,
      quaternion_of(mount), bias};
  if (const char* fault = validate(settings, longest_motion)) throw nb::value_error(fault);
  new (self) Compensation(settings);
}

void bind_payload_compensation(nb::module_& module) {
  using Three = std::tuple<double, double, double>;
  const auto part = [](std::size_t first) {
    return [first](const Compensation& self) {
      const Vector<6>& wrench = self.output().wrench;
      return Three(wrench[first], wrench[first + 1], wrench[first + 2]);
    };
  };
  nb::class_<Compensation>(module, "PayloadCompensation", nb::type_slots(compensation_slots))
      .def("__init__", &make_compensation)
      .def("start_tare", &Compensation::start_tare, "Begin a tare: keep the tool in free air.")
      .def("finish_tare", &Compensation::finish_tare,
           "Add the mean wrench since :meth:`start_tare` to the bias; return whether there is one.")
      .def("reset", &Compensation::reset, "Forget everything but the settings.")
      .def_prop_ro("delay", &Compensation::delay, "Delay of the output, s.")
      .def_prop_ro("force", part(0), "Force of the environment on the tool, N.")
      .def_prop_ro("torque", part(3), "Torque about the origin of the sensor, N·m.")
      .def_prop_ro(
          "position",
          [](const Compensation& self) {
            const Vector<3>& position = self.output().position;
            return Three(position[0], position[1], position[2]);
          },
          "Origin of the pose, m.")
      .def_prop_ro(
          "time", [](const Compensation& self) { return self.output().time; },
          "Time of the output, s.")
      .def("_state", [](const Compensation& self) { return saved(self, "PayloadCompensation"); })
      .def("_restore", [](Compensation& self, const nb::bytes& state) {
        restore(self, "PayloadCompensation", state);
      });
}

}  // namespace

void bind_online_preparation(nb::module_& module) {
  bind_sample(module);
  bind_payload_compensation(module);
  nb::class_<Online>(module, "OnlinePreparation", nb::is_weak_referenceable(),
                     nb::type_slots(online_slots))
      .def("__init__", &make_online)
      .def("_replay", &replay_online, nb::arg(), nb::arg(), nb::arg().none(), nb::arg(), nb::arg(),
           nb::arg(), nb::arg(), nb::arg())
      .def("interrupt", &Online::interrupt,
           "Start a new window: the next sample does not continue the latest one.")
      .def("reset", &Online::reset, "Forget everything but the settings.")
      .def_prop_ro("status", &Online::status, "Status of the latest sample.")
      .def_prop_ro("delay", &Online::delay, "Delay of the returned samples, s, if none is missing.")
      .def_prop_ro(
          "tare", &Online::tare,
          "The mean force of the first ``tare_time``, N, which is subtracted; NaN until it "
          "is known.")
      .def("_state", [](const Online& self) { return saved(self, "OnlinePreparation"); })
      .def("_restore",
           [](Online& self, const nb::bytes& state) { restore(self, "OnlinePreparation", state); });
  nb::dict defaults;
  const OnlinePreparationSettings settings;
  defaults["sample_time"] = settings.filter.sample_time;
  defaults["lost_positions"] = settings.filter.lost_positions;
  defaults["longest_window"] = longest_window;
  module.attr("defaults")["OnlinePreparation"] = defaults;
}

}  // namespace palpate::bindings
