// The double-stage method (Diolaiti, Melchiorri & Stramigioli 2005; the paper's eqs. 3–6).
//
//   stage 1:  y = F,                φ = [x^n̂, x^n̂ v]  → K̂, B̂   (n̂ of the previous sample)
//   stage 2:  y = ln(F / (K̂ + B̂ v)), φ = ln x          → n̂       (skipped while K̂ + B̂ v ≤ 0)
//
// Each stage takes the other's estimate for the truth, so from most starts it freezes on a ridge
// between K and n. That is the method's nature, shown here as it is.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "palpate/estimate.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/least_squares.hpp"
#include "palpate/matrix.hpp"
#include "palpate/method.hpp"
#include "palpate/methods/regression.hpp"
#include "palpate/sample.hpp"

namespace palpate {

class DoubleStageMethod {
 public:
  using Law = HuntCrossley;

  struct Settings {
    Law initial{0.1, 0.0, 1.0};
    // Of [K, B], in scaled units, and of n, with none between the stages. In SI φ² is near 1e-4: a
    // smaller one of K would hold it at the start.
    Matrix<3> initial_covariance = diagonal<3>({1e8, 1e8, 1e3});
    // The start's is the truth, such as of a tip whose shape is known: no stage 2.
    bool exponent_known = false;

    bool operator==(const Settings&) const = default;
  };

  // What both stages take from a sample, n̂ being that of the sample before.
  struct Row {
    Vector<2> regressor;  // of stage 1
    double depth;         // ln ξ, the regressor of stage 2
    double velocity;
    double force;
  };

  static constexpr Forgetting::Settings default_forgetting = fading_forgetting;
  static constexpr Scale default_scale{};
  static constexpr bool forgets = true;
  static constexpr bool perturbs = true;
  static constexpr double largest_input = 1e100;  // as RegressionMethod's

  DoubleStageMethod(const Settings& settings, const Units& units) noexcept
      : settings_(settings),
        stage_one_({in_scaled_units(settings.initial, units), of_stage_one(settings)}),
        stage_two_({{detail::saturate(settings.initial.exponent)}, of_stage_two(settings)}) {}

  bool in_range(const Sample& s) const noexcept {
    return detail::touching(s) && detail::within(s, largest_input);
  }

  Row prepare(const Sample& sample, double) const noexcept {
    const double depth = std::log(sample.penetration);
    // xⁿ stays within e^±100, so that its square is finite and far from the subnormal.
    const double power = std::exp(std::clamp(stage_two_.parameters()[0] * depth, -100.0, 100.0));
    return {{power, power * sample.velocity}, depth, sample.velocity, sample.force};
  }

  double predict(const Row& row) const noexcept { return stage_one_.predict(row.regressor); }

  Status learn(const Row& row, double, double forgetting_factor, double perturbation) noexcept {
    const LeastSquares<2>::State before = stage_one_.state();
    const Status status =
        stage_one_.update(row.regressor, row.force, forgetting_factor, perturbation);
    if (!taken(status)) return status;

    if (settings_.exponent_known) return status;
    const Vector<2>& stiffness = stage_one_.parameters();
    const double rate = stiffness[0] + stiffness[1] * row.velocity;
    if (!(rate > 0.0)) return status;
    const double output = std::log(row.force / rate);
    if (!std::isfinite(output)) return status;
    const Status second = stage_two_.update({row.depth}, output, forgetting_factor, perturbation);
    if (!taken(second)) stage_one_.restore(before);  // a sample is taken whole or not at all
    return second == Status::updated ? status : second;
  }

  // From the old answer, as uncertain as at the start.
  void reinitialise() noexcept {
    stage_one_ = LeastSquares<2>({stage_one_.parameters(), of_stage_one(settings_)});
    stage_two_ = LeastSquares<1>({stage_two_.parameters(), of_stage_two(settings_)});
  }
  void reinitialise_after_transient() noexcept { reinitialise(); }

  const LeastSquares<2>& stage_one() const noexcept { return stage_one_; }
  const LeastSquares<1>& stage_two() const noexcept { return stage_two_; }

  Law law(const Units& u) const noexcept {
    const double exponent = detail::saturate(stage_two_.parameters()[0]);
    const double unit = u.force * detail::bounded_exp(-exponent * u.log_penetration);
    return {detail::saturate(stage_one_.parameters()[0] * unit),
            detail::saturate(stage_one_.parameters()[1] * unit / u.velocity), exponent};
  }

  double force(const Units& u, double x, double v) const noexcept { return law(u).force(x, v); }

  // The covariance is the stages' own; neither knows of the other, so K and n appear independent
  // but for the unit of K, which depends on n.
  Fit<Law> fit(const Units& u) const noexcept {
    const Law now = law(u);
    return {now,
            detail::congruence(jacobian(now, u), of_stages(stage_one_.scaled_root(),
                                                           of_exponent(stage_two_.scaled_root())))};
  }

  Snapshot<Law> snapshot(const Units& u) const noexcept {
    const Law now = law(u);
    return {now, detail::congruent_diagonal(
                     jacobian(now, u), of_stages(stage_one_.scaled_covariance(),
                                                 of_exponent(stage_two_.scaled_covariance())))};
  }

 private:
  static Matrix<2> of_stage_one(const Settings& settings) noexcept {
    const auto& p = settings.initial_covariance;
    return {{{p[0][0], p[0][1]}, {p[1][0], p[1][1]}}};
  }
  static Matrix<1> of_stage_two(const Settings& settings) noexcept {
    return {{{settings.initial_covariance[2][2]}}};
  }

  static Vector<2> in_scaled_units(const Law& law, const Units& u) noexcept {
    const double unit = detail::bounded_exp(law.exponent * u.log_penetration) / u.force;
    return {detail::saturate(law.stiffness * unit),
            detail::saturate(law.damping * unit * u.velocity)};
  }

  // Of (K, B, n) in SI by [K, B] in scaled units and n.
  static Matrix<3> jacobian(const Law& law, const Units& u) noexcept {
    const double unit =
        detail::saturate(u.force * detail::bounded_exp(-law.exponent * u.log_penetration));
    return {{{unit, 0.0, detail::saturate(-law.stiffness * u.log_penetration)},
             {0.0, detail::saturate(unit / u.velocity),
              detail::saturate(-law.damping * u.log_penetration)},
             {0.0, 0.0, 1.0}}};
  }

  Matrix<1> of_exponent(const Matrix<1>& two) const noexcept {
    return settings_.exponent_known ? Matrix<1>{} : two;
  }

  static Matrix<3> of_stages(const Matrix<2>& one, const Matrix<1>& two) noexcept {
    return {{{one[0][0], one[0][1], 0.0}, {one[1][0], one[1][1], 0.0}, {0.0, 0.0, two[0][0]}}};
  }

  Settings settings_;
  LeastSquares<2> stage_one_;
  LeastSquares<1> stage_two_;
};

constexpr const char* validate(const DoubleStageMethod::Settings& settings) noexcept {
  if (const char* fault = detail::validate_initial(settings.initial)) return fault;
  if (settings.exponent_known) {
    if (const char* fault = detail::validate_known_exponent(settings.initial.exponent)) {
      return fault;
    }
  }
  const auto& p = settings.initial_covariance;
  if (p[0][2] != 0.0 || p[1][2] != 0.0) {
    return "method.initial_covariance must be zero between [K, B] and n";
  }
  return detail::validate_covariance(p);
}

}  // namespace palpate
