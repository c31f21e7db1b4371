// Drift tracking, which stands on variable projection; apart, so that the two compile side by side.
#include "projection_settings.hpp"

namespace palpate::bindings {
namespace {

constexpr Pair none_forgotten{no_forgetting.initial_factor, no_forgetting.rate};

constexpr const char* name = "DriftTracking";

void make_drift_tracking(FaceOf<DriftTracking>* self, double noise, const Pair& exponents,
                         double exponent, bool offset, double offset_deviation, const Triple& drift,
                         const std::optional<Detector>& changes,
                         const std::optional<double>& outliers, const Triple& gate,
                         const Triple& scale, double sample_time) {
  const auto projection =
      projection_settings(noise, exponents, exponent, offset, offset_deviation, scale[2]);
  new (self) FaceOf<DriftTracking>(core_of<DriftTracking>(
      name, 0, {projection, {drift[0], drift[1] * scale[1], drift[2]}},
      {none_forgotten, not_perturbed, changes, outliers, gate, scale, sample_time}));
}

}  // namespace

void bind_drift_tracking(nb::module_& module) {
  bind_face<DriftTracking>(module, name)
      .def("__init__", &make_drift_tracking, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
           nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg(), nb::arg(), nb::arg());

  const DriftTracking::Method::Settings drift;
  nb::dict tracking = projection_defaults(drift.projection, DriftTracking::Method::default_scale);
  tracking["stiffness_drift"] = drift.drift[0];
  tracking["dissipation_drift"] = drift.drift[1];
  tracking["exponent_drift"] = drift.drift[2];
  module.attr("defaults")["DriftTracking"] = tracking;
}

}  // namespace palpate::bindings
