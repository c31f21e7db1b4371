// The Hunt–Crossley law by variable projection from every sample that it is given.
#pragma once

#include <cmath>

#include "palpate/matrix.hpp"
#include "palpate/method.hpp"
#include "palpate/projection/power_sums.hpp"
#include "palpate/projection/priors.hpp"
#include "palpate/projection/projection_fit.hpp"
#include "palpate/sample.hpp"

namespace palpate::detail {

class ProjectionSolver {
 public:
  using Settings = ProjectionSettings;

  explicit ProjectionSolver(const Settings& settings) noexcept
      : settings_(settings), sums_(empty_sums(settings)) {}

  // Samples count where the gate finds contact, and the law needs a depth and a push.
  static ContactGate::Settings gate(const ContactGate::Settings& given, const Units&) noexcept {
    return given;
  }
  static bool in_range(const Sample& s) noexcept { return touching(s); }

  void add(const Sample& sample, double forgetting_factor) noexcept {
    sums_.add(sample, forgetting_factor);
  }

  double weight() const noexcept { return sums_.weight(); }  // samples, less what was forgotten
  double lowest_exponent() const noexcept { return sums_.lowest(); }
  double highest_exponent() const noexcept { return sums_.highest(); }

  Vector<4> prior_fractions(const ProjectionSolution& solution) const noexcept {
    return ProjectionFit(sums_, settings_).prior_fractions(solution);
  }

  // The prior is an old answer with these deviations.
  void set_prior(const ProjectionSolution& old, double exponent_deviation,
                 double dissipation_deviation) noexcept {
    centre_priors(settings_, old, exponent_deviation, dissipation_deviation);
    settings_.offset_deviation = offset_deviation(old);
  }

  // Forgets the samples and keeps the prior.
  void clear() noexcept { sums_.clear(); }

  // The global minimum over the whole range of exponents. Not inlined: a replay would hold the
  // search a dozen times, and every kind of estimator each of them.
  [[gnu::noinline]] ProjectionSolution solve() const noexcept {
    return ProjectionFit(sums_, settings_).solve();
  }

  // The same from an answer of a little while ago, in whose basin the minimum still is.
  [[gnu::noinline]] ProjectionSolution solve_near(
      const ProjectionSolution& earlier) const noexcept {
    return ProjectionFit(sums_, settings_).solve_near(earlier);
  }

 private:
  Settings settings_;
  PowerSums sums_;
};

}  // namespace palpate::detail
