// Detection of a change of the material from the one-step prediction errors of the force, whitened
// by their autocorrelation. Three tests:
//
//   a cumulative sum of white errors, for abrupt changes;
//   a cumulative sum of the raw errors: the errors of a wrong law are as smooth as the motion, so
//   that whitening removes them however large a change makes them;
//   scores of blocks of white errors, for changes too small to show in single errors, such as of
//   the damping alone.
//
// An alarm of a sum counts only if a change of the law explains the errors since its start, because
// bursts of noise add up too. Each test alarms only above its earlier peaks, and only at depths and
// speeds of an earlier stroke, so that a wrong law raises the threshold instead of causing alarms.
// The tests are in change_tests.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "palpate/change_tests.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"

namespace palpate {

// A past sample, which is relearned after a change.
struct TakenSample {
  Sample sample;  // in scaled units
  double dt;      // s since the one before it
};

class ChangeDetector {
 public:
  struct Settings {
    // White noise has z = 1 on average. With 4 and 60, noise, white or correlated, caused one alarm
    // in 13 h, and a change of stiffness by 5 % is found in 2 to 3 ms
    // (docs/validation/accuracy/alarms.md).
    double drift = 4.0;  // subtracted from z at each sample
    double threshold = 60.0;
    double noise = 0.0;  // N, lower bound on s; 0: from the first errors alone
    // Gain of s² towards e² per sample: a memory of 2 s at 1 kHz, which is longer than the
    // detection of any change and shorter than the relaxation of most soft materials.
    double adaptation = 5e-4;
    // Samples without alarms at the start. The first half measures the noise and its correlation:
    // for AR(1) 0.98 it is ten correlation lengths. The later half measures the size of errors
    // without a change; it is repeated from 300 samples after each change.
    std::uint32_t warm_up = 1000;
    // Samples over which a velocity filter smears a change; at most memory / 2. Once twice as many
    // samples have followed an alarm, only the latest of them count.
    std::uint32_t transition = 15;

    bool operator==(const Settings&) const = default;
  };

  // The number of stored samples before an alarm: a power of two, so that a remainder is a mask,
  // and larger than the longest transition. A change that takes longer to detect is relearned from
  // the latest stored samples.
  static constexpr std::size_t memory = detail::Autoregression::memory;

  explicit ChangeDetector(const Settings& settings) noexcept : settings_(settings) {}

  ChangeDetector* watcher() noexcept { return this; }
  const Settings& settings() const noexcept { return settings_; }
  // Whether a restored state is within its arrays.
  bool sound() const noexcept { return correlation_.sound(); }

  // Contact was lost: the next error does not continue the last one.
  void interrupt() noexcept { correlation_.interrupt(); }

  // Adds a sample, its time step, its predicted force and the prediction error [N]; true for an
  // alarm. The first two are combined only here: passed as a struct they would be stored as single
  // numbers and loaded as pairs, a stall of 5 ns.
  bool observe(const Sample& sample, double dt, double predicted, double error) noexcept {
    const double square = error * error;
    recent_[seen_ % memory] = {sample, dt};
    ++seen_;
    transient_over_ = transient_left_ > 0 && --transient_left_ == 0;
    const bool known = ground_.visit(sample.penetration, sample.velocity);
    const detail::Regressed white = correlation_.whiten(
        {predicted, predicted * sample.velocity, predicted * sample.penetration, error});
    if (!correlation_.knows_past()) return false;
    if (quiet_left_ > 0) {
      --quiet_left_;
      const double gain = std::min(1.0, 10.0 * settings_.adaptation);
      sum_.learn(white[detail::error_at] * white[detail::error_at], gain);
      level_.learn(square, gain);
      last_zero_ = last_level_zero_ = seen_;
      return false;
    }
    const bool warming = warmed_ < settings_.warm_up;
    if (warming && ++warmed_ <= settings_.warm_up / 2) {
      settle(white[detail::error_at] * white[detail::error_at], square);
      return false;
    }
    if (!known && !warming) return false;
    return compare(white, square, warming);
  }

  // The number of the latest samples that lie after the change: those since the sum was last zero.
  // In one case of twenty it was above zero already before the change, and a single sample of the
  // old material biases the new fit for hundreds of milliseconds. So the first samples are excluded
  // while their error is below half the standard deviation of the later ones.
  std::size_t post_change_samples() const noexcept {
    const auto since = static_cast<std::size_t>(std::min<std::uint64_t>(seen_ - begun_, memory));
    double later = 0.0;
    std::size_t count = since;
    for (std::size_t age = 0; age < since; ++age) {
      const double error = correlation_.past(age)[detail::error_at];
      const double square = error * error;
      const bool agrees = square * static_cast<double>(age) < 0.25 * later;
      if (!agrees) count = age + 1;
      later += square;
    }
    return count;
  }

  // Whether the transient of a change has just ended. At a change of the material the speed has a
  // kink, which a filter rounds on both sides; a few such samples, all biased the same way, would
  // bias a fit without forgetting for seconds.
  bool transient_over() const noexcept { return transient_over_; }

  // The number of the latest samples, after the transient, that come from the new material alone.
  std::size_t settled_samples() const noexcept { return settings_.transition; }

  // A past sample: age 0 is the latest.
  const TakenSample& recent(std::size_t age) const noexcept {
    return recent_[(seen_ - 1 - age) % memory];
  }

  // Prepares for the next change after a restart: the sensor's noise remains, the law is new.
  void rearm() noexcept {
    sum_.restart();
    level_.restart();
    blocks_.restart();
    ground_.forget();
    quiet_left_ = std::min(settings_.warm_up, quiet);
    warmed_ = settings_.warm_up / 2;
    transient_left_ = 2 * settings_.transition;
  }

 private:
  // Samples without alarms after an alarm: by then the error of the estimate for well excited
  // materials is within the noise, which is known already.
  static constexpr std::uint32_t quiet = 300;
  // Threshold of the raw errors' sum: a second at three deviations, or 50 ms at five.
  static constexpr double level_threshold = 1000.0;
  // Noise of any size exceeds this L with a probability of e⁻¹⁰.
  static constexpr double convincing = 20.0;

  // The first errors come from an estimate that has not converged: the correlation learned from
  // them is discarded after a fifth of the warm-up and again after half of it; s² is the mean in
  // between.
  void settle(double white_square, double square) noexcept {
    const std::uint32_t fifth = settings_.warm_up / 5, half = settings_.warm_up / 2;
    if (warmed_ == fifth || warmed_ == half) correlation_.relearn();
    if (warmed_ <= fifth) return;
    const double gain = 1.0 / static_cast<double>(warmed_ - fifth);
    const auto mean = [&](detail::CumulativeSum& sum, double next) noexcept {
      sum.set_variance(sum.variance() + gain * (next - sum.variance()), least_variance());
    };
    mean(sum_, white_square);
    mean(level_, square);
  }

  // True if one of the three tests finds a change. While alarms are withheld, the tests measure the
  // size of errors without a change.
  bool compare(const detail::Regressed& white, double square, bool withheld) noexcept {
    const auto& [drift, threshold, noise, gain, warm_up, transition] = settings_;
    const std::size_t block = blocks_.add(white, sum_.variance(), withheld);
    const bool jumped = sum_.add(white[detail::error_at] * white[detail::error_at], gain, drift,
                                 threshold, withheld);
    const bool risen = level_.add(square, gain, drift, level_threshold, withheld);
    if (sum_.zero()) last_zero_ = seen_;
    if (level_.zero()) last_level_zero_ = seen_;
    // The sum of white errors gives the time of the change best. A small change began somewhere in
    // the block that shows it, or before: the later half of the block is new.
    if (jumped && explained(last_zero_, sum_.variance(), true)) return true;
    begun_ = seen_ - block / 2;
    return block > 0 || (risen && explained(last_level_zero_, level_.variance(), false));
  }

  // Whether a change after `begun` samples explains the errors since. The longer ago it began, the
  // less often this is tested, so that a long burst costs little.
  bool explained(std::uint64_t begun, double variance, bool whitened) noexcept {
    const std::uint64_t count = seen_ - begun;
    if (count % std::max<std::uint64_t>(1, std::bit_floor(count) / 8) != 0) return false;
    begun_ = begun;
    const std::size_t samples =
        std::min(post_change_samples(), memory - detail::Autoregression::order);
    return correlation_.of_change(samples, variance, whitened) > convincing * blocks_.inflation();
  }

  // A variance of zero means a noise-free signal, in which any error would be infinite.
  double least_variance() const noexcept {
    return std::max(settings_.noise * settings_.noise, 1e-300);
  }

  Settings settings_;
  std::array<TakenSample, memory> recent_{};
  std::uint64_t seen_ = 0;
  std::uint32_t warmed_ = 0;          // samples of the warm-up so far
  std::uint32_t quiet_left_ = 0;      // remaining samples without alarms
  std::uint32_t transient_left_ = 0;  // samples until the transient of a change is over
  bool transient_over_ = false;
  detail::Autoregression correlation_;
  detail::KnownGround ground_;
  detail::CumulativeSum sum_;          // of white errors
  detail::CumulativeSum level_;        // of raw errors
  detail::ScoreBlocks blocks_;         // of white errors and their regressors
  std::uint64_t last_zero_ = 0;        // samples seen when the sum of white errors was last zero …
  std::uint64_t last_level_zero_ = 0;  // … and when the sum of raw errors was
  std::uint64_t begun_ = 0;            // samples seen before the change that alarmed
};

constexpr const char* validate(const ChangeDetector::Settings& settings) noexcept {
  using detail::lies_in;
  return detail::first_fault({
      // Below 1 white noise alone would add up; z is at most 25.
      {lies_in(settings.drift, 1.0, 24.0), "changes.drift must be in [1, 24]"},
      {settings.threshold > 0.0 && settings.threshold <= 1e12,
       "changes.threshold must be in (0, 1e12]"},
      {lies_in(settings.noise, 0.0, 1e30), "changes.noise must be in [0, 1e30] N"},
      {lies_in(settings.adaptation, 0.0, 1.0), "changes.adaptation must be in [0, 1]"},
      {lies_in(settings.warm_up, 10, 1e6), "changes.warm_up must be in [10, 1000000] samples"},
      {settings.transition <= 100, "changes.transition must be in [0, 100] samples"},
  });
}

}  // namespace palpate
