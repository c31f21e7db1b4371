// Variable projection, the search for the surface, and the filter for drift.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "check.hpp"
#include "estimators.hpp"
#include "palpate/palpate.hpp"
#include "random_numbers.hpp"

using namespace palpate;

static_assert(std::is_trivially_copyable_v<VariableProjection>);
static_assert(std::is_trivially_copyable_v<VariableProjectionWithSurface>);
static_assert(std::is_trivially_copyable_v<DriftTracking>);

TEST("Lagrange weights give a polynomial of degree five and its derivatives exactly") {
  const auto f = [](double t) {
    return 1.0 + t * (2.0 + t * (-1.0 + t * (0.5 + t * (0.1 - 0.03 * t))));
  };
  for (const double t : {0.0, 0.7, 4.5, 5.1, 9.0}) {
    const detail::LagrangeWeights w = detail::lagrange_weights(t);
    double value = 0.0, first = 0.0, second = 0.0;
    for (std::size_t i = 0; i < detail::LagrangeWeights::points; ++i) {
      value += w.value[i] * f(static_cast<double>(i));
      first += w.first[i] * f(static_cast<double>(i));
      second += w.second[i] * f(static_cast<double>(i));
    }
    // Values reach 1400 and, at the ends, the weights of ten points sum to 1 from terms of 1000.
    CHECK(std::abs(value - f(t)) < 1e-9);
    CHECK(std::abs(first - (2.0 + t * (-2.0 + t * (1.5 + t * (0.4 - 0.15 * t))))) < 1e-9);
    CHECK(std::abs(second - (-2.0 + t * (3.0 + t * (1.2 - 0.6 * t)))) < 1e-9);
  }
}

TEST("what fades while a contact is held ends at zero, with no subnormal number on the way") {
  detail::PowerSums sums(0.3, 3.6);
  for (int k = 0; k < 100000; ++k) {
    const double speed = k < 1000 ? 0.5 * std::cos(0.01 * k) : 0.0;
    sums.add({1.0 + 0.1 * std::sin(0.01 * k), speed, 20.0}, 0.99);
    if (k % 100) continue;
    for (std::size_t power = 0; power < detail::power_count; ++power) {
      for (const double sum : sums.column(static_cast<detail::Power>(power))) {
        // Nor would the product of two be one.
        CHECK(sum == 0.0 || std::abs(sum) > 1e-150);
      }
    }
  }
  CHECK(sums.column(detail::ppww)[0] == 0.0);
  CHECK(sums.column(detail::pp)[0] > 0.0);
}

// A probe that only goes in, with v = peak speed × (1 − fade · depth reached), in scaled units: the
// dissipation then looks like a higher exponent. `noise` is uniform, in units of force.
struct Approach {
  double exponent, dissipation, fade, noise;
};

void approach(const Approach& a, std::uint64_t seed, detail::ProjectionSolver& solver,
              detail::PowerSums& sums) {
  RandomNumbers random(seed);
  for (int k = 1; k < 500; ++k) {
    const double depth = a.fade > 0.0 ? (1.0 - std::exp(-3e-3 * k)) / 0.78 : 2e-3 * k;
    const double speed = 1.0 - 0.78 * a.fade * depth;
    const double force = 20.0 * std::pow(depth, a.exponent) * (1.0 + a.dissipation * speed) +
                         random.between(-a.noise, a.noise);
    if (!(force > 0.0)) continue;
    solver.add({depth, speed, force}, 1.0);
    sums.add({depth, speed, force}, 1.0);
  }
}

// The exponent of least J, over 3301 of them, with the weights that the solver's priors had.
double densely_searched(const detail::PowerSums& sums, double variance) {
  const ProjectionSettings settings;
  const detail::ProjectionProblem problem{sums, settings};
  const double fraction = problem.offset_fraction(variance);
  double least = std::numeric_limits<double>::infinity(), best = 0.0;
  for (int j = 0; j <= 3300; ++j) {
    const double n = 0.3 + 1e-3 * j;
    const auto local = sums.at(n).value;
    const double k = detail::solve_linear(problem, local, 0.0, fraction).k;
    const double weight = problem.damping_weight(k, variance);
    const double cost = detail::solve_linear(problem, local, weight, fraction).cost +
                        problem.exponent_penalty(n, variance);
    if (cost < least) {
      least = cost;
      best = n;
    }
  }
  return best;
}

TEST("the global minimum is found on approaches that only go in") {
  RandomNumbers random(1);
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const Approach a{random.between(0.5, 3.0), random.between(0.02, 0.6), seed % 2 ? 1.0 : 0.0,
                     seed % 3 ? 1e-4 : 5e-3};
    detail::ProjectionSolver solver{ProjectionSettings{}};
    detail::PowerSums sums(0.3, 3.6);
    approach(a, seed, solver, sums);
    const detail::ProjectionSolution found = solver.solve();
    const double error = std::sqrt(detail::dot(found.root[2], found.root[2]));
    // A fifth of a standard error is for the weight of the prior on c/k, which the search takes at
    // its start; at constant speed, where k and c are told apart by that alone, rounding moves the
    // reference by two of its steps of 1e-3. A wrong valley is 0.02 to 1 away.
    CHECK_NEAR(found.n, densely_searched(sums, found.prior_variance), 5e-3 + 0.2 * error);
  }
}

TEST("where the power of the depth is too small to square no stiffness is made of it") {
  const ProjectionSettings settings{.lowest_exponent = 9.6, .highest_exponent = 10.0};
  detail::ProjectionSolver solver(settings);
  for (int k = 0; k < 4; ++k) solver.add({0.0, 0.0, 0.0}, 1.0);
  solver.add({1e-16, 0.0, 1.0}, 1.0);
  const detail::ProjectionSolution found = solver.solve();
  CHECK(found.k == 0.0);
  CHECK(std::isfinite(found.n));
  CHECK(std::isfinite(found.cost));
}
