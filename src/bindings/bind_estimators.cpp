// The recursive least squares estimators, and the defaults of the settings that all have.
#include <vector>

#include "face.hpp"
#include "palpate/estimators.hpp"

namespace palpate::bindings {
namespace {

// θ₀ and P₀ as Python hands them over.
template <class Law>
struct Start {
  Vector<Law::size> parameters;
  Matrix<Law::size> covariance;
};

constexpr std::make_index_sequence<3> three;

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
void add_defaults(nb::module_& module, const char* name) {
  using Method = typename Estimator::Method;
  nb::dict defaults;
  defaults["initial"] = nb::cast(typename Method::Settings{}.initial.parameters());
  defaults["initial_covariance"] = initial_variances<Method>();
  module.attr("defaults")[name] = defaults;
}

// An estimator whose law has an exponent, which may be known; the start has it then.
template <class Usual, class Make>
void bind_with_exponent(nb::module_& module, const char* name, Make make) {
  bind_face<Usual>(module, name)
      .def(
          "__init__",
          [make](FaceOf<Usual>* self, const Vector<3>& initial, const Matrix<3>& initial_covariance,
                 bool exponent_known, const Pair& forgetting, const Pair& perturbation,
                 const std::optional<Detector>& changes, const std::optional<double>& outliers,
                 const Triple& gate, const Triple& scale, double sample_time) {
            new (self) FaceOf<Usual>(
                make({initial, initial_covariance}, exponent_known,
                     {forgetting, perturbation, changes, outliers, gate, scale, sample_time}));
          },
          nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none(),
          nb::arg(), nb::arg(), nb::arg());
  add_defaults<Usual>(module, name);
}

std::unique_ptr<Core> single_stage(const Start<HuntCrossley>& start, bool exponent_known,
                                   const Loop& loop) {
  constexpr const char* name = "SingleStageRLS";
  if (!exponent_known) {
    return core_of<SingleStageRLS>(name, 0, method_settings<SingleStageRLS::Method>(start), loop);
  }
  const auto& p = start.covariance;  // of [ln K, B/K] it is the first two
  const HuntCrossley initial = law_of<HuntCrossley>(start.parameters, three);
  return core_of<SingleStageKnownExponentRLS>(
      name, 1, {initial, {{{p[0][0], p[0][1]}, {p[1][0], p[1][1]}}}}, loop);
}

std::unique_ptr<Core> double_stage(const Start<HuntCrossley>& start, bool exponent_known,
                                   const Loop& loop) {
  DoubleStageMethod::Settings settings = method_settings<DoubleStageMethod>(start);
  settings.exponent_known = exponent_known;
  return core_of<DoubleStageRLS>("DoubleStageRLS", 0, settings, loop);
}

template <class Usual>
void bind_estimator(nb::module_& module, const char* name) {
  using Law = typename Usual::Law;
  bind_face<Usual>(module, name)
      .def(
          "__init__",
          [name](FaceOf<Usual>* self, const Vector<Law::size>& initial,
                 const Matrix<Law::size>& initial_covariance, const Pair& forgetting,
                 const Pair& perturbation, const std::optional<Detector>& changes,
                 const std::optional<double>& outliers, const Triple& gate, const Triple& scale,
                 double sample_time) {
            new (self) FaceOf<Usual>(core_of<Usual>(
                name, 0, method_settings<typename Usual::Method>({initial, initial_covariance}),
                {forgetting, perturbation, changes, outliers, gate, scale, sample_time}));
          },
          nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg().none(), nb::arg(),
          nb::arg(), nb::arg());
  add_defaults<Usual>(module, name);
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
  bind_with_exponent<SingleStageRLS>(module, "SingleStageRLS", &single_stage);
  bind_with_exponent<DoubleStageRLS>(module, "DoubleStageRLS", &double_stage);
}

}  // namespace palpate::bindings
