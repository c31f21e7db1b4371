// Converts a robot's measurements to an estimator's samples, one at a time:
//
//   penetration = ± d·p − surface,   force = ± d·f − offset − tare,   velocity by VelocityFilter
//
// p [m] and f [N] are a position and a force along the contact normal, or vectors with the
// direction d into the material. The tare is the mean force of the first seconds, without contact.
//
// The velocity is computed from the positions, which delays it. Position and force are delayed
// equally, so that all three belong to one instant.
//
//   min over a, b, c of Σ (x_i − a − b s_i − c s_i²)²,   s_i = t_i − t_m,   v(t_m) = b
//
// over the latest W samples, with m in their middle: the Savitzky–Golay filter for a whole
// recording, half a window later. With an even clock, s_i = k T for k = −h … h, this is
//
//   v = Σ k x_k / (T Σ k²),   Σ k² = h (h + 1)(2 h + 1)/3,   h = (W − 1)/2
//
// otherwise two regressions, on s and on the part of s² that is orthogonal to 1 and s. Penetration
// and force are not smoothed, because a smoothed penetration would be another motion.
//
// A force that the sensor delivers δ late belongs to the middle of the window at t_m + δ. It is
// interpolated there between two samples of the window, which reaches half a window to both sides.
//
// A shorter delay would bias stiffness and damping: a backward difference is half a sample late and
// noisy like the position, and a mean of past samples lags behind the force.
//
// Dropouts of the position (outliers.hpp) are excluded from every window, and their samples are not
// returned. Their detection needs the two samples after them, which adds to the delay.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "palpate/outliers.hpp"
#include "palpate/sample.hpp"

namespace palpate {

struct VelocityFilterSettings {
  double sample_time = 1e-3;   // s
  std::uint32_t samples = 15;  // W, odd; longer than 15 ms flattens the motion of a probe
  double longest_gap = 0.0;    // s; a longer one restarts the window; 0: the window's length, W T
  bool lost_positions = true;  // exclude dropouts
  double force_delay = 0.0;    // s, δ of the force behind the position; at most half a window

  bool operator==(const VelocityFilterSettings&) const = default;
};

// The error in these settings as a message; null if they are valid.
constexpr const char* validate(const VelocityFilterSettings& settings,
                               std::size_t maximum_samples) noexcept {
  return detail::first_fault({
      // Keeps every velocity within the range of a double, which a metre in less than 1e-100 s
      // might leave.
      {detail::lies_in(settings.sample_time, 1e-100, 1e6),
       "sample_time must be in [1e-100, 1e6] s"},
      {settings.samples >= 3 && settings.samples % 2 == 1 && settings.samples <= maximum_samples,
       "samples must be odd, at least 3, and no more than the filter holds"},
      {detail::lies_in(settings.longest_gap, 0.0, 1e12), "longest_gap must be in [0, 1e12] s"},
      {std::abs(settings.force_delay) <= settings.sample_time * (settings.samples / 2),
       "force_delay must be at most half of the filter's window"},
  });
}

// The output of the filter: a delayed sample with its velocity.
struct FilteredSample : Sample {
  double dt;   // s, since the previous output
  double age;  // s, delay until now
};

template <std::size_t MaximumSamples = 15>
class VelocityFilter {
  static_assert(MaximumSamples >= 3 && MaximumSamples % 2 == 1);

 public:
  using Settings = VelocityFilterSettings;

  // Call validate() first for settings from outside.
  explicit VelocityFilter(const Settings& settings = {}) noexcept : settings_(settings) {
    const double h = static_cast<double>(half_);
    per_sum_ = 3.0 / (settings.sample_time * h * (h + 1.0) * (2.0 * h + 1.0));
  }

  Status update(double penetration, double force) noexcept {
    return update(penetration, force, settings_.sample_time);
  }

  // Adds a sample `dt` [s] after the previous call. Returns:
  //
  //   updated       taken; sample() returns the delayed one
  //   waiting       taken; no output yet, or the rate is below half of that in the settings: so
  //                 long a window would flatten the motion
  //   restarted     taken as the first of a new window, after too long a gap
  //   rejected      taken; the position of two samples ago was a dropout and has no output
  //   not_finite, invalid_step, out_of_range   refused; only its time counts
  Status update(double penetration, double force, double dt) noexcept {
    const bool finite = std::isfinite(penetration) && std::isfinite(force);
    if (!(dt >= shortest_step && dt <= longest_step)) {
      return finite ? Status::invalid_step : Status::not_finite;
    }
    elapsed_ += dt;
    since_given_ += dt;
    if (!finite) return Status::not_finite;
    if (!(std::abs(penetration) < largest && std::abs(force) < largest)) {
      return Status::out_of_range;
    }
    const Entry entry{elapsed_, penetration, force};
    elapsed_ = 0.0;
    if (entry.dt > longest_gap_ && taken_) [[unlikely]] {
      interrupt();
      take(entry);
      return Status::restarted;
    }
    return take(entry);
  }

  // The output of the latest update, if it returned Status::updated.
  const FilteredSample& sample() const noexcept { return sample_; }

  // Starts a new window: the next sample does not continue the latest one.
  void interrupt() noexcept {
    count_ = even_ = waiting_ = 0;
    carried_ = 0.0;
    taken_ = continuous_ = false;
    lost_.interrupt();
  }

  // Delay of the output, s, for an even clock without dropouts.
  double delay() const noexcept { return delay_; }
  double longest_gap() const noexcept { return longest_gap_; }
  const Settings& settings() const noexcept { return settings_; }
  // Whether a restored state is within its window.
  bool sound() const noexcept { return half_ == settings_.samples / 2; }

  void reset() noexcept { *this = VelocityFilter(settings_); }

 private:
  struct Entry {
    double dt;  // s, since the entry before
    double penetration;
    double force;
  };

  static constexpr double shortest_step = 1e-100, longest_step = 1e6;  // s
  static constexpr double largest = 1e100;                             // m or N
  static constexpr std::size_t capacity = std::bit_ceil(MaximumSamples);

  std::size_t lag() const noexcept {
    return half_ + (settings_.lost_positions ? LostPositions::ahead : 0);
  }

  // An entry of the window; `age` 0 is the newest.
  const Entry& ago(std::size_t age) const noexcept {
    return window_[(newest_ - age) & (capacity - 1)];
  }

  // The test of a sample for a dropout needs the two samples after it.
  Status take(const Entry& entry) noexcept {
    taken_ = true;
    if (!settings_.lost_positions) return append(entry);
    const Entry judged = pending_[1];
    pending_[1] = pending_[0];
    pending_[0] = entry;
    const bool lost = lost_.observe(entry.penetration);
    if (waiting_ < LostPositions::ahead) {
      ++waiting_;
      return Status::waiting;
    }
    if (lost) [[unlikely]] {
      carried_ += judged.dt;
      return Status::rejected;
    }
    const Entry kept{judged.dt + carried_, judged.penetration, judged.force};
    carried_ = 0.0;
    return append(kept);
  }

  Status append(const Entry& entry) noexcept {
    newest_ = (newest_ + 1) & (capacity - 1);
    window_[newest_] = entry;
    even_ = entry.dt == settings_.sample_time ? std::min(even_ + 1, settings_.samples) : 0;
    if (count_ < settings_.samples && ++count_ < settings_.samples) return Status::waiting;
    // The step before the oldest sample is not part of the window.
    const bool even = even_ >= settings_.samples - 1;
    const double velocity = even ? even_slope() : slope();
    const double force = settings_.force_delay == 0.0 ? ago(half_).force : late_force();
    if (std::isnan(velocity) || std::isnan(force)) {
      continuous_ = false;
      return Status::waiting;
    }
    const Entry& middle = ago(half_);
    const double age = age_of_middle(even);
    double dt = settings_.sample_time;
    if (given_) dt = continuous_ ? middle.dt : std::max(since_given_ - age, middle.dt);
    sample_ = {{middle.penetration, velocity, force}, dt, age};
    since_given_ = age;
    given_ = continuous_ = true;
    return Status::updated;
  }

  double age_of_middle(bool even) const noexcept {
    const double step = settings_.sample_time;
    const bool late = settings_.lost_positions;
    if (even && (!late || (pending_[0].dt == step && pending_[1].dt == step))) return delay_;
    double age = late ? pending_[0].dt + pending_[1].dt : 0.0;
    for (std::size_t k = 0; k < half_; ++k) age += ago(k).dt;
    return age;
  }

  // The force at t_m + δ; NaN if the window does not reach it.
  double late_force() const noexcept {
    const double late = settings_.force_delay;
    const bool newer = late > 0.0;
    double left = std::abs(late);
    for (std::size_t k = 0; k < half_; ++k) {
      const Entry& near = newer ? ago(half_ - k) : ago(half_ + k);
      const Entry& far = newer ? ago(half_ - k - 1) : ago(half_ + k + 1);
      const double step = newer ? far.dt : near.dt;
      // An even clock whose rounding puts δ just beyond the last sample.
      if (left <= step * (1.0 + 1e-9)) return near.force + (far.force - near.force) * left / step;
      left -= step;
    }
    return std::numeric_limits<double>::quiet_NaN();
  }

  double even_slope() const noexcept {
    double sum = 0.0;
    for (std::size_t k = 1; k <= half_; ++k) {
      sum += static_cast<double>(k) * (ago(half_ - k).penetration - ago(half_ + k).penetration);
    }
    return sum * per_sum_;
  }

  // The slope for any clock; NaN if the window is too long. Times count from the middle in units of
  // the largest, so that no power of them leaves the range of a double.
  [[gnu::noinline]] double slope() const noexcept {
    std::array<double, MaximumSamples> s, depth;
    const std::size_t h = half_;
    const Entry& middle = ago(h);
    s[h] = depth[h] = 0.0;
    for (std::size_t k = 1; k <= h; ++k) {
      s[h + k] = s[h + k - 1] + ago(h - k).dt;
      s[h - k] = s[h - k + 1] - ago(h + k - 1).dt;
      depth[h + k] = ago(h - k).penetration - middle.penetration;
      depth[h - k] = ago(h + k).penetration - middle.penetration;
    }
    if (s[2 * h] - s[0] > window_time_ + longest_gap_)
      return std::numeric_limits<double>::quiet_NaN();
    const double unit = std::max(s[2 * h], -s[0]), per_unit = 1.0 / unit;
    for (std::size_t i = 0; i <= 2 * h; ++i) s[i] *= per_unit;

    // From the middle outwards: two sums at a time are faster than one.
    const auto sum = [h](auto term) noexcept {
      double total = term(h);
      for (std::size_t k = 1; k <= h; ++k) total += term(h + k) + term(h - k);
      return total;
    };
    const double per_sample = 1.0 / static_cast<double>(settings_.samples);
    const double mean = per_sample * sum([&](std::size_t i) { return s[i]; });
    const double mean_square = per_sample * sum([&](std::size_t i) { return s[i] * s[i]; });
    const auto linear = [&](std::size_t i) { return s[i] - mean; };
    const double variance = sum([&](std::size_t i) { return linear(i) * linear(i); });
    const double along = sum([&](std::size_t i) { return linear(i) * depth[i]; });
    // The square, made orthogonal to 1 and s.
    const double skew =
        sum([&](std::size_t i) { return linear(i) * (s[i] * s[i] - mean_square); }) / variance;
    const auto square = [&](std::size_t i) { return s[i] * s[i] - mean_square - skew * linear(i); };
    const double energy = sum([&](std::size_t i) { return square(i) * square(i); });
    const double bent = sum([&](std::size_t i) { return square(i) * depth[i]; });
    // With only two distinct times the curvature is undetermined.
    const double curvature = energy > 0.0 ? bent / energy : 0.0;
    // At the middle, s = 0, the slope of curvature·(s² − skew s) is −curvature·skew.
    return (along / variance - curvature * skew) / unit;
  }

  Settings settings_;
  std::uint32_t half_ = settings_.samples / 2;                                               // h
  double window_time_ = settings_.sample_time * settings_.samples;                           // s
  double longest_gap_ = settings_.longest_gap > 0.0 ? settings_.longest_gap : window_time_;  // s
  double delay_ = settings_.sample_time * static_cast<double>(lag());                        // s
  double per_sum_;  // 1/(T Σ k²), 1/s
  LostPositions lost_;
  std::array<Entry, capacity> window_{};
  std::array<Entry, LostPositions::ahead> pending_{};  // the newest first; not yet tested
  std::size_t newest_ = 0;
  std::uint32_t count_ = 0;    // entries of the window
  std::uint32_t even_ = 0;     // latest steps that are the sample time
  std::uint32_t waiting_ = 0;  // entries of pending_
  bool taken_ = false;         // a sample, since the last break
  bool given_ = false;         // an output, ever
  bool continuous_ = false;    // an output, from this window
  double carried_ = 0.0;       // s, of dropouts
  double elapsed_ = 0.0;       // s, since the latest sample taken
  double since_given_ = 0.0;   // s, since the latest output
  FilteredSample sample_{};
};

struct OnlinePreparationSettings {
  VelocityFilterSettings filter{};
  double surface = 0.0;           // m; position of the surface
  double force_offset = 0.0;      // N; subtracted
  double tare_time = 0.0;         // s; without output; its mean force is subtracted afterwards
  bool flip_penetration = false;  // reverses its sign, before the surface is subtracted
  bool flip_force = false;
  std::array<double, 3> direction{};  // of length 1, into the material; for vectors only

  bool operator==(const OnlinePreparationSettings&) const = default;
};

// The error in these settings as a message; null if they are valid.
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

  // Adds a sample, one sample_time after the previous call.
  Status update(double position, double force) noexcept {
    advance_clock();
    return take(position, force, settings_.filter.sample_time);
  }

  // Adds a sample at this time [s], by any clock. Returns the status as VelocityFilter::update; if
  // the clock jumps, back by more than a gap or far ahead, the window restarts.
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

  // The output of the latest update, if it returned Status::updated.
  FilteredSample sample() const noexcept {
    FilteredSample sample = filter_.sample();
    sample.force -= tare_;
    return sample;
  }
  // The time of sample(), s: by the caller's clock, otherwise since the first call.
  double time() const noexcept {
    const double age = filter_.sample().age, nominal = settings_.filter.sample_time;
    const double ticks_ago = std::nearbyint(age / nominal), ticks = static_cast<double>(ticks_);
    // Without a clock it is a multiple of the sample time, so that no difference is rounded.
    if (ticks_ago <= ticks) return origin_ + (ticks - ticks_ago) * nominal;
    return now_ - age;
  }

  Status status() const noexcept { return status_; }

  // The mean force that is subtracted, N; NaN until it is known.
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

  // Ticks are counted, so that rounding does not accumulate over many days.
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

  // Adds to the tare; there is no output until the tare is known.
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

  static constexpr double longest_step = 1e6;  // s; beyond it the clock has jumped

  Settings settings_;
  VelocityFilter<MaximumSamples> filter_;
  double now_ = 0.0;     // s
  double origin_ = 0.0;  // s; start of the counted samples
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
