// The answer to one least-squares problem, from its sums:
//
//   min over (k, c, F₀, n) of Σ (F − k ξⁿ − c ξⁿ w − F₀)²,   ξ = x/x_r, w = v/V,
//
// with no logarithm, no condition 10 and no starting values. For a fixed n the law is linear in
// (k, c, F₀), so what is left is a function J(n) of one variable. See docs/variable-projection.md.
//
// It stands beside the fit of whole curves (curves/curve_fit.hpp), which goes through the samples
// again and again: an answer after every sample leaves no time for that, 0.3 µs, nor memory.
#pragma once

#include <algorithm>

#include "palpate/matrix.hpp"
#include "palpate/projection/covariance.hpp"
#include "palpate/projection/exponent_search.hpp"
#include "palpate/projection/power_sums.hpp"
#include "palpate/projection/priors.hpp"

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

  // As Information has them, of a solution and in its root.
  Vector<4> prior_fractions(const ProjectionSolution& s) const noexcept {
    const ProjectionPoint point{s.n, sums_.at(s.n), {s.k, s.c, s.offset, s.cost, true}};
    const Matrix<5> samples = information(problem(), point);
    return Information(samples, problem(), s.k, s.root_variance, 0.0).prior_fractions();
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
    r.cost = cost(point, start);
    r.residual = std::max(sums_.force_squared() + point.linear.cost, 0.0);
    // Below rounding of Σ F², some ε, there is no residual.
    const double fitted = (settings_.offset ? 4.0 : 3.0) - (problem().exponent_known() ? 1.0 : 0.0);
    r.noise_variance = problem().noise_variance(r.residual, 1e-15 * sums_.force_squared(),
                                                sums_.weight() - fitted, start.variance);
    r.at_edge = problem().at_edge(point.n);
    r.surface_found = true;
    r.root_variance =
        std::max(r.noise_variance, least_variance(sums_.force_squared(), sums_.weight()));
    const Matrix<5> samples = information(problem(), point);
    const InverseRoot<5> inverse =
        Information(samples, problem(), r.k, r.root_variance, 0.0).covariance_root();
    r.root = inverse.root;
    say_identifiable(r, inverse.guarded, problem(), sums_.depth_spread());
    return r;
  }

  const ProjectionSettings& settings_;
  const PowerSums& sums_;
};

}  // namespace palpate::detail
