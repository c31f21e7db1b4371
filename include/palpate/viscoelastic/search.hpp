// The search for the minimum of J over the exponent n, its covariance, and the selection of the
// law.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/error_widening.hpp"
#include "palpate/matrix.hpp"
#include "palpate/viscoelastic/problem.hpp"

namespace palpate::viscoelastic {

// Finds the minimum of J over the exponent n in steps that are short enough for a control loop.
class Search {
 public:
  // Begins a search over the whole range.
  void begin(PartSet near) noexcept {
    place_ = 0.0;
    cost_ = 1e300;
    near_ = near;
    row_ = round_ = 0;
    // Every second node is evaluated, so that the minimum is at most one step away.
    step_ = 1.0;
  }

  // Begins at a recent minimum, from which few steps are needed.
  void begin_near(double place, PartSet near) noexcept {
    place_ = place;
    near_ = near;
    row_ = rows;
    round_ = 0;
    step_ = least_step;
  }

  // Advances the search: about 24 evaluations without memory, one to four with it. True when it has
  // converged.
  [[gnu::noinline]] bool advance(const Problem& problem) noexcept {
    const bool quick = !problem.law.remembers();
    if (row_ < rows) {
      do {
        look_at_row(problem);
      } while (row_ < rows && quick);
      return false;
    }
    Point middle = problem.at(place_, near_);
    bool done = !problem.searches_exponent();
    const std::size_t rounds = quick ? most_rounds : 1;
    for (std::size_t i = 0; i < rounds && !done; ++i) done = refine(problem, middle);
    keep(middle);
    return done;
  }

  double place() const noexcept { return place_; }
  // The parts that are above 0 at the minimum, and the total stiffness k + Σ mᵢ.
  PartSet near() const noexcept { return near_; }
  double spring() const noexcept { return spring_; }
  // The second derivative of J, per node squared, at the last evaluation.
  double curvature() const noexcept { return curvature_; }

 private:
  static constexpr std::uint32_t rows = Grid::exponents / 2;
  static constexpr std::uint32_t most_rounds = 10;
  // A 64th of a node is 0.004 in n: a vertex within half of that is accurate to 1e-5 or better.
  static constexpr double least_step = 1.0 / 64.0;
  // Upper limit of a growing step, for a previous minimum that is further away than expected.
  static constexpr double grown_step = 1.0 / 8.0;

  void keep(const Point& point) noexcept {
    place_ = point.place;
    cost_ = point.cost;
    near_ = point.linear.fitted;
    spring_ = point.linear.value[stiffness];
    for (std::size_t i = memory; i < parts; ++i) spring_ += point.linear.value[i];
  }

  void look_at_row(const Problem& problem) noexcept {
    const Point found = problem.at(2.0 * static_cast<double>(row_), near_);
    if (found.cost < cost_) keep(found);
    row_ = problem.searches_exponent() ? row_ + 1 : rows;
  }

  // Clamps a centre so that a step in either direction stays within the grid.
  double within(double place) const noexcept {
    return std::clamp(place, step_, static_cast<double>(Grid::exponents - 1) - step_);
  }

  // One Newton step by finite differences; true when it has converged.
  bool refine(const Problem& problem, Point& middle) noexcept {
    const double centre = within(middle.place);
    if (centre != middle.place) middle = problem.at(centre, middle.linear.fitted);
    const Point below = problem.at(centre - step_, middle.linear.fitted);
    const Point above = problem.at(centre + step_, middle.linear.fitted);
    const double slope = 0.5 * (above.cost - below.cost);
    const double curvature = above.cost - 2.0 * middle.cost + below.cost;
    curvature_ = curvature / (step_ * step_);
    constexpr double longest = 1.5;
    const double move = downhill(slope, curvature), largest = std::abs(move);
    const double next = within(centre + step_ * std::clamp(move, -longest, longest));
    if (largest < 0.5 && step_ <= least_step && !problem.law.remembers()) {
      // The vertex of a parabola this accurate needs no further evaluation.
      middle.place = next;
      return true;
    }
    const Point there = problem.at(next, middle.linear.fitted);
    // A step that increases the cost is rejected; the next step is shorter.
    const bool better = there.cost <= middle.cost;
    if (better) middle = there;
    // At an end of the grid the step cannot move the centre: a shorter step comes nearer to the
    // end.
    if (largest < 0.5 || !better || next == centre) {
      if (step_ <= least_step) return true;
      step_ = std::max(0.25 * step_, least_step);
    } else if (largest > longest && step_ < grown_step) {
      step_ = std::min(4.0 * step_, grown_step);
    }
    return ++round_ >= most_rounds;
  }

  // The step to the vertex of the parabola, or the longest step where the curvature is not
  // positive.
  static double downhill(double slope, double curvature) noexcept {
    if (curvature > 0.0) return -slope / curvature;
    return slope > 0.0 ? -1.5 : slope < 0.0 ? 1.5 : 0.0;
  }

  double place_ = 0.0;  // the best place so far
  double cost_ = 0.0;
  double spring_ = 0.0;
  double curvature_ = 0.0;
  double step_ = 0.0;
  PartSet near_ = 0;
  std::uint32_t row_ = 0;
  std::uint32_t round_ = 0;
  std::uint32_t unused_ = 0;  // padding made explicit, so that no saved state has any
};

// The unknowns: the linear parts, then n in nodes of the grid.
inline constexpr std::size_t unknowns = parts + 1;
inline constexpr std::size_t exponent_node = parts;

// The covariance of all unknowns at a minimum,
//
//   Var(n) = 2 σ²/H of J with the linear part projected out,
//   Var(p) = σ² A⁻¹ + d Var(n) dᵀ,   d = ∂p/∂n,
//
// for the parts above 0 and for the damper. The damper's column stays free, since a damper held at
// 0 would have an error bar of 0. H and d are finite differences over about one standard error,
// where J has risen by σ². `about` is the curvature from the search, per node squared; 0: none.
inline Matrix<unknowns> covariance_of(const Problem& problem, const Point& minimum, double variance,
                                      double about) noexcept {
  const PartSet wanted = problem.wanted();
  const PartSet held = problem.constrained() & ~minimum.linear.fitted & ~bit(damping);
  const PartSet open = wanted & ~held;
  Matrix<unknowns> result{};
  Vector<parts> slope{};
  double spread = 0.0;
  if (problem.searches_exponent()) {
    const auto differ = [&](double centre, double step) noexcept {
      return std::array<Point, 3>{problem.with_parts(centre - step, open),
                                  problem.with_parts(centre, open),
                                  problem.with_parts(centre + step, open)};
    };
    const auto bend = [](const std::array<Point, 3>& at) noexcept {
      return at[0].cost - 2.0 * at[1].cost + at[2].cost;
    };
    const double last = static_cast<double>(Grid::exponents - 1);
    const auto centre = [&](double step) noexcept {
      return std::clamp(minimum.place, step, last - step);
    };
    double step = 0.125;
    const double curvature = about > 0.0 ? about : bend(differ(centre(step), step)) / (step * step);
    constexpr double least = 1.0 / 64.0, most = 0.5;
    if (curvature > 0.0) step = std::clamp(std::sqrt(2.0 * variance / curvature), least, most);
    const auto near = differ(centre(step), step);
    constexpr double widest = 16.0;  // (1/0.25)² nodes: n ~ N(1.3, 1)
    const double bent = bend(near);
    spread = bent > 0.0 ? std::min(2.0 * variance / bent * step * step, widest) : widest;
    for (std::size_t i = 0; i < parts; ++i) {
      slope[i] = (near[2].linear.value[i] - near[0].linear.value[i]) / (2.0 * step);
    }
  }
  const Factored factored(problem.normal(minimum.place), open);
  const Matrix<parts> inverse = factored.inverse();
  for (std::size_t i = 0; i < parts; ++i) {
    for (std::size_t j = 0; j < parts; ++j) {
      result[i][j] = variance * inverse[i][j] + slope[i] * spread * slope[j];
    }
    result[i][exponent_node] = result[exponent_node][i] = slope[i] * spread;
    // A part that is collinear with others is undetermined.
    if (has(open, i) && !has(factored.fitted(), i)) {
      const double size = i == offset ? 1.0 : std::abs(minimum.linear.value[stiffness]) + 1.0;
      result[i][i] = size * size;
    }
  }
  result[exponent_node][exponent_node] = spread;
  return result;
}

// Selection of the law from candidates that are fitted to the same samples:
//
//   score = N_eff ln(RSS/N) + 2 p ln N_eff
//
// The lowest score is selected: Schwarz's criterion with twice the penalty, and with the effective
// sample size for correlated residuals (docs/explain/relaxation.md). A law with memory must also
// have an rms residual below `clearly` times that of the others, because faults of the velocity or
// of a filter look like memory. On a one-way motion at nearly constant speed all laws are functions
// of the depth alone and any may win; then the Hunt–Crossley law is selected.
struct Verdict {
  static constexpr std::size_t count = candidates.size();
  static constexpr double clearly = 0.95;

  std::array<double, count> mean_square{};  // RSS/N; 0 for candidates that do not compete
  std::array<double, count> parameters{};   // fitted numbers, with F₀
  double effective = 0.0;                   // N_eff

  // The candidate with the lowest residual, and the one with the lowest score; `count` if none
  // competes.
  std::size_t closest() const noexcept {
    return least([this](std::size_t i) noexcept { return mean_square[i]; }, 0, count);
  }
  std::size_t chosen(bool one_way) const noexcept {
    if (one_way && mean_square[hunt_crossley] > 0.0) return hunt_crossley;
    const std::size_t by = closest();
    const auto of = [this, by](std::size_t i) noexcept { return score(i, by); };
    constexpr std::size_t first = std::countr_one(forgetful);
    const std::size_t plain = least(of, 0, first), relaxing = least(of, first, count);
    if (plain == count || relaxing == count) return std::min(plain, relaxing);
    const bool clear = mean_square[relaxing] < clearly * clearly * mean_square[plain];
    if (!clear || !(of(relaxing) < of(plain))) return plain;
    // Among the laws with memory the number of parameters counts as equal, whichever happen to be
    // above 0. With the damper at 0 all damping forms are the same law and rounding would choose:
    // the first is taken.
    const auto logarithm = [this](std::size_t i) noexcept { return std::log(mean_square[i]); };
    return least(logarithm, first, count, 1e-6);
  }

  // The score minus N_eff ln of the lowest RSS/N.
  double score(std::size_t candidate, std::size_t by) const noexcept {
    return effective * std::log(mean_square[candidate] / mean_square[by]) +
           2.0 * parameters[candidate] * std::log(effective);
  }

 private:
  // The first candidate that no later one undercuts by more than a margin.
  template <class Of>
  std::size_t least(Of of, std::size_t begin, std::size_t end, double margin = 0.0) const noexcept {
    std::size_t result = count;
    double smallest = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      if (!(mean_square[i] > 0.0)) continue;
      const double value = of(i);
      if (result != count && !(value < smallest - margin)) continue;
      result = i;
      smallest = value;
    }
    return result;
  }
};

// The correlation of the residuals: the inflation that the verdict uses, and the widening of the
// error bars.
class ResidualNoise {
 public:
  // Adds the one-step prediction error of a fit at a depth. Errors beyond four standard deviations
  // count as four, because at depths that are new to the fit they are not noise.
  void add(double depth, double error, double variance, double forgetting_factor) noexcept {
    const double limit = variance > 0.0 ? std::min(4.0 * std::sqrt(variance), largest) : largest;
    levels_.add({depth}, std::clamp(error, -limit, limit), forgetting_factor);
  }

  void clear() noexcept { levels_.clear(); }
  bool sound() const noexcept { return levels_.sound(); }

  // The best fit has changed, and the variance of its residual is `ratio` times the old one. The
  // correlation of its noise shows only in later errors. Until then it is assumed equal to that of
  // the noise so far, which counts as a quarter so that new errors soon outweigh it. The assumption
  // of white noise gave ten times the evidence.
  void succeed(double ratio) noexcept { levels_.scale_residuals(std::sqrt(ratio), 0.25); }

  // Measures with the variance of the residual, or with that of the errors if it is smaller: the
  // correlation of the noise must not depend on where the law fits worst, such as at the touch
  // before a long hold.
  [[gnu::noinline]] void measure(double whole_variance) noexcept {
    const double own = levels_.residual_variance();
    const double variance = own > 0.0 ? std::min(whole_variance, own) : whole_variance;
    const detail::LevelNoise noise(levels_, variance, {1.0});
    // Beyond the slowest measured level, the few available pairs are pooled, reduced by the
    // standard deviation of so few. Error bars extrapolate; a selection criterion that did so would
    // find no law in a short record.
    double energy = 0.0, pairs = 0.0;
    for (std::size_t k = noise.measured; k < noise.used; ++k) {
      energy += double{levels_[k].older};
      pairs += double{levels_[k].older_pairs};
    }
    const double few = pairs > 0.0 ? energy / (variance * (pairs + std::sqrt(2.0 * pairs))) : 1.0;
    const double slowest =
        std::max(noise.measured > 0 ? noise.ratio[noise.measured - 1] : 1.0, few);
    // The mean of all samples has no partner and is excluded: the offset absorbs it.
    double whole = 0.0, wider = 0.0;
    for (std::size_t k = 0; k < noise.used; ++k) {
      const double information = levels_[k].information[0][0];
      whole += information;
      wider += information * (k < noise.measured ? noise.ratio[k] : slowest);
    }
    const bool measured = noise.measured > 0 && whole > 0.0;
    inflation_ = measured ? std::max(wider / whole, 1.0) : 1.0;
    const detail::ErrorWidening<1, 1, float> widening(levels_, {0.0}, variance);
    const double root = widening.root({{{1.0}}})[0][0];
    widening_ = std::max(root * root, inflation_);
  }

  // Σ d_k D_k / σ² Σ D_k with the depth as the only slope: that number of correlated samples
  // carries the information of one sample with white noise.
  double inflation() const noexcept { return inflation_; }

  // The inflation of variances, widened for the few blocks that it is measured from.
  double widening() const noexcept { return widening_; }

 private:
  // In units of force; its square still fits a float.
  static constexpr double largest = 1e10;

  // Floats suffice: the sums of squares are needed to a hundredth only.
  detail::HaarLevels<1, float> levels_;
  double inflation_ = 1.0;
  double widening_ = 1.0;
};

}  // namespace palpate::viscoelastic
