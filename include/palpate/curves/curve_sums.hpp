// One pass over the samples of a curve: Σ r², Jᵀr, JᵀJ and Σ r ∇²f for (k, c, n, F₀, d), of
//
//   f = p (k + c w) + F₀,   p = (ξ − d)ⁿ below the surface, 0 above it.
#pragma once

#include <cstddef>

#include "palpate/curves/curve_blocks.hpp"
#include "palpate/matrix.hpp"

namespace palpate::detail {

// Of a law in scaled units, in this order: k, c, n, F₀, d.
using CurvePoint = Vector<5>;

struct CurveSamples {
  static constexpr std::size_t block = curves::curve_block;

  static constexpr std::size_t padded(std::size_t count) noexcept {
    return (count + block - 1) / block * block;
  }

  double* x;  // penetration …
  double* w;  // … velocity and force, scaled
  double* f;
  double* log;       // ln x, where the surface is known
  double* residual;  // of the latest pass
  std::size_t count;

  // What fills the last block up: it has neither force nor depth.
  void pad() const noexcept {
    for (std::size_t i = count; i < padded(count); ++i) {
      x[i] = -1e300;
      w[i] = f[i] = residual[i] = 0.0;
    }
  }

  curves::CurveColumns columns() const noexcept { return {x, w, f, log, residual, count}; }
};

struct CurveSums {
  double squares = 0.0;     // Σ r²
  Vector<5> gradient{};     // Jᵀr
  Matrix<5> information{};  // JᵀJ
  Matrix<5> curvature{};    // Σ r ∇²f

  void include(const CurveSums& other, double weight) noexcept {
    squares += weight * other.squares;
    for (std::size_t i = 0; i < 5; ++i) {
      gradient[i] += weight * other.gradient[i];
      for (std::size_t j = 0; j < 5; ++j) {
        information[i][j] += weight * other.information[i][j];
        curvature[i][j] += weight * other.curvature[i][j];
      }
    }
  }
};

inline CurveSums curve_sums(const CurveSamples& samples, const CurvePoint& at, bool surface,
                            const curves::CurveKernels& kernels) noexcept {
  using namespace curves;
  double s[unknown_sums] = {};
  const CurveLaw law{at[0], at[1], at[2], at[3], at[4]};
  (surface ? kernels.unknown_surface : kernels.known_surface)(samples.columns(), law, s);
  CurveSums result;
  result.squares = s[rr];
  result.gradient = {s[rp], s[rpw], s[rn], s[r1], s[rd]};
  Matrix<5>& m = result.information;
  m[0] = {s[p_p], s[p_pw], s[p_n], s[sum_p], s[p_d]};
  m[1] = {0.0, s[pw_pw], s[pw_n], s[sum_pw], s[pw_d]};
  m[2] = {0.0, 0.0, s[n_n], s[sum_n], s[n_d]};
  m[3] = {0.0, 0.0, 0.0, static_cast<double>(samples.count), s[sum_d]};
  m[4][4] = s[d_d];
  const double n = at[2];
  Matrix<5>& h = result.curvature;
  h[0][2] = s[rlp];
  h[1][2] = s[rlpw];
  h[2][2] = s[rln];
  h[0][4] = -n * s[rip];
  h[1][4] = -n * s[ripw];
  h[2][4] = s[rd] / n + s[rld];
  h[4][4] = (1.0 - n) * s[rid];
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      m[i][j] = m[j][i];
      h[i][j] = h[j][i];
    }
  }
  return result;
}

}  // namespace palpate::detail
