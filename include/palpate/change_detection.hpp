// Detection of a change of the material from the one-step prediction errors of the force, whitened
// by their own correlation. Three tests:
//
//   a cumulative sum of white errors, for abrupt changes;
//   a cumulative sum of the raw errors: those of a wrong law are as smooth as the motion, so that
//   whitening removes them however large a change makes them;
//   scores of blocks of white errors, for changes too small to show in single errors, such as of
//   the damping alone.
//
// An alarm of a sum counts once a change of the law explains the errors since its start: bursts of
// noise add up as well. Each test alarms only above its earlier peaks, and only at depths and
// speeds of an earlier stroke, so that a wrong law raises the threshold instead of causing alarms.
// change_tests.hpp has them.
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

// A past sample, to be learned again after a change.
struct TakenSample {
  Sample sample;  // in scaled units
  double dt;      // s since the one before it
};

class ChangeDetector {
 public:
  struct Settings {
    // White noise has z = 1 on average; with 4 and 60 noise, white or correlated, alarmed once in
    // 13 h, and 5 % of stiffness are found in 2 to 3 ms (docs/validation/accuracy/alarms.md).
    double drift = 4.0;  // of z, a sample
    double threshold = 60.0;
    double noise = 0.0;  // N, the least s; 0: from the first errors alone
    // Fraction of the way from s² to e², a sample: a memory of 2 s at 1 kHz, which is longer than
    // any change takes to be found and shorter than the relaxation of most soft materials.
    double adaptation = 5e-4;
    // Samples without alarms at the start. The first half tells the noise and its correlation: of
    // AR(1) 0.98 that is ten lengths. The later half, and it again from 300 samples after a change
    // on, tells how large errors are where nothing changes.
    std::uint32_t warm_up = 1000;
    // Samples over which a velocity filter smears a change; at most memory / 2. Once twice as many
    // have come after an alarm, only the latest count.
    std::uint32_t transition = 15;

    bool operator==(const Settings&) const = default;
  };

  // Samples that an alarm can look back on: a power of two, so that a remainder is a mask, above
  // the longest transition. A change that takes longer to be found is relearned from its latest
  // ones.
  static constexpr std::size_t memory = detail::Autoregression::memory;

  explicit ChangeDetector(const Settings& settings) noexcept : settings_(settings) {}

  ChangeDetector* watcher() noexcept { return this; }

  // Contact was lost: the next error does not continue the last one.
  void interrupt() noexcept { correlation_.interrupt(); }

  // Takes a sample, its time step, its predicted force and the prediction error [N]; true is an
  // alarm. The first two are joined only here: passed on as a struct they would be stored as
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

  // Number of the latest samples after the change: those since the sum was last zero. In one case
  // of twenty it was above zero before the change already, and a single sample of the old material
  // spoils the new fit for hundreds of milliseconds; so the first ones are excluded while their
  // error is below half the standard deviation of the later ones.
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
  // spoil a fit without forgetting for seconds.
  bool transient_over() const noexcept { return transient_over_; }

  // Number of the latest samples, after the transient, that are of the new material alone.
  std::size_t settled_samples() const noexcept { return settings_.transition; }

  // A past sample: 0 is the latest.
  const TakenSample& recent(std::size_t age) const noexcept {
    return recent_[(seen_ - 1 - age) % memory];
  }

  // After the restart that follows an alarm: the sensor's noise stays, the law is another.
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
  // Samples without alarms after one: by then the estimate of well excited materials is within its
  // noise, which is known already.
  static constexpr std::uint32_t quiet = 300;
  // Threshold of the raw errors' sum: a second of three deviations, or 50 ms of five.
  static constexpr double level_threshold = 1000.0;
  // L that noise, however large, exceeds in a fraction e⁻¹⁰ of the cases.
  static constexpr double convincing = 20.0;

  // The first errors are those of an estimate that is still on its way: what they say of
  // correlation is forgotten after a fifth of the warm-up, and once more after half of it; s² is
  // the mean in between.
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

  // True where one of the three tests finds a change; what is withheld tells them how large errors
  // are without one.
  bool compare(const detail::Regressed& white, double square, bool withheld) noexcept {
    const auto& [drift, threshold, noise, gain, warm_up, transition] = settings_;
    const std::size_t block = blocks_.add(white, sum_.variance(), withheld);
    const bool jumped = sum_.add(white[detail::error_at] * white[detail::error_at], gain, drift,
                                 threshold, withheld);
    const bool risen = level_.add(square, gain, drift, level_threshold, withheld);
    if (sum_.zero()) last_zero_ = seen_;
    if (level_.zero()) last_level_zero_ = seen_;
    // The sum of white errors tells best when the change came. A small one came somewhere in the
    // block that shows it, or before: its later half is new.
    if (jumped && explained(last_zero_, sum_.variance(), true)) return true;
    begun_ = seen_ - block / 2;
    return block > 0 || (risen && explained(last_level_zero_, level_.variance(), false));
  }

  // Whether a change after `begun` samples explains the errors since. Examined less often the
  // longer it has been, so that a long burst costs little.
  bool explained(std::uint64_t begun, double variance, bool whitened) noexcept {
    const std::uint64_t count = seen_ - begun;
    if (count % std::max<std::uint64_t>(1, std::bit_floor(count) / 8) != 0) return false;
    begun_ = begun;
    const std::size_t samples =
        std::min(post_change_samples(), memory - detail::Autoregression::order);
    return correlation_.of_change(samples, variance, whitened) > convincing * blocks_.inflation();
  }

  // A variance of zero is a noise-free signal: any error is then an infinite one.
  double least_variance() const noexcept {
    return std::max(settings_.noise * settings_.noise, 1e-300);
  }

  Settings settings_;
  std::array<TakenSample, memory> recent_{};
  std::uint64_t seen_ = 0;
  std::uint32_t warmed_ = 0;          // samples of the warm-up so far
  std::uint32_t quiet_left_ = 0;      // samples without alarms that are still to come
  std::uint32_t transient_left_ = 0;  // samples until the transient of a change is over
  bool transient_over_ = false;
  detail::Autoregression correlation_;
  detail::KnownGround ground_;
  detail::CumulativeSum sum_;          // of white errors
  detail::CumulativeSum level_;        // of errors as they are
  detail::ScoreBlocks blocks_;         // of white errors and their regressors
  std::uint64_t last_zero_ = 0;        // samples seen when the one sum was last zero …
  std::uint64_t last_level_zero_ = 0;  // … and the other
  std::uint64_t begun_ = 0;            // samples seen before the change that alarmed
};

constexpr const char* validate(const ChangeDetector::Settings& settings) noexcept {
  using detail::lies_in;
  return detail::first_fault({
      // Below 1 white noise alone adds up; z is at most 25.
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
