// Variable projection as a method of the recursive estimator: samples in, the law in SI out.
#pragma once

#include <cmath>

#include "palpate/estimate.hpp"
#include "palpate/scale.hpp"
#include "palpate/status.hpp"
#include "palpate/variable_projection.hpp"

namespace palpate {

class ProjectionMethod {
 public:
  using Law = HuntCrossley;
  static constexpr std::size_t order = 3;
  // ξ^3.6 squared, times w², summed and multiplied by its like three times, stays finite below it.
  static constexpr double largest_input = 1e8;

  struct Settings {
    double noise;  // N; 0: from the residual
    double lowest_exponent;
    double highest_exponent;
    bool offset;
    double offset_deviation;  // N; 0: twenty times the noise
  };

  ProjectionMethod(const Settings& settings, const Units& units) noexcept
      : projection_({.noise = settings.noise / units.force,
                     .lowest_exponent = settings.lowest_exponent,
                     .highest_exponent = settings.highest_exponent,
                     .offset = settings.offset,
                     .offset_deviation = settings.offset_deviation / units.force}) {}

  template <class Adapt>
  Status learn(const Sample& sample, Adapt&& adapt) noexcept {
    const double forgetting_factor =
        adapt([&]() noexcept { return projection_.solve().force(sample); }).first;
    projection_.add(sample, forgetting_factor);
    return Status::updated;
  }

  Law law(const Units& units) const noexcept { return law(projection_.solve(), units); }

  double force(const Units& units, double x, double v) const noexcept {
    const Projection now = projection_.solve();
    return law(now, units).force(x, v) + now.offset * units.force;
  }

  Fit<Law> fit(const Units& units) const noexcept {
    const Projection now = projection_.solve();
    const Law law = this->law(now, units);
    const Matrix<4> joint = congruence(jacobian(law, units), now.covariance);
    Fit<Law> fit{law, {}, {now.offset * units.force, joint[3][3], {}}, now.doubts};
    for (std::size_t i = 0; i < order; ++i) {
      for (std::size_t j = 0; j < order; ++j) fit.covariance[i][j] = joint[i][j];
      fit.offset.covariance[i] = joint[3][i];
    }
    return fit;
  }

  Moment<Law> moment(const Units& units) const noexcept {
    const Projection now = projection_.solve();
    const Law law = this->law(now, units);
    const Vector<4> joint = congruent_diagonal(jacobian(law, units), now.covariance);
    return {law, {joint[0], joint[1], joint[2]}};
  }

 private:
  // K = k F₀ x_r⁻ⁿ, B = (c/V) F₀ x_r⁻ⁿ.
  static Law law(const Projection& p, const Units& u) noexcept {
    const double unit = u.force * bounded_exp(-p.n * u.log_penetration);
    return {saturate(p.k * unit), saturate(p.c * unit / u.velocity), p.n};
  }

  // Of (K, B, n, F₀) in SI by (k, c, n, F₀) in scaled units.
  static Matrix<4> jacobian(const Law& law, const Units& u) noexcept {
    const double unit = u.force * bounded_exp(-law.exponent * u.log_penetration);
    const double depth = -u.log_penetration;
    return {{{saturate(unit), 0.0, saturate(law.stiffness * depth), 0.0},
             {0.0, saturate(unit / u.velocity), saturate(law.damping * depth), 0.0},
             {0.0, 0.0, 1.0, 0.0},
             {0.0, 0.0, 0.0, u.force}}};
  }

  VariableProjection projection_;
};

}  // namespace palpate
