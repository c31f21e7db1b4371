// Gate + method + forgetting: an estimator that a control loop calls once a sample.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "palpate/contact_gate.hpp"
#include "palpate/double_stage.hpp"
#include "palpate/estimate.hpp"
#include "palpate/forgetting.hpp"
#include "palpate/regression_method.hpp"
#include "palpate/scale.hpp"
#include "palpate/status.hpp"

namespace palpate {

// Scaled inputs beyond this are refused: their squares and products stay finite below it.
inline constexpr double largest_input = 1e100;

template <class Method>
class RecursiveEstimator {
 public:
  using Law = typename Method::Law;
  static constexpr std::size_t order = Method::order;

  struct Settings {
    typename Method::Settings method;
    Forgetting::Settings forgetting{};
    SelfPerturbation perturbation{};
    ContactGate::Settings gate{};
    Scale scale{};
    double sample_time = 1e-3;  // s
  };

  explicit RecursiveEstimator(const Settings& settings) noexcept
      : settings_(settings),
        gate_(settings.gate),
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

  // The force that the present estimate gives, N; zero out of contact.
  double predict(double penetration, double velocity) const noexcept {
    return law().force(penetration, velocity);
  }

  Law law() const noexcept { return method_.law(units_); }

  Estimate<order> estimate() const noexcept {
    const Law now = law();
    return {now.parameters(),
            method_.covariance(now, units_),
            validity_margin(now, velocity_),
            status_,
            samples_,
            guarded_};
  }

  // A row of a trace: what of the estimate changes with every sample.
  Moment<order> moment() const noexcept {
    const Law now = law();
    return {now.parameters(), method_.variances(now, units_), validity_margin(now, velocity_)};
  }

  const Settings& settings() const noexcept { return settings_; }

  // The recursion inside, for θ and P as they are, in scaled units.
  const Method& method() const noexcept { return method_; }

  void reset() noexcept { *this = RecursiveEstimator(settings_); }

 private:
  static bool finite(const Sample& s) noexcept {
    return std::isfinite(s.penetration) && std::isfinite(s.velocity) && std::isfinite(s.force);
  }

  static bool in_range(const Sample& s) noexcept {
    return s.penetration > 0.0 && s.force > 0.0 && s.penetration < largest_input &&
           std::abs(s.velocity) < largest_input && s.force < largest_input;
  }

  Status step(const Sample& sample, double dt, double* predicted_force) noexcept {
    if (!finite(sample)) return Status::not_finite;
    const bool valid_step = dt > 0.0 && std::isfinite(dt);
    const ContactGate::Phase phase = gate_.next(sample.penetration, sample.force);
    const Sample inner = scaled(sample, units_);
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
    // An abrupt change perturbs P and takes λ back to λ₀.
    const auto adapt = [&](auto&& predict_scaled) noexcept {
      double perturbation = 0.0;
      if (predicted_force || settings_.perturbation.active()) {
        const double predicted = predict_scaled() * units_.force;
        if (predicted_force) *predicted_force = predicted;
        perturbation = settings_.perturbation(sample.force - predicted);
        if (perturbation > 0.0) forgetting.rearm();
      }
      return std::pair{forgetting.factor(), perturbation};
    };
    const Status status = method_.learn(inner, adapt);
    if (!taken(status)) return status;

    gate_.enter(ContactGate::Phase::contact);
    forgetting_ = forgetting;
    velocity_ = sample.velocity;
    status_ = status;
    ++samples_;
    if (status == Status::guarded) ++guarded_;
    return status;
  }

  Settings settings_;
  ContactGate gate_;
  Forgetting forgetting_;
  Units units_;
  Method method_;
  double velocity_ = 0.0;
  Status status_ = Status::waiting;
  std::uint64_t samples_ = 0;
  std::uint64_t guarded_ = 0;
};

using KelvinVoigtRLS = RecursiveEstimator<RegressionMethod<KelvinVoigtRegression>>;
using ExtendedKelvinVoigtRLS = RecursiveEstimator<RegressionMethod<ExtendedKelvinVoigtRegression>>;
using SingleStageRLS = RecursiveEstimator<RegressionMethod<HuntCrossleyLogRegression>>;
using DoubleStageRLS = RecursiveEstimator<DoubleStageMethod>;

}  // namespace palpate
