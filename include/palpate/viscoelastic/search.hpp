// The minimum of J over the exponent n and over what is second, and how well it is known.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

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

}  // namespace palpate::viscoelastic
