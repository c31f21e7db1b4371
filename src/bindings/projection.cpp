// Variable projection: its sums are straight-line arithmetic over the exponents, which vectorises.
#include "estimator_face.hpp"

namespace palpate::bindings {

void bind_projection(nb::module_& module) {
  using Core = RecursiveEstimator<ProjectionMethod>;
  bind_face<ProjectionMethod>(module, "VariableProjection")
      .def("__init__", [](Core* self, double noise, const Pair& exponents, bool offset,
                          double offset_deviation, const Pair& forgetting, const Detector& changes,
                          const Triple& gate, const Triple& scale, double sample_time) {
        new (self) Core({{noise, exponents[0], exponents[1], offset, offset_deviation},
                         {forgetting[0], forgetting[1]},
                         {},
                         detector_settings(changes),
                         {gate[0], gate[1], gate[2]},
                         {scale[0], scale[1], scale[2]},
                         sample_time});
      });
}

}  // namespace palpate::bindings
