// Subtracts a tool's weight and inertia from the wrench of its sensor, one sample at a time:
//
//   f = s f_raw − m g + (α× + ω×ω×) m c − b_f
//   τ = s τ_raw − m c × g + (I α + ω × I ω) − b_τ,   g = Rᵀ(g₀ − p̈) − (α× + ω×ω×) d
//
// in the axes of the sensor: mass m, centre of mass c from the sensor's origin, inertia I about it,
// lever d from the origin of the pose to it, sign s, bias b; position p, rotation R of the sensor.
//
// The derivatives are those of the least-squares quartic over the latest W poses at its middle,
// h = (W − 1)/2 steps ago, where q is the quaternion of the sensor:
//
//   y⁽ʲ⁾ = Σ_k c_jk y_k, k = −h … h,   ω = 2 vec(q* q'),   α = 2 vec(q* q'')
//
// At the end of the window they would be much noisier. Position and wrench are therefore returned
// of that instant too, as in online_preparation.hpp. The delay of the wrench behind the pose is
// taken out. W = 1 subtracts the weight only, without delay.
//
// Samples of any clock are first interpolated linearly to steps of the sample time, so that
// neither jitter nor a few lost samples look like an acceleration.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"

namespace palpate {

// The quaternion x, y, z, w of a rotation, by the best conditioned of four formulas.
inline Vector<4> quaternion_of(const Matrix<3>& r) noexcept {
  const double trace = r[0][0] + r[1][1] + r[2][2];
  std::size_t i = 0;
  for (std::size_t k = 1; k < 3; ++k) i = r[k][k] > r[i][i] ? k : i;
  const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
  Vector<4> q = {r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1], 1.0 + trace};
  if (trace < r[i][i]) {
    q[3] = r[k][j] - r[j][k];
    q[j] = r[i][j] + r[j][i];
    q[k] = r[i][k] + r[k][i];
    q[i] = 1.0 + 2.0 * r[i][i] - trace;
  }
  const double norm = std::sqrt(detail::dot(q, q));
  for (double& part : q) part /= norm;
  return q;
}

struct PayloadCompensationSettings {
  double sample_time = 1e-3;    // s
  std::uint32_t samples = 101;  // W, odd
  bool in_base = true;          // return the wrench in the axes of the base, else of the sensor
  double delay = 0.0;           // s; of the wrench behind the pose
  double sign = 1.0;            // −1 if the sensor reads the force that the tool exerts
  double mass = 0.0;            // kg
  Vector<3> centre{};           // m
  Vector<3> lever{};            // m
  Matrix<3> inertia{};          // kg·m²
  Vector<4> mount = {0.0, 0.0, 0.0, 1.0};  // quaternion of the sensor in the pose
  Vector<6> bias{};                        // N, N·m

  bool operator==(const PayloadCompensationSettings&) const = default;
};

// The error in these settings as a message; null if they are valid.
constexpr const char* validate(const PayloadCompensationSettings& settings,
                               std::size_t maximum_samples) noexcept {
  double sum = 0.0;
  for (const double value : settings.centre) sum += value * value;
  for (const double value : settings.lever) sum += value * value;
  for (const double value : settings.bias) sum += value * value;
  for (const auto& row : settings.inertia) sum += detail::dot(row, row);
  const double longest = 0.5 * settings.sample_time * static_cast<double>(maximum_samples);
  return detail::first_fault({
      {detail::lies_in(settings.sample_time, 1e-6, 1e3), "sample_time must be in [1e-6, 1e3] s"},
      {settings.samples == 1 || (settings.samples >= 7 && settings.samples % 2 == 1 &&
                                 settings.samples <= maximum_samples),
       "samples must be 1, or odd, at least 7, and no more than the filter holds"},
      {detail::lies_in(settings.delay, -longest, longest),
       "delay must be at most half as long as what the filter holds"},
      {settings.sign == 1.0 || settings.sign == -1.0, "sign must be 1 or -1"},
      {detail::lies_in(settings.mass, 0.0, 1e6), "mass must be in [0, 1e6] kg"},
      {sum < 1e12, "centre, lever, inertia and bias must be within 1e6"},
      {detail::lies_in(detail::dot(settings.mount, settings.mount), 1.0 - 1e-6, 1.0 + 1e-6),
       "mount must be a unit quaternion"},
  });
}

struct CompensatedWrench {
  double time;         // s
  Vector<3> position;  // m
  Vector<6> wrench;    // N and, about the origin of the sensor, N·m
};

template <std::size_t MaximumSamples = 255>
class PayloadCompensation {
 public:
  using Settings = PayloadCompensationSettings;

  // Call validate() first for settings from outside.
  explicit PayloadCompensation(const Settings& settings = {}) noexcept : settings_(settings) {
    weights_[0][0] = 1.0;
    if (half_ > 0) set_weights();
    const double late = settings.delay / settings.sample_time;
    pose_age_ = std::max(half_, static_cast<std::size_t>(std::ceil(std::max(late, 0.0))));
    const double age = static_cast<double>(pose_age_) - late;
    wrench_age_ = static_cast<std::size_t>(age);
    part_ = age - static_cast<double>(wrench_age_);
    needed_ = std::max(pose_age_ + half_, wrench_age_ + 1) + 1;
  }

  // Adds a sample at this time [s]; the orientation is a unit quaternion x, y, z, w. Returns:
  //
  //   updated       taken; output() returns the delayed one
  //   waiting       taken; no output yet, or none for this sample, as samples are more frequent
  //   restarted     taken as the first of a new window, after a gap or a jump of the clock
  //   not_finite, invalid_step   refused
  //   out_of_range  refused; also if the norm of the orientation differs from 1 by over 2 %
  Status update(const Vector<3>& position, const Vector<4>& orientation, const Vector<6>& wrench,
                double time) noexcept {
    double sum = std::abs(time);
    for (const double value : position) sum += std::abs(value);
    for (const double value : orientation) sum += std::abs(value);
    for (const double value : wrench) sum += std::abs(value);
    if (!std::isfinite(sum)) return Status::not_finite;
    const double norm = std::sqrt(detail::dot(orientation, orientation));
    // A step must change the time.
    const bool resolved = std::abs(time) < 1e16 * settings_.sample_time;
    if (sum > 1e100 || !resolved || std::abs(norm - 1.0) > 0.02) return Status::out_of_range;
    const double gap = longest_gap * settings_.sample_time, step = time - latest_.time;
    if (count_ > 0 && step <= 0.0 && step >= -gap) return Status::invalid_step;
    const bool jumped = count_ > 0 && std::abs(step) > gap;
    Vector<4> q = product(orientation, settings_.mount);
    // q and −q are one rotation: take the sign that does not jump.
    const auto& before = latest_.pose;
    const double along = before[4] * q[0] + before[5] * q[1] + before[6] * q[2] + before[7] * q[3];
    for (double& part : q) part *= std::copysign(1.0 / norm, along);
    const Entry entry = {
        {position[0], position[1], position[2], 0.0, q[0], q[1], q[2], q[3]}, wrench, time};
    if (count_ == 0 || jumped) {
      count_ = steps_ = 0;
      origin_ = time;
      latest_ = entry;
    }
    const std::uint64_t steps_before = steps_;
    for (double at; (at = origin_ + static_cast<double>(steps_) * settings_.sample_time) <=
                    time + rounding * settings_.sample_time;
         ++steps_) {
      append(entry, at);
    }
    latest_ = entry;
    if (jumped) return Status::restarted;
    return count_ < needed_ || steps_ == steps_before ? Status::waiting : compensate();
  }

  // The output of the latest update, if it returned Status::updated.
  const CompensatedWrench& output() const noexcept { return output_; }
  // Delay of the output, s.
  double delay() const noexcept { return settings_.sample_time * static_cast<double>(pose_age_); }

  // Begins a tare in free air; finish_tare() then shifts the bias by the mean of the outputs since,
  // and returns whether there was one.
  void start_tare() noexcept {
    tare_sum_ = {};
    tared_ = 0.0;
  }
  bool finish_tare() noexcept {
    for (std::size_t i = 0; i < 6 && tared_ > 0.0; ++i) bias_[i] += tare_sum_[i] / tared_;
    return tared_ > 0.0;
  }

  const Vector<6>& bias() const noexcept { return bias_; }
  const Settings& settings() const noexcept { return settings_; }
  // Whether a restored state is within its window, and its clock at its newest sample.
  bool sound() const noexcept {
    const double now = origin_ + static_cast<double>(steps_) * settings_.sample_time;
    return half_ == settings_.samples / 2 &&
           (count_ == 0 || std::abs(now - latest_.time) <= longest_gap * settings_.sample_time);
  }
  void reset() noexcept { *this = PayloadCompensation(settings_); }

 private:
  struct Entry {
    std::array<double, 8> pose;  // position, 0, quaternion of the sensor
    Vector<6> wrench;
    double time;
  };

  static constexpr double longest_gap = 10.0;  // steps
  static constexpr double rounding = 1e-3;     // steps; a sample that is early by less is in time
  static constexpr std::size_t capacity = std::bit_ceil(2 * MaximumSamples);

  const Entry& ago(std::size_t age) const noexcept {
    return window_[(newest_ - age) & (capacity - 1)];
  }

  // Adds the pose and wrench at a time up to that of the newest sample.
  void append(const Entry& entry, double time) noexcept {
    Entry& added = window_[++newest_ & (capacity - 1)];
    const double span = entry.time - latest_.time;
    const double part = span > 0.0 ? (time - latest_.time) / span : 1.0;
    for (std::size_t i = 0; i < 8; ++i) {
      added.pose[i] = latest_.pose[i] + part * (entry.pose[i] - latest_.pose[i]);
    }
    for (std::size_t i = 0; i < 6; ++i) {
      added.wrench[i] = latest_.wrench[i] + part * (entry.wrench[i] - latest_.wrench[i]);
    }
    added.time = time;
    count_ = std::min(count_ + 1, needed_);
  }

  static Vector<3> cross(const Vector<3>& a, const Vector<3>& b) noexcept {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  }
  // The product of two quaternions, which rotates by b first.
  static Vector<4> product(const Vector<4>& a, const Vector<4>& b) noexcept {
    return {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
            a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
            a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
            a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
  }
  static Vector<3> rotate(const Vector<4>& q, const Vector<3>& v) noexcept {
    const auto turned = product(product(q, {v[0], v[1], v[2], 0.0}), {-q[0], -q[1], -q[2], q[3]});
    return {turned[0], turned[1], turned[2]};
  }

  // Orthogonal polynomials of u = k/h by their recurrence, p_j+1 = u p_j − (N_j / N_j−1) p_j−1,
  // with N_j = Σ p_j²; `at` are p_j and its derivatives at 0.
  void set_weights() noexcept {
    const double h = static_cast<double>(half_), unit = h * settings_.sample_time;
    std::array<double, MaximumSamples / 2 + 1> now, before{};
    now.fill(1.0);
    Vector<3> at = {1.0, 0.0, 0.0}, at_before{};
    weights_[0] = {};
    double norm_before = 1.0;
    for (int degree = 0; degree <= 4; ++degree) {
      double norm = now[0] * now[0];
      for (std::size_t k = 1; k <= half_; ++k) norm += 2.0 * now[k] * now[k];
      const double ratio = degree > 0 ? norm / norm_before : 0.0;
      for (std::size_t k = 0; k <= half_; ++k) {
        weights_[k][0] += now[k] * at[0] / norm;
        weights_[k][1] += now[k] * at[1] / norm / unit;
        weights_[k][2] += now[k] * at[2] / norm / (unit * unit);
        const double next = now[k] * static_cast<double>(k) / h - ratio * before[k];
        before[k] = now[k];
        now[k] = next;
      }
      const Vector<3> next = {-ratio * at_before[0], at[0] - ratio * at_before[1],
                              2.0 * at[1] - ratio * at_before[2]};
      at_before = at;
      at = next;
      norm_before = norm;
    }
  }

  Status compensate() noexcept {
    const Entry& middle = ago(pose_age_);
    std::array<double, 8> second{};
    Vector<4> q{}, first{};
    for (std::size_t i = 0; i < 8; ++i) second[i] = weights_[0][2] * middle.pose[i];
    for (std::size_t i = 0; i < 4; ++i) q[i] = weights_[0][0] * middle.pose[i + 4];
    for (std::size_t k = 1; k <= half_; ++k) {
      const auto &later = ago(pose_age_ - k).pose, &earlier = ago(pose_age_ + k).pose;
      const Vector<3>& weight = weights_[k];
      std::array<double, 8> sum{};
      for (std::size_t i = 0; i < 8; ++i) sum[i] = later[i] + earlier[i];
      for (std::size_t i = 0; i < 8; ++i) second[i] += weight[2] * sum[i];
      for (std::size_t i = 0; i < 4; ++i) {
        q[i] += weight[0] * sum[i + 4];
        first[i] += weight[1] * (later[i + 4] - earlier[i + 4]);
      }
    }
    const double length = std::sqrt(detail::dot(q, q));
    for (double& part : q) part /= length;
    const Vector<4> inverse = {-q[0], -q[1], -q[2], q[3]};
    const auto spin = product(inverse, first);
    const auto bend = product(inverse, {second[4], second[5], second[6], second[7]});
    const double twice = 2.0 / length;
    const Vector<3> w = {twice * spin[0], twice * spin[1], twice * spin[2]};
    const Vector<3> a = {twice * bend[0], twice * bend[1], twice * bend[2]};
    const Vector<3> g = rotate(inverse, {-second[0], -second[1], -standard_gravity - second[2]});
    const auto swing = [&](const Vector<3>& arm) {  // (α× + ω×ω×) arm
      const Vector<3> tangential = cross(a, arm), centripetal = cross(w, cross(w, arm));
      return Vector<3>{tangential[0] + centripetal[0], tangential[1] + centripetal[1],
                       tangential[2] + centripetal[2]};
    };
    const Vector<3> swung = swing(settings_.lever);
    Vector<3> h{}, at_sensor{};
    for (std::size_t i = 0; i < 3; ++i) {
      h[i] = settings_.mass * settings_.centre[i];
      at_sensor[i] = g[i] - swung[i];
    }
    const Vector<3> moment = cross(h, at_sensor), by_centre = swing(h),
                    inertial = detail::multiply(settings_.inertia, a),
                    gyroscopic = cross(w, detail::multiply(settings_.inertia, w));
    const Vector<6>&recent = ago(wrench_age_).wrench, &older = ago(wrench_age_ + 1).wrench;
    Vector<6> load{}, rest{};
    for (std::size_t i = 0; i < 3; ++i) {
      load[i] = settings_.mass * at_sensor[i] - by_centre[i];
      load[i + 3] = moment[i] - inertial[i] - gyroscopic[i];
    }
    for (std::size_t i = 0; i < 6; ++i) {
      rest[i] = settings_.sign * (recent[i] + part_ * (older[i] - recent[i])) - load[i] - bias_[i];
      tare_sum_[i] += rest[i];
    }
    tared_ += 1.0;
    if (settings_.in_base) {
      const Vector<3> f = rotate(q, {rest[0], rest[1], rest[2]});
      const Vector<3> t = rotate(q, {rest[3], rest[4], rest[5]});
      rest = {f[0], f[1], f[2], t[0], t[1], t[2]};
    }
    output_ = {middle.time, {middle.pose[0], middle.pose[1], middle.pose[2]}, rest};
    return Status::updated;
  }

  static constexpr double standard_gravity = 9.80665;  // m/s²

  Settings settings_;
  std::size_t half_ = settings_.samples / 2;                 // h
  std::size_t pose_age_ = 0, wrench_age_ = 0;                // samples
  double part_ = 0.0;                                        // of a step beyond wrench_age_
  std::size_t needed_ = 1;                                   // entries for an output
  std::array<Vector<3>, MaximumSamples / 2 + 1> weights_{};  // c_jk by k and j
  std::array<Entry, capacity> window_{};
  std::size_t newest_ = 0, count_ = 0;
  Entry latest_{};       // the newest sample
  double origin_ = 0.0;  // s, of the first step
  std::uint64_t steps_ = 0;
  Vector<6> bias_ = settings_.bias, tare_sum_{};
  double tared_ = 0.0;  // outputs since start_tare()
  CompensatedWrench output_{};
};

}  // namespace palpate
