// What a viscoelastic estimator answers, in scaled units: one candidate, fitted.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/problem.hpp"

namespace palpate::viscoelastic {

// Of F₀, k, c and m, and then of n and of the second, in nodes of the grid.
inline constexpr std::size_t unknowns = parts + 2;
enum Unknown : std::size_t { exponent_node = parts, second_node };

// The lower triangle of a symmetric matrix, row by row.
class Triangle {
 public:
  Triangle() = default;
  Triangle(const Matrix<unknowns>& full, double factor) noexcept {
    for (std::size_t i = 0, place = 0; i < unknowns; ++i) {
      for (std::size_t j = 0; j <= i; ++j, ++place) entries_[place] = factor * full[i][j];
    }
  }

  double diagonal(std::size_t i) const noexcept { return entries_[i * (i + 3) / 2]; }

  Matrix<unknowns> full() const noexcept {
    Matrix<unknowns> result{};
    for (std::size_t i = 0, place = 0; i < unknowns; ++i) {
      for (std::size_t j = 0; j <= i; ++j, ++place) {
        result[i][j] = result[j][i] = entries_[place];
      }
    }
    return result;
  }

 private:
  std::array<double, unknowns*(unknowns + 1) / 2> entries_{};
};

// A candidate with its numbers.
struct Fitted {
  std::size_t candidate = 1;
  double n = 1.0;
  Place place{};
  Vector<parts> value{};

  const Candidate& law() const noexcept { return candidates[candidate]; }
  double second() const noexcept { return second_of(law().memory, place.second); }
};

struct Solution {
  Fitted fit;
  Triangle covariance;
  std::uint32_t at_edge = 0;  // whether it is, of the range of exponents
  std::uint16_t known = 0;    // 0 before the first
  std::uint16_t given = 0;    // whether the exponent is

  const Candidate& law() const noexcept { return fit.law(); }
};

}  // namespace palpate::viscoelastic
