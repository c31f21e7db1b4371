// Which samples are contact, by the force of their neighbours and never by their own: choosing a
// sample because noise made its force large would bias the law.
//
// A sample is *sure* where the means of the eight forces before it and of the eight after it both
// exceed F₀ + 3σ/√8. Whatever else is below the surface is *light*. Until the eighth neighbour has
// come the neighbours that there are decide, so that nothing is learned late.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "palpate/sample.hpp"

namespace palpate::detail {

enum class Role : std::uint8_t {
  none,      // not there, or withdrawn
  free,      // above the surface
  sure,      // firm contact
  light,     // below the surface, in contact or not
  unusable,  // light, where the law would pull
};

// The latest sample and seventeen before it, and how noisy their force is.
class ContactSamples {
 public:
  static constexpr std::size_t side = 8;  // neighbours on each side

  struct Entry {
    Sample sample{};
    double weight = 0.0;      // in its bank, after what was forgotten since
    double force = 0.0;       // Σ F of all up to this one, so that a mean is a difference …
    std::uint32_t count = 0;  // … and how many they are
    Role role = Role::none;
    bool pulls = false;
  };

  void push(const Sample& sample, Role role, bool pulls) noexcept {
    const Entry& last = entries_[newest_];
    if (last.role != Role::none) learn_noise(std::abs(sample.force - last.sample.force));
    newest_ = newest_ + 1 < entries_.size() ? newest_ + 1 : 0;
    // One by one: a whole entry goes through the stack, and its reading waits for the writing.
    Entry& next = entries_[newest_];
    next.sample = sample;
    next.weight = 1.0;
    next.force = last.force + sample.force;
    next.count = last.count + 1;
    next.role = role;
    next.pulls = pulls;
  }

  Entry& ago(std::size_t age) noexcept { return entries_[place(age)]; }
  const Entry& ago(std::size_t age) const noexcept { return entries_[place(age)]; }

  // Takes a sample out of its neighbours' means.
  void withdraw(std::size_t age) noexcept {
    const double force = ago(age).sample.force;
    ago(age).role = Role::none;
    for (std::size_t later = 0; later <= age; ++later) {
      ago(later).force -= force;
      --ago(later).count;
    }
  }

  // Whether the neighbours of the sample of `age` ago press, beside a force `zero` in free air. One
  // without neighbours is not doubted.
  bool pressed(std::size_t age, double zero) const noexcept {
    const Side before = between(age + side + 1, age + 1);
    const Side after = between(age, age - std::min(age, side));
    return exceeds(before, zero) && exceeds(after, zero);
  }

  void forget(double factor) noexcept {
    for (std::size_t age = 0; age < side; ++age) ago(age).weight *= factor;
  }

  // Forgets the samples; what is known of the noise stays.
  void clear() noexcept { entries_ = {}; }

  // The smallest step of the force seen, 0 before one: that of its resolution, if it has one.
  double least_step() const noexcept { return least_step_; }

 private:
  struct Side {
    double sum;
    double count;
  };

  std::size_t place(std::size_t age) const noexcept {
    return newest_ >= age ? newest_ - age : newest_ + entries_.size() - age;
  }

  // The samples after the elder up to the younger. What was never there adds nothing.
  Side between(std::size_t elder, std::size_t younger) const noexcept {
    const Entry &first = ago(elder), &last = ago(younger);
    return {last.force - first.force, static_cast<double>(last.count - first.count)};
  }

  // Without neighbours on a side it is the other's to say.
  bool exceeds(const Side& them, double zero) const noexcept {
    if (!(them.count > 0.0)) return true;
    const double excess = them.sum - them.count * zero;
    // |ΔF| of white noise has a median of 0.6745 √2 σ.
    const double deviations = (3.0 / 0.954) * step_;
    return excess > 0.0 && excess * excess > deviations * deviations * them.count;
  }

  // The median of |ΔF| by steps up and down, of a 64th in the end, which leave it 8 % of scatter. A
  // sensor of coarse steps repeats itself: no step says nothing.
  void learn_noise(double step) noexcept {
    if (!(step > 0.0)) return;
    if (!(step_ > 0.0)) step_ = least_step_ = step;
    least_step_ = std::min(least_step_, step);
    if (pace_ < 64.0) {
      pace_ += 1.0;
      move_ = {pace_ / (pace_ + 1.0), (pace_ + 1.0) / pace_};
    }
    step_ *= move_[step > step_ ? 1 : 0];  // by place: as a branch it would be a toss-up
  }

  std::array<Entry, 2 * side + 2> entries_{};
  std::size_t newest_ = 0;
  double step_ = 0.0;  // median |ΔF|
  double least_step_ = 0.0;
  double pace_ = 0.0;             // steps are by one part in so many
  std::array<double, 2> move_{};  // down, up
};

// What the force above the surface says of the sensor's offset: a prior F₀ ~ N(mean, deviation²).
struct OffsetPrior {
  double mean;
  double deviation;  // 0: nothing is known
};

// ρ_F = σ²/s_F² in samples, of a prior of this deviation. Where nothing is known the offset may be
// as large as the forces are, one unit; where the unit is small beside the residual, 20 σ.
constexpr double offset_weight_of(double deviation, double variance) noexcept {
  if (deviation > 0.0) return variance / (deviation * deviation);
  return std::min(variance, 1.0 / (20.0 * 20.0));
}

class FreeAir {
 public:
  // A sample counts as free after ten in a row this far above the surface, in units of
  // penetration: a surface is not known better, and a material that recovers may still touch.
  static constexpr double clearance = 0.02;
  static constexpr std::uint32_t fewest = 10;

  void add(double penetration, double force, double forgetting_factor) noexcept {
    if (!(penetration < -clearance)) {
      run_ = 0;
      return;
    }
    if (run_ < fewest) {
      ++run_;
      last_ = 0.0;
      return;
    }
    forget(forgetting_factor);
    weight_ += 1.0;
    const double away = force - mean_;
    mean_ += away / weight_;
    const double rest = force - mean_;
    squares_ += away * rest;
    products_ += last_ * rest;
    last_ = rest;
  }

  void forget(double factor) noexcept {
    weight_ *= factor;
    squares_ *= factor;
    products_ *= factor;
  }

  bool known() const noexcept { return weight_ >= static_cast<double>(fewest); }
  double mean() const noexcept { return known() ? mean_ : 0.0; }

  // s² = σ²/N (1 + r)/(1 − r) + δ²: of the mean of noise whose neighbours correlate by r, and what
  // rounding to steps Δ leaves beside it however many there are, δ = (Δ/π) exp(−2π²σ²/Δ²).
  OffsetPrior prior(double step) const noexcept {
    const double variance = std::max(squares_, 0.0) / weight_;
    const double correlation = squares_ > 0.0 ? std::clamp(products_ / squares_, 0.0, 0.999) : 0.0;
    const double of_mean = variance / weight_ * (1.0 + correlation) / (1.0 - correlation);
    constexpr double pi = std::numbers::pi;
    double rounding = 0.0;
    if (step > 0.0) {
      const double before = std::max(variance / (step * step) - 1.0 / 12.0, 0.0);
      rounding = step / pi * std::exp(-2.0 * pi * pi * before);
    }
    constexpr double least = 1e-6;  // of the unit: no force sensor is better than 1e-5
    return {mean_, std::max(std::sqrt(of_mean + rounding * rounding), least)};
  }

 private:
  double weight_ = 0.0;
  double mean_ = 0.0;
  double squares_ = 0.0;   // Σ (F − mean)²
  double products_ = 0.0;  // the same of neighbours
  double last_ = 0.0;
  std::uint32_t run_ = 0;
};

// Of a fit's offset beside its prior, in deviations: from the one a tare is flagged, beyond the
// other the prior is dropped. A surface 10 µm off moves the offset by four of what a pause leaves:
// dropped at three, the ball under the paper's sensors for 20 s has 0.92 of the bound, at five
// 0.70.
inline constexpr double suspect_offset = 3.0;
inline constexpr double largest_offset = 5.0;

struct Tare {
  OffsetPrior prior;
  bool of_air;   // free air or an earlier answer says it, not a tare
  bool refuted;  // a tare was made, and free air is beyond it
};

// The tighter of what a tare, of this deviation where it is not 0, and free air say; free air where
// it contradicts the tare. A surface that is off looks like an offset, and widens what is known.
inline Tare measured_offset(bool offset, double declared, double surface_deviation,
                            const FreeAir& air, double step) noexcept {
  const bool told = declared > 0.0;
  Tare result{{0.0, declared}, !told, false};
  if (offset && air.known()) {
    const OffsetPrior said = air.prior(step);
    result.refuted =
        told && std::abs(said.mean) > suspect_offset * std::hypot(declared, said.deviation);
    result.of_air = !(told && !result.refuted && declared < said.deviation);
    if (result.of_air) result.prior = said;
  }
  double& deviation = result.prior.deviation;
  if (deviation > 0.0) deviation = std::hypot(deviation, surface_deviation);
  return result;
}

// Light samples join where they have no more deviations than so many beyond the noise of the firm
// ones, and so large a part of them is none where the law would pull.
inline constexpr double largest_excess = 3.0;
inline constexpr double fewest_usable = 0.9;

// By how many deviations so many light samples, which leave this much more of Σ r², have more than
// noise of this variance.
inline double excess_of(double more, double light, double variance) noexcept {
  return (more - light * variance) / (variance * std::sqrt(2.0 * light));
}

}  // namespace palpate::detail
