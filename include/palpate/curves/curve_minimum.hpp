// The nearest minimum of a curve's cost by damped Newton steps in all that is fitted.
//
// Where JᵀJ − Σ r ∇²f is not positive definite, as for n < 2 with samples just below the surface,
// JᵀJ + λ diag is taken. Valleys are bent: after a step that is cut short or refused the linear
// part is solved anew where it ended.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/curves/curve_cost.hpp"
#include "palpate/matrix.hpp"

namespace palpate::detail {

struct CurveMinimum {
  CurveState state;  // at the last point that was looked at …
  CurvePoint at;     // … and after the last step from it
  double cost;       // J there
  int passes;
  bool settled;
  bool latest;  // the residuals in the arrays are those of `state`
};

// When a descent is not worth its end: it leads to a minimum that is known, or to none below it.
struct CurveAbandon {
  CurvePoint at{};    // the known minimum …
  double cost = 0.0;  // … and J there
  double near = 0.0;  // of its surface; 0: no descent is abandoned
  // The exponent of a valley that is looked through by itself, and how far it reaches.
  double elsewhere = 0.0;
  double apart = 0.0;
};

// x of A x = b for the open coordinates, and whether A is positive definite; scaled to a unit
// diagonal by that of `sizes`.
struct CurveStep {
  Vector<5> by{};
  bool sound = true;
};

inline CurveStep solve_open(const Matrix<5>& a, const Matrix<5>& sizes, const Vector<5>& b,
                            const std::array<bool, 5>& open, double damping) noexcept {
  Vector<5> unit{}, right{}, pivots{};
  Matrix<5> lower{};
  std::array<std::size_t, 5> index{};
  std::size_t size = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    if (!open[i] || !(sizes[i][i] > 0.0)) continue;
    unit[size] = 1.0 / std::sqrt(sizes[i][i]);
    index[size++] = i;
  }
  CurveStep step;
  for (std::size_t j = 0; j < size; ++j) {
    for (std::size_t i = j; i < size; ++i) {
      double entry = a[index[i]][index[j]] * unit[i] * unit[j];
      if (i == j) entry += damping;
      for (std::size_t m = 0; m < j; ++m) entry -= lower[i][m] * lower[j][m] * pivots[m];
      if (i == j) {
        constexpr double least = 1e-13;  // below it a pivot is rounding
        if (!(entry > least)) {
          step.sound = false;
          entry = 1.0;
        }
        pivots[j] = entry;
        lower[j][j] = 1.0;
      } else {
        lower[i][j] = entry / pivots[j];
      }
    }
  }
  for (std::size_t i = 0; i < size; ++i) {
    right[i] = b[index[i]] * unit[i];
    for (std::size_t m = 0; m < i; ++m) right[i] -= lower[i][m] * right[m];
  }
  for (std::size_t i = size; i-- > 0;) {
    right[i] /= pivots[i];
    for (std::size_t m = i + 1; m < size; ++m) right[i] -= lower[m][i] * right[m];
  }
  for (std::size_t i = 0; i < size; ++i) step.by[index[i]] = right[i] * unit[i];
  return step;
}

class CurveDescent {
 public:
  explicit CurveDescent(const CurveCost& cost) noexcept : CurveDescent(cost, cost.model().open()) {}

  // With a coordinate that is not open held where each descent starts.
  CurveDescent(const CurveCost& cost, const std::array<bool, 5>& open) noexcept
      : cost_(cost),
        open_(open),
        lowest_(cost.model().lowest()),
        highest_(cost.model().highest()) {}

  // `tolerance` ends it: what the next step would take off J, in σ².
  CurveMinimum from(const CurvePoint& start, int most_passes, double tolerance,
                    const CurveAbandon& abandon = {}) const noexcept {
    CurveMinimum found{cost_.at(start), start, 0.0, 1, false, true};
    double damping = 0.0, fall = 0.0, fall_before = 0.0;
    while (true) {
      const CurveState& here = found.state;
      const CurveCost::Slope slope = cost_.slope(here);
      const std::array<bool, 5> free = not_held(here.at, slope.gradient);
      const Planned step = plan(slope, free, damping);
      const double gain = -dot(slope.gradient, step.by);
      // The error after Newton's step is that before it squared.
      const double enough = step.newton && !step.cut ? 1e3 * tolerance : tolerance;
      if (!step.cut && gain < enough * here.variance / cost_.data().per_point) {
        found.at = bounded(moved(here.at, step.by));
        found.settled = true;
        break;
      }
      found.at = here.at;
      if (found.passes >= most_passes) break;
      if (std::abs(here.at[2] - abandon.elsewhere) < abandon.apart) break;
      if (abandon.near > 0.0 && !step.cut) {
        const double ahead = here.at[4] + step.by[4];
        const double above = cost_.value(here, here.variance) - abandon.cost;
        if (std::abs(ahead - abandon.at[4]) < abandon.near) break;
        // Not even if all that follow were like the better of the last two, once the first have
        // come down into the valley; what Newton's step promises of a bent valley may be ten times
        // too little.
        const double left = static_cast<double>(most_passes - found.passes);
        const double hope = std::max(10.0 * gain, left * std::max(fall, fall_before));
        if (found.passes >= 5 && hope < above) break;
      }
      const CurvePoint target = moved(here.at, step.by);
      const CurvePoint trial = bounded(target);
      CurveState there = cost_.at(trial);
      ++found.passes;
      found.latest = true;
      const double before = cost_.value(here, here.variance);
      const bool short_of_it = step.cut || trial != target;
      bool better = cost_.value(there, here.variance) < before;
      if (short_of_it || !better) {
        CurveState again = cost_.at(with_linear_part(there));
        ++found.passes;
        const double other = cost_.value(again, here.variance);
        if (other < cost_.value(there, here.variance)) {
          there = again;
        } else {
          found.latest = false;
        }
        better = cost_.value(there, here.variance) < before;
      }
      if (better) {
        fall_before = fall;
        fall = before - cost_.value(there, here.variance);
        found.state = there;
        damping = damping > 1e-3 ? 0.1 * damping : 0.0;
      } else {
        found.latest = false;
        damping = std::max(1e-3, 10.0 * damping);
        if (damping > 1e8) {  // no step makes it less: it is there, but for rounding
          found.settled = true;
          break;
        }
      }
    }
    found.cost = cost_.value(found.state, found.state.variance);
    return found;
  }

  // What Newton's step would take off J, and where to; and the variance of F₀ by JᵀJ.
  struct Gain {
    bool sound;
    double gain;
    Vector<5> by;
    double offset_variance;
  };

  Gain gain(const CurveState& state) const noexcept {
    const CurveCost::Slope slope = cost_.slope(state);
    const Planned step = plan(slope, open_, 0.0);
    const CurveStep offset =
        solve_open(slope.information, slope.information, {0.0, 0.0, 0.0, 1.0, 0.0}, open_, 1e-12);
    return {step.newton && !step.cut, -dot(slope.gradient, step.by), step.by,
            std::max(offset.by[3], 0.0) * state.variance};
  }

  CurvePoint bounded(CurvePoint z) const noexcept {
    for (const std::size_t i : {std::size_t{2}, std::size_t{4}}) {
      z[i] = std::clamp(z[i], lowest_[i], highest_[i]);
    }
    return z;
  }

  // The same point with k, c and F₀ as they are best there: the law is linear in them.
  CurvePoint with_linear_part(const CurveState& state) const noexcept {
    std::array<bool, 5> linear = open_;
    linear[2] = linear[4] = false;
    const CurveCost::Slope slope = cost_.slope(state);
    const Vector<5> down = negative(slope.gradient);
    const CurveStep step = solve_open(slope.information, slope.information, down, linear, 1e-13);
    return step.sound ? moved(state.at, step.by) : state.at;
  }

 private:
  struct Planned {
    Vector<5> by;
    bool newton;
    bool cut;
  };

  // A bound that the slope pushes against holds its coordinate.
  std::array<bool, 5> not_held(const CurvePoint& z, const Vector<5>& gradient) const noexcept {
    std::array<bool, 5> free = open_;
    for (const std::size_t i : {std::size_t{2}, std::size_t{4}}) {
      if (z[i] <= lowest_[i] && gradient[i] > 0.0) free[i] = false;
      if (z[i] >= highest_[i] && gradient[i] < 0.0) free[i] = false;
    }
    return free;
  }

  Planned plan(const CurveCost::Slope& slope, const std::array<bool, 5>& free,
               double damping) const noexcept {
    const Vector<5> down = negative(slope.gradient);
    Planned planned{{}, damping == 0.0, false};
    if (planned.newton) {
      Matrix<5> hessian = slope.information;
      for (std::size_t i = 0; i < 5; ++i) {
        for (std::size_t j = 0; j < 5; ++j) hessian[i][j] -= slope.curvature[i][j];
      }
      const CurveStep step = solve_open(hessian, slope.information, down, free, 0.0);
      // Near a saddle it is hardly positive definite, and its step goes far for next to nothing.
      const double gain = dot(down, step.by);
      planned.newton =
          step.sound && dot(step.by, multiply(slope.information, step.by)) < 10.0 * gain;
      planned.by = step.by;
    }
    if (!planned.newton) {
      const double least = std::max(damping, 1e-12);
      CurveStep step = solve_open(slope.information, slope.information, down, free, least);
      if (!step.sound) {
        step = solve_open(slope.information, slope.information, down, free, least + 1e-3);
      }
      planned.by = step.by;
    }
    // Beyond these a quadratic form says little of the cost.
    const double width = highest_[4] - lowest_[4];
    const double far = std::max(std::abs(planned.by[2]) / 0.4,
                                width > 0.0 ? std::abs(planned.by[4]) / (0.15 * width) : 0.0);
    planned.cut = !(far <= 1.0);
    if (planned.cut) {
      for (double& entry : planned.by) entry /= far;
    }
    return planned;
  }

  static CurvePoint moved(CurvePoint z, const Vector<5>& by) noexcept {
    for (std::size_t i = 0; i < 5; ++i) z[i] += by[i];
    return z;
  }

  static Vector<5> negative(Vector<5> v) noexcept {
    for (double& entry : v) entry = -entry;
    return v;
  }

  const CurveCost& cost_;
  std::array<bool, 5> open_;
  std::array<double, 5> lowest_;
  std::array<double, 5> highest_;
};

}  // namespace palpate::detail
