#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include <array>
#include <cstddef>
#include <cstring>
#include <optional>

#include "conversions.hpp"
#include "estimate.hpp"
#include "palpate/palpate.hpp"
#include "update_method.hpp"

namespace palpate::bindings {
namespace {

// Settings as the Python layer hands them over, checked there.
template <std::size_t Order>
struct PlainSettings {
  std::array<double, Order> initial;
  Matrix<Order> initial_covariance;
};

template <class Regression>
typename RegressionMethod<Regression>::Settings method_settings(
    const RegressionMethod<Regression>*, const PlainSettings<Regression::order>& plain) {
  typename Regression::Law law{};
  static_assert(sizeof law == sizeof plain.initial);
  std::memcpy(&law, plain.initial.data(), sizeof law);
  return {law, plain.initial_covariance};
}

DoubleStageMethod::Settings method_settings(const DoubleStageMethod*,
                                            const PlainSettings<3>& plain) {
  const Matrix<3>& p = plain.initial_covariance;
  return {{plain.initial[0], plain.initial[1], plain.initial[2]},
          {{{p[0][0], p[0][1]}, {p[1][0], p[1][1]}}},
          p[2][2]};
}

template <class Method>
void replay_arrays(RecursiveEstimator<Method>& estimator, const InputArray& penetration,
                   const InputArray& velocity, const InputArray& force,
                   const std::optional<InputArray>& time_steps, const OutputArray& parameters,
                   const OutputArray& standard_errors, const OutputArray& predicted_force,
                   const OutputArray& validity_margin, const StatusArray& status) {
  const Signals in{penetration.data(), velocity.data(),
                   force.data(),       time_steps ? time_steps->data() : nullptr,
                   penetration.size(), time_steps && time_steps->size() == 1};
  const TraceColumns out{parameters.data(), standard_errors.data(), predicted_force.data(),
                         validity_margin.data(), status.data()};
  nb::gil_scoped_release release;
  replay(estimator, in, out);
}

template <class Method>
void bind_estimator(nb::module_& module, const char* name) {
  using Core = RecursiveEstimator<Method>;
  constexpr std::size_t order = Method::order;
  using Triple = std::array<double, 3>;
  using Pair = std::array<double, 2>;

  nb::class_<Core>(module, name, nb::is_weak_referenceable(), nb::type_slots(update_slots<Core>))
      .def("__init__",
           [](Core* self, const std::array<double, order>& initial,
              const Matrix<order>& initial_covariance, const Pair& forgetting,
              const Pair& perturbation, const Triple& gate, const Triple& scale,
              double sample_time) {
             new (self) Core({method_settings(static_cast<const Method*>(nullptr),
                                              {initial, initial_covariance}),
                              {forgetting[0], forgetting[1]},
                              {perturbation[0], perturbation[1]},
                              {gate[0], gate[1], gate[2]},
                              {scale[0], scale[1], scale[2]},
                              sample_time});
           })
      .def(
          "predict",
          [](const Core& self, double penetration, double velocity) {
            return self.predict(penetration, velocity);
          },
          nb::arg("penetration"), nb::arg("velocity"),
          "Force [N] of the present law at a penetration [m] and velocity [m/s]; zero out of "
          "contact.")
      .def(
          "estimate",
          [](const Core& self) { return value_of<typename Core::Law>(self.estimate()); },
          "What is known now, as an :class:`Estimate`.")
      .def("reset", &Core::reset, "Forget everything but the settings.")
      .def("_replay", &replay_arrays<Method>)
      .def("_state", &state_of<Core>)
      .def("_restore", &restore<Core>);
}

}  // namespace

void bind_estimators(nb::module_& module) {
  bind_estimator<RegressionMethod<KelvinVoigtRegression>>(module, "KelvinVoigtRLS");
  bind_estimator<RegressionMethod<ExtendedKelvinVoigtRegression>>(module, "ExtendedKelvinVoigtRLS");
  bind_estimator<RegressionMethod<HuntCrossleyLogRegression>>(module, "SingleStageRLS");
  bind_estimator<DoubleStageMethod>(module, "DoubleStageRLS");
}

}  // namespace palpate::bindings
