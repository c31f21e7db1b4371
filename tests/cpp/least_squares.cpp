#include "palpate/least_squares.hpp"

#include <cmath>
#include <limits>

#include "check.hpp"

using namespace palpate;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

constexpr double first_parameter_of_a_compiled_run() {
  LeastSquares<2> recursion({{}, diagonal<2>({1e6, 1e6})});
  recursion.update({1.0, 2.0}, 5.0, 1.0);
  recursion.update({2.0, -1.0}, 0.0, 0.99);
  return recursion.parameters()[0];
}

}  // namespace

static_assert(first_parameter_of_a_compiled_run() > 0.99);

TEST("a perturbation or a factor that is not finite is guarded, and P stays positive definite") {
  for (const double bad : {infinity, not_a_number}) {
    LeastSquares<3> recursion({{0.1, 0.1, 0.1}, diagonal<3>({1e3, 1e3, 1e3})});
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
