// The Hunt–Crossley law by variable projection: exact nonlinear least squares in the force domain,
//
//   min over (k, c, F₀, n) of Σ (F − k ξⁿ − c ξⁿ w − F₀)²,   ξ = x/x_r, w = v/V,
//
// with no logarithm, no condition 10 and no starting values. For a fixed n the law is linear in
// (k, c, F₀), so what is left is a function J(n) of one variable: searched over a grid for the
// global minimum, then solved by Newton's method on dJ/dn. See docs/variable-projection.md.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "palpate/estimate.hpp"
#include "palpate/matrix.hpp"
#include "palpate/power_sums.hpp"
#include "palpate/projection.hpp"

namespace palpate {

class VariableProjection {
 public:
  static constexpr bool takes_approach = false;

  struct Settings {
    double noise = 0.0;  // standard deviation of the force in scaled units; 0: from the residual
    double lowest_exponent = 0.3;
    double highest_exponent = 3.6;
    bool offset = true;
    double offset_deviation = 0.0;  // of the prior F₀ ~ N(0, ·²); 0: twenty times the noise
    // Weak priors: n ~ N(1.3, 1) and c/k ~ N(0, 1).
    double prior_exponent = 1.3;
    double prior_exponent_deviation = 1.0;
    double prior_dissipation = 0.0;  // c/k
    double prior_dissipation_deviation = 1.0;
  };

  explicit VariableProjection(const Settings& settings) noexcept
      : settings_(settings), sums_(settings.lowest_exponent, settings.highest_exponent) {}

  void add(const Sample& sample, double forgetting_factor) noexcept {
    sums_.add(sample, forgetting_factor);
  }

  double weight() const noexcept { return sums_.weight(); }  // samples, less what was forgotten
  double lowest_exponent() const noexcept { return sums_.lowest(); }
  double highest_exponent() const noexcept { return sums_.highest(); }

  // Forgets the samples; the prior is the old answer with these deviations.
  void restart(const Projection& old, double exponent_deviation,
               double dissipation_deviation) noexcept {
    settings_.prior_exponent = old.n;
    settings_.prior_exponent_deviation = exponent_deviation;
    settings_.prior_dissipation = old.k > 0.0 ? old.c / old.k : 0.0;
    settings_.prior_dissipation_deviation = dissipation_deviation;
    clear();
  }

  // Forgets the samples and keeps the prior.
  void clear() noexcept { sums_.clear(); }

  // The global minimum over the whole range of exponents.
  Projection solve() const noexcept { return finish(search_grid()); }

  // The same from an answer of a little while ago, in whose basin the minimum still is.
  Projection solve_near(const Projection& earlier) const noexcept {
    return finish({earlier.n, earlier.prior_variance, 0.0, offset_share(earlier.prior_variance)});
  }

 private:
  struct Linear {
    double k, c, offset;
    double cost;  // −bᵀÃ⁻¹b
    bool damped;  // the damping column has a sound pivot
  };

  struct Search {
    double n;
    double variance;        // of the noise, for the weight of the priors
    double damping_weight;  // ρ_b
    double offset_share;    // 1 / (Σ1 + ρ_F); 0 without an offset
  };

  struct Point {
    double n;
    PowerSums::Local sums;
    Linear linear;
  };

  Projection finish(Search search) const noexcept {
    const Point point = refine(search);
    return result(point, search);
  }

  // ρ_F, in samples.
  double offset_weight(double variance) const noexcept {
    const double deviation = settings_.offset_deviation;
    return deviation > 0.0 ? variance / (deviation * deviation) : 1.0 / 400.0;
  }

  double offset_share(double variance) const noexcept {
    return settings_.offset ? 1.0 / (sums_.weight() + offset_weight(variance) + tiny) : 0.0;
  }

  // The linear least squares for one exponent: F₀ is eliminated first, then (k, c) by determinants.
  Linear linear(const PowerSums::Values& s, double damping_weight, double share) const noexcept {
    const double prior = settings_.prior_dissipation;
    const double a11 = s[pp] - s[p1] * s[p1] * share + damping_weight * prior * prior;
    const double a12 = s[ppw] - s[p1] * s[pw] * share - damping_weight * prior;
    const double a22 = s[ppww] - s[pw] * s[pw] * share + damping_weight;
    const double b1 = s[pf] - s[p1] * sums_.force() * share;
    const double b2 = s[pwf] - s[pw] * sums_.force() * share;
    const double determinant = a11 * a22 - a12 * a12;
    const bool damped = determinant > smallest_share * (a11 * a22) && a22 > smallest_sum;
    Linear r{};
    r.damped = damped;
    r.k = damped ? (a22 * b1 - a12 * b2) / determinant : a11 > smallest_sum ? b1 / a11 : 0.0;
    r.c = damped ? (a11 * b2 - a12 * b1) / determinant : 0.0;
    r.offset = share * (sums_.force() - r.k * s[p1] - r.c * s[pw]);
    r.cost = -(r.k * b1 + r.c * b2) - share * sums_.force() * sums_.force();
    return r;
  }

  using Costs = std::array<double, PowerSums::nodes>;

  // J over the grid without priors on (k, c), in one straight line of arithmetic; −share (ΣF)², the
  // same for all, is left out.
  Costs grid_costs(double share) const noexcept {
    Costs cost;
    const auto &spp = sums_.column(pp), &sppw = sums_.column(ppw), &sppww = sums_.column(ppww),
               &sp = sums_.column(p1), &spw = sums_.column(pw), &spf = sums_.column(pf),
               &spwf = sums_.column(pwf);
    const double total = sums_.force();
    for (std::size_t j = 0; j < PowerSums::nodes; ++j) {
      const double a11 = spp[j] - sp[j] * sp[j] * share;
      const double a12 = sppw[j] - sp[j] * spw[j] * share;
      const double a22 = sppww[j] - spw[j] * spw[j] * share;
      const double b1 = spf[j] - sp[j] * total * share;
      const double b2 = spwf[j] - spw[j] * total * share;
      // b₁²/a₁₁ + (what damping adds), with one division; ridge keeps a column that is not there
      // out.
      const double ridge = smallest_share * a22 + 1e-30 * a11;
      const double rest = b2 * a11 - b1 * a12;
      const double determinant = a11 * (a22 + ridge) - a12 * a12;
      cost[j] = -(b1 * b1 * determinant + rest * rest) / (a11 * determinant + tiny);
    }
    return cost;
  }

  static std::size_t lowest(const Costs& cost) noexcept {
    std::size_t best = 0;
    for (std::size_t j = 1; j < PowerSums::nodes; ++j) {
      if (cost[j] < cost[best]) best = j;
    }
    return best;
  }

  Search search_grid() const noexcept {
    const double share = offset_share(settings_.noise * settings_.noise), total = sums_.force();
    Costs cost = grid_costs(share);
    std::size_t best = lowest(cost);
    Search search{};
    search.variance = prior_variance(cost[best] - share * total * total);
    search.offset_share = offset_share(search.variance);
    // While the noise was unknown the prior of the offset had no weight; with it the minimum may be
    // at quite another node.
    if (search.offset_share != share) cost = grid_costs(search.offset_share);
    for (std::size_t j = 0; j < PowerSums::nodes; ++j) {
      const double away =
          (sums_.exponent(j) - settings_.prior_exponent) / settings_.prior_exponent_deviation;
      cost[j] += search.variance * away * away;
    }
    best = lowest(cost);
    search.n = sums_.exponent(best);
    if (best > 0 && best + 1 < PowerSums::nodes) {
      const double bend = cost[best - 1] - 2.0 * cost[best] + cost[best + 1];
      const double slope = 0.5 * (cost[best + 1] - cost[best - 1]);
      if (bend > std::abs(slope)) search.n -= sums_.step() * slope / bend;
    }
    return search;
  }

  // σ² for the weight of the priors. Few samples fit exactly; the relative floor keeps the priors
  // from vanishing then.
  double prior_variance(double cost) const noexcept {
    if (settings_.noise > 0.0) return settings_.noise * settings_.noise;
    const double n = sums_.weight();
    if (!(sums_.force_squared() > 0.0)) return 1.0;
    const double floor = 1e-4 * sums_.force_squared() / std::max(n, 1.0);
    const double residual = std::max(sums_.force_squared() + cost, 0.0);
    return (residual + 2.0 * floor) / (std::max(n - 4.0, 0.0) + 2.0);
  }

  // Newton's method on dJ/dn with the sums' own derivatives; the curvature is Gauss and Newton's.
  Point refine(Search& search) const noexcept {
    const double exponent_weight = exponent_weight_of(search.variance);
    double n = std::clamp(search.n, sums_.lowest(), sums_.highest());
    Point point{n, sums_.at(n), {}};
    point.linear = linear(point.sums.value, 0.0, search.offset_share);
    search.damping_weight = damping_weight(point.linear.k, search.variance);
    for (int round = 0; round < 4; ++round) {
      point.linear = linear(point.sums.value, search.damping_weight, search.offset_share);
      const Curve curve = curve_at(point, search);
      const double slope =
          curve.slope + 2.0 * exponent_weight * (point.n - settings_.prior_exponent);
      const double bend = 2.0 * (curve.bend + exponent_weight);
      if (!(bend > 0.0)) break;
      const double limit = sums_.step();
      const double step = std::clamp(-slope / bend, -limit, limit);
      const double next = std::clamp(point.n + step, sums_.lowest(), sums_.highest());
      // Steps shrink by a hundred or more, so the one after this would be below 1e-8.
      const bool settled = std::abs(next - point.n) < 1e-6;
      point.n = next;
      point.sums = sums_.at(next);
      if (settled) break;
    }
    point.linear = linear(point.sums.value, search.damping_weight, search.offset_share);
    return point;
  }

  // dJ/dn = θᵀA'θ − 2b'ᵀθ (θ minimises, so its own change does not count), and the Schur complement
  // of the linear part in JᵀJ.
  struct Curve {
    double slope;
    double bend;
  };

  Curve curve_at(const Point& point, const Search& search) const noexcept {
    const Matrix<4> m = information(point, search.variance);
    const auto& [k, c, f0, cost, damped] = point.linear;
    const PowerSums::Values& d = point.sums.first;
    const double quadratic =
        k * k * d[pp] + 2.0 * k * c * d[ppw] + c * c * d[ppww] + 2.0 * f0 * (k * d[p1] + c * d[pw]);
    const double share = search.offset_share;
    const double a11 = m[0][0] - m[0][3] * m[0][3] * share;
    const double a12 = m[0][1] - m[0][3] * m[1][3] * share;
    const double a22 = m[1][1] - m[1][3] * m[1][3] * share;
    const double h1 = m[0][2] - m[0][3] * m[2][3] * share;
    const double h2 = m[1][2] - m[1][3] * m[2][3] * share;
    const double h = m[2][2] - m[2][3] * m[2][3] * share;
    const double determinant = a11 * a22 - a12 * a12;
    const double taken = damped
                             ? (a22 * h1 * h1 - 2.0 * a12 * h1 * h2 + a11 * h2 * h2) / determinant
                         : a11 > smallest_sum ? h1 * h1 / a11
                                              : 0.0;
    return {quadratic - 2.0 * (k * d[pf] + c * d[pwf]), std::max(h - taken, 0.0)};
  }

  // JᵀJ for (k, c, n, F₀), from the sums and their derivatives: Σ ln ξ · p² = (Σ p²)'/2, and so on.
  Matrix<4> information(const Point& point, double variance) const noexcept {
    const PowerSums::Values &v = point.sums.value, &d = point.sums.first;
    const Vector<3>& dd = point.sums.second;
    const double k = point.linear.k, c = point.linear.c;
    Matrix<4> m{};
    m[0] = {v[pp], v[ppw], 0.5 * (k * d[pp] + c * d[ppw]), v[p1]};
    m[1] = {v[ppw], v[ppww], 0.5 * (k * d[ppw] + c * d[ppww]), v[pw]};
    m[2] = {m[0][2], m[1][2], 0.25 * (k * k * dd[pp] + 2.0 * k * c * dd[ppw] + c * c * dd[ppww]),
            k * d[p1] + c * d[pw]};
    m[3] = {v[p1], v[pw], m[2][3], sums_.weight() + offset_weight(variance)};
    return m;
  }

  double damping_weight(double k, double variance) const noexcept {
    const double deviation = settings_.prior_dissipation_deviation * k;
    return std::min(variance / (deviation * deviation + tiny), largest_parameter);
  }

  Projection result(const Point& point, const Search& search) const noexcept {
    const Linear& linear = point.linear;
    const double away = (point.n - settings_.prior_exponent) / settings_.prior_exponent_deviation;
    Projection r{};
    r.k = linear.k;
    r.c = linear.c;
    r.offset = linear.offset;
    r.n = point.n;
    r.noise_variance = r.prior_variance = search.variance;
    r.cost = linear.cost + search.variance * away * away;
    r.at_edge = at_edge(point.n);
    r.surface_found = true;
    const double fitted = settings_.offset ? 4.0 : 3.0;
    const double freedom = sums_.weight() - fitted;
    if (settings_.noise == 0.0 && freedom >= 10.0) {
      // Below rounding of Σ F² there is no residual; a share of it keeps error bars above zero.
      const double rounding = 1e-15 * sums_.force_squared();
      r.noise_variance = std::max(sums_.force_squared() + linear.cost, rounding) / freedom;
    }
    const InverseRoot<4> inverse = covariance_root(point, search, r.noise_variance);
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) r.root[i][j] = inverse.root[i][j];
    }
    r.damping_told = !inverse.guarded[1];
    r.exponent_told =
        !inverse.guarded[2] && !inverse.guarded[3] && sums_.depth_spread() > smallest_spread;
    return r;
  }

  // The error bars take the priors in with the variance that they scale by, so that what the motion
  // does not tell is as uncertain as it was before, whatever the noise.
  InverseRoot<4> covariance_root(const Point& point, Search search,
                                 double variance) const noexcept {
    search.variance = std::max(variance, least_variance());
    search.damping_weight = damping_weight(point.linear.k, search.variance);
    const double prior = settings_.prior_dissipation, weight = search.damping_weight;
    const double exponent_weight = exponent_weight_of(search.variance);
    Matrix<4> m = information(point, search.variance);
    m[0][0] += weight * prior * prior;
    m[0][1] = m[1][0] = m[0][1] - weight * prior;
    m[1][1] += weight;
    m[2][2] += exponent_weight;
    if (!settings_.offset) {
      for (std::size_t i = 0; i < 3; ++i) m[i][3] = m[3][i] = 0.0;
    }
    constexpr double unknown_stiffness = 1e-12;  // k ~ N(0, 1e6²)
    Vector<4> priors{unknown_stiffness * search.variance, weight, exponent_weight,
                     offset_weight(search.variance)};
    // Scaled to a unit diagonal, so that the inverse does not overflow.
    Vector<4> unit{};
    for (std::size_t i = 0; i < 4; ++i) {
      unit[i] = m[i][i] > 0.0 ? 1.0 / std::sqrt(m[i][i]) : 1.0;
      priors[i] = std::max(priors[i] * unit[i] * unit[i], tiny);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) m[i][j] = m[i][j] * unit[i] * unit[j];
    }
    InverseRoot<4> inverse = guarded_inverse_root(m, priors);
    const double deviation = std::sqrt(search.variance);
    for (std::size_t i = 0; i < 4; ++i) {
      for (double& entry : inverse.root[i]) entry = saturate(entry * (unit[i] * deviation));
    }
    if (!settings_.offset) inverse.root[3] = {};
    return inverse;
  }

  // No force sensor is better than a hundred-thousandth; without any force, one unit.
  double least_variance() const noexcept {
    if (!(sums_.force_squared() > 0.0)) return 1.0;
    return 1e-10 * sums_.force_squared() / sums_.weight();
  }

  double exponent_weight_of(double variance) const noexcept {
    return variance / (settings_.prior_exponent_deviation * settings_.prior_exponent_deviation);
  }

  bool at_edge(double n) const noexcept {
    const double margin = 0.25 * sums_.step();
    return n < sums_.lowest() + margin || n > sums_.highest() - margin;
  }

  static constexpr double smallest_share = 1e-13;
  static constexpr double smallest_spread = 1e-4;  // of ln ξ: 1 µm at 10 mm, beyond any sensor
  static constexpr double smallest_sum = 1e-150;   // of squares; below it a column is not there
  static constexpr double tiny = 1e-300;

  Settings settings_;
  PowerSums sums_;
};

}  // namespace palpate
