// The minimum of J over the exponent n and over what is second, and how well it is known.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/error_widening.hpp"
#include "palpate/matrix.hpp"
#include "palpate/viscoelastic/problem.hpp"
#include "palpate/viscoelastic/solution.hpp"

namespace palpate::viscoelastic {

// Differences of J, and of the linear part, by a step either way along the axes that are searched.
struct Differences {
  std::array<double, 2> slope{};          // of J, half of first ones
  Matrix<2> curvature{};                  // of J, second ones
  std::array<Vector<parts>, 2> linear{};  // first ones
};

template <class Sums>
Differences differences(const Problem<Sums>& problem, const Point& middle,
                        const std::array<double, 2>& step, bool mixed = true) noexcept {
  const auto at = [&](double along, double across) noexcept {
    return problem.at(
        {middle.place.exponent + along * step[0], middle.place.second + across * step[1]});
  };
  const std::array<bool, 2> searched{problem.searches_exponent(), problem.searches_memory()};
  Differences found;
  double sides = 0.0;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (!searched[axis]) continue;
    const Point below = axis == 0 ? at(-1.0, 0.0) : at(0.0, -1.0);
    const Point above = axis == 0 ? at(1.0, 0.0) : at(0.0, 1.0);
    found.slope[axis] = 0.5 * (above.cost - below.cost);
    found.curvature[axis][axis] = above.cost - 2.0 * middle.cost + below.cost;
    sides += above.cost + below.cost;
    for (std::size_t i = 0; i < parts; ++i) {
      found.linear[axis][i] = above.linear.value[i] - below.linear.value[i];
    }
  }
  if (mixed && searched[0] && searched[1]) {
    found.curvature[0][1] = found.curvature[1][0] =
        0.5 * (at(1.0, 1.0).cost + at(-1.0, -1.0).cost - sides + 2.0 * middle.cost);
  }
  return found;
}

// The minimum of J over the exponent n and, where a candidate has one, over its relaxation time or
// the exponent of its spectrum; in steps that are short enough for a control loop.
template <class Sums>
class Search {
 public:
  // Over the whole range.
  void begin() noexcept {
    place_ = {};
    cost_ = 1e300;
    row_ = round_ = 0;
    // Every second node is looked at, so that a minimum is a step off at most.
    step_ = 1.0;
  }

  // From an answer of a little while ago, that few steps lead on from.
  void begin_near(const Place& place) noexcept {
    place_ = place;
    row_ = rows;
    round_ = 0;
    step_ = least_step;
  }

  // A dozen evaluations or so; true when it is done.
  [[gnu::noinline]] bool advance(const Problem<Sums>& problem) noexcept {
    if (row_ < rows) {
      do {
        look_along_row(problem);
      } while (row_ < rows && !problem.searches_memory());
      return false;
    }
    Point middle = problem.at(place_);
    bool done = !problem.searches_exponent() && !problem.searches_memory();
    const std::size_t rounds = problem.searches_memory() ? 2 : most_rounds;
    for (std::size_t i = 0; i < rounds && !done; ++i) done = refine(problem, middle);
    keep(middle);
    return done;
  }

  const Place& place() const noexcept { return place_; }
  double spring() const noexcept { return spring_; }  // k there
  // Second derivatives of J along either axis, per node, where it was looked at last.
  const Place& curvature() const noexcept { return curvature_; }

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
    spring_ = point.linear.value[stiffness];
  }

  void look_along_row(const Problem<Sums>& problem) noexcept {
    const double exponent = 2.0 * static_cast<double>(row_);
    for (double second = 0.0; second <= problem.last_second(); second += 2.0) {
      const Point found = problem.at({exponent, second});
      if (found.cost < cost_) keep(found);
    }
    row_ = problem.searches_exponent() ? row_ + 1 : rows;
  }

  // A centre about which a step either way is within the grid. A spectrum may rise as well as fall.
  Place within(const Problem<Sums>& problem, const Place& place) const noexcept {
    const double last = static_cast<double>(Grid::exponents - 1);
    const double margin = problem.law.memory == Memory::power_law ? 0.0 : step_;
    const double end = problem.last_second();
    return {problem.searches_exponent() ? std::clamp(place.exponent, step_, last - step_)
                                        : place.exponent,
            problem.searches_memory() ? std::clamp(place.second, margin, end - margin) : 0.0};
  }

  // Where Newton's step leads, in steps.
  Place newton(const Differences& seen, const Place& centre) const noexcept {
    const auto [g1, g2] = seen.slope;
    const double h11 = seen.curvature[0][0], h12 = seen.curvature[0][1];
    const double h22 = seen.curvature[1][1], determinant = h11 * h22 - h12 * h12;
    double d1 = downhill(g1, h11), d2 = downhill(g2, h22);
    if (h11 > 0.0 && determinant > 1e-6 * h11 * h22) {
      d1 = (h12 * g2 - h22 * g1) / determinant;
      d2 = (h12 * g1 - h11 * g2) / determinant;
      // At an end of the range the other moves alone.
      if (centre.second + d2 * step_ < 0.0) {
        d2 = -centre.second / step_;
        d1 = -(g1 + h12 * d2) / h11;
      }
    }
    return {d1, d2};
  }

  // One of Newton's steps by differences; true when it is done.
  bool refine(const Problem<Sums>& problem, Point& middle) noexcept {
    const Place centre = within(problem, middle.place);
    if (centre != middle.place) middle = problem.at(centre);
    const Differences seen = differences(problem, middle, {step_, step_});
    const Place move = newton(seen, centre);
    curvature_ = {seen.curvature[0][0] / (step_ * step_), seen.curvature[1][1] / (step_ * step_)};
    constexpr double longest = 1.5;
    const double largest = std::max(std::abs(move.exponent), std::abs(move.second));
    const double taken = step_ * (largest > longest ? longest / largest : 1.0);
    const Place next = within(
        problem, {centre.exponent + taken * move.exponent, centre.second + taken * move.second});
    if (largest < 0.5 && step_ <= least_step && !problem.searches_memory()) {
      // The vertex of a parabola that is known so well needs no proof.
      middle.place = next;
      return true;
    }
    const Point there = problem.at(next);
    // A step that leads up, as from a saddle, is not taken; the next one is shorter.
    const bool better = there.cost <= middle.cost;
    if (better) middle = there;
    if (largest < 0.5 || !better) {
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

  Place place_{};  // the best so far, …
  double cost_ = 0.0;
  double spring_ = 0.0;
  Place curvature_{};
  double step_ = 0.0;
  std::uint32_t row_ = 0;
  std::uint32_t round_ = 0;
};

// 2σ²H⁻¹ per node of differences H, and what is not seen at all as wide as its range.
inline Matrix<2> spread_of(const Matrix<2>& h, const std::array<bool, 2>& searched,
                           const std::array<double, 2>& step, double variance) noexcept {
  const double widest = 16.0;  // (1/0.25)² nodes: n ~ N(1.3, 1)
  Matrix<2> spread{};
  const double determinant = h[0][0] * h[1][1] - h[0][1] * h[0][1];
  if (searched[0] && searched[1] && h[0][0] > 0.0 && determinant > 1e-9 * h[0][0] * h[1][1]) {
    const double factor = 2.0 * variance / determinant;
    spread[0][0] = factor * h[1][1] * step[0] * step[0];
    spread[1][1] = factor * h[0][0] * step[1] * step[1];
    spread[0][1] = spread[1][0] = -factor * h[0][1] * step[0] * step[1];
  } else {
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (!searched[axis]) continue;
      const double curvature = h[axis][axis];
      spread[axis][axis] =
          curvature > 0.0 ? 2.0 * variance / curvature * step[axis] * step[axis] : widest;
    }
  }
  detail::bound_variances(spread, widest);
  return spread;
}

// How well a minimum is known: the covariance of all unknowns there,
//
//   Var(n, s) = 2 σ² H⁻¹ of J with the linear part projected out,
//   Var(k, c, m, F₀) = σ² A⁻¹ + D Var(n, s) Dᵀ,   D = ∂(k, c, m, F₀)/∂(n, s),
//
// H and D by differences over about a standard error, where J has risen by σ². `about` is what a
// search saw of the curvature, per node; 0 where it saw nothing.
template <class Sums>
Matrix<unknowns> covariance_of(const Problem<Sums>& problem, const Point& minimum,
                               const Normal& normal, double variance, const Place& about) noexcept {
  const std::array<bool, 2> searched{problem.searches_exponent(), problem.searches_memory()};
  std::array<double, 2> step{0.125, 0.125};
  const std::array<double, 2> seen{about.exponent, about.second};
  const auto unseen = [&](std::size_t axis) { return searched[axis] && !(seen[axis] > 0.0); };
  const Differences rough =
      unseen(0) || unseen(1) ? differences(problem, minimum, step, false) : Differences{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (!searched[axis]) continue;
    const double curvature =
        unseen(axis) ? rough.curvature[axis][axis] / (step[axis] * step[axis]) : seen[axis];
    constexpr double least = 1.0 / 64.0, most = 0.5;
    if (curvature > 0.0) {
      step[axis] = std::clamp(std::sqrt(2.0 * variance / curvature), least, most);
    }
  }
  Place centre = minimum.place;
  const double last = static_cast<double>(Grid::exponents - 1);
  if (searched[0]) centre.exponent = std::clamp(centre.exponent, step[0], last - step[0]);
  const Differences near =
      differences(problem, centre == minimum.place ? minimum : problem.at(centre), step);
  const Matrix<2> spread = spread_of(near.curvature, searched, step, variance);
  // D. A part that a bound holds on one side only has the slope of the other.
  std::array<Vector<parts>, 2> slope{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    for (std::size_t i = 0; i < parts; ++i)
      slope[axis][i] = near.linear[axis][i] / (2.0 * step[axis]);
  }

  const Factored factored(normal, problem.wanted());
  const Matrix<parts> inverse = factored.inverse();
  Matrix<unknowns> result{};
  for (std::size_t i = 0; i < parts; ++i) {
    for (std::size_t j = 0; j < parts; ++j) {
      double sum = variance * inverse[i][j];
      for (std::size_t a = 0; a < 2; ++a) {
        for (std::size_t b = 0; b < 2; ++b) sum += slope[a][i] * spread[a][b] * slope[b][j];
      }
      result[i][j] = sum;
    }
    for (std::size_t a = 0; a < 2; ++a) {
      const double sum = spread[a][0] * slope[0][i] + spread[a][1] * slope[1][i];
      result[i][parts + a] = result[parts + a][i] = sum;
    }
    // Nothing is known of a part that says what others do.
    const Part part = static_cast<Part>(i);
    if (has(problem.wanted(), part) && !has(factored.fitted(), part)) {
      const double size = part == offset ? 1.0 : std::abs(minimum.linear.value[stiffness]) + 1.0;
      result[i][i] = size * size;
    }
  }
  for (std::size_t a = 0; a < 2; ++a) {
    for (std::size_t b = 0; b < 2; ++b) result[parts + a][parts + b] = spread[a][b];
  }
  return result;
}

// Which law it is, of candidates that are fitted to the same samples:
//
//   score = N_eff ln(RSS/N) + 2 p ln N_eff
//
// The least wins: Schwarz's criterion with twice the penalty, and as many samples as noise of the
// residual's correlation leaves (docs/viscoelastic.md).
template <std::size_t Count>
struct Verdict {
  std::array<double, Count> mean_square{};  // RSS/N; 0 of what does not compete
  double effective = 0.0;                   // N_eff

  // The candidate that leaves least, and that of the least score; `Count` where none competes.
  std::size_t closest() const noexcept {
    return least([this](std::size_t i) noexcept { return mean_square[i]; });
  }
  std::size_t chosen() const noexcept {
    const std::size_t by = closest();
    return least([this, by](std::size_t i) noexcept { return score(i, by); });
  }

  // The score less N_eff ln of the least RSS/N.
  double score(std::size_t candidate, std::size_t by) const noexcept {
    return effective * std::log(mean_square[candidate] / mean_square[by]) +
           2.0 * candidates[candidate].parameters() * std::log(effective);
  }

 private:
  template <class Of>
  std::size_t least(Of of) const noexcept {
    std::size_t result = Count;
    double smallest = 0.0;
    for (std::size_t i = 0; i < Count; ++i) {
      if (!(mean_square[i] > 0.0)) continue;
      const double value = of(i);
      if (result != Count && !(value < smallest)) continue;
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
