// Outliers: samples that no probe and no material can produce. One rule finds them,
//
//   |departure| > max(k σ, a part of the size, …),   σ = median |departure|/0.6745,
//
// which outliers hardly influence. The definition of the departure depends on the use:
//
// - spike: departure from the median of five samples around it. LostPositions applies it to
//   positions before a velocity filter, where a dropout would spoil a whole window; for arrays
//   src/bindings/rows.hpp applies it to any channel, with σ, size and step from the whole array
//   instead of from the samples so far;
// - outlier: departure from the extrapolation of the previous sample. OutlierRejection applies it
//   in a loop that must accept or reject a sample before the next one. On an array it also finds
//   the force at which the sensor saturates.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "palpate/sample.hpp"

namespace palpate {

namespace detail {

// Median of |e| over the standard deviation, for normal errors.
constexpr double normal_median = 0.6745;

// A running median of sizes: a larger size raises it by a ratio, a smaller one lowers it by the
// same, whatever the size. A size of zero comes from a held or rounded value and is ignored.
class RunningMedian {
 public:
  double value() const noexcept { return value_; }

  // Factor for its uncertainty: the median of 30 normal sizes is accurate to 25 %, that of the
  // first few to a factor of four.
  double doubt() const noexcept { return seen_ >= few ? 1.0 : seen_ >= 4 ? 4.0 : unknown; }
  // Whether a single outlier changes it only a little.
  bool settled() const noexcept { return seen_ >= 2 * few; }

  void learn(double size) noexcept {
    if (!(size > smallest)) return;
    if (seen_ >= slow) [[likely]] {
      // A table instead of a branch: its direction is unpredictable, and a misprediction costs 5
      // ns.
      value_ *= steps[size > value_];
      return;
    }
    if (++seen_ == 1) value_ = std::min(size, largest);
    const double part = (seen_ < few ? 8.0 : 2.0) / static_cast<double>(seen_);
    const double ratio = 1.0 + std::min(1.0, part);
    value_ = size > value_ ? value_ * ratio : value_ / ratio;
  }

  // Raises the median at least to this size, when what it was learned from no longer holds.
  void raise_to(double size) noexcept { value_ = std::max(value_, std::min(size, largest)); }

 private:
  // The first sizes change it by a factor of two, because a motion may begin slowly; then the k-th
  // by 8/k, from the thirtieth on by 2/k, and finally by a 256th, so that a burst of outliers
  // changes it little.
  static constexpr std::uint32_t few = 30, slow = 512;
  static constexpr double steps[2] = {1.0 / (1.0 + 2.0 / slow), 1.0 + 2.0 / slow};
  static constexpr double smallest = 1e-150, largest = 1e150;
  static constexpr double unknown = std::numeric_limits<double>::infinity();

  double value_ = 0.0;
  std::uint32_t seen_ = 0;
};

// The smallest distance of a spike from the median of five. Rounding up and down is below it.
inline double least_spike(double noise, double largest, double step) noexcept {
  return std::max({8.0 * noise, 0.02 * largest, 1.5 * step});
}

// Whether the middle one of five samples is farther than `limit` from their median, and three times
// as far as its neighbours are from each other: the peak of a sine at 66 Hz is 2 % above its
// neighbours, and the noise of the whole recording does not describe a vibration of a tenth of a
// second.
inline bool is_spike(const double* five, double limit) noexcept {
  constexpr double alone = 3.0;
  // Most samples are near their neighbours' mean and cannot be spikes.
  if (!(std::abs(five[2] - 0.5 * (five[1] + five[3])) > 0.5 * limit)) [[likely]]
    return false;
  std::array<double, 5> sorted;
  std::copy_n(five, 5, sorted.begin());
  std::sort(sorted.begin(), sorted.end());
  const double away = std::abs(five[2] - sorted[2]);
  const auto [low, high] = std::minmax({five[0], five[1], five[3], five[4]});
  return away > limit && away > alone * (high - low);
}

}  // namespace detail

// Finds dropouts of the position, such as lost packets or encoder counts. σ is that of white noise,
// from the running median of the fourth differences, which suppress a motion as (ωT)⁴ and have 70
// times the variance of the noise.
class LostPositions {
 public:
  // The number of later samples that the test of one sample needs.
  static constexpr std::size_t ahead = 2;

  // Adds a position [m], and returns whether the one of two samples ago is a dropout. The first two
  // after a break have no earlier neighbours and are accepted.
  bool observe(double position) noexcept {
    for (std::size_t age = size - 1; age > 0; --age) recent_[age] = recent_[age - 1];
    recent_[0] = position;
    if (held_ > 0) learn_step(std::abs(recent_[0] - recent_[1]));
    if (held_ < size && ++held_ < size) return false;
    if (seen_ < few) ++seen_;

    const double difference =
        recent_[0] + recent_[4] - 4.0 * (recent_[1] + recent_[3]) + 6.0 * recent_[2];
    const bool lost = detail::is_spike(recent_.data(), limit());
    noise_.learn(std::abs(difference));
    if (!lost) largest_ = std::max(fading * largest_, std::abs(recent_[2]));
    return lost;
  }

  // The next position does not continue the latest one.
  void interrupt() noexcept { held_ = 0; }

 private:
  static constexpr std::size_t size = 2 * ahead + 1;
  // Median of |Δ⁴| over the standard deviation of normal noise: 0.6745 √70.
  static constexpr double difference_median = 5.6432;
  // The number of samples from which the noise counts as known, even if all are rounded to one
  // value.
  static constexpr std::uint32_t few = 30;
  // The largest position decays, so that a wrong one has no effect ten thousand samples later.
  static constexpr double fading = 1.0 - 1e-4;
  static constexpr double unlimited = std::numeric_limits<double>::infinity();

  void learn_step(double step) noexcept {
    if (step > 0.0) step_ = std::min(step_, step);
  }

  double limit() const noexcept {
    const double doubt = seen_ >= few ? 1.0 : noise_.doubt();
    if (doubt == unlimited) return unlimited;
    const double noise = doubt * noise_.value() / difference_median;
    return detail::least_spike(noise, largest_, step_ < unlimited ? step_ : 0.0);
  }

  std::array<double, size> recent_{};  // the newest first
  std::size_t held_ = 0;
  detail::RunningMedian noise_;  // |Δ⁴|
  std::uint32_t seen_ = 0;
  double largest_ = 0.0;
  double step_ = unlimited;  // the smallest that is not zero
};

// Outliers of velocity, force and the sensor's range:
//
//   force:   |F − F′| > max(10 σ, a tenth of the median force),     three in a row at most
//   motion:  |x − x′ − ½(v + v′)T| > max(10 σ, 1.2 T median |v|),   twenty in a row at most, once
//            the position has changed
//   range:   F = F_max, from the fifth of equal forces at the highest value so far, while the force
//            of the law changed
//
// x′, v′, F′ is the last accepted sample and T the time since then; σ is the running median of the
// left-hand side in contact, over 0.6745. If the previous sample departed as much, the cause is a
// fast motion and not an outlier: the departure is then the difference of the two, if that is
// smaller. A longer run is another material, place or speed, and is accepted, so that a change is
// detected a few samples late. If force and position step together, or if the law predicts the
// force, it is a real step, and is accepted.
class OutlierRejection {
 public:
  struct Settings {
    double threshold = 10.0;  // standard deviations

    bool operator==(const Settings&) const = default;
  };

  explicit OutlierRejection(const Settings& settings) noexcept
      : factor_(settings.threshold / detail::normal_median) {}

  OutlierRejection* watcher() noexcept { return this; }
  const OutlierRejection* watcher() const noexcept { return this; }

  // Whether a restored state is within the samples that a method can withdraw.
  bool sound() const noexcept { return withdrawn_ <= most_withdrawn; }

  // Contact ends: the next sample does not continue the last one.
  void interrupt() noexcept { following_ = false; }

  // Whether to reject a sample [SI], `dt` [s] after the previous one. `touching` is the decision of
  // the contact gate, and law(x, v) the force of the present estimate, which is rarely called.
  template <class Law>
  [[gnu::noinline]] bool rejects(const Sample& sample, double dt, bool touching,
                                 const Law& law) noexcept {
    step_.learn(dt);
    const bool free = !touching && !touched_;
    if (!following_ || free || dt > longest_gap * step_.value()) return follow(sample, touching);
    // Time stamps in bursts determine no speed.
    elapsed_ += std::max(dt, 0.5 * step_.value());
    ++steps_;

    // A held or rounded position carries no information: only a velocity above the one that the
    // position arrived with can be an outlier, because the probe may also have stopped.
    const double travelled = sample.penetration - last_.penetration;
    const bool held = travelled == 0.0;
    travels_ |= !held;
    const bool slower = std::abs(sample.velocity) < std::abs(last_.velocity);
    const double start = !held ? last_.velocity : slower ? -sample.velocity : -last_.velocity;
    const Departure now{travelled - 0.5 * (sample.velocity + start) * elapsed_,
                        sample.force - last_.force};
    const double astray =
        std::min(std::abs(now.motion), std::abs(now.motion - last_departure_.motion));
    const double rise =
        std::min(std::abs(now.force), std::abs(now.force - steps_ * last_departure_.force));
    const double most_astray =
        std::max(factor_ * astray_.value(), least_speed * elapsed_ * speed_.value());
    const double most_rise = std::max(factor_ * rise_.value(), least_force * force_.value());
    const bool stepped = travels_ && astray > speed_.doubt() * most_astray;
    const bool moved = stepped && (held || !between(travelled, start, sample));
    const bool jumped = rise > rise_.doubt() * most_rise;
    if (touching) learn(sample, now, held, moved, jumped);
    if (moved || jumped) [[unlikely]] {
      if (corroborated(sample, travelled, now.force, stepped && jumped, law)) {
        speed_.raise_to(std::abs(travelled) / elapsed_);
        moved_ = jumped_ = 0;
      } else if (within_runs(sample, now, moved, jumped)) {
        return reject();
      }
    } else {
      moved_ = jumped_ = 0;
    }
    if (out_of_range(sample, touching, law)) return reject();
    accept(sample, now, dt, touching);
    return false;
  }

  // The number of the latest accepted samples that turn out to be outliers when one is rejected:
  // the first of a run at the end of the range. Each number is returned once.
  std::size_t withdrawn() noexcept { return std::exchange(withdrawn_, 0); }

  // The force at which the sensor saturates; infinite until known.
  double range() const noexcept { return range_; }

  // The number of rejected samples.
  std::uint64_t rejected() const noexcept { return rejected_; }

 private:
  // An error of a tenth in one of a hundred samples changes the mean force by 0.1 %, and damping
  // causes such steps where a fast probe reverses.
  static constexpr double least_force = 0.1;
  // A motion may reverse between two samples: its mean velocity is then wrong by the speed itself.
  static constexpr double least_speed = 1.2;
  static constexpr double longest_gap = 8.0;    // median steps
  static constexpr double longest_hold = 16.0;  // samples of one position
  static constexpr std::uint32_t most_jumped = 3, most_moved = 20;
  // The number of equal forces that is not chance, and the least change of the law in median steps
  // meanwhile.
  static constexpr std::uint32_t flat = 5;
  static constexpr double flat_steps = 4.0;
  static constexpr std::uint32_t most_withdrawn = 8;

  // Departure of a sample from the extrapolation of the previous one, m and N.
  struct Departure {
    double motion;
    double force;
  };

  // Whether the mean speed lies clearly between the speeds at both ends, as when a resting probe
  // starts or stops. If the velocity is wrong, the mean equals the speed at the other end; where a
  // spline rings before a jump, it is at most 0.18 of the way from there.
  bool between(double travelled, double start, const Sample& sample) const noexcept {
    constexpr double clear = 0.2;
    const double change = (sample.velocity - start) * elapsed_;
    const double part = (travelled - start * elapsed_) * change;
    return part > clear * change * change && part < (1.0 - clear) * change * change;
  }

  bool follow(const Sample& sample, bool touching) noexcept {
    last_ = sample;
    last_departure_ = {};
    elapsed_ = 0.0;
    steps_ = 0.0;
    following_ = true;
    touched_ = touching;
    moved_ = jumped_ = 0;
    equal_ = 1;
    flat_start_ = sample;
    return false;
  }

  void learn(const Sample& sample, const Departure& now, bool held, bool moved,
             bool jumped) noexcept {
    if (!held && !moved) astray_.learn(std::abs(now.motion));
    // While the probe is held still, the speed of its motion is not updated.
    const double speed = std::abs(sample.velocity);
    const bool moving = speed > 0.5 * speed_.value() || !speed_.settled();
    if (travels_ && !moved && moving) speed_.learn(speed);
    const double rise = std::abs(now.force);
    if (!jumped) rise_.learn(rise);
    if (rise > 0.0) least_rise_ = std::min(least_rise_, rise);
    force_.learn(std::abs(sample.force));
  }

  // Whether force and position step together: both jump in the same direction, or the law predicts
  // most of the change of the force. If the probe is held in between, median speed and rise are
  // those of noise.
  template <class Law>
  bool corroborated(const Sample& sample, double travelled, double risen, bool both,
                    const Law& law) const noexcept {
    if (both && travelled * risen > 0.0) return true;
    if (!(std::abs(risen) > 3.0 / detail::normal_median * rise_.value())) return false;
    const double expected =
        law(sample.penetration, sample.velocity) - law(last_.penetration, last_.velocity);
    return std::abs(risen - expected) <= 0.5 * std::abs(risen);
  }

  // Whether the present runs of outliers are still short enough to reject the sample.
  bool within_runs(const Sample& sample, const Departure& now, bool moved, bool jumped) noexcept {
    if (moved && ++moved_ > most_moved) {
      moved = false;
      moved_ = 0;
      astray_.raise_to(std::abs(now.motion) / factor_);  // so that similar samples are accepted
      speed_.raise_to(std::abs(sample.velocity));
    }
    if (jumped && ++jumped_ > most_jumped) {
      jumped = false;
      jumped_ = 0;
      rise_.raise_to(2.0 * rise_.value());
    }
    return moved || jumped;
  }

  // Whether the force is one at which the sensor saturates, or the fifth of a run of equal forces
  // at the highest force so far while the force of the law changed.
  template <class Law>
  bool out_of_range(const Sample& sample, bool touching, const Law& law) noexcept {
    if (sample.force == range_) return true;
    if (sample.force > range_) range_ = unlimited;
    if (sample.force != last_.force || !touching) {
      if (last_.force != range_) longest_ = std::max(longest_, equal_);
      equal_ = 1;
      flat_start_ = sample;
      highest_ = std::max(highest_, sample.force);
      return false;
    }
    if (++equal_ < flat || sample.force < highest_) return false;
    // Rounding causes runs within which the force changes by one step; a sensor that holds its
    // values causes runs of equal length.
    const double least = equal_ > 2 * longest_ ? 2.0 * least_rise_ : flat_steps * rise_.value();
    const double travelled = std::abs(sample.penetration - flat_start_.penetration);
    if (!(travelled * sample.force > least * sample.penetration)) return false;
    const double moved = law(sample.penetration, sample.velocity) -
                         law(flat_start_.penetration, flat_start_.velocity);
    if (!(std::abs(moved) > least)) return false;
    range_ = sample.force;
    withdrawn_ = std::min(equal_ - 1, most_withdrawn);
    return true;
  }

  void accept(const Sample& sample, const Departure& now, double dt, bool touching) noexcept {
    last_.force = sample.force;
    last_departure_.force = steps_ == 1.0 ? now.force : now.force / steps_;
    steps_ = 0.0;
    touched_ = touching;
    if (sample.penetration == last_.penetration && elapsed_ < longest_hold * dt) return;
    last_.penetration = sample.penetration;
    last_.velocity = sample.velocity;
    last_departure_.motion = now.motion;
    elapsed_ = 0.0;
  }

  bool reject() noexcept {
    ++rejected_;
    return true;
  }

  static constexpr double unlimited = std::numeric_limits<double>::infinity();

  double factor_;                  // multiplies a median
  Sample last_{};                  // last accepted sample
  Departure last_departure_{};     // of its motion; of its force, per sample
  double elapsed_ = 0.0;           // s since then, or since its position was new
  double steps_ = 0.0;             // samples since then
  detail::RunningMedian step_;     // dt, s
  detail::RunningMedian astray_;   // |x − x′ − ½(v + v′)T|, m
  detail::RunningMedian speed_;    // |v|, m/s
  detail::RunningMedian rise_;     // |F − F′|, N
  detail::RunningMedian force_;    // |F|, N
  double range_ = unlimited;       // saturation force of the sensor, N
  double highest_ = 0.0;           // force so far, N
  Sample flat_start_{};            // first sample of equal forces
  double least_rise_ = unlimited;  // N, the smallest above zero: the step of a rounded force
  std::uint64_t rejected_ = 0;
  std::uint32_t moved_ = 0;    // in a row
  std::uint32_t jumped_ = 0;   // in a row
  std::uint32_t equal_ = 0;    // forces in a row
  std::uint32_t longest_ = 1;  // longest such run, for a sensor that holds its values
  std::uint32_t withdrawn_ = 0;
  bool following_ = false;
  bool touched_ = false;
  bool travels_ = false;  // since the position first changed: before, its velocity is rounding
};

constexpr const char* validate(const OutlierRejection::Settings& settings) noexcept {
  // A threshold below 3 would reject noise.
  if (!(settings.threshold >= 3.0 && settings.threshold <= 1e6)) {
    return "outliers.threshold must be in [3, 1e6] deviations";
  }
  return nullptr;
}

}  // namespace palpate
