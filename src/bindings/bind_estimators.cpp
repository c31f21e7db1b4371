// The recursive least squares estimators, and the defaults of the settings that all have.
#include <vector>

#include "bind_face.hpp"

namespace palpate::bindings {
namespace {

// θ₀ and P₀ as Python hands them over.
template <class Law>
struct Start {
  Vector<Law::size> parameters;
  Matrix<Law::size> covariance;
};

template <class Law, std::size_t... Index>
Law law_of(const Vector<Law::size>& parameters, std::index_sequence<Index...>) {
  return {parameters[Index]...};
}

template <class Method>
typename Method::Settings method_settings(const Start<typename Method::Law>& start) {
  using Law = typename Method::Law;
  const Law initial = law_of<Law>(start.parameters, std::make_index_sequence<Law::size>{});
  const auto& p = start.covariance;
  if constexpr (std::is_same_v<Method, DoubleStageMethod>) {
    return {initial, {{{p[0][0], p[0][1]}, {p[1][0], p[1][1]}}}, p[2][2]};
  } else {
    return {initial, p};
  }
}

// One number where all are the same, as a person would write it.
template <class Method>
nb::object initial_variances() {
  const typename Method::Settings settings;
  nb::list variances;
  if constexpr (std::is_same_v<Method, DoubleStageMethod>) {
    variances.append(settings.stage_one_covariance[0][0]);
    variances.append(settings.stage_one_covariance[1][1]);
    variances.append(settings.stage_two_covariance);
  } else {
    for (std::size_t i = 0; i < Method::Law::size; ++i) {
      variances.append(settings.initial_covariance[i][i]);
    }
  }
  for (const nb::handle variance : variances) {
    if (!variance.equal(variances[0])) return variances;
  }
  return variances[0];
}

template <class Estimator>
void bind_estimator(nb::module_& module, const char* name) {
  using Method = typename Estimator::Method;
  using Law = typename Method::Law;
  using Face = AllKinds<Estimator>;
  bind_face<Face>(module, name)
      .def(
          "__init__",
          [](Face* self, const Vector<Law::size>& initial,
             const Matrix<Law::size>& initial_covariance, const Pair& forgetting,
             const Pair& perturbation, const std::optional<Detector>& changes,
             const std::optional<double>& outliers, const Triple& gate, const Triple& scale,
             double sample_time) {
            new (self) Face();
            construct<Estimator>(
                *self, method_settings<Method>({initial, initial_covariance}),
                {forgetting, perturbation, changes, outliers, gate, scale, sample_time});
          },
          nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg(),
          nb::arg(), nb::arg());
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
