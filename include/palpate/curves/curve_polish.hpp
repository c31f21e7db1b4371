// For n near 1 and below every sample that the surface passes makes a kink, and J has many minima:
// the lowest is looked for along the direction in which the surface is known worst.
#pragma once

#include <cmath>
#include <cstddef>

#include "palpate/curves/curve_condensed.hpp"
#include "palpate/curves/curve_cost.hpp"
#include "palpate/curves/curve_minimum.hpp"

namespace palpate::detail {

// A line through a minimum, and how far one standard error of the surface is along it.
struct CurveLine {
  Vector<5> deviation{};
  bool sound = false;

  CurveLine(const CurveCost& cost, const CurveState& state) noexcept {
    const CurveCost::Slope slope = cost.slope(state);
    const CurveStep along = solve_open(slope.information, slope.information,
                                       {0.0, 0.0, 0.0, 0.0, 1.0}, cost.model().open(), 1e-12);
    sound = along.by[4] > 0.0;
    if (!sound) return;
    const double unit = std::sqrt(state.variance / along.by[4]);
    for (std::size_t i = 0; i < 5; ++i) deviation[i] = unit * along.by[i];
  }
};

inline constexpr double polish_steps[] = {0.3, 0.7, 1.2, 1.8, 2.5};

// The lowest minimum that descents from places on the line come to, but for the one at its centre.
inline CurveMinimum lowest_beside(const CurveCost& cost, const CurveMinimum& centre,
                                  const CurveLine& line, double aim, double elsewhere,
                                  double apart) noexcept {
  constexpr double tolerance = 1e-8;
  const CurveDescent descent(cost);
  // At n = 1 and below descents are slow, from kink to kink.
  const int passes = centre.at[2] < 1.0 ? 40 : 25;
  CurveMinimum lowest = centre;
  for (const double step : polish_steps) {
    for (const double side : {-1.0, 1.0}) {
      CurvePoint start = centre.at;
      for (std::size_t i = 0; i < 5; ++i) start[i] += side * step * line.deviation[i];
      const CurveAbandon abandon{lowest.at, std::min(aim, lowest.cost), 1e-4 * line.deviation[4], elsewhere, apart};
      const CurveMinimum here = descent.from(descent.bounded(start), passes, tolerance, abandon);
      if (std::abs(here.at[2] - elsewhere) < apart) continue;
      if (here.cost < lowest.cost) lowest = here;
    }
  }
  return lowest;
}

inline CurveMinimum polished(const CurveModel& model, const CurveData& data, CurveMinimum best,
                             const CurveSamples& memory, double aim, double elsewhere = 0.0,
                             double apart = 0.0) noexcept {
  constexpr double tolerance = 1e-8;
  constexpr double reach = 1.4;
  const CurveCost cost(model, data);
  for (int round = 0; round < 2; ++round) {
    best.state = cost.at(best.at);
    const CurveLine line(cost, best.state);
    if (!line.sound) break;
    const CondensedCurve condensed(model, data, best.state, reach * 2.5 * line.deviation[4],
                                   memory);
    const CurveCost quick(model, condensed.data());
    const CurveMinimum beside = lowest_beside(quick, best, line, aim, elsewhere, apart);
    if (!(beside.cost < std::min(aim, best.cost) - 1e-6 * best.state.variance)) break;
    const CurveMinimum here = CurveDescent(cost).from(beside.at, 40, tolerance);
    if (!(here.cost < best.cost)) break;
    const bool better = here.cost < best.cost - 1e-6 * best.state.variance;
    best = here;
    if (!better) break;
  }
  return best;
}

}  // namespace palpate::detail
