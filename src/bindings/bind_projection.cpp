// Variable projection: sums in straight lines of arithmetic, which vectorise.
#include "projection_settings.hpp"

namespace palpate::bindings {
namespace {

constexpr const char* name = "VariableProjection";
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
    new (self) FaceOf<Plain>(core_of<Searching>(name, 1, surface, loop));
  } else {
    new (self) FaceOf<Plain>(core_of<Plain>(name, 0, projection, loop));
  }
}

}  // namespace

void bind_projection(nb::module_& module) {
  bind_face<Plain>(module, name)
      .def("__init__", &make_projection, nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(),
           nb::arg().none(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg(),
           nb::arg(), nb::arg());

  const SurfaceSettings surface;
  nb::dict projection =
      projection_defaults(surface.projection, VariableProjection::Method::default_scale);
  projection["surface_range"] = nb::make_tuple(surface.lowest_surface, surface.highest_surface);
  module.attr("defaults")["VariableProjection"] = projection;
}

}  // namespace palpate::bindings
