// A change of what is touched, from the a-priori force errors, whitened by their own correlation.
//
//   z = min(e²/s², 25);  g ← max(0, g + z − drift);  alarm at g > threshold
//
// is a cumulative sum (Page 1954) for abrupt changes; for those too small to show in single errors,
// as of the damping alone, blocks of errors are compared with what a change would look like
// (score_blocks.hpp). s² follows the clipped e² slowly, and both alarm only beyond what they have
// come back from before, so that a material outside the model class raises the bar instead of
// alarms for ever.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "palpate/autoregression.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"
#include "palpate/score_blocks.hpp"

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
    // White noise has z = 1 on average; with 4 and 60 noise, white or correlated, alarmed once in
    // 13 h, and 5 % of stiffness are found in 2 to 3 ms (docs/accuracy/alarms.md).
    double drift = 4.0;  // of z, a sample
    double threshold = 60.0;
    double noise = 0.0;  // N, the least s; 0: from the first errors alone
    // Fraction of the way from s² to e², a sample: a memory of 2 s at 1 kHz, which is longer than
    // any change takes to be found and shorter than the relaxation of most soft materials.
    double adaptation = 5e-4;
    // Samples without alarms at the start, and up to 300 of them after a change. The later half
    // tells the correlation: of AR(1) 0.98 that is ten lengths.
    std::uint32_t warm_up = 1000;
    // Samples over which a velocity filter smears a change; at most memory / 2. Once twice as many
    // have come after an alarm, only the latest count.
    std::uint32_t transition = 15;

    bool operator==(const Settings&) const = default;
  };

  // Samples that an alarm can look back on: a power of two, so that a remainder is a mask, above
  // the longest transition. A change that takes longer to be found is relearned from its latest
  // ones.
  static constexpr std::size_t memory = 256;

  explicit ChangeDetector(const Settings& settings) noexcept
      : settings_(settings), quiet_left_(settings.warm_up) {}

  // Contact was lost: the next error does not follow the last one.
  void interrupt() noexcept { correlation_.interrupt(); }

  // Takes a sample, its time step, the force that was predicted for it and the error of that [N];
  // true is an alarm. The first two are joined here only: on the way they would be stored as
  // numbers and loaded as pairs, a stall of 5 ns.
  bool observe(const Sample& sample, double dt, double predicted, double error) noexcept {
    recent_[seen_ % memory] = {sample, dt};
    squares_[seen_ % memory] = error * error;
    ++seen_;
    transient_over_ = transient_left_ > 0 && --transient_left_ == 0;
    const White white = whitened(error, {predicted, predicted * sample.velocity});
    const double square = white.error * white.error;
    correlation_.learn(error);
    if (!correlation_.knows_past()) return false;
    if (quiet_left_ > 0) return settle(square);
    const double clipped = std::min(square, clip * variance_);
    variance_ += settings_.adaptation * (clipped - variance_);
    variance_ = std::max(variance_, least_variance());
    block_ = blocks_.add(white.error, white.regressor, variance_);
    if (!jumped(square)) return block_ > 0;
    block_ = 0;  // the sum tells better when the change came
    return true;
  }

  // How many of the latest samples are post-change: those since the sum was last zero. By chance it
  // was above zero already when the change came in one case of twenty, and a single sample of the
  // old material spoils the new fit for hundreds of milliseconds; so the first ones are left out
  // while their error is below half the deviation of what came after them.
  std::size_t post_change_samples() const noexcept {
    // A small change came somewhere in the block that shows it, or before: its later half is new.
    const std::uint64_t back = block_ > 0 ? block_ / 2 : seen_ - last_zero_;
    const auto since = static_cast<std::size_t>(std::min<std::uint64_t>(back, memory));
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
    peak_ = 0.0;
    quiet_left_ = std::min(settings_.warm_up, quiet);
    transient_left_ = 2 * settings_.transition;
    last_zero_ = seen_;
    blocks_.restart();
  }

 private:
  struct White {
    double error;
    Vector<2> regressor;
  };

  // z beyond this is an outlier, of which it takes three to alarm.
  static constexpr double largest_score = 25.0;
  // e² counts for s² up to three deviations: 99.7 % of white noise, and little of a change.
  static constexpr double clip = 9.0;
  // Samples without alarms after one: by then the estimate of well excited materials is within its
  // noise, which is known already.
  static constexpr std::uint32_t quiet = 300;

  // The error and what it is compared with, less what the errors before let expect.
  White whitened(double error, const Vector<2>& regressor) noexcept {
    White white{error, regressor};
    const auto& a = correlation_.coefficients();
    for (std::size_t i = 0; i < a.size(); ++i) {
      const White& past = past_[(seen_ - 1 - i) % past_.size()];
      white.error -= a[i] * past.error;
      white.regressor[0] -= a[i] * past.regressor[0];
      white.regressor[1] -= a[i] * past.regressor[1];
    }
    past_[seen_ % past_.size()] = {error, regressor};
    return white;
  }

  // The cumulative sum: true where it is beyond the threshold and thrice what it ever came back
  // from.
  bool jumped(double square) noexcept {
    sum_ = std::max(0.0, sum_ + std::min(square / variance_, largest_score) - settings_.drift);
    if (sum_ == 0.0) {
      last_zero_ = seen_;
      highest_ = std::max(highest_, peak_);
      peak_ = 0.0;
    }
    peak_ = std::max(peak_, sum_);
    return sum_ > settings_.threshold && sum_ > 3.0 * highest_;
  }

  // The first errors are those of an estimate that is still on its way: what they say of
  // correlation is forgotten after a fifth and a half, and s² is the mean of the later half.
  bool settle(double square) noexcept {
    --quiet_left_;
    last_zero_ = seen_;
    if (started_) {
      const double clipped = std::min(square, clip * variance_);
      variance_ += std::min(1.0, 10.0 * settings_.adaptation) * (clipped - variance_);
      variance_ = std::max(variance_, least_variance());
      return false;
    }
    const std::uint32_t settled = settings_.warm_up - quiet_left_;
    const std::uint32_t half = settings_.warm_up / 2;
    if (settled == settings_.warm_up / 5 || settled == half) correlation_.relearn();
    if (settled > half) variance_ += square;
    if (quiet_left_ == 0) {
      variance_ =
          std::max(variance_ / static_cast<double>(settings_.warm_up - half), least_variance());
      started_ = true;
    }
    return false;
  }

  // A variance of zero is a noise-free signal: any error is then an infinite one.
  double least_variance() const noexcept {
    return std::max(settings_.noise * settings_.noise, 1e-300);
  }

  Settings settings_;
  std::array<TakenSample, memory> recent_{};
  std::array<double, memory> squares_{};  // of their errors
  std::uint64_t seen_ = 0;
  std::uint64_t last_zero_ = 0;       // samples seen when the sum was last zero
  std::uint32_t quiet_left_;          // samples without alarms that are still to come
  std::uint32_t transient_left_ = 0;  // samples until the transient of a change is over
  bool transient_over_ = false;
  bool started_ = false;  // the first of them are over
  double variance_ = 0.0;
  double sum_ = 0.0;
  double peak_ = 0.0;     // of the sum since it was last zero
  double highest_ = 0.0;  // of the peaks that it came back from
  detail::Autoregression correlation_;
  std::array<White, 8> past_{};  // a power of two, above the order
  detail::ScoreBlocks blocks_;
  std::size_t block_ = 0;  // length of the one that alarmed
};

constexpr const char* validate(const ChangeDetector::Settings& settings) noexcept {
  // Below 1 white noise alone adds up; z is at most 25.
  if (!(settings.drift >= 1.0 && settings.drift <= 24.0)) {
    return "changes.drift must be in [1, 24]";
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
