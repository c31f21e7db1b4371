// Where the minima of a curve's cost are, roughly: over means of consecutive samples, with k, c and
// F₀ projected out.
//
// With the surface known a minimum lies where dJ/dn changes its sign from node to node: nodes 0.28
// apart do not see a valley of width 0.003 by their values, and a one-way approach has several. By
// the envelope theorem only the sums' own derivatives count in dJ/dn.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/curves/curve_cost.hpp"
#include "palpate/curves/curve_sums.hpp"
#include "palpate/projection/linear_solve.hpp"

namespace palpate::detail {

// Means of blocks of equally many consecutive samples; they bend where ξⁿ does, so they only start.
class CurveMeans {
 public:
  static constexpr std::size_t most = 2 * CurveSamples::block;

  // At most `points` of them, of all parts together but for the rounding of each.
  CurveMeans(const CurveData& data, std::size_t points) noexcept {
    const double per_point =
        std::max(1.0, std::ceil(data.count() / static_cast<double>(points - data.used + 1)));
    const auto length = static_cast<std::size_t>(per_point);
    std::size_t count = 0;
    double force_squared = 0.0;
    for (std::size_t part = 0; part < data.used; ++part) {
      const CurveSamples& from = data.parts[part];
      for (std::size_t first = 0; first < from.count; first += length) {
        const std::size_t size = std::min(length, from.count - first);
        double x = 0.0, w = 0.0, f = 0.0;
        for (std::size_t i = first; i < first + size; ++i) {
          x += from.x[i];
          w += from.w[i];
          f += from.f[i];
        }
        const double mean = 1.0 / static_cast<double>(size);
        columns_[0][count] = x * mean;
        columns_[1][count] = w * mean;
        columns_[2][count] = f * mean;
        force_squared += columns_[2][count] * columns_[2][count];
        ++count;
      }
    }
    data_ = {{CurveSamples{columns_[0].data(), columns_[1].data(), columns_[2].data(),
                           columns_[3].data(), columns_[4].data(), count}},
             1,
             force_squared,
             per_point};
    data_.parts[0].pad();
  }
  CurveMeans(const CurveMeans&) = delete;
  CurveMeans& operator=(const CurveMeans&) = delete;

  const CurveData& data() const noexcept { return data_; }
  const CurveSamples& samples() const noexcept { return data_.parts[0]; }

 private:
  alignas(64) std::array<std::array<double, most>, 5> columns_;
  CurveData data_{};
};

// Places to start from, the lowest cost first.
struct CurveStarts {
  static constexpr std::size_t most = 8;

  void add(const CurvePoint& at, double cost) noexcept {
    std::size_t place = std::min(count, most - 1);
    if (count == most && !(cost < costs[place])) return;
    if (count < most) ++count;
    for (; place > 0 && cost < costs[place - 1]; --place) {
      starts[place] = starts[place - 1];
      costs[place] = costs[place - 1];
    }
    starts[place] = at;
    costs[place] = cost;
  }

  std::array<CurvePoint, most> starts{};
  std::array<double, most> costs{};
  std::size_t count = 0;
};

// The linear part at one exponent and surface: its solution, J less Σ F², and half of dJ/dn.
class CurveNode {
 public:
  // Sums of p², p²w, p²w², p, pw, pF, pwF, and then the same with ln ξ.
  static constexpr std::size_t sums = 2 * power_count;
  using Sums = std::array<double, sums>;

  CurveNode(const Sums& s, double total, double fraction, double damping_weight,
            double prior) noexcept {
    auto [a11, a12, a22, b1, b2] =
        normal_equations(s[pp], s[ppw], s[ppww], s[p1], s[pw], s[pf], s[pwf], total, fraction);
    a11 += damping_weight * prior * prior;
    a12 -= damping_weight * prior;
    a22 += damping_weight;
    // The ridge keeps out a column that is not there.
    const double ridge = smallest_fraction * a22 + 1e-30 * a11;
    const double determinant = a11 * (a22 + ridge) - a12 * a12;
    if (a11 > smallest_sum && determinant > 0.0) {
      k = ((a22 + ridge) * b1 - a12 * b2) / determinant;
      c = (a11 * b2 - a12 * b1) / determinant;
    }
    offset = fraction * (total - k * s[p1] - c * s[pw]);
    cost = -(k * b1 + c * b2) - fraction * total * total;
    constexpr std::size_t log = power_count;
    half_slope = k * (k * s[log + pp] + 2.0 * c * s[log + ppw]) + c * c * s[log + ppww] +
                 offset * (k * s[log + p1] + c * s[log + pw]) -
                 (k * s[log + pf] + c * s[log + pwf]);
  }

  double k = 0.0, c = 0.0, offset = 0.0;
  double cost = 0.0;
  double half_slope = 0.0;
};

// Of means: the powers of their depths at evenly spaced exponents, and the sums of those.
class CurveGrid {
 public:
  static constexpr std::size_t most_nodes = 20;

  CurveGrid(const CurveMeans& means, const CurveModel& model) noexcept
      : samples_(means.samples()), model_(model), per_point_(means.data().per_point) {
    const double low = model.settings.lowest_exponent, high = model.settings.highest_exponent;
    // Steps of 0.3 over the default range.
    const double steps = model.priors().exponent_known() ? 0.0 : std::ceil((high - low) / 0.3);
    nodes_ = 1 + static_cast<std::size_t>(steps);
    step_ = nodes_ > 1 ? (high - low) / steps : 0.0;
    for (std::size_t i = 0; i < samples_.count; ++i) total_ += samples_.f[i];
  }

  std::size_t nodes() const noexcept { return nodes_; }
  double total() const noexcept { return total_; }
  double exponent(std::size_t node) const noexcept {
    return model_.settings.lowest_exponent + step_ * static_cast<double>(node);
  }
  double step() const noexcept { return step_; }

  // For a surface, and from an exponent on.
  void place(double surface, double exponent) noexcept {
    model_.kernels->place(samples_.columns(), powers(), surface, exponent, step_);
  }

  // At the present exponent, and on to the next.
  CurveNode::Sums next() noexcept {
    CurveNode::Sums sums{};
    model_.kernels->powers(samples_.columns(), powers(), sums.data());
    return sums;
  }

  // The same with the sums that dJ/dn needs.
  CurveNode::Sums next_with_slopes() noexcept {
    CurveNode::Sums sums{};
    model_.kernels->powers_and_slopes(samples_.columns(), powers(), sums.data());
    return sums;
  }

  // 1/(Σ1 + ρ_F), by which the offset is eliminated.
  double offset_fraction(const CurveCost& cost, double variance) const noexcept {
    if (!model_.settings.offset) return 0.0;
    const double weight = cost.model().priors().offset_weight(variance) / per_point_;
    return 1.0 / (static_cast<double>(samples_.count) + weight + tiny);
  }

  // ρ_b = σ²/(s k)².
  double damping_weight(double k, double variance) const noexcept {
    const double deviation = model_.settings.prior_dissipation_deviation * k;
    return std::min(variance / per_point_ / (deviation * deviation + tiny), largest_parameter);
  }

  double exponent_penalty(double n, double variance) const noexcept {
    if (model_.priors().exponent_known()) return 0.0;
    const double away =
        (n - model_.settings.prior_exponent) / model_.settings.prior_exponent_deviation;
    return variance / per_point_ * away * away;
  }

 private:
  curves::CurvePowers powers() noexcept { return {log_.data(), power_.data(), ratio_.data()}; }

  const CurveSamples& samples_;
  const CurveModel& model_;
  double per_point_;
  std::size_t nodes_ = 1;
  double step_ = 0.0;
  double total_ = 0.0;
  alignas(64) std::array<double, CurveMeans::most> log_;
  alignas(64) std::array<double, CurveMeans::most> power_;
  alignas(64) std::array<double, CurveMeans::most> ratio_;
};

// Every minimum of J(n), the surface being known.
inline CurveStarts known_surface_starts(const CurveMeans& means, const CurveCost& cost) noexcept {
  const CurveModel& model = cost.model();
  CurveGrid grid(means, model);
  const double prior = model.settings.prior_dissipation;
  std::array<CurveNode::Sums, CurveGrid::most_nodes> sums;
  grid.place(0.0, grid.exponent(0));
  double lowest = 0.0;
  const double open = grid.offset_fraction(cost, model.settings.noise * model.settings.noise);
  std::array<double, CurveGrid::most_nodes> stiffness;
  for (std::size_t j = 0; j < grid.nodes(); ++j) {
    sums[j] = grid.next_with_slopes();
    const CurveNode node(sums[j], grid.total(), open, 0.0, prior);
    stiffness[j] = node.k;
    lowest = std::min(lowest, node.cost);
  }
  const double force_squared = means.data().force_squared;
  const double variance = cost.variance(std::max(force_squared + lowest, 0.0));
  const double fraction = grid.offset_fraction(cost, variance);
  const double slope_of_prior =
      1.0 / (means.data().per_point * model.settings.prior_exponent_deviation *
             model.settings.prior_exponent_deviation);
  CurveStarts found;
  const auto solved = [&](const CurveNode::Sums& s, double k) noexcept {
    return CurveNode(s, grid.total(), fraction, grid.damping_weight(k, variance), prior);
  };
  const auto add = [&](double n, const CurveNode& node) noexcept {
    found.add({node.k, node.c, n, node.offset, 0.0},
              force_squared + node.cost + grid.exponent_penalty(n, variance));
  };
  if (grid.nodes() == 1) {
    add(grid.exponent(0), solved(sums[0], stiffness[0]));
    return found;
  }
  std::array<double, CurveGrid::most_nodes> slope;
  const std::size_t last = grid.nodes() - 1;
  for (std::size_t j = 0; j <= last; ++j) {
    const CurveNode node = solved(sums[j], stiffness[j]);
    slope[j] = node.half_slope +
               variance * slope_of_prior * (grid.exponent(j) - model.settings.prior_exponent);
    const bool at_end = (j == 0 && slope[j] > 0.0) || (j == last && slope[j] < 0.0);
    if (at_end) add(grid.exponent(j), node);
  }
  for (std::size_t j = 0; j < last; ++j) {
    if (!(slope[j] <= 0.0 && slope[j + 1] > 0.0)) continue;
    const double part = slope[j] / (slope[j] - slope[j + 1]);
    const double n = grid.exponent(j) + grid.step() * part;
    grid.place(0.0, n);
    const CurveNode::Sums between = grid.next();
    const double k = stiffness[part < 0.5 ? j : j + 1];
    add(n, solved(between, k));
  }
  return found;
}

// The lowest local minima of J(d, n) over a grid.
inline CurveStarts unknown_surface_starts(const CurveMeans& means, const CurveCost& cost) noexcept {
  constexpr std::size_t surfaces = 24, most = 6;
  const CurveModel& model = cost.model();
  CurveGrid grid(means, model);
  const std::size_t nodes = grid.nodes();
  const double step = (model.highest_surface - model.lowest_surface) / (surfaces - 1);
  const double prior = model.settings.prior_dissipation;
  std::array<std::array<CurveNode::Sums, CurveGrid::most_nodes>, surfaces> sums;
  std::array<std::array<double, CurveGrid::most_nodes>, surfaces> costs;
  std::array<std::array<CurvePoint, CurveGrid::most_nodes>, surfaces> points;
  const auto solve = [&](double variance) noexcept {
    const double fraction = grid.offset_fraction(cost, variance);
    double lowest = 0.0;
    for (std::size_t i = 0; i < surfaces; ++i) {
      const double surface = model.lowest_surface + step * static_cast<double>(i);
      for (std::size_t j = 0; j < nodes; ++j) {
        const CurveNode node(sums[i][j], grid.total(), fraction, 0.0, prior);
        points[i][j] = {node.k, node.c, grid.exponent(j), node.offset, surface};
        costs[i][j] = node.cost;
        lowest = std::min(lowest, node.cost);
      }
    }
    return cost.variance(std::max(means.data().force_squared + lowest, 0.0));
  };
  for (std::size_t i = 0; i < surfaces; ++i) {
    grid.place(model.lowest_surface + step * static_cast<double>(i), grid.exponent(0));
    for (std::size_t j = 0; j < nodes; ++j) sums[i][j] = grid.next();
  }
  const double variance = solve(model.settings.noise * model.settings.noise);
  if (model.settings.offset_deviation > 0.0) solve(variance);
  for (std::size_t i = 0; i < surfaces; ++i) {
    for (std::size_t j = 0; j < nodes; ++j) {
      costs[i][j] += means.data().force_squared + grid.exponent_penalty(grid.exponent(j), variance);
    }
  }
  CurveStarts found;
  for (std::size_t i = 0; i < surfaces; ++i) {
    for (std::size_t j = 0; j < nodes; ++j) {
      bool least = true;
      for (std::size_t a = i > 0 ? i - 1 : i; least && a <= std::min(i + 1, surfaces - 1); ++a) {
        for (std::size_t b = j > 0 ? j - 1 : j; least && b <= std::min(j + 1, nodes - 1); ++b) {
          least = !(costs[a][b] < costs[i][j]);
        }
      }
      if (least) found.add(points[i][j], costs[i][j]);
    }
  }
  found.count = std::min(found.count, most);
  return found;
}

}  // namespace palpate::detail
