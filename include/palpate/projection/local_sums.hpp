// The sums of variable projection near one exponent n₀, as polynomials in n − n₀: what a row of
// answers close to each other needs of them. Samples are added to the polynomials themselves, since
// the derivatives of ξⁿ by n are ξⁿ (ln ξ)ᵈ.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"
#include "palpate/projection/lagrange.hpp"
#include "palpate/projection/power_sums.hpp"
#include "palpate/sample.hpp"

namespace palpate::detail {

// Terms of a polynomial. With five, up to |n − n₀| = 0.02, slopes are off by δ⁴/24 = 7e-9 of what
// their fourth derivatives are of them.
inline constexpr std::size_t local_terms = 5;

// [d][i]: of (t − t₀)ᵈ in the basis polynomial of point i, on a grid of steps of one.
using LocalWeights = std::array<Vector<lagrange_points>, local_terms>;

constexpr LocalWeights local_weights(double t) noexcept {
  const double u = t - lagrange_middle;
  LocalWeights weights{};
  for (std::size_t k = lagrange_points; k-- > 0;) {
    for (std::size_t d = local_terms; d-- > 1;) {
      for (std::size_t i = 0; i < lagrange_points; ++i) {
        weights[d][i] = weights[d][i] * u + weights[d - 1][i];
      }
    }
    for (std::size_t i = 0; i < lagrange_points; ++i) {
      weights[0][i] = weights[0][i] * u + lagrange_coefficients[k][i];
    }
  }
  return weights;
}

// For values that grow by about e^rate a step, as `rescaled` in lagrange.hpp.
inline LocalWeights local_rescaled(const LocalWeights& level, double t, double rate) noexcept {
  Vector<local_terms> power{1.0};  // of e^(rate (t − t₀))
  for (std::size_t d = 1; d < local_terms; ++d)
    power[d] = power[d - 1] * rate / static_cast<double>(d);
  LocalWeights weights{};
  double growth = std::exp(rate * t);
  const double back = std::exp(-rate);
  for (std::size_t i = 0; i < lagrange_points; ++i) {
    for (std::size_t d = 0; d < local_terms; ++d) {
      double sum = 0.0;
      for (std::size_t j = 0; j <= d; ++j) sum += level[j][i] * power[d - j];
      weights[d][i] = sum * growth;
    }
    growth *= back;
  }
  return weights;
}

class LocalSums {
 public:
  // One more than there are sums, for the sake of whole vectors.
  static constexpr std::size_t width = 8;

  LocalSums() = default;

  LocalSums(const PowerSums& sums, double exponent) noexcept : exponent_(exponent) {
    const auto [first, t] = sums.place(exponent);
    const double rate = sums.growth_rate(first);
    LocalWeights single = local_weights(t), square = single;
    if (rate != 0.0) {
      square = local_rescaled(single, t, 2.0 * rate);
      single = local_rescaled(single, t, rate);
    }
    double scale = 1.0;
    for (std::size_t d = 0; d < local_terms; ++d, scale /= sums.step()) {
      for (std::size_t power = 0; power < power_count; ++power) {
        const Vector<lagrange_points>& w = power < 3 ? square[d] : single[d];
        const double* column = &sums.column(static_cast<Power>(power))[first];
        double sum = 0.0;
        for (std::size_t i = 0; i < lagrange_points; ++i) sum += w[i] * column[i];
        terms_[d][power] = sum * scale;
      }
    }
  }

  double exponent() const noexcept { return exponent_; }
  double term(std::size_t degree, std::size_t power) const noexcept {
    return terms_[degree][power];
  }

  // Adds a sample in scaled units, `depth` being ln ξ and `power` ξ^n₀.
  void add(const Sample& s, double depth, double power) noexcept {
    const double w = s.velocity, square = power * power;
    std::array<double, width> term{square,    square * w,      square * (w * w),      power,
                                   power * w, power * s.force, power * (w * s.force), 0.0};
    const double twice = 2.0 * depth;
    const std::array<double, width> factor{twice, twice, twice, depth, depth, depth, depth, 0.0};
    for (std::size_t j = 0; j < width; ++j) terms_[0][j] += term[j];
    for (std::size_t d = 1; d < local_terms; ++d) {
      const double per_degree = 1.0 / static_cast<double>(d);
      for (std::size_t j = 0; j < width; ++j) {
        term[j] *= factor[j] * per_degree;
        terms_[d][j] += term[j];
      }
    }
  }

 private:
  double exponent_ = 0.0;
  alignas(64) std::array<std::array<double, width>, local_terms> terms_{};
};

}  // namespace palpate::detail
