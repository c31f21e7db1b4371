// Samples that no probe can have made change nothing but their count.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "check.hpp"
#include "estimators.hpp"
#include "random_numbers.hpp"

using namespace palpate;

namespace {

template <class Estimator>
using Rejecting = WithOutlierRejection<Estimator>;

// Calls test.operator()<Rejecting<Estimator>>() with every bare estimator, and with a detector.
template <class Test>
void for_every_rejection(Test&& test) {
  for_every_estimator([&]<class Estimator>() {
    if constexpr (std::is_same_v<typename Estimator::Outliers, NoOutlierRejection>)
      test.template operator()<Rejecting<Estimator>>();
  });
}

// `seconds` of probing with 0.05 N of noise.
template <class Estimator>
void probe_noisily(Estimator& estimator, double seconds) {
  RandomNumbers random(7);
  const auto law = ball<typename Estimator::Law>;
  for (int k = 0; k < static_cast<int>(1e3 * seconds); ++k) {
    Sample s = probed(law, 1e-3 * k);
    s.force += random.between(-0.05, 0.05);
    update(estimator, s);
  }
}

// A method that counts what it is to forget.
struct Forgetful : KelvinVoigtRLS::Method {
  using Base = KelvinVoigtRLS::Method;
  using Base::Base;

  void withdraw(std::size_t count) noexcept { withdrawn += count; }

  std::size_t withdrawn = 0;
};

}  // namespace

TEST("a running median that has grown beyond its range can still be raised") {
  detail::RunningMedian median;
  for (int k = 0; k < 10; ++k) median.learn(std::numeric_limits<double>::max());
  const double before = median.value();
  median.raise_to(1.0);
  CHECK(median.value() == before);
}

TEST("an outlier changes nothing that the method knows, and is counted") {
  for_every_rejection([]<class Estimator>() {
    Estimator estimator;
    probe_noisily(estimator, 1.0);
    const auto before = bytes_of(estimator.method());
    const auto known = estimator.estimate();
    const Sample next = probed(ball<typename Estimator::Law>, 1.0);
    std::uint64_t count = 0;
    for (const Sample& bad : {Sample{0.0, next.velocity, next.force},
                              Sample{next.penetration, next.velocity + 1.0, next.force},
                              Sample{next.penetration, next.velocity, next.force + 500.0},
                              Sample{next.penetration, next.velocity, -500.0}}) {
      CHECK(update(estimator, bad) == Status::rejected);
      const auto now = estimator.estimate();
      CHECK(now.rejected == ++count);
      CHECK(now.samples == known.samples);
      CHECK(now.status == known.status);
      CHECK(bytes_of(estimator.method()) == before);
      CHECK(now.parameters == known.parameters);
    }
    CHECK(taken(update(estimator, probed(ball<typename Estimator::Law>, 1.004))));
    estimator.reset();
    CHECK(estimator.estimate().rejected == 0);
  });
}

TEST("the first samples at the end of the range are withdrawn, once it is known") {
  RecursiveEstimator<Forgetful, NoChangeDetector, OutlierRejection> estimator;
  RandomNumbers random(3);
  std::size_t clipped = 0;
  for (int k = 0; k < 3000; ++k) {
    Sample s = probed(ball<KelvinVoigt>, 1e-3 * k);
    s.force = std::min(s.force + random.between(-0.05, 0.05), 22.0);
    clipped += s.force == 22.0;
    update(estimator, s);
  }
  CHECK(estimator.method().withdrawn == 4);
  CHECK(estimator.estimate().rejected == clipped - 4);
}
