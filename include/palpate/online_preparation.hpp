// From what a robot measures to what an estimator takes, one sample at a time:
//
//   penetration = ± d·p − surface,   force = ± d·f − offset − tare,   velocity by
//   velocity_filter.hpp
//
// p [m] and f [N] are a position and a force along the contact normal, or vectors with the
// direction d into the material. The tare is the mean force of the first seconds, in which nothing
// is touched.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "palpate/sample.hpp"
#include "palpate/velocity_filter.hpp"

namespace palpate {

struct OnlinePreparationSettings {
  VelocityFilterSettings filter{};
  double surface = 0.0;           // m; where the material begins
  double force_offset = 0.0;      // N; taken off
  double tare_time = 0.0;         // s; so long nothing is given, and the mean force is taken off
  bool flip_penetration = false;  // its sign is turned, before the surface is taken off
  bool flip_force = false;
  std::array<double, 3> direction{};  // of length 1, into the material; of vectors only

  bool operator==(const OnlinePreparationSettings&) const = default;
};

// What is wrong with these settings, in words; null where they are sound.
constexpr const char* validate(const OnlinePreparationSettings& settings,
                               std::size_t maximum_samples) noexcept {
  if (const char* fault = validate(settings.filter, maximum_samples)) return fault;
  double length = 0.0;
  for (const double part : settings.direction) length += part * part;
  return detail::first_fault({
      {detail::lies_in(settings.surface, -1e6, 1e6), "surface must be in [-1e6, 1e6] m"},
      {detail::lies_in(settings.force_offset, -1e30, 1e30),
       "force_offset must be in [-1e30, 1e30] N"},
      {detail::lies_in(settings.tare_time, 0.0, 1e6), "tare_time must be in [0, 1e6] s"},
      {length == 0.0 || (length > 1.0 - 1e-6 && length < 1.0 + 1e-6),
       "direction must be of length 1"},
  });
}

template <std::size_t MaximumSamples = 15>
class OnlinePreparation {
 public:
  using Settings = OnlinePreparationSettings;
  using Vector3 = std::array<double, 3>;

  explicit OnlinePreparation(const Settings& settings = {}) noexcept
      : settings_(settings), filter_(settings.filter) {}

  // One sample_time after the call before.
  Status update(double position, double force) noexcept {
    advance_clock();
    return take(position, force, settings_.filter.sample_time);
  }

  // At this time [s], by any clock. What a Status says is VelocityFilter::update's; where the clock
  // was set, back by more than a gap or far ahead, the window starts anew.
  Status update_at(double position, double force, double time) noexcept {
    const double nominal = settings_.filter.sample_time;
    const double dt = calls_ ? time - now_ : nominal;
    if (!std::isfinite(time) || (dt <= 0.0 && dt >= -filter_.longest_gap())) {
      return status_ = Status::invalid_step;
    }
    set_clock(time);
    if (dt > 0.0 && dt <= longest_step) return take(position, force, dt);
    filter_.interrupt();
    take(position, force, nominal);
    if (!refused(status_)) status_ = Status::restarted;
    return status_;
  }

  Status update(const Vector3& position, const Vector3& force) noexcept {
    return update(along(position), along(force));
  }
  Status update_at(const Vector3& position, const Vector3& force, double time) noexcept {
    return update_at(along(position), along(force), time);
  }

  // The sample that the latest update gave, if it returned Status::updated: its age is until now.
  FilteredSample sample() const noexcept {
    FilteredSample sample = filter_.sample();
    sample.force -= tare_;
    return sample;
  }
  // When that was, s: by the clock that is given, else since the first call.
  double time() const noexcept {
    const double age = filter_.sample().age, nominal = settings_.filter.sample_time;
    const double ticks_ago = std::nearbyint(age / nominal), ticks = static_cast<double>(ticks_);
    // Of ticks alone it is a multiple of them, without the rounding of a difference.
    if (ticks_ago <= ticks) return origin_ + (ticks - ticks_ago) * nominal;
    return now_ - age;
  }

  Status status() const noexcept { return status_; }

  // The mean force that is taken off, N; NaN until it is known.
  double tare() const noexcept {
    return taring_ ? std::numeric_limits<double>::quiet_NaN() : tare_;
  }

  void interrupt() noexcept { filter_.interrupt(); }
  double delay() const noexcept { return filter_.delay(); }
  const Settings& settings() const noexcept { return settings_; }
  void reset() noexcept { *this = OnlinePreparation(settings_); }

 private:
  double along(const Vector3& vector) const noexcept {
    const Vector3& d = settings_.direction;
    return d[0] * vector[0] + d[1] * vector[1] + d[2] * vector[2];
  }

  // Counted, so that a clock of many days has no rounding of each of its ticks.
  void advance_clock() noexcept {
    if (calls_++ == 0) return;
    ++ticks_;
    now_ = origin_ + static_cast<double>(ticks_) * settings_.filter.sample_time;
  }
  void set_clock(double time) noexcept {
    ++calls_;
    now_ = origin_ = time;
    ticks_ = 0;
  }

  Status take(double position, double force, double dt) noexcept {
    const double penetration =
        (settings_.flip_penetration ? -position : position) - settings_.surface;
    const double push = (settings_.flip_force ? -force : force) - settings_.force_offset;
    status_ = filter_.update(penetration, push, dt);
    if (taring_ && !refused(status_)) status_ = tared(push, dt);
    return status_;
  }

  // Nothing is given before the tare is known.
  Status tared(double force, double dt) noexcept {
    if (tared_ > 0) tared_time_ += dt;
    if (tared_time_ >= settings_.tare_time && tared_ > 0) {
      tare_ = tare_sum_ / static_cast<double>(tared_);
      taring_ = false;
      return status_;
    }
    tare_sum_ += force;
    ++tared_;
    return status_ == Status::updated ? Status::waiting : status_;
  }

  static constexpr bool refused(Status status) noexcept {
    return status == Status::not_finite || status == Status::invalid_step ||
           status == Status::out_of_range;
  }

  static constexpr double longest_step = 1e6;  // s; beyond it a clock was set

  Settings settings_;
  VelocityFilter<MaximumSamples> filter_;
  double now_ = 0.0;     // s
  double origin_ = 0.0;  // s; of the ticks
  std::uint64_t ticks_ = 0;
  std::uint64_t calls_ = 0;
  bool taring_ = settings_.tare_time > 0.0;
  std::uint64_t tared_ = 0;
  double tared_time_ = 0.0;  // s
  double tare_sum_ = 0.0;    // N
  double tare_ = 0.0;        // N
  Status status_ = Status::waiting;
};

}  // namespace palpate
