#include <algorithm>
#include <cmath>
#include <cstddef>
#include <type_traits>

#include "check.hpp"
#include "estimators.hpp"
#include "soundness.hpp"

using namespace palpate;

namespace {

template <class Estimator>
typename Estimator::Settings constantly_forgetting(double factor) noexcept {
  typename Estimator::Settings settings;
  settings.forgetting = {factor, 0.0};
  return settings;
}

// Largest variance over the largest variance of P₀.
template <std::size_t Order>
double windup(const LeastSquares<Order>& recursion, double start) noexcept {
  double largest = 0.0;
  for (std::size_t i = 0; i < Order; ++i) {
    largest = std::max(largest, recursion.covariance()[i][i]);
  }
  return largest / start;
}

// φ = [1, 2, 3 …] for ever: one direction is known, all others wind up.
template <std::size_t Order>
void hold_one_direction() {
  Vector<Order> variances{};
  Vector<Order> regressor{};
  for (std::size_t i = 0; i < Order; ++i) {
    variances[i] = 1e3;
    regressor[i] = static_cast<double>(i + 1);
  }
  LeastSquares<Order> recursion({{}, diagonal(variances)});
  for (int k = 0; k < 100000; ++k) {
    CHECK(taken(recursion.update(regressor, 5.0, 0.95)));
    if (k % 100 == 0) check_sound(recursion);
  }
  CHECK(windup(recursion, 1e3) <= detail::largest_windup);
  CHECK_NEAR(recursion.predict(regressor), 5.0, 1e-6);
}

}  // namespace

TEST("after a million held samples a linear model finds a changed material") {
  KelvinVoigtRLS estimator(constantly_forgetting<KelvinVoigtRLS>(0.99));
  for (int k = 0; k < 1000000; ++k) estimator.update(0.01, 0.0, 20.0);
  const KelvinVoigt other{.K = 3000.0, .B = 40.0};
  // Forgetting was withheld, so the hold weighs a million samples: e^(-40) of that is left.
  probe(estimator, other, 4.0);
  CHECK_NEAR(estimator.law().K, other.K, 1e-6 * other.K);
  CHECK_NEAR(estimator.law().B, other.B, 1e-6 * other.B);
}

TEST("no direction winds up past its bound, whatever the order") {
  hold_one_direction<1>();
  hold_one_direction<2>();
  hold_one_direction<3>();
  hold_one_direction<5>();
  hold_one_direction<8>();
}

TEST("no motion at all, or none that a regressor sees, leaves P as it was") {
  LeastSquares<2> recursion({{1.0, 1.0}, diagonal<2>({1e3, 1e3})});
  for (int k = 0; k < 10000; ++k) {
    CHECK(taken(recursion.update({0.0, 0.0}, 0.0, 0.9)));
    check_sound(recursion);
  }
  CHECK(windup(recursion, 1e3) <= detail::largest_windup);
  CHECK(recursion.parameters()[0] == 1.0);
}

TEST("while the motion excites every direction the guard never acts") {
  for_each_estimator([]<class Estimator>() {
    const auto law = ball<typename Estimator::Law>;
    Estimator fading;
    probe(fading, law, 60.0);
    CHECK(fading.estimate().guarded == 0);
    Estimator constant(constantly_forgetting<Estimator>(0.99));
    probe(constant, law, 60.0);
    CHECK(constant.estimate().guarded == 0);
  });
}

TEST("however large the initial covariance, the estimate comes out the same") {
  // From 1e12 on one sample holds more than a covariance of doubles can hold beside the others.
  for_each_estimator([]<class Estimator>() {
    if constexpr (!std::is_same_v<Estimator, DoubleStageRLS>) {
      const auto law = ball<typename Estimator::Law>;
      const auto found_from = [&](double variance) {
        typename Estimator::Settings settings;
        for (std::size_t i = 0; i < Estimator::Law::size; ++i) {
          settings.method.initial_covariance[i][i] = variance;
        }
        Estimator estimator(settings);
        probe(estimator, law, 2.0);
        check_sound(estimator);
        return estimator.law().parameters();
      };
      const auto expected = found_from(1e11);
      for (const double variance : {1e12, 1e14, 1e16, 1e18, 1e20}) {
        const auto found = found_from(variance);
        for (std::size_t i = 0; i < Estimator::Law::size; ++i) {
          // The dozen samples that were guarded count for less, of two thousand.
          CHECK_NEAR(found[i], expected[i], 1e-4 * expected[i]);
        }
      }
    }
  });
}
