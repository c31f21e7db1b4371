// The minimum of J over the exponent n and, where a candidate has one, over its relaxation time or
// the exponent of its spectrum; in steps that are short enough for a control loop.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/projection/free_air.hpp"
#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/linear.hpp"
#include "palpate/viscoelastic/samples.hpp"

namespace palpate::viscoelastic {

// What is known beside the samples, in scaled units.
struct Priors {
  double variance = 0.0;  // σ² of the force, by which they weigh
  double exponent = 0.0;  // where it is known; 0 where it is looked for
  double centre = 1.3;    // n ~ N(1.3, 1), between a spring and a cone
  double deviation = 1.0;
  double dissipation = 1.0;  // c/k ~ N(0, 1): damping as large as the spring at the scale's speed
  std::uint64_t offset = 1;  // whether there is one; a word, so that no saved state has padding
  detail::OffsetPrior air{0.0, 0.0};  // F₀ ~ N(mean, deviation²); 0: nothing is known

  // ρ_F = σ²/s² in samples. Where nothing is known the offset may be as large as the forces are,
  // one unit; where the unit is small beside the residual, 20 σ.
  double offset_weight() const noexcept {
    if (air.deviation > 0.0) return variance / (air.deviation * air.deviation);
    return std::min(variance, 1.0 / (20.0 * 20.0));
  }
};

// Nodes of the grid, from 0: of the exponent, and of what is second.
struct Place {
  double exponent;
  double second;
};

// Of a power law α = 0, 0.14 … 0.98; of one relaxation time the rungs of the ladder. From 1 on a
// spectrum is that of its shortest time alone.
inline constexpr double highest_slope = 0.98;
inline constexpr std::size_t slopes = 8;

constexpr double second_of(Memory memory, double place) noexcept {
  constexpr double step = highest_slope / static_cast<double>(slopes - 1);
  return memory == Memory::power_law ? step * place : place;
}

// A candidate fitted at one place.
struct Point {
  Place place{};
  Linear linear{};
  double cost = 0.0;  // J less Σ F², with the priors
};

constexpr double exponent_at(const Candidate& law, const Priors& priors, double place) noexcept {
  if (law.linear) return 1.0;
  return priors.exponent > 0.0 ? priors.exponent : Grid::lowest_exponent + Grid::step * place;
}

template <class Sums>
Normal normal_with_priors(const Samples<Sums>& samples, const Candidate& law, const Priors& priors,
                          const Place& place, double stiffness_before) noexcept {
  const double n = exponent_at(law, priors, place.exponent);
  Normal normal = samples.normal(law, n, second_of(law.memory, place.second));
  if (priors.offset != 0) {
    normal.a[offset][offset] += priors.offset_weight();
    normal.b[offset] += priors.offset_weight() * priors.air.mean;
  }
  const double spread = priors.dissipation * stiffness_before;
  if (spread > 0.0)
    normal.a[damping][damping] += std::min(priors.variance / (spread * spread), 1e100);
  return normal;
}

template <class Sums>
[[gnu::noinline]] Point point_at(const Samples<Sums>& samples, const Candidate& law,
                                 const Priors& priors, const Place& place,
                                 double stiffness_before) noexcept {
  const Normal normal = normal_with_priors(samples, law, priors, place, stiffness_before);
  Point point{place, solve_passive(normal, law, priors.offset != 0), 0.0};
  const double away = (exponent_at(law, priors, place.exponent) - priors.centre) / priors.deviation;
  point.cost = priors.variance * away * away - point.linear.gain;
  return point;
}

template <class Sums>
class Search {
 public:
  // Over the whole range.
  void begin(const Candidate& law, const Priors& priors, double stiffness_before) noexcept {
    start(law, priors, {}, stiffness_before);
    row_ = 0;
    // Every second node is looked at, so that a minimum is a step off at most.
    step_ = 1.0;
  }

  // From an answer of a little while ago.
  void begin_near(const Candidate& law, const Priors& priors, const Place& place,
                  double stiffness_before) noexcept {
    start(law, priors, place, stiffness_before);
    row_ = rows();
    step_ = 0.125;
  }

  // A dozen evaluations or so; true when it is done.
  [[gnu::noinline]] bool advance(const Samples<Sums>& samples) noexcept {
    if (row_ < rows()) {
      look_along_row(samples);
      if (!law_.searches_memory()) {
        while (row_ < rows()) look_along_row(samples);
      }
      return false;
    }
    if (!searches_exponent() && !law_.searches_memory()) {
      best_ = at(samples, best_.place);
      return true;
    }
    const std::size_t rounds = law_.searches_memory() ? 2 : most_rounds;
    for (std::size_t i = 0; i < rounds; ++i) {
      if (refine(samples)) return true;
    }
    return false;
  }

  const Candidate& law() const noexcept { return law_; }
  const Point& best() const noexcept { return best_; }

 private:
  static constexpr std::size_t most_rounds = 10;
  // A 64th of a node is 0.004 in n: a vertex within half of that is known to 1e-5 and better.
  static constexpr double least_step = 1.0 / 64.0;

  void start(const Candidate& law, const Priors& priors, const Place& place,
             double stiffness_before) noexcept {
    law_ = law;
    priors_ = priors;
    stiffness_before_ = stiffness_before;
    best_ = {place, {}, 1e300};
    round_ = 0;
  }

  bool searches_exponent() const noexcept { return !law_.linear && !(priors_.exponent > 0.0); }
  std::size_t rows() const noexcept { return searches_exponent() ? Grid::exponents / 2 : 1; }
  double last_second() const noexcept {
    const std::size_t nodes = law_.memory == Memory::power_law ? slopes : Sums::Times::count;
    return law_.searches_memory() ? static_cast<double>(nodes - 1) : 0.0;
  }

  Point at(const Samples<Sums>& samples, const Place& place) const noexcept {
    return point_at(samples, law_, priors_, place, stiffness_before_);
  }

  void look_along_row(const Samples<Sums>& samples) noexcept {
    const double last = last_second(), exponent = 2.0 * static_cast<double>(row_);
    for (double second = 0.0; second <= last; second += 2.0) {
      const Point found = at(samples, {exponent, second});
      if (found.cost < best_.cost) best_ = found;
    }
    ++row_;
  }

  // A centre about which a step either way is within the grid. A spectrum may rise as well as fall.
  Place within(const Place& place) const noexcept {
    const double last = static_cast<double>(Grid::exponents - 1);
    const double margin = law_.memory == Memory::power_law ? 0.0 : step_;
    return {
        std::clamp(place.exponent, step_, last - step_),
        law_.searches_memory() ? std::clamp(place.second, margin, last_second() - margin) : 0.0};
  }

  // One of Newton's steps by differences; true when it is done.
  bool refine(const Samples<Sums>& samples) noexcept {
    const Place centre = within(best_.place);
    const auto cost = [&](double along, double across) noexcept {
      return at(samples, {centre.exponent + along * step_, centre.second + across * step_}).cost;
    };
    const bool along = searches_exponent(), across = law_.searches_memory();
    const double middle = cost(0.0, 0.0);
    double g1 = 0.0, g2 = 0.0, h11 = 0.0, h22 = 0.0, h12 = 0.0;
    double sides = 0.0;
    if (along) {
      const double below = cost(-1.0, 0.0), above = cost(1.0, 0.0);
      g1 = 0.5 * (above - below);
      h11 = above - 2.0 * middle + below;
      sides += above + below;
    }
    if (across) {
      const double below = cost(0.0, -1.0), above = cost(0.0, 1.0);
      g2 = 0.5 * (above - below);
      h22 = above - 2.0 * middle + below;
      sides += above + below;
    }
    if (along && across) h12 = 0.5 * (cost(1.0, 1.0) + cost(-1.0, -1.0) - sides + 2.0 * middle);
    double d1 = downhill(g1, h11), d2 = downhill(g2, h22);
    const double determinant = h11 * h22 - h12 * h12;
    if (along && across && h11 > 0.0 && determinant > 1e-6 * h11 * h22) {
      d1 = (h12 * g2 - h22 * g1) / determinant;
      d2 = (h12 * g1 - h11 * g2) / determinant;
      // At an end of the range the other moves alone.
      if (centre.second + d2 * step_ < 0.0) {
        d2 = -centre.second / step_;
        d1 = -(g1 + h12 * d2) / h11;
      }
    }
    const double largest = std::max(std::abs(d1), std::abs(d2));
    const double shorter = largest > 1.5 ? 1.5 / largest : 1.0;
    const Place next =
        within({centre.exponent + d1 * shorter * step_, centre.second + d2 * shorter * step_});
    const Point there = at(samples, next);
    // A step that leads up, as from a saddle, is not taken; the next one is shorter.
    if (there.cost <= middle) {
      best_ = there;
    } else {
      best_ = at(samples, centre);
    }
    const bool small = largest < 0.5 || !(there.cost <= middle);
    if (small && step_ <= least_step) return true;
    if (small) step_ = std::max(0.25 * step_, least_step);
    return ++round_ >= most_rounds;
  }

  // To the vertex of a parabola, or so far as a step may go.
  static double downhill(double slope, double curvature) noexcept {
    if (curvature > 0.0) return -slope / curvature;
    return slope > 0.0 ? -1.5 : slope < 0.0 ? 1.5 : 0.0;
  }

  Candidate law_{};
  Priors priors_{};
  Point best_{};
  double stiffness_before_ = 0.0;
  double step_ = 0.0;
  std::size_t row_ = 0;
  std::size_t round_ = 0;
};

}  // namespace palpate::viscoelastic
