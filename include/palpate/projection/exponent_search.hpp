// The minimum of J(n), once (k, c, F₀) are projected out: a grid for its valleys, then Newton's
// method on dJ/dn in the two lowest.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"
#include "palpate/projection/covariance.hpp"
#include "palpate/projection/priors.hpp"

namespace palpate::detail {

// Where Newton's method starts, and the weights of the priors on the way.
struct SearchStart {
  double n;
  double variance;         // σ² for the weight of the priors
  double offset_fraction;  // 1 / (Σ1 + ρ_F); 0 without an offset
};

// Where to start in the lowest valleys of J. On a one-way approach another exponent gives nearly
// the same function (at v = a − b x, x^(n+1) in place of xⁿ), and the nodes beside the deeper
// valley need not be the lower ones: of 2000 such approaches the lowest node alone misses 16, two
// valleys none, and a third changes nothing in 20 000.
struct Valleys {
  static constexpr std::size_t most = 2;
  std::array<SearchStart, most> start;
  std::size_t count;
};

inline std::size_t lowest(const GridCosts& cost) noexcept {
  std::size_t best = 0;
  for (std::size_t j = 1; j < cost.size(); ++j) {
    if (cost[j] < cost[best]) best = j;
  }
  return best;
}

// The vertex of the parabola through a node and its neighbours; the node itself at an end.
inline double vertex(const PowerSums& sums, const GridCosts& cost, std::size_t node) noexcept {
  const double n = sums.exponent(node);
  if (node == 0 || node + 1 == cost.size()) return n;
  const double curvature = cost[node - 1] - 2.0 * cost[node] + cost[node + 1];
  const double slope = 0.5 * (cost[node + 1] - cost[node - 1]);
  return curvature > std::abs(slope) ? n - sums.step() * slope / curvature : n;
}

inline Valleys valleys(const PowerSums& sums, const GridCosts& cost,
                       const SearchStart& weights) noexcept {
  // The lowest node is in a valley, whatever the comparisons below make of equal costs.
  std::array<std::size_t, Valleys::most> node{lowest(cost)};
  Valleys found{{}, 1};
  for (std::size_t j = 0; j < cost.size(); ++j) {
    const bool falls = j == 0 || cost[j] < cost[j - 1];
    const bool rises = j + 1 == cost.size() || cost[j] < cost[j + 1];
    if (!falls || !rises || j == node[0]) continue;
    if (found.count == Valleys::most && !(cost[j] < cost[node[1]])) continue;
    node[1] = j;
    found.count = Valleys::most;
  }
  for (std::size_t i = 0; i < found.count; ++i) {
    found.start[i] = weights;
    found.start[i].n = vertex(sums, cost, node[i]);
  }
  return found;
}

inline Valleys search_grid(const ProjectionProblem& problem) noexcept {
  const PowerSums& sums = problem.sums;
  const double noise = problem.settings.noise;
  const double fraction = problem.offset_fraction(noise * noise), total = sums.force();
  GridCosts cost = grid_costs(sums, fraction);
  std::size_t best = lowest(cost);
  SearchStart start{};
  start.variance = problem.prior_variance(cost[best] - fraction * total * total);
  start.offset_fraction = problem.offset_fraction(start.variance);
  // While the noise was unknown the prior of the offset had no weight; with it the minimum may be
  // at quite another node.
  if (start.offset_fraction != fraction) cost = grid_costs(sums, start.offset_fraction);
  for (std::size_t j = 0; j < cost.size(); ++j) {
    cost[j] += problem.exponent_penalty(sums.exponent(j), start.variance);
  }
  return valleys(sums, cost, start);
}

// The slope of J without the prior on n, and half its Gauss–Newton curvature: what is left of n's
// entry of JᵀJ once the linear part is projected out. The prior on c/k counts in that part: where v
// says nothing that ξ does not, the curvature without it is rounding, and steps by it end anywhere.
struct Curve {
  double slope;
  double half_curvature;
};

// dJ/dn = θᵀA'θ − 2b'ᵀθ: θ minimises, so its own change does not count.
inline Curve curve_at(const ProjectionProblem& problem, const ProjectionPoint& point,
                      const SearchStart& start, double damping_weight) noexcept {
  const double prior = problem.settings.prior_dissipation;
  const Matrix<5> m = information(problem, point);
  const auto& [k, c, f0, cost, damped] = point.linear;
  const PowerSums::Values& d = point.sums.first;
  const double quadratic =
      k * k * d[pp] + 2.0 * k * c * d[ppw] + c * c * d[ppww] + 2.0 * f0 * (k * d[p1] + c * d[pw]);
  const auto without_offset = [&](std::size_t i, std::size_t j) noexcept {
    return m[i][j] - m[i][3] * m[j][3] * start.offset_fraction;
  };
  const double a11 = without_offset(0, 0) + damping_weight * prior * prior;
  const double a12 = without_offset(0, 1) - damping_weight * prior;
  const double a22 = without_offset(1, 1) + damping_weight, h1 = without_offset(0, 2);
  const double h2 = without_offset(1, 2), h = without_offset(2, 2);
  // By elimination, not by the determinant, which underflows where columns are small.
  double projected = 0.0;
  if (a11 > smallest_sum) {
    projected = h1 * h1 / a11;
    const double pivot = a22 - a12 * a12 / a11, rest = h2 - h1 * a12 / a11;
    if (damped && pivot > 0.0) projected += rest * rest / pivot;
  }
  return {quadratic - 2.0 * (k * d[pf] + c * d[pwf]), std::max(h - projected, 0.0)};
}

// Not inlined: a replay would hold it a dozen times, and take three times as long to compile.
[[gnu::noinline]] inline ProjectionPoint refine(const ProjectionProblem& problem,
                                                const SearchStart& start) noexcept {
  const PowerSums& sums = problem.sums;
  const double exponent_weight = problem.exponent_weight(start.variance);
  const double n = std::clamp(start.n, sums.lowest(), sums.highest());
  ProjectionPoint point{n, sums.at(n), {}};
  const auto solve = [&](double damping_weight) noexcept {
    return solve_linear(problem, point.sums.value, damping_weight, start.offset_fraction);
  };
  const double damping_weight = problem.damping_weight(solve(0.0).k, start.variance);
  // From the parabola's vertex, a tenth of a step off at most, Newton's steps shrink by a hundred
  // or more: three reach 1e-8, and the fourth is for starts from an earlier solution.
  constexpr int most_rounds = 4;
  for (int round = 0; round < most_rounds; ++round) {
    point.linear = solve(damping_weight);
    const Curve curve = curve_at(problem, point, start, damping_weight);
    const double away = point.n - problem.settings.prior_exponent;
    const double slope = curve.slope + 2.0 * exponent_weight * away;
    const double curvature = 2.0 * (curve.half_curvature + exponent_weight);
    if (!(curvature > 0.0)) break;
    const double limit = sums.step();
    const double step = std::clamp(-slope / curvature, -limit, limit);
    const double next = std::clamp(point.n + step, sums.lowest(), sums.highest());
    // The step after one of 1e-6 would be below 1e-8.
    const bool settled = std::abs(next - point.n) < 1e-6;
    point.n = next;
    point.sums = sums.at(next);
    if (settled) break;
  }
  point.linear = solve(damping_weight);
  return point;
}

}  // namespace palpate::detail
