// Variable projection, whose sums are straight lines of arithmetic, which vectorise; and drift
// tracking, which stands on it.
#include "face.hpp"
#include "palpate/estimators.hpp"

namespace palpate::bindings {
namespace {

// Noise, the range of exponents, the exponent or 0 where it is looked for, whether there is an
// offset and its deviation.
using Projection = std::tuple<double, Pair, double, bool, double>;

ProjectionSettings settings_of(const Projection& given, const Loop& loop) {
  const auto& [noise, exponents, exponent, offset, offset_deviation] = given;
  const double force_unit = scale_of(loop)[2];
  return {.noise = noise / force_unit,
          .lowest_exponent = exponents[0],
          .highest_exponent = exponents[1],
          .exponent = exponent,
          .offset = offset,
          .offset_deviation = offset_deviation / force_unit};
}

nb::dict projection_defaults(const ProjectionSettings& settings) {
  nb::dict defaults;
  defaults["offset"] = settings.offset;
  defaults["exponent_range"] = nb::make_tuple(settings.lowest_exponent, settings.highest_exponent);
  return defaults;
}

// Its search for the surface holds forty-one banks of sums, which an estimator without it does not.
using Plain = VariableProjection;
using Searching = VariableProjectionWithSurface;

void make_projection(FaceOf<Plain>* self, const Projection& given,
                     const std::tuple<std::optional<Pair>, double>& surface, const Loop& loop) {
  const auto& [surfaces, surface_deviation] = surface;
  const double unit = scale_of(loop)[0];
  ProjectionSettings projection = settings_of(given, loop);
  projection.surface_deviation = surface_deviation / unit;
  if (surfaces) {
    const SurfaceSettings searched{projection, (*surfaces)[0] / unit, (*surfaces)[1] / unit};
    new (self) FaceOf<Plain>(core_of<Searching>("VariableProjection", 1, searched, loop));
  } else {
    new (self) FaceOf<Plain>(core_of<Plain>("VariableProjection", 0, projection, loop));
  }
}

void make_drift_tracking(FaceOf<DriftTracking>* self, const Projection& given, const Triple& drift,
                         const Loop& loop) {
  const Vector<3> scaled{drift[0], drift[1] * scale_of(loop)[1], drift[2]};
  new (self) FaceOf<DriftTracking>(
      core_of<DriftTracking>("DriftTracking", 0, {settings_of(given, loop), scaled}, loop));
}

}  // namespace

void bind_projection(nb::module_& module) {
  bind_face<Plain>(module, "VariableProjection").def("__init__", &make_projection);

  const SurfaceSettings surface;
  const Scale scale = VariableProjection::Method::default_scale;
  nb::dict projection = projection_defaults(surface.projection);
  projection["scale"] = nb::make_tuple(scale.penetration, scale.velocity, scale.force);
  projection["surface_range"] = nb::make_tuple(surface.lowest_surface, surface.highest_surface);
  module.attr("defaults")["VariableProjection"] = projection;

  bind_face<DriftTracking>(module, "DriftTracking").def("__init__", &make_drift_tracking);

  const DriftTracking::Method::Settings drift;
  nb::dict tracking = projection_defaults(drift.projection);
  tracking["stiffness_drift"] = drift.drift[0];
  tracking["dissipation_drift"] = drift.drift[1];
  tracking["exponent_drift"] = drift.drift[2];
  module.attr("defaults")["DriftTracking"] = tracking;
}

}  // namespace palpate::bindings
