// The stated cost of a curve, in scaled units, forces counting from the mean of the offset's prior:
//
//   J = Σ (F − f)² + σ² [(n − n₀)²/s_n² + (c/k − b₀)²/s_b² + F₀²/s_F²],
//
// over the samples that were chosen once, with σ² from the residual that J itself ends with: the
// answer is the point where J of its own σ² is least. See docs/curves.md.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/curves/curve_blocks.hpp"
#include "palpate/matrix.hpp"
#include "palpate/projection/covariance.hpp"

namespace palpate::detail {

// One pass over the samples of a curve: Σ r², Jᵀr, JᵀJ and Σ r ∇²f for (k, c, n, F₀, d), of
//
//   f = p (k + c w) + F₀,   p = (ξ − d)ⁿ below the surface, 0 above it.

// Of a law in scaled units, in this order: k, c, n, F₀, d.
using CurvePoint = Vector<5>;

struct CurveSamples : curves::CurveColumns {
  static constexpr std::size_t block = curves::curve_block;

  static constexpr std::size_t padded(std::size_t count) noexcept {
    return (count + block - 1) / block * block;
  }

  // What fills the last block up: it has neither force nor depth.
  void pad() const noexcept {
    for (std::size_t i = count; i < padded(count); ++i) {
      x[i] = -1e300;
      w[i] = f[i] = residual[i] = 0.0;
    }
  }
};

inline double squared_force(const CurveSamples& samples) noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < samples.count; ++i) sum += samples.f[i] * samples.f[i];
  return sum;
}

// Appends the mean of so many samples, with that of `third` in place of the force.
inline void add_mean(const CurveSamples& from, const double* third, std::size_t first,
                     std::size_t size, CurveSamples& to) noexcept {
  double x = 0.0, w = 0.0, f = 0.0;
  for (std::size_t i = first; i < first + size; ++i) {
    x += from.x[i];
    w += from.w[i];
    f += third[i];
  }
  const double share = 1.0 / static_cast<double>(size);
  to.x[to.count] = x * share;
  to.w[to.count] = w * share;
  to.f[to.count] = f * share;
  ++to.count;
}

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
  (surface ? kernels.unknown_surface : kernels.known_surface)(samples, law, s);
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

// What is added to Σ r² about a point: a constant, and a form that is linear in the distance.
struct CurveTangent {
  CurvePoint at{};
  double squares = 0.0;
  Vector<5> gradient{};  // of −½ Σ r²
};

// The samples of one cost: firm ones, and beside them the light ones where these join.
struct CurveData {
  static constexpr std::size_t most = 2;
  std::array<CurveSamples, most> parts;
  std::size_t used;
  double force_squared;    // Σ F²
  double per_point = 1.0;  // samples that a point stands for: block means stand for many
  std::array<double, most> weight{1.0, 1.0};  // of the samples of a part
  CurveTangent tangent{};

  double count() const noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < used; ++i) sum += weight[i] * static_cast<double>(parts[i].count);
    return sum;
  }
};

// What is fitted, and within which bounds.
struct CurveModel {
  ProjectionSettings settings;
  const curves::CurveKernels* kernels;
  double lowest_surface = 0.0;
  double highest_surface = 0.0;  // equal where the surface is known

  Priors priors() const noexcept { return {settings}; }
  double surface_range() const noexcept { return highest_surface - lowest_surface; }
  bool finds_surface() const noexcept { return highest_surface > lowest_surface; }
  std::array<bool, 5> open() const noexcept {
    return {true, true, !(settings.exponent > 0.0), settings.offset, finds_surface()};
  }
  std::array<double, 5> lowest() const noexcept {
    constexpr double none = -largest_parameter;
    return {none, none, settings.lowest_exponent, none, lowest_surface};
  }
  std::array<double, 5> highest() const noexcept {
    constexpr double none = largest_parameter;
    return {none, none, settings.highest_exponent, none, highest_surface};
  }
};

// The sums at a point, those of each part beside those of all.
struct CurveState {
  CurvePoint at;
  CurveSums sums;
  std::array<CurveSums, CurveData::most> part;
  double variance;  // σ² of the priors
};

class CurveCost {
 public:
  CurveCost(const CurveModel& model, const CurveData& data) noexcept : model_(model), data_(data) {}

  const CurveModel& model() const noexcept { return model_; }
  const CurveData& data() const noexcept { return data_; }

  CurveState at(const CurvePoint& point) const noexcept {
    CurveState state{point, {}, {}, 0.0};
    for (std::size_t i = 0; i < data_.used; ++i) {
      state.part[i] = curve_sums(data_.parts[i], point, model_.finds_surface(), *model_.kernels);
      state.sums.include(state.part[i], data_.weight[i]);
    }
    const CurveTangent& tangent = data_.tangent;
    state.sums.squares += tangent.squares;
    for (std::size_t i = 0; i < 5; ++i) {
      state.sums.squares -= 2.0 * tangent.gradient[i] * (point[i] - tangent.at[i]);
      state.sums.gradient[i] += tangent.gradient[i];
    }
    state.variance = variance(state.sums.squares);
    return state;
  }

  double variance(double squares) const noexcept {
    return priors().variance(data_.per_point * squares, data_.force_squared, data_.count());
  }

  // J of a point as if σ² were this.
  double value(const CurveState& state, double variance) const noexcept {
    return state.sums.squares + penalty(state.at, variance);
  }

  double penalty(const CurvePoint& z, double variance) const noexcept {
    const ProjectionSettings& s = model_.settings;
    const double away = (z[1] / stiff(z[0]) - s.prior_dissipation) / s.prior_dissipation_deviation;
    double sum = priors().exponent_penalty(z[2], variance) + variance * away * away;
    if (s.offset) sum += z[3] * z[3] * priors().offset_weight(variance);
    return sum / data_.per_point;
  }

  // ½ ∂J/∂z, and what the priors add to JᵀJ and to the curvature that Newton's method takes off.
  struct Slope {
    Vector<5> gradient;
    Matrix<5> information;
    Matrix<5> curvature;
  };

  Slope slope(const CurveState& state) const noexcept {
    const ProjectionSettings& s = model_.settings;
    const CurvePoint& z = state.at;
    const double weight = state.variance / data_.per_point;
    Slope r{{}, state.sums.information, state.sums.curvature};
    for (std::size_t i = 0; i < 5; ++i) r.gradient[i] = -state.sums.gradient[i];
    if (!priors().exponent_known()) {
      const double by_n = priors().exponent_weight(weight);
      r.gradient[2] += by_n * (z[2] - s.prior_exponent);
      r.information[2][2] += by_n;
    }
    const double by_b = weight / (s.prior_dissipation_deviation * s.prior_dissipation_deviation);
    const double k = stiff(z[0]), b = z[1] / k, off = b - s.prior_dissipation;
    const Vector<2> u{-b / k, 1.0 / k};
    for (std::size_t i = 0; i < 2; ++i) {
      r.gradient[i] += by_b * off * u[i];
      for (std::size_t j = 0; j < 2; ++j) r.information[i][j] += by_b * u[i] * u[j];
    }
    r.curvature[0][0] -= by_b * off * 2.0 * b / (k * k);
    r.curvature[0][1] += by_b * off / (k * k);
    r.curvature[1][0] += by_b * off / (k * k);
    if (s.offset) {
      const double by_offset = priors().offset_weight(state.variance) / data_.per_point;
      r.gradient[3] += by_offset * z[3];
      r.information[3][3] += by_offset;
    }
    return r;
  }

 private:
  // A stiffness that is not there does not divide.
  static double stiff(double k) noexcept {
    constexpr double least = 1e-30;
    return k < 0.0 ? std::min(k, -least) : std::max(k, least);
  }

  Priors priors() const noexcept { return model_.priors(); }

  const CurveModel& model_;
  const CurveData& data_;
};

}  // namespace palpate::detail
