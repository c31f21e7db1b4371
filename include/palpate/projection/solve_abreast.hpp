// Answers after eight samples, abreast: what solve_near() does, in straight lines over eight lanes,
// which vectorise and give the same bits whatever the vectors' width. Of sums that are regular: a
// lane that is not says so, and is for the plain way.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"
#include "palpate/projection/linear_solve.hpp"
#include "palpate/projection/local_sums.hpp"
#include "palpate/projection/power_sums.hpp"
#include "palpate/projection/priors.hpp"

namespace palpate::detail {

inline constexpr std::size_t abreast = 8;

struct alignas(64) Lane {
  std::array<double, abreast> of;

  double& operator[](std::size_t lane) noexcept { return of[lane]; }
  double operator[](std::size_t lane) const noexcept { return of[lane]; }
};

// What the lanes have in common.
struct AbreastSettings {
  double exponent;  // n₀
  double lowest, highest;
  double most_step;
  double prior_exponent, exponent_precision;        // 1/s²
  double prior_dissipation, dissipation_precision;  // of c/k
  double offset;                                    // 1; 0 where none is estimated
  double noise_variance;                            // 0: from the residual
  double log_penetration;                           // of the unit
};

struct Abreast {
  // Of each sample: polynomials in n − n₀ of the sums; Σ1, ΣF and ΣF²; how the priors weigh.
  std::array<std::array<Lane, power_count>, local_terms> terms;
  Lane weight, force, square;
  Lane variance;          // σ² for the priors
  Lane damping_weight;    // ρ_b
  Lane offset_precision;  // 1/s_F²; 0 where nothing is known of F₀
  std::array<Lane, 10> widening;

  // n − n₀: where Newton's method starts, and what it comes to.
  Lane away;

  // (k, c, F₀); and, but for the units of force and speed, the law's e^(−n ln x_r) and the
  // variances of K, B and n.
  Lane k, c, offset, unit;
  std::array<Lane, 3> variances;
  Lane step;   // the last one
  Lane moved;  // its square, in variances of n as white noise leaves it
  Lane sound;  // 1; 0 where it is not regular
};

namespace eight_lanes {

// e^z to 1e-13 for |z| < 0.6.
inline double small_exp(double z) noexcept {
  return 1.0 +
         z * (1.0 +
              z * (1.0 / 2 +
                   z * (1.0 / 6 + z * (1.0 / 24 +
                                       z * (1.0 / 120 +
                                            z * (1.0 / 720 +
                                                 z * (1.0 / 5040 +
                                                      z * (1.0 / 40320 +
                                                           z * (1.0 / 362880 +
                                                                z * (1.0 / 3628800 +
                                                                     z * (1.0 / 39916800)))))))))));
}
inline constexpr double largest_small = 0.6;

inline double smaller(double a, double b) noexcept { return a < b ? a : b; }
inline double larger(double a, double b) noexcept { return a > b ? a : b; }

inline double offset_weight(double precision, double variance) noexcept {
  const double open = smaller(variance, 1.0 / (20.0 * 20.0));
  return precision > 0.0 ? variance * precision : open;
}

// The sums of one lane at n₀ + δ.
struct Point {
  const Abreast& a;
  std::size_t lane;
  double away;

  double term(std::size_t degree, std::size_t power) const noexcept {
    return a.terms[degree][power][lane];
  }
  double value(std::size_t p) const noexcept {
    return term(0, p) +
           away * (term(1, p) + away * (term(2, p) + away * (term(3, p) + away * term(4, p))));
  }
  double first(std::size_t p) const noexcept {
    return term(1, p) +
           away * (2.0 * term(2, p) + away * (3.0 * term(3, p) + away * (4.0 * term(4, p))));
  }
  double second(std::size_t p) const noexcept {
    return 2.0 * term(2, p) + away * (6.0 * term(3, p) + away * (12.0 * term(4, p)));
  }
};

struct Linear {
  double k, c, offset, cost;
  double a11, a12, a22;
  bool sound;
};

inline Linear solve(double spp, double sppw, double sppww, double sp, double spw, double spf,
                    double spwf, double total, double fraction, double damping_weight,
                    double prior) noexcept {
  Linear r;
  r.a11 = spp - sp * sp * fraction + damping_weight * prior * prior;
  r.a12 = sppw - sp * spw * fraction - damping_weight * prior;
  r.a22 = sppww - spw * spw * fraction + damping_weight;
  const double b1 = spf - sp * total * fraction, b2 = spwf - spw * total * fraction;
  const double determinant = r.a11 * r.a22 - r.a12 * r.a12;
  r.sound = determinant > smallest_fraction * (r.a11 * r.a22) && r.a11 > smallest_sum &&
            r.a22 > smallest_sum;
  const double per_determinant = 1.0 / determinant;
  r.k = (r.a22 * b1 - r.a12 * b2) * per_determinant;
  r.c = (r.a11 * b2 - r.a12 * b1) * per_determinant;
  r.offset = fraction * (total - r.k * sp - r.c * spw);
  r.cost = -(r.k * b1 + r.c * b2) - fraction * total * total;
  return r;
}

}  // namespace eight_lanes

// A round of Newton's method on J(n), as refine() in exponent_search.hpp.
inline void newton_abreast(Abreast& a, const AbreastSettings& s) noexcept {
  using namespace eight_lanes;
  for (std::size_t l = 0; l < abreast; ++l) {
    const Point at{a, l, a.away[l]};
    const double spp = at.value(pp), sppw = at.value(ppw), sppww = at.value(ppww);
    const double sp = at.value(p1), spw = at.value(pw), spf = at.value(pf), spwf = at.value(pwf);
    const double dpp = at.first(pp), dppw = at.first(ppw), dppww = at.first(ppww);
    const double dp = at.first(p1), dpw = at.first(pw), dpf = at.first(pf), dpwf = at.first(pwf);
    const double weight = a.weight[l] + offset_weight(a.offset_precision[l], a.variance[l]) + tiny;
    const double fraction = s.offset / weight;
    const Linear r = solve(spp, sppw, sppww, sp, spw, spf, spwf, a.force[l], fraction,
                           a.damping_weight[l], s.prior_dissipation);
    const double kk = r.k * r.k, kc = 2.0 * r.k * r.c, cc = r.c * r.c;
    const double m23 = r.k * dp + r.c * dpw;
    const double h1 = 0.5 * (r.k * dpp + r.c * dppw) - sp * m23 * fraction;
    const double h2 = 0.5 * (r.k * dppw + r.c * dppww) - spw * m23 * fraction;
    const double h = 0.25 * (kk * at.second(pp) + kc * at.second(ppw) + cc * at.second(ppww)) -
                     m23 * m23 * fraction;
    const double per_first = 1.0 / r.a11;
    const double rest = h2 - h1 * r.a12 * per_first;
    const double pivot = r.a22 - r.a12 * r.a12 * per_first;
    const double projected = h1 * h1 * per_first + rest * rest / pivot;
    const double precision = a.variance[l] * s.exponent_precision;
    const double slope = kk * dpp + kc * dppw + cc * dppww + 2.0 * r.offset * m23 -
                         2.0 * (r.k * dpf + r.c * dpwf) +
                         2.0 * precision * (s.exponent + a.away[l] - s.prior_exponent);
    const double curvature = 2.0 * (larger(h - projected, 0.0) + precision);
    const double whole = -slope / curvature;
    const double step = larger(smaller(whole, s.most_step), -s.most_step);
    const double next = a.away[l] + step;
    const bool sound = r.sound & (pivot > 0.0) & (curvature > 0.0) & (whole * whole < 1e6);
    a.sound[l] = sound ? a.sound[l] : 0.0;
    a.step[l] = step;
    a.moved[l] = step * step * curvature / a.variance[l];
    a.away[l] = next;
  }
}

// The answer at the exponents found: the linear part, the noise and the covariance, as answer() in
// projection_fit.hpp and covariance_root() in covariance.hpp.
inline void finish_abreast(Abreast& a, const AbreastSettings& s) noexcept {
  using namespace eight_lanes;
  constexpr double margin = definiteness_margin<4>;
  for (std::size_t l = 0; l < abreast; ++l) {
    const Point at{a, l, a.away[l]};
    const double spp = at.value(pp), sppw = at.value(ppw), sppww = at.value(ppww);
    const double sp = at.value(p1), spw = at.value(pw), spf = at.value(pf), spwf = at.value(pwf);
    const double weight = a.weight[l], square = a.square[l];
    const double fraction =
        s.offset / (weight + offset_weight(a.offset_precision[l], a.variance[l]) + tiny);
    const Linear r = solve(spp, sppw, sppww, sp, spw, spf, spwf, a.force[l], fraction,
                           a.damping_weight[l], s.prior_dissipation);
    a.k[l] = r.k;
    a.c[l] = r.c;
    a.offset[l] = r.offset;

    const double freedom = weight - (3.0 + s.offset);
    const double residual = larger(square + r.cost, 1e-15 * square) / freedom;
    const double noise = s.noise_variance > 0.0 ? s.noise_variance : residual;
    const double variance = larger(noise, 1e-10 * square / weight);

    // JᵀJ with the priors, and what these say of each alone.
    const double known_damping =
        smaller(variance * s.dissipation_precision / (r.k * r.k), largest_parameter);
    const double known_exponent = variance * s.exponent_precision;
    const double known_offset = offset_weight(a.offset_precision[l], variance);
    const double m00 = spp + known_damping * s.prior_dissipation * s.prior_dissipation;
    const double m01 = sppw - known_damping * s.prior_dissipation;
    const double m02 = 0.5 * (r.k * at.first(pp) + r.c * at.first(ppw));
    const double m03 = s.offset * sp;
    const double m11 = sppww + known_damping;
    const double m12 = 0.5 * (r.k * at.first(ppw) + r.c * at.first(ppww));
    const double m13 = s.offset * spw;
    const double m22 = 0.25 * (r.k * r.k * at.second(pp) + 2.0 * r.k * r.c * at.second(ppw) +
                               r.c * r.c * at.second(ppww)) +
                       known_exponent;
    const double m23 = s.offset * (r.k * at.first(p1) + r.c * at.first(pw));
    const double m33 = weight + known_offset;

    // To a unit diagonal, then LDLᵀ.
    const double u0 = 1.0 / std::sqrt(m00), u1 = 1.0 / std::sqrt(m11);
    const double u2 = 1.0 / std::sqrt(m22), u3 = 1.0 / std::sqrt(m33);
    const double a01 = m01 * u0 * u1, a02 = m02 * u0 * u2, a03 = m03 * u0 * u3;
    const double a12 = m12 * u1 * u2, a13 = m13 * u1 * u3, a23 = m23 * u2 * u3;
    const double p1_ = 1.0 - a01 * a01, d1 = larger(p1_, known_damping * u1 * u1);
    const double e1 = 1.0 / d1;
    const double l21 = (a12 - a02 * a01) * e1, l31 = (a13 - a03 * a01) * e1;
    const double p2 = 1.0 - a02 * a02 - l21 * l21 * d1;
    const double d2 = larger(p2, known_exponent * u2 * u2), e2 = 1.0 / d2;
    const double l32 = (a23 - a03 * a02 - l31 * l21 * d1) * e2;
    const double p3 = 1.0 - a03 * a03 - l31 * l31 * d1 - l32 * l32 * d2;
    const double d3 = larger(p3, known_offset * u3 * u3), e3 = 1.0 / d3;
    const double s1 = std::sqrt(e1), s2 = std::sqrt(e2), s3 = std::sqrt(e3);
    // Columns of L⁻¹.
    const double i10 = -a01, i20 = -(a02 + l21 * i10), i21 = -l21;
    const double i30 = -(a03 + l31 * i10 + l32 * i20), i31 = -(l31 + l32 * i21), i32 = -l32;
    const double deviation = std::sqrt(variance);
    const double v0 = u0 * deviation, v1 = u1 * deviation, v2 = u2 * deviation;
    const double r00 = v0, r01 = i10 * s1 * v0, r02 = i20 * s2 * v0, r03 = i30 * s3 * v0;
    const double r11 = s1 * v1, r12 = i21 * s2 * v1, r13 = i31 * s3 * v1;
    const double r22 = s2 * v2, r23 = i32 * s3 * v2;

    // Widened, of (k, c, n); and in SI but for the units.
    const auto w = [&](std::size_t entry) noexcept { return a.widening[entry][l]; };
    const double k0 = r00 * w(0) + r01 * w(1) + r02 * w(3) + r03 * w(6);
    const double k1 = r01 * w(2) + r02 * w(4) + r03 * w(7);
    const double k2 = r02 * w(5) + r03 * w(8), k3 = r03 * w(9);
    const double c0 = r11 * w(1) + r12 * w(3) + r13 * w(6);
    const double c1 = r11 * w(2) + r12 * w(4) + r13 * w(7);
    const double c2 = r12 * w(5) + r13 * w(8), c3 = r13 * w(9);
    const double n0 = r22 * w(3) + r23 * w(6), n1 = r22 * w(4) + r23 * w(7);
    const double n2 = r22 * w(5) + r23 * w(8), n3 = r23 * w(9);
    const double by_k = -r.k * s.log_penetration, by_c = -r.c * s.log_penetration;
    const double g0 = k0 + by_k * n0, g1 = k1 + by_k * n1, g2 = k2 + by_k * n2;
    const double g3 = k3 + by_k * n3;
    const double b0 = c0 + by_c * n0, b1 = c1 + by_c * n1, b2 = c2 + by_c * n2;
    const double b3 = c3 + by_c * n3;
    a.variances[0][l] = g0 * g0 + g1 * g1 + g2 * g2 + g3 * g3;
    a.variances[1][l] = b0 * b0 + b1 * b1 + b2 * b2 + b3 * b3;
    a.variances[2][l] = n0 * n0 + n1 * n1 + n2 * n2 + n3 * n3;
    a.unit[l] = small_exp(-a.away[l] * s.log_penetration);

    const double n = s.exponent + a.away[l];
    const double turned = a.away[l] * s.log_penetration;
    const bool sound = r.sound & (p1_ > margin) & (p2 > margin) & (p3 > margin) &
                       (freedom >= 10.0) & (n > s.lowest) & (n < s.highest) &
                       (turned * turned < largest_small * largest_small);
    a.sound[l] = sound ? a.sound[l] : 0.0;
  }
}

}  // namespace palpate::detail
