// What is kept of an answer after a change of what is touched. Another material of the same kind
// mostly has the same exponent, and a few milliseconds of it tell stiffness and exponent apart so
// badly that K overshoots by half; so the old exponent is kept until the samples reject it:
//
//   n ~ N(n_old, 0.02²), c/k ~ N(old, 0.5²)   while   J_kept − J_open ≤ 9 σ²,
//   n ~ N(n_old, 0.3²),  c/k ~ N(old, 0.1²)   from then on (J_open).
//
// An exponent that was not identifiable is no knowledge: the priors stay those that it had.
#pragma once

#include <algorithm>

#include "palpate/matrix.hpp"
#include "palpate/projection/priors.hpp"

namespace palpate::detail {

class KeptExponent {
 public:
  KeptExponent() = default;

  // Of the answer before the change; `identifiable` says whether its exponent is worth keeping, and
  // `inflation` by how much correlation inflates its variance.
  KeptExponent(const ProjectionSolution& old, bool identifiable, double inflation) noexcept
      : old_(old),
        identifiable_(identifiable),
        tolerance_(9.0 * old.noise_variance * std::min(inflation, most_inflation)) {}

  // The samples before are forgotten: none rejects the old exponent.
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
    // A quarter of the prior's deviation: from there on it says next to nothing.
    constexpr double known = 0.25 * exponent_deviation;
    if (dot(open.root[2], open.root[2]) < known * known) return open;
    const double tolerance = std::max(tolerance_, 9.0 * open.noise_variance);
    // Of other samples their costs say nothing.
    const bool alike = kept.lost_above == open.lost_above;
    if (!alike || !(kept.cost - open.cost <= tolerance)) return open;
    kept_ = true;
    give(solver);
    return kept;
  }

 private:
  static constexpr double exponent_deviation = 0.02;
  // With more, a wrong exponent would be kept for half a second.
  static constexpr double most_inflation = 4.0;

  template <class Solver>
  void give(Solver& solver) const noexcept {
    if (kept_) {
      solver.set_prior(old_, exponent_deviation, 0.5);
    } else {
      // Of the same kind an exponent is within 0.3 or so, and at the speed of the scale a damping
      // force within a tenth of the elastic one.
      solver.set_prior(old_, 0.3, 0.1);
    }
  }

  ProjectionSolution old_{};
  bool identifiable_ = false;
  bool kept_ = false;
  double tolerance_ = 0.0;  // of J
};

}  // namespace palpate::detail
