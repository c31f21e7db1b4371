// The face that every estimator shows to Python; constructors differ.
#pragma once

#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include <optional>

#include "conversions.hpp"
#include "estimate.hpp"
#include "palpate/palpate.hpp"
#include "update_method.hpp"

namespace palpate::bindings {

using Pair = std::array<double, 2>;
// drift, threshold, noise, adaptation, settling, transition
using Detector = std::array<double, 6>;
using Triple = std::array<double, 3>;

inline ChangeDetector::Settings detector_settings(const Detector& d) {
  return {
      d[0], d[1], d[2], d[3], static_cast<std::uint32_t>(d[4]), static_cast<std::uint32_t>(d[5])};
}

template <class Core>
void replay_arrays(Core& estimator, const InputArray& penetration, const InputArray& velocity,
                   const InputArray& force, const std::optional<InputArray>& time_steps,
                   const OutputArray& parameters, const OutputArray& standard_errors,
                   const OutputArray& predicted_force, const OutputArray& validity_margin,
                   const StatusArray& status) {
  const Signals in{penetration.data(), velocity.data(),
                   force.data(),       time_steps ? time_steps->data() : nullptr,
                   penetration.size(), time_steps && time_steps->size() == 1};
  const TraceColumns out{parameters.data(), standard_errors.data(), predicted_force.data(),
                         validity_margin.data(), status.data()};
  nb::gil_scoped_release release;
  replay(estimator, in, out);
}

template <class Core>
nb::class_<Core> bind_face(nb::module_& module, const char* name) {
  nb::class_<Core> face(module, name, nb::is_weak_referenceable(),
                        nb::type_slots(update_slots<Core>));
  face.def(
          "predict",
          [](const Core& self, double penetration, double velocity) {
            return self.predict(penetration, velocity);
          },
          nb::arg("penetration"), nb::arg("velocity"),
          "Force [N] that the sensor would show at a penetration [m] and velocity [m/s] by the "
          "present estimate; no law acts out of contact.")
      .def(
          "estimate",
          [](const Core& self) { return value_of<typename Core::Law>(self.estimate()); },
          "What is known now, as an :class:`Estimate`.")
      .def("reset", &Core::reset, "Forget everything but the settings.")
      .def("_replay", &replay_arrays<Core>)
      .def("_state", &state_of<Core>)
      .def("_restore", &restore<Core>);
  return face;
}

}  // namespace palpate::bindings
