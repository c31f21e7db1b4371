// Error bars of a curve's fit: those of variable projection (covariance.hpp), from
// the final residuals.
#pragma once

#include <array>
#include <cstddef>

#include "palpate/curves/curve_cost.hpp"
#include "palpate/haar_levels.hpp"
#include "palpate/matrix.hpp"
#include "palpate/projection/covariance.hpp"

namespace palpate::detail {

// Slopes and residuals by how quickly they change, of a whole contact at once; `columns` are (ξ,
// ξw, ξ ln ξ, r) in the order of time, and are overwritten. The slope of F₀, one, is the same at
// all speeds but the slowest.
inline HaarLevels<4> haar_levels(const std::array<double*, 4>& columns,
                                 std::size_t samples) noexcept {
  HaarLevels<4> levels;
  double length = 1.0;
  std::size_t count = samples;
  for (std::size_t k = 0; k < HaarLevels<4>::most && count > 0; ++k, length *= 2.0) {
    HaarLevel<4>& level = levels[k];
    const std::size_t pairs = count / 2;
    const double per_pair = 0.5 / length;
    const auto [a, b, c, r] = columns;
    std::array<std::array<double, 2>, 7> sums{};  // two of each, for two additions at once
    const auto pair = [&](std::size_t i, std::size_t lane) noexcept {
      const double da = a[2 * i] - a[2 * i + 1], db = b[2 * i] - b[2 * i + 1];
      const double dc = c[2 * i] - c[2 * i + 1], dr = r[2 * i] - r[2 * i + 1];
      a[i] = a[2 * i] + a[2 * i + 1];
      b[i] = b[2 * i] + b[2 * i + 1];
      c[i] = c[2 * i] + c[2 * i + 1];
      r[i] = r[2 * i] + r[2 * i + 1];
      sums[0][lane] += da * da;
      sums[1][lane] += da * db;
      sums[2][lane] += da * dc;
      sums[3][lane] += db * db;
      sums[4][lane] += db * dc;
      sums[5][lane] += dc * dc;
      sums[6][lane] += dr * dr;
    };
    if (count % 2 == 1) {
      const std::size_t last = count - 1;
      levels.wait(k);
      level.half = {a[last], b[last], c[last], length};
      level.half_residual = r[last];
    }
    std::size_t i = 0;
    for (; i + 1 < pairs; i += 2) {
      pair(i, 0);
      pair(i + 1, 1);
    }
    if (i < pairs) pair(i, 0);
    const auto sum = [&](std::size_t j) noexcept { return (sums[j][0] + sums[j][1]) * per_pair; };
    level.information[0] = {sum(0), sum(1), sum(2), 0.0};
    level.information[1] = {0.0, sum(3), sum(4), 0.0};
    level.information[2] = {0.0, 0.0, sum(5), 0.0};
    level.older = level.newer = sum(6);
    level.older_pairs = level.newer_pairs = static_cast<double>(pairs);
    count = pairs;
  }
  return levels;
}

// A minimum as the answer of a projection, without the error bars of correlated residuals.
// `depth_spread` is that of ln ξ.
inline ProjectionSolution solution_of(const CurveCost& cost, const CurveState& state,
                                      const Information& known, double noise_variance,
                                      double variance, double depth_spread) noexcept {
  const CurveModel& model = cost.model();
  ProjectionSolution p{};
  p.k = state.at[0];
  p.c = state.at[1];
  p.n = state.at[2];
  p.offset = state.at[3];
  p.surface = state.at[4];
  p.noise_variance = noise_variance;
  p.root_variance = variance;
  const InverseRoot<5> inverse = known.covariance_root();
  p.root = inverse.root;
  say_identifiable(p, inverse.guarded, model.priors(), depth_spread);
  p.at_edge = model.priors().at_edge(p.n);
  // Within half of a candidate's step of the recursion.
  const double margin = model.surface_range() / 80.0;
  p.surface_found = !model.finds_surface() || (p.surface >= model.lowest_surface + margin &&
                                               p.surface <= model.highest_surface - margin);
  return p;
}

}  // namespace palpate::detail
