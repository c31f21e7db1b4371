// What happens when another material is touched, and when contact ends.
#include <cmath>

#include "check.hpp"
#include "estimators.hpp"
#include "random_numbers.hpp"

using namespace palpate;

namespace {

constexpr HuntCrossley soft{.K = 1e5, .B = 2e5, .n = 2.0}, hard{.K = 3e5, .B = 3e5, .n = 2.0};

// Soft for 2 s, then hard, every 10 ms, with the step that update() is given or the nominal one.
template <class Estimator>
Estimator pressed(const typename Estimator::Settings& settings, bool own_step) {
  Estimator estimator(settings);
  RandomNumbers random(1);
  for (int k = 0; k < 600; ++k) {
    Sample s = probed(k < 300 ? soft : hard, 1e-2 * k);
    s.force += random.between(-0.05, 0.05);
    if (own_step) {
      estimator.update(s.penetration, s.velocity, s.force, 1e-2);
    } else {
      update(estimator, s);
    }
  }
  return estimator;
}

}  // namespace

TEST("a restart relearns its samples with their own time steps") {
  const auto check = []<class Estimator>() {
    typename Estimator::Settings nominal;
    nominal.scale = {10e-3, 50e-3, 10.0};
    nominal.sample_time = 1e-2;
    nominal.changes.warm_up = 100;
    if (Estimator::Method::forgets) nominal.forgetting = {0.98, 2.0};
    typename Estimator::Settings given = nominal;
    given.sample_time = 1e-3;
    const Estimator by_nominal = pressed<Estimator>(nominal, false);
    const Estimator by_step = pressed<Estimator>(given, true);
    CHECK(by_nominal.estimate().restarts == 1);
    const auto expected = by_nominal.estimate(), found = by_step.estimate();
    CHECK(found.restarts == 1);
    for (std::size_t i = 0; i < Estimator::Law::size; ++i) {
      // The fading factor is e^(−α dt) either way, worked out once or at each sample.
      CHECK_NEAR(found.parameters[i], expected.parameters[i],
                 1e-9 * std::abs(expected.parameters[i]));
    }
  };
  check.template operator()<WithChangeDetector<SingleStageRLS>>();
  check.template operator()<WithChangeDetector<KelvinVoigtRLS>>();
  check.template operator()<WithChangeDetector<VariableProjection>>();
  check.template operator()<WithChangeDetector<DriftTracking>>();
}

TEST("where nothing changes a detector changes nothing") {
  const auto check = []<class Estimator>() {
    Estimator plain;
    WithChangeDetector<Estimator> watched;
    const auto law = ball<typename Estimator::Law>;
    probe(plain, law, 1.0);
    probe(watched, law, 1.0);
    CHECK(watched.estimate().restarts == 0);
    CHECK(plain.estimate().parameters == watched.estimate().parameters);
    CHECK(plain.estimate().covariance == watched.estimate().covariance);
  };
  for_each_estimator(check);
  check.template operator()<VariableProjection>();
}
