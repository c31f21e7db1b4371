// Generalised Hunt–Crossley laws, with and without memory, as a method of the recursive estimator.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/estimate.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/method.hpp"
#include "palpate/projection/contact_samples.hpp"
#include "palpate/sample.hpp"
#include "palpate/viscoelastic/solution.hpp"
#include "palpate/viscoelastic/solver.hpp"

namespace palpate {

// Settings of an estimator for laws with memory.
struct ViscoelasticSettings {
  // The competing viscoelastic::candidates, one bit each.
  std::uint64_t offered = viscoelastic::common;
  double exponent = 0.0;  // known n, for a tip of known shape; 0: estimated
  Flag offset = true;
  double offset_deviation = 0.0;  // of the prior F₀ ~ N(0, ·²) after a tare; 0: no tare
  // Standard deviation of the surface position, in scaled units. A wrong surface looks like an
  // offset of as many units of force.
  double surface_deviation = 0.0;
  double sample_time = 1e-3;  // s; the shortest relaxation time is two of them
  double longest_time = 0.0;  // longest relaxation time, s; 0: 4096 sample times

  bool operator==(const ViscoelasticSettings&) const = default;
};

constexpr const char* validate(const ViscoelasticSettings& s) noexcept {
  using viscoelastic::Grid;
  return detail::first_fault({
      {s.offered != 0 && (s.offered >> viscoelastic::candidates.size()) == 0,
       "method.offered must name at least one law"},
      {s.exponent == 0.0 ||
           detail::lies_in(s.exponent, Grid::lowest_exponent, Grid::highest_exponent),
       "method.exponent must be in [0.5, 3.25], or 0 if it is not known"},
      {detail::lies_in(s.offset_deviation, 0.0, 1e60),
       "method.offset_deviation must be in [0, 1e60] units of force"},
      {detail::lies_in(s.surface_deviation, 0.0, 1e60),
       "method.surface_deviation must be in [0, 1e60] units of penetration"},
      {s.sample_time > 0.0 && s.sample_time <= 1e6, "method.sample_time must be in (0, 1e6] s"},
      {s.longest_time == 0.0 || detail::lies_in(s.longest_time, 4.0 * s.sample_time, 1e12),
       "method.longest_time must be in [4 sample times, 1e12 s], or 0 for 4096 sample times"},
  });
}

class ViscoelasticMethod {
 public:
  using Law = GeneralisedHuntCrossley;
  using Settings = ViscoelasticSettings;
  static constexpr std::size_t order = Law::size;

  struct Row {
    Sample sample;
    double predicted;
  };

  static constexpr Forgetting::Settings default_forgetting = no_forgetting;
  static constexpr Scale default_scale = probing_scale;
  static constexpr bool forgets = true;
  static constexpr bool perturbs = false;
  // The estimate changes only when it is published.
  // ξ⁷ w² and two branches of ξ³ at a weight of 1e26 are far from overflow.
  static constexpr double largest_input = 1e8;
  // With smaller depths ξ⁻¹ near the surface would outweigh all other samples; 10 µm at 10 mm.
  static constexpr double least_depth = 1e-3;

  ViscoelasticMethod(const Settings& settings, const Units&) noexcept
      : solver_(settings.sample_time,
                settings.longest_time > 0.0 ? settings.longest_time
                                            : default_longest * settings.sample_time,
                static_cast<viscoelastic::Offered>(settings.offered), priors_of(settings)),
        offset_deviation_(settings.offset_deviation),
        surface_deviation_(settings.surface_deviation) {}

  static bool in_range(const Sample& s) noexcept {
    return s.penetration > 0.0 && detail::within(s, largest_input);
  }

  Row prepare(const Sample& sample, double dt) noexcept {
    advance(sample, dt);
    return {sample, solver_.predict(sample)};
  }

  static double predict(const Row& row) noexcept { return row.predicted; }

  Status learn(const Row& row, double, double forgetting_factor, double) noexcept {
    if (row.sample.penetration < least_depth) return Status::held;
    renew_offset();
    solver_.take(row.sample, row.predicted, forgetting_factor);
    return Status::updated;
  }

  // Uses a sample out of contact: the branches relax, and it informs the force offset.
  void free(const Sample& sample, double dt, double forgetting_factor) noexcept {
    if (!detail::within(sample, largest_input)) return pass(dt);
    advance(sample, dt);
    air_.add(sample.penetration, sample.force, forgetting_factor);
    air_is_new_ = true;
  }

  // Adds the time of a refused sample. The motion meanwhile is unknown; the next sample assumes a
  // uniform one.
  void pass(double dt) noexcept { passed_ += dt; }

  // The next sample does not continue the latest one.
  void interrupt() noexcept {
    begun_ = false;
    passed_ = last_step_ = 0.0;
  }

  // Restarts with the old exponent as a prior. The branches remain, because the motion's history
  // does.
  void reinitialise() noexcept {
    const viscoelastic::Solution& now = solver_.solution();
    if (now.known != 0 && now.at_edge == 0) {
      // Punch, sphere and cone have exponents 0.5 apart.
      solver_.priors().centre = now.fit.n;
      solver_.priors().deviation = 0.3;
    }
    reinitialise_after_transient();
  }

  void reinitialise_after_transient() noexcept { solver_.clear(0.0); }

  // Completes the computation that is otherwise spread over the next samples.
  void finish_pending() noexcept {
    renew_offset();
    solver_.finish_pending();
  }

  Law law(const Units& units) const noexcept {
    return viscoelastic::law_in_si(solver_.solution().fit, units);
  }

  double force(const Units& units, double x, double v) const noexcept {
    const Sample sample{x * units.per_penetration, v * units.per_velocity, 0.0};
    return units.force * detail::saturate(solver_.predict_after(sample, sample_time()));
  }

  Fit<Law> fit(const Units& units) const noexcept {
    const viscoelastic::Solution& now = solver_.solution();
    const Law law = this->law(units);
    return fit_of(law, covariance(units), now.fit.value[viscoelastic::offset] * units.force,
                  flags(now));
  }

  Snapshot<Law> snapshot(const Units& units) const noexcept {
    const Law law = this->law(units);
    const Matrix<order + 1> joint = covariance(units);
    const double offset = solver_.solution().fit.value[viscoelastic::offset];
    Snapshot<Law> snapshot{law, {}, offset * units.force};
    for (std::size_t i = 0; i < order; ++i) snapshot.variances[i] = joint[i][i];
    return snapshot;
  }

  detail::LawResponse response(const Units& units, double depth, double frequency) const noexcept {
    return viscoelastic::response_of(solver_.solution(), solver_.samples().ladder().times(), units,
                                     depth, frequency);
  }

  // Whether the latest sample renewed the solution, and the variance of its residual.
  bool renewed() const noexcept { return solver_.renewed(); }
  double residual_variance() const noexcept { return solver_.priors().variance; }

  const viscoelastic::Solver& solver() const noexcept { return solver_; }
  bool sound() const noexcept { return solver_.sound() && air_.sound(); }

  // Whether any contact began before its first sample.
  bool began_in_contact() const noexcept { return began_in_contact_; }

 private:
  static constexpr double default_longest = 4096.0;  // sample times
  // A step longer than this many previous time steps is a gap.
  static constexpr double longest_gap = 20.0;
  // Smaller depths have no finite inverse.
  static constexpr double surface_depth = 1e-9;

  double sample_time() const noexcept { return solver_.samples().ladder().sample_time(); }

  static viscoelastic::Priors priors_of(const Settings& s) noexcept {
    viscoelastic::Priors priors{};
    priors.exponent = s.exponent;
    priors.offset = s.offset ? 1 : 0;
    if (s.offset_deviation > 0.0) {
      priors.air = {0.0, detail::combined(s.offset_deviation, s.surface_deviation)};
    }
    return priors;
  }

  void advance(const Sample& sample, double dt) noexcept {
    const double depth = sample.penetration > surface_depth ? sample.penetration : 0.0;
    const double step = dt + passed_;
    passed_ = 0.0;
    const bool both = depth > 0.0 && solver_.samples().touching();
    if (!begun_ && !both) {
      solver_.samples().begin(depth);
      began_in_contact_ = began_in_contact_ || depth > 0.0;
    } else {
      // If the probe was in the material before and after a gap, contact most likely continued as
      // before, as in recordings of every tenth cycle: the relaxation state is kept.
      const bool gap = !begun_ || step > longest_gap * std::max(sample_time(), last_step_);
      solver_.samples().advance(depth, both && gap ? sample_time() : step);
    }
    begun_ = true;
    last_step_ = step;
  }

  void renew_offset() noexcept {
    if (!air_is_new_) return;
    air_is_new_ = false;
    if (solver_.priors().offset == 0 || !air_.known()) return;
    const detail::Tare tare =
        detail::measured_offset(true, offset_deviation_, surface_deviation_, air_, 0.0);
    tare_refuted_ = tare.refuted;
    solver_.know_offset(tare.prior);
  }

  Matrix<order + 1> covariance(const Units& units) const noexcept {
    return viscoelastic::law_covariance(viscoelastic::covariance_in_si(solver_.solution(), units));
  }

  std::uint8_t flags(const viscoelastic::Solution& now) const noexcept {
    using namespace viscoelastic;
    std::uint8_t found = 0;
    const double exponent =
        Grid::step * std::sqrt(now.covariance[in_triangle(exponent_node, exponent_node)]);
    const double damper = std::sqrt(now.covariance[in_triangle(damping, damping)]);
    double spring = now.fit.value[stiffness];
    for (std::size_t i = memory; i < parts; ++i) spring += now.fit.value[i];
    spring = std::abs(spring);
    const bool searched = !now.law().linear && !(solver_.priors().exponent > 0.0);
    if (now.known == 0 || (searched && !(exponent < largest_exponent_error))) {
      found |= exponent_not_identifiable;
    }
    const bool damped = now.law().damping != Damping::none;
    if (now.known == 0 || (damped && !(damper < largest_damping_error * spring))) {
      found |= damping_not_identifiable;
    }
    if (now.at_edge != 0) found |= exponent_at_edge;
    const bool tared = offset_deviation_ > 0.0;
    if (tare_refuted_ || (tared && solver_.offset_refuted())) found |= tare_refuted;
    return found;
  }

  viscoelastic::Solver solver_;
  detail::FreeAir air_;
  double passed_ = 0.0;     // s since the last sample that was not refused
  double last_step_ = 0.0;  // s
  double offset_deviation_;
  double surface_deviation_;
  bool begun_ = false;
  bool began_in_contact_ = false;
  bool air_is_new_ = false;
  bool tare_refuted_ = false;
};

}  // namespace palpate
