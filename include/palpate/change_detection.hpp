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

#include "palpate/scale.hpp"

namespace palpate {

class ChangeDetector {
 public:
  struct Settings {
    double drift = 0.0;  // of z, a sample; 0 switches the detector off
    double threshold = 60.0;
    double noise = 0.0;            // N, the least s; 0: from the first errors alone
    double adaptation = 5e-4;      // share of the way from s² to e², a sample
    std::uint32_t settling = 200;  // samples without alarms at the start and after a change
    // Samples over which a velocity filter smears a change; at most memory / 2. Once twice as many
    // have come after an alarm, only the latest count.
    std::uint32_t transition = 15;
  };

  // Samples that an alarm can look back on.
  static constexpr std::size_t memory = 256;

  constexpr explicit ChangeDetector(const Settings& settings) noexcept : settings_(settings) {}

  constexpr bool active() const noexcept { return settings_.drift > 0.0; }

  // Takes a sample and its a-priori error [N]; true is an alarm.
  bool observe(const Sample& sample, double error) noexcept {
    const double square = error * error;
    recent_[seen_ % memory] = sample;
    squares_[seen_ % memory] = square;
    ++seen_;
    over_ = left_ > 0 && --left_ == 0;
    if (settling_ < settings_.settling) return settle(square);
    const double z = std::min(square / (variance_ + 1e-300), 200.0);
    sum_ = std::max(0.0, sum_ + z - settings_.drift);
    if (sum_ == 0.0) suspects_from_ = seen_;
    variance_ += settings_.adaptation * (std::min(square, 9.0 * variance_) - variance_);
    variance_ = std::max(variance_, settings_.noise * settings_.noise);
    return sum_ > settings_.threshold;
  }

  // How many of the latest samples belong to what came after the change: those since the sum was
  // last zero. By chance it was above zero already when the change came in one case of twenty, and
  // a single sample of the old material spoils the new fit for hundreds of milliseconds; so the
  // first ones are left out while they disagree with the old law far less than the rest does.
  std::size_t suspects() const noexcept {
    const auto since =
        static_cast<std::size_t>(std::min<std::uint64_t>(seen_ - suspects_from_, memory));
    double later = 0.0;
    std::size_t count = since;
    for (std::size_t age = 0; age < since; ++age) {
      const double square = squares_[(seen_ - 1 - age) % memory];
      const bool agrees = 4.0 * square * static_cast<double>(age) < later;
      if (!agrees) count = age + 1;
      later += square;
    }
    return count;
  }

  // Whether the change is just over. At a change of what is touched the speed kinks, which a
  // filter rounds off on both sides; a few such samples, all wrong the same way, would spoil a fit
  // that forgets nothing for seconds.
  bool over() const noexcept { return over_; }

  // How many of the latest samples are surely of the new material alone, once the change is over.
  std::size_t certain() const noexcept { return settings_.transition; }

  // A sample of the past: 0 is the latest.
  const Sample& recent(std::size_t age) const noexcept {
    return recent_[(seen_ - 1 - age) % memory];
  }

  // After an alarm was acted on. The noise is still the sensor's.
  void rearm() noexcept {
    sum_ = 0.0;
    settling_ = 0;
    left_ = 2 * settings_.transition;
    suspects_from_ = seen_;
  }

 private:
  // The first errors are those of an estimate that is still on its way, so the later half counts.
  bool settle(double square) noexcept {
    ++settling_;
    const std::uint32_t half = settings_.settling / 2;
    if (settling_ == half) learned_ = 0.0;
    learned_ += square;
    suspects_from_ = seen_;
    if (settling_ == settings_.settling) {
      const double mean = learned_ / static_cast<double>(settings_.settling - half + 1);
      variance_ = std::max(mean, settings_.noise * settings_.noise);
    }
    return false;
  }

  Settings settings_;
  std::array<Sample, memory> recent_{};
  std::array<double, memory> squares_{};  // of their errors
  std::uint64_t seen_ = 0;
  std::uint64_t suspects_from_ = 0;
  std::uint32_t settling_ = 0;
  std::uint32_t left_ = 0;  // samples until the change is over
  bool over_ = false;
  double learned_ = 0.0;
  double variance_ = 0.0;
  double sum_ = 0.0;
};

}  // namespace palpate
