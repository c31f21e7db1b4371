// Variable projection that selects its samples. It keeps two banks of sums, one for firm contact
// and one for light samples, and measures the offset in free air.
//
// A solution uses both banks if the light samples fit the law of the firm ones. They do not if the
// material recovers slowly and contact is lost above the surface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "palpate/method.hpp"
#include "palpate/projection/contact_samples.hpp"
#include "palpate/projection/covariance.hpp"
#include "palpate/projection/power_sums.hpp"
#include "palpate/projection/projection_fit.hpp"
#include "palpate/sample.hpp"

namespace palpate {

namespace detail {

// Sums that apply forgetting only when they are needed next.
class Bank {
 public:
  explicit Bank(const ProjectionSettings& settings) noexcept : sums_(empty_sums(settings)) {}

  void forget(double factor) noexcept { factor_ *= factor; }

  void add(const Sample& sample) noexcept {
    sums_.add(sample, factor_);
    factor_ = 1.0;
  }

  void add_weighted(const Sample& sample, double weight) noexcept {
    if (factor_ != 1.0) sums_.forget(factor_);
    factor_ = 1.0;
    sums_.add_weighted(sample, weight);
  }

  double weight() const noexcept { return factor_ * sums_.weight(); }
  const PowerSums& sums() const noexcept { return sums_; }
  double factor() const noexcept { return factor_; }

  void clear() noexcept {
    sums_.clear();
    factor_ = 1.0;
  }

 private:
  PowerSums sums_;
  double factor_ = 1.0;
};

class ContactSolver {
 public:
  using Settings = ProjectionSettings;

  explicit ContactSolver(const Settings& settings) noexcept
      : settings_(settings), sure_(settings), light_(settings) {}

  // With a force threshold the gate alone selects the samples. Without one every sample below the
  // surface is passed to this solver.
  ContactGate::Settings gate(const ContactGate::Settings& given, const Units&) noexcept {
    chooses_ = !(given.make_force > 0.0);
    if (!chooses_) return given;
    constexpr double any_force = -std::numeric_limits<double>::infinity();
    return {given.minimum_penetration, any_force, any_force};
  }
  static bool in_range(const Sample& s) noexcept { return s.penetration > 0.0; }

  // Adds a sample; true if the neighbours before it show firm contact. A light sample is stored
  // too. `expected` is its force by the latest solution.
  bool add(const Sample& sample, double forgetting_factor, double expected,
           const ProjectionSolution& latest) noexcept {
    forget(forgetting_factor);
    const double unrounded = rounding_.correction(sample.force, expected, recent_.resolution());
    if (!chooses_) {
      recent_.push(sample, Role::sure, false, unrounded);
      sure_.add(recent_.ago(0).sample);
      return true;
    }
    const bool pulls = latest.k + latest.c * sample.velocity < 0.0;
    recent_.push(sample, Role::none, pulls, unrounded);
    const Role role = role_of(0);
    recent_.ago(0).role = role;
    if (role == Role::sure) {
      sure_.add(recent_.ago(0).sample);
    } else {
      put(recent_.ago(0), 1.0);
    }
    finish_pending();
    return role == Role::sure;
  }

  // Copies resolution and noise from a solver that has processed the same samples, so that the
  // first of them is corrected too; false if their force is not rounded.
  bool unround_as(const ContactSolver& earlier) noexcept {
    if (!(earlier.recent_.resolution() > 0.0 && earlier.rounding_.known())) return false;
    rounding_ = earlier.rounding_;
    recent_ = earlier.recent_;
    recent_.clear();
    return true;
  }

  // A sample out of contact informs its neighbours and the offset.
  void free(const Sample& sample, double forgetting_factor) noexcept {
    if (!chooses_) return;
    recent_.push(sample, Role::free, false);
    if (air_.add(sample.penetration, sample.force, forgetting_factor)) {
      recent_.set_correlated(air_.variance(), air_.inflation());
    }
    finish_pending();
  }

  // Removes the latest samples, which have turned out to be outliers.
  bool sound() const noexcept { return recent_.sound() && air_.sound(); }

  void withdraw(std::size_t count) noexcept {
    for (std::size_t age = 0; count > 0 && age <= ContactSamples::side; ++age) {
      ContactSamples::Entry& entry = recent_.ago(age);
      if (entry.role == Role::none || entry.role == Role::free) continue;
      put(entry, -1.0);
      recent_.withdraw(age);
      --count;
    }
  }

  // The next sample is not a neighbour of the latest.
  void interrupt() noexcept { recent_.clear(); }

  double weight() const noexcept { return sure_.weight() + light_.weight(); }

  double highest_exponent() const noexcept { return sure_.sums().highest(); }

  // Centres the priors on an old estimate with these deviations; the sensor's offset is unchanged.
  void set_prior(const ProjectionSolution& old, double exponent_deviation,
                 double dissipation_deviation) noexcept {
    centre_priors(settings_, old, exponent_deviation, dissipation_deviation);
    kept_offset_ = offset_deviation(old);
  }

  Vector<4> prior_fractions(const ProjectionSolution& solution) const noexcept {
    const PowerSums sums = chosen(solution);
    ProjectionSettings settings = settings_;
    settings.offset_deviation = solution.prior_deviation;
    return ProjectionFit(sums, settings).prior_fractions(solution);
  }

  // Forgets the samples; the priors and the offset from free air remain.
  void clear() noexcept {
    sure_.clear();
    light_.clear();
    unusable_ = 0.0;
    recent_.clear();
  }

  // The global minimum, with consistent samples and offset prior. Not inlined, like the functions
  // it calls: a replay would contain the search a dozen times.
  [[gnu::noinline]] ProjectionSolution solve() const noexcept {
    const Tare tare = offset_prior();
    PowerSums sums = firm();
    ProjectionSolution best = fitted(sums, {tare.prior.mean, 0.0});
    const double slow = best.inflation = inflation(best.noise_variance);
    best.tare_refuted = tare.refuted;
    if (settings_.offset && tare.prior.deviation > 0.0) {
      const double away = deviations(best, tare.prior);
      // If f samples carry the information of one, a prior weighs f times as much relative to them.
      const OffsetPrior weighed{tare.prior.mean, tare.prior.deviation / std::sqrt(slow)};
      if (!(away > largest_offset)) best = fitted(sums, weighed);
      best.inflation = slow;
      best.tare_refuted = tare.refuted || (!tare.of_air && away > suspect_offset);
    }
    if (!(light_.weight() > 0.0)) return best;
    if (!mostly_usable()) {
      best.lost_above = true;
      return best;
    }
    sums.include(light_.sums(), light_.factor());
    ProjectionSolution joined = fitted(sums, {best.prior_mean, best.prior_deviation});
    joined.tare_refuted = best.tare_refuted;
    joined.inflation = slow;
    best.lost_above = excess(best, joined) > largest_excess * std::sqrt(slow);
    return best.lost_above ? best : joined;
  }

  // A local minimum near a recent estimate, with the same samples and prior.
  [[gnu::noinline]] ProjectionSolution solve_near(
      const ProjectionSolution& earlier) const noexcept {
    const PowerSums sums = chosen(earlier);
    ProjectionSettings settings = settings_;
    settings.offset_deviation = earlier.prior_deviation;
    ProjectionSolution r = ProjectionFit(sums, settings).solve_near(earlier);
    return finished(r, earlier);
  }

 private:
  // The tightest offset prior of a tare, free air and the estimate before a restart.
  Tare offset_prior() const noexcept {
    const Tare tare = measured_offset(settings_.offset, settings_.offset_deviation,
                                      settings_.surface_deviation, air_, recent_.least_step());
    const double deviation = tare.prior.deviation;
    const bool looser = kept_offset_ > 0.0 && !(deviation > 0.0 && deviation <= kept_offset_);
    return looser ? Tare{{0.0, kept_offset_}, true, tare.refuted} : tare;
  }

  // The inflation f in contact: that of the slow noise in free air, scaled by its variance over
  // that of the residual. f samples carry the information of one in white noise. The misfit of the
  // law does not contribute.
  double inflation(double variance) const noexcept {
    return std::max(air_.inflation() * std::min(air_.variance() / std::max(variance, tiny), 1.0),
                    1.0);
  }

  // The difference between a nearly free offset and a prior, in standard deviations.
  static double deviations(const ProjectionSolution& open, const OffsetPrior& prior) noexcept {
    const double error = std::sqrt(open.inflation * dot(open.root[3], open.root[3]));
    return std::abs(open.offset - prior.mean) / combined(error, prior.deviation);
  }

  // Excess of the light samples over the noise of the firm ones, in standard deviations.
  double excess(const ProjectionSolution& alone, const ProjectionSolution& joined) const noexcept {
    constexpr double fewest_degrees = 10.0;
    if (sure_.weight() - 4.0 < fewest_degrees) return 0.0;
    return excess_of(joined.residual - alone.residual, light_.weight(),
                     std::max(alone.noise_variance, tiny));
  }

  bool mostly_usable() const noexcept {
    return light_.weight() >= fewest_usable * (light_.weight() + unusable_);
  }

  // The sums that an estimate used, with forces relative to its prior's mean.
  PowerSums chosen(const ProjectionSolution& answer) const noexcept {
    PowerSums sums = firm();
    if (!answer.lost_above) sums.include(light_.sums(), light_.factor());
    sums.shift(answer.prior_mean);
    return sums;
  }

  PowerSums firm() const noexcept {
    PowerSums sums = sure_.sums();
    if (sure_.factor() != 1.0) sums.forget(sure_.factor());
    return sums;
  }

  ProjectionSolution fitted(const PowerSums& sums, const OffsetPrior& prior) const noexcept {
    if (prior.mean != 0.0) {
      PowerSums shifted = sums;
      shifted.shift(prior.mean);
      return unshifted(shifted, prior);
    }
    return unshifted(sums, prior);
  }

  // The solution for sums whose forces are relative to the prior's mean.
  [[gnu::noinline]] ProjectionSolution unshifted(const PowerSums& sums,
                                                 const OffsetPrior& prior) const noexcept {
    ProjectionSettings settings = settings_;
    settings.offset_deviation = prior.deviation;
    ProjectionSolution r = ProjectionFit(sums, settings).solve();
    r.prior_mean = prior.mean;
    r.prior_deviation = prior.deviation;
    return finished(r, r);
  }

  static ProjectionSolution finished(ProjectionSolution r,
                                     const ProjectionSolution& choice) noexcept {
    r.lost_above = choice.lost_above;
    r.tare_refuted = choice.tare_refuted;
    r.prior_mean = choice.prior_mean;
    r.prior_deviation = choice.prior_deviation;
    r.inflation = choice.inflation;
    r.offset += choice.prior_mean;
    return r;
  }

  void forget(double factor) noexcept {
    if (factor == 1.0) return;
    sure_.forget(factor);
    light_.forget(factor);
    unusable_ *= factor;
    air_.forget(factor);
    recent_.forget(factor);
  }

  Role role_of(std::size_t age) const noexcept {
    if (recent_.pressed(age, air_.mean())) return Role::sure;
    return recent_.ago(age).pulls ? Role::unusable : Role::light;
  }

  // Reclassifies the sample of eight ago, which has all its neighbours now.
  void finish_pending() noexcept {
    ContactSamples::Entry& entry = recent_.ago(ContactSamples::side);
    if (entry.role == Role::none || entry.role == Role::free) return;
    const Role role = role_of(ContactSamples::side);
    if (role == entry.role) return;
    put(entry, -1.0);
    entry.role = role;
    put(entry, 1.0);
  }

  // Adds a sample to the bank of its role; a factor of −1 removes it.
  void put(const ContactSamples::Entry& entry, double factor) noexcept {
    const double weight = factor * entry.weight;
    if (entry.role == Role::sure) sure_.add_weighted(entry.sample, weight);
    if (entry.role == Role::light) light_.add_weighted(entry.sample, weight);
    if (entry.role == Role::unusable) unusable_ = std::max(unusable_ + weight, 0.0);
  }

  Settings settings_;
  Bank sure_;
  Bank light_;
  double unusable_ = 0.0;     // light samples where the law's force is negative
  double kept_offset_ = 0.0;  // its deviation from an estimate before a restart; 0: none
  ContactSamples recent_;
  ForceRounding rounding_;
  FreeAir air_;
  bool chooses_ = true;
};

}  // namespace detail

struct SurfaceSettings {
  ProjectionSettings projection{};
  // In scaled units: ±2 mm at 10 mm, the delay of a force threshold on a soft material.
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

// Variable projection with an unknown surface position: a bank of candidate positions, each with
// the same samples, including the free approach. J*(d), the minimum over the other parameters, is
// smooth near its own minimum; its curvature there gives the standard error of the surface.
class SurfaceSolver {
 public:
  using Settings = SurfaceSettings;

  // The default range in steps of a hundredth of the unit, which is 0.1 mm at 10 mm: small enough
  // for J* to be a polynomial of degree nine around its minimum.
  static constexpr std::size_t candidates = 41;

  explicit SurfaceSolver(const Settings& settings) noexcept
      : settings_(settings),
        bank_(filled(ProjectionSolver(settings.projection),
                     std::make_index_sequence<candidates>())) {}

  // Samples of the approach are used too, at any force: a tenth of the unit before the first
  // candidate is enough to measure the force out of contact.
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

  // Every candidate has its own minimum, so there is no faster method.
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

  // Interpolates the solution at the minimum of J* through the ten candidates around the best; J*,
  // ln k, c/k, n and F₀ are interpolated. A parabola through three candidates would bias the
  // surface by 2 µm, more than its standard error on a stiff material.
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
    Vector<5> moved{0.0, 0.0, 0.0, 0.0, 1.0};  // derivatives with respect to the surface
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

  // Minimum of the polynomial through these costs, within a step of `centre`, by Newton's method.
  // The best candidate is at most half a step away, and four iterations reach rounding error.
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

  // Var d = 2σ²/J*''; the fitted θ depends on d, which adds (dθ/dd)(dθ/dd)ᵀ Var d to its
  // covariance.
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
