// Gate + method + forgetting: an estimator that a control loop calls once a sample.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "palpate/change_detection.hpp"
#include "palpate/contact_gate.hpp"
#include "palpate/double_stage.hpp"
#include "palpate/drift_method.hpp"
#include "palpate/estimate.hpp"
#include "palpate/forgetting.hpp"
#include "palpate/projection_method.hpp"
#include "palpate/regression_method.hpp"
#include "palpate/scale.hpp"
#include "palpate/status.hpp"
#include "palpate/surface_search.hpp"

namespace palpate {

template <class Method>
class RecursiveEstimator {
 public:
  using Law = typename Method::Law;
  static constexpr std::size_t order = Method::order;

  struct Settings {
    typename Method::Settings method;
    Forgetting::Settings forgetting{};
    SelfPerturbation perturbation{};
    ChangeDetector::Settings changes{};
    ContactGate::Settings gate{};
    Scale scale{};
    double sample_time = 1e-3;  // s
  };

  explicit RecursiveEstimator(const Settings& settings) noexcept
      : settings_(settings),
        gate_(settings.gate),
        changes_(settings.changes),
        forgetting_(settings.forgetting, settings.sample_time),
        units_(settings.scale),
        method_(settings.method, units_) {}

  Status update(double penetration, double velocity, double force) noexcept {
    return update(penetration, velocity, force, settings_.sample_time);
  }

  // dt: time since the previous sample, s. The sample is taken whole or not at all.
  Status update(double penetration, double velocity, double force, double dt) noexcept {
    return step({penetration, velocity, force}, dt, nullptr);
  }

  // update(), which also writes down the a-priori force [N] that the sample is compared with.
  Status update(const Sample& sample, double dt, double& predicted_force) noexcept {
    predicted_force = std::numeric_limits<double>::quiet_NaN();
    return step(sample, dt, &predicted_force);
  }

  // The force that the sensor would show by the present estimate, N; no law acts out of contact.
  double predict(double penetration, double velocity) const noexcept {
    return method_.force(units_, penetration, velocity);
  }

  Law law() const noexcept { return method_.law(units_); }

  Estimate<order> estimate() const noexcept {
    const Fit<Law> fit = method_.fit(units_);
    return {fit.law.parameters(),
            fit.covariance,
            fit.offset,
            fit.surface,
            fit.doubts,
            validity_margin(fit.law, velocity_),
            status_,
            samples_,
            guarded_,
            restarts_};
  }

  // The part of an estimate that a trace writes down at every sample.
  Moment<Law> moment() const noexcept { return method_.moment(units_); }

  double last_velocity() const noexcept { return velocity_; }
  const Settings& settings() const noexcept { return settings_; }

  // The recursion inside, for θ and P as they are, in scaled units.
  const Method& method() const noexcept { return method_; }

  void reset() noexcept { *this = RecursiveEstimator(settings_); }

 private:
  static bool finite(const Sample& s) noexcept {
    return std::isfinite(s.penetration) && std::isfinite(s.velocity) && std::isfinite(s.force);
  }

  bool in_range(const Sample& s) const noexcept {
    constexpr double limit = Method::largest_input;
    if constexpr (requires { method_.largest_penetration(); }) {
      if (!(s.penetration < method_.largest_penetration())) return false;
    }
    const bool signs = Method::takes_approach || (s.penetration > 0.0 && s.force > 0.0);
    return signs && std::abs(s.penetration) < limit && std::abs(s.velocity) < limit &&
           std::abs(s.force) < limit;
  }

  // A method that searches for the surface takes the approach to it too, whatever the force.
  ContactGate::Phase next_phase(const Sample& sample, const Sample& inner) const noexcept {
    if constexpr (Method::takes_approach) {
      // A tenth of the unit before the first candidate is enough to know the force in the free.
      if (inner.penetration > method_.lowest_surface() - 0.1) return ContactGate::Phase::contact;
      const bool waiting = gate_.phase() == ContactGate::Phase::waiting;
      return waiting ? ContactGate::Phase::waiting : ContactGate::Phase::held;
    }
    return gate_.next(sample.penetration, sample.force);
  }

  Status step(const Sample& sample, double dt, double* predicted_force) noexcept {
    if (!finite(sample)) return Status::not_finite;
    const bool valid_step = dt > 0.0 && std::isfinite(dt);
    const Sample inner = scaled(sample, units_);
    const ContactGate::Phase phase = next_phase(sample, inner);
    if (valid_step && phase == ContactGate::Phase::contact && in_range(inner)) [[likely]] {
      return learn(sample, inner, dt, predicted_force);
    }
    if (predicted_force) *predicted_force = predict(sample.penetration, sample.velocity);
    if (!valid_step) return Status::invalid_step;
    if (phase == ContactGate::Phase::contact) return Status::out_of_range;
    gate_.enter(phase);
    return status_ = phase == ContactGate::Phase::waiting ? Status::waiting : Status::held;
  }

  Status learn(const Sample& sample, const Sample& inner, double dt,
               double* predicted_force) noexcept {
    Forgetting forgetting = forgetting_;
    if (gate_.phase() == ContactGate::Phase::contact) {
      forgetting.advance(dt);
    } else {
      forgetting.rearm();
    }
    // Before the method refreshes the answer that it measures errors against.
    if (predicted_force && Method::prediction_lags) {
      *predicted_force = predict(sample.penetration, sample.velocity);
    }
    // An abrupt change perturbs P and takes λ back to λ₀.
    double error = 0.0;
    const auto adapt = [&](auto&& predict_scaled) noexcept {
      double perturbation = 0.0;
      if (predicted_force || settings_.perturbation.active() || changes_.active()) {
        const double predicted = predict_scaled() * units_.force;
        if (predicted_force && !Method::prediction_lags) *predicted_force = predicted;
        error = saturate(sample.force - predicted);
        perturbation = settings_.perturbation(error);
        if (perturbation > 0.0) forgetting.rearm();
      }
      return std::pair{forgetting.factor(), perturbation};
    };
    Status status = method_.learn(inner, dt, adapt);
    if (!taken(status)) return status;
    if (changes_.active()) {
      if (changes_.observe(inner, error)) {
        method_.restart();
        begin_with(changes_.suspects(), forgetting);
        changes_.rearm();
        ++restarts_;
        status = Status::restarted;
      } else if (changes_.over()) {
        method_.restart_again();
        begin_with(changes_.certain(), forgetting);
      }
    }

    gate_.enter(ContactGate::Phase::contact);
    forgetting_ = forgetting;
    velocity_ = sample.velocity;
    status_ = status;
    ++samples_;
    if (status == Status::guarded) ++guarded_;
    return status;
  }

  // The estimate begins anew with this many of the latest samples.
  void begin_with(std::size_t samples, Forgetting& forgetting) noexcept {
    forgetting.rearm();
    const auto adapt = [&](auto&&) noexcept { return std::pair{forgetting.factor(), 0.0}; };
    for (std::size_t age = samples; age-- > 0;) {
      method_.learn(changes_.recent(age), settings_.sample_time, adapt);
      forgetting.advance(settings_.sample_time);
    }
  }

  Settings settings_;
  ContactGate gate_;
  ChangeDetector changes_;
  Forgetting forgetting_;
  Units units_;
  Method method_;
  double velocity_ = 0.0;
  Status status_ = Status::waiting;
  std::uint64_t samples_ = 0;
  std::uint64_t guarded_ = 0;
  std::uint64_t restarts_ = 0;
};

using KelvinVoigtRLS = RecursiveEstimator<RegressionMethod<KelvinVoigtRegression>>;
using ExtendedKelvinVoigtRLS = RecursiveEstimator<RegressionMethod<ExtendedKelvinVoigtRegression>>;
using SingleStageRLS = RecursiveEstimator<RegressionMethod<HuntCrossleyLogRegression>>;
using DoubleStageRLS = RecursiveEstimator<DoubleStageMethod>;
using ProjectionEstimator = RecursiveEstimator<ProjectionMethod<VariableProjection>>;
using DriftEstimator = RecursiveEstimator<DriftMethod>;
using SurfaceEstimator = RecursiveEstimator<ProjectionMethod<SurfaceSearch>>;

}  // namespace palpate
