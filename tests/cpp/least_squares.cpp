#include "palpate/least_squares.hpp"

#include <limits>
#include <utility>

#include "batch.hpp"
#include "check.hpp"
#include "estimators.hpp"
#include "random_numbers.hpp"

using namespace palpate;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

template <std::size_t Order>
Vector<Order> filled(double value) {
  Vector<Order> result{};
  result.fill(value);
  return result;
}

template <std::size_t Order>
LeastSquares<Order> started(double initial, double variance) {
  return LeastSquares<Order>({filled<Order>(initial), diagonal(filled<Order>(variance))});
}

// Rows of uniform regressors, and outputs of θ = 1, 2, 3 … with uniform noise. P₀ is small enough
// for the start to matter to the answer.
template <std::size_t Order>
void compare_with_batch(double forgetting_factor) {
  RandomNumbers random(Order);
  const double variance = 10.0;
  LeastSquares<Order> online = started<Order>(0.5, variance);
  Batch<Order> batch(filled<Order>(0.5), filled<Order>(variance));
  for (int k = 0; k < 400; ++k) {
    Vector<Order> regressor{};
    double output = random.between(-0.1, 0.1);
    for (std::size_t i = 0; i < Order; ++i) {
      regressor[i] = random.between(-1.0, 1.0);
      output += regressor[i] * static_cast<double>(i + 1);
    }
    CHECK(online.update(regressor, output, forgetting_factor) == Status::updated);
    batch.add(regressor, output, forgetting_factor);
  }
  const auto theta = batch.parameters();
  const auto p = batch.covariance();
  for (std::size_t i = 0; i < Order; ++i) {
    CHECK_NEAR(online.parameters()[i], static_cast<double>(theta[i]), 1e-12);
    for (std::size_t j = 0; j < Order; ++j) {
      // Relative to the variances: a covariance may be zero.
      const double size = static_cast<double>(std::sqrt(p[i][i] * p[j][j]));
      CHECK_NEAR(online.covariance()[i][j], static_cast<double>(p[i][j]), 1e-11 * size);
      CHECK(online.covariance()[i][j] == online.covariance()[j][i]);
    }
  }
  const double noise = static_cast<double>(batch.noise_variance());
  CHECK_NEAR(online.noise_variance(), noise, 1e-9 * noise);
  CHECK(online.samples() == 400);
}

constexpr double first_parameter_of_a_compiled_run() {
  LeastSquares<2> recursion({{}, diagonal<2>({1e6, 1e6})});
  recursion.update({1.0, 2.0}, 5.0, 1.0);
  recursion.update({2.0, -1.0}, 0.0, 0.99);
  return recursion.parameters()[0];
}

}  // namespace

static_assert(first_parameter_of_a_compiled_run() > 0.99);

TEST("without forgetting the recursion is batch least squares, for every order") {
  compare_with_batch<1>(1.0);
  compare_with_batch<2>(1.0);
  compare_with_batch<3>(1.0);
  compare_with_batch<4>(1.0);
  compare_with_batch<8>(1.0);
}

TEST("with forgetting it is exponentially weighted least squares") {
  compare_with_batch<1>(0.98);
  compare_with_batch<2>(0.98);
  compare_with_batch<3>(0.98);
  compare_with_batch<4>(0.98);
  compare_with_batch<8>(0.98);
}

TEST("one row by hand") {
  LeastSquares<1> recursion({{1.0}, {{{4.0}}}});
  CHECK(recursion.update({2.0}, 10.0, 0.5) == Status::updated);
  // g = 8, L = 8/(0.5 + 16), e = 8, P = (4 - L g)/0.5
  CHECK_NEAR(recursion.parameters()[0], 1.0 + 8.0 / 16.5 * 8.0, 1e-15);
  CHECK_NEAR(recursion.covariance()[0][0], (4.0 - 64.0 / 16.5) / 0.5, 1e-15);
}

TEST("a perturbation is added to the diagonal before the division by the forgetting factor") {
  LeastSquares<2> plain = started<2>(0.0, 4.0);
  LeastSquares<2> perturbed = plain;
  plain.update({1.0, -2.0}, 3.0, 0.5);
  perturbed.update({1.0, -2.0}, 3.0, 0.5, 0.25);
  CHECK(perturbed.parameters() == plain.parameters());
  CHECK_NEAR(perturbed.covariance()[0][0], plain.covariance()[0][0] + 0.25 / 0.5, 1e-15);
  CHECK_NEAR(perturbed.covariance()[1][1], plain.covariance()[1][1] + 0.25 / 0.5, 1e-15);
  CHECK(perturbed.covariance()[0][1] == plain.covariance()[0][1]);
}

TEST("a row that is refused changes no byte") {
  LeastSquares<3> recursion = started<3>(0.1, 1e3);
  recursion.update({1.0, 0.2, 0.3}, 2.0, 0.99);
  const auto before = bytes_of(recursion);
  for (const double bad : {infinity, -infinity, not_a_number, 1e200, -1e308}) {
    CHECK(recursion.update({1.0, bad, 0.3}, 2.0, 0.99) == Status::out_of_range);
    CHECK(recursion.update({1.0, 0.2, 0.3}, bad, 0.99) == Status::out_of_range);
    CHECK(bytes_of(recursion) == before);
  }
}

TEST("a perturbation or a factor that is not finite is guarded, and P stays positive definite") {
  for (const double bad : {infinity, not_a_number}) {
    LeastSquares<3> recursion = started<3>(0.1, 1e3);
    CHECK(recursion.update({1.0, 0.2, 0.3}, 2.0, 0.99, bad) == Status::guarded);
    CHECK(recursion.update({1.0, 0.1, 0.5}, 2.0, bad, 0.0) == Status::guarded);
    CHECK(detail::is_positive_definite(recursion.covariance()));
    for (const double theta : recursion.parameters()) CHECK(std::isfinite(theta));
  }
}

TEST("the noise variance is 1 until there are more rows than coefficients, and finite ever after") {
  LeastSquares<2> recursion({{0.0, 0.0}, {{{1.0, 1.0 - 1e-9}, {1.0 - 1e-9, 1.0}}}});
  CHECK(recursion.noise_variance() == 1.0);
  recursion.update({1.0, 0.0}, 1e30, 1.0);
  recursion.update({0.0, 1.0}, -1e30, 1.0);
  CHECK(recursion.noise_variance() == 1.0);
  recursion.update({1.0, 1.0}, 1e30, 1.0);
  CHECK(recursion.noise_variance() > 0.0);
  CHECK(std::isfinite(recursion.noise_variance()));
}

TEST("the recursion can run while compiling") {
  // θ = [1, 2], but for P₀.
  CHECK_NEAR(first_parameter_of_a_compiled_run(), 1.0, 1e-5);
}
