#include <algorithm>
#include <cmath>

#include "check.hpp"
#include "estimators.hpp"
#include "palpate/method.hpp"

using namespace palpate;

namespace {

constexpr double sample_time = 1e-3;

Forgetting paper() noexcept { return Forgetting({0.99, 5.0}, sample_time); }

}  // namespace

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
