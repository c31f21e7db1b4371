// Vectors and symmetric matrices whose size is fixed at compile time: no heap, trivially copyable.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "palpate/language.hpp"

namespace palpate {

template <std::size_t Size>
using Vector = std::array<double, Size>;

template <std::size_t Size>
using Matrix = std::array<std::array<double, Size>, Size>;

template <std::size_t Size>
constexpr Matrix<Size> diagonal(const Vector<Size>& values) noexcept {
  Matrix<Size> matrix{};
  for (std::size_t i = 0; i < Size; ++i) matrix[i][i] = values[i];
  return matrix;
}

namespace detail {

// √(a² + b²), the standard deviation of a sum, without overflow of the squares. std::hypot would
// tie a wheel to glibc 2.35, and is exact to the last bit, which a standard deviation does not
// need.
inline double combined(double a, double b) noexcept {
  const double large = std::max(std::abs(a), std::abs(b));
  if (!(large > 0.0) || std::isinf(large)) return large;
  return large * std::sqrt((a / large) * (a / large) + (b / large) * (b / large));
}

template <std::size_t Size>
constexpr double dot(const Vector<Size>& a, const Vector<Size>& b) noexcept {
  double sum = a[0] * b[0];
  for (std::size_t i = 1; i < Size; ++i) sum += a[i] * b[i];
  return sum;
}

template <std::size_t Size>
constexpr Vector<Size> multiply(const Matrix<Size>& matrix, const Vector<Size>& vector) noexcept {
  Vector<Size> product{};
  for (std::size_t i = 0; i < Size; ++i) product[i] = dot(matrix[i], vector);
  return product;
}

// Elimination in floating point is exact for a matrix whose entries differ by a few ε of the
// diagonal. If the matrix minus this fraction of its diagonal is positive definite, the stored one
// is too (Rump, BIT 46, 2006).
template <std::size_t Size>
inline constexpr double definiteness_margin =
    8.0 * static_cast<double>(Size * Size) * std::numeric_limits<double>::epsilon();

// True when the symmetric matrix is provably positive definite. Entries must lie within 1e±70, so
// that the products below neither overflow nor vanish. NaN fails.
template <std::size_t Size>
constexpr bool is_positive_definite(const Matrix<Size>& m) noexcept {
  constexpr double kept = 1.0 - definiteness_margin<Size>;
  if constexpr (Size == 1) {
    return m[0][0] > 0.0;
  } else if constexpr (Size <= 3) {
    // Leading minors, without a division: this runs once a sample.
    const double first = kept * m[0][0];
    const double minor = first * (kept * m[1][1]) - m[0][1] * m[0][1];
    if (!(first > 0.0 && minor > 0.0)) return false;
    if constexpr (Size == 2) return true;
    const double across = first * m[1][2] - m[0][1] * m[0][2];
    const double last = first * (kept * m[2][2]) - m[0][2] * m[0][2];
    return minor * last > across * across;
  } else {
    Matrix<Size> reduced = m;  // LDLᵀ
    for (std::size_t k = 0; k < Size; ++k) reduced[k][k] *= kept;
    for (std::size_t k = 0; k < Size; ++k) {
      const double pivot = reduced[k][k];
      if (!(pivot > 0.0)) return false;
      for (std::size_t i = k + 1; i < Size; ++i) {
        const double ratio = reduced[k][i] / pivot;
        for (std::size_t j = i; j < Size; ++j) reduced[i][j] -= ratio * reduced[k][j];
      }
    }
    return true;
  }
}

// Inverse of a positive definite matrix, a column at a time by Gauss–Jordan (no pivoting needed).
template <std::size_t Size>
constexpr Matrix<Size> inverse(Matrix<Size> matrix) noexcept {
  Matrix<Size> result = diagonal(Vector<Size>{});
  for (std::size_t i = 0; i < Size; ++i) result[i][i] = 1.0;
  for (std::size_t k = 0; k < Size; ++k) {
    const double pivot = matrix[k][k];
    for (std::size_t j = 0; j < Size; ++j) {
      matrix[k][j] /= pivot;
      result[k][j] /= pivot;
    }
    for (std::size_t i = 0; i < Size; ++i) {
      if (i == k) continue;
      const double factor = matrix[i][k];
      for (std::size_t j = 0; j < Size; ++j) {
        matrix[i][j] -= factor * matrix[k][j];
        result[i][j] -= factor * result[k][j];
      }
    }
  }
  return result;
}

template <std::size_t Size>
struct InverseRoot {
  Matrix<Size> root;               // R Rᵀ is the inverse
  std::array<bool, Size> guarded;  // pivots lost to rounding
};

// The inverse of a symmetric, positive semidefinite information matrix by LDLᵀ. A pivot lost to
// rounding carries no information from the samples and is replaced by `prior` (> 0), the
// information without them.
template <std::size_t Size>
InverseRoot<Size> guarded_inverse_root(const Matrix<Size>& matrix,
                                       const Vector<Size>& prior) noexcept {
  InverseRoot<Size> result{};
  Matrix<Size> lower{};
  Vector<Size> pivots{}, reciprocals{};
  for (std::size_t j = 0; j < Size; ++j) {
    double pivot = matrix[j][j];
    for (std::size_t k = 0; k < j; ++k) pivot -= lower[j][k] * lower[j][k] * pivots[k];
    result.guarded[j] = !(pivot > definiteness_margin<Size> * matrix[j][j]);
    pivots[j] = result.guarded[j] ? prior[j] : std::max(pivot, prior[j]);
    reciprocals[j] = 1.0 / pivots[j];
    for (std::size_t i = j + 1; i < Size; ++i) {
      double entry = matrix[i][j];
      for (std::size_t k = 0; k < j; ++k) entry -= lower[i][k] * lower[j][k] * pivots[k];
      lower[i][j] = entry * reciprocals[j];
    }
  }
  // Columns of L⁻¹, then L⁻ᵀ D^(−1/2).
  Matrix<Size> left{};
  for (std::size_t j = 0; j < Size; ++j) {
    left[j][j] = 1.0;
    for (std::size_t i = j + 1; i < Size; ++i) {
      for (std::size_t k = j; k < i; ++k) left[i][j] -= lower[i][k] * left[k][j];
    }
  }
  for (std::size_t k = 0; k < Size; ++k) {
    const double scale = std::sqrt(reciprocals[k]);
    for (std::size_t i = 0; i <= k; ++i) result.root[i][k] = left[k][i] * scale;
  }
  return result;
}

template <std::size_t Size>
constexpr Matrix<Size> multiply(const Matrix<Size>& a, const Matrix<Size>& b) noexcept {
  Matrix<Size> product{};
  for (std::size_t i = 0; i < Size; ++i) {
    for (std::size_t k = 0; k < Size; ++k) {
      for (std::size_t j = 0; j < Size; ++j) product[i][j] += a[i][k] * b[k][j];
    }
  }
  return product;
}

template <std::size_t Size>
constexpr Matrix<Size> multiply(Matrix<Size> matrix, double factor) noexcept {
  for (auto& row : matrix) {
    for (double& entry : row) entry *= factor;
  }
  return matrix;
}

// R Rᵀ: positive semidefinite up to rounding, and exactly symmetric.
template <std::size_t Rows, std::size_t Size>
constexpr Matrix<Rows> squared(const std::array<Vector<Size>, Rows>& root) noexcept {
  Matrix<Rows> result{};
  for (std::size_t i = 0; i < Rows; ++i) {
    for (std::size_t j = i; j < Rows; ++j) result[i][j] = result[j][i] = dot(root[i], root[j]);
  }
  return result;
}

// The lower triangle L of a positive semidefinite matrix L Lᵀ; an empty row gives an empty column.
template <std::size_t Size>
Matrix<Size> cholesky(const Matrix<Size>& m) noexcept {
  Matrix<Size> lower{};
  for (std::size_t j = 0; j < Size; ++j) {
    const double pivot = m[j][j] - dot(lower[j], lower[j]);
    if (!(pivot > 0.0)) continue;
    lower[j][j] = std::sqrt(pivot);
    for (std::size_t i = j + 1; i < Size; ++i) {
      lower[i][j] = (m[i][j] - dot(lower[i], lower[j])) / lower[j][j];
    }
  }
  return lower;
}

// J S Jᵀ for S = R Rᵀ, as (J R)(J R)ᵀ, which is always symmetric and semidefinite.
template <std::size_t Size>
constexpr Matrix<Size> congruence(const Matrix<Size>& jacobian, const Matrix<Size>& root) noexcept {
  return squared(multiply(jacobian, root));
}

// Sets variances above `limit` to it, and makes them independent of the others.
template <std::size_t Size>
constexpr void bound_variances(Matrix<Size>& covariance, double limit) noexcept {
  for (std::size_t i = 0; i < Size; ++i) {
    if (covariance[i][i] < limit) continue;  // false for NaN too
    for (std::size_t j = 0; j < Size; ++j) covariance[i][j] = covariance[j][i] = 0.0;
    covariance[i][i] = limit;
  }
}

// The diagonal of J S Jᵀ.
template <std::size_t Size>
constexpr Vector<Size> congruent_diagonal(const Matrix<Size>& jacobian,
                                          const Matrix<Size>& s) noexcept {
  Vector<Size> result{};
  for (std::size_t i = 0; i < Size; ++i) result[i] = dot(jacobian[i], multiply(s, jacobian[i]));
  return result;
}

}  // namespace detail
}  // namespace palpate
