// Variable projection, whose sums are straight lines of arithmetic, which vectorise; and drift
// tracking, which stands on it.
#include "face.hpp"
#include "palpate/estimators.hpp"

namespace palpate::bindings {
namespace {

// `exponent` is 0 where it is looked for, within `exponents`.
ProjectionSettings projection_settings(double noise, const Pair& exponents, double exponent,
                                       bool offset, double offset_deviation, double force_unit) {
  return {.noise = noise / force_unit,
          .lowest_exponent = exponents[0],
          .highest_exponent = exponents[1],
          .exponent = exponent,
          .offset = offset,
          .offset_deviation = offset_deviation / force_unit};
}

nb::dict projection_defaults(const ProjectionSettings& settings, const Scale& scale) {
  nb::dict defaults;
  defaults["offset"] = settings.offset;
  defaults["exponent_range"] = nb::make_tuple(settings.lowest_exponent, settings.highest_exponent);
  defaults["scale"] = nb::make_tuple(scale.penetration, scale.velocity, scale.force);
  return defaults;
}

constexpr Pair not_perturbed{no_perturbation.gain, no_perturbation.sensitivity};

// Its search for the surface holds forty-one banks of sums, which an estimator without it does not.
using Plain = VariableProjection;
using Searching = VariableProjectionWithSurface;

void make_projection(FaceOf<Plain>* self, double noise, const Pair& exponents, double exponent,
                     bool offset, double offset_deviation, const std::optional<Pair>& surfaces,
                     double surface_deviation, const Pair& forgetting,
                     const std::optional<Detector>& changes, const std::optional<double>& outliers,
                     const Triple& gate, const Triple& scale, double sample_time) {
  auto projection =
      projection_settings(noise, exponents, exponent, offset, offset_deviation, scale[2]);
  projection.surface_deviation = surface_deviation / scale[0];
  const Loop loop{forgetting, not_perturbed, changes, outliers, gate, scale, sample_time};
  if (surfaces) {
    const SurfaceSettings surface{projection, (*surfaces)[0] / scale[0], (*surfaces)[1] / scale[0]};
    new (self) FaceOf<Plain>(core_of<Searching>("VariableProjection", 1, surface, loop));
  } else {
    new (self) FaceOf<Plain>(core_of<Plain>("VariableProjection", 0, projection, loop));
  }
}

constexpr Pair none_forgotten{no_forgetting.initial_factor, no_forgetting.rate};

void make_drift_tracking(FaceOf<DriftTracking>* self, double noise, const Pair& exponents,
                         double exponent, bool offset, double offset_deviation, const Triple& drift,
                         const std::optional<Detector>& changes,
                         const std::optional<double>& outliers, const Triple& gate,
                         const Triple& scale, double sample_time) {
  const auto projection =
      projection_settings(noise, exponents, exponent, offset, offset_deviation, scale[2]);
  new (self) FaceOf<DriftTracking>(core_of<DriftTracking>(
      "DriftTracking", 0, {projection, {drift[0], drift[1] * scale[1], drift[2]}},
      {none_forgotten, not_perturbed, changes, outliers, gate, scale, sample_time}));
}

void bind_variable_projection(nb::module_& module) {
  bind_face<Plain>(module, "VariableProjection")
      .def("__init__", &make_projection, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
           nb::arg().none(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg(),
           nb::arg(), nb::arg());

  const SurfaceSettings surface;
  nb::dict projection =
      projection_defaults(surface.projection, VariableProjection::Method::default_scale);
  projection["surface_range"] = nb::make_tuple(surface.lowest_surface, surface.highest_surface);
  module.attr("defaults")["VariableProjection"] = projection;
}

void bind_drift_tracking(nb::module_& module) {
  bind_face<DriftTracking>(module, "DriftTracking")
      .def("__init__", &make_drift_tracking, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
           nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg(), nb::arg(), nb::arg());

  const DriftTracking::Method::Settings drift;
  nb::dict tracking = projection_defaults(drift.projection, DriftTracking::Method::default_scale);
  tracking["stiffness_drift"] = drift.drift[0];
  tracking["dissipation_drift"] = drift.drift[1];
  tracking["exponent_drift"] = drift.drift[2];
  module.attr("defaults")["DriftTracking"] = tracking;
}

}  // namespace

void bind_projection(nb::module_& module) {
  bind_variable_projection(module);
  bind_drift_tracking(module);
}

}  // namespace palpate::bindings
