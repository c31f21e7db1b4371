#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <type_traits>

#include "batch.hpp"
#include "check.hpp"
#include "estimators.hpp"

using namespace palpate;

namespace {

// A whole period of the motion (4, 11 and 15 rad/s), s.
constexpr double period = 2.0 * std::numbers::pi;

double relative_error(double value, double truth) noexcept { return (value - truth) / truth; }

template <class Estimator>
void check_on_truth(const Estimator& estimator, const typename Estimator::Law& truth,
                    double tolerance) {
  const auto found = estimator.law().parameters();
  const auto expected = truth.parameters();
  for (std::size_t i = 0; i < found.size(); ++i) {
    CHECK_NEAR(found[i], expected[i], tolerance * std::max(std::abs(expected[i]), 1.0));
  }
}

}  // namespace

TEST("the linear models converge to the truth") {
  // What is left of the start is its weight P₀⁻¹ against that of two seconds of motion.
  KelvinVoigtRLS linear(KelvinVoigtRLS::Settings{});
  probe(linear, ball<KelvinVoigt>, 2.0);
  check_on_truth(linear, ball<KelvinVoigt>, 1e-6);
  ExtendedKelvinVoigtRLS extended(ExtendedKelvinVoigtRLS::Settings{});
  probe(extended, ball<ExtendedKelvinVoigt>, 2.0);
  check_on_truth(extended, ball<ExtendedKelvinVoigt>, 1e-4);
}

TEST("the single stage converges to the truth where its logarithm is exact, without damping") {
  for (const double exponent : {1.0, 1.5, 2.0}) {
    SingleStageRLS::Settings settings = SingleStageRLS::Settings{};
    settings.method.initial_covariance = diagonal<3>({1e8, 1e8, 1e8});
    SingleStageRLS estimator(settings);
    const HuntCrossley truth{2000.0, 0.0, exponent};
    probe(estimator, truth, 2.0);
    check_on_truth(estimator, truth, 1e-5);
    CHECK(estimator.estimate().valid());
  }
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
    const HuntCrossley truth{2000.0, 2000.0 * row.dissipation, 1.0};
    probe(estimator, truth, period);
    const HuntCrossley found = estimator.law();
    CHECK_NEAR(100.0 * relative_error(found.stiffness, truth.stiffness), row.stiffness_bias,
               0.1 * std::abs(row.stiffness_bias) + 0.5 * row.stiffness_digit);
    CHECK_NEAR(100.0 * relative_error(found.damping, truth.damping), row.damping_bias,
               0.1 * std::abs(row.damping_bias) + 0.5 * row.damping_digit);
  }
}

TEST("the single stage is batch least squares of the logarithm, weighted as the factors say") {
  SingleStageRLS estimator(SingleStageRLS::Settings{});
  Batch<3> batch({std::log(0.1), 0.0, 1.0}, {1e3, 1e3, 1e3});
  double departure = 0.01;
  for (int k = 0; k < 1000; ++k) {
    const Sample s = probed(HuntCrossley{1e5, 2e5, 2.0}, 1e-3 * k);
    update(estimator, s);
    batch.add({1.0, s.velocity, std::log(s.penetration)}, std::log(s.force), 1.0 - departure);
    departure *= std::exp(-5.0 * 1e-3);
  }
  const auto theta = batch.parameters();
  const HuntCrossley found = estimator.law();
  CHECK_NEAR(std::log(found.stiffness), static_cast<double>(theta[0]), 1e-9);
  CHECK_NEAR(found.damping / found.stiffness, static_cast<double>(theta[1]), 1e-9);
  CHECK_NEAR(found.exponent, static_cast<double>(theta[2]), 1e-9);
}

TEST("from a start off the truth the double stage freezes on a ridge that explains the force") {
  const HuntCrossley truth = ball<HuntCrossley>;
  for (const double off : {0.9, 1.1}) {
    DoubleStageRLS::Settings settings = DoubleStageRLS::Settings{};
    settings.method.initial = {off * truth.stiffness, off * truth.damping, off * truth.exponent};
    DoubleStageRLS estimator(settings);
    probe(estimator, truth, 2.0 * period);
    double worst = 0.0;
    for (int k = 0; k < 1000; ++k) {
      const Sample s = probed(truth, 1e-3 * k);
      const double predicted = estimator.predict(s.penetration, s.velocity);
      worst = std::max(worst, std::abs(relative_error(predicted, s.force)));
    }
    CHECK(worst < 0.1);
    const double still_off = std::abs(estimator.law().exponent - truth.exponent);
    CHECK(still_off < 0.1 && still_off > 0.05);
  }
}

TEST("the truth as a start stays put on clean data") {
  for_each_estimator([]<class Estimator>() {
    typename Estimator::Settings settings;
    settings.method.initial = ball<typename Estimator::Law>;
    if constexpr (std::is_same_v<Estimator, SingleStageRLS>) {
      settings.method.initial.damping = 0.0;  // where the logarithm is exact
    }
    Estimator estimator(settings);
    probe(estimator, settings.method.initial, 1.0);
    check_on_truth(estimator, settings.method.initial, 1e-9);
  });
}
