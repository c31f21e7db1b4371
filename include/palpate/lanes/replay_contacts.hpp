// Many contacts of one length, several at once in vector lanes, through the recursion of
// recursive_estimator.hpp; what an estimator's lanes do not take goes through itself.
//
//   palpate::lanes::replay_contacts(settings, contacts, 0, contacts.count, palpate::lanes::kernels,
//                                   [&](std::size_t contact, const auto& estimator) { … });
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "palpate/estimators.hpp"
#include "palpate/lanes/lane_state.hpp"
#include "palpate/least_squares.hpp"

namespace palpate::lanes {

// Row-major, `count` rows of `samples`, SI. Gates and scales are three numbers a contact, in the
// order of their settings, or null where all contacts have those of the settings.
struct Contacts {
  const double* penetration;
  const double* velocity;
  const double* force;
  std::size_t count;
  std::size_t samples;
  const double* gates = nullptr;
  const double* scales = nullptr;
  // Where it is asked for: how many samples of each were taken without condition 10.
  std::uint64_t* violated = nullptr;
  // Where it is asked for: the status of every sample, by rows. Contacts then go one at a time.
  std::uint8_t* statuses = nullptr;

  template <class Settings>
  Settings settings_of(Settings settings, std::size_t contact) const noexcept {
    if (gates) {
      const double* own = gates + 3 * contact;
      settings.gate = {own[0], own[1], own[2]};
    }
    if (scales) {
      const double* own = scales + 3 * contact;
      settings.scale = {own[0], own[1], own[2]};
    }
    return settings;
  }
};

template <class Estimator>
inline constexpr bool has_lanes =
    std::is_same_v<Estimator, KelvinVoigtRLS> ||
    std::is_same_v<Estimator, ExtendedKelvinVoigtRLS> || std::is_same_v<Estimator, SingleStageRLS>;

// Whether lanes take contacts under these settings: all but self-perturbation, which needs the
// force that is predicted. A detector of changes and a rejection of outliers are other estimators.
template <class Estimator>
constexpr bool in_lanes(const typename Estimator::Settings& settings) noexcept {
  if constexpr (has_lanes<Estimator>) {
    using Method = typename Estimator::Method;
    static_assert(sizeof(typename Method::Settings) ==
                      sizeof(double) * (Method::order + Method::order * Method::order),
                  "the method has a setting that lanes know nothing of: decide whether they take "
                  "it, here and in their documentation");
    return !settings.perturbation.active();
  } else {
    return false;
  }
}

// Carries what was learned between estimators and lanes.
struct Access {
  template <class Estimator>
  static void fill(const Estimator& estimator, LaneSettings& to, int lane) noexcept {
    const Units& units = estimator.units_;
    const ContactGate::Settings gate = estimator.method_.gate(estimator.settings_.gate, units);
    to.per_penetration[lane] = units.per_penetration;
    to.per_velocity[lane] = units.per_velocity;
    to.per_force[lane] = units.per_force;
    to.minimum_penetration[lane] = gate.minimum_penetration;
    to.make_force[lane] = gate.make_force;
    to.break_force[lane] = gate.break_force;
    // Normal, and within a tenth of the largest input, in scaled units.
    constexpr double least = 4.0 * 0x1p-1022, most = 0.1 * Estimator::Method::largest_input;
    to.plain_penetration[0][lane] = std::max(gate.minimum_penetration, least * units.penetration);
    to.plain_penetration[1][lane] = most * units.penetration;
    to.plain_force[0][lane] = std::max(gate.make_force, least * units.force);
    to.plain_force[1][lane] = most * units.force;
    to.plain_velocity[lane] = most * units.velocity;
    const auto& initial = estimator.method_.least_squares_.settings().initial_covariance;
    double largest = 0.0;
    for (std::size_t i = 0; i < initial.size(); ++i) largest = std::max(largest, initial[i][i]);
    to.ceiling[lane] = palpate::detail::largest_windup * largest;
    to.departure[lane] = estimator.forgetting_.initial_departure();
    to.decay[lane] = estimator.forgetting_.decay_;
  }

  // Of an estimator that has learned nothing.
  template <class Estimator, int Order>
  static void begin(const Estimator& estimator, LaneState<Order>& to, int lane) noexcept {
    const auto& from = estimator.method_.least_squares_.state();
    load(from, to, lane);
    to.departure[lane] = estimator.forgetting_.departure_;
    to.samples[lane] = 0.0;
    to.last[lane] = to.guarded_last[lane] = -1.0;
    to.guarded[lane] = 0;
    to.violated[lane] = 0.0;
  }

  // `velocity`: of the lane's samples, SI.
  template <class Estimator, int Order>
  static void finish(const LaneState<Order>& from, int lane, const double* velocity,
                     Estimator& estimator) noexcept {
    const auto taken = static_cast<std::uint64_t>(from.samples[lane]);
    auto state = stored<Order>(from, lane);
    state.samples = taken;
    estimator.method_.least_squares_.restore(state);
    estimator.forgetting_.departure_ = from.departure[lane];
    estimator.samples_ = taken;
    estimator.guarded_ = from.guarded[lane];
    if (taken == 0) return;
    estimator.velocity_ = velocity[static_cast<std::size_t>(from.last[lane])];
    if ((from.contact >> lane) & 1U) {
      estimator.gate_.enter(ContactGate::Phase::contact);
      const bool guarded = from.last[lane] == from.guarded_last[lane];
      estimator.status_ = guarded ? Status::guarded : Status::updated;
    } else {
      estimator.gate_.enter(ContactGate::Phase::held);
      estimator.status_ = Status::held;
    }
  }

  // ScalarStep; its context are the estimators of the lanes, whose own state is not asked.
  template <class Estimator, int Order>
  static bool step(void* context, int lane, const double* regressor, double output,
                   double forgetting_factor, std::size_t index, LaneState<Order>& state) {
    auto recursion = static_cast<Estimator*>(context)[lane].method_.least_squares_;
    recursion.restore(stored<Order>(state, lane));
    Vector<Order> phi{};
    for (std::size_t i = 0; i < Order; ++i) phi[i] = regressor[i];
    const Status status = recursion.update(phi, output, forgetting_factor);
    if (!taken(status)) return false;
    load(recursion.state(), state, lane);
    if (status == Status::guarded) {
      ++state.guarded[lane];
      state.guarded_last[lane] = static_cast<double>(index);
    }
    return true;
  }

 private:
  template <int Order>
  static void load(const typename LeastSquares<Order>::State& from, LaneState<Order>& to,
                   int lane) noexcept {
    int entry = 0;
    for (std::size_t i = 0; i < Order; ++i) {
      to.parameters[i][lane] = from.parameters[i];
      for (std::size_t j = i; j < Order; ++j) to.covariance[entry++][lane] = from.covariance[i][j];
    }
    to.residual[lane] = from.residual;
    to.weight[lane] = from.weight;
    to.prior_weight[lane] = from.prior_weight;
  }

  template <int Order>
  static typename LeastSquares<Order>::State stored(const LaneState<Order>& from,
                                                    int lane) noexcept {
    typename LeastSquares<Order>::State to{};
    int entry = 0;
    for (std::size_t i = 0; i < Order; ++i) {
      to.parameters[i] = from.parameters[i][lane];
      for (std::size_t j = i; j < Order; ++j) {
        to.covariance[i][j] = to.covariance[j][i] = from.covariance[entry++][lane];
      }
    }
    to.residual = from.residual[lane];
    to.weight = from.weight[lane];
    to.prior_weight = from.prior_weight[lane];
    return to;
  }
};

namespace detail {

template <class Estimator>
constexpr auto kernel_of(const Kernels& kernels, [[maybe_unused]] bool counting) noexcept {
  if constexpr (std::is_same_v<Estimator, KelvinVoigtRLS>) {
    return kernels.kelvin_voigt;
  } else if constexpr (std::is_same_v<Estimator, ExtendedKelvinVoigtRLS>) {
    return kernels.extended_kelvin_voigt;
  } else {
    return counting ? kernels.single_stage_counting : kernels.single_stage;
  }
}

// Contacts `first` … `first + lanes − 1`.
template <class Estimator, class Sink>
void replay_block(const Estimator& fresh, const Contacts& in, std::size_t first, int lanes,
                  const Kernels& kernels, Estimator (&estimators)[block_lanes], Sink& sink) {
  constexpr int order = static_cast<int>(Estimator::Method::order);
  const bool own_settings = in.gates || in.scales;
  LaneSignals signals{{}, {}, {}, in.samples, lanes};
  LaneSettings settings;
  LaneState<order> state;
  state.contact = 0;
  for (int lane = 0; lane < block_lanes; ++lane) {
    const std::size_t contact = first + static_cast<std::size_t>(lane < lanes ? lane : 0);
    signals.penetration[lane] = in.penetration + contact * in.samples;
    signals.velocity[lane] = in.velocity + contact * in.samples;
    signals.force[lane] = in.force + contact * in.samples;
    estimators[lane] = own_settings ? Estimator(in.settings_of(fresh.settings(), contact)) : fresh;
    Access::fill(estimators[lane], settings, lane);
    Access::begin(estimators[lane], state, lane);
  }
  kernel_of<Estimator>(kernels, in.violated != nullptr)(
      signals, settings, state, &Access::step<Estimator, order>, estimators);
  for (int lane = 0; lane < lanes; ++lane) {
    const std::size_t contact = first + static_cast<std::size_t>(lane);
    Access::finish(state, lane, signals.velocity[lane], estimators[lane]);
    if (in.violated) in.violated[contact] = static_cast<std::uint64_t>(state.violated[lane]);
    sink(contact, estimators[lane]);
  }
}

}  // namespace detail

// Each contact alone, through the estimator itself.
template <class Estimator, class Sink>
void replay_one_by_one(const typename Estimator::Settings& settings, const Contacts& in,
                       std::size_t first, std::size_t last, Sink&& sink) {
  const Estimator fresh(settings);
  const bool own_settings = in.gates || in.scales;
  for (std::size_t contact = first; contact < last; ++contact) {
    Estimator estimator = own_settings ? Estimator(in.settings_of(settings, contact)) : fresh;
    const std::size_t start = contact * in.samples;
    std::uint64_t violated = 0;
    for (std::size_t k = start; k < start + in.samples; ++k) {
      const Status status = estimator.update(in.penetration[k], in.velocity[k], in.force[k]);
      if (in.statuses) in.statuses[k] = static_cast<std::uint8_t>(status);
      if (in.violated && taken(status) &&
          !(validity_margin(estimator.law(), estimator.last_velocity()) > 0.0)) {
        ++violated;
      }
    }
    if (in.violated) in.violated[contact] = violated;
    sink(contact, std::as_const(estimator));
  }
}

// Contacts `first` … `last − 1`, each from a fresh start; `sink(contact, estimator)` is given every
// estimator as its contact left it. In lanes where they take the settings.
template <class Estimator, class Sink>
void replay_contacts(const typename Estimator::Settings& settings, const Contacts& in,
                     std::size_t first, std::size_t last, const Kernels& kernels, Sink&& sink) {
  if constexpr (has_lanes<Estimator>) {
    if (!in.statuses && in_lanes<Estimator>(settings)) {
      const Estimator fresh(settings);
      Estimator estimators[block_lanes];
      for (std::size_t contact = first; contact < last; contact += block_lanes) {
        const std::size_t left = last - contact;
        const int lanes = left < block_lanes ? static_cast<int>(left) : block_lanes;
        detail::replay_block(fresh, in, contact, lanes, kernels, estimators, sink);
      }
      return;
    }
  }
  replay_one_by_one<Estimator>(settings, in, first, last, sink);
}

}  // namespace palpate::lanes
