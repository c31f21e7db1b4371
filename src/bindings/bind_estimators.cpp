// The recursive least-squares estimators, and the default settings that all of them share.
#include <type_traits>

#include "face.hpp"
#include "palpate/estimators.hpp"

namespace palpate::bindings {
namespace {

// A single number if all are equal, as a user would write it.
template <class Method>
nb::object initial_variances() {
  const auto covariance = typename Method::Settings{}.initial_covariance;
  nb::list variances;
  for (std::size_t i = 0; i < covariance.size(); ++i) variances.append(covariance[i][i]);
  for (const nb::handle variance : variances) {
    if (!variance.equal(variances[0])) return variances;
  }
  return variances[0];
}

template <class Usual>
using InitialCovariance = Matrix<Usual::Law::size>;

// Settings from θ₀ and P₀ as Python passes them. A known exponent is part of the start.
template <class Usual>
std::unique_ptr<Core> made(const char* name, const typename Usual::Law& initial,
                           const InitialCovariance<Usual>& covariance, bool exponent_known,
                           const Loop& loop) {
  typename Usual::Method::Settings settings{initial, covariance};
  if constexpr (std::is_same_v<Usual, SingleStageRLS>) {
    const auto& p = covariance;  // for [ln K, B/K] its first two rows
    const Matrix<2> first{{{p[0][0], p[0][1]}, {p[1][0], p[1][1]}}};
    using Known = SingleStageKnownExponentRLS;
    if (exponent_known) return core_of<Known>(name, 1, {initial, first}, loop);
  } else if constexpr (std::is_same_v<Usual, DoubleStageRLS>) {
    settings.exponent_known = exponent_known;
  }
  return core_of<Usual>(name, 0, settings, loop);
}

template <class Usual>
void bind_estimator(nb::module_& module, const char* name) {
  using Law = typename Usual::Law;
  bind_face<Usual>(module, name)
      .def("__init__", [name](FaceOf<Usual>* self, const Vector<Law::size>& initial,
                              const InitialCovariance<Usual>& covariance, bool exponent_known,
                              const Loop& loop) {
        new (self) FaceOf<Usual>(
            made<Usual>(name, law_of<Law>(initial.data()), covariance, exponent_known, loop));
      });
  using Method = typename Usual::Method;
  nb::dict defaults;
  defaults["initial"] = nb::cast(typename Method::Settings{}.initial.parameters());
  defaults["initial_covariance"] = initial_variances<Method>();
  module.attr("defaults")[name] = defaults;
}

void bind_shared_defaults(nb::module_& module) {
  nb::dict detector, rejection, perturbation, fading, loop;
  const ChangeDetector::Settings changes;
  detector["drift"] = changes.drift;
  detector["threshold"] = changes.threshold;
  detector["adaptation"] = changes.adaptation;
  detector["warm_up"] = changes.warm_up;
  detector["transition"] = changes.transition;
  rejection["threshold"] = OutlierRejection::Settings{}.threshold;
  perturbation["gain"] = SelfPerturbation{}.gain;
  perturbation["sensitivity"] = SelfPerturbation{}.sensitivity;
  fading["initial_factor"] = fading_forgetting.initial_factor;
  fading["rate"] = fading_forgetting.rate;
  loop["sample_time"] = SingleStageRLS::Settings{}.sample_time;
  nb::object defaults = module.attr("defaults");
  defaults["ChangeDetector"] = detector;
  defaults["OutlierRejection"] = rejection;
  defaults["SelfPerturbation"] = perturbation;
  defaults["FadingForgetting"] = fading;
  defaults["loop"] = loop;
}

}  // namespace

void bind_estimators(nb::module_& module) {
  bind_shared_defaults(module);
  bind_estimator<KelvinVoigtRLS>(module, "KelvinVoigtRLS");
  bind_estimator<ExtendedKelvinVoigtRLS>(module, "ExtendedKelvinVoigtRLS");
  bind_estimator<SingleStageRLS>(module, "SingleStageRLS");
  bind_estimator<DoubleStageRLS>(module, "DoubleStageRLS");
}

}  // namespace palpate::bindings
