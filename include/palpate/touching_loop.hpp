// A control loop that touches a material: from first touch at the approach speed until it has
// settled, swings or bounces. The contact is a generalised Hunt–Crossley law, which may relax. The
// robot is one mass; its controller is sampled, and each command acts after a delay.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "palpate/force_laws.hpp"

namespace palpate::detail {

enum class Controller : int {
  admittance,  // from the force to a motion, which a position loop follows
  impedance,   // from the position to a force of the motors
  force,       // from the force to a force of the motors: proportional and integral
};

// A loop and the material that it touches, SI.
struct TouchingLoop {
  static constexpr std::size_t size = 20;
  GeneralisedHuntCrossley law;
  Controller controller;
  double gain;                  // factor of both gains, or on the force of an admittance
  double first_gain;            // virtual mass; stiffness; proportional gain
  double second_gain;           // virtual damping; damping; integral gain, 1/s
  double mass, tool_mass;       // of all that moves; of what is beyond the force sensor
  double friction;              // N·s/m
  double sample_time, delay;    // s
  double filter;                // corner of the force's Butterworth filter of order two, rad/s
  double bandwidth;             // of the position loop, critically damped, rad/s
  double wanted_force, speed;   // N; m/s at first touch
  double rest_depth, duration;  // m, where the law has the wanted force; s

  // The numbers of a row: five of the law, then the fields in their order.
  static TouchingLoop from(const double* row) noexcept {
    const auto controller = static_cast<Controller>(static_cast<int>(row[5]));
    return {law_of<GeneralisedHuntCrossley>(row),
            controller,
            row[6],
            row[7],
            row[8],
            row[9],
            row[10],
            row[11],
            row[12],
            row[13],
            row[14],
            row[15],
            row[16],
            row[17],
            row[18],
            row[19]};
  }

  // Whether a simulation ends: within 2²⁴ samples and 2¹⁶ steps each, with finite numbers.
  bool is_valid() const noexcept {
    const bool moves = mass > 0.0 && sample_time > 0.0 && rest_depth > 0.0 && speed > 0.0;
    const bool short_enough = delay >= 0.0 && delay / sample_time < 65536.0 && duration >= 0.0 &&
                              duration / sample_time < 16777216.0;
    const bool slow_enough = bandwidth * sample_time < 1000.0 && filter * sample_time < 1000.0;
    return moves && short_enough && slow_enough;
  }
  std::size_t whole_delay() const noexcept {
    return static_cast<std::size_t>(std::floor(delay / sample_time + 1e-9));
  }
  std::size_t samples() const noexcept { return static_cast<std::size_t>(duration / sample_time); }
};

struct TouchOutcome {
  static constexpr std::size_t size = 5;
  double losses = 0.0;         // how often the contact is lost
  double third_swing = 0.0;    // N, of the force in the third quarter of the time
  double last_swing = 0.0;     // N, in the last quarter
  double peak_force = 0.0;     // N
  double settling_time = 0.0;  // s, after which the force stays within 5 % of the wanted one

  std::array<double, size> numbers() const noexcept {
    return {losses, third_swing, last_swing, peak_force, settling_time};
  }
};

// The relaxing part of a law over steps of one length. The branches relax while xⁿ moves linearly
// in time; their force at a stage of Runge and Kutta needs no sum over the branches.
class RelaxingSteps {
 public:
  RelaxingSteps(const viscoelastic::RelaxationBranches& branches, double stiffness,
                double step) noexcept
      : count_(branches.count) {
    for (std::size_t i = 0; i < count_; ++i) {
      const double time = branches.times[i];
      stiffness_[i] = stiffness * branches.stiffnesses[i];
      for (std::size_t stage = 1; stage < 3; ++stage) {
        const double h = 0.5 * step * static_cast<double>(stage);
        const double lost = -std::expm1(-h / time);
        kept_[stage][i] = 1.0 - lost;
        gained_[stage][i] = h > 0.0 ? lost * time / h : 1.0;
        share_[stage] += stiffness_[i] * gained_[stage][i];
      }
      share_[0] += stiffness_[i];
    }
  }

  void begin(const double* state, double elastic) noexcept {
    start_ = elastic;
    held_ = {};
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t stage = 0; stage < 3; ++stage) {
        const double kept = stage == 0 ? 1.0 : kept_[stage][i];
        held_[stage] += stiffness_[i] * kept * state[i];
      }
    }
  }

  // The force at the start (0), in the middle (1) and at the end (2) of the step.
  double force(std::size_t stage, double elastic) const noexcept {
    return held_[stage] + share_[stage] * (elastic - start_);
  }

  void end(double* state, double elastic) const noexcept {
    for (std::size_t i = 0; i < count_; ++i) {
      // Sets a branch below 1e-76 to zero, because arithmetic on subnormal numbers is slow.
      const double next = kept_[2][i] * state[i] + gained_[2][i] * (elastic - start_);
      state[i] = (next + 1e-60) - 1e-60;
    }
  }

 private:
  using Branches = std::array<double, viscoelastic::RelaxationBranches::most>;
  std::size_t count_;
  Branches stiffness_{};
  std::array<Branches, 3> kept_{}, gained_{};
  std::array<double, 3> held_{}, share_{};
  double start_ = 0.0;
};

class Touch {
 public:
  // `commands` has room for the commands under way: whole_delay() + 2.
  Touch(const TouchingLoop& loop, const viscoelastic::RelaxationBranches& branches,
        double* commands) noexcept
      : loop_(loop), branches_(branches), commands_(commands) {}

  // Runs the loop; `forces`, if not null, receives the contact's force at each sample.
  TouchOutcome run(double* forces) noexcept {
    const TouchingLoop& l = loop_;
    const double late =
        std::max(0.0, l.delay - static_cast<double>(l.whole_delay()) * l.sample_time);
    const double most = longest_step();
    const std::size_t before = late > 1e-9 ? pieces(late, most) : 0;
    const std::size_t after = pieces(l.sample_time - late, most);
    const double first = before > 0 ? late / static_cast<double>(before) : 0.0;
    const double second = (l.sample_time - late) / static_cast<double>(after);
    RelaxingSteps early{branches_, l.law.M, first}, rest{branches_, l.law.M, second};
    approach();
    TouchOutcome outcome;
    std::array<double, 2> low{1e300, 1e300}, high{-1e300, -1e300};
    const std::size_t samples = l.samples(), newest = l.whole_delay() + 1;
    for (std::size_t k = 0; k < samples; ++k) {
      std::copy(commands_ + 1, commands_ + newest + 1, commands_);
      commands_[newest] = command();
      // The command from before acts until the delay's fraction of the sample time is over.
      acting_ = commands_[0];
      for (std::size_t i = 0; i < before; ++i) advance(early, first, outcome);
      acting_ = commands_[1];
      for (std::size_t i = 0; i < after; ++i) advance(rest, second, outcome);
      if (!(std::abs(state_[0]) < 10.0)) {  // m: it runs away
        outcome.third_swing = 0.0;
        outcome.last_swing = 1e9;
        outcome.settling_time = l.duration;
        return outcome;
      }
      const double force = contact_force(rest);
      if (forces != nullptr) forces[k] = force;
      outcome.peak_force = std::max(outcome.peak_force, force);
      if (std::abs(force - l.wanted_force) > 0.05 * l.wanted_force) {
        outcome.settling_time = static_cast<double>(k + 1) * l.sample_time;
      }
      if (2 * k >= samples) {
        const std::size_t quarter = 4 * k >= 3 * samples ? 1 : 0;
        low[quarter] = std::min(low[quarter], force);
        high[quarter] = std::max(high[quarter], force);
      }
    }
    outcome.third_swing = high[0] - low[0];
    outcome.last_swing = high[1] - low[1];
    return outcome;
  }

 private:
  using State = std::array<double, 4>;  // penetration, velocity, filtered force and its rate

  static std::size_t pieces(double time, double most) noexcept {
    return std::max<std::size_t>(1, static_cast<std::size_t>(std::ceil(time / most)));
  }

  // xᵉ for x > 0; most materials have an exponent that needs no logarithm.
  static double power(double x, double exponent) noexcept {
    if (exponent == 1.0) return x;
    if (exponent == 2.0) return x * x;
    return exponent == 0.0 ? 1.0 : std::pow(x, exponent);
  }

  double elastic(double x) const noexcept { return x > 0.0 ? power(x, loop_.law.n) : 0.0; }

  // A step that resolves the fastest part of the loop, at twice the depth at rest.
  double longest_step() const noexcept {
    const TouchingLoop& l = loop_;
    const double deep = 2.0 * std::max(l.rest_depth, 1e-6);
    const double stiffness =
        (l.law.K + l.law.M) * l.law.n * std::pow(deep, std::max(l.law.n - 1.0, 0.0));
    const double damping = l.law.B * std::pow(deep, l.law.p);
    const double fastest =
        std::max({std::sqrt(stiffness / l.mass), damping / l.mass, l.bandwidth, l.filter});
    // Not below a 2¹⁶th of a sample time, which a contact stiffer than any material would ask for.
    return std::max(std::min(5e-4, 0.35 / fastest), l.sample_time / 65536.0);
  }

  // Before first touch all moved at the approach speed, and the commands with it.
  void approach() noexcept {
    const TouchingLoop& l = loop_;
    state_ = {0.0, l.speed, 0.0, 0.0};
    const double lag = l.controller == Controller::admittance ? 2.0 / l.bandwidth : 0.0;
    // A command acts, on average, half a sample time after its delay; this is that of the sample
    // before the first.
    commanded_ = l.speed * (lag + l.delay - 0.5 * l.sample_time);
    commanded_speed_ = l.speed;
    before_ = -l.speed * l.sample_time;
    const double steady = l.friction * l.speed;
    if (l.controller == Controller::impedance) target_ = steady / (l.gain * l.first_gain);
    for (std::size_t j = 0; j < l.whole_delay() + 2; ++j) {
      const double ago = static_cast<double>(l.whole_delay() + 1 - j) * l.sample_time;
      commands_[j] = l.controller == Controller::admittance ? commanded_ - l.speed * ago : steady;
    }
  }

  // What the controller commands at a sample.
  double command() noexcept {
    const TouchingLoop& l = loop_;
    const double error = l.wanted_force - state_[2];
    const double speed = (state_[0] - before_) / l.sample_time;
    before_ = state_[0];
    switch (l.controller) {
      case Controller::admittance:  // as ros2_controllers integrates it
        commanded_speed_ +=
            l.sample_time * (l.gain * error - l.second_gain * commanded_speed_) / l.first_gain;
        commanded_ += l.sample_time * commanded_speed_;
        return commanded_;
      case Controller::impedance: {  // its target moves on at the approach speed to the rest
        const double along = std::max(0.0, target_) / l.rest_depth;
        const double wanted_speed = along < 1.0 ? l.speed : 0.0;
        const double spring = l.first_gain * (target_ - state_[0]);
        const double damper = l.second_gain * (wanted_speed - speed);
        const double ahead = l.wanted_force * std::min(1.0, along);
        if (along < 1.0) target_ = std::min(target_ + l.speed * l.sample_time, l.rest_depth);
        return l.gain * (spring + damper) + ahead;
      }
      case Controller::force:
        break;
    }
    sum_ += l.sample_time * error;
    return l.wanted_force + l.gain * (l.first_gain * error + l.second_gain * sum_);
  }

  double contact_force(const RelaxingSteps& relaxing) const noexcept {
    return contact_force(relaxing, 2, state_[0], state_[1]);
  }

  double contact_force(const RelaxingSteps& relaxing, std::size_t stage, double x,
                       double v) const noexcept {
    if (x <= 0.0) return 0.0;
    const double spring = power(x, loop_.law.n);
    const double damper = loop_.law.p == loop_.law.n ? spring : power(x, loop_.law.p);
    return std::max(
        0.0, loop_.law.K * spring + loop_.law.B * damper * v + relaxing.force(stage, spring));
  }

  State slope(const RelaxingSteps& relaxing, std::size_t stage, const State& z) const noexcept {
    const TouchingLoop& l = loop_;
    const double contact = contact_force(relaxing, stage, z[0], z[1]);
    double push = acting_ - l.friction * z[1];
    if (l.controller == Controller::admittance) {
      push = l.mass * l.bandwidth * (l.bandwidth * (acting_ - z[0]) - 2.0 * z[1]);
    }
    const double acceleration = (push - contact) / l.mass;
    const double measured = contact + l.tool_mass * acceleration;
    const double filtered = l.filter * (l.filter * (measured - z[2]) - std::numbers::sqrt2 * z[3]);
    return {z[1], acceleration, z[3], filtered};
  }

  static State moved(const State& z, double h, const State& slope) noexcept {
    return {z[0] + h * slope[0], z[1] + h * slope[1], z[2] + h * slope[2], z[3] + h * slope[3]};
  }

  void advance(RelaxingSteps& relaxing, double h, TouchOutcome& outcome) noexcept {
    relaxing.begin(memory_.data(), elastic(state_[0]));
    const State one = slope(relaxing, 0, state_);
    const State two = slope(relaxing, 1, moved(state_, 0.5 * h, one));
    const State three = slope(relaxing, 1, moved(state_, 0.5 * h, two));
    const State four = slope(relaxing, 2, moved(state_, h, three));
    for (std::size_t i = 0; i < state_.size(); ++i) {
      state_[i] += h / 6.0 * (one[i] + 2.0 * two[i] + 2.0 * three[i] + four[i]);
    }
    relaxing.end(memory_.data(), elastic(state_[0]));
    const bool inside = state_[0] > 0.0;
    if (touching_ && !inside) outcome.losses += 1.0;
    touching_ = inside;
  }

  const TouchingLoop& loop_;
  const viscoelastic::RelaxationBranches& branches_;
  double* commands_;  // the oldest first
  State state_{};
  std::array<double, viscoelastic::RelaxationBranches::most> memory_{};
  double acting_ = 0.0, commanded_ = 0.0, commanded_speed_ = 0.0, target_ = 0.0;
  double before_ = 0.0, sum_ = 0.0;
  bool touching_ = true;
};

}  // namespace palpate::detail
