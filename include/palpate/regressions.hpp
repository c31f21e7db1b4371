// Each force law as a linear regression y = φᵀθ in scaled units, and θ back to the law in SI.
#pragma once

#include <algorithm>
#include <cmath>

#include "palpate/force_laws.hpp"
#include "palpate/matrix.hpp"
#include "palpate/scale.hpp"

namespace palpate {

template <std::size_t Order>
struct Row {
  Vector<Order> regressor;  // φ
  double output;            // y
};

// y = F, φ = [x, v], θ = [K, B].
struct KelvinVoigtRegression {
  using Law = KelvinVoigt;
  static constexpr std::size_t order = 2;

  static constexpr Row<order> row(const Sample& s) noexcept {
    return {{s.penetration, s.velocity}, s.force};
  }
  static constexpr double force(const Vector<order>& theta, const Vector<order>& phi) noexcept {
    return dot(phi, theta);
  }
  static constexpr Vector<order> coefficients(const Law& law, const Units& u) noexcept {
    return {law.stiffness * u.penetration / u.force, law.damping * u.velocity / u.force};
  }
  static constexpr Law law(const Vector<order>& theta, const Units& u) noexcept {
    return {saturate(theta[0] * u.force / u.penetration),
            saturate(theta[1] * u.force / u.velocity)};
  }
  static constexpr Matrix<order> jacobian(const Law&, const Units& u) noexcept {
    return diagonal<order>({u.force / u.penetration, u.force / u.velocity});
  }
  static constexpr Vector<order> variances(const Matrix<order>& p, const Law& law,
                                           const Units& u) noexcept {
    return congruent_diagonal(jacobian(law, u), p);
  }
};

// y = F, φ = [x, x², v], θ = [K₁, K₂, B].
struct ExtendedKelvinVoigtRegression {
  using Law = ExtendedKelvinVoigt;
  static constexpr std::size_t order = 3;

  static constexpr Row<order> row(const Sample& s) noexcept {
    return {{s.penetration, s.penetration * s.penetration, s.velocity}, s.force};
  }
  static constexpr double force(const Vector<order>& theta, const Vector<order>& phi) noexcept {
    return dot(phi, theta);
  }
  static constexpr Vector<order> coefficients(const Law& law, const Units& u) noexcept {
    return {law.stiffness * u.penetration / u.force,
            law.quadratic_stiffness * u.penetration * u.penetration / u.force,
            law.damping * u.velocity / u.force};
  }
  static constexpr Law law(const Vector<order>& theta, const Units& u) noexcept {
    return {saturate(theta[0] * u.force / u.penetration),
            saturate(theta[1] * u.force / u.penetration / u.penetration),
            saturate(theta[2] * u.force / u.velocity)};
  }
  static constexpr Matrix<order> jacobian(const Law&, const Units& u) noexcept {
    return diagonal<order>(
        {u.force / u.penetration, u.force / u.penetration / u.penetration, u.force / u.velocity});
  }
  static constexpr Vector<order> variances(const Matrix<order>& p, const Law& law,
                                           const Units& u) noexcept {
    return congruent_diagonal(jacobian(law, u), p);
  }
};

// The single-stage method (eqs. 9, 12): y = ln F, φ = [1, v, ln x], θ = [ln K, B/K, n].
struct HuntCrossleyLogRegression {
  using Law = HuntCrossley;
  static constexpr std::size_t order = 3;

  static Row<order> row(const Sample& s) noexcept {
    return {{1.0, s.velocity, std::log(s.penetration)}, std::log(s.force)};
  }
  static double force(const Vector<order>& theta, const Vector<order>& phi) noexcept {
    return bounded_exp(theta[0] + theta[2] * phi[2]) * (1.0 + theta[1] * phi[1]);
  }
  static Vector<order> coefficients(const Law& law, const Units& u) noexcept {
    return {std::log(law.stiffness) + law.exponent * u.log_penetration - u.log_force,
            law.damping / law.stiffness * u.velocity, law.exponent};
  }
  static Law law(const Vector<order>& theta, const Units& u) noexcept {
    const double stiffness = bounded_exp(theta[0] - theta[2] * u.log_penetration + u.log_force);
    return {stiffness, saturate(theta[1] / u.velocity * stiffness), saturate(theta[2])};
  }
  // dK = K (dθ₁ − ln x₀ dθ₃), dB = (K/v₀) dθ₂ + (B/K) dK, dn = dθ₃, at the scale x₀, v₀.
  static Matrix<order> jacobian(const Law& law, const Units& u) noexcept {
    const double depth = -u.log_penetration;
    return {{{law.stiffness, 0.0, saturate(law.stiffness * depth)},
             {law.damping, saturate(law.stiffness / u.velocity), saturate(law.damping * depth)},
             {0.0, 0.0, 1.0}}};
  }
  // The diagonal of J P Jᵀ written out: a trace asks for it at every sample.
  static Vector<order> variances(const Matrix<order>& p, const Law& law, const Units& u) noexcept {
    const double depth = -u.log_penetration;
    const double log_stiffness = p[0][0] + depth * (2.0 * p[0][2] + depth * p[2][2]);
    const double dissipation = saturate(law.stiffness / u.velocity);
    const double shared = dissipation * (p[0][1] + depth * p[1][2]);
    return {law.stiffness * law.stiffness * log_stiffness,
            law.damping * (law.damping * log_stiffness + 2.0 * shared) +
                dissipation * dissipation * p[1][1],
            p[2][2]};
  }
};

}  // namespace palpate
