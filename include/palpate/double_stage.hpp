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
#include "palpate/scale.hpp"
#include "palpate/status.hpp"

namespace palpate {

class DoubleStageMethod {
 public:
  static constexpr bool prediction_lags = false;
  static constexpr bool takes_approach = false;
  static constexpr double largest_input = 1e100;
  using Law = HuntCrossley;
  static constexpr std::size_t order = 3;

  struct Settings {
    Law initial;
    Matrix<2> stage_one_covariance;  // of [K, B], in scaled units
    double stage_two_covariance;     // of n
  };

  DoubleStageMethod(const Settings& settings, const Units& units) noexcept
      : settings_(settings),
        stage_one_({in_scaled_units(settings.initial, units), settings.stage_one_covariance}),
        stage_two_({{saturate(settings.initial.exponent)}, {{{settings.stage_two_covariance}}}}) {}

  template <class Adapt>
  Status learn(const Sample& sample, double, Adapt&& adapt) noexcept {
    const double depth = std::log(sample.penetration);
    // xⁿ stays within e^±100, so that its square is finite and far from the subnormal.
    const double power = std::exp(std::clamp(stage_two_.parameters()[0] * depth, -100.0, 100.0));
    const Vector<2> regressor{power, power * sample.velocity};
    const auto [forgetting_factor, perturbation] =
        adapt([&]() noexcept { return stage_one_.predict(regressor); });

    const LeastSquares<2>::State before = stage_one_.state();
    const Status status =
        stage_one_.update(regressor, sample.force, forgetting_factor, perturbation);
    if (!taken(status)) return status;

    const Vector<2>& stiffness = stage_one_.parameters();
    const double rate = stiffness[0] + stiffness[1] * sample.velocity;
    if (!(rate > 0.0)) return status;
    const double output = std::log(sample.force / rate);
    if (!std::isfinite(output)) return status;
    const Status second = stage_two_.update({depth}, output, forgetting_factor, perturbation);
    if (!taken(second)) stage_one_.restore(before);  // a sample is taken whole or not at all
    return second == Status::updated ? status : second;
  }

  // Begins anew from the old answer, as uncertain as at the start.
  void restart() noexcept {
    stage_one_ = LeastSquares<2>({stage_one_.parameters(), settings_.stage_one_covariance});
    stage_two_ = LeastSquares<1>({stage_two_.parameters(), {{{settings_.stage_two_covariance}}}});
  }

  void restart_again() noexcept { restart(); }

  const LeastSquares<2>& stage_one() const noexcept { return stage_one_; }
  const LeastSquares<1>& stage_two() const noexcept { return stage_two_; }

  Law law(const Units& u) const noexcept {
    const double exponent = saturate(stage_two_.parameters()[0]);
    const double unit = u.force * bounded_exp(-exponent * u.log_penetration);
    return {saturate(stage_one_.parameters()[0] * unit),
            saturate(stage_one_.parameters()[1] * unit / u.velocity), exponent};
  }

  double force(const Units& u, double x, double v) const noexcept { return law(u).force(x, v); }

  // The covariance is the stages' own; neither knows of the other, so K and n appear independent
  // but for the unit of K, which depends on n.
  Fit<Law> fit(const Units& u) const noexcept {
    const Law now = law(u);
    return {now, congruence(jacobian(now, u),
                            of_stages(stage_one_.scaled_root(), stage_two_.scaled_root()))};
  }

  Moment<Law> moment(const Units& u) const noexcept {
    const Law now = law(u);
    return {now, congruent_diagonal(jacobian(now, u), of_stages(stage_one_.scaled_covariance(),
                                                                stage_two_.scaled_covariance()))};
  }

 private:
  static Vector<2> in_scaled_units(const Law& law, const Units& u) noexcept {
    const double unit = bounded_exp(law.exponent * u.log_penetration) / u.force;
    return {saturate(law.stiffness * unit), saturate(law.damping * unit * u.velocity)};
  }

  // Of (K, B, n) in SI by [K, B] in scaled units and n.
  static Matrix<order> jacobian(const Law& law, const Units& u) noexcept {
    const double unit = saturate(u.force * bounded_exp(-law.exponent * u.log_penetration));
    return {{{unit, 0.0, saturate(-law.stiffness * u.log_penetration)},
             {0.0, saturate(unit / u.velocity), saturate(-law.damping * u.log_penetration)},
             {0.0, 0.0, 1.0}}};
  }

  static Matrix<order> of_stages(const Matrix<2>& one, const Matrix<1>& two) noexcept {
    return {{{one[0][0], one[0][1], 0.0}, {one[1][0], one[1][1], 0.0}, {0.0, 0.0, two[0][0]}}};
  }

  Settings settings_;
  LeastSquares<2> stage_one_;
  LeastSquares<1> stage_two_;
};

}  // namespace palpate
