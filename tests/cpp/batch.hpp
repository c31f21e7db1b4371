// Weighted least squares of all rows at once, in long double: what eq. 13 must arrive at.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "palpate/matrix.hpp"

template <std::size_t Order>
class Batch {
 public:
  using Real = long double;
  using Reals = std::array<Real, Order>;

  Batch(const palpate::Vector<Order>& initial, const palpate::Vector<Order>& variances) {
    for (std::size_t i = 0; i < Order; ++i) {
      information_[i][i] = 1.0L / variances[i];
      moment_[i] = information_[i][i] * initial[i];
    }
  }

  // All that came before counts λ times as much as it did.
  void add(const palpate::Vector<Order>& regressor, double output, double forgetting_factor) {
    for (Row& row : rows_) row.weight *= forgetting_factor;
    rows_.push_back({regressor, output, 1.0L});
    for (std::size_t i = 0; i < Order; ++i) {
      for (std::size_t j = 0; j < Order; ++j) {
        information_[i][j] =
            forgetting_factor * information_[i][j] + Real{regressor[i]} * Real{regressor[j]};
      }
      moment_[i] = forgetting_factor * moment_[i] + Real{regressor[i]} * Real{output};
    }
  }

  Reals parameters() const { return solved(moment_); }

  // P, the inverse of the information.
  std::array<Reals, Order> covariance() const {
    std::array<Reals, Order> result{};
    for (std::size_t i = 0; i < Order; ++i) {
      Reals unit{};
      unit[i] = 1.0L;
      result[i] = solved(unit);
    }
    return result;
  }

  // Weighted residual sum of the data over its degrees of freedom.
  Real noise_variance() const {
    const Reals theta = parameters();
    Real residual = 0.0L;
    Real weight = 0.0L;
    for (const Row& row : rows_) {
      Real error = row.output;
      for (std::size_t i = 0; i < Order; ++i) error -= Real{row.regressor[i]} * theta[i];
      residual += row.weight * error * error;
      weight += row.weight;
    }
    return residual / (weight - Real{Order});
  }

 private:
  struct Row {
    palpate::Vector<Order> regressor;
    double output;
    Real weight;
  };

  // Gaussian elimination with the largest pivot.
  Reals solved(Reals right) const {
    auto left = information_;
    for (std::size_t k = 0; k < Order; ++k) {
      std::size_t pivot = k;
      for (std::size_t i = k + 1; i < Order; ++i) {
        if (std::abs(left[i][k]) > std::abs(left[pivot][k])) pivot = i;
      }
      std::swap(left[k], left[pivot]);
      std::swap(right[k], right[pivot]);
      for (std::size_t i = k + 1; i < Order; ++i) {
        const Real factor = left[i][k] / left[k][k];
        for (std::size_t j = k; j < Order; ++j) left[i][j] -= factor * left[k][j];
        right[i] -= factor * right[k];
      }
    }
    for (std::size_t k = Order; k-- > 0;) {
      for (std::size_t j = k + 1; j < Order; ++j) right[k] -= left[k][j] * right[j];
      right[k] /= left[k][k];
    }
    return right;
  }

  std::array<Reals, Order> information_{};
  Reals moment_{};
  std::vector<Row> rows_;
};
