// For one exponent the law is linear in (k, c, F₀): least squares from the sums, with F₀ eliminated
// first and (k, c) by determinants.
#pragma once

#include "palpate/projection/power_sums.hpp"
#include "palpate/projection/priors.hpp"

namespace palpate::detail {

// A pivot below this fraction of its diagonal is rounding: sums of 1e3 samples carry 1e3 ε.
inline constexpr double smallest_fraction = 1e-13;
// Of a sum of squares; below it a column is not there. Its square is still a normal number.
inline constexpr double smallest_sum = 1e-150;

// [a11 a12; a12 a22] (k, c)ᵀ = (b1, b2)ᵀ, once F₀ = f (ΣF − k Σp − c Σpw) is eliminated.
struct NormalEquations {
  double a11, a12, a22, b1, b2;
};

// The sums of one exponent, by name; `total` is Σ F, `fraction` f = 1/(Σ1 + ρ_F).
constexpr NormalEquations normal_equations(double spp, double sppw, double sppww, double sp,
                                           double spw, double spf, double spwf, double total,
                                           double fraction) noexcept {
  return {spp - sp * sp * fraction, sppw - sp * spw * fraction, sppww - spw * spw * fraction,
          spf - sp * total * fraction, spwf - spw * total * fraction};
}

struct LinearSolution {
  double k, c, offset;
  double cost;  // −bᵀÃ⁻¹b
  bool damped;  // the damping column has a sound pivot
};

// With the prior on c/k, of weight ρ_b.
inline LinearSolution solve_linear(const ProjectionProblem& problem, const PowerSums::Values& s,
                                   double damping_weight, double fraction) noexcept {
  const double total = problem.sums.force();
  const double prior = problem.settings.prior_dissipation;
  auto [a11, a12, a22, b1, b2] =
      normal_equations(s[pp], s[ppw], s[ppww], s[p1], s[pw], s[pf], s[pwf], total, fraction);
  a11 += damping_weight * prior * prior;
  a12 -= damping_weight * prior;
  a22 += damping_weight;
  const double determinant = a11 * a22 - a12 * a12;
  const bool damped =
      determinant > smallest_fraction * (a11 * a22) && a11 > smallest_sum && a22 > smallest_sum;
  LinearSolution r{};
  r.damped = damped;
  r.k = damped ? (a22 * b1 - a12 * b2) / determinant : a11 > smallest_sum ? b1 / a11 : 0.0;
  r.c = damped ? (a11 * b2 - a12 * b1) / determinant : 0.0;
  r.offset = fraction * (total - r.k * s[p1] - r.c * s[pw]);
  r.cost = -(r.k * b1 + r.c * b2) - fraction * total * total;
  return r;
}

using GridCosts = std::array<double, PowerSums::nodes>;

// J over the grid without priors on (k, c), in one straight line of arithmetic, which vectorises;
// −f (ΣF)², the same for all, is left out.
inline GridCosts grid_costs(const PowerSums& sums, double fraction) noexcept {
  GridCosts cost;
  const auto &spp = sums.column(pp), &sppw = sums.column(ppw), &sppww = sums.column(ppww),
             &sp = sums.column(p1), &spw = sums.column(pw), &spf = sums.column(pf),
             &spwf = sums.column(pwf);
  const double total = sums.force();
  for (std::size_t j = 0; j < PowerSums::nodes; ++j) {
    const auto [a11, a12, a22, b1, b2] = normal_equations(spp[j], sppw[j], sppww[j], sp[j], spw[j],
                                                          spf[j], spwf[j], total, fraction);
    // b₁²/a₁₁ + (what damping adds), with one division; the ridge keeps out a column that is not
    // there, where sppww[j] is zero too and 1e-30 decides.
    const double ridge = smallest_fraction * a22 + 1e-30 * a11;
    const double rest = b2 * a11 - b1 * a12;
    const double determinant = a11 * (a22 + ridge) - a12 * a12;
    cost[j] = -(b1 * b1 * determinant + rest * rest) / (a11 * determinant + tiny);
  }
  return cost;
}

}  // namespace palpate::detail
