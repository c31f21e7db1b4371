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

TEST("a rate of zero is a constant factor, and a faded one becomes 1 exactly") {
  Forgetting constant({0.97, 0.0}, sample_time);
  for (int k = 0; k < 1000; ++k) constant.advance(sample_time);
  CHECK(constant.factor() == 1.0 - (1.0 - 0.97));
  Forgetting faded = paper();
  faded.advance(1e300);
  CHECK(faded.factor() == 1.0);
}

TEST("self-perturbation follows a change of material that a faded factor cannot") {
  KelvinVoigtRLS::Settings settings;
  KelvinVoigtRLS plain(settings);
  settings.perturbation = {0.05, 2.5};
  KelvinVoigtRLS perturbed(settings);
  const KelvinVoigt before = ball<KelvinVoigt>;
  const KelvinVoigt after{.K = 1.1 * before.K, .B = before.B};
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
