// The cost of a curve about one point by fewer samples: those near the surface one by one, since
// each that the surface passes is a kink of J, and means of the others.
//
// A mean stands where the law has the same mean residual at that point, and what means leave of J
// and of its slope there is added as a linear form: so J and its slope are the whole curve's at the
// point, and within two standard errors of it J is so to a thousandth of σ² mostly, to a tenth in
// 99 of 100 descents where the surface is known worst.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/curves/curve_cost.hpp"

namespace palpate::detail {

class CondensedCurve {
 public:
  // `at` is a state of the cost over all samples, whose residuals are in the arrays of `data`;
  // `reach` how far the surface may go from it, and `memory` is as large as those arrays.
  CondensedCurve(const CurveModel& model, const CurveData& data, const CurveState& at, double reach,
                 const CurveSamples& memory) noexcept
      : data_(data) {
    const CurveSamples& from = data.parts[0];
    const double surface = at.at[4];
    const auto mean = [&](std::size_t first) noexcept {
      return condenses(from, first, surface, reach);
    };
    std::size_t means = 0;
    for (std::size_t i = 0; i + length <= from.count; i += length) means += mean(i) ? 1 : 0;
    const std::size_t start = CurveSamples::padded(from.count - length * means);
    CurveSamples near = memory, far{memory.x + start,   memory.w + start,        memory.f + start,
                                    memory.log + start, memory.residual + start, 0};
    near.count = 0;
    for (std::size_t i = 0; i < from.count; i += length) {
      if (i + length <= from.count && mean(i)) {
        add_mean(from, i, far);
      } else {
        add_all(from, i, near);
      }
    }
    near.pad();
    far.pad();
    force_as_residual(model, at.at, far);
    data_.parts = {near, far};
    data_.used = 2;
    data_.weight = {1.0, static_cast<double>(length)};
    const CurveState rough = CurveCost(model, data_).at(at.at);
    data_.tangent.at = at.at;
    data_.tangent.squares = at.sums.squares - rough.sums.squares;
    for (std::size_t i = 0; i < 5; ++i) {
      data_.tangent.gradient[i] = at.sums.gradient[i] - rough.sums.gradient[i];
    }
  }

  const CurveData& data() const noexcept { return data_; }

 private:
  // Samples of a mean. (Of 2000 one-way curves two lost their minimum with 16, and none with 8.)
  static constexpr std::size_t length = 8;

  // Samples that stay above the surface, or so far below it that xⁿ hardly bends among them.
  static bool condenses(const CurveSamples& from, std::size_t first, double surface,
                        double reach) noexcept {
    double low = from.x[first], high = low;
    for (std::size_t i = first + 1; i < first + length; ++i) {
      low = std::min(low, from.x[i]);
      high = std::max(high, from.x[i]);
    }
    constexpr double least = 4.0;  // of depth, in spreads: (1 + 1/8)ⁿ still bends little
    return high < surface - reach || low - (surface + reach) > least * (high - low);
  }

  // With the mean residual in place of the force.
  static void add_mean(const CurveSamples& from, std::size_t first, CurveSamples& to) noexcept {
    double x = 0.0, w = 0.0, r = 0.0;
    for (std::size_t i = first; i < first + length; ++i) {
      x += from.x[i];
      w += from.w[i];
      r += from.residual[i];
    }
    constexpr double share = 1.0 / static_cast<double>(length);
    to.x[to.count] = x * share;
    to.w[to.count] = w * share;
    to.f[to.count] = r * share;
    ++to.count;
  }

  static void add_all(const CurveSamples& from, std::size_t first, CurveSamples& to) noexcept {
    for (std::size_t i = first; i < std::min(first + length, from.count); ++i) {
      to.x[to.count] = from.x[i];
      to.w[to.count] = from.w[i];
      to.f[to.count] = from.f[i];
      ++to.count;
    }
  }

  // Adds the law's force to each: what a pass leaves of r is r less that force.
  static void force_as_residual(const CurveModel& model, const CurvePoint& at,
                                const CurveSamples& means) noexcept {
    curve_sums(means, at, true, *model.kernels);
    for (std::size_t i = 0; i < means.count; ++i) {
      means.f[i] += means.f[i] - means.residual[i];
    }
  }

  CurveData data_;
};

}  // namespace palpate::detail
