// Variable projection as a method of the recursive estimator: it converts samples to the law in SI.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "palpate/error_widening.hpp"
#include "palpate/estimate.hpp"
#include "palpate/matrix.hpp"
#include "palpate/method.hpp"
#include "palpate/projection/contact_solver.hpp"
#include "palpate/projection/covariance.hpp"
#include "palpate/projection/projection_fit.hpp"
#include "palpate/sample.hpp"

namespace palpate {

namespace detail {

// The part of an estimate that survives a change of the material. Another material of the same kind
// usually has the same exponent, and a few milliseconds of data separate stiffness and exponent so
// poorly that K overshoots by half. So the old exponent is kept until the samples reject it:
//
//   n ~ N(n_old, 0.02²), c/k ~ N(old, 0.5²)   while   J_kept − J_open ≤ 9 σ²,
//   n ~ N(n_old, 0.3²),  c/k ~ N(old, 0.1²)   afterwards (J_open).
//
// An exponent that was not identifiable carries no information: the weak priors remain.
class KeptExponent {
 public:
  KeptExponent() = default;

  // `old` is the estimate before the change; `identifiable`: whether its exponent is worth keeping;
  // `inflation`: the factor on its variance from correlated noise.
  KeptExponent(const ProjectionSolution& old, bool identifiable, double inflation) noexcept
      : old_(old),
        identifiable_(identifiable),
        tolerance_(9.0 * old.noise_variance * std::min(inflation, most_inflation)) {}

  // Forgets the earlier samples and keeps the old exponent again.
  template <class Solver>
  void begin(Solver& solver) noexcept {
    solver.clear();
    kept_ = identifiable_;
    if (identifiable_) give(solver);
  }

  bool kept() const noexcept { return kept_; }

  // The solution with the old exponent, or without it once the samples reject it.
  template <class Solver>
  ProjectionSolution solve(Solver& solver) noexcept {
    if (!kept_) return solver.solve();
    const ProjectionSolution kept = solver.solve();
    kept_ = false;
    give(solver);
    const ProjectionSolution open = solver.solve();
    // With an error below a quarter of the prior's deviation the prior has almost no effect.
    constexpr double known = 0.25 * exponent_deviation;
    if (dot(open.root[2], open.root[2]) < known * known) return open;
    const double tolerance = std::max(tolerance_, 9.0 * open.noise_variance);
    // Costs for different samples cannot be compared.
    const bool alike = kept.lost_above == open.lost_above;
    if (!alike || !(kept.cost - open.cost <= tolerance)) return open;
    kept_ = true;
    give(solver);
    return kept;
  }

 private:
  static constexpr double exponent_deviation = 0.02;
  // With a larger value, a wrong exponent would be kept for half a second.
  static constexpr double most_inflation = 4.0;

  template <class Solver>
  void give(Solver& solver) const noexcept {
    if (kept_) {
      solver.set_prior(old_, exponent_deviation, 0.5);
    } else {
      // Exponents of materials of one kind lie within about 0.3, and damping forces at the
      // reference speed within a tenth of the elastic force.
      solver.set_prior(old_, 0.3, 0.1);
    }
  }

  ProjectionSolution old_{};
  bool identifiable_ = false;
  bool kept_ = false;
  double tolerance_ = 0.0;  // of J
};

}  // namespace detail

// `Solver` is ContactSolver, which selects the samples; ProjectionSolver, which uses all; or
// SurfaceSolver for an unknown surface.
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
  static constexpr Scale default_scale = probing_scale;
  static constexpr bool forgets = true;
  static constexpr bool perturbs = false;
  // With the limit on ξⁿ below, sums of these squares stay finite.
  static constexpr double largest_input = 1e8;
  // Up to this limit ξⁿ squared, times w², summed, and a product of three such sums stay finite.
  static constexpr double largest_power = 1e29;

  VariableProjectionMethod(const Settings& settings, const Units& units) noexcept
      : solver_(settings),
        log_penetration_(units.log_penetration),
        largest_penetration_(std::pow(largest_power, 1.0 / solver_.highest_exponent())) {}

  ContactGate::Settings gate(const ContactGate::Settings& given, const Units& units) noexcept {
    return solver_.gate(given, units);
  }
  bool in_range(const Sample& s) const noexcept {
    return s.penetration < largest_penetration_ && solver_.in_range(s) &&
           detail::within(s, largest_input);
  }

  Row prepare(const Sample& sample, double) noexcept {
    refresh();
    return {sample, last_solution_.force(sample)};
  }

  double predict(const Row& row) const noexcept { return row.predicted; }

  Status learn(const Row& row, double, double forgetting_factor, double) noexcept {
    const bool firm = add(row, forgetting_factor);
    ++samples_since_solve_;
    if (!firm) return Status::held;
    if constexpr (std::is_same_v<Solver, detail::SurfaceSolver>) watch_reach(row.sample);
    levels_.add(slope(row.sample), detail::saturate(row.sample.force - row.predicted),
                forgetting_factor);
    return Status::updated;
  }

  // A sample out of contact informs the force offset.
  void free(const Sample& sample, double, double forgetting_factor) noexcept {
    if constexpr (requires { solver_.free(sample, forgetting_factor); }) {
      if (detail::within(sample, largest_input)) solver_.free(sample, forgetting_factor);
    }
  }

  // Removes the latest samples, at most eight, which turned out to be outliers.
  bool sound() const noexcept {
    if constexpr (requires { solver_.sound(); }) return solver_.sound() && levels_.sound();
    return levels_.sound();
  }

  void withdraw(std::size_t count) noexcept {
    if constexpr (requires { solver_.withdraw(count); }) solver_.withdraw(count);
  }

  // Corrects the rounding of the force with the law of an earlier replay of the same samples: with
  // its own law the first samples would not be corrected, or wrongly. True if there is rounding.
  bool unround_as(const VariableProjectionMethod& earlier) noexcept
    requires requires(Solver& solver) { solver.unround_as(solver); }
  {
    unrounds_ = solver_.unround_as(earlier.solver_);
    if (unrounds_) unrounding_ = earlier.solve();
    return unrounds_;
  }

  // The next sample does not continue the latest one.
  void interrupt() noexcept {
    if constexpr (requires { solver_.interrupt(); }) solver_.interrupt();
  }

  // Restarts with the old estimate as a prior (KeptExponent).
  void reinitialise() noexcept {
    const Solution now = solve();
    const Matrix<5> root = widened(now);
    open_flags_ = flags(now, root);
    open_until_ = std::max(open_until_, solver_.weight());
    const bool open = (open_flags_ & (exponent_not_identifiable | exponent_at_edge)) != 0;
    const double white_variance = detail::dot(now.root[2], now.root[2]);
    const double inflation = detail::dot(root[2], root[2]) / (white_variance + detail::tiny);
    kept_ = detail::KeptExponent(now, !open, inflation);
    reinitialise_after_transient();
  }

  // Restarts again, from the same prior.
  void reinitialise_after_transient() noexcept {
    kept_.begin(solver_);
    forget_noise();
  }

  Law law(const Units& units) const noexcept { return law(solve(), units); }

  double force(const Units& units, double x, double v) const noexcept {
    return without_errors(solve(), units).force(x, v);
  }

  // The solution for one-step prediction errors, which is up to a 64th of the samples old.
  Snapshot<Law> latest(const Units& units) const noexcept {
    return without_errors(last_solution_, units);
  }

  // The fit of that solution.
  Fit<Law> latest_fit(const Units& units) const noexcept {
    return fit(last_solution_, widened(last_solution_), units);
  }

  // Whether the latest sample renewed it, and the variance of its residual, in scaled units.
  bool renewed() const noexcept { return samples_since_solve_ <= 1; }
  double residual_variance() const noexcept { return last_solution_.noise_variance; }

  Fit<Law> fit(const Units& units) const noexcept {
    const Solution now = solve();
    return fit(now, widened(now), units);
  }

  // The fit with standard errors for white noise: the drift-tracking filter starts from it.
  Fit<Law> fit_in_white_noise(const Units& units) const noexcept {
    const Solution now = solve();
    return fit(now, now.root, units);
  }

  Snapshot<Law> snapshot(const Units& units) const noexcept {
    const Solution now = solve();
    Snapshot<Law> snapshot = without_errors(now, units);
    const Matrix<5> root = detail::root_in_si(widened(now), snapshot.law, units);
    for (std::size_t i = 0; i < order; ++i) {
      snapshot.variances[i] = detail::bounded_variance(detail::dot(root[i], root[i]));
    }
    return snapshot;
  }

  // Noise variance of the force, in scaled units.
  double noise_variance() const noexcept { return solve().noise_variance; }
  // The prediction errors by time scale.
  const detail::HaarLevels<4>& noise_levels() const noexcept { return levels_; }

 private:
  using Solution = detail::ProjectionSolution;

  // The fit from a solution and the root of its covariance, in scaled units.
  Fit<Law> fit(const Solution& now, const Matrix<5>& root, const Units& units) const noexcept {
    const Law law = this->law(now, units);
    const Matrix<5> joint = detail::covariance_in_si(root, law, units);
    Fit<Law> fit = fit_of(law, joint, now.offset * units.force, flags(now, root));
    fit.surface = {now.surface * units.penetration, joint[4][4]};
    return fit;
  }

  // Adds a sample; true if it counts as contact. A solver may keep an undecided sample separate.
  bool add(const Row& row, double forgetting_factor) noexcept {
    const auto& sample = row.sample;
    const double expected = unrounds_ ? unrounding_.force(sample) : row.predicted;
    if constexpr (requires { solver_.add(sample, forgetting_factor, expected, last_solution_); }) {
      return solver_.add(sample, forgetting_factor, expected, last_solution_);
    } else {
      solver_.add(sample, forgetting_factor);
      return true;
    }
  }

  void forget_noise() noexcept {
    levels_.clear();
    widening_ = white;
    samples_since_widening_ = 0;
    samples_since_solve_ = 1;
  }

  // Whether to solve again: after 1/64 more samples, which change the estimate by at most an eighth
  // of its standard error (1/√64), and at most every 64 samples, where a solution, which costs ten
  // updates, adds a sixth to their cost.
  bool due() const noexcept {
    return static_cast<double>(samples_since_solve_) >=
           std::min(1.0 + solver_.weight() / 64.0, 64.0);
  }

  // An exponent that changed this much since the last solution has left its basin: the samples
  // after a slow approach, for instance, outweigh all before them.
  Solution solve() const noexcept {
    constexpr double basin = 0.1;
    if (due()) return solver_.solve();
    const Solution near = solver_.solve_near(last_solution_);
    return std::abs(near.n - last_solution_.n) < basin ? near : solver_.solve();
  }

  // Renews, if due, the solution for prediction errors, from which later solutions start.
  void refresh() noexcept {
    if (!due()) return;
    samples_since_widening_ += samples_since_solve_;
    last_solution_ = kept_.solve(solver_);
    samples_since_solve_ = 0;
    // A tenth more samples changes a standard error by a twentieth.
    if (static_cast<double>(samples_since_widening_) > 0.1 * solver_.weight()) {
      samples_since_widening_ = 0;
      const Vector<4> prior = solver_.prior_fractions(last_solution_);
      widening_ = detail::projection_widening(levels_, prior, last_solution_, log_penetration_);
    }
  }

  // The derivatives of F = ξⁿ (k + c w) + F₀ with respect to k, c, n/k and F₀, always at n = 1 and
  // c = 0: slopes that change while an estimate converges would look like fast motion.
  static Vector<4> slope(const Sample& s) noexcept {
    const double depth = s.penetration;
    if (!(depth > 0.0)) return {0.0, 0.0, 0.0, 1.0};
    return {depth, depth * s.velocity, depth * std::log(depth), 1.0};
  }

  // An unknown surface is found while the probe goes farther than before. The errors of the first
  // touch are as large as the force; a rest above the surface must not make them count for longer.
  void watch_reach(const Sample& s) noexcept {
    if (std::isnan(first_penetration_)) first_penetration_ = s.penetration;
    const double reach = std::abs(s.penetration - first_penetration_);
    if (!(reach > 2.0 * reach_)) return;
    reach_ = reach;
    levels_.start_again();
  }

  // The root of the reported covariance.
  Matrix<5> widened(const Solution& p) const noexcept {
    return detail::multiply(p.root, widening_);
  }

  std::uint8_t flags(const Solution& p, const Matrix<5>& root) const noexcept {
    std::uint8_t found = detail::open_flags(p, root);
    // A few samples after a restart do not identify what the samples before it did not, although
    // the prior from the old estimate would hide that. The factor is 0.9 because with forgetting
    // the weight only approaches its limit.
    if (solver_.weight() < 0.9 * open_until_) found |= open_flags_;
    return found;
  }

  static Law law(const Solution& p, const Units& u) noexcept { return detail::law_in_si(p, u); }

  static Snapshot<Law> without_errors(const Solution& now, const Units& units) noexcept {
    return {law(now, units), {}, now.offset * units.force, now.surface * units.penetration};
  }

  Solver solver_;
  double log_penetration_;      // logarithm of the unit
  double largest_penetration_;  // in scaled units
  Solution last_solution_{};
  Solution unrounding_{};  // from an earlier replay
  bool unrounds_ = false;
  std::uint64_t samples_since_solve_ = 1;
  detail::HaarLevels<4> levels_;
  // With an unknown surface: the first position, and the farthest from it, to a factor of two.
  double first_penetration_ = std::numeric_limits<double>::quiet_NaN();
  double reach_ = 0.0;
  static constexpr Matrix<5> white = diagonal<5>({1.0, 1.0, 1.0, 1.0, 1.0});
  Matrix<5> widening_ = white;  // widening of the root by the levels, when it was last due
  std::uint64_t samples_since_widening_ = 0;
  detail::KeptExponent kept_;    // from before a restart
  std::uint8_t open_flags_ = 0;  // from before a restart …
  double open_until_ = 0.0;      // … until the samples have the same weight
};

}  // namespace palpate
