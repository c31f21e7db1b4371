#include <algorithm>
#include <cmath>

#include "check.hpp"
#include "estimators.hpp"
#include "palpate/method.hpp"

using namespace palpate;

namespace {

constexpr double sample_time = 1e-3;
constexpr double tolerance = 1e-14;  // of λ, over a few thousand steps

Forgetting paper() noexcept { return Forgetting({0.99, 5.0}, sample_time); }

}  // namespace

TEST("the factor fades as 1 - (1 - first) exp(-rate t)") {
  Forgetting forgetting = paper();
  for (int k = 0; k < 3000; ++k) {
    CHECK_NEAR(forgetting.factor(), 1.0 - 0.01 * std::exp(-5.0 * sample_time * k), tolerance);
    forgetting.advance(sample_time);
  }
}

TEST("uneven steps reach the factor that even ones reach") {
  Forgetting even = paper();
  Forgetting uneven = paper();
  for (int k = 0; k < 1000; ++k) even.advance(sample_time);
  for (const double dt : {0.25, 1e-6, 0.5, 0.25 - 1e-6}) uneven.advance(dt);
  CHECK_NEAR(uneven.factor(), even.factor(), tolerance);
}

TEST("the product of all factors is what methods state, exp(-0.01/(rate T))") {
  Forgetting forgetting = paper();
  double product = 1.0;
  for (int k = 0; k < 20000; ++k) {
    product *= forgetting.factor();
    forgetting.advance(sample_time);
  }
  // The sum of d₀ e^(-αTk) is d₀/(αT) to first order in αT and d₀.
  CHECK_NEAR(product, std::exp(-0.01 / (5.0 * sample_time)), 0.02 * product);
}

TEST("a rate of zero is a constant factor, and a faded one becomes 1 exactly") {
  Forgetting constant({0.97, 0.0}, sample_time);
  for (int k = 0; k < 1000; ++k) constant.advance(sample_time);
  CHECK(constant.factor() == 1.0 - (1.0 - 0.97));
  Forgetting faded = paper();
  faded.advance(1e300);
  CHECK(faded.factor() == 1.0);
}

TEST("re-arming starts the schedule again") {
  Forgetting forgetting = paper();
  const double first = forgetting.factor();
  for (int k = 0; k < 500; ++k) forgetting.advance(sample_time);
  CHECK(forgetting.factor() > first);
  forgetting.rearm();
  CHECK(forgetting.factor() == first);
}

TEST("a perturbation is the gain times the nearest integer of the weighted squared error") {
  const SelfPerturbation paper_perturbation{0.05, 2.5};
  CHECK(paper_perturbation(0.0) == 0.0);
  CHECK(paper_perturbation(0.447) == 0.0);  // √(0.5/2.5) = 0.4472 N
  CHECK(paper_perturbation(-0.448) == 0.05);
  CHECK_NEAR(paper_perturbation(2.0), 0.05 * 10.0, 1e-15);
  CHECK(no_perturbation(1e6) == 0.0);
  CHECK(!SelfPerturbation{0.0, 2.5}.active());
  CHECK(!SelfPerturbation{0.05, 0.0}.active());
}

TEST(
    "an estimator is eq. 13 with the schedule from its own contact, and again from each later "
    "one") {
  KelvinVoigtRLS estimator;
  LeastSquares<2> recursion({{0.1, 0.0}, diagonal<2>({1e8, 1e8})});
  const KelvinVoigt truth = ball<KelvinVoigt>;
  for (const int length : {700, 300, 50}) {
    for (int k = 0; k < 10; ++k) estimator.update(-1e-3, 0.01, 0.0);
    double departure = 0.01;
    for (int k = 0; k < length; ++k) {
      const Sample s = probed(truth, sample_time * (length + k));
      estimator.update(s.penetration, s.velocity, s.force);
      recursion.update({s.penetration, s.velocity}, s.force, 1.0 - departure);
      departure *= std::exp(-5.0 * sample_time);
    }
    CHECK_NEAR(estimator.law().stiffness, recursion.parameters()[0], 1e-9);
    CHECK_NEAR(estimator.law().damping, recursion.parameters()[1], 1e-9);
  }
}

TEST("self-perturbation follows a change of material that a faded factor cannot") {
  KelvinVoigtRLS::Settings settings;
  KelvinVoigtRLS plain(settings);
  settings.perturbation = {0.05, 2.5};
  KelvinVoigtRLS perturbed(settings);
  const KelvinVoigt before = ball<KelvinVoigt>;
  const KelvinVoigt after{1.1 * before.stiffness, before.damping};
  double largest_plain = 0.0;
  double largest_perturbed = 0.0;
  for (int k = 0; k < 9000; ++k) {
    const Sample s = probed(k < 4000 ? before : after, sample_time * k);
    if (k >= 8000) {
      const auto error = [&](const KelvinVoigtRLS& estimator) {
        return std::abs(s.force - estimator.predict(s.penetration, s.velocity));
      };
      largest_plain = std::max(largest_plain, error(plain));
      largest_perturbed = std::max(largest_perturbed, error(perturbed));
    }
    update(plain, s);
    update(perturbed, s);
  }
  const double threshold = std::sqrt(0.5 / 2.5);  // N; a smaller error perturbs nothing
  CHECK(largest_plain > threshold);
  CHECK(largest_perturbed < threshold);
}

TEST("a perturbation takes the factor back to its first value") {
  KelvinVoigtRLS::Settings settings;
  settings.perturbation = {0.05, 2.5};
  KelvinVoigtRLS estimator(settings);
  LeastSquares<2> recursion({{0.1, 0.0}, diagonal<2>({1e8, 1e8})});
  double departure = 0.01;
  for (int k = 0; k < 3000; ++k) {
    const Sample s =
        probed(k < 2000 ? KelvinVoigt{2000.0, 20.0} : KelvinVoigt{2300.0, 20.0}, sample_time * k);
    const Vector<2> row{s.penetration, s.velocity};
    if (k > 0) departure *= std::exp(-5.0 * sample_time);
    const double error = s.force - recursion.predict(row);
    const double added = 0.05 * std::nearbyint(2.5 * error * error);
    if (added > 0.0) departure = 0.01;
    recursion.update(row, s.force, 1.0 - departure, added);
    update(estimator, s);
  }
  CHECK_NEAR(estimator.law().stiffness, recursion.parameters()[0], 1e-8);
  CHECK_NEAR(estimator.law().damping, recursion.parameters()[1], 1e-8);
}
