// The loop of every method, which a controller calls once per sample:
//
//   gate → reject outliers → predict → choose λ and perturbation → learn → detect a change
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "palpate/change_detection.hpp"
#include "palpate/contact_response.hpp"
#include "palpate/estimate.hpp"
#include "palpate/method.hpp"
#include "palpate/outliers.hpp"
#include "palpate/sample.hpp"

namespace palpate {

// Replaces a change detector or outlier rejection that is absent at compile time: it costs no
// memory and no time.
template <class Watcher>
class NotWatching {
 public:
  struct Settings {
    bool operator==(const Settings&) const = default;
    friend constexpr const char* validate(const Settings&) noexcept { return nullptr; }
  };

  constexpr explicit NotWatching(const Settings&) noexcept {}

  static constexpr Watcher* watcher() noexcept { return nullptr; }
};
using NoChangeDetector = NotWatching<ChangeDetector>;
using NoOutlierRejection = NotWatching<OutlierRejection>;

template <Method M, class Detector = NoChangeDetector, class Rejection = NoOutlierRejection>
struct EstimatorSettings {
  typename M::Settings method{};
  Forgetting::Settings forgetting = M::default_forgetting;
  SelfPerturbation perturbation = no_perturbation;
  [[no_unique_address]] typename Detector::Settings changes{};
  [[no_unique_address]] typename Rejection::Settings outliers{};
  ContactGate::Settings gate{};
  Scale scale = M::default_scale;
  double sample_time = 1e-3;  // s

  bool operator==(const EstimatorSettings&) const = default;
};

// The error in these settings as a message; null if they are valid. Constructors do not check: call
// this for settings from outside.
template <Method M, class Detector, class Rejection>
constexpr const char* validate(const EstimatorSettings<M, Detector, Rejection>& settings) noexcept {
  for (const char* fault :
       {validate(settings.method), validate(settings.forgetting), validate(settings.perturbation),
        validate(settings.changes), validate(settings.outliers), validate(settings.gate),
        validate(settings.scale)}) {
    if (fault) return fault;
  }
  return detail::first_fault(
      {{settings.sample_time > 0.0 && settings.sample_time <= 1e6,
        "sample_time must be in (0, 1e6] s"},
       {M::forgets || settings.forgetting == no_forgetting,
        "forgetting must be none: this method does not forget by a factor"},
       {M::perturbs || !settings.perturbation.active(),
        "perturbation must be none: this method has no covariance to increase"}});
}

// The loop without change detector and outlier rejection, which are arguments of each call: it is
// compiled once per method, not once per combination.
template <Method M>
class Recursion {
 public:
  using Method = M;
  using Law = typename M::Law;

  // Whether the present estimate needs a solution; one-step prediction errors then use the latest
  // one.
  static constexpr bool solves = requires(const M& m, const Units& units) { m.latest(units); };

  template <class Settings>
  explicit Recursion(const Settings& settings) noexcept
      : units_(settings.scale),
        method_(settings.method, units_),
        gate_(gate_of(method_, settings.gate, units_)),
        forgetting_(settings.forgetting, settings.sample_time) {}

  // Completes an estimate whose computation is spread over the samples.
  void finish_pending() noexcept
    requires requires(M& method) { method.finish_pending(); }
  {
    method_.finish_pending();
  }

  // Corrects the rounding of the force with the law of an earlier replay of the same samples.
  bool unround_as(const Recursion& earlier) noexcept
    requires requires(M& method) { method.unround_as(method); }
  {
    return method_.unround_as(earlier.method_);
  }

  // The force that the present estimate predicts for the sensor, N; out of contact the offset only.
  double predict(double penetration, double velocity) const noexcept {
    return method_.force(units_, penetration, velocity);
  }

  Law law() const noexcept { return method_.law(units_); }

  // The law of the one-step prediction errors.
  Law latest_law() const noexcept {
    if constexpr (solves) {
      return method_.latest(units_).law;
    } else {
      return law();
    }
  }

  // The part of an estimate that a trace contains for every sample.
  Snapshot<Law> snapshot() const noexcept { return method_.snapshot(units_); }

  // Stiffness and damping that a controller may act on, at a depth [m]; default: the present one.
  // Without a solution of its own: a tenth of the time of estimate(). `fit`: the present fit, if it
  // is known already.
  ContactResponse response(double depth = std::numeric_limits<double>::quiet_NaN(),
                           const ResponsePrior& prior = {},
                           const Fit<Law>* fit = nullptr) const noexcept {
    const double frequency = watch_.frequency();
    if (!std::isfinite(depth)) depth = watch_.position();
    return watch_.response(law_response(depth, frequency, fit), std::max(depth, shallowest),
                           frequency, velocity_, taken(status_), prior);
  }

  // The present fit, from which estimate() and response() are computed.
  Fit<Law> fit() const noexcept { return method_.fit(units_); }

  double last_velocity() const noexcept { return velocity_; }
  const Units& units() const noexcept { return units_; }

  // Whether a restored state is within its ranges.
  bool sound() const noexcept {
    if constexpr (requires { method_.sound(); }) {
      if (!method_.sound()) return false;
    }
    return gate_.phase() <= ContactGate::Phase::held &&
           static_cast<std::size_t>(status_) < status_count;
  }

  // The method itself, for θ and P in scaled units.
  const M& method() const noexcept { return method_; }

 protected:
  struct Outcome {
    Status status;
    double predicted_force;  // N; NaN if not requested
  };

  // `changes` and `outliers` are null if absent.
  [[gnu::always_inline]] Outcome step(const Sample& sample, double dt,
                                      const SelfPerturbation& perturbation, ChangeDetector* changes,
                                      OutlierRejection* outliers, bool predict_force) noexcept {
    constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
    const bool valid_step = dt > 0.0 && std::isfinite(dt);
    if (!detail::finite(sample)) {
      if (valid_step) pass(dt);
      return {Status::not_finite, unknown};
    }
    const Sample inner = detail::scaled(sample, units_);
    const ContactGate::Phase phase = gate_.next(sample.penetration, sample.force);
    const bool touching = phase == ContactGate::Phase::contact;
    const bool in_range = touching && method_.in_range(inner);
    if (outliers) {
      const auto law = [this](double x, double v) noexcept { return predict(x, v); };
      if (valid_step && in_range == touching && outliers->rejects(sample, dt, touching, law)) {
        if constexpr (requires { method_.withdraw(std::size_t{}); }) {
          if (const std::size_t count = outliers->withdrawn()) method_.withdraw(count);
        }
        if constexpr (requires { method_.pass(dt); }) method_.pass(dt);
        watch_.reject(sample, dt);
        return {Status::rejected, predict_force ? expected_force(sample) : unknown};
      }
    }
    if (valid_step && in_range) [[likely]] {
      return take(sample, inner, dt, perturbation, changes, predict_force);
    }
    const double predicted = predict_force ? expected_force(sample) : unknown;
    if (!valid_step) return {Status::invalid_step, predicted};
    if (touching) {
      pass(dt);
      return {Status::out_of_range, predicted};
    }
    if constexpr (requires { method_.free(inner, dt, 1.0); }) {
      method_.free(inner, dt, forgetting_.factor());
    }
    watch_.free(sample, dt);
    enter(phase);
    return {status_, predicted};
  }

  void leave_contact(OutlierRejection* outliers) noexcept {
    if constexpr (requires { method_.interrupt(); }) method_.interrupt();
    if (outliers) outliers->interrupt();
    watch_.leave();
    enter(gate_.without_contact());
  }

  Estimate<Law::size> estimate(const Fit<Law>& fit, std::uint64_t rejected) const noexcept {
    const double margin = validity_margin(fit.law, velocity_);
    return {{fit.surface, fit.flags, margin, status_, samples_, guarded_, restarts_, rejected},
            fit.law.parameters(),
            fit.covariance,
            fit.offset};
  }

 private:
  static constexpr double shallowest = 1e-9;  // m

  detail::LawResponse law_response(double depth, double frequency,
                                   const Fit<Law>* fit = nullptr) const noexcept {
    depth = std::max(depth, shallowest);
    // After a change the old law tells more than what is usual.
    const double velocity = restarts_ == 0 ? velocity_ : 0.0;
    if constexpr (requires { method_.response(units_, depth, frequency); }) {
      return method_.response(units_, depth, frequency);
    } else if constexpr (requires { method_.latest_fit(units_); }) {
      const Fit<Law> latest = method_.latest_fit(units_);
      return detail::law_response(latest, std::max(depth - latest.surface.value, shallowest),
                                  velocity);
    } else {
      return detail::law_response(fit ? *fit : this->fit(), depth, velocity);
    }
  }

  // Advances the time for a sample that is not taken.
  void pass(double dt) noexcept {
    if constexpr (requires { method_.pass(dt); }) method_.pass(dt);
    watch_.pass(dt);
  }

  static ContactGate::Settings gate_of(M& method, const ContactGate::Settings& given,
                                       const Units& units) noexcept {
    if constexpr (requires { method.gate(given, units); }) return method.gate(given, units);
    return given;
  }

  // Learns a sample in contact and in range. The loop's state changes only after the method has
  // learned it.
  [[gnu::always_inline]] Outcome take(const Sample& sample, const Sample& inner, double dt,
                                      const SelfPerturbation& self_perturbation,
                                      ChangeDetector* changes, bool predict_force) noexcept {
    Forgetting forgetting = forgetting_;
    if (gate_.phase() == ContactGate::Phase::contact) {
      forgetting.advance(dt);
    } else {
      forgetting.rearm();
    }

    double predicted = std::numeric_limits<double>::quiet_NaN(), error = 0.0;
    const typename M::Row row = method_.prepare(inner, dt);
    if (predict_force || changes || self_perturbation.active()) {
      predicted = method_.predict(row) * units_.force;
      error = detail::saturate(sample.force - predicted);
    }

    // Choose λ and the perturbation: an abrupt change perturbs P and resets λ to λ₀.
    const double perturbation = self_perturbation(error);
    if (perturbation > 0.0) forgetting.rearm();

    Status status = method_.learn(row, dt, forgetting.factor(), perturbation);
    if (status == Status::held) {  // undecided: the method keeps it; the contact phase stays
      watch_.approach(sample, dt);
      enter(gate_.phase());
      return {status_, predicted};
    }
    if (!taken(status)) return {status, predicted};
    if constexpr (requires { method_.residual_variance(); }) {
      const double unit = units_.force;
      watch_.touch(sample, dt, method_.renewed());
      watch_.compare(sample.force, row.predicted * unit, method_.residual_variance() * unit * unit);
    } else {
      watch_.touch(sample, dt, true);
    }

    if (changes) {
      const double expected = sample.force - error;
      if (watch(*changes, inner, dt, expected, error, forgetting)) status = Status::restarted;
    }
    commit(sample, status, forgetting);
    return {status, predicted};
  }

  // The predicted force of a sample that is not taken.
  double expected_force(const Sample& sample) const noexcept {
    if constexpr (solves) {
      return method_.latest(units_).force(sample.penetration, sample.velocity);
    } else {
      return predict(sample.penetration, sample.velocity);
    }
  }

  void commit(const Sample& sample, Status status, const Forgetting& forgetting) noexcept {
    gate_.enter(ContactGate::Phase::contact);
    forgetting_ = forgetting;
    velocity_ = sample.velocity;
    status_ = status;
    ++samples_;
    if (status == Status::guarded) ++guarded_;
  }

  void enter(ContactGate::Phase phase) noexcept {
    gate_.enter(phase);
    status_ = phase == ContactGate::Phase::waiting ? Status::waiting : Status::held;
  }

  // True when a change is detected. The method then restarts with the samples after it.
  bool watch(ChangeDetector& changes, const Sample& inner, double dt, double predicted,
             double error, Forgetting& forgetting) noexcept {
    if (gate_.phase() != ContactGate::Phase::contact) changes.interrupt();
    if (changes.observe(inner, dt, predicted, error)) {
      watch_.restart(law_response(watch_.position(), watch_.frequency()));
      method_.reinitialise();
      relearn(changes, changes.post_change_samples(), forgetting);
      changes.rearm();
      ++restarts_;
      return true;
    }
    if (changes.transient_over()) {
      method_.reinitialise_after_transient();
      relearn(changes, changes.settled_samples(), forgetting);
    }
    return false;
  }

  // Learns this many of the latest samples again, with their own time steps, as if contact began
  // with the first of them. This is rare, so it is separate from the code for every sample.
  [[gnu::cold, gnu::noinline]] void relearn(const ChangeDetector& changes, std::size_t samples,
                                            Forgetting& forgetting) noexcept {
    forgetting.rearm();
    for (std::size_t age = samples; age-- > 0;) {
      const TakenSample& past = changes.recent(age);
      if (age + 1 < samples) forgetting.advance(past.dt);
      method_.learn(method_.prepare(past.sample, past.dt), past.dt, forgetting.factor(), 0.0);
    }
  }

  Units units_;
  M method_;
  ContactGate gate_;
  Forgetting forgetting_;
  detail::ContactWatch watch_;
  double velocity_ = 0.0;
  Status status_ = Status::waiting;
  std::uint64_t samples_ = 0;
  std::uint64_t guarded_ = 0;
  std::uint64_t restarts_ = 0;
};

// The loop with its settings, change detector and outlier rejection.
template <Method M, class Detector = NoChangeDetector, class Rejection = NoOutlierRejection>
class RecursiveEstimator : public Recursion<M> {
 public:
  using Changes = Detector;
  using Outliers = Rejection;
  using Settings = EstimatorSettings<M, Detector, Rejection>;

  explicit RecursiveEstimator(const Settings& settings = {}) noexcept(in_place)
      : Recursion<M>(settings),
        settings_(settings),
        changes_(settings.changes),
        outliers_(settings.outliers) {}

  Status update(double penetration, double velocity, double force) noexcept {
    return update(penetration, velocity, force, settings_.sample_time);
  }

  // dt: time since the previous sample, s. A refused sample changes nothing but the time.
  Status update(double penetration, double velocity, double force, double dt) noexcept {
    return step({penetration, velocity, force}, dt, false).status;
  }

  // update(), which also returns the one-step prediction of the force [N]; NaN if the sample is not
  // finite.
  Status update(const Sample& sample, double dt, double& predicted_force) noexcept {
    const auto outcome = step(sample, dt, true);
    predicted_force = outcome.predicted_force;
    return outcome.status;
  }

  // Ends the contact, as at the end of a recording or a change of the tool: the estimate is held
  // until the next contact.
  void leave_contact() noexcept { Recursion<M>::leave_contact(outliers()); }

  Estimate<M::Law::size> estimate() const noexcept { return estimate(this->fit()); }
  Estimate<M::Law::size> estimate(const Fit<typename M::Law>& fit) const noexcept {
    const OutlierRejection* outliers = outliers_.watcher();
    return Recursion<M>::estimate(fit, outliers ? outliers->rejected() : 0);
  }

  const Settings& settings() const noexcept { return settings_; }
  // Null if absent.
  ChangeDetector* changes() noexcept { return changes_.watcher(); }
  OutlierRejection* outliers() noexcept { return outliers_.watcher(); }

  void reset() noexcept(in_place) { *this = RecursiveEstimator(settings_); }

 private:
  // Whether all memory is inside the object, without a heap, as a controller needs it.
  static constexpr bool in_place =
      std::is_trivially_copyable_v<Detector> && std::is_trivially_copyable_v<Rejection>;

  [[gnu::always_inline]] auto step(const Sample& sample, double dt, bool predict_force) noexcept {
    return Recursion<M>::step(sample, dt, settings_.perturbation, changes(), outliers(),
                              predict_force);
  }

  Settings settings_;
  [[no_unique_address]] Detector changes_;
  [[no_unique_address]] Rejection outliers_;
};

}  // namespace palpate
