// The cost of a curve, in scaled units, with forces relative to the mean of the offset's prior:
//
//   J = Σ (F − f)² + σ² [(n − n₀)²/s_n² + (c/k − b₀)²/s_b² + F₀²/s_F²],
//
// over the samples that were selected once, with σ² from the residual at the minimum of J itself:
// the solution is the point where J, with the σ² of that point, is least. See
// docs/reference/curves.md.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/batch_fit/curve_blocks.hpp"
#include "palpate/matrix.hpp"
#include "palpate/projection/covariance.hpp"

namespace palpate::detail {

// The result of one pass over the samples of a curve: Σ r², Jᵀr, JᵀJ and Σ r ∇²f for (k, c, n, F₀,
// d), with
//
//   f = p (k + c w) + F₀,   p = (ξ − d)ⁿ below the surface, 0 above it.
using CurvePoint = Vector<5>;

struct CurveSamples : curves::CurveColumns {
  static constexpr std::size_t block = curves::curve_block;

  static constexpr std::size_t padded(std::size_t count) noexcept {
    return (count + block - 1) / block * block;
  }

  // Fills the last block with samples that have neither force nor depth.
  void pad() const noexcept {
    for (std::size_t i = count; i < padded(count); ++i) {
      x[i] = -1e300;
      w[i] = f[i] = residual[i] = 0.0;
    }
  }
};

inline double squared_force(const CurveSamples& samples) noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < samples.count; ++i) sum += samples.f[i] * samples.f[i];
  return sum;
}

// Appends the mean of `size` samples, with the mean of `third` in place of the force.
inline void add_mean(const CurveSamples& from, const double* third, std::size_t first,
                     std::size_t size, CurveSamples& to) noexcept {
  double x = 0.0, w = 0.0, f = 0.0;
  for (std::size_t i = first; i < first + size; ++i) {
    x += from.x[i];
    w += from.w[i];
    f += third[i];
  }
  const double share = 1.0 / static_cast<double>(size);
  to.x[to.count] = x * share;
  to.w[to.count] = w * share;
  to.f[to.count] = f * share;
  ++to.count;
}

struct CurveSums {
  double squares = 0.0;     // Σ r²
  Vector<5> gradient{};     // Jᵀr
  Matrix<5> information{};  // JᵀJ
  Matrix<5> curvature{};    // Σ r ∇²f

  void include(const CurveSums& other, double weight) noexcept {
    squares += weight * other.squares;
    for (std::size_t i = 0; i < 5; ++i) {
      gradient[i] += weight * other.gradient[i];
      for (std::size_t j = 0; j < 5; ++j) {
        information[i][j] += weight * other.information[i][j];
        curvature[i][j] += weight * other.curvature[i][j];
      }
    }
  }
};

inline CurveSums curve_sums(const CurveSamples& samples, const CurvePoint& at, bool surface,
                            const curves::CurveKernels& kernels) noexcept {
  using namespace curves;
  double s[unknown_sums] = {};
  const CurveLaw law{at[0], at[1], at[2], at[3], at[4]};
  (surface ? kernels.unknown_surface : kernels.known_surface)(samples, law, s);
  CurveSums result;
  result.squares = s[rr];
  result.gradient = {s[rp], s[rpw], s[rn], s[r1], s[rd]};
  Matrix<5>& m = result.information;
  m[0] = {s[p_p], s[p_pw], s[p_n], s[sum_p], s[p_d]};
  m[1] = {0.0, s[pw_pw], s[pw_n], s[sum_pw], s[pw_d]};
  m[2] = {0.0, 0.0, s[n_n], s[sum_n], s[n_d]};
  m[3] = {0.0, 0.0, 0.0, static_cast<double>(samples.count), s[sum_d]};
  m[4][4] = s[d_d];
  const double n = at[2];
  Matrix<5>& h = result.curvature;
  h[0][2] = s[rlp];
  h[1][2] = s[rlpw];
  h[2][2] = s[rln];
  h[0][4] = -n * s[rip];
  h[1][4] = -n * s[ripw];
  h[2][4] = s[rd] / n + s[rld];
  h[4][4] = (1.0 - n) * s[rid];
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      m[i][j] = m[j][i];
      h[i][j] = h[j][i];
    }
  }
  return result;
}

// A correction to Σ r² around a point: a constant, and a form that is linear in the distance.
struct CurveTangent {
  CurvePoint at{};
  double squares = 0.0;
  Vector<5> gradient{};  // of −½ Σ r²
};

// The samples of one cost: the firm ones, and the light ones if they are included.
struct CurveData {
  static constexpr std::size_t most = 2;
  std::array<CurveSamples, most> parts;
  std::size_t used;
  double force_squared;                       // Σ F²
  double per_point = 1.0;                     // samples per point, more than 1 for block means
  std::array<double, most> weight{1.0, 1.0};  // of the samples in a part
  CurveTangent tangent{};

  double count() const noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < used; ++i) sum += weight[i] * static_cast<double>(parts[i].count);
    return sum;
  }
};

// The fitted parameters and their bounds.
struct CurveModel {
  ProjectionSettings settings;
  const curves::CurveKernels* kernels;
  double lowest_surface = 0.0;
  double highest_surface = 0.0;  // the same as the lowest if the surface is known

  Priors priors() const noexcept { return {settings}; }
  double surface_range() const noexcept { return highest_surface - lowest_surface; }
  bool finds_surface() const noexcept { return highest_surface > lowest_surface; }
  std::array<bool, 5> open() const noexcept {
    return {true, true, !(settings.exponent > 0.0), settings.offset, finds_surface()};
  }
  std::array<double, 5> lowest() const noexcept {
    constexpr double none = -largest_parameter;
    return {none, none, settings.lowest_exponent, none, lowest_surface};
  }
  std::array<double, 5> highest() const noexcept {
    constexpr double none = largest_parameter;
    return {none, none, settings.highest_exponent, none, highest_surface};
  }
};

// The sums at a point, for each part and for all samples.
struct CurveState {
  CurvePoint at;
  CurveSums sums;
  std::array<CurveSums, CurveData::most> part;
  double variance;  // σ² of the priors
};

class CurveCost {
 public:
  CurveCost(const CurveModel& model, const CurveData& data) noexcept : model_(model), data_(data) {}

  const CurveModel& model() const noexcept { return model_; }
  const CurveData& data() const noexcept { return data_; }

  CurveState at(const CurvePoint& point) const noexcept {
    CurveState state{point, {}, {}, 0.0};
    for (std::size_t i = 0; i < data_.used; ++i) {
      state.part[i] = curve_sums(data_.parts[i], point, model_.finds_surface(), *model_.kernels);
      state.sums.include(state.part[i], data_.weight[i]);
    }
    const CurveTangent& tangent = data_.tangent;
    state.sums.squares += tangent.squares;
    for (std::size_t i = 0; i < 5; ++i) {
      state.sums.squares -= 2.0 * tangent.gradient[i] * (point[i] - tangent.at[i]);
      state.sums.gradient[i] += tangent.gradient[i];
    }
    state.variance = variance(state.sums.squares);
    return state;
  }

  double variance(double squares) const noexcept {
    return priors().variance(data_.per_point * squares, data_.force_squared, data_.count());
  }

  // J at a point with this value of σ².
  double value(const CurveState& state, double variance) const noexcept {
    return state.sums.squares + penalty(state.at, variance);
  }

  double penalty(const CurvePoint& z, double variance) const noexcept {
    const ProjectionSettings& s = model_.settings;
    const double away = (z[1] / stiff(z[0]) - s.prior_dissipation) / s.prior_dissipation_deviation;
    double sum = priors().exponent_penalty(z[2], variance) + variance * away * away;
    if (s.offset) sum += z[3] * z[3] * priors().offset_weight(variance);
    return sum / data_.per_point;
  }

  // ½ ∂J/∂z, and JᵀJ and the curvature that Newton's method subtracts, both with the priors.
  struct Slope {
    Vector<5> gradient;
    Matrix<5> information;
    Matrix<5> curvature;
  };

  Slope slope(const CurveState& state) const noexcept {
    const ProjectionSettings& s = model_.settings;
    const CurvePoint& z = state.at;
    const double weight = state.variance / data_.per_point;
    Slope r{{}, state.sums.information, state.sums.curvature};
    for (std::size_t i = 0; i < 5; ++i) r.gradient[i] = -state.sums.gradient[i];
    if (!priors().exponent_known()) {
      const double by_n = priors().exponent_weight(weight);
      r.gradient[2] += by_n * (z[2] - s.prior_exponent);
      r.information[2][2] += by_n;
    }
    const double by_b = weight / (s.prior_dissipation_deviation * s.prior_dissipation_deviation);
    const double k = stiff(z[0]), b = z[1] / k, off = b - s.prior_dissipation;
    const Vector<2> u{-b / k, 1.0 / k};
    for (std::size_t i = 0; i < 2; ++i) {
      r.gradient[i] += by_b * off * u[i];
      for (std::size_t j = 0; j < 2; ++j) r.information[i][j] += by_b * u[i] * u[j];
    }
    r.curvature[0][0] -= by_b * off * 2.0 * b / (k * k);
    r.curvature[0][1] += by_b * off / (k * k);
    r.curvature[1][0] += by_b * off / (k * k);
    if (s.offset) {
      const double by_offset = priors().offset_weight(state.variance) / data_.per_point;
      r.gradient[3] += by_offset * z[3];
      r.information[3][3] += by_offset;
    }
    return r;
  }

 private:
  // Keeps a vanishing stiffness from dividing by zero.
  static double stiff(double k) noexcept {
    constexpr double least = 1e-30;
    return k < 0.0 ? std::min(k, -least) : std::max(k, least);
  }

  Priors priors() const noexcept { return model_.priors(); }

  const CurveModel& model_;
  const CurveData& data_;
};

// The nearest minimum of a curve's cost, by damped Newton steps in all fitted parameters.
//
// Where JᵀJ − Σ r ∇²f is not positive definite, as for n < 2 with samples just below the surface,
// JᵀJ + λ diag replaces it. Valleys are curved: after a step that was shortened or rejected, the
// linear part is solved again at its end.
struct CurveMinimum {
  CurveState state;  // at the last evaluated point …
  CurvePoint at;     // … and after the last step from it
  double cost;       // J there
  int passes;
  bool settled;
  bool latest;  // the residuals in the arrays belong to `state`
};

// When to abandon a descent: it leads to a known minimum, or to none below that minimum.
struct CurveAbandon {
  CurvePoint at{};    // the known minimum …
  double cost = 0.0;  // … and J there
  double near = 0.0;  // distance from its surface; 0: no descent is abandoned
  // The exponent in a valley with a separate search, and the half width of the valley in n.
  double elsewhere = 0.0;
  double apart = 0.0;
};

// x in A x = b for the open coordinates, and whether A is positive definite; scaled to a unit
// diagonal of `sizes`.
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
        constexpr double least = 1e-13;  // below this a pivot is rounding error
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

  // A coordinate that is not open stays where each descent starts.
  CurveDescent(const CurveCost& cost, const std::array<bool, 5>& open) noexcept
      : cost_(cost),
        open_(open),
        lowest_(cost.model().lowest()),
        highest_(cost.model().highest()) {}

  // A descent ends once the next step would reduce J by less than `tolerance`, in σ².
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
      // The error after a Newton step is the square of the error before it.
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
        // After five passes, in the valley, abandon the descent if all remaining passes, each as
        // good as the better of the last two, would not suffice. In a curved valley Newton's step
        // may underestimate the reduction tenfold.
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
        if (damping > 1e8) {  // no step reduces it: a minimum, except for rounding
          found.settled = true;
          break;
        }
      }
    }
    found.cost = cost_.value(found.state, found.state.variance);
    return found;
  }

  // The reduction of J by a Newton step, the step, and the variance of F₀ from JᵀJ.
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

  // The same point with the best k, c and F₀ there, in which the law is linear.
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

  // A coordinate is held at a bound that the slope pushes it against.
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
      // Near a saddle it is hardly positive definite, and its step is long for almost no reduction.
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
    // Beyond these lengths a quadratic form does not describe the cost.
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
