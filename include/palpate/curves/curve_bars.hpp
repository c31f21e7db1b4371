// Error bars of a curve's fit: those of variable projection (covariance.hpp, error_widening.hpp),
// from the final residuals.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/curves/curve_cost.hpp"
#include "palpate/error_widening.hpp"
#include "palpate/estimate.hpp"
#include "palpate/haar_levels.hpp"
#include "palpate/matrix.hpp"

namespace palpate::detail {

// Slopes and residuals by how quickly they change, of a whole contact at once; `columns` are (ξ,
// ξw, ξ ln ξ, r) in the order of time, and are overwritten. The slope of F₀, one, is the same at
// all speeds but the slowest.
inline HaarLevels<4> haar_levels(const std::array<double*, 4>& columns,
                                 std::size_t samples) noexcept {
  HaarLevels<4> levels;
  double length = 1.0;
  std::size_t count = samples;
  for (std::size_t k = 0; k < HaarLevels<4>::most && count > 0; ++k, length *= 2.0) {
    HaarLevel<4>& level = levels[k];
    const std::size_t pairs = count / 2;
    const double per_pair = 0.5 / length;
    const auto [a, b, c, r] = columns;
    std::array<std::array<double, 2>, 7> sums{};  // two of each, for two additions at once
    const auto pair = [&](std::size_t i, std::size_t lane) noexcept {
      const double da = a[2 * i] - a[2 * i + 1], db = b[2 * i] - b[2 * i + 1];
      const double dc = c[2 * i] - c[2 * i + 1], dr = r[2 * i] - r[2 * i + 1];
      a[i] = a[2 * i] + a[2 * i + 1];
      b[i] = b[2 * i] + b[2 * i + 1];
      c[i] = c[2 * i] + c[2 * i + 1];
      r[i] = r[2 * i] + r[2 * i + 1];
      sums[0][lane] += da * da;
      sums[1][lane] += da * db;
      sums[2][lane] += da * dc;
      sums[3][lane] += db * db;
      sums[4][lane] += db * dc;
      sums[5][lane] += dc * dc;
      sums[6][lane] += dr * dr;
    };
    if (count % 2 == 1) {
      const std::size_t last = count - 1;
      levels.wait(k);
      level.half = {a[last], b[last], c[last], length};
      level.half_residual = r[last];
    }
    std::size_t i = 0;
    for (; i + 1 < pairs; i += 2) {
      pair(i, 0);
      pair(i + 1, 1);
    }
    if (i < pairs) pair(i, 0);
    const auto sum = [&](std::size_t j) noexcept { return (sums[j][0] + sums[j][1]) * per_pair; };
    level.information[0] = {sum(0), sum(1), sum(2), 0.0};
    level.information[1] = {0.0, sum(3), sum(4), 0.0};
    level.information[2] = {0.0, 0.0, sum(5), 0.0};
    level.older = level.newer = sum(6);
    level.older_pairs = level.newer_pairs = static_cast<double>(pairs);
    count = pairs;
  }
  return levels;
}

struct CurveBars {
  Matrix<5> root{};  // of the covariance that is printed, in scaled units
  double noise_variance = 0.0;
  std::uint8_t flags = 0;
};

class CurveErrors {
 public:
  // `state` is where the answer is, `residual` of the firm samples there; `log_penetration` of the
  // unit.
  CurveErrors(const CurveCost& cost, const CurveState& state) noexcept
      : cost_(cost), model_(cost.model()), state_(state) {
    noise_variance_ = by_residual();
    variance_ = std::max(noise_variance_, least_variance());
  }

  double noise_variance() const noexcept { return noise_variance_; }

  CurveBars bars(const std::array<double*, 4>& columns, std::size_t firm, double log_penetration,
                 double depth_spread) const noexcept {
    const InverseRoot<5> white = covariance_root();
    CurveBars result;
    result.noise_variance = noise_variance_;
    result.root = widened(white.root, haar_levels(columns, firm), log_penetration);
    result.flags = flags(result.root, white.guarded, depth_spread);
    return result;
  }

 private:
  // From the residual, once ten degrees of freedom tell it to a quarter or so (1/√20).
  double by_residual() const noexcept {
    const std::array<bool, 5> open = model_.open();
    const double fitted = static_cast<double>(std::count(open.begin(), open.end(), true));
    const double freedom = cost_.data().count() - fitted;
    if (model_.settings.noise != 0.0 || freedom < 10.0) return state_.variance;
    const double rounding = 1e-30 * cost_.data().force_squared;
    return std::max(state_.sums.squares, rounding) / freedom;
  }

  // No force sensor is better than a hundred-thousandth; without any force, one unit.
  double least_variance() const noexcept {
    if (!(cost_.data().force_squared > 0.0)) return 1.0;
    return 1e-10 * cost_.data().force_squared / cost_.data().count();
  }

  // What the priors add to the diagonal of JᵀJ.
  Vector<5> priors() const noexcept {
    const ProjectionSettings& s = model_.settings;
    const double k = state_.at[0], by_damping = s.prior_dissipation_deviation * k;
    const double width = model_.highest_surface - model_.lowest_surface;
    constexpr double unknown_stiffness = 1e-12;  // as in covariance.hpp
    return {unknown_stiffness * variance_,
            std::min(variance_ / (by_damping * by_damping + tiny), largest_parameter),
            variance_ / (s.prior_exponent_deviation * s.prior_exponent_deviation),
            cost_.offset_weight(variance_),
            model_.finds_surface() ? variance_ / (width * width) : 1.0};
  }

  InverseRoot<5> covariance_root() const noexcept {
    Matrix<5> m = state_.sums.information;
    Vector<5> prior = priors();
    const double ratio = model_.settings.prior_dissipation, weight = prior[1];
    m[0][0] += weight * ratio * ratio;
    m[0][1] = m[1][0] = m[0][1] - weight * ratio;
    m[1][1] += weight;
    const std::array<bool, 5> open = model_.open();
    for (std::size_t i = 2; i < 5; ++i) {
      m[i][i] += prior[i];
      for (std::size_t j = 0; j < 5; ++j) {
        if (!open[i] && i != j) m[i][j] = m[j][i] = 0.0;
      }
    }
    Vector<5> unit{};
    for (std::size_t i = 0; i < 5; ++i) {
      unit[i] = m[i][i] > 0.0 ? 1.0 / std::sqrt(m[i][i]) : 1.0;
      prior[i] = std::max(prior[i] * unit[i] * unit[i], tiny);
    }
    for (std::size_t i = 0; i < 5; ++i) {
      for (std::size_t j = 0; j < 5; ++j) m[i][j] = m[i][j] * unit[i] * unit[j];
    }
    InverseRoot<5> inverse = guarded_inverse_root(m, prior);
    const double deviation = std::sqrt(variance_);
    for (std::size_t i = 0; i < 5; ++i) {
      for (double& entry : inverse.root[i]) entry = saturate(entry * (unit[i] * deviation));
      if (!open[i]) inverse.root[i] = {};
    }
    return inverse;
  }

  // What priors weigh over what samples do; a parameter that is not fitted is known.
  Vector<4> prior_fractions() const noexcept {
    const Vector<5> prior = priors();
    const std::array<bool, 5> open = model_.open();
    Vector<4> result{};
    for (std::size_t i = 1; i < 4; ++i) {
      const double data = state_.sums.information[i][i];
      result[i] = open[i] ? std::clamp(prior[i] / (data + tiny), 0.0, largest_parameter)
                          : largest_parameter;
    }
    return result;
  }

  Matrix<5> widened(const Matrix<5>& white, const HaarLevels<4>& levels,
                    double log_penetration) const noexcept {
    const double k = state_.at[0], c = state_.at[1];
    std::array<Vector<4>, 3> rows{};
    for (std::size_t j = 0; j < 4; ++j) {
      rows[0][j] = white[0][j] - k * log_penetration * white[2][j];
      rows[1][j] = white[1][j] - c * log_penetration * white[2][j];
      rows[2][j] = white[2][j];
    }
    const Matrix<4> by =
        ErrorWidening<4, 3>(levels, prior_fractions(), variance_, true).root(rows);
    Matrix<5> whole{};
    double widest = 1.0;
    for (std::size_t i = 0; i < 4; ++i) {
      std::copy_n(by[i].begin(), 4, whole[i].begin());
      widest = std::max(widest, dot(by[i], by[i]));
    }
    whole[4][4] = std::sqrt(widest);
    return multiply(white, whole);
  }

  // As VariableProjectionMethod::flags.
  std::uint8_t flags(const Matrix<5>& root, const std::array<bool, 5>& guarded,
                     double depth_spread) const noexcept {
    constexpr double largest_exponent_error = 0.2, largest_damping_error = 0.25;
    constexpr double smallest_spread = 1e-4;
    const ProjectionSettings& s = model_.settings;
    const double n = state_.at[2];
    std::uint8_t found = 0;
    if (!model_.exponent_fixed) {
      const double margin = 0.25 * (s.highest_exponent - s.lowest_exponent) /
                            static_cast<double>(PowerSums::nodes - 1);
      if (n < s.lowest_exponent + margin || n > s.highest_exponent - margin) {
        found |= exponent_at_edge;
      }
      const bool identifiable = !guarded[2] && !guarded[3] && depth_spread > smallest_spread;
      if (!(std::sqrt(dot(root[2], root[2])) < largest_exponent_error) || !identifiable) {
        found |= exponent_not_identifiable;
      }
    }
    const double damping = std::sqrt(dot(root[1], root[1]));
    if (!(damping < largest_damping_error * std::abs(state_.at[0])) || guarded[1]) {
      found |= damping_not_identifiable;
    }
    if (model_.finds_surface()) {
      // Within half of a candidate's step of the recursion.
      const double margin = (model_.highest_surface - model_.lowest_surface) / 80.0;
      if (state_.at[4] < model_.lowest_surface + margin ||
          state_.at[4] > model_.highest_surface - margin) {
        found |= surface_at_edge;
      }
    }
    return found;
  }

  const CurveCost& cost_;
  const CurveModel& model_;
  const CurveState& state_;
  double noise_variance_ = 0.0;
  double variance_ = 0.0;
};

}  // namespace palpate::detail
