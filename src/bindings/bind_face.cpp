// The Python methods of every estimator, and saved states.
#include "face.hpp"

#ifndef _WIN32
#include <unistd.h>
#endif

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <stdexcept>

namespace palpate::bindings {
namespace {

int this_process() noexcept {
#ifdef _WIN32
  return 1;  // it cannot be forked
#else
  return static_cast<int>(::getpid());
#endif
}

void replay_arrays(Face& face, const InputArray& penetration, const InputArray& velocity,
                   const InputArray& force, const std::optional<InputArray>& time_steps,
                   const OutputArray& parameters, const OutputArray& standard_errors,
                   const OutputArray& predicted_force, const OutputArray& validity_margin,
                   const StatusArray& status, const std::optional<RowArray>& samples) {
  const Signals in{penetration.data(), velocity.data(),
                   force.data(),       time_steps ? time_steps->data() : nullptr,
                   penetration.size(), time_steps && time_steps->size() == 1};
  const TraceColumns out{parameters.data(), standard_errors.data(), predicted_force.data(),
                         validity_margin.data(), status.data()};
  face.replay(in, out, samples ? TraceRows{samples->data(), samples->size()} : TraceRows{});
}

using Bounds = std::array<double, 4>;  // of K′ [N/m], then of B′ [N·s/m]

// The estimate as an instance of this class, which derives from EstimateValue: its numbers are
// written in place, where another object and a call of its constructor would take twice the time.
nb::object estimate_as(Face& self, nb::handle kind, double depth, const Bounds& bounds) {
  const auto& [softest, stiffest, least, most] = bounds;
  nb::object estimate = nb::inst_alloc(kind);
  new (nb::inst_ptr<EstimateValue>(estimate))
      EstimateValue(self.core().estimate(depth, {softest, stiffest, least, most}));
  nb::inst_mark_ready(estimate);
  return estimate;
}

constexpr const char* update_doc =
    R"(update(self, penetration, velocity, force, dt=None)
--

Take one sample and return its :class:`Status`.

Never raises on data, never allocates; a refused sample changes nothing.

Parameters
----------
penetration : float
    m, positive inside the material.
velocity : float
    m/s, positive while penetrating.
force : float
    N, compression positive.
dt : float, optional
    Time since the previous sample, s. Default: ``sample_time``.)";

PyObject* update(PyObject* self, PyObject* const* args, Py_ssize_t positional,
                 PyObject* names) noexcept {
  static constexpr std::array<const char*, 4> parameters{"penetration", "velocity", "force", "dt"};
  std::array<PyObject*, 4> placed{};
  if (positional != 3 || names) [[unlikely]] {
    if (!place_arguments(args, positional, names, parameters, placed)) return nullptr;
    args = placed.data();
  }
  double penetration, velocity, force, dt = 0.0;
  if (!number_of(args[0], penetration) || !number_of(args[1], velocity) ||
      !number_of(args[2], force)) {
    return nullptr;
  }
  const bool own_step = placed[3] && placed[3] != Py_None;
  if (own_step && !number_of(placed[3], dt)) return nullptr;
  if (!nb::inst_ready(self)) {
    PyErr_SetString(PyExc_TypeError, "update() of an estimator that was never initialised");
    return nullptr;
  }
  try {
    Core& core = nb::inst_ptr<Face>(self)->core();
    return member_of(core.update(penetration, velocity, force, own_step ? dt : core.sample_time));
  } catch (const std::runtime_error& fault) {
    PyErr_SetString(PyExc_RuntimeError, fault.what());
    return nullptr;
  }
}

PyMethodDef update_methods[] = {
    {"update", reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(&update)),
     METH_FASTCALL | METH_KEYWORDS, update_doc},
    {nullptr, nullptr, 0, nullptr}};
PyType_Slot update_slots[] = {{Py_tp_methods, update_methods}, {0, nullptr}};

// FNV-1a, 64 bits, in hex and with the end of the line.
std::string checksum_of(Memory bytes) {
  std::uint64_t hash = 14695981039346656037u;
  for (const char byte : bytes) {
    hash = (hash ^ static_cast<unsigned char>(byte)) * 1099511628211u;
  }
  char text[18];
  std::snprintf(text, sizeof text, "%016llx\n", static_cast<unsigned long long>(hash));
  return text;
}

std::size_t size_of(std::span<const Memory> parts) noexcept {
  std::size_t size = 0;
  for (const Memory& part : parts) size += part.size();
  return size;
}

std::string heading_of(const std::string& name, std::size_t size) {
  return "palpate-state 3;" PALPATE_VERSION ";" + name + ";" + std::to_string(size) + ";";
}

}  // namespace

void* Zeroed::operator new(std::size_t size) {
  if (void* memory = std::calloc(1, size)) return memory;
  throw std::bad_alloc();
}

void Zeroed::operator delete(void* memory) noexcept { std::free(memory); }

nb::bytes saved(const std::string& name, std::span<const Memory> parts) {
  std::string memory;
  memory.reserve(size_of(parts));
  for (const Memory& part : parts) memory += part;
  const std::string state = heading_of(name, memory.size()) + checksum_of(memory) + memory;
  return nb::bytes(state.data(), state.size());
}

Memory opened(const std::string& name, const nb::bytes& bytes, std::span<const Memory> present) {
  const Memory state(bytes.c_str(), bytes.size());
  const std::size_t size = size_of(present);
  const std::string heading = heading_of(name, size);
  if (!state.starts_with("palpate-state ")) {
    throw nb::value_error("state must be bytes that an estimator saved");
  }
  if (!state.starts_with(heading)) {
    const std::string found(state.substr(0, std::min<std::size_t>(state.find('\n'), 80)));
    std::string words = "state must be of this version and class, " + heading + " not ";
    for (const char c : found) words += c >= ' ' && c <= '~' ? c : '?';
    throw nb::value_error(words.c_str());
  }
  constexpr std::size_t checksum_size = 17;  // and the end of the line
  const Memory memory = state.substr(std::min(heading.size() + checksum_size, state.size()));
  if (memory.size() != size || !state.starts_with(heading + checksum_of(memory))) {
    throw nb::value_error("state is damaged: its checksum does not match");
  }
  return memory;
}

void check_settings(bool same) {
  if (same) return;
  throw nb::value_error("state must be of an estimator with the same settings");
}

void check_ranges(bool sound) {
  if (!sound) throw nb::value_error("state is damaged: a number in it is out of its range");
}

void Face::wait_until_free() {
  int process;
  while ((process = replaying_.load(std::memory_order_acquire)) != 0) {
    if (process != this_process()) {
      throw std::runtime_error(
          "the process was forked while another thread replayed this estimator, so its copy here "
          "is incomplete: call reset()");
    }
    nb::gil_scoped_release release;
    replaying_.wait(process, std::memory_order_acquire);
  }
}

void Face::reset() {
  if (replaying_.load() == this_process()) wait_until_free();
  replaying_.store(0);
  core_->reset();
}

void Face::replay(const Signals& in, const TraceColumns& out, const TraceRows& rows) {
  wait_until_free();
  replaying_.store(this_process(), std::memory_order_relaxed);
  nb::gil_scoped_release release;
  core_->replay(in, out, rows);
  replaying_.store(0, std::memory_order_release);
  replaying_.notify_all();
}

void bind_face(nb::module_& module) {
  nb::class_<Face>(module, "RecursiveEstimator", nb::is_weak_referenceable(),
                   nb::type_slots(update_slots))
      .def(
          "predict",
          [](Face& self, double penetration, double velocity) {
            return self.core().predict(penetration, velocity);
          },
          nb::arg("penetration"), nb::arg("velocity"),
          "Force [N] that the present estimate predicts for the sensor at a penetration [m] and "
          "velocity [m/s]; out of contact only the offset.")
      .def("_estimate", &estimate_as, nb::arg("kind"), nb::arg("depth"), nb::arg("bounds"),
           nb::sig("def _estimate(self, kind: type, depth: float, bounds: "
                   "collections.abc.Sequence[float]) -> Any"))
      .def("reset", &Face::reset, "Forget everything but the settings.")
      .def(
          "leave_contact", [](Face& self) { self.core().leave_contact(); },
          "End the contact, as at the end of a recording: the estimate is held until the next "
          "contact.")
      .def("_replay", &replay_arrays)
      .def("_state", [](Face& self) { return self.core().state(); })
      .def("_restore", [](Face& self, const nb::bytes& state) { self.core().restore(state); });
}

}  // namespace palpate::bindings
