// Selects the samples in contact by the force of their neighbours. Selection by their own force
// would prefer samples with positive force noise and bias the law.
//
// A sample is *sure* where the means of the eight forces before it and of the eight after it both
// exceed F₀ + 3σ/√8. All other samples below the surface are *light*. Until the eighth later
// neighbour has arrived the available neighbours decide, so that learning is not delayed.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>

#include "palpate/error_widening.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"

namespace palpate::detail {

enum class Role : std::uint8_t {
  none,      // absent or withdrawn
  free,      // above the surface
  sure,      // firm contact
  light,     // below the surface, in contact or not
  unusable,  // light, and the force of the law is negative there
};

// The latest sample and the seventeen before it, and the noise of their force.
class ContactSamples {
 public:
  static constexpr std::size_t side = 8;  // neighbours on each side

  struct Entry {
    Sample sample{};
    double weight = 0.0;      // its weight in its bank, after forgetting
    double force = 0.0;       // Σ F up to this sample, so that a mean is a difference …
    std::uint32_t count = 0;  // … and the number of these samples
    Role role = Role::none;
    bool pulls = false;
  };

  // `unrounded` is added to the force, which is a level of a sensor that rounds.
  void push(const Sample& sample, Role role, bool pulls, double unrounded = 0.0) noexcept {
    const Entry& last = entries_[newest_];
    if (last.role != Role::none) learn_noise(std::abs(sample.force - reading_));
    reading_ = sample.force;
    newest_ = newest_ + 1 < entries_.size() ? newest_ + 1 : 0;
    // Written field by field: a whole entry would pass through the stack, and the next read of it
    // would stall until it is written.
    Entry& next = entries_[newest_];
    next.sample = sample;
    next.sample.force += unrounded;
    next.weight = 1.0;
    next.force = last.force + next.sample.force;
    next.count = last.count + 1;
    next.role = role;
    next.pulls = pulls;
  }

  // Whether a restored state is within its arrays.
  bool sound() const noexcept { return newest_ < entries_.size(); }

  Entry& ago(std::size_t age) noexcept { return entries_[place(age)]; }
  const Entry& ago(std::size_t age) const noexcept { return entries_[place(age)]; }

  // Removes a sample from the means over its neighbours.
  void withdraw(std::size_t age) noexcept {
    const double force = ago(age).sample.force;
    ago(age).role = Role::none;
    for (std::size_t later = 0; later <= age; ++later) {
      ago(later).force -= force;
      --ago(later).count;
    }
  }

  // Whether the neighbours of the sample `age` ago are in contact, where `zero` is the force in
  // free air. True if it has no neighbours.
  bool pressed(std::size_t age, double zero) const noexcept {
    const Side before = between(age + side + 1, age + 1);
    const Side after = between(age, age - std::min(age, side));
    return exceeds(before, zero) && exceeds(after, zero);
  }

  void forget(double factor) noexcept {
    for (std::size_t age = 0; age < side; ++age) ago(age).weight *= factor;
  }

  // Sets the noise for correlated neighbours: the mean over N ≤ 8 samples has the variance f σ²/N.
  // Differences of neighbours do not show this noise, and without it samples with negative noise
  // would become light.
  void set_correlated(double variance, double inflation) noexcept {
    const double most = static_cast<double>(side);
    correlated_ = inflation > 1.0 ? std::sqrt(variance * std::min(inflation, most)) : 0.0;
  }

  // Forgets the samples, but not the noise.
  void clear() noexcept { entries_ = {}; }

  // The smallest change of the force so far, 0 before any change: the resolution, if the sensor has
  // one.
  double least_step() const noexcept { return least_step_; }

  // The resolution of a sensor that rounds, else 0. It is known once the latest changes are all
  // multiples of the smallest, and sixteen of them are larger or follow a repeated reading; a
  // smooth force can rise evenly, without repeats.
  double resolution() const noexcept { return multiples_ < 16 ? 0.0 : least_step_; }

 private:
  struct Side {
    double sum;
    double count;
  };

  std::size_t place(std::size_t age) const noexcept {
    return newest_ >= age ? newest_ - age : newest_ + entries_.size() - age;
  }

  // The samples after the elder up to and including the younger. Absent samples add nothing.
  Side between(std::size_t elder, std::size_t younger) const noexcept {
    const Entry &first = ago(elder), &last = ago(younger);
    return {last.force - first.force, static_cast<double>(last.count - first.count)};
  }

  // A side without neighbours does not decide.
  bool exceeds(const Side& them, double zero) const noexcept {
    if (!(them.count > 0.0)) return true;
    const double excess = them.sum - them.count * zero;
    // |ΔF| of white noise has a median of 0.6745 √2 σ.
    const double deviations = 3.0 * std::max(step_ / 0.954, correlated_);
    return excess > 0.0 && excess * excess > deviations * deviations * them.count;
  }

  // Updates the running median of |ΔF|, finally in steps of a 64th, with a scatter of 8 %. A
  // coarsely quantised sensor repeats its values, so a difference of zero is ignored.
  void learn_noise(double step) noexcept {
    if (!(step > 0.0)) {
      repeated_ = true;
      return;
    }
    if (!(step_ > 0.0)) step_ = least_step_ = step;
    const double ratio = step / least_step_;
    least_step_ = std::min(least_step_, step);
    if (!(std::abs(ratio - std::round(ratio)) < 0.01)) {
      multiples_ = 0;
    } else if (repeated_ || ratio > 1.5) {
      ++multiples_;
    }
    repeated_ = false;
    if (pace_ < 64.0) {
      pace_ += 1.0;
      move_ = {pace_ / (pace_ + 1.0), (pace_ + 1.0) / pace_};
    }
    step_ *= move_[step > step_ ? 1 : 0];  // indexed, because a branch would be unpredictable
  }

  std::array<Entry, 2 * side + 2> entries_{};
  std::size_t newest_ = 0;
  double reading_ = 0.0;     // latest force as recorded
  double step_ = 0.0;        // median |ΔF|
  double correlated_ = 0.0;  // σ √f of correlated noise
  double least_step_ = 0.0;
  std::uint32_t multiples_ = 0;   // multiples of least_step_ since another change
  bool repeated_ = false;         // whether the latest reading repeated the one before
  double pace_ = 0.0;             // a step changes the median by one part in pace_ + 1
  std::array<double, 2> move_{};  // down, up
};

// The mean error of a rounded force. If a sensor rounds F + noise of deviation σ to steps Δ, its
// mean reading is F − Δ s(F/Δ), where F is relative to the nearest level and
//
//   s(u) = Σ (−1)^(k+1) sin(2πku)/(πk) exp(−2π²k²σ²/Δ²),   k = 1, 2, 3 …   (Widrow and Kollár 2008)
//
// The error averages out over a force that sweeps the levels, but not at light touch or where the
// probe turns: least squares at 8 σ have errors of 2 to 7 times the bound there. With F from the
// latest estimate the error can be corrected. An error in that F adds (1 − dE/dF) of itself, which
// also averages out over the levels.
class ForceRounding {
 public:
  // The correction to a reading, given the size of the steps and the force that the law predicts.
  // It is 0 unless the misfit, which may be that of an unconverged estimate, is small compared with
  // a step.
  double correction(double reading, double expected, double step) noexcept {
    if (!(step > 0.0)) return 0.0;
    const double away = (expected - reading) / step;
    constexpr double memory = 1024.0;
    count_ = std::min(count_ + 1.0, memory);
    square_ += (std::min(away * away, 1.0) - square_) / count_;
    return step * mean_error(away, square_ - 1.0 / 12.0);
  }

  // Whether the predicted forces are accurate enough to correct the readings.
  bool known() const noexcept { return applies(square_ - 1.0 / 12.0); }

  // σ²/Δ² above which rounding is ignored: at σ = 0.4 Δ it is at most 1.4 % of a step, a thirtieth
  // of σ.
  static constexpr double largest = 0.16;

  // Readings that differ from the law by much less than Δ²/12 in mean square were not rounded to Δ.
  static bool applies(double variance) noexcept {
    return variance < largest && variance > -1.0 / 24.0;
  }

  // s(u) for this σ²/Δ².
  static double mean_error(double u, double variance) noexcept {
    if (!applies(variance)) return 0.0;
    constexpr double least = 0.0064;
    constexpr double pi = std::numbers::pi;
    const double fading = std::exp(-2.0 * pi * pi * std::max(variance, least));
    const double cosine = std::cos(2.0 * pi * u);
    double sine = std::sin(2.0 * pi * u), before = 0.0, sum = 0.0;
    double power = fading, ratio = -fading * fading * fading;  // ±q, q⁴, q⁹ …
    for (int k = 1; k <= 4; ++k) {                             // the fifth term is below 0.003
      sum += sine * power / (pi * k);
      before = std::exchange(sine, 2.0 * cosine * sine - before);
      power *= ratio;
      ratio *= fading * fading;
    }
    return sum;
  }

 private:
  double square_ = 1.0;  // mean of min((expected − reading)²/Δ², 1)
  double count_ = 0.0;
};

// The sensor's offset measured above the surface: a prior F₀ ~ N(mean, deviation²).
struct OffsetPrior {
  double mean;
  double deviation;  // 0: unknown
};

// ρ_F = σ²/s_F², in samples, for a prior with the deviation s_F. An unknown offset gets the
// deviation of the forces, one unit, or 20 σ if the unit is small compared with the residual.
constexpr double offset_weight_of(double deviation, double variance) noexcept {
  if (deviation > 0.0) return variance / (deviation * deviation);
  return std::min(variance, 1.0 / (20.0 * 20.0));
}

class FreeAir {
 public:
  // A sample counts as free after ten in a row at this distance above the surface, in units of
  // penetration: the surface is not known more accurately, and slowly recovering material may still
  // touch.
  static constexpr double clearance = 0.02;
  static constexpr std::uint32_t fewest = 10;

  // Adds a sample; true if the inflation was updated.
  bool add(double penetration, double force, double forgetting_factor) noexcept {
    if (!(penetration < -clearance)) {
      run_ = 0;
      return false;
    }
    if (run_ < fewest) {
      ++run_;
      last_ = 0.0;
      return false;
    }
    forget(forgetting_factor);
    weight_ += 1.0;
    force_ = force;
    const double away = force - mean_;
    mean_ += away / weight_;
    const double rest = force - mean_;
    squares_ += away * rest;
    products_ += last_ * rest;
    last_ = rest;
    levels_.add({1.0}, rest, forgetting_factor);
    // A sixteenth more samples changes the inflation by a fraction of its error.
    if (static_cast<double>(++samples_) < 16.0 + weight_ / 16.0) return false;
    samples_ = 0;
    inflation_ = measured_inflation();
    return true;
  }

  void forget(double factor) noexcept {
    weight_ *= factor;
    squares_ *= factor;
    products_ *= factor;
  }

  bool known() const noexcept { return weight_ >= static_cast<double>(fewest); }
  bool sound() const noexcept { return levels_.sound(); }
  double mean() const noexcept { return known() ? mean_ : 0.0; }

  double variance() const noexcept {
    return weight_ > 0.0 ? std::max(squares_, 0.0) / weight_ : 0.0;
  }

  // Variance of the mean relative to white noise: from the longest blocks if neighbours correlate
  // (r > 4/√N), else 1.
  double inflation() const noexcept { return inflation_; }

  // s² = f σ²/N + δ²: the variance of the mean. The inflation f is (1 + r)/(1 − r) for nearly white
  // noise with the correlation r of neighbours. δ = (Δ/π) exp(−2π²σ²/Δ²) is the remaining error of
  // rounding to steps Δ.
  OffsetPrior prior(double step) const noexcept {
    const double variance = this->variance();
    const double of_mean = variance / weight_ * (inflation_ > 1.0 ? inflation_ : neighbours());
    constexpr double pi = std::numbers::pi;
    double rounding = 0.0;
    if (step > 0.0) {
      const double squared = variance / (step * step);
      const double before = std::max(squared - 1.0 / 12.0, 0.0);
      rounding = step / pi * std::exp(-2.0 * pi * pi * before);
      // Readings at only two levels do not determine the noise. Without noise the true mean is at
      // the border between the levels; with much noise it is at the share p of the upper level. The
      // measured mean, p, is wrong by 0 to |p − ½| steps.
      const double from_level = (force_ - mean_) / step;
      const double share = from_level - std::floor(from_level);
      constexpr double others = 0.005;  // contribution of further levels to p (1 − p) at σ = Δ/3
      if (squared < share * (1.0 - share) + others) {
        rounding = std::max(rounding, step * std::abs(share - 0.5) / std::numbers::sqrt3);
      }
    }
    constexpr double least = 1e-6;  // of the unit: no force sensor is more accurate than 1e-5
    return {mean_, std::max(std::sqrt(of_mean + rounding * rounding), least)};
  }

 private:
  double correlation() const noexcept {
    return squares_ > 0.0 ? std::clamp(products_ / squares_, 0.0, 0.999) : 0.0;
  }
  double neighbours() const noexcept { return (1.0 + correlation()) / (1.0 - correlation()); }

  double measured_inflation() const noexcept {
    if (!(correlation() * std::sqrt(weight_) > 4.0)) return 1.0;
    // Over many samples at least 32 pairs of blocks: eight pairs determine a variance to a half
    // only.
    const LevelNoise noise(levels_, variance(), {1.0, true, std::max(8.0, weight_ / 512.0)});
    if (noise.measured < 3) return neighbours();  // too few levels to measure the growth
    const double quantile = widened_quantile(2.0 / noise.scatter);
    return std::max(quantile * quantile * noise.ratio[noise.used], 1.0);
  }

  HaarLevels<1, float> levels_;
  double weight_ = 0.0;
  double mean_ = 0.0;
  double squares_ = 0.0;   // Σ (F − mean)²
  double products_ = 0.0;  // the same products for neighbours
  double last_ = 0.0;
  double force_ = 0.0;  // latest force, which is a level of a coarse sensor
  double inflation_ = 1.0;
  std::uint32_t run_ = 0;
  std::uint32_t samples_ = 0;  // since the latest update of the inflation
};

// The difference between a fitted offset and its prior, in standard deviations. Above the first
// limit the tare is flagged, above the second the prior is dropped. A surface error of 10 µm
// changes the offset by four deviations of the mean over a pause: with a limit of three, the ball
// with the paper's sensors for 20 s reaches 0.92 of the bound, with five 0.70.
inline constexpr double suspect_offset = 3.0;
inline constexpr double largest_offset = 5.0;

struct Tare {
  OffsetPrior prior;
  bool of_air;   // from free air or an earlier estimate instead of a tare
  bool refuted;  // free air contradicts the tare
};

// The tighter prior of a tare (with the deviation `declared`, if not 0) and free air; free air if
// it contradicts the tare. A wrong surface looks like an offset, so its deviation widens the prior.
inline Tare measured_offset(bool offset, double declared, double surface_deviation,
                            const FreeAir& air, double step) noexcept {
  const bool told = declared > 0.0;
  Tare result{{0.0, declared}, !told, false};
  if (offset && air.known()) {
    const OffsetPrior said = air.prior(step);
    result.refuted =
        told && std::abs(said.mean) > suspect_offset * combined(declared, said.deviation);
    result.of_air = !(told && !result.refuted && declared < said.deviation);
    if (result.of_air) result.prior = said;
  }
  double& deviation = result.prior.deviation;
  if (deviation > 0.0) deviation = combined(deviation, surface_deviation);
  return result;
}

// Light samples are included if their excess over the noise of the firm samples is below this many
// standard deviations, and if the force of the law is positive for at least this fraction of them.
inline constexpr double largest_excess = 3.0;
inline constexpr double fewest_usable = 0.9;

// Excess of the light samples' part of Σ r² over noise of this variance, in standard deviations.
inline double excess_of(double more, double light, double variance) noexcept {
  return (more - light * variance) / (variance * std::sqrt(2.0 * light));
}

}  // namespace palpate::detail
