// Variable projection where the place of the surface is unknown too: a bank of candidates, each
// with the same samples, the free approach included. J*(d), minimised over everything else, is a
// parabola near its minimum; its curvature is the standard error of the surface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "palpate/variable_projection.hpp"

namespace palpate {

class SurfaceSearch {
 public:
  static constexpr std::size_t candidates = 41;
  static constexpr bool takes_approach = true;

  struct Settings {
    VariableProjection::Settings projection;
    double lowest_surface = -0.2;  // in scaled units
    double highest_surface = 0.2;
  };

  explicit SurfaceSearch(const Settings& settings) noexcept
      : settings_(settings),
        bank_(filled(VariableProjection(settings.projection),
                     std::make_index_sequence<candidates>())) {}

  double surface(std::size_t candidate) const noexcept {
    return settings_.lowest_surface + step() * static_cast<double>(candidate);
  }
  double lowest_surface() const noexcept { return settings_.lowest_surface; }

  void add(const Sample& sample, double forgetting_factor) noexcept {
    for (std::size_t i = 0; i < candidates; ++i) {
      bank_[i].add({sample.penetration - surface(i), sample.velocity, sample.force},
                   forgetting_factor);
    }
  }

  double weight() const noexcept { return bank_[0].weight(); }
  double highest_exponent() const noexcept { return bank_[0].highest_exponent(); }

  void restart(const Projection& old, double exponent_deviation,
               double dissipation_deviation) noexcept {
    for (VariableProjection& candidate : bank_) {
      candidate.restart(old, exponent_deviation, dissipation_deviation);
    }
  }

  // There is no cheaper way: every candidate has its own minimum.
  Projection solve_near(const Projection&) const noexcept { return solve(); }

  Projection solve() const noexcept {
    std::array<Projection, candidates> found;
    std::size_t best = 0;
    for (std::size_t i = 0; i < candidates; ++i) {
      found[i] = bank_[i].solve();
      if (found[i].cost < found[best].cost) best = i;
    }
    const std::size_t middle = std::clamp(best, std::size_t{1}, candidates - 2);
    Projection r = between(found[middle - 1], found[middle], found[middle + 1], surface(middle));
    r.surface_found = best == middle;
    return r;
  }

 private:
  double step() const noexcept {
    return (settings_.highest_surface - settings_.lowest_surface) /
           static_cast<double>(candidates - 1);
  }

  // At the vertex of the parabola through three neighbours; ln k, c/k, n and F₀ follow parabolas
  // too.
  Projection between(const Projection& left, const Projection& centre, const Projection& right,
                     double surface) const noexcept {
    const double bend = left.cost - 2.0 * centre.cost + right.cost;
    const double slope = 0.5 * (right.cost - left.cost);
    const double t = bend > 0.0 ? std::clamp(-slope / bend, -1.0, 1.0) : 0.0;
    const auto at = [t](double a, double b, double c) noexcept {
      return b + t * (0.5 * (c - a) + 0.5 * t * (a - 2.0 * b + c));
    };
    Projection r = centre;
    const bool positive = left.k > 0.0 && centre.k > 0.0 && right.k > 0.0;
    if (positive) {
      r.k = bounded_exp(at(std::log(left.k), std::log(centre.k), std::log(right.k)));
      r.c = r.k * at(left.c / left.k, centre.c / centre.k, right.c / right.k);
    }
    r.n = at(left.n, centre.n, right.n);
    r.offset = at(left.offset, centre.offset, right.offset);
    r.surface = surface + t * step();
    widen(r, left, right, bend);
    return r;
  }

  // Var d = 2σ²/J*''; what is fitted moves with d, so its covariance grows by (dθ/dd)(dθ/dd)ᵀ Var
  // d.
  void widen(Projection& r, const Projection& left, const Projection& right,
             double bend) const noexcept {
    const double range = settings_.highest_surface - settings_.lowest_surface;
    const double variance =
        bend > 0.0 ? std::min(2.0 * r.noise_variance * step() * step() / bend, range * range)
                   : range * range;
    const double per_surface = 0.5 / step();
    const Vector<5> moved{(right.k - left.k) * per_surface, (right.c - left.c) * per_surface,
                          (right.n - left.n) * per_surface,
                          (right.offset - left.offset) * per_surface, 1.0};
    const double deviation = std::sqrt(variance);
    for (std::size_t i = 0; i < 5; ++i) r.root[i][4] = saturate(moved[i] * deviation);
  }

  template <std::size_t... Index>
  static std::array<VariableProjection, candidates> filled(const VariableProjection& empty,
                                                           std::index_sequence<Index...>) noexcept {
    return {((void)Index, empty)...};
  }

  Settings settings_;
  std::array<VariableProjection, candidates> bank_;
};

}  // namespace palpate
