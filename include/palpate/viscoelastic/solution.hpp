// What a viscoelastic estimator answers, in scaled units: one candidate, fitted.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/linear.hpp"
#include "palpate/viscoelastic/search.hpp"

namespace palpate::viscoelastic {

// Of k, c, m and F₀, and then of n and of the second, in nodes of the grid.
inline constexpr std::size_t unknowns = parts + 2;
enum Unknown : std::size_t { exponent_node = parts, second_node };

struct Solution {
  std::size_t candidate = 1;
  double n = 1.0;
  Place place{};
  Vector<parts> value{};
  Matrix<unknowns> covariance{};
  double variance = 0.0;      // σ² of the force
  double weight = 0.0;        // samples that it is of
  std::uint64_t at_edge = 0;  // whether it is, of the range of exponents
  std::uint64_t known = 0;    // 0 before the first
  std::uint64_t given = 0;    // whether the exponent is

  const Candidate& law() const noexcept { return candidates[candidate]; }
};

// The covariance of all unknowns at a minimum:
//
//   Var(n, s) = 2 σ² H⁻¹ of J with the linear part projected out,
//   Var(k, c, m, F₀) = σ² A⁻¹ + D Var(n, s) Dᵀ,   D = ∂(k, c, m, F₀)/∂(n, s),
//
// H and D by differences over about a standard error, where J has risen by σ².
template <class Sums>
class Curvature {
 public:
  Curvature(const Samples<Sums>& samples, const Candidate& law, const Priors& priors,
            const Point& minimum, double stiffness_before, double variance) noexcept
      : samples_(samples),
        law_(law),
        priors_(priors),
        minimum_(minimum),
        stiffness_before_(stiffness_before),
        variance_(variance) {
    measure();
  }

  Matrix<unknowns> covariance() const noexcept {
    const Normal normal =
        normal_with_priors(samples_, law_, priors_, minimum_.place, stiffness_before_);
    const PartSet wanted = parts_of(law_, priors_.offset != 0);
    const Factored factored(normal, wanted);
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
      if (has(wanted, part) && !has(factored.fitted(), part)) {
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
    if (axis == 1) return law_.searches_memory();
    return !law_.linear && !(priors_.exponent > 0.0);
  }

  Point at(double along, double across) const noexcept {
    return point_at(samples_, law_, priors_,
                    {centre_.exponent + along * step_[0], centre_.second + across * step_[1]},
                    stiffness_before_);
  }

  void measure() noexcept {
    centre_ = minimum_.place;
    const double last = static_cast<double>(Grid::exponents - 1);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (!searches(axis)) continue;
      const double curvature = curvature_along(axis);
      if (curvature > 0.0) {
        step_[axis] = std::clamp(step_[axis] * std::sqrt(2.0 * variance_ / curvature), least, most);
      }
    }
    centre_.exponent = std::clamp(centre_.exponent, step_[0], last - step_[0]);
    const Point middle = at(0.0, 0.0);
    Matrix<2> h{};
    double sides = 0.0;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (!searches(axis)) continue;
      const Point below = axis == 0 ? at(-1.0, 0.0) : at(0.0, -1.0);
      const Point above = axis == 0 ? at(1.0, 0.0) : at(0.0, 1.0);
      h[axis][axis] = above.cost - 2.0 * middle.cost + below.cost;
      sides += above.cost + below.cost;
      // A part that a bound holds on one side only has the slope of the other.
      for (std::size_t i = 0; i < parts; ++i) {
        slope_[axis][i] = (above.linear.value[i] - below.linear.value[i]) / (2.0 * step_[axis]);
      }
    }
    if (searches(0) && searches(1)) {
      h[0][1] = h[1][0] =
          0.5 * (at(1.0, 1.0).cost + at(-1.0, -1.0).cost - sides + 2.0 * middle.cost);
    }
    spread(h);
  }

  double curvature_along(std::size_t axis) const noexcept {
    const Point below = axis == 0 ? at(-1.0, 0.0) : at(0.0, -1.0);
    const Point above = axis == 0 ? at(1.0, 0.0) : at(0.0, 1.0);
    return above.cost - 2.0 * at(0.0, 0.0).cost + below.cost;
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

  const Samples<Sums>& samples_;
  const Candidate& law_;
  const Priors& priors_;
  const Point& minimum_;
  double stiffness_before_;
  double variance_;
  Place centre_{};
  std::array<double, 2> step_{0.125, 0.125};
  std::array<Vector<parts>, 2> slope_{};
  Matrix<2> spread_{};
};

}  // namespace palpate::viscoelastic
