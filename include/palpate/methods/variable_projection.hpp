// Variable projection as a method of the recursive estimator: samples in, the law in SI out.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "palpate/contact_gate.hpp"
#include "palpate/estimate.hpp"
#include "palpate/forgetting.hpp"
#include "palpate/projection/contact_solver.hpp"
#include "palpate/projection/projection_solver.hpp"
#include "palpate/projection/residual_blocks.hpp"
#include "palpate/projection/solution.hpp"
#include "palpate/projection/surface_solver.hpp"
#include "palpate/sample.hpp"
#include "palpate/status.hpp"

namespace palpate {

// `Solver` is ContactSolver, which chooses the samples; ProjectionSolver, which takes what it is
// given; or SurfaceSolver where the surface is unknown.
template <class Solver>
class VariableProjectionMethod {
 public:
  using Law = HuntCrossley;
  static constexpr std::size_t order = 3;
  using Settings = typename Solver::Settings;  // in scaled units

  struct Row {
    Sample sample;
    double predicted;  // by the last solution
  };

  static constexpr Forgetting::Settings default_forgetting = no_forgetting;
  // The probing of a hand-sized robot.
  static constexpr Scale default_scale{.penetration = 10e-3, .velocity = 20e-3, .force = 1.0};
  static constexpr bool forgets = true;
  static constexpr bool perturbs = false;
  // Errors are measured against a solution that is up to a 64th of the samples old.
  static constexpr bool predicts_exactly = false;
  // With the limit on ξⁿ below, sums of what is squared here stay finite.
  static constexpr double largest_input = 1e8;
  // ξⁿ squared, times w², summed and multiplied by its like three times, stays finite below it.
  static constexpr double largest_power = 1e29;

  VariableProjectionMethod(const Settings& settings, const Units&) noexcept
      : solver_(settings),
        largest_penetration_(std::pow(largest_power, 1.0 / solver_.highest_exponent())) {}

  ContactGate::Settings gate(const ContactGate::Settings& given, const Units& units) noexcept {
    return solver_.gate(given, units);
  }
  bool in_range(const Sample& s) const noexcept {
    return s.penetration < largest_penetration_ && solver_.in_range(s) &&
           detail::within(s, largest_input);
  }

  Row prepare(const Sample& sample) noexcept {
    refresh();
    return {sample, last_solution_.force(sample)};
  }

  double predict(const Row& row) const noexcept { return row.predicted; }

  Status learn(const Row& row, double, double forgetting_factor, double) noexcept {
    // Before that the answer is mostly the priors', and its errors say nothing of the noise.
    constexpr double fewest_samples = 20.0;
    const bool told = solver_.weight() >= fewest_samples;
    const bool firm = add(row.sample, forgetting_factor);
    ++samples_since_solve_;
    if (!firm) return Status::held;
    if (told) residuals_.add(detail::saturate(row.sample.force - row.predicted));
    return Status::updated;
  }

  // A sample out of contact tells of the force's offset.
  void free(const Sample& sample, double forgetting_factor) noexcept {
    if constexpr (requires { solver_.free(sample, forgetting_factor); }) {
      if (detail::within(sample, largest_input)) solver_.free(sample, forgetting_factor);
    }
  }

  // The latest samples, at most eight, were bad after all.
  void withdraw(std::size_t count) noexcept {
    if constexpr (requires { solver_.withdraw(count); }) solver_.withdraw(count);
  }

  // The next sample does not follow upon the latest.
  void interrupt() noexcept {
    if constexpr (requires { solver_.interrupt(); }) solver_.interrupt();
  }

  // With the old answer as a weak prior: another material of the same kind has an exponent within
  // 0.3 or so, and at the speed of the scale a damping force within a tenth of the elastic one.
  void reinitialise() noexcept {
    const Solution now = solver_.solve();
    open_flags_ = flags(now, inflation_);
    open_until_ = std::max(open_until_, solver_.weight());
    solver_.restart(now, 0.3, 0.1);
    forget_residuals();
  }

  // The same once more: the weak prior is still that of before the change.
  void reinitialise_after_transient() noexcept {
    solver_.clear();
    forget_residuals();
  }

  Law law(const Units& units) const noexcept { return law(solve(), units); }

  double force(const Units& units, double x, double v) const noexcept {
    const Solution now = solve();
    return law(now, units).force(x - now.surface * units.penetration, v) + now.offset * units.force;
  }

  Fit<Law> fit(const Units& units) const noexcept {
    const Solution now = solve();
    const Law law = this->law(now, units);
    const double inflation = inflation_;
    Matrix<5> joint = detail::squared(in_si(now.root, law, units));
    for (auto& row : joint) {
      for (double& entry : row) entry *= inflation;
    }
    detail::bound_variances(joint, detail::largest_variance);
    Fit<Law> fit{.law = law,
                 .covariance = {},
                 .offset = {now.offset * units.force, joint[3][3], {}},
                 .surface = {now.surface * units.penetration, joint[4][4]},
                 .flags = flags(now, inflation)};
    for (std::size_t i = 0; i < order; ++i) {
      for (std::size_t j = 0; j < order; ++j) fit.covariance[i][j] = joint[i][j];
      fit.offset.covariance[i] = joint[3][i];
    }
    return fit;
  }

  Snapshot<Law> snapshot(const Units& units) const noexcept {
    const Solution now = solve();
    const Law law = this->law(now, units);
    const double inflation = inflation_;
    const Matrix<5> root = in_si(now.root, law, units);
    Snapshot<Law> snapshot{law, {}};
    for (std::size_t i = 0; i < order; ++i) {
      snapshot.variances[i] = detail::bounded_variance(inflation * detail::dot(root[i], root[i]));
    }
    return snapshot;
  }

  // Of the force, in scaled units.
  double noise_variance() const noexcept { return solve().noise_variance; }

 private:
  using Solution = detail::ProjectionSolution;

  // Whether the sample is taken as contact: a solver may keep one that is in doubt beside.
  bool add(const Sample& sample, double forgetting_factor) noexcept {
    if constexpr (requires { solver_.add(sample, forgetting_factor, last_solution_); }) {
      return solver_.add(sample, forgetting_factor, last_solution_);
    } else {
      solver_.add(sample, forgetting_factor);
      return true;
    }
  }

  void forget_residuals() noexcept {
    residuals_.clear();
    inflation_ = 1.0;
    samples_since_solve_ = 1;
  }

  // The global search is due again after every 64th part of the samples, which moves an answer by
  // an eighth of its standard error at most (1/√64), but at least every 64 samples, as its cost of
  // ten updates is a sixth of theirs then.
  bool due() const noexcept {
    return static_cast<double>(samples_since_solve_) >=
           std::min(1.0 + solver_.weight() / 64.0, 64.0);
  }

  Solution solve() const noexcept {
    return due() ? solver_.solve() : solver_.solve_near(last_solution_);
  }

  // Renews the solution that errors are measured against, and solving starts from, where it is due.
  void refresh() noexcept {
    if (!due()) return;
    last_solution_ = solver_.solve();
    inflation_ = residuals_.inflation();
    samples_since_solve_ = 0;
  }

  std::uint8_t flags(const Solution& p, double inflation) const noexcept {
    // Twice this and a sphere (1.5) is not distinct from a cone (2) or a spring (1).
    constexpr double largest_exponent_error = 0.2;
    // Of the elastic force: B v is unknown to a quarter of K at the speed of the scale.
    constexpr double largest_damping_error = 0.25;
    const double exponent = std::sqrt(inflation * detail::dot(p.root[2], p.root[2]));
    const double damping = std::sqrt(inflation * detail::dot(p.root[1], p.root[1]));
    std::uint8_t found = p.at_edge ? exponent_at_edge : 0;
    if (!(exponent < largest_exponent_error) || !p.exponent_identifiable) {
      found |= exponent_not_identifiable;
    }
    if (!(damping < largest_damping_error * std::abs(p.k)) || !p.damping_identifiable) {
      found |= damping_not_identifiable;
    }
    if (!p.surface_found) found |= surface_at_edge;
    if (p.tare_refuted) found |= tare_refuted;
    // What the samples before a restart left open, few after it do not settle: the prior that is
    // made of the old answer would hide it. Nine tenths, as with forgetting a weight only nears its
    // limit.
    if (solver_.weight() < 0.9 * open_until_) found |= open_flags_;
    return found;
  }

  // K = k F₀ x_r⁻ⁿ, B = (c/V) F₀ x_r⁻ⁿ.
  static Law law(const Solution& p, const Units& u) noexcept {
    const double unit = u.force * detail::bounded_exp(-p.n * u.log_penetration);
    return {detail::saturate(p.k * unit), detail::saturate(p.c * unit / u.velocity), p.n};
  }

  // The root of the covariance of (K, B, n, F₀, d) in SI, from that of (k, c, n, F₀, d) in scaled
  // units: dK = U (dk − k ln x_r dn), dB = (U/V) (dc − c ln x_r dn), at U = F_s x_r⁻ⁿ.
  static Matrix<5> in_si(const Matrix<5>& root, const Law& law, const Units& u) noexcept {
    const double unit =
        detail::saturate(u.force * detail::bounded_exp(-law.exponent * u.log_penetration));
    const double damping_unit = detail::saturate(unit / u.velocity);
    const double by_stiffness = detail::saturate(-law.stiffness * u.log_penetration);
    const double by_damping = detail::saturate(-law.damping * u.log_penetration);
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

  Solver solver_;
  double largest_penetration_;  // in scaled units
  Solution last_solution_{};
  std::uint64_t samples_since_solve_ = 1;
  detail::LatterResiduals residuals_;
  double inflation_ = 1.0;       // theirs, at the last solution
  std::uint8_t open_flags_ = 0;  // of before a restart …
  double open_until_ = 0.0;      // … until the samples weigh as much as those did
};

}  // namespace palpate
