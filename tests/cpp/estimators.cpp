// What the paper's methods do by themselves; tests/conformance.py holds what every estimator does.
#include "estimators.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "check.hpp"

using namespace palpate;

namespace {

// A whole period of the motion (4, 11 and 15 rad/s), s.
constexpr double period = 2.0 * std::numbers::pi;

double relative_error(double value, double truth) noexcept { return (value - truth) / truth; }

}  // namespace

TEST("an estimate reports condition 10 of its law at the last velocity") {
  for_each_estimator([]<class Estimator>() {
    Estimator estimator;
    probe(estimator, ball<typename Estimator::Law>, 0.5);
    const double velocity = probed(ball<typename Estimator::Law>, 0.499).velocity;
    CHECK(estimator.estimate().validity_margin == validity_margin(estimator.law(), velocity));
    CHECK(estimator.estimate().valid());
  });
}

TEST("the double stage skips its second stage while K + B v is not positive") {
  DoubleStageRLS::Settings settings;
  settings.method.initial = {1.0, 100.0, 1.0};
  settings.method.initial_covariance = diagonal<3>({1e-9, 1e-9, 1e3});
  DoubleStageRLS estimator(settings);
  CHECK(estimator.update(0.01, -0.05, 1.0) == Status::updated);
  CHECK(estimator.law().n == 1.0);
  CHECK(estimator.update(0.01, 0.05, 1.0) == Status::updated);
  CHECK(estimator.law().n != 1.0);
}

TEST("an absurd exponent does not stop the double stage") {
  DoubleStageRLS::Settings settings;
  settings.method.initial.n = 1000.0;
  DoubleStageRLS estimator(settings);
  CHECK(taken(estimator.update(10.0, 0.01, 20.0)));
}

TEST("with damping the single stage has the bias of its logarithm that methods state") {
  // By peak |b v| over the motion, in percent. They were measured elsewhere over an unstated time,
  // to the digits given: compared within a tenth and half of the last digit.
  struct Stated {
    double dissipation, stiffness_bias, stiffness_digit, damping_bias, damping_digit;
  };
  constexpr Stated rows[] = {{1.0, -0.03, 0.01, -0.28, 0.01},
                             {2.0, -0.12, 0.01, -0.54, 0.01},
                             {4.0, -0.5, 0.1, -1.0, 0.1},
                             {10.0, -3.2, 0.1, -2.0, 0.1}};
  for (const Stated& row : rows) {
    SingleStageRLS::Settings settings = SingleStageRLS::Settings{};
    settings.method.initial_covariance = diagonal<3>({1e8, 1e8, 1e8});
    SingleStageRLS estimator(settings);
    const HuntCrossley truth{.K = 2000.0, .B = 2000.0 * row.dissipation, .n = 1.0};
    probe(estimator, truth, period);
    const HuntCrossley found = estimator.law();
    CHECK_NEAR(100.0 * relative_error(found.K, truth.K), row.stiffness_bias,
               0.1 * std::abs(row.stiffness_bias) + 0.5 * row.stiffness_digit);
    CHECK_NEAR(100.0 * relative_error(found.B, truth.B), row.damping_bias,
               0.1 * std::abs(row.damping_bias) + 0.5 * row.damping_digit);
  }
}

TEST("from a start off the truth the double stage freezes on a ridge that explains the force") {
  const HuntCrossley truth = ball<HuntCrossley>;
  for (const double off : {0.9, 1.1}) {
    DoubleStageRLS::Settings settings = DoubleStageRLS::Settings{};
    settings.method.initial = {.K = off * truth.K, .B = off * truth.B, .n = off * truth.n};
    DoubleStageRLS estimator(settings);
    probe(estimator, truth, 2.0 * period);
    double worst = 0.0;
    for (int k = 0; k < 1000; ++k) {
      const Sample s = probed(truth, 1e-3 * k);
      const double predicted = estimator.predict(s.penetration, s.velocity);
      worst = std::max(worst, std::abs(relative_error(predicted, s.force)));
    }
    CHECK(worst < 0.1);
    const double still_off = std::abs(estimator.law().n - truth.n);
    CHECK(still_off < 0.1 && still_off > 0.05);
  }
}
