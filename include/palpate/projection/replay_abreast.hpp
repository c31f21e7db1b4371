// A whole trace of variable projection: answers after eight samples are worked out abreast, and
// agree with those of estimate() to a hundredth of a standard error; the recursion itself is the
// same to the last bit. Where a search is due its answer is the trace's. What is not regular, as
// with forgetting, beside a known exponent, about a change or in the first samples, is worked out
// sample by sample; so are eight of which one turns out not to be.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "palpate/force_laws.hpp"
#include "palpate/forgetting.hpp"
#include "palpate/matrix.hpp"
#include "palpate/projection/contact_solver.hpp"
#include "palpate/projection/local_sums.hpp"
#include "palpate/projection/solution.hpp"
#include "palpate/projection/solve_abreast.hpp"
#include "palpate/sample.hpp"
#include "palpate/status.hpp"
#include "palpate/trace_columns.hpp"

namespace palpate::detail {

template <class Estimator>
class ReplayAbreast {
 public:
  ReplayAbreast(Estimator& estimator, const Signals& in, const TraceColumns& out) noexcept
      : estimator_(estimator),
        in_(in),
        out_(out),
        sample_time_(estimator.settings().sample_time),
        settled_(estimator.settings().forgetting == no_forgetting &&
                 !(solver().settings().exponent > 0.0) &&
                 std::abs(units().log_penetration) < largest_unit),
        before_(estimator),
        known_(method().solution()),
        known_before_(known_),
        now_(method().snapshot(known_, units())) {}

  void run() noexcept {
    for (std::size_t k = 0; k < in_.count; ++k) take(k);
    if (count_ > 0) finish(in_.count - 1);
  }

 private:
  // e^(−δ ln x_r) is worked out by a few terms.
  static constexpr double largest_unit = 15.0;
  // Of n − n₀, which the polynomials are good for where the depth is at most the unit, half of it
  // moving n₀; where it is more, powers of it grow as (2 ln ξ)ᵈ.
  static constexpr double furthest = 0.02;
  double reach() const noexcept { return furthest / (1.0 + 4.0 * deepest_); }
  // Before that a search is due every third sample, and freedom is small.
  static constexpr double fewest_samples = 128.0;
  // Newton's steps go by the slopes alone, so that each leaves some 10 σ_n of the one before: one
  // is enough where it is so short, as that is a thousandth of σ_n then. The last may be so many
  // σ_n.
  static constexpr double largest_first_step = 1e-4;
  static constexpr double largest_step = 0.05;
  // Samples: a copy of the estimator costs 200 ns, and what was not regular is done again from it.
  static constexpr std::size_t between_copies = 32;

  const auto& method() const noexcept { return estimator_.method(); }
  const auto& solver() const noexcept { return method().solver(); }
  const Units& units() const noexcept { return estimator_.units(); }

  Sample sample(std::size_t k) const noexcept {
    return {in_.penetration[k], in_.velocity[k], in_.force[k]};
  }

  Status update(std::size_t k) noexcept {
    const Status status =
        estimator_.update_knowing(sample(k), time_step(in_, k, sample_time_), known_);
    out_.status[k] = static_cast<std::uint8_t>(status);
    return status;
  }

  // Whether the next answers may be worked out abreast.
  bool regular() const noexcept {
    const ProjectionSolution& last = method().last_solution();
    return settled_ && !method().keeps_exponent() && solver().weight() >= fewest_samples &&
           last.noise_variance > 0.0 && last.k != 0.0 && last.damping_identifiable &&
           last.exponent_identifiable && !last.at_edge;
  }

  void take(std::size_t k) noexcept {
    const bool abreast_here = regular();
    if (count_ == 0 && abreast_here) begin(k);
    const std::uint32_t revisions = solver().revisions();
    const double weight = weight_of_choice();
    const Status status = update(k);
    const bool usual = status == Status::updated || status == Status::held ||
                       status == Status::waiting || status == Status::guarded;
    if (!abreast_here || !usual || !regular() || !same_choice()) {
      local_ = false;
      if (count_ > 0) {
        finish(k);
      } else {
        plainly(k, status);
      }
      return;
    }
    add(k, revisions, weight);
    if (count_ == abreast) finish(k);
  }

  // A block begins, with sums about the last answer; and from time to time with the estimator as it
  // is, to go back to.
  void begin(std::size_t k) noexcept {
    first_ = k;
    if (k >= saved_ + between_copies) {
      saved_ = k;
      before_ = estimator_;
      known_before_ = known_;
      now_before_ = now_;
    }
    const ProjectionSolution& last = method().last_solution();
    if (local_ && std::abs(away_) < 0.5 * reach() && same_choice()) return;
    choice_ = {last.lost_above, last.prior_mean};
    const double exponent = local_ ? sums_.exponent() + away_ : last.n;
    sums_ = LocalSums(solver().chosen(last), exponent);
    away_ = last.n - exponent;
    unit_ = units().force * bounded_exp(-exponent * units().log_penetration);
    local_ = true;
  }

  bool same_choice() const noexcept {
    const ProjectionSolution& last = method().last_solution();
    return last.lost_above == choice_.lost_above && last.prior_mean == choice_.prior_mean;
  }

  double weight_of_choice() const noexcept {
    return solver().totals(method().last_solution()).weight;
  }

  // A lane for the sample that was just given to the estimator.
  void add(std::size_t k, std::uint32_t revisions, double weight) noexcept {
    const std::size_t lane = count_++;
    const ProjectionSolution& last = method().last_solution();
    const Sample s = scaled(sample(k), units());
    const bool deep = s.penetration > 0.0;
    const double depth = deep ? std::log(s.penetration) : 0.0;
    const double power = deep ? std::exp(sums_.exponent() * depth) : 0.0;
    depth_[lane] = depth;
    deepest_ = std::max(deepest_, depth);
    power_[lane] = power;
    velocity_[lane] = s.velocity;
    last_velocity_[lane] = estimator_.last_velocity();
    const ContactSolver::Totals totals = solver().totals(last);
    if (solver().revisions() != revisions) {
      sums_ = LocalSums(solver().chosen(last), sums_.exponent());
    } else if (totals.weight > weight + 0.5 && deep) {
      sums_.add({s.penetration, s.velocity, s.force - choice_.prior_mean}, depth, power);
    }
    for (std::size_t d = 0; d < local_terms; ++d) {
      for (std::size_t p = 0; p < power_count; ++p) block_.terms[d][p][lane] = sums_.term(d, p);
    }
    block_.weight[lane] = totals.weight;
    block_.force[lane] = totals.force;
    block_.square[lane] = totals.square;
    block_.variance[lane] = last.prior_variance;
    const ProjectionSettings& settings = solver().settings();
    const double spread = settings.prior_dissipation_deviation * last.k;
    block_.damping_weight[lane] =
        std::min(last.prior_variance / (spread * spread), largest_parameter);
    const double deviation = last.prior_deviation;
    block_.offset_precision[lane] = deviation > 0.0 ? 1.0 / (deviation * deviation) : 0.0;
    block_.away[lane] = away_;
    block_.sound[lane] = 1.0;
    const Matrix<5>& w = method().widening();
    std::size_t entry = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j <= i; ++j) block_.widening[entry++][lane] = w[i][j];
    }
    searched_[lane] = method().due();
    if (!searched_[lane]) return;
    known_ = method().solution();
    found_[lane] = known_;
    found_in_si_[lane] = method().snapshot(known_, units());
  }

  // Works out the block that ends before or with a sample, up to that sample.
  void finish(std::size_t k) noexcept {
    const std::size_t filled = count_;
    count_ = 0;
    if (solved(filled)) {
      write(filled);
      if (first_ + filled <= k) plainly(k, static_cast<Status>(out_.status[k]));
      return;
    }
    local_ = false;
    estimator_ = before_;
    known_ = known_before_;
    now_ = now_before_;
    for (std::size_t j = saved_; j <= k; ++j) plainly(j, update(j));
  }

  bool solved(std::size_t filled) noexcept {
    for (std::size_t lane = filled; lane < abreast; ++lane) repeat(lane, filled - 1);
    const ProjectionSettings& given = solver().settings();
    const double s = given.prior_exponent_deviation, b = given.prior_dissipation_deviation;
    const AbreastSettings settings{.exponent = sums_.exponent(),
                                   .lowest = given.lowest_exponent,
                                   .highest = given.highest_exponent,
                                   .most_step = 2.0 * reach(),
                                   .prior_exponent = given.prior_exponent,
                                   .exponent_precision = 1.0 / (s * s),
                                   .prior_dissipation = given.prior_dissipation,
                                   .dissipation_precision = 1.0 / (b * b),
                                   .offset = given.offset ? 1.0 : 0.0,
                                   .noise_variance = given.noise * given.noise,
                                   .log_penetration = units().log_penetration};
    newton_abreast(block_, settings);
    if (!near(filled)) newton_abreast(block_, settings);
    finish_abreast(block_, settings);
    bool sound = true;
    for (std::size_t lane = 0; lane < filled; ++lane) {
      if (searched_[lane]) continue;
      sound &= block_.sound[lane] > 0.0 && std::abs(block_.away[lane]) < reach() &&
               block_.moved[lane] < largest_step * largest_step;
    }
    return sound;
  }

  // Whether the first of Newton's steps leaves a thousandth of a standard error, or less.
  bool near(std::size_t filled) const noexcept {
    double most = 0.0, in_variances = 0.0;
    for (std::size_t lane = 0; lane < filled; ++lane) {
      most = std::max(most, std::abs(block_.step[lane]));
      in_variances = std::max(in_variances, block_.moved[lane]);
    }
    return most < largest_first_step && in_variances < largest_step * largest_step;
  }

  // Lanes that no sample fills do as another does.
  void repeat(std::size_t lane, std::size_t other) noexcept {
    for (auto& degree : block_.terms) {
      for (Lane& term : degree) term[lane] = term[other];
    }
    for (Lane* each : {&block_.weight, &block_.force, &block_.square, &block_.variance,
                       &block_.damping_weight, &block_.offset_precision, &block_.away}) {
      (*each)[lane] = (*each)[other];
    }
    for (Lane& entry : block_.widening) entry[lane] = entry[other];
    block_.sound[lane] = 1.0;
  }

  void write(std::size_t filled) noexcept {
    const double log_penetration = units().log_penetration;
    // Prediction is by the answer before; of the sample before the block that is in SI.
    double k = now_.law.stiffness, c = now_.law.damping, offset = now_.offset;
    double away = now_.law.exponent - sums_.exponent();
    {
      const double unit = unit_ * bounded_exp(-away * log_penetration);
      k /= unit;
      c *= units().velocity / unit;
      offset *= units().per_force;
    }
    for (std::size_t lane = 0; lane < filled; ++lane) {
      const std::size_t row = first_ + lane;
      const double power = power_[lane] * grown(away * depth_[lane]);
      out_.predicted_force[row] = units().force * (power * (k + c * velocity_[lane]) + offset);
      if (searched_[lane]) {
        const ScaledLaw& found = found_[lane];
        now_ = found_in_si_[lane];
        k = found.k, c = found.c, offset = found.offset;
        away = found.n - sums_.exponent();
      } else {
        k = block_.k[lane], c = block_.c[lane], away = block_.away[lane];
        offset = block_.offset[lane] + choice_.prior_mean;
        now_ = in_si(lane, offset);
      }
      out_.validity_margin[row] = write_estimate(now_, last_velocity_[lane], out_, row);
    }
    away_ = std::abs(away) < reach() ? away : 0.0;
  }

  static double grown(double z) noexcept {
    return std::abs(z) < eight_lanes::largest_small ? eight_lanes::small_exp(z) : bounded_exp(z);
  }

  Snapshot<HuntCrossley> in_si(std::size_t lane, double offset) const noexcept {
    const double unit = unit_ * block_.unit[lane];
    const double damping_unit = unit * units().per_velocity;
    return {{saturate(block_.k[lane] * unit), saturate(block_.c[lane] * damping_unit),
             sums_.exponent() + block_.away[lane]},
            {bounded_variance(block_.variances[0][lane] * (unit * unit)),
             bounded_variance(block_.variances[1][lane] * (damping_unit * damping_unit)),
             bounded_variance(block_.variances[2][lane])},
            offset * units().force};
  }

  // The row of a sample that was just given to the estimator, by the plain way.
  void plainly(std::size_t k, Status status) noexcept {
    out_.predicted_force[k] = predicted_by(estimator_, now_, sample(k), status);
    known_ = method().solution();
    now_ = method().snapshot(known_, units());
    out_.validity_margin[k] = write_estimate(now_, estimator_.last_velocity(), out_, k);
  }

  struct Choice {
    bool lost_above;
    double prior_mean;
  };

  Estimator& estimator_;
  const Signals& in_;
  const TraceColumns& out_;
  double sample_time_;
  bool settled_;
  Estimator before_;  // as it was when the block began
  ProjectionSolution known_, known_before_;
  Snapshot<HuntCrossley> now_, now_before_{};
  LocalSums sums_{};
  Choice choice_{};
  bool local_ = false;     // whether the sums are those of all samples so far
  double away_ = 0.0;      // of the last answer
  double deepest_ = 0.0;   // ln ξ so far, of depths beyond the unit
  double unit_ = 1.0;      // N at the unit of penetration, by n₀
  std::size_t saved_ = 0;  // the sample before which the copy was made
  std::size_t first_ = 0, count_ = 0;
  Abreast block_{};
  std::array<double, abreast> depth_{}, power_{}, velocity_{}, last_velocity_{};
  std::array<bool, abreast> searched_{};
  std::array<ScaledLaw, abreast> found_{};
  std::array<Snapshot<HuntCrossley>, abreast> found_in_si_{};
};

}  // namespace palpate::detail
