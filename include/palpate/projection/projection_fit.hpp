// The solution of one least-squares problem from its sums:
//
//   min over (k, c, F₀, n) of Σ (F − k ξⁿ − c ξⁿ w − F₀)²,   ξ = x/x_r, w = v/V,
//
// without a logarithm, condition 10 or starting values. For a fixed n the law is linear in (k, c,
// F₀), so that only a function J(n) of one variable is minimised. See
// docs/explain/default-method.md.
//
// The fit of whole curves (batch_fit/curve_fit.hpp) iterates over the samples instead. An estimate
// after every sample, within 0.3 µs, has neither the time nor the memory for that.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"
#include "palpate/method.hpp"
#include "palpate/projection/covariance.hpp"
#include "palpate/projection/power_sums.hpp"
#include "palpate/sample.hpp"

namespace palpate::detail {

// Minimises J(n), the cost with (k, c, F₀) projected out: a grid finds its valleys, and Newton's
// method on dJ/dn refines the two lowest.
// The start of Newton's method, and the weights of the priors.
struct SearchStart {
  double n;
  double variance;         // σ² for the weight of the priors
  double offset_fraction;  // 1 / (Σ1 + ρ_F); 0 without an offset
};

// Starts in the lowest valleys of J. On a one-way approach another exponent gives nearly the same
// function (at v = a − b x, x^(n+1) in place of xⁿ), and the nodes next to the deeper valley may
// not be the lowest. Of 2000 such approaches the lowest node alone misses 16, two valleys miss
// none, and a third valley changes nothing in 20 000.
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
  // The lowest node is in a valley even if costs are equal.
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
  // Without the noise the prior of the offset had no weight; with it the minimum may be at a very
  // different node.
  if (start.offset_fraction != fraction) cost = grid_costs(sums, start.offset_fraction);
  for (std::size_t j = 0; j < cost.size(); ++j) {
    cost[j] += problem.exponent_penalty(sums.exponent(j), start.variance);
  }
  return valleys(sums, cost, start);
}

// The slope of J without the prior on n, and half its Gauss–Newton curvature: the entry of JᵀJ for
// n after the linear part is projected out. The linear part includes the prior on c/k: if v carries
// no information beyond ξ, the curvature without that prior is rounding error, and so are Newton's
// steps.
struct Curve {
  double slope;
  double half_curvature;
};

// dJ/dn = θᵀA'θ − 2b'ᵀθ: because θ minimises J, the change of θ does not contribute.
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
  // Elimination, because the determinant underflows if columns are small.
  double projected = 0.0;
  if (a11 > smallest_sum) {
    projected = h1 * h1 / a11;
    const double pivot = a22 - a12 * a12 / a11, rest = h2 - h1 * a12 / a11;
    if (damped && pivot > 0.0) projected += rest * rest / pivot;
  }
  return {quadratic - 2.0 * (k * d[pf] + c * d[pwf]), std::max(h - projected, 0.0)};
}

// Not inlined: a replay would contain it a dozen times and take three times as long to compile.
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
  // The parabola's vertex is at most a tenth of a step away, and each Newton step shrinks by a
  // factor of a hundred or more: three reach 1e-8. The fourth is for starts at an earlier solution.
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

class ProjectionFit {
 public:
  // Keeps references: both arguments must outlive this object.
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

  // The minimum near a recent solution, in whose basin it still lies.
  ProjectionSolution solve_near(const ProjectionSolution& earlier) const noexcept {
    const double variance = earlier.prior_variance;
    const SearchStart start{earlier.n, variance, problem().offset_fraction(variance)};
    if (problem().exponent_known()) return answer(point_at_known(start), start);
    return answer(refine(problem(), start), start);
  }

  // The fractions of Information::prior_fractions at a solution, with its root.
  Vector<4> prior_fractions(const ProjectionSolution& s) const noexcept {
    const ProjectionPoint point{s.n, sums_.at(s.n), {s.k, s.c, s.offset, s.cost, true}};
    const Matrix<5> samples = information(problem(), point);
    return Information(samples, problem(), s.k, s.root_variance, 0.0).prior_fractions();
  }

 private:
  ProjectionProblem problem() const noexcept { return {sums_, settings_}; }

  // With a known exponent the problem is linear and needs no search.
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

  // Refines with priors that are weighted by the residual at the minimum. In the search they are
  // weighted by the cost of the lowest node, which is (0.05/SE(n))² σ² above the minimum if noise
  // is small: an offset prior with five times its weight changed the result by a standard error.
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
    // The lower bound on the residual is the rounding of Σ F², a few ε.
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

// The Hunt–Crossley law by variable projection from every sample that is passed to it.
class ProjectionSolver {
 public:
  using Settings = ProjectionSettings;

  explicit ProjectionSolver(const Settings& settings) noexcept
      : settings_(settings), sums_(empty_sums(settings)) {}

  // Samples in contact according to the gate, in the range of the law: positive depth and force.
  static ContactGate::Settings gate(const ContactGate::Settings& given, const Units&) noexcept {
    return given;
  }
  static bool in_range(const Sample& s) noexcept { return touching(s); }

  void add(const Sample& sample, double forgetting_factor) noexcept {
    sums_.add(sample, forgetting_factor);
  }

  double weight() const noexcept { return sums_.weight(); }  // number of samples, after forgetting
  double lowest_exponent() const noexcept { return sums_.lowest(); }
  double highest_exponent() const noexcept { return sums_.highest(); }

  Vector<4> prior_fractions(const ProjectionSolution& solution) const noexcept {
    return ProjectionFit(sums_, settings_).prior_fractions(solution);
  }

  // Centres the priors on an old solution with these deviations.
  void set_prior(const ProjectionSolution& old, double exponent_deviation,
                 double dissipation_deviation) noexcept {
    centre_priors(settings_, old, exponent_deviation, dissipation_deviation);
    settings_.offset_deviation = offset_deviation(old);
  }

  // Forgets the samples; the priors remain.
  void clear() noexcept { sums_.clear(); }

  // The global minimum over the whole range of exponents. Not inlined: a replay would contain the
  // search a dozen times, in every kind of estimator.
  [[gnu::noinline]] ProjectionSolution solve() const noexcept {
    return ProjectionFit(sums_, settings_).solve();
  }

  // The minimum near a recent solution, in whose basin it still lies.
  [[gnu::noinline]] ProjectionSolution solve_near(
      const ProjectionSolution& earlier) const noexcept {
    return ProjectionFit(sums_, settings_).solve_near(earlier);
  }

 private:
  Settings settings_;
  PowerSums sums_;
};

}  // namespace palpate::detail
