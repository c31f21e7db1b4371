// The face that every estimator shows to Python, and how its settings come from there.
#pragma once

#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "conversions.hpp"
#include "estimate.hpp"
#include "handle.hpp"
#include "palpate/palpate.hpp"
#include "state.hpp"
#include "update_method.hpp"

namespace palpate::bindings {

using Pair = std::array<double, 2>;
using Triple = std::array<double, 3>;
// drift, threshold, noise, adaptation, warm-up, transition
using Detector = std::array<double, 6>;

// What the settings of every estimator have in common; an absent detector or rejection is none.
struct Loop {
  Pair forgetting;
  Pair perturbation;
  std::optional<Detector> changes;
  std::optional<double> outliers;  // the threshold of their rejection
  Triple gate;
  Triple scale;
  double sample_time;
};

// An estimator of all kinds, the plain one first.
template <class Estimator>
using AllKinds = Handle<Estimator, WithChangeDetector<Estimator>, WithOutlierRejection<Estimator>,
                        WithOutlierRejection<WithChangeDetector<Estimator>>>;

// Builds `Estimator`, with a change detector and a rejection of outliers where they are asked for,
// from what Python has checked.
template <class Estimator, class Handle>
void construct(Handle& handle, const typename Estimator::Method::Settings& method,
               const Loop& loop) {
  const auto build = [&]<class Kind>(std::type_identity<Kind>) {
    typename Kind::Settings settings{.method = method,
                                     .forgetting = {loop.forgetting[0], loop.forgetting[1]},
                                     .perturbation = {loop.perturbation[0], loop.perturbation[1]},
                                     .changes = {},
                                     .outliers = {},
                                     .gate = {loop.gate[0], loop.gate[1], loop.gate[2]},
                                     .scale = {loop.scale[0], loop.scale[1], loop.scale[2]},
                                     .sample_time = loop.sample_time};
    if constexpr (Kind::Outliers::active) settings.outliers = {*loop.outliers};
    if constexpr (Kind::Changes::active) {
      const Detector& d = *loop.changes;
      settings.changes = {d[0],
                          d[1],
                          d[2],
                          d[3],
                          static_cast<std::uint32_t>(d[4]),
                          static_cast<std::uint32_t>(d[5])};
    }
    if (const char* fault = validate(settings)) throw nb::value_error(fault);
    handle.template emplace<Kind>(settings);
  };
  const auto build_watched = [&]<class Kind>(std::type_identity<Kind> kind) {
    if (loop.changes) {
      build(std::type_identity<WithChangeDetector<Kind>>{});
    } else {
      build(kind);
    }
  };
  if (loop.outliers) {
    build_watched(std::type_identity<WithOutlierRejection<Estimator>>{});
  } else {
    build_watched(std::type_identity<Estimator>{});
  }
}

template <class Handle>
void replay_arrays(Handle& handle, const InputArray& penetration, const InputArray& velocity,
                   const InputArray& force, const std::optional<InputArray>& time_steps,
                   const OutputArray& parameters, const OutputArray& standard_errors,
                   const OutputArray& predicted_force, const OutputArray& validity_margin,
                   const StatusArray& status, const std::optional<RowArray>& samples) {
  const Signals in{penetration.data(), velocity.data(),
                   force.data(),       time_steps ? time_steps->data() : nullptr,
                   penetration.size(), time_steps && time_steps->size() == 1};
  const TraceColumns out{parameters.data(), standard_errors.data(), predicted_force.data(),
                         validity_margin.data(), status.data()};
  const TraceRows rows = samples ? TraceRows{samples->data(), samples->size()} : TraceRows{};
  handle.replay_with([&](auto& estimator) { replay(estimator, in, out, rows); });
}

// Binds a method of no arguments that answers from the estimator, or changes it.
template <class Handle, class Act>
auto alone(Act act) {
  return [act](Handle& self) {
    self.wait_until_free();
    return self.with(act);
  };
}

template <class Handle>
nb::class_<Handle> bind_face(nb::module_& module, const char* name) {
  nb::class_<Handle> face(module, name, nb::is_weak_referenceable(),
                          nb::type_slots(update_slots<Handle>));
  const auto full_name = [name](const Handle& self) {
    return std::string(name) + "." + std::to_string(self.kind());
  };
  face.def(
          "predict",
          [](Handle& self, double penetration, double velocity) {
            self.wait_until_free();
            return self.with([=](auto& core) { return core.predict(penetration, velocity); });
          },
          nb::arg("penetration"), nb::arg("velocity"),
          "Force [N] that the sensor would show at a penetration [m] and velocity [m/s] by the "
          "present estimate; no law acts out of contact.")
      .def("_estimate", alone<Handle>([](auto& core) { return value_of(core.estimate()); }))
      .def(
          "reset", [](Handle& self) { self.reset(); }, "Forget everything but the settings.")
      .def("leave_contact", alone<Handle>([](auto& core) { core.leave_contact(); }),
           "End the contact, as where a recording breaks off: the estimate is held until contact "
           "is made again.")
      .def("_replay", &replay_arrays<Handle>)
      .def("_state",
           [full_name](Handle& self) {
             self.wait_until_free();
             return self.with([&](auto& core) { return saved(core, full_name(self)); });
           })
      .def("_restore", [full_name](Handle& self, const nb::bytes& state) {
        self.wait_until_free();
        self.with([&](auto& core) { restore(core, full_name(self), state); });
      });
  return face;
}

}  // namespace palpate::bindings
