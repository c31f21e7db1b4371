// The recursive least squares estimators.
#include <cstring>

#include "estimator_face.hpp"

namespace palpate::bindings {
namespace {

// Settings as the Python layer hands them over, checked there.
template <std::size_t Order>
struct PlainSettings {
  std::array<double, Order> initial;
  Matrix<Order> initial_covariance;
};

template <class Regression>
typename RegressionMethod<Regression>::Settings method_settings(
    const RegressionMethod<Regression>*, const PlainSettings<Regression::order>& plain) {
  typename Regression::Law law{};
  static_assert(sizeof law == sizeof plain.initial);
  std::memcpy(&law, plain.initial.data(), sizeof law);
  return {law, plain.initial_covariance};
}

DoubleStageMethod::Settings method_settings(const DoubleStageMethod*,
                                            const PlainSettings<3>& plain) {
  const Matrix<3>& p = plain.initial_covariance;
  return {{plain.initial[0], plain.initial[1], plain.initial[2]},
          {{{p[0][0], p[0][1]}, {p[1][0], p[1][1]}}},
          p[2][2]};
}

template <class Method>
void bind_estimator(nb::module_& module, const char* name) {
  using Core = RecursiveEstimator<Method>;
  constexpr std::size_t order = Method::order;
  bind_face<Core>(module, name)
      .def("__init__", [](Core* self, const std::array<double, order>& initial,
                          const Matrix<order>& initial_covariance, const Pair& forgetting,
                          const Pair& perturbation, const Detector& changes, const Triple& gate,
                          const Triple& scale, double sample_time) {
        new (self) Core(
            {method_settings(static_cast<const Method*>(nullptr), {initial, initial_covariance}),
             {forgetting[0], forgetting[1]},
             {perturbation[0], perturbation[1]},
             detector_settings(changes),
             {gate[0], gate[1], gate[2]},
             {scale[0], scale[1], scale[2]},
             sample_time});
      });
}

}  // namespace

void bind_estimators(nb::module_& module) {
  bind_estimator<RegressionMethod<KelvinVoigtRegression>>(module, "KelvinVoigtRLS");
  bind_estimator<RegressionMethod<ExtendedKelvinVoigtRegression>>(module, "ExtendedKelvinVoigtRLS");
  bind_estimator<RegressionMethod<HuntCrossleyLogRegression>>(module, "SingleStageRLS");
  bind_estimator<DoubleStageMethod>(module, "DoubleStageRLS");
}

}  // namespace palpate::bindings
