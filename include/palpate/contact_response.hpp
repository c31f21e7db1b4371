// What a controller may act on: the stiffness K′ = ∂F/∂x and the damping B′ = ∂F/∂v of the contact
// at a depth and at the frequency of the motion so far, each with its standard error and whether it
// is usable. It may be read at any time: until the samples determine a number, its value lies
// within bounds that every material respects.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "palpate/estimate.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"

namespace palpate {

// The bits of `ContactResponse::checks`.
enum LoopCheck : std::uint16_t {
  stuck_channel = 1,      // force or position repeats its value while the other one changes
  saturated_force = 2,    // the force repeats its largest value while the position changes
  rejected_spikes = 4,    // at least one of the latest thousand samples was rejected
  late_force = 8,         // the damping is negative: the force is later than the position
  lost_contact = 16,      // there is no contact now
  moved_free_air = 32,    // the force in free air differs from that before
  changed_material = 64,  // the latest forces are not those of the law
};

struct ResponseNumber {
  double value;
  double standard_error;
  bool usable;
};

struct ContactResponse {
  ResponseNumber stiffness;  // N/m
  ResponseNumber damping;    // N·s/m
  double depth;              // m
  double frequency;          // rad/s; 0 before any motion
  double age;                // s since the latest sample that the numbers contain
  std::uint16_t checks;      // bits of LoopCheck
};

// Bounds of K′ and B′ that are known before the identification.
struct ResponsePrior {
  double least_stiffness = 0.0;                  // N/m
  double largest_stiffness = largest_parameter;  // N/m
  double least_damping = 0.0;                    // N·s/m
  double largest_damping = largest_parameter;    // N·s/m
};

namespace detail {

// K′ and B′ by the law of a method, SI.
struct LawResponse {
  double stiffness, stiffness_variance;
  double damping, damping_variance;
  double exponent, exponent_variance;
  double offset, offset_variance;  // N, N²
  // How far the damping is wrong by a force that the law does not explain, relative to a law that
  // was compared with laws with memory: without them relaxation looks like damping. (With 4.5, the
  // damping of three materials that relax is usable and wrong by more than 60 % for 5 ms in a
  // second of contact, with 6 never: benchmarks.online.)
  double damping_misfit = 6.0;
};

// aᵀ C a of the delta method.
template <std::size_t Size>
double variance_along(const Vector<Size>& a, const Matrix<Size>& covariance) noexcept {
  return bounded_variance(dot(a, multiply(covariance, a)));
}

// A law of one's own: differences of its force. How its parameters share their errors with K′ and
// B′ is not known here, so the variances are as large as they can be, and the numbers never usable.
template <class Law>
LawResponse law_response(const Fit<Law>& fit, double x, double) noexcept {
  const double step = 1e-4 * x, slow = 1e-4;  // m; m/s
  const double stiffness = fit.law.force(x + step, 0.0) - fit.law.force(x - step, 0.0);
  const double damping = fit.law.force(x, slow) - fit.law.force(x, -slow);
  const double unknown = bounded_variance(std::numeric_limits<double>::infinity());
  return {saturate(0.5 * stiffness / step),
          unknown,
          saturate(0.5 * damping / slow),
          unknown,
          1.5,
          0.1,
          fit.offset.value,
          fit.offset.variance};
}

inline LawResponse law_response(const Fit<KelvinVoigt>& fit, double, double) noexcept {
  const auto& [law, covariance, offset, surface, flags] = fit;
  return {law.K, covariance[0][0], law.B,          covariance[1][1], 1.0,
          0.0,   offset.value,     offset.variance};
}

inline LawResponse law_response(const Fit<ExtendedKelvinVoigt>& fit, double x, double) noexcept {
  const auto& [law, covariance, offset, surface, flags] = fit;
  return {law.K1 + 2.0 * law.K2 * x,
          variance_along({1.0, 2.0 * x, 0.0}, covariance),
          law.B,
          covariance[2][2],
          1.5,
          0.1,
          offset.value,
          offset.variance};
}

// In a first stroke stiffness and damping share the force. The ratio v B/K of soft materials, about
// 0.25 ± 0.15, tells them apart, unless the law contradicts it.
inline LawResponse law_response(const Fit<HuntCrossley>& fit, double x, double v) noexcept {
  const auto& [law, covariance, offset, surface, flags] = fit;
  const double n = law.n, depth = std::log(x), power = bounded_exp(n * depth);
  const double stiffness = saturate(n * law.K * power / x);
  const double damping = saturate(law.B * power);
  const Vector<3> to_stiffness{n * power / x, 0.0, stiffness * (1.0 / n + depth)};
  double value = stiffness, variance = variance_along(to_stiffness, covariance);
  constexpr double usual = 0.25, deviation = 0.15, most = 0.15;
  const double ratio = std::abs(v) * law.B / law.K;
  const Vector<3> to_ratio{-ratio / law.K, std::abs(v) / law.K, 0.0};
  const double total = variance_along(to_ratio, covariance) + deviation * deviation;
  const double shared = dot(to_stiffness, multiply(covariance, to_ratio)) / stiffness;
  const double change = shared / total * (usual - ratio);
  if (law.K > 0.0 && std::abs(change) < most) {
    value = stiffness * std::exp(change);
    const double relative = variance / (stiffness * stiffness) - shared * shared / total;
    variance = bounded_variance(std::max(relative, 0.0) * value * value);
  }
  return {value,
          variance,
          damping,
          variance_along({0.0, power, damping * depth}, covariance),
          n,
          covariance[2][2],
          offset.value,
          offset.variance};
}

// Follows the motion and the forces of a contact: some additions at every sample, 184 bytes.
class ContactWatch {
 public:
  // A sample in contact, SI. `fresh`: whether the method's solution was renewed.
  void touch(const Sample& s, double dt, bool fresh) noexcept {
    age_ = fresh ? 0.0 : age_ + dt;
    duration_ += dt;
    const double x = s.penetration, v = s.velocity;
    const double speed_squared = v * v;
    count_ += 1.0;
    sum_x_ += x;
    sum_xx_ += x * x;
    sum_v_ += v;
    sum_vv_ += speed_squared;
    const bool fast = speed_squared * count_ > slow * sum_vv_;
    fast_in_ += fast && v > 0.0;
    fast_out_ += fast && v < 0.0;
    follow(s);
    if (count_ >= memory) [[unlikely]] {
      for (double* sum : {&count_, &sum_x_, &sum_xx_, &sum_v_, &sum_vv_}) *sum *= 0.5;
    }
    watch_channels(s);
    peak_ = std::max(peak_, s.force);
  }

  // The force that the law predicts for this sample, and the variance of its residual. The law of
  // another material is known only after many samples, but the ratio of its force to the old law's
  // after two.
  void compare(double force, double predicted, double variance) noexcept {
    const double error = force - predicted;
    // The covariance of neighbouring errors: white noise has none, but for a tenth of its variance
    // that 512 samples leave at random.
    const float gain = std::max(1.0F / static_cast<float>(count_), misfit_gain);
    const float rest = short_of(error), of_noise = short_of(0.1 * variance);
    misfit_ += gain * (rest * last_error_ - of_noise - misfit_);
    last_error_ = rest;
    const bool firm = predicted * predicted > 100.0 * variance;
    const bool continues = run_ == 0 || (error > 0.0) == (run_force_ > run_law_);
    if (error * error > 9.0 * variance && firm && continues) {
      run_force_ = 0.8 * run_force_ + force;
      run_law_ = 0.8 * run_law_ + predicted;
      run_ = std::min<std::uint16_t>(run_ + 1, repeats);
    } else {
      run_ = 0;
      run_force_ = run_law_ = 0.0;
    }
  }

  // A sample above the surface, SI.
  void free(const Sample& s, double dt) noexcept {
    age_ += dt;
    leave();
    air_samples_ = std::min<std::uint16_t>(air_samples_ + 1, slow_air);
    const float samples = air_samples_, force = short_of(s.force);
    air_force_ += (force - air_force_) / samples;
    recent_air_ += (force - recent_air_) / std::min(samples, 64.0F);
    const float away = force - recent_air_;
    air_variance_ += (away * away - air_variance_) / samples;
  }

  // A sample below the surface that the method does not count as contact yet.
  void approach(const Sample& s, double dt) noexcept {
    age_ += dt;
    follow(s);
    position_ = s.penetration;
  }

  // The next sample in contact is that of another touch.
  void leave() noexcept {
    force_ = depth_ = run_force_ = run_law_ = 0.0;
    run_ = same_force_ = same_position_ = 0;
  }

  // A sample that the method did not take.
  void pass(double dt) noexcept { age_ += dt; }
  void reject(const Sample& s, double dt) noexcept {
    age_ += dt;
    watch_channels(s);
    spiky_ = 1000;
  }

  // The material has changed: the motion counts from here on. Until the law of the new material is
  // known, its stiffness is that of the old law times the ratio of the forces.
  void restart(const LawResponse& old) noexcept {
    const double ratio = this->ratio();
    const bool known = ratio != 1.0 && old.stiffness > 0.0;
    const double error = known ? 0.015 + 0.15 * std::abs(std::log(ratio)) : 0.0;
    anchor_ = {short_of(old.stiffness * ratio), short_of(position_), short_of(old.exponent),
               short_of(error)};
    duration_ = count_ = sum_x_ = sum_xx_ = sum_v_ = sum_vv_ = run_force_ = run_law_ = 0.0;
    fast_in_ = fast_out_ = run_ = 0;
    misfit_ = last_error_ = 0.0F;
  }

  double position() const noexcept { return position_; }

  // ω² = Var v/Var x of the motion so far; (v/x)² of a first stroke.
  double frequency() const noexcept {
    if (!(count_ > 0.0)) return 0.0;
    const double travel = sum_xx_ - sum_x_ * sum_x_ / count_;
    const double speed = sum_vv_ - sum_v_ * sum_v_ / count_;
    const double squared =
        both_ways() && travel > 0.0 ? speed / travel : sum_vv_ / (sum_xx_ + smallest);
    return std::sqrt(within(squared, 0.0, largest_parameter));
  }

  ContactResponse response(LawResponse law, double depth, double frequency, double velocity,
                           bool touching, const ResponsePrior& prior) const noexcept {
    std::uint16_t checks = this->checks(touching);
    if (anchor_.error > 0.0F) hold_anchor(law, depth);
    const double ratio = this->ratio();
    if (ratio != 1.0) checks |= changed_material;
    const double stiffness = law.stiffness * ratio, damping = law.damping * ratio;
    const bool cycle = both_ways() && duration_ * frequency > 2.0 * std::numbers::pi;
    // A first cycle does not tell laws apart, which differ by some percent of K′. Later, a force
    // that the law does not explain counts at the speed and the amplitude of the motion.
    const double unexplained = std::sqrt(std::max(static_cast<double>(misfit_), 0.0));
    const double speed = std::sqrt(sum_vv_ / std::max(count_, 1.0)) + smallest;
    const double by_speed = std::min(0.4 * unexplained / speed, largest_parameter);
    const double of_stiffness = cycle ? by_speed * frequency : 0.04 * stiffness;
    const double of_damping = cycle ? law.damping_misfit * by_speed : 0.3 * damping;
    const double stiffness_deviation = std::sqrt(law.stiffness_variance) * ratio;
    const double damping_deviation = std::sqrt(law.damping_variance) * ratio;
    const double stiffness_error = combined(stiffness_deviation, of_stiffness);
    const double damping_error = combined(damping_deviation, of_damping);
    const bool solved = stiffness > 0.0 && stiffness_error < largest_parameter;
    const double lowest = -2.5 * combined(damping_deviation, cycle ? by_speed : of_damping);
    if (solved && both_ways() && damping < lowest) checks |= late_force;
    // On a first approach K′/(F/x) is n/(1 + v B/K), whatever a law of few samples says.
    const double force = sprung_force(law), spring = stiffness * depth_;
    const bool plausible =
        cycle || velocity < 0.0 || (spring < 2.5 * force && spring > 0.3 * force);
    const double stiff = largest_stiffness_error * stiffness;
    const double damped = largest_damping_error * damping;
    const bool knows_stiffness = solved && plausible && stiffness_deviation < stiff;
    const bool knows_damping = knows_stiffness && both_ways() && damping_deviation < damped;
    constexpr std::uint16_t disturbing =
        stuck_channel | saturated_force | lost_contact | changed_material;
    const bool usable = knows_stiffness && stiffness_error < stiff && (checks & disturbing) == 0;
    // The damping is the energy that a whole cycle loses.
    const bool usable_damping = usable && knows_damping && cycle && damping_error < damped;

    ContactResponse r{{stiffness, stiffness_error, usable},
                      {damping, damping_error, usable_damping},
                      depth,
                      frequency,
                      age_,
                      checks};
    if (!knows_stiffness) r.stiffness = bounded_stiffness(law, force, solved);
    if (!knows_damping) r.damping = bounded_damping(r, solved);
    const auto& [softest, stiffest, least, most] = prior;
    r.stiffness.value = within(r.stiffness.value, softest, stiffest);
    r.damping.value = within(r.damping.value, least, most);
    return r;
  }

 private:
  static constexpr double memory = 65536.0;  // samples of the motion, of which then half count
  static constexpr double slow = 0.05;       // of the mean square of the speed
  static constexpr std::uint32_t fewest_fast = 20;
  static constexpr std::uint16_t repeats = 20;
  static constexpr std::uint16_t slow_air = 4096;
  static constexpr float misfit_gain = 1.0F / 512.0F;
  static constexpr double largest_stiffness_error = 0.15;  // of the value
  static constexpr double largest_damping_error = 0.3;
  static constexpr double smallest = 1e-300;

  // As a float whose square is finite.
  static float short_of(double value) noexcept {
    return static_cast<float>(std::clamp(value, -1e18, 1e18));
  }

  // The lower bound for NaN.
  static double within(double value, double low, double high) noexcept {
    return value >= low ? std::min(value, high) : low;
  }

  bool both_ways() const noexcept { return std::min(fast_in_, fast_out_) >= fewest_fast; }

  double ratio() const noexcept {
    return run_ >= 2 && run_law_ * run_force_ > 0.0 ? run_force_ / run_law_ : 1.0;
  }

  // The mean of ln K′ by the law and by the old law times the ratio, weighted by their variances.
  void hold_anchor(LawResponse& law, double depth) const noexcept {
    const double known = anchor_.stiffness, at = anchor_.depth;
    const double exponent = anchor_.exponent, error = anchor_.error;
    const double expected = known * bounded_exp((exponent - 1.0) * std::log(depth / at));
    const double later = count_ / 50.0;
    const double variance = error * error * (1.0 + later * later);
    const bool solved = law.stiffness > 0.0;
    const double own = solved ? law.stiffness_variance / (law.stiffness * law.stiffness) : 1e9;
    const double share = variance / (variance + own);
    if (!solved) law.stiffness = expected;
    law.stiffness = expected * std::exp(share * std::log(law.stiffness / expected));
    law.stiffness_variance = share * own * law.stiffness * law.stiffness;
  }

  // Weighted sum of the latest forces, without the offset once it is known.
  double sprung_force(const LawResponse& law) const noexcept {
    const bool tared = law.offset_variance < 0.01 * force_ * force_;
    constexpr double weight = 4.0;  // Σ 0.75ᵏ
    return std::max(force_ - (tared ? weight * law.offset : 0.0), 0.0);
  }

  // K′ = n F/x/(1 + v B/K) with n in [1, 2] and v B/K in [0, 1], as soft materials have. The law's
  // exponent and stiffness count by their variances.
  ResponseNumber bounded_stiffness(const LawResponse& law, double force,
                                   bool solved) const noexcept {
    if (!(depth_ > 0.0 && force > 0.0)) return {0.0, largest_parameter, false};
    constexpr double usual_exponent = 1.45, elastic = 0.8, spread = 0.35;
    constexpr double variance = spread * spread;
    const bool passive = law.damping >= 0.0;
    const double exponent_variance = law.exponent_variance + (passive ? 0.0 : variance);
    const double known = solved ? variance / (variance + exponent_variance) : 0.0;
    const double n = usual_exponent + known * (std::clamp(law.exponent, 1.0, 2.0) - usual_exponent);
    const double whole = n * force / depth_, typical = elastic * whole;
    if (!solved || !passive) return {typical, spread * typical, false};
    const double relative = law.stiffness_variance / (law.stiffness * law.stiffness);
    const double share = variance / (variance + relative);
    const double value = typical * std::exp(share * std::log(law.stiffness / typical));
    return {std::clamp(value, 0.5 * whole, whole), spread * typical, false};
  }

  // A loss factor ωB′/K′ of 0.1, which is typical of soft materials, and of at most 0.4. The law's
  // B′ and this are weighted by their variances.
  ResponseNumber bounded_damping(const ContactResponse& r, bool solved) const noexcept {
    if (!(r.frequency > 0.0)) return {0.0, largest_parameter, false};
    const double typical = 0.1 * r.stiffness.value / r.frequency;
    const double variance = r.damping.standard_error * r.damping.standard_error;
    const double share = solved ? typical * typical / (typical * typical + variance) : 0.0;
    const double value = typical + share * (r.damping.value - typical);
    return {std::clamp(value, 0.0, 4.0 * typical), typical, false};
  }

  // Weighted sums of the latest samples, about four.
  void follow(const Sample& s) noexcept {
    force_ = 0.75 * force_ + s.force;
    depth_ = 0.75 * depth_ + s.penetration;
  }

  void watch_channels(const Sample& s) noexcept {
    const bool same_force = s.force == reading_, same_position = s.penetration == position_;
    if (same_force || same_position || same_force_ + same_position_ > 0) [[unlikely]] {
      if (same_force_ == 0) position_at_repeat_ = position_;
      if (same_position_ == 0) force_at_repeat_ = reading_;
      same_force_ = same_force ? std::min<std::uint16_t>(same_force_ + 1, repeats) : 0;
      same_position_ = same_position ? std::min<std::uint16_t>(same_position_ + 1, repeats) : 0;
    }
    reading_ = s.force;
    position_ = s.penetration;
    if (spiky_ > 0) --spiky_;
  }

  std::uint16_t checks(bool touching) const noexcept {
    std::uint16_t found = 0;
    constexpr double moved = 0.05;
    const double travel = std::abs(position_ - position_at_repeat_);
    if (same_force_ == repeats && travel > moved * position_) {
      found |= reading_ == peak_ ? saturated_force : stuck_channel;
    }
    const double change = std::abs(reading_ - force_at_repeat_);
    if (same_position_ == repeats && change > moved * peak_) found |= stuck_channel;
    if (spiky_ > 0) found |= rejected_spikes;
    if (!touching) found |= lost_contact;
    const float away = recent_air_ - air_force_;
    if (air_samples_ >= 256 && away * away > 4.0F * air_variance_) found |= moved_free_air;
    return found;
  }

  double duration_ = 0.0;  // s of contact
  double count_ = 0.0, sum_x_ = 0.0, sum_xx_ = 0.0, sum_v_ = 0.0, sum_vv_ = 0.0;
  double force_ = 0.0, depth_ = 0.0;
  double run_force_ = 0.0, run_law_ = 0.0;  // sums since the law does not fit
  double age_ = 0.0;
  double reading_ = 0.0, position_ = 0.0, peak_ = 0.0;
  struct Anchor {
    float stiffness, depth, exponent;
    float error;  // of ln K′; 0: no anchor
  };
  Anchor anchor_{};
  double force_at_repeat_ = 0.0, position_at_repeat_ = 0.0;
  float misfit_ = 0.0F, last_error_ = 0.0F;  // N², N
  float air_force_ = 0.0F, recent_air_ = 0.0F, air_variance_ = 0.0F;
  std::uint32_t fast_in_ = 0, fast_out_ = 0;
  std::uint16_t run_ = 0, spiky_ = 0, same_force_ = 0, same_position_ = 0, air_samples_ = 0;
};

}  // namespace detail
}  // namespace palpate
