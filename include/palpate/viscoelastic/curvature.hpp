// How well a minimum is known: the covariance of all unknowns there,
//
//   Var(n, s) = 2 σ² H⁻¹ of J with the linear part projected out,
//   Var(k, c, m, F₀) = σ² A⁻¹ + D Var(n, s) Dᵀ,   D = ∂(k, c, m, F₀)/∂(n, s),
//
// H and D by differences over about a standard error, where J has risen by σ².
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"
#include "palpate/viscoelastic/problem.hpp"
#include "palpate/viscoelastic/solution.hpp"

namespace palpate::viscoelastic {

template <class Sums>
class Curvature {
 public:
  // `about` is what a search saw of the curvature, per node; 0 where it saw nothing.
  Curvature(const Problem<Sums>& problem, const Point& minimum, double variance,
            const Place& about) noexcept
      : problem_(problem), minimum_(minimum), variance_(variance), centre_(minimum.place) {
    choose_step(0, about.exponent);
    choose_step(1, about.second);
    measure();
  }

  // From the normal equations at the minimum.
  Matrix<unknowns> covariance(const Normal& normal) const noexcept {
    const Factored factored(normal, problem_.wanted());
    const Matrix<parts> inverse = factored.inverse();
    Matrix<unknowns> result{};
    for (std::size_t i = 0; i < parts; ++i) {
      for (std::size_t j = 0; j < parts; ++j) {
        double sum = variance_ * inverse[i][j];
        for (std::size_t a = 0; a < 2; ++a) {
          for (std::size_t b = 0; b < 2; ++b) sum += slope_[a][i] * spread_[a][b] * slope_[b][j];
        }
        result[i][j] = sum;
      }
      for (std::size_t a = 0; a < 2; ++a) {
        const double sum = spread_[a][0] * slope_[0][i] + spread_[a][1] * slope_[1][i];
        result[i][parts + a] = result[parts + a][i] = sum;
      }
      // Nothing is known of a part that says what others do.
      const Part part = static_cast<Part>(i);
      if (has(problem_.wanted(), part) && !has(factored.fitted(), part)) {
        const double size = part == offset ? 1.0 : std::abs(minimum_.linear.value[stiffness]) + 1.0;
        result[i][i] = size * size;
      }
    }
    for (std::size_t a = 0; a < 2; ++a) {
      for (std::size_t b = 0; b < 2; ++b) result[parts + a][parts + b] = spread_[a][b];
    }
    return result;
  }

 private:
  bool searches(std::size_t axis) const noexcept {
    return axis == 1 ? problem_.searches_memory() : problem_.searches_exponent();
  }

  Point at(double along, double across) const noexcept {
    if (along == 0.0 && across == 0.0 && centre_ == minimum_.place) return minimum_;
    return problem_.at({centre_.exponent + along * step_[0], centre_.second + across * step_[1]});
  }

  // Steps along an axis, back and on.
  std::array<Point, 2> sides(std::size_t axis) const noexcept {
    return {axis == 0 ? at(-1.0, 0.0) : at(0.0, -1.0), axis == 0 ? at(1.0, 0.0) : at(0.0, 1.0)};
  }

  // About a standard error.
  void choose_step(std::size_t axis, double curvature) noexcept {
    if (!searches(axis)) return;
    if (!(curvature > 0.0)) {
      const auto [below, above] = sides(axis);
      curvature = (above.cost - 2.0 * minimum_.cost + below.cost) / (step_[axis] * step_[axis]);
    }
    if (curvature > 0.0) {
      step_[axis] = std::clamp(std::sqrt(2.0 * variance_ / curvature), least, most);
    }
  }

  void measure() noexcept {
    const double last = static_cast<double>(Grid::exponents - 1);
    if (searches(0)) centre_.exponent = std::clamp(centre_.exponent, step_[0], last - step_[0]);
    const double middle = at(0.0, 0.0).cost;
    Matrix<2> h{};
    double around = 0.0;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (!searches(axis)) continue;
      const auto [below, above] = sides(axis);
      h[axis][axis] = above.cost - 2.0 * middle + below.cost;
      around += above.cost + below.cost;
      // A part that a bound holds on one side only has the slope of the other.
      for (std::size_t i = 0; i < parts; ++i) {
        slope_[axis][i] = (above.linear.value[i] - below.linear.value[i]) / (2.0 * step_[axis]);
      }
    }
    if (searches(0) && searches(1)) {
      h[0][1] = h[1][0] = 0.5 * (at(1.0, 1.0).cost + at(-1.0, -1.0).cost - around + 2.0 * middle);
    }
    spread(h);
  }

  // 2σ²H⁻¹ per node, and what is not seen at all as wide as its range.
  void spread(const Matrix<2>& h) noexcept {
    const double widest = 16.0;  // (1/0.25)² nodes: n ~ N(1.3, 1)
    const double determinant = h[0][0] * h[1][1] - h[0][1] * h[0][1];
    if (searches(0) && searches(1) && h[0][0] > 0.0 && determinant > 1e-9 * h[0][0] * h[1][1]) {
      const double factor = 2.0 * variance_ / determinant;
      spread_[0][0] = factor * h[1][1] * step_[0] * step_[0];
      spread_[1][1] = factor * h[0][0] * step_[1] * step_[1];
      spread_[0][1] = spread_[1][0] = -factor * h[0][1] * step_[0] * step_[1];
    } else {
      for (std::size_t axis = 0; axis < 2; ++axis) {
        if (!searches(axis)) continue;
        spread_[axis][axis] = h[axis][axis] > 0.0
                                  ? 2.0 * variance_ / h[axis][axis] * step_[axis] * step_[axis]
                                  : widest;
      }
    }
    detail::bound_variances(spread_, widest);
  }

  static constexpr double least = 1.0 / 64.0;
  static constexpr double most = 0.5;

  const Problem<Sums>& problem_;
  const Point& minimum_;
  double variance_;
  Place centre_{};
  std::array<double, 2> step_{0.125, 0.125};
  std::array<Vector<parts>, 2> slope_{};
  Matrix<2> spread_{};
};

}  // namespace palpate::viscoelastic
