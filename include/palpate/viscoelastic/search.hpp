// The minimum of J over the exponent n, and how well it is known.
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

// The minimum of J over the exponent n, in steps that are short enough for a control loop.
class Search {
 public:
  // Over the whole range.
  void begin(PartSet near) noexcept {
    place_ = 0.0;
    cost_ = 1e300;
    near_ = near;
    row_ = round_ = 0;
    // Every second node is looked at, so that a minimum is a step off at most.
    step_ = 1.0;
  }

  // From an answer of a little while ago, that few steps lead on from.
  void begin_near(double place, PartSet near) noexcept {
    place_ = place;
    near_ = near;
    row_ = rows;
    round_ = 0;
    step_ = least_step;
  }

  // Two dozen evaluations without memory, and one or four with; true when it is done.
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
  // The parts that are above 0 there, and the spring.
  PartSet near() const noexcept { return near_; }
  double spring() const noexcept { return spring_; }
  // The second derivative of J, per node, where it was looked at last.
  double curvature() const noexcept { return curvature_; }

 private:
  static constexpr std::uint32_t rows = Grid::exponents / 2;
  static constexpr std::uint32_t most_rounds = 10;
  // A 64th of a node is 0.004 in n: a vertex within half of that is known to 1e-5 and better.
  static constexpr double least_step = 1.0 / 64.0;
  // Of a step that grows, as an answer of a while ago is further away than it seemed.
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

  // A centre about which a step either way is within the grid.
  double within(double place) const noexcept {
    return std::clamp(place, step_, static_cast<double>(Grid::exponents - 1) - step_);
  }

  // One of Newton's steps by differences; true when it is done.
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
      // The vertex of a parabola that is known so well needs no proof.
      middle.place = next;
      return true;
    }
    const Point there = problem.at(next, middle.linear.fitted);
    // A step that leads up is not taken; the next one is shorter.
    const bool better = there.cost <= middle.cost;
    if (better) middle = there;
    // Nor is one that the end of the grid forbids: a shorter step comes nearer to it.
    if (largest < 0.5 || !better || next == centre) {
      if (step_ <= least_step) return true;
      step_ = std::max(0.25 * step_, least_step);
    } else if (largest > longest && step_ < grown_step) {
      step_ = std::min(4.0 * step_, grown_step);
    }
    return ++round_ >= most_rounds;
  }

  // To the vertex of a parabola, or so far as a step may go.
  static double downhill(double slope, double curvature) noexcept {
    if (curvature > 0.0) return -slope / curvature;
    return slope > 0.0 ? -1.5 : slope < 0.0 ? 1.5 : 0.0;
  }

  double place_ = 0.0;  // the best so far, …
  double cost_ = 0.0;
  double spring_ = 0.0;
  double curvature_ = 0.0;
  double step_ = 0.0;
  PartSet near_ = 0;
  std::uint32_t row_ = 0;
  std::uint32_t round_ = 0;
  std::uint32_t unused_ = 0;  // no saved state has padding
};

// Of the linear parts, and then of n in nodes of the grid.
inline constexpr std::size_t unknowns = parts + 1;
inline constexpr std::size_t exponent_node = parts;

// How well a minimum is known: the covariance of all unknowns there,
//
//   Var(n) = 2 σ²/H of J with the linear part projected out,
//   Var(p) = σ² A⁻¹ + d Var(n) dᵀ,   d = ∂p/∂n,
//
// of the parts that are above 0 and of the damper, whose column stays open: held at 0 it would have
// an error bar of 0. H and d by differences over about a standard error, where J has risen by σ².
// `about` is what a search saw of the curvature, per node; 0 where it saw nothing.
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
    // Nothing is known of a part that says what others do.
    if (has(open, i) && !has(factored.fitted(), i)) {
      const double size = i == offset ? 1.0 : std::abs(minimum.linear.value[stiffness]) + 1.0;
      result[i][i] = size * size;
    }
  }
  result[exponent_node][exponent_node] = spread;
  return result;
}

// Which law it is, of candidates that are fitted to the same samples:
//
//   score = N_eff ln(RSS/N) + 2 p ln N_eff
//
// The least wins: Schwarz's criterion with twice the penalty, and as many samples as noise of the
// residual's correlation leaves (docs/viscoelastic.md). One with memory has to leave less than
// `clearly` of the error of the others too: in a velocity's or a filter's faults it would find
// some. Where the probe went one way at nearly one speed, all of them are functions of the depth
// alone, any may win, and Hunt & Crossley's is as good.
struct Verdict {
  static constexpr std::size_t count = candidates.size();
  static constexpr double clearly = 0.95;

  std::array<double, count> mean_square{};  // RSS/N; 0 of what does not compete
  std::array<double, count> parameters{};   // fitted numbers, with F₀
  double effective = 0.0;                   // N_eff

  // The candidate that leaves least, and that of the least score; `count` where none competes.
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
    // Among those with memory the numbers are as many, whichever happen to be above 0. With a
    // damper at 0 the forms of damping are one law, and rounding would choose: the first is taken.
    const auto logarithm = [this](std::size_t i) noexcept { return std::log(mean_square[i]); };
    return least(logarithm, first, count, 1e-6);
  }

  // The score less N_eff ln of the least RSS/N.
  double score(std::size_t candidate, std::size_t by) const noexcept {
    return effective * std::log(mean_square[candidate] / mean_square[by]) +
           2.0 * parameters[candidate] * std::log(effective);
  }

 private:
  // The first candidate that no later one is below by more than a margin.
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

// How much less than white noise's the samples say: what a verdict and error bars ask of errors.
class ResidualNoise {
 public:
  // The a-priori error of a fit at a depth. Where a fit meets new ground errors are no noise:
  // beyond four deviations they count as four.
  void add(double depth, double error, double variance, double forgetting_factor) noexcept {
    const double limit = variance > 0.0 ? std::min(4.0 * std::sqrt(variance), largest) : largest;
    levels_.add({depth}, std::clamp(error, -limit, limit), forgetting_factor);
  }

  void clear() noexcept { levels_.clear(); }

  // Another fit has become the best, whose residual has so many times the variance. How slow its
  // noise is shows only in errors to come: it is taken for as slow as the noise so far, which
  // counts a quarter, so that its own soon weigh more. Taken for white, it had ten times the
  // evidence.
  void succeed(double ratio) noexcept { levels_.scale_residuals(std::sqrt(ratio), 0.25); }

  // By the variance of the residual; or of the errors themselves where they are smaller: how slow
  // noise is does not depend on where in the samples the law fits worst, as at the touch before a
  // long hold.
  [[gnu::noinline]] void measure(double whole_variance) noexcept {
    const double own = levels_.residual_variance();
    const double variance = own > 0.0 ? std::min(whole_variance, own) : whole_variance;
    const detail::LevelNoise noise(levels_, variance, {1.0});
    // Slower than the slowest that was measured, the few pairs that there are count together, less
    // the deviation of so few: error bars guess how it goes on, but a criterion that did would find
    // no law of a short record.
    double energy = 0.0, pairs = 0.0;
    for (std::size_t k = noise.measured; k < noise.used; ++k) {
      energy += levels_[k].older;
      pairs += levels_[k].older_pairs;
    }
    const double few = pairs > 0.0 ? energy / (variance * (pairs + std::sqrt(2.0 * pairs))) : 1.0;
    const double slowest =
        std::max(noise.measured > 0 ? noise.ratio[noise.measured - 1] : 1.0, few);
    // What has no partner, the mean of all, is not in it: that is what the offset takes.
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

  // Σ d_k D_k / σ² Σ D_k with the depth as the only slope: so many times fewer samples of white
  // noise would say the same.
  double inflation() const noexcept { return inflation_; }

  // Of variances: the same, and by how few blocks it is known from.
  double widening() const noexcept { return widening_; }

 private:
  // In units of force; what floats still square.
  static constexpr double largest = 1e10;

  // Sums of squares that are looked at to a hundredth: floats are enough.
  detail::HaarLevels<1, float> levels_;
  double inflation_ = 1.0;
  double widening_ = 1.0;
};

}  // namespace palpate::viscoelastic
