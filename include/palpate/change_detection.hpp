// An abrupt change of what is touched, from the a-priori force error: a cumulative sum (Page 1954).
//
//   z = min(e²/s², 200);  g ← max(0, g + z − drift);  alarm at g > threshold
//
// s² follows the clipped e² slowly, so that a material outside the model class, whose error never
// becomes white, raises the bar instead of alarms for ever.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "palpate/sample.hpp"

namespace palpate {

// A sample as it was taken, to be learned again after a change.
struct TakenSample {
  Sample sample;  // in scaled units
  double dt;      // s since the one before it
};

// In place of a detector where no change is looked for: it costs no memory and no time.
class NoChangeDetector {
 public:
  static constexpr bool active = false;

  struct Settings {
    bool operator==(const Settings&) const = default;
  };

  constexpr explicit NoChangeDetector(const Settings&) noexcept {}
};

constexpr const char* validate(const NoChangeDetector::Settings&) noexcept { return nullptr; }

class ChangeDetector {
 public:
  static constexpr bool active = true;

  struct Settings {
    // White noise has z = 1 on average; with 4 and 60 it alarmed in none of 33 h of PVC, and a
    // change from PVC to its inclusion is found in 1 to 2 ms (docs/accuracy.md).
    double drift = 4.0;  // of z, a sample
    double threshold = 60.0;
    double noise = 0.0;  // N, the least s; 0: from the first errors alone
    // Fraction of the way from s² to e², a sample: a memory of 2 s at 1 kHz, which is longer than
    // any change takes to be found and shorter than the relaxation of most soft materials.
    double adaptation = 5e-4;
    // Samples without alarms at the start and after a change: by then the estimate of well excited
    // materials is within its noise.
    std::uint32_t warm_up = 200;
    // Samples over which a velocity filter smears a change; at most memory / 2. Once twice as many
    // have come after an alarm, only the latest count.
    std::uint32_t transition = 15;

    bool operator==(const Settings&) const = default;
  };

  // Samples that an alarm can look back on: a power of two, so that a remainder is a mask, above
  // the longest transition. A change that takes longer to be found is relearned from its latest
  // ones.
  static constexpr std::size_t memory = 256;

  constexpr explicit ChangeDetector(const Settings& settings) noexcept : settings_(settings) {}

  // Takes a sample, its time step and its a-priori error [N]; true is an alarm. The first two are
  // joined here only: on the way they would be stored as numbers and loaded as pairs, a stall of
  // 5 ns.
  bool observe(const Sample& sample, double dt, double error) noexcept {
    const double square = error * error;
    recent_[seen_ % memory] = {sample, dt};
    squares_[seen_ % memory] = square;
    ++seen_;
    transient_over_ = transient_left_ > 0 && --transient_left_ == 0;
    if (warmed_up_ < settings_.warm_up) return warm_up(square);
    // A variance of zero is a noise-free signal: any error is then an infinite one.
    constexpr double smallest_normal = 1e-300;
    const double z = std::min(square / (variance_ + smallest_normal), largest_score);
    sum_ = std::max(0.0, sum_ + z - settings_.drift);
    if (sum_ == 0.0) last_zero_ = seen_;
    variance_ += settings_.adaptation * (std::min(square, clip * variance_) - variance_);
    variance_ = std::max(variance_, settings_.noise * settings_.noise);
    return sum_ > settings_.threshold;
  }

  // How many of the latest samples are post-change: those since the sum was last zero. By chance it
  // was above zero already when the change came in one case of twenty, and a single sample of the
  // old material spoils the new fit for hundreds of milliseconds; so the first ones are left out
  // while their error is below half the deviation of what came after them.
  std::size_t post_change_samples() const noexcept {
    const auto since =
        static_cast<std::size_t>(std::min<std::uint64_t>(seen_ - last_zero_, memory));
    double later = 0.0;
    std::size_t count = since;
    for (std::size_t age = 0; age < since; ++age) {
      const double square = squares_[(seen_ - 1 - age) % memory];
      const bool agrees = square * static_cast<double>(age) < 0.25 * later;
      if (!agrees) count = age + 1;
      later += square;
    }
    return count;
  }

  // Whether the transient of a change has just ended. At a change of what is touched the speed
  // kinks, which a filter rounds off on both sides; a few such samples, all wrong the same way,
  // would spoil a fit that forgets nothing for seconds.
  bool transient_over() const noexcept { return transient_over_; }

  // How many of the latest samples are settled, of the new material alone, once that is over.
  std::size_t settled_samples() const noexcept { return settings_.transition; }

  // A sample of the past: 0 is the latest.
  const TakenSample& recent(std::size_t age) const noexcept {
    return recent_[(seen_ - 1 - age) % memory];
  }

  // After an alarm was acted on. The noise is still the sensor's.
  void rearm() noexcept {
    sum_ = 0.0;
    warmed_up_ = 0;
    transient_left_ = 2 * settings_.transition;
    last_zero_ = seen_;
  }

 private:
  // z beyond this changes no alarm, as it exceeds drift + threshold; it keeps the sum finite.
  static constexpr double largest_score = 200.0;
  // e² counts for s² up to three deviations: 99.7 % of white noise, and little of a change.
  static constexpr double clip = 9.0;

  // The first errors are those of an estimate that is still on its way, so the later half counts.
  bool warm_up(double square) noexcept {
    ++warmed_up_;
    const std::uint32_t half = settings_.warm_up / 2;
    if (warmed_up_ == half) learned_ = 0.0;
    learned_ += square;
    last_zero_ = seen_;
    if (warmed_up_ == settings_.warm_up) {
      const double mean = learned_ / static_cast<double>(settings_.warm_up - half + 1);
      variance_ = std::max(mean, settings_.noise * settings_.noise);
    }
    return false;
  }

  Settings settings_;
  std::array<TakenSample, memory> recent_{};
  std::array<double, memory> squares_{};  // of their errors
  std::uint64_t seen_ = 0;
  std::uint64_t last_zero_ = 0;  // samples seen when the sum was last zero
  std::uint32_t warmed_up_ = 0;
  std::uint32_t transient_left_ = 0;  // samples until the transient of a change is over
  bool transient_over_ = false;
  double learned_ = 0.0;
  double variance_ = 0.0;
  double sum_ = 0.0;
};

constexpr const char* validate(const ChangeDetector::Settings& settings) noexcept {
  // Below 1 white noise alone adds up; z is at most 200.
  if (!(settings.drift >= 1.0 && settings.drift <= 199.0)) {
    return "changes.drift must be in [1, 199]";
  }
  if (!(settings.threshold > 0.0 && settings.threshold <= 1e12)) {
    return "changes.threshold must be in (0, 1e12]";
  }
  if (!(settings.noise >= 0.0 && settings.noise <= 1e30)) {
    return "changes.noise must be in [0, 1e30] N";
  }
  if (!(settings.adaptation >= 0.0 && settings.adaptation <= 1.0)) {
    return "changes.adaptation must be in [0, 1]";
  }
  if (!(settings.warm_up >= 10 && settings.warm_up <= 1000000)) {
    return "changes.warm_up must be in [10, 1000000] samples";
  }
  if (!(settings.transition <= 100)) return "changes.transition must be in [0, 100] samples";
  return nullptr;
}

}  // namespace palpate
