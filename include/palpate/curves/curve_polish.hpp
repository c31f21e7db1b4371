// The lowest minimum where J has many: for n near 1 and below every sample that the surface passes
// makes a kink. They are looked for along the direction in which the surface is known worst.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "palpate/curves/curve_cost.hpp"
#include "palpate/curves/curve_minimum.hpp"

namespace palpate::detail {

// The cost of a curve about one point by fewer samples: those near the surface one by one, since
// each that the surface passes is a kink of J, and means of the others.
//
// A mean stands where the law has the same mean residual at that point, and what means leave of J
// and of its slope there is added as a linear form: so J and its slope are the whole curve's at the
// point, and within two standard errors of it J is so to a thousandth of σ² mostly, to a tenth in
// 99 of 100 descents where the surface is known worst.
class CondensedCurve {
 public:
  // `at` is a state of the cost over all samples, whose residuals are in the arrays of `data`;
  // `reach` how far the surface may go from it, and `memory` is as large as those arrays.
  CondensedCurve(const CurveModel& model, const CurveData& data, const CurveState& at, double reach,
                 const CurveSamples& memory) noexcept
      : data_(data) {
    const CurveSamples& from = data.parts[0];
    const double surface = at.at[4];
    const auto mean = [&](std::size_t first) noexcept {
      return condenses(from, first, surface, reach);
    };
    std::size_t means = 0;
    for (std::size_t i = 0; i + length <= from.count; i += length) means += mean(i) ? 1 : 0;
    const std::size_t start = CurveSamples::padded(from.count - length * means);
    CurveSamples near = memory, far{memory.x + start,   memory.w + start,        memory.f + start,
                                    memory.log + start, memory.residual + start, 0};
    near.count = 0;
    for (std::size_t i = 0; i < from.count; i += length) {
      if (i + length <= from.count && mean(i)) {
        add_mean(from, from.residual, i, length, far);  // in place of the force
      } else {
        add_all(from, i, near);
      }
    }
    near.pad();
    far.pad();
    force_as_residual(model, at.at, far);
    data_.parts = {near, far};
    data_.used = 2;
    data_.weight = {1.0, static_cast<double>(length)};
    const CurveState rough = CurveCost(model, data_).at(at.at);
    data_.tangent.at = at.at;
    data_.tangent.squares = at.sums.squares - rough.sums.squares;
    for (std::size_t i = 0; i < 5; ++i) {
      data_.tangent.gradient[i] = at.sums.gradient[i] - rough.sums.gradient[i];
    }
  }

  const CurveData& data() const noexcept { return data_; }

 private:
  // Samples of a mean. (Of 2000 one-way curves two lost their minimum with 16, and none with 8.)
  static constexpr std::size_t length = 8;

  // Samples that stay above the surface, or so far below it that xⁿ hardly bends among them.
  static bool condenses(const CurveSamples& from, std::size_t first, double surface,
                        double reach) noexcept {
    double low = from.x[first], high = low;
    for (std::size_t i = first + 1; i < first + length; ++i) {
      low = std::min(low, from.x[i]);
      high = std::max(high, from.x[i]);
    }
    constexpr double least = 4.0;  // of depth, in spreads: (1 + 1/8)ⁿ still bends little
    return high < surface - reach || low - (surface + reach) > least * (high - low);
  }

  static void add_all(const CurveSamples& from, std::size_t first, CurveSamples& to) noexcept {
    for (std::size_t i = first; i < std::min(first + length, from.count); ++i) {
      to.x[to.count] = from.x[i];
      to.w[to.count] = from.w[i];
      to.f[to.count] = from.f[i];
      ++to.count;
    }
  }

  // Adds the law's force to each: what a pass leaves of r is r less that force.
  static void force_as_residual(const CurveModel& model, const CurvePoint& at,
                                const CurveSamples& means) noexcept {
    curve_sums(means, at, true, *model.kernels);
    for (std::size_t i = 0; i < means.count; ++i) {
      means.f[i] += means.f[i] - means.residual[i];
    }
  }

  CurveData data_;
};

// A line through a minimum, and how far along it the surface is one standard error away.
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

  CurvePoint from(CurvePoint centre, double deviations) const noexcept {
    for (std::size_t i = 0; i < 5; ++i) centre[i] += deviations * deviation[i];
    return centre;
  }
};

// What is worth finding: a cost below this, outside of a valley that is looked through by itself.
struct CurveGoal {
  double cost;
  double elsewhere = 0.0;  // the exponent of that valley …
  double apart = 0.0;      // … and how far it reaches; 0: there is none
};

class CurvePolish {
 public:
  // `memory` is as large as the arrays of `data`.
  CurvePolish(const CurveModel& model, const CurveData& data, const CurveSamples& memory) noexcept
      : model_(model), data_(data), memory_(memory), cost_(model, data) {}

  CurveMinimum operator()(CurveMinimum best, const CurveGoal& goal) const noexcept {
    for (int round = 0; round < 2; ++round) {
      best.state = cost_.at(best.at);
      const CurveLine line(cost_, best.state);
      if (!line.sound) break;
      // Minima lie beyond the places that descents start from, too.
      // Descents end beyond where they start. (With 1.4 one in 400 lost its minimum.)
      const double reach = 2.0 * farthest * line.deviation[4];
      const CondensedCurve condensed(model_, data_, best.state, reach, memory_);
      const CurveMinimum beside = lowest_beside({model_, condensed.data()}, best, line, goal);
      const double enough = 1e-6 * best.state.variance;
      if (!(beside.cost < std::min(goal.cost, best.cost) - enough)) break;
      const CurveMinimum here = CurveDescent(cost_).from(beside.at, 40, tolerance);
      const bool better = here.cost < best.cost - enough;
      if (here.cost < best.cost) best = here;
      if (!better) break;
    }
    return best.at[2] < 1.0 || !best.settled ? lowest_at_samples(best) : best;
  }

 private:
  static constexpr double farthest = 2.5;  // standard errors
  static constexpr double steps[] = {0.3, 0.7, 1.2, 1.8, farthest};
  static constexpr double tolerance = 1e-8;

  // The lowest minimum that descents from places on the line come to.
  static CurveMinimum lowest_beside(const CurveCost& cost, const CurveMinimum& centre,
                                    const CurveLine& line, const CurveGoal& goal) noexcept {
    const CurveDescent descent(cost);
    // At n = 1 and below descents are slow, from kink to kink.
    const int passes = centre.at[2] < 1.0 ? 40 : 25;
    CurveMinimum lowest = centre;
    for (const double step : steps) {
      for (const double side : {-1.0, 1.0}) {
        const CurvePoint start = line.from(centre.at, side * step);
        const CurveAbandon abandon{lowest.at, std::min(goal.cost, lowest.cost),
                                   1e-4 * line.deviation[4], goal.elsewhere, goal.apart};
        const CurveMinimum here = descent.from(descent.bounded(start), passes, tolerance, abandon);
        if (std::abs(here.at[2] - goal.elsewhere) < goal.apart) continue;
        if (here.cost < lowest.cost) lowest = here;
      }
    }
    return lowest;
  }

  // Below n = 1 the slope is infinite where the surface comes to a sample from above, and J may be
  // least just there, where no step of Newton's ends.
  CurveMinimum lowest_at_samples(const CurveMinimum& least) const noexcept {
    constexpr double none = std::numeric_limits<double>::infinity();
    const CurveSamples& samples = data_.parts[0];
    double above = -none, below = none;  // the depths nearest to the surface
    for (std::size_t i = 0; i < samples.count; ++i) {
      const double x = samples.x[i], surface = least.at[4];
      above = x <= surface ? std::max(above, x) : above;
      below = x > surface ? std::min(below, x) : below;
    }
    std::array<bool, 5> open = model_.open();
    open[4] = false;
    const CurveDescent descent(cost_, open);
    CurveMinimum lowest = least;
    for (const double depth : {above, below}) {
      CurvePoint start = least.at;
      start[4] = depth;
      if (descent.bounded(start) != start) continue;
      CurveMinimum here = descent.from(start, 25, tolerance);
      // From n = 1 on it is lower there, but goes on.
      here.settled = here.settled && here.at[2] < 1.0;
      if (here.cost < lowest.cost) lowest = here;
    }
    return lowest;
  }

  const CurveModel& model_;
  const CurveData& data_;
  const CurveSamples& memory_;
  CurveCost cost_;
};

}  // namespace palpate::detail
