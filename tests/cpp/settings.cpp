// Settings: what is wrong with them is said in words, and the defaults are sound.
#include <limits>
#include <string_view>

#include "check.hpp"
#include "estimators.hpp"

using namespace palpate;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

// The words for settings that `spoil` has changed, empty where there are none.
template <class Estimator, class Spoil>
std::string_view fault(Spoil&& spoil) {
  typename Estimator::Settings settings;
  spoil(settings);
  const char* words = validate(settings);
  return words ? words : "";
}

}  // namespace

TEST("the defaults of every estimator are sound") {
  for_every_estimator(
      []<class Estimator>() { CHECK(validate(typename Estimator::Settings{}) == nullptr); });
}

TEST("every estimator names the setting that is out of its range, and the range") {
  for_every_estimator([]<class Estimator>() {
    for (const double bad : {0.0, -1.0, 2e6, infinity, not_a_number}) {
      CHECK(fault<Estimator>([=](auto& s) { s.sample_time = bad; }) ==
            "sample_time must be in (0, 1e6] s");
      CHECK(fault<Estimator>([=](auto& s) { s.forgetting.initial_factor = bad; }) ==
            "forgetting.initial_factor must be in (0, 1]");
    }
    for (const double bad : {0.0, -1.0, 1e31, infinity, not_a_number}) {
      CHECK(fault<Estimator>([=](auto& s) { s.scale.force = bad; }) ==
            "scale.force must be in [1e-30, 1e30] N");
    }
    CHECK(fault<Estimator>([](auto& s) { s.gate.break_force = 1.0; }) ==
          "gate.break_force must be in [0, make_force]");
    CHECK(fault<Estimator>([](auto& s) { s.gate.minimum_penetration = not_a_number; }) ==
          "gate.minimum_penetration must be in [0, 1e100] m");
    CHECK(fault<Estimator>([](auto& s) { s.perturbation.gain = -1.0; }) ==
          "perturbation.gain must be in [0, 1e20]");
  });
}

TEST("a detector's settings are checked where there is one") {
  using Estimator = WithChangeDetector<SingleStageRLS>;
  CHECK(fault<Estimator>([](auto& s) { s.changes.drift = 0.5; }) ==
        "changes.drift must be in [1, 24]");
  CHECK(fault<Estimator>([](auto& s) { s.changes.warm_up = 9; }) ==
        "changes.warm_up must be in [10, 1000000] samples");
  CHECK(fault<Estimator>([](auto& s) { s.changes.transition = 101; }) ==
        "changes.transition must be in [0, 100] samples");
  CHECK(fault<Estimator>([](auto& s) { s.changes.adaptation = not_a_number; }) ==
        "changes.adaptation must be in [0, 1]");
}

TEST("a rejection's threshold is checked where there is one") {
  using Estimator = WithOutlierRejection<SingleStageRLS>;
  for (const double bad : {2.0, 2e6, infinity, not_a_number}) {
    CHECK(fault<Estimator>([=](auto& s) { s.outliers.threshold = bad; }) ==
          "outliers.threshold must be in [3, 1e6] deviations");
  }
}

TEST("a method's own settings are checked") {
  CHECK(fault<SingleStageRLS>([](auto& s) { s.method.initial.K = 0.0; }) ==
        "method.initial must have K > 0, as its logarithm is taken");
  CHECK(fault<KelvinVoigtRLS>([](auto& s) { s.method.initial.B = infinity; }) ==
        "method.initial must be finite parameters, within ±1e100");
  CHECK(fault<KelvinVoigtRLS>([](auto& s) { s.method.initial_covariance[0][0] = 1e21; }) ==
        "method.initial_covariance must have variances in [1e-20, 1e20]");
  CHECK(fault<KelvinVoigtRLS>([](auto& s) { s.method.initial_covariance[0][1] = 1.0; }) ==
        "method.initial_covariance must be symmetric");
  CHECK(fault<KelvinVoigtRLS>([](auto& s) {
          s.method.initial_covariance = {{{1.0, 2.0}, {2.0, 1.0}}};
        }) == "method.initial_covariance must be positive definite");
  CHECK(fault<DoubleStageRLS>([](auto& s) { s.method.initial_covariance[2][2] = 0.0; }) ==
        "method.initial_covariance must have variances in [1e-20, 1e20]");
  CHECK(fault<VariableProjection>([](auto& s) { s.method.highest_exponent = 0.4; }) ==
        "method.highest_exponent must be 0.2 to 5 above lowest_exponent");
  CHECK(fault<VariableProjectionWithSurface>([](auto& s) { s.method.lowest_surface = 0.3; }) ==
        "method.lowest_surface must be below highest_surface, within ±5 units of penetration");
  CHECK(fault<DriftTracking>([](auto& s) { s.method.drift[1] = -1.0; }) ==
        "method.drift must be in [0, 1e60] 1/√s");
}

TEST("a setting that a method would ignore is refused") {
  CHECK(fault<DriftTracking>([](auto& s) { s.forgetting = fading_forgetting; }) ==
        "forgetting must be none: this method does not forget by a factor");
  CHECK(fault<VariableProjection>([](auto& s) { s.perturbation = SelfPerturbation{}; }) ==
        "perturbation must be none: this method has no covariance to increase");
  CHECK(fault<SingleStageRLS>([](auto& s) { s.perturbation = SelfPerturbation{}; }).empty());
}
