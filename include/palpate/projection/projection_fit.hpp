// The answer to one least-squares problem, from its sums:
//
//   min over (k, c, F₀, n) of Σ (F − k ξⁿ − c ξⁿ w − F₀)²,   ξ = x/x_r, w = v/V,
//
// with no logarithm, no condition 10 and no starting values. For a fixed n the law is linear in
// (k, c, F₀), so what is left is a function J(n) of one variable. See docs/variable-projection.md.
#pragma once

#include <algorithm>

#include "palpate/matrix.hpp"
#include "palpate/projection/covariance.hpp"
#include "palpate/projection/exponent_search.hpp"
#include "palpate/projection/power_sums.hpp"
#include "palpate/projection/priors.hpp"
#include "palpate/projection/solution.hpp"

namespace palpate::detail {

class ProjectionFit {
 public:
  // Both are only looked at, and have to outlive this.
  ProjectionFit(const PowerSums& sums, const ProjectionSettings& settings) noexcept
      : settings_(settings), sums_(sums) {}

  // The global minimum over the whole range of exponents.
  ProjectionSolution solve() const noexcept {
    if (problem().exponent_known()) return answer_at_known();
    const Valleys valleys = search_grid(problem());
    const SearchStart& first = valleys.start[0];
    const ProjectionPoint point = refine(problem(), first);
    if (valleys.count > 1) {
      const SearchStart& second = valleys.start[1];
      const ProjectionPoint other = refine(problem(), second);
      if (cost(other, second) < cost(point, first)) return weighed_anew(other, second);
    }
    return weighed_anew(point, first);
  }

  // The same from an answer of a little while ago, in whose basin the minimum still is.
  ProjectionSolution solve_near(const ProjectionSolution& earlier) const noexcept {
    const double variance = earlier.prior_variance;
    const SearchStart start{earlier.n, variance, problem().offset_fraction(variance)};
    if (problem().exponent_known()) return answer(point_at_known(start), start);
    return answer(refine(problem(), start), start);
  }

  // What the priors of (k, c, n, F₀) weigh, over what the samples do, in the root of a solution. An
  // offset that there is none of is known.
  Vector<4> prior_fractions(const ProjectionSolution& s) const noexcept {
    const double variance = s.root_variance;
    const ProjectionPoint point{s.n, sums_.at(s.n), {s.k, s.c, s.offset, s.cost, true}};
    const Matrix<4> samples = information(problem(), point, variance);
    const auto fraction = [](double prior, double data) noexcept {
      return std::clamp(prior / (data + tiny), 0.0, largest_parameter);
    };
    return {0.0, fraction(problem().damping_weight(s.k, variance), samples[1][1]),
            problem().exponent_known()
                ? largest_parameter
                : fraction(problem().exponent_weight(variance), samples[2][2]),
            settings_.offset ? fraction(problem().offset_weight(variance), sums_.weight())
                             : largest_parameter};
  }

 private:
  ProjectionProblem problem() const noexcept { return {sums_, settings_}; }

  // Where the exponent is known what is left is linear, and there is nothing to search.
  ProjectionSolution answer_at_known() const noexcept {
    const double noise = settings_.noise;
    const double fraction = problem().offset_fraction(noise * noise);
    const LinearSolution plain =
        solve_linear(problem(), sums_.at(settings_.exponent).value, 0.0, fraction);
    SearchStart start{settings_.exponent, problem().prior_variance(plain.cost), 0.0};
    start.offset_fraction = problem().offset_fraction(start.variance);
    return answer(point_at_known(start), start);
  }

  ProjectionPoint point_at_known(const SearchStart& start) const noexcept {
    ProjectionPoint point{settings_.exponent, sums_.at(settings_.exponent), {}};
    const auto solve = [&](double damping_weight) noexcept {
      return solve_linear(problem(), point.sums.value, damping_weight, start.offset_fraction);
    };
    point.linear = solve(problem().damping_weight(solve(0.0).k, start.variance));
    return point;
  }

  // With priors that weigh by the residual at the minimum. The lowest node, by which they weighed
  // in the search, lies (0.05/SE(n))² σ² above it where noise is small: a prior of the offset that
  // counted five times over moved the answer by a standard error.
  ProjectionSolution weighed_anew(const ProjectionPoint& point,
                                  const SearchStart& start) const noexcept {
    SearchStart again{point.n, problem().prior_variance(point.linear.cost), 0.0};
    if (!(again.variance < 0.99 * start.variance)) return answer(point, start);
    again.offset_fraction = problem().offset_fraction(again.variance);
    return answer(refine(problem(), again), again);
  }

  // J with the priors.
  double cost(const ProjectionPoint& point, const SearchStart& start) const noexcept {
    return point.linear.cost + problem().exponent_penalty(point.n, start.variance);
  }

  ProjectionSolution answer(const ProjectionPoint& point, const SearchStart& start) const noexcept {
    ProjectionSolution r{};
    r.k = point.linear.k;
    r.c = point.linear.c;
    r.offset = point.linear.offset;
    r.n = point.n;
    r.prior_variance = start.variance;
    r.noise_variance = noise_variance(point, start);
    r.cost = cost(point, start);
    r.residual = std::max(sums_.force_squared() + point.linear.cost, 0.0);
    r.at_edge = at_edge(point.n);
    r.surface_found = true;
    r.root_variance = std::max(r.noise_variance, least_variance());
    const InverseRoot<4> inverse = covariance_root(problem(), point, r.root_variance);
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) r.root[i][j] = inverse.root[i][j];
    }
    r.damping_identifiable = !inverse.guarded[1];
    r.exponent_identifiable =
        problem().exponent_known() ||
        (!inverse.guarded[2] && !inverse.guarded[3] && sums_.depth_spread() > smallest_spread);
    return r;
  }

  // From the residual, once ten degrees of freedom tell it to a quarter or so (1/√20).
  double noise_variance(const ProjectionPoint& point, const SearchStart& start) const noexcept {
    constexpr double fewest_degrees = 10.0;
    const double fitted = (settings_.offset ? 4.0 : 3.0) - (problem().exponent_known() ? 1.0 : 0.0);
    const double freedom = sums_.weight() - fitted;
    if (settings_.noise != 0.0 || freedom < fewest_degrees) return start.variance;
    // Below rounding of Σ F², some ε, there is no residual; a part of it keeps error bars above
    // zero.
    const double rounding = 1e-15 * sums_.force_squared();
    return std::max(sums_.force_squared() + point.linear.cost, rounding) / freedom;
  }

  // No force sensor is better than a hundred-thousandth; without any force, one unit.
  double least_variance() const noexcept {
    if (!(sums_.force_squared() > 0.0)) return 1.0;
    return 1e-10 * sums_.force_squared() / sums_.weight();
  }

  // Within a quarter of a step of the last node: there the minimum may lie beyond it.
  bool at_edge(double n) const noexcept {
    const double margin = 0.25 * sums_.step();
    return n < sums_.lowest() + margin || n > sums_.highest() - margin;
  }

  static constexpr double smallest_spread = 1e-4;  // of ln ξ: 1 µm at 10 mm, beyond any sensor

  const ProjectionSettings& settings_;
  const PowerSums& sums_;
};

}  // namespace palpate::detail
