// The minimum of J over the exponent n and, where a candidate has one, over its relaxation time or
// the exponent of its spectrum; in steps that are short enough for a control loop.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/viscoelastic/problem.hpp"

namespace palpate::viscoelastic {

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

  // Differences of J by a step either way.
  struct Slopes {
    double g1 = 0.0, g2 = 0.0;               // half of first ones
    double h11 = 0.0, h22 = 0.0, h12 = 0.0;  // second ones
  };
  Slopes slopes_about(const Problem<Sums>& problem, const Point& middle) const noexcept {
    const auto cost = [&](double along, double across) noexcept {
      return problem
          .at({middle.place.exponent + along * step_, middle.place.second + across * step_})
          .cost;
    };
    const bool along = problem.searches_exponent(), across = problem.searches_memory();
    Slopes s;
    double sides = 0.0;
    if (along) {
      const double below = cost(-1.0, 0.0), above = cost(1.0, 0.0);
      s.g1 = 0.5 * (above - below);
      s.h11 = above - 2.0 * middle.cost + below;
      sides += above + below;
    }
    if (across) {
      const double below = cost(0.0, -1.0), above = cost(0.0, 1.0);
      s.g2 = 0.5 * (above - below);
      s.h22 = above - 2.0 * middle.cost + below;
      sides += above + below;
    }
    if (along && across) {
      s.h12 = 0.5 * (cost(1.0, 1.0) + cost(-1.0, -1.0) - sides + 2.0 * middle.cost);
    }
    return s;
  }

  // Where Newton's step leads, in steps.
  Place newton(const Slopes& s, const Place& centre) const noexcept {
    double d1 = downhill(s.g1, s.h11), d2 = downhill(s.g2, s.h22);
    const double determinant = s.h11 * s.h22 - s.h12 * s.h12;
    if (s.h11 > 0.0 && determinant > 1e-6 * s.h11 * s.h22) {
      d1 = (s.h12 * s.g2 - s.h22 * s.g1) / determinant;
      d2 = (s.h12 * s.g1 - s.h11 * s.g2) / determinant;
      // At an end of the range the other moves alone.
      if (centre.second + d2 * step_ < 0.0) {
        d2 = -centre.second / step_;
        d1 = -(s.g1 + s.h12 * d2) / s.h11;
      }
    }
    return {d1, d2};
  }

  // One of Newton's steps by differences; true when it is done.
  bool refine(const Problem<Sums>& problem, Point& middle) noexcept {
    const Place centre = within(problem, middle.place);
    if (centre != middle.place) middle = problem.at(centre);
    const Slopes seen = slopes_about(problem, middle);
    const Place move = newton(seen, centre);
    curvature_ = {seen.h11 / (step_ * step_), seen.h22 / (step_ * step_)};
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

}  // namespace palpate::viscoelastic
