// The inputs and outputs of the vector kernels for whole curves: plain memory, the same for every
// instruction set.
#pragma once

#include <cstddef>

namespace palpate::curves {

// Samples are stored in arrays that are padded to whole blocks, with samples above the surface and
// without force.
inline constexpr std::size_t curve_block = 64;

struct CurveColumns {
  double* x;  // penetration …
  double* w;  // … velocity and force, scaled
  double* f;
  double* log;       // ln x, if the surface is known
  double* residual;  // of the latest pass
  std::size_t count;
};

// The parameters of a law f = p (k + c w) + F₀, p = (x − d)ⁿ.
struct CurveLaw {
  double k, c, n, offset, surface;
};

// The sums that a pass over samples returns. r is the residual, l = ln(x − d), and N and D are the
// derivatives of f with respect to n and d:
enum CurveSum : std::size_t {
  rr,
  r1,
  rp,
  rpw,
  rn,  // Σ r², r, rp, rpw, rN
  sum_p,
  sum_pw,
  sum_n,  // Σ p, pw, N
  p_p,
  p_pw,
  pw_pw,
  p_n,
  pw_n,
  n_n,
  rlp,
  rlpw,
  rln,  // Σ r l p …
  known_sums,
  p_d = known_sums,
  pw_d,
  n_d,
  d_d,
  sum_d,
  rd,
  rip,
  ripw,
  rld,
  rid,  // Σ r p/(x − d), r p w/(x − d), r l D, r D/(x − d)
  unknown_sums
};

struct CurveKernels {
  void (*known_surface)(const CurveColumns&, const CurveLaw&, double* sums);
  void (*unknown_surface)(const CurveColumns&, const CurveLaw&, double* sums);
  void (*logarithms)(const double* x, double* log, std::size_t count);
};

}  // namespace palpate::curves
