// Variable projection as a method of the recursive estimator: samples in, the law in SI out.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "palpate/estimate.hpp"
#include "palpate/residual_blocks.hpp"
#include "palpate/scale.hpp"
#include "palpate/status.hpp"
#include "palpate/variable_projection.hpp"

namespace palpate {

// `Projector` is VariableProjection, or SurfaceSearch where the surface is unknown.
template <class Projector>
class ProjectionMethod {
 public:
  static constexpr bool takes_approach = Projector::takes_approach;
  using Law = HuntCrossley;
  static constexpr std::size_t order = 3;
  // Errors are measured against an answer that is up to a 64th of the samples old.
  static constexpr bool prediction_lags = true;
  static constexpr double largest_input = 1e8;
  // ξⁿ squared, times w², summed and multiplied by its like three times, stays finite below it.
  static constexpr double largest_power = 1e29;

  using Settings = typename Projector::Settings;  // in scaled units

  ProjectionMethod(const Settings& settings, const Units&) noexcept
      : projection_(settings),
        largest_penetration_(std::pow(largest_power, 1.0 / projection_.highest_exponent())) {}

  // In scaled units; samples beyond it are out of range.
  double largest_penetration() const noexcept { return largest_penetration_; }

  // Deeper than this a sample says something, in scaled units; only asked where the approach
  // counts.
  double lowest_surface() const noexcept { return projection_.lowest_surface(); }

  // `adapt` is called with a function that gives the a-priori force, which only some need.
  template <class Adapt>
  Status learn(const Sample& sample, double, Adapt&& adapt) noexcept {
    follow();
    const double predicted = present_.force(sample);
    const double forgetting_factor = adapt([&]() noexcept { return predicted; }).first;
    if (projection_.weight() >= 20.0) residuals_.add(saturate(sample.force - predicted));
    projection_.add(sample, forgetting_factor);
    ++unsolved_;
    return Status::updated;
  }

  // Begins anew, with the old answer as a weak prior.
  void restart() noexcept {
    projection_.restart(projection_.solve(), 0.3, 0.1);
    forget_residuals();
  }

  // The same once more: the weak prior is still that of before the change.
  void restart_again() noexcept {
    projection_.clear();
    forget_residuals();
  }

  Law law(const Units& units) const noexcept { return law(solve(), units); }

  double force(const Units& units, double x, double v) const noexcept {
    const Projection now = solve();
    return law(now, units).force(x - now.surface * units.penetration, v) + now.offset * units.force;
  }

  Fit<Law> fit(const Units& units) const noexcept {
    const Projection now = solve();
    const Law law = this->law(now, units);
    const double inflation = inflation_;
    Matrix<5> joint = squared(in_si(now.root, law, units));
    for (auto& row : joint) {
      for (double& entry : row) entry *= inflation;
    }
    bound_variances(joint, largest_variance);
    Fit<Law> fit{.law = law,
                 .covariance = {},
                 .offset = {now.offset * units.force, joint[3][3], {}},
                 .surface = {now.surface * units.penetration, joint[4][4]},
                 .doubts = doubts(now, inflation)};
    for (std::size_t i = 0; i < order; ++i) {
      for (std::size_t j = 0; j < order; ++j) fit.covariance[i][j] = joint[i][j];
      fit.offset.covariance[i] = joint[3][i];
    }
    return fit;
  }

  Moment<Law> moment(const Units& units) const noexcept {
    const Projection now = solve();
    const Law law = this->law(now, units);
    const double inflation = inflation_;
    const Matrix<5> root = in_si(now.root, law, units);
    Moment<Law> moment{law, {}};
    for (std::size_t i = 0; i < order; ++i) {
      moment.variances[i] = bounded_variance(inflation * dot(root[i], root[i]));
    }
    return moment;
  }

  // Of the force, in scaled units.
  double noise_variance() const noexcept { return solve().noise_variance; }

 private:
  void forget_residuals() noexcept {
    residuals_.clear();
    inflation_ = 1.0;
    unsolved_ = 1;
  }

  // The global search is due again after every 64th part of the samples, but at least every 64.
  bool due() const noexcept {
    return static_cast<double>(unsolved_) >= std::min(1.0 + projection_.weight() / 64.0, 64.0);
  }

  Projection solve() const noexcept {
    return due() ? projection_.solve() : projection_.solve_near(present_);
  }

  // Keeps the answer fresh that errors are measured against, and solving starts from.
  void follow() noexcept {
    if (!due()) return;
    present_ = projection_.solve();
    inflation_ = residuals_.inflation();
    unsolved_ = 0;
  }

  std::uint8_t doubts(const Projection& p, double inflation) const noexcept {
    const double exponent = std::sqrt(inflation * dot(p.root[2], p.root[2]));
    const double damping = std::sqrt(inflation * dot(p.root[1], p.root[1]));
    std::uint8_t found = p.at_edge ? exponent_at_edge : 0;
    // Twice this and a sphere (1.5) is not told from a cone (2) or a spring (1).
    if (!(exponent < 0.2) || !p.exponent_told) found |= exponent_not_identifiable;
    // Against the elastic force: B v is unknown to a quarter of K at the speed of the scale.
    if (!(damping < 0.25 * std::abs(p.k)) || !p.damping_told) found |= damping_not_identifiable;
    if (!p.surface_found) found |= surface_at_edge;
    return found;
  }

  // K = k F₀ x_r⁻ⁿ, B = (c/V) F₀ x_r⁻ⁿ.
  static Law law(const Projection& p, const Units& u) noexcept {
    const double unit = u.force * bounded_exp(-p.n * u.log_penetration);
    return {saturate(p.k * unit), saturate(p.c * unit / u.velocity), p.n};
  }

  // The root of the covariance of (K, B, n, F₀, d) in SI, from that of (k, c, n, F₀, d) in scaled
  // units: dK = U (dk − k ln x_r dn), dB = (U/V) (dc − c ln x_r dn), at U = F_s x_r⁻ⁿ.
  static Matrix<5> in_si(const Matrix<5>& root, const Law& law, const Units& u) noexcept {
    const double unit = saturate(u.force * bounded_exp(-law.exponent * u.log_penetration));
    const double damping_unit = saturate(unit / u.velocity);
    const double by_stiffness = saturate(-law.stiffness * u.log_penetration);
    const double by_damping = saturate(-law.damping * u.log_penetration);
    Matrix<5> result{};
    for (std::size_t j = 0; j < 5; ++j) {
      result[0][j] = unit * root[0][j] + by_stiffness * root[2][j];
      result[1][j] = damping_unit * root[1][j] + by_damping * root[2][j];
      result[2][j] = root[2][j];
      result[3][j] = u.force * root[3][j];
      result[4][j] = u.penetration * root[4][j];
    }
    return result;
  }

  Projector projection_;
  double largest_penetration_;
  Projection present_{};
  std::uint64_t unsolved_ = 1;  // samples since it was solved for
  LatterResiduals residuals_;
  double inflation_ = 1.0;  // theirs, when it was last solved for
};

}  // namespace palpate
