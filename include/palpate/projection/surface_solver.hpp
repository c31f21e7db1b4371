// Variable projection where the position of the surface is unknown too: a bank of candidates, each
// with the same samples, the free approach included. J*(d), minimised over everything else, is
// smooth near its minimum; its curvature there is the standard error of the surface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "palpate/projection/projection_fit.hpp"

namespace palpate {

struct SurfaceSettings {
  ProjectionSettings projection{};
  // In scaled units: ±2 mm at 10 mm, as far as a force threshold is late on a soft material.
  double lowest_surface = -0.2;
  double highest_surface = 0.2;

  bool operator==(const SurfaceSettings&) const = default;
};

constexpr const char* validate(const SurfaceSettings& s) noexcept {
  if (const char* fault = validate(s.projection)) return fault;
  const bool bounded = s.lowest_surface >= -5.0 && s.highest_surface <= 5.0;
  if (!(bounded && s.lowest_surface < s.highest_surface)) {
    return "method.lowest_surface must be below highest_surface, within ±5 units of penetration";
  }
  return nullptr;
}

namespace detail {

class SurfaceSolver {
 public:
  using Settings = SurfaceSettings;

  // Steps of a hundredth of the unit over the default range: 0.1 mm at 10 mm, fine enough for J*
  // to be a polynomial of degree nine around its minimum.
  static constexpr std::size_t candidates = 41;

  explicit SurfaceSolver(const Settings& settings) noexcept
      : settings_(settings),
        bank_(filled(ProjectionSolver(settings.projection),
                     std::make_index_sequence<candidates>())) {}

  // The approach counts too, whatever the force: a tenth of the unit before the first candidate is
  // enough to know the force out of contact.
  ContactGate::Settings gate(const ContactGate::Settings&, const Units& units) const noexcept {
    constexpr double any_force = -std::numeric_limits<double>::infinity();
    return {(settings_.lowest_surface - 0.1) * units.penetration, any_force, any_force};
  }
  static bool in_range(const Sample&) noexcept { return true; }

  double surface(std::size_t candidate) const noexcept {
    return settings_.lowest_surface + step() * static_cast<double>(candidate);
  }

  void add(const Sample& sample, double forgetting_factor) noexcept {
    for (std::size_t i = 0; i < candidates; ++i) {
      bank_[i].add({sample.penetration - surface(i), sample.velocity, sample.force},
                   forgetting_factor);
    }
  }

  double weight() const noexcept { return bank_[0].weight(); }
  double highest_exponent() const noexcept { return bank_[0].highest_exponent(); }
  Vector<4> prior_fractions(const ProjectionSolution& solution) const noexcept {
    const double nearest = std::round((solution.surface - settings_.lowest_surface) / step());
    const double last = static_cast<double>(candidates - 1);
    return bank_[static_cast<std::size_t>(std::clamp(nearest, 0.0, last))].prior_fractions(
        solution);
  }

  void set_prior(const ProjectionSolution& old, double exponent_deviation,
                 double dissipation_deviation) noexcept {
    for (ProjectionSolver& candidate : bank_) {
      candidate.set_prior(old, exponent_deviation, dissipation_deviation);
    }
  }

  void clear() noexcept {
    for (ProjectionSolver& candidate : bank_) candidate.clear();
  }

  // There is no cheaper way: every candidate has its own minimum.
  ProjectionSolution solve_near(const ProjectionSolution&) const noexcept { return solve(); }

  [[gnu::noinline]] ProjectionSolution solve() const noexcept {
    std::array<ProjectionSolution, candidates> found;
    std::size_t best = 0;
    for (std::size_t i = 0; i < candidates; ++i) {
      found[i] = bank_[i].solve();
      if (found[i].cost < found[best].cost) best = i;
    }
    ProjectionSolution r = between(found, best);
    r.surface_found = best > 0 && best + 1 < candidates;
    return r;
  }

 private:
  double step() const noexcept {
    return (settings_.highest_surface - settings_.lowest_surface) /
           static_cast<double>(candidates - 1);
  }

  // At the minimum of J*, interpolated through the ten candidates around the best; ln k, c/k, n
  // and F₀ are interpolated too. A parabola through three would put the surface 2 µm too high,
  // which is more than the error bar of a stiff material.
  ProjectionSolution between(const std::array<ProjectionSolution, candidates>& found,
                             std::size_t best) const noexcept {
    const std::size_t first =
        std::min(best - std::min(best, lagrange_points / 2 - 1), candidates - lagrange_points);
    const auto through = [&](auto&& quantity) noexcept {
      Vector<lagrange_points> values;
      for (std::size_t i = 0; i < lagrange_points; ++i) values[i] = quantity(found[first + i]);
      return values;
    };
    const Vector<lagrange_points> cost =
        through([](const ProjectionSolution& p) noexcept { return p.cost; });
    const double t = minimum(cost, static_cast<double>(best - first));
    const LagrangeWeights w = lagrange_weights(t);
    ProjectionSolution r = found[best];
    Vector<5> moved{0.0, 0.0, 0.0, 0.0, 1.0};  // by the surface
    const auto take = [&](double& value, double& slope,
                          const Vector<lagrange_points>& values) noexcept {
      value = dot(w.value, values);
      slope = dot(w.first, values) / step();
    };
    const Vector<lagrange_points> k =
        through([](const ProjectionSolution& p) noexcept { return p.k; });
    if (std::all_of(k.begin(), k.end(), [](double value) { return value > 0.0; })) {
      double log_k, log_slope, ratio, ratio_slope;
      take(log_k, log_slope,
           through([](const ProjectionSolution& p) noexcept { return std::log(p.k); }));
      take(ratio, ratio_slope,
           through([](const ProjectionSolution& p) noexcept { return p.c / p.k; }));
      r.k = bounded_exp(log_k);
      r.c = r.k * ratio;
      moved[0] = r.k * log_slope;
      moved[1] = r.c * log_slope + r.k * ratio_slope;
    }
    if (!(settings_.projection.exponent > 0.0)) {
      take(r.n, moved[2], through([](const ProjectionSolution& p) noexcept { return p.n; }));
    }
    take(r.offset, moved[3],
         through([](const ProjectionSolution& p) noexcept { return p.offset; }));
    r.n = std::clamp(r.n, bank_[0].lowest_exponent(), bank_[0].highest_exponent());
    r.surface = surface(first) + t * step();
    widen(r, moved, dot(w.second, cost));
    return r;
  }

  // Where the polynomial through these costs is least, within a step of `centre`, by Newton's
  // method: from the best candidate, half a step off at most, four rounds end in rounding.
  static double minimum(const Vector<lagrange_points>& cost, double centre) noexcept {
    double t = centre;
    for (int round = 0; round < 4; ++round) {
      const LagrangeWeights w = lagrange_weights(t);
      const double curvature = dot(w.second, cost);
      if (!(curvature > 0.0)) break;
      const double next = t - dot(w.first, cost) / curvature;
      t = std::clamp(next, std::max(centre - 1.0, 0.0),
                     std::min(centre + 1.0, static_cast<double>(lagrange_points - 1)));
    }
    return t;
  }

  // Var d = 2σ²/J*''; what is fitted moves with d, so its covariance grows by (dθ/dd)(dθ/dd)ᵀ Var
  // d.
  void widen(ProjectionSolution& r, const Vector<5>& moved, double curvature) const noexcept {
    const double range = settings_.highest_surface - settings_.lowest_surface;
    const double variance =
        curvature > 0.0
            ? std::min(2.0 * r.noise_variance * step() * step() / curvature, range * range)
            : range * range;
    const double deviation = std::sqrt(variance);
    for (std::size_t i = 0; i < 5; ++i) r.root[i][4] = saturate(moved[i] * deviation);
  }

  template <std::size_t... Index>
  static std::array<ProjectionSolver, candidates> filled(const ProjectionSolver& empty,
                                                         std::index_sequence<Index...>) noexcept {
    return {((void)Index, empty)...};
  }

  Settings settings_;
  std::array<ProjectionSolver, candidates> bank_;
};

}  // namespace detail
}  // namespace palpate
