#include <cmath>
#include <cstddef>
#include <vector>

#include "check.hpp"
#include "palpate/batch_fit/long_run_covariance.hpp"
#include "palpate/error_widening.hpp"
#include "random_numbers.hpp"

using namespace palpate;
using detail::ErrorWidening;
using detail::HaarLevels;

namespace {

// Of a slope that is steady and one that swings once in 100 samples.
Vector<2> slope(int i) { return {1.0, std::sin(0.0628 * i)}; }

Matrix<2> widening(const HaarLevels<2>& levels, const Vector<2>& prior = {}) {
  return ErrorWidening<2, 1>(levels, prior, 1.0).root({{{0.0, 1.0}}});
}

// AR(1) noise of variance 1.
HaarLevels<2> correlated(double pole, int count, double forgetting_factor = 1.0) {
  RandomNumbers random(7);
  HaarLevels<2> levels;
  double noise = 0.0;
  for (int i = 0; i < count; ++i) {
    const double innovation = std::sqrt(3.0) * random.between(-1.0, 1.0);
    noise = pole * noise + std::sqrt(1.0 - pole * pole) * innovation;
    levels.add(slope(i), noise, forgetting_factor);
  }
  return levels;
}

}  // namespace

TEST("the levels and what has no partner hold the whole information") {
  for (const int count : {1, 2, 3, 100, 1023, 5000}) {
    const HaarLevels<2> levels = correlated(0.5, count);
    Matrix<2> sum = levels.rest(), whole{};
    for (std::size_t k = 0; k < levels.used(); ++k) {
      for (std::size_t i = 0; i < 2; ++i) {
        for (std::size_t j = i; j < 2; ++j) sum[i][j] += levels[k].information[i][j];
      }
    }
    for (int s = 0; s < count; ++s) {
      const Vector<2> x = slope(s);
      for (std::size_t i = 0; i < 2; ++i) {
        for (std::size_t j = i; j < 2; ++j) whole[i][j] += x[i] * x[j];
      }
    }
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t j = i; j < 2; ++j) CHECK_NEAR(sum[i][j], whole[i][j], 1e-9 * count);
    }
  }
}

TEST("what a prior knows is not widened") {
  const HaarLevels<2> levels = correlated(0.98, 20000);
  const Matrix<2> known = widening(levels, {0.0, 1e12});
  CHECK_NEAR(known[1][1], 1.0, 1e-3);
  CHECK(known[0][0] > 5.0);
}

TEST("a prior that stands for less than its weight widens what it knows") {
  const HaarLevels<2> levels = correlated(0.0, 20000);
  const ErrorWidening<2, 1> widening(levels, {0.0, 1e6}, 1.0);
  CHECK_NEAR(widening.root({{{0.0, 1.0}}}, 9.0)[1][1], 3.0, 1e-3);
}

TEST("few samples widen nothing") {
  const Matrix<2> none = widening(correlated(0.98, 20));
  CHECK(none[0][0] == 1.0 && none[1][0] == 0.0 && none[1][1] == 1.0);
}

TEST("with forgetting blocks end within the memory") {
  const HaarLevels<2> levels = correlated(0.98, 20000, 0.999);
  // λ^2b ≥ 0.6 up to b = 255.
  CHECK(levels.used() == 8);
  CHECK(widening(levels)[0][0] > 3.0);
  for (std::size_t k = 0; k < levels.used(); ++k) CHECK(levels[k].older_pairs < 501.0);
}

TEST("what no double holds widens nothing, and stays finite") {
  HaarLevels<2> levels;
  for (int i = 0; i < 1000; ++i) levels.add({1e20, -1e20}, i % 3 == 0 ? 1e100 : -1e100, 0.99);
  for (const auto& row : widening(levels)) {
    for (const double entry : row) CHECK(std::isfinite(entry));
  }
}

TEST("Student's quantile is that of the tables") {
  CHECK_NEAR(1.959964 * detail::widened_quantile(3.0), 3.182, 0.03);
  CHECK_NEAR(1.959964 * detail::widened_quantile(10.0), 2.228, 0.003);
  CHECK_NEAR(1.959964 * detail::widened_quantile(1e6), 1.96, 1e-3);
}

TEST("two deviations combine where their squares overflow, vanish or are infinite") {
  CHECK(detail::combined(3.0, -4.0) == 5.0);
  CHECK_NEAR(detail::combined(3e200, 4e200) / 5e200, 1.0, 1e-15);
  CHECK_NEAR(detail::combined(3e-200, 4e-200) / 5e-200, 1.0, 1e-15);
  CHECK(detail::combined(0.0, 0.0) == 0.0);
  CHECK(std::isinf(detail::combined(1.0, -std::numeric_limits<double>::infinity())));
}

TEST(
    "the long-run covariance of a mean grows with the correlation of the residual, not with "
    "signs") {
  // Σ u e of AR(1) noise has the variance N (1 + r)/(1 − r) for u = 1, and N (1 − r)/(1 + r), which
  // is reported as N, for signs that alternate. Twenty levels measure it to a fifth; Student's
  // quantile adds up to a third.
  constexpr std::size_t count = 20000;
  for (const double pole : {0.0, 0.5, 0.9}) {
    RandomNumbers random(7);
    std::vector<double> scores, residual;
    double noise = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double innovation = std::sqrt(3.0) * random.between(-1.0, 1.0);
      noise = pole * noise + std::sqrt(1.0 - pole * pole) * innovation;
      residual.push_back(noise);
      scores.push_back(1.0);
      scores.push_back(i % 2 == 0 ? 1.0 : -1.0);
    }
    std::vector<double> covariance(4);
    detail::long_run_covariance(scores, residual, {}, 1.0, covariance);
    const double growth = (1.0 + pole) / (1.0 - pole);
    CHECK_NEAR(std::log(covariance[0] / (count * growth)), 0.2, 0.35);
    CHECK_NEAR(covariance[3], static_cast<double>(count), 0.1 * count);
    CHECK_NEAR(covariance[1], covariance[2], 1e-9 * covariance[0]);
  }
  std::vector<double> nothing(4, 1.0);
  detail::long_run_covariance({}, {}, {}, 1.0, nothing);
  CHECK(nothing == std::vector<double>(4));
}
