// What variable projection answers, in scaled units.
#pragma once

#include <cmath>

#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"

namespace palpate::detail {

// F = k (ξ − d)ⁿ (1 + c/k w) + F₀ in scaled units.
struct ScaledLaw {
  double k, c, offset, n, surface;

  double force(const Sample& s) const noexcept {
    const double depth = s.penetration - surface;
    const double power = depth > 0.0 ? std::pow(depth, n) : 0.0;
    return power * (k + c * s.velocity) + offset;
  }
};

struct ProjectionSolution : ScaledLaw {
  double noise_variance;  // of the force
  double prior_variance;  // the same as the priors were weighted with
  double root_variance;   // the same as the root below takes it, with its floor
  Matrix<5> root;   // R Rᵀ is the covariance of (k, c, n, offset, surface) for white residuals
  double cost;      // J: the weighted residual sum less Σ F², with the priors
  double residual;  // the weighted residual sum
  bool damping_identifiable;   // false where v says nothing that ξ does not, but for rounding
  bool exponent_identifiable;  // false where the depth has hardly varied
  bool at_edge;                // the exponent ended at the edge of its range
  bool surface_found;      // true unless a search for the surface ended at the edge of its range
  bool lost_above;         // contact is lost above the surface: the light samples are left out
  bool tare_refuted;       // F₀ is beyond the prior that a tare gave
  double prior_mean;       // of the prior of F₀ that was used …
  double prior_deviation;  // … and its deviation
};

}  // namespace palpate::detail
