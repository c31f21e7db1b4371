// Variable projection and what stands on it: sums in straight lines of arithmetic, which vectorise.
#include "bind_face.hpp"

namespace palpate::bindings {
namespace {

ProjectionSettings projection_settings(double noise, const Pair& exponents, bool offset,
                                       double offset_deviation, double force_unit) {
  return {.noise = noise / force_unit,
          .lowest_exponent = exponents[0],
          .highest_exponent = exponents[1],
          .offset = offset,
          .offset_deviation = offset_deviation / force_unit};
}

constexpr Pair none_forgotten{no_forgetting.initial_factor, no_forgetting.rate};
constexpr Pair not_perturbed{no_perturbation.gain, no_perturbation.sensitivity};

// Its search for the surface holds forty-one banks of sums, which an estimator without it does not.
using Plain = VariableProjection;
using Searching = VariableProjectionWithSurface;
using ProjectionFace = Handle<Plain, WithChangeDetector<Plain>, WithOutlierRejection<Plain>,
                              WithOutlierRejection<WithChangeDetector<Plain>>, Searching,
                              WithChangeDetector<Searching>, WithOutlierRejection<Searching>,
                              WithOutlierRejection<WithChangeDetector<Searching>>>;

void make_projection(ProjectionFace* self, double noise, const Pair& exponents, bool offset,
                     double offset_deviation, const std::optional<Pair>& surfaces,
                     double surface_deviation, const Pair& forgetting,
                     const std::optional<Detector>& changes, const std::optional<double>& outliers,
                     const Triple& gate, const Triple& scale, double sample_time) {
  new (self) ProjectionFace();
  auto projection = projection_settings(noise, exponents, offset, offset_deviation, scale[2]);
  projection.surface_deviation = surface_deviation / scale[0];
  const Loop loop{forgetting, not_perturbed, changes, outliers, gate, scale, sample_time};
  if (surfaces) {
    const SurfaceSettings surface{projection, (*surfaces)[0] / scale[0], (*surfaces)[1] / scale[0]};
    construct<Searching>(*self, surface, loop);
  } else {
    construct<Plain>(*self, projection, loop);
  }
}

using DriftFace = AllKinds<DriftTracking>;

void make_drift_tracking(DriftFace* self, double noise, const Pair& exponents, bool offset,
                         double offset_deviation, const Triple& drift,
                         const std::optional<Detector>& changes,
                         const std::optional<double>& outliers, const Triple& gate,
                         const Triple& scale, double sample_time) {
  new (self) DriftFace();
  const auto projection = projection_settings(noise, exponents, offset, offset_deviation, scale[2]);
  construct<DriftTracking>(
      *self, {projection, {drift[0], drift[1] * scale[1], drift[2]}},
      {none_forgotten, not_perturbed, changes, outliers, gate, scale, sample_time});
}

nb::dict projection_defaults(const ProjectionSettings& settings, const Scale& scale) {
  nb::dict defaults;
  defaults["offset"] = settings.offset;
  defaults["exponent_range"] = nb::make_tuple(settings.lowest_exponent, settings.highest_exponent);
  defaults["scale"] = nb::make_tuple(scale.penetration, scale.velocity, scale.force);
  return defaults;
}

}  // namespace

void bind_projection(nb::module_& module) {
  bind_face<ProjectionFace>(module, "VariableProjection")
      .def("__init__", &make_projection, nb::arg(), nb::arg(), nb::arg(), nb::arg(),
           nb::arg().none(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg(),
           nb::arg(), nb::arg());
  bind_face<DriftFace>(module, "DriftTracking")
      .def("__init__", &make_drift_tracking, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
           nb::arg().none(), nb::arg().none(), nb::arg(), nb::arg(), nb::arg());

  nb::object defaults = module.attr("defaults");
  const SurfaceSettings surface;
  nb::dict projection =
      projection_defaults(surface.projection, VariableProjection::Method::default_scale);
  projection["surface_range"] = nb::make_tuple(surface.lowest_surface, surface.highest_surface);
  defaults["VariableProjection"] = projection;
  const DriftTracking::Method::Settings drift;
  nb::dict tracking = projection_defaults(drift.projection, DriftTracking::Method::default_scale);
  tracking["stiffness_drift"] = drift.drift[0];
  tracking["dissipation_drift"] = drift.drift[1];
  tracking["exponent_drift"] = drift.drift[2];
  defaults["DriftTracking"] = tracking;
}

}  // namespace palpate::bindings
