// A controller built with -fno-exceptions and -fno-rtti, as firmware is. Every header also compiles
// on its own with these flags (see CMakeLists.txt).
#include <cmath>
#include <cstdio>
#include <type_traits>
#include <utility>

#include "estimators.hpp"

using namespace palpate;

namespace {

// What the Python package pickles, and what may run in an interrupt.
template <class Estimator>
constexpr bool fit_for_a_controller() noexcept {
  using Settings = typename Estimator::Settings;
  Estimator* e = nullptr;
  const Estimator* known = nullptr;
  double* number = nullptr;
  return std::is_trivially_copyable_v<Estimator> && std::is_trivially_destructible_v<Estimator> &&
         std::is_trivially_copyable_v<Settings> &&
         std::is_nothrow_constructible_v<Estimator, const Settings&> &&
         noexcept(e->update(0.0, 0.0, 0.0)) && noexcept(e->update(0.0, 0.0, 0.0, 0.0)) &&
         noexcept(e->update(Sample{}, 0.0, *number)) && noexcept(e->reset()) &&
         noexcept(e->leave_contact()) && noexcept(known->predict(0.0, 0.0)) &&
         noexcept(known->law()) && noexcept(known->estimate()) && noexcept(known->response()) &&
         noexcept(known->snapshot()) && noexcept(replay(*e, Signals{}, TraceColumns{}));
}

static_assert(fit_for_a_controller<KelvinVoigtRLS>());
static_assert(fit_for_a_controller<ExtendedKelvinVoigtRLS>());
static_assert(fit_for_a_controller<SingleStageRLS>());
static_assert(fit_for_a_controller<DoubleStageRLS>());
static_assert(fit_for_a_controller<VariableProjection>());
static_assert(fit_for_a_controller<VariableProjectionWithSurface>());
static_assert(fit_for_a_controller<DriftTracking>());
static_assert(fit_for_a_controller<WithChangeDetector<SingleStageRLS>>());
static_assert(fit_for_a_controller<WithOutlierRejection<SingleStageRLS>>());

// A detector or a rejection that is switched off costs no memory: what holds it is larger by it.
static_assert(sizeof(SingleStageRLS) + sizeof(ChangeDetector) <=
              sizeof(WithChangeDetector<SingleStageRLS>));
static_assert(sizeof(SingleStageRLS) + sizeof(OutlierRejection) <=
              sizeof(WithOutlierRejection<SingleStageRLS>));

static_assert(std::is_trivially_copyable_v<LeastSquares<1>>);
static_assert(std::is_trivially_copyable_v<LeastSquares<8>>);
static_assert(noexcept(std::declval<LeastSquares<8>&>().update({}, 0.0, 1.0)));
static_assert(std::is_trivially_copyable_v<Estimate<3>>);

bool finds_the_ball() noexcept {
  bool found = true;
  for_each_estimator([&]<class Estimator>() {
    const auto law = ball<typename Estimator::Law>;
    Estimator estimator;
    probe(estimator, law, 2.0);
    const Sample s = probed(law, 2.0);
    found &= std::abs(estimator.predict(s.penetration, s.velocity) - s.force) < 0.05 * s.force;
  });
  return found;
}

}  // namespace

int main() {
  const bool found = finds_the_ball();
  std::puts(found ? "every estimator found the ball" : "an estimator did not find the ball");
  return found ? 0 : 1;
}
