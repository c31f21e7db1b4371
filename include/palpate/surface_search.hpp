// Variable projection where the place of the surface is unknown too: a bank of candidates, each
// with the same samples, the free approach included. J*(d), minimised over everything else, is
// smooth near its minimum; its curvature there is the standard error of the surface.
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

  void clear() noexcept {
    for (VariableProjection& candidate : bank_) candidate.clear();
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
    Projection r = between(found, best);
    r.surface_found = best > 0 && best + 1 < candidates;
    return r;
  }

 private:
  double step() const noexcept {
    return (settings_.highest_surface - settings_.lowest_surface) /
           static_cast<double>(candidates - 1);
  }

  // At the minimum of J*, interpolated through the eight candidates around the best; ln k, c/k, n
  // and F₀ are interpolated too. A parabola through three would put the surface 2 µm too high,
  // which is more than the error bar of a stiff material.
  Projection between(const std::array<Projection, candidates>& found,
                     std::size_t best) const noexcept {
    const std::size_t first =
        std::min(best - std::min(best, lagrange_points / 2 - 1), candidates - lagrange_points);
    const auto through = [&](auto&& quantity) noexcept {
      Vector<lagrange_points> values;
      for (std::size_t i = 0; i < lagrange_points; ++i) values[i] = quantity(found[first + i]);
      return values;
    };
    const Vector<lagrange_points> cost =
        through([](const Projection& p) noexcept { return p.cost; });
    const double centre = static_cast<double>(best - first);
    double t = centre;
    for (int round = 0; round < 4; ++round) {
      const LagrangeWeights w = lagrange_weights(t);
      const double bend = dot(w.second, cost);
      if (!(bend > 0.0)) break;
      const double next = t - dot(w.first, cost) / bend;
      t = std::clamp(next, std::max(centre - 1.0, 0.0),
                     std::min(centre + 1.0, static_cast<double>(lagrange_points - 1)));
    }
    const LagrangeWeights w = lagrange_weights(t);
    Projection r = found[best];
    Vector<5> moved{0.0, 0.0, 0.0, 0.0, 1.0};  // by the surface
    const auto take = [&](double& value, double& slope,
                          const Vector<lagrange_points>& values) noexcept {
      value = dot(w.value, values);
      slope = dot(w.first, values) / step();
    };
    const Vector<lagrange_points> k = through([](const Projection& p) noexcept { return p.k; });
    if (std::all_of(k.begin(), k.end(), [](double value) { return value > 0.0; })) {
      double log_k, log_slope, ratio, ratio_slope;
      take(log_k, log_slope, through([](const Projection& p) noexcept { return std::log(p.k); }));
      take(ratio, ratio_slope, through([](const Projection& p) noexcept { return p.c / p.k; }));
      r.k = bounded_exp(log_k);
      r.c = r.k * ratio;
      moved[0] = r.k * log_slope;
      moved[1] = r.c * log_slope + r.k * ratio_slope;
    }
    take(r.n, moved[2], through([](const Projection& p) noexcept { return p.n; }));
    take(r.offset, moved[3], through([](const Projection& p) noexcept { return p.offset; }));
    r.n = std::clamp(r.n, bank_[0].lowest_exponent(), bank_[0].highest_exponent());
    r.surface = surface(first) + t * step();
    widen(r, moved, dot(w.second, cost));
    return r;
  }

  // Var d = 2σ²/J*''; what is fitted moves with d, so its covariance grows by (dθ/dd)(dθ/dd)ᵀ Var
  // d.
  void widen(Projection& r, const Vector<5>& moved, double bend) const noexcept {
    const double range = settings_.highest_surface - settings_.lowest_surface;
    const double variance =
        bend > 0.0 ? std::min(2.0 * r.noise_variance * step() * step() / bend, range * range)
                   : range * range;
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
