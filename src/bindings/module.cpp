#include "conversions.hpp"

NB_MODULE(_core, module) {
  module.doc() = "The compiled recursion of palpate.";
  module.attr("__version__") = PALPATE_VERSION;
  // The settings' defaults, by class and name, so that they stand once: in the headers.
  module.attr("defaults") = palpate::bindings::nb::dict();
  palpate::bindings::bind_force_laws(module);
  palpate::bindings::bind_estimate(module);
  palpate::bindings::bind_error_bars(module);
  palpate::bindings::bind_least_squares(module);
  palpate::bindings::bind_curves(module);
  palpate::bindings::bind_face(module);
  palpate::bindings::bind_estimators(module);
  palpate::bindings::bind_projection(module);
  palpate::bindings::bind_drift_tracking(module);
  palpate::bindings::bind_viscoelastic(module);
  palpate::bindings::bind_online_preparation(module);
  palpate::bindings::bind_rows(module);
}
