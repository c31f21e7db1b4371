// least_squares.hpp in lanes, behind the gate: θ, P and the sums of several contacts in registers.
//
// A lane takes its sample where every test of the scalar recursion is passed with room to spare;
// where one is not, the scalar recursion takes that lane's sample.
#pragma once

#include <cstddef>

#include "palpate/lanes/instruction_set.hpp"
#include "palpate/lanes/lane_state.hpp"
#include "palpate/lanes/pack.hpp"
#include "palpate/lanes/sample_block.hpp"

namespace palpate::lanes {
inline namespace PALPATE_LANES_SET {

// P as its upper triangle by rows: where entry (i, j) stands.
template <int Order>
constexpr int entry(int i, int j) noexcept {
  return i <= j ? i * Order - i * (i - 1) / 2 + j - i : entry<Order>(j, i);
}

// Calls act with Index<0> … Index<Order − 1>, and with every pair (i, j) of them, j ≥ i.
template <int Order, class Act>
PALPATE_LANES_INLINE void each_entry(const Act& act) noexcept {
  each<Order>([&](auto row) PALPATE_LANES_LAMBDA {
    each<Order - decltype(row)::value>([&](auto right) PALPATE_LANES_LAMBDA {
      act(row, Index<decltype(row)::value + decltype(right)::value>{});
    });
  });
}

template <int Order, int Lanes>
struct Learned {
  using Doubles = Pack<Lanes>;
  static constexpr int entries = LaneState<Order>::entries;

  Doubles parameters[Order];
  Doubles covariance[entries];
  Doubles residual, weight, prior_weight;

  PALPATE_LANES_INLINE void load(const LaneState<Order>& from, int lane) noexcept {
    each<Order>([&](auto i) PALPATE_LANES_LAMBDA {
      parameters[i.value] = Doubles::load(from.parameters[i.value] + lane);
    });
    each<entries>([&](auto i) PALPATE_LANES_LAMBDA {
      covariance[i.value] = Doubles::load(from.covariance[i.value] + lane);
    });
    residual = Doubles::load(from.residual + lane);
    weight = Doubles::load(from.weight + lane);
    prior_weight = Doubles::load(from.prior_weight + lane);
  }

  PALPATE_LANES_INLINE void store(LaneState<Order>& to, int lane) const noexcept {
    each<Order>([&](auto i) PALPATE_LANES_LAMBDA {
      parameters[i.value].store(to.parameters[i.value] + lane);
    });
    each<entries>([&](auto i) PALPATE_LANES_LAMBDA {
      covariance[i.value].store(to.covariance[i.value] + lane);
    });
    residual.store(to.residual + lane);
    weight.store(to.weight + lane);
    prior_weight.store(to.prior_weight + lane);
  }

  PALPATE_LANES_INLINE void take(const Learned& next) noexcept {
    each<Order>([&](auto i)
                    PALPATE_LANES_LAMBDA { parameters[i.value] = next.parameters[i.value]; });
    each<entries>([&](auto i)
                      PALPATE_LANES_LAMBDA { covariance[i.value] = next.covariance[i.value]; });
    residual = next.residual;
    weight = next.weight;
    prior_weight = next.prior_weight;
  }

  PALPATE_LANES_INLINE void take(const Mask<Lanes>& which, const Learned& next) noexcept {
    each<Order>([&](auto i) PALPATE_LANES_LAMBDA {
      parameters[i.value] = select(which, next.parameters[i.value], parameters[i.value]);
    });
    each<entries>([&](auto i) PALPATE_LANES_LAMBDA {
      covariance[i.value] = select(which, next.covariance[i.value], covariance[i.value]);
    });
    residual = select(which, next.residual, residual);
    weight = select(which, next.weight, weight);
    prior_weight = select(which, next.prior_weight, prior_weight);
  }

  // The test of is_positive_definite(), with its margin.
  PALPATE_LANES_INLINE Mask<Lanes> definite() const noexcept {
    constexpr double margin = 8.0 * Order * Order * 0x1p-52;
    const Doubles kept = Doubles::all(1.0 - margin);
    const Doubles first = kept * covariance[0];
    if constexpr (Order == 2) {
      const Doubles minor = first * (kept * covariance[2]) - covariance[1] * covariance[1];
      return minor > Doubles::all(0.0);
    } else {
      static_assert(Order == 3);
      const Doubles minor = first * (kept * covariance[3]) - covariance[1] * covariance[1];
      const Doubles across = first * covariance[4] - covariance[1] * covariance[2];
      const Doubles last = first * (kept * covariance[5]) - covariance[2] * covariance[2];
      return (minor > Doubles::all(0.0)) & (minor * last > across * across);
    }
  }

  // Where θ stays below its bound of 1e100 for a block of samples, if next() finds each of them
  // sound: |Δθᵢ| ≤ √(Pᵢᵢ e²/(λ + φᵀPφ)) ≤ √(1e26 · 1e70/λ), of P within its ceiling.
  PALPATE_LANES_INLINE Mask<Lanes> far_within(const Doubles& departure) const noexcept {
    Doubles magnitude = abs(parameters[0]);
    each<Order - 1>(
        [&](auto i) PALPATE_LANES_LAMBDA { magnitude = magnitude + abs(parameters[i.value + 1]); });
    return (magnitude <= Doubles::all(1e60)) & (departure <= Doubles::all(0.999999));
  }

  // One application of eq. 13 without perturbation, and whether it may stand in each lane.
  //
  // One division stands for the ten of the scalar recursion: the last bits of a step may differ.
  PALPATE_LANES_INLINE Mask<Lanes> next(const Doubles (&phi)[Order], const Doubles& output,
                                        const Doubles& factor, const Doubles& ceiling,
                                        Learned& to) const noexcept {
    Doubles g[Order];
    Doubles spread, predicted;
    each<Order>([&](auto row) PALPATE_LANES_LAMBDA {
      constexpr int i = decltype(row)::value;
      g[i] = covariance[entry<Order>(i, 0)] * phi[0];
      each<Order - 1>([&](auto column) PALPATE_LANES_LAMBDA {
        constexpr int j = decltype(column)::value + 1;
        g[i] = g[i] + covariance[entry<Order>(i, j)] * phi[j];
      });
      if constexpr (i == 0) {
        spread = phi[0] * g[0];
        predicted = phi[0] * parameters[0];
      } else {
        spread = spread + phi[i] * g[i];
        predicted = predicted + phi[i] * parameters[i];
      }
    });
    const Doubles error = output - predicted;
    const Doubles innovation = factor + spread;
    const Doubles one = Doubles::all(1.0);
    const Doubles per_both = one / (factor * innovation);
    const Doubles per_factor = per_both * innovation;
    const Doubles per_innovation = per_both * factor;

    Doubles gain[Order];
    each<Order>([&](auto i) PALPATE_LANES_LAMBDA {
      gain[i.value] = g[i.value] * per_innovation;
      to.parameters[i.value] = parameters[i.value] + gain[i.value] * error;
    });
    each_entry<Order>([&](auto row, auto column) PALPATE_LANES_LAMBDA {
      constexpr int i = decltype(row)::value, j = decltype(column)::value;
      constexpr int at = entry<Order>(i, j);
      to.covariance[at] = (covariance[at] - gain[i] * g[j]) * per_factor;
    });
    to.residual = factor * (residual + error * (error * per_innovation));
    to.weight = factor * weight + one;
    to.prior_weight = prior_weight * factor;

    Doubles least = to.covariance[0], trace = to.covariance[0];
    each<Order - 1>([&](auto index) PALPATE_LANES_LAMBDA {
      constexpr int i = decltype(index)::value + 1;
      least = lesser(to.covariance[entry<Order>(i, i)], least);
      trace = trace + to.covariance[entry<Order>(i, i)];
    });
    return (spread >= Doubles::all(0.0)) & (innovation + to.residual <= Doubles::all(1e70)) &
           (least >= Doubles::all(1e-70)) & (trace <= ceiling) & to.definite();
  }
};

// `Lanes` contacts from `lane` on, through a block of samples.
template <class Row, int Lanes, bool Counting>
class LaneGroup {
 public:
  static constexpr int order = Row::order;
  using Doubles = Pack<Lanes>;

  PALPATE_LANES_INLINE LaneGroup(const LaneSettings& settings, LaneState<order>& state, int lane,
                                 ScalarStep<order> scalar_step, void* context) noexcept
      : settings_(settings),
        state_(state),
        lane_(lane),
        scalar_step_(scalar_step),
        context_(context) {}

  PALPATE_LANES_INLINE void run(const SampleBlock& block, const LaneSignals& in, std::size_t first,
                                int count) noexcept {
    Learned<order, Lanes> now;
    now.load(state_, lane_);
    Doubles departure = Doubles::load(state_.departure + lane_);
    const Doubles decay = Doubles::load(settings_.decay + lane_);
    const Doubles ceiling = Doubles::load(settings_.ceiling + lane_);
    const Doubles initial_departure = Doubles::load(settings_.departure + lane_);
    const Doubles one = Doubles::all(1.0);
    [[maybe_unused]] const Doubles zero = Doubles::all(0.0);
    const unsigned far_within = now.far_within(initial_departure).bits();
    unsigned contact = (state_.contact >> lane_) & full;
    [[maybe_unused]] Doubles violated = zero;
    if constexpr (Counting) violated = Doubles::load(state_.violated + lane_);
    int whole = 0, last_whole = -1;  // samples that every lane took

    for (int k = 0; k < count; ++k) {
      fetch_next<Lanes>(in, lane_, first, k);
      const unsigned touching = ((block.makes[k] | (block.keeps[k] & contact << lane_)) >> lane_);
      const unsigned learning = touching & (block.in_range[k] >> lane_) & full;
      const unsigned leaving = (block.finite[k] >> lane_) & ~touching;
      if (learning != 0) {
        Doubles advanced = departure * decay;
        if (contact != full) {
          advanced = select(Mask<Lanes>::of_bits(contact), advanced, initial_departure);
        }
        const Doubles factor = one - advanced;
        Doubles phi[order];
        Row::regressor(Doubles::load(&block.depth[k][lane_]),
                       Doubles::load(&block.velocity[k][lane_]), phi);
        Learned<order, Lanes> next;
        const Doubles output = Doubles::load(&block.output[k][lane_]);
        const unsigned sound = now.next(phi, output, factor, ceiling, next).bits() & far_within;
        if ((sound & learning) == full) [[likely]] {
          now.take(next);
          departure = advanced;
          if constexpr (Counting) {
            violated = violated + select(Row::violated(now.parameters, phi), one, zero);
          }
          ++whole;
          last_whole = k;
          contact = full;
          continue;
        }
        const unsigned taking = sound & learning;
        const Mask<Lanes> which = Mask<Lanes>::of_bits(taking);
        now.take(which, next);
        departure = select(which, advanced, departure);
        unsigned taken = taking;
        if (taking != learning) {
          now.store(state_, lane_);
          departure.store(state_.departure + lane_);
          taken |= take_by_scalar(block, k, first, learning & ~taking, advanced);
          now.load(state_, lane_);
          departure = Doubles::load(state_.departure + lane_);
        }
        count_taken(taken, first + static_cast<std::size_t>(k));
        if constexpr (Counting) {
          const Mask<Lanes> off = Row::violated(now.parameters, phi) & Mask<Lanes>::of_bits(taken);
          violated = violated + select(off, one, zero);
        }
        contact |= taken;
      }
      contact &= ~leaving;
    }
    if constexpr (Counting) violated.store(state_.violated + lane_);
    finish(now, departure, contact, whole, first, last_whole);
  }

 private:
  static constexpr unsigned full = Mask<Lanes>::full;

  [[gnu::cold, gnu::noinline]] unsigned take_by_scalar(const SampleBlock& block, int k,
                                                       std::size_t first, unsigned which,
                                                       const Doubles& departure) noexcept {
    double departures[Lanes];
    departure.store(departures);
    Pack<Lanes> phi[order];
    Row::regressor(Doubles::load(&block.depth[k][lane_]), Doubles::load(&block.velocity[k][lane_]),
                   phi);
    double columns[order][Lanes];
    for (int i = 0; i < order; ++i) phi[i].store(columns[i]);
    unsigned taken = 0;
    for (int i = 0; i < Lanes; ++i) {
      if (((which >> i) & 1U) == 0) continue;
      double regressor[order];
      for (int j = 0; j < order; ++j) regressor[j] = columns[j][i];
      if (!scalar_step_(context_, lane_ + i, regressor, block.output[k][lane_ + i],
                        1.0 - departures[i], first + static_cast<std::size_t>(k), state_)) {
        continue;
      }
      state_.departure[lane_ + i] = departures[i];
      taken |= 1U << i;
    }
    return taken;
  }

  PALPATE_LANES_INLINE void count_taken(unsigned which, std::size_t index) noexcept {
    const Mask<Lanes> taken = Mask<Lanes>::of_bits(which);
    const Doubles samples = Doubles::load(state_.samples + lane_);
    const Doubles last = Doubles::load(state_.last + lane_);
    const Doubles now = Doubles::all(static_cast<double>(index));
    select(taken, samples + Doubles::all(1.0), samples).store(state_.samples + lane_);
    select(taken, now, last).store(state_.last + lane_);
  }

  PALPATE_LANES_INLINE void finish(Learned<order, Lanes>& now, Doubles& departure, unsigned contact,
                                   int whole, std::size_t first, int last_whole) noexcept {
    // What the scalar recursion rounds to nothing at every sample changes no digit until then.
    const Doubles zero = Doubles::all(0.0);
    now.prior_weight = select(now.prior_weight < Doubles::all(1e-30), zero, now.prior_weight);
    departure = select(departure < Doubles::all(1e-20), zero, departure);
    now.store(state_, lane_);
    departure.store(state_.departure + lane_);
    state_.contact = (state_.contact & ~(full << lane_)) | contact << lane_;
    if (last_whole < 0) return;
    const double last = static_cast<double>(first) + last_whole;
    for (int i = lane_; i < lane_ + Lanes; ++i) {
      state_.samples[i] += whole;
      if (state_.last[i] < last) state_.last[i] = last;
    }
  }

  const LaneSettings& settings_;
  LaneState<order>& state_;
  int lane_;
  ScalarStep<order> scalar_step_;
  void* context_;
};

}  // namespace PALPATE_LANES_SET
}  // namespace palpate::lanes
