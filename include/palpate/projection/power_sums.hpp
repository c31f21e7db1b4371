// The sufficient statistics of F = k ξⁿ + c ξⁿ w + F₀ over a grid of exponents n, or at a known
// exponent. Variable projection keeps nothing else of past samples. Accumulation is a straight
// sequence of multiplications and additions.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"

namespace palpate::detail {

// Ten-point Lagrange interpolation on an even grid: value, first and second derivative. The number
// is even, so that the point lies in the middle interval. At steps of 0.1 and 0.005 N of noise,
// eight points have errors of up to 0.01 standard errors if the depth varies by a factor of 3, and
// of 1 if it varies by 30; ten points have 0.002 and 0.07.
inline constexpr std::size_t lagrange_points = 10;

struct LagrangeWeights {
  static constexpr std::size_t points = lagrange_points;
  Vector<points> value;
  Vector<points> first;   // per grid step
  Vector<points> second;  // per grid step squared
};

// Polynomials are expanded about the middle of the points, near which they are evaluated. About the
// first point terms of 1e5 would cancel, with an error of 3e-11 of a sum.
inline constexpr double lagrange_middle = 0.5 * static_cast<double>(lagrange_points - 1);

// [k][i]: the coefficient of (t − middle)ᵏ in the basis polynomial of point i = 0, 1, 2 ….
constexpr Matrix<lagrange_points> lagrange_basis() noexcept {
  Matrix<lagrange_points> basis{};
  for (std::size_t i = 0; i < lagrange_points; ++i) {
    Vector<lagrange_points> polynomial{1.0};
    std::size_t degree = 0;
    double scale = 1.0;
    for (std::size_t j = 0; j < lagrange_points; ++j) {
      if (j == i) continue;
      Vector<lagrange_points> product{};
      for (std::size_t k = 0; k <= degree; ++k) {
        product[k + 1] += polynomial[k];
        product[k] -= (static_cast<double>(j) - lagrange_middle) * polynomial[k];
      }
      polynomial = product;
      ++degree;
      scale *= static_cast<double>(i) - static_cast<double>(j);
    }
    for (std::size_t k = 0; k < lagrange_points; ++k) basis[k][i] = polynomial[k] / scale;
  }
  return basis;
}

inline constexpr Matrix<lagrange_points> lagrange_coefficients = lagrange_basis();

// Weights at t, in grid steps from the first point; most accurate near the middle.
constexpr LagrangeWeights lagrange_weights(double t) noexcept {
  // Horner's scheme for all polynomials and their derivatives in one pass.
  const double u = t - lagrange_middle;
  LagrangeWeights weights{lagrange_coefficients[lagrange_points - 1], {}, {}};
  for (std::size_t k = lagrange_points - 1; k-- > 0;) {
    const Vector<lagrange_points>& c = lagrange_coefficients[k];
    for (std::size_t i = 0; i < lagrange_points; ++i) {
      weights.second[i] = weights.second[i] * u + 2.0 * weights.first[i];
      weights.first[i] = weights.first[i] * u + weights.value[i];
      weights.value[i] = weights.value[i] * u + c[i];
    }
  }
  return weights;
}

// Interpolation weights for values S that grow by about e^rate per step: S e^(−rate t), which
// hardly grows, is interpolated and scaled back. Value, first and second derivative of S at t.
inline LagrangeWeights rescaled(const LagrangeWeights& level, double t, double rate) noexcept {
  LagrangeWeights weights;
  double growth = std::exp(rate * t);  // from point i to t
  const double back = std::exp(-rate);
  for (std::size_t i = 0; i < lagrange_points; ++i) {
    const double value = level.value[i], first = level.first[i];
    weights.value[i] = value * growth;
    weights.first[i] = (first + rate * value) * growth;
    weights.second[i] = (level.second[i] + rate * (2.0 * first + rate * value)) * growth;
    growth *= back;
  }
  return weights;
}

// For p = ξⁿ at one exponent: the sums of p², p²w, p²w², p, pw, pF, pwF.
enum Power : std::size_t { pp, ppw, ppww, p1, pw, pf, pwf, power_count };

class PowerSums {
 public:
  // The default range, from 0.3 to 3.6, in steps of 0.1: small enough for an interpolation error of
  // 1e-9.
  static constexpr std::size_t nodes = 34;
  using Values = Vector<power_count>;

  // At an exponent between the nodes: the sums, and their first two derivatives with respect to n.
  struct Local {
    Values value;
    Values first;
    Vector<3> second;  // of p², p²w and p²w² only
  };

  // If both ends are the same, only the first node is used.
  constexpr PowerSums(double lowest, double highest) noexcept
      : lowest_(lowest), step_((highest - lowest) / static_cast<double>(nodes - 1)) {}

  constexpr double exponent(std::size_t node) const noexcept {
    return lowest_ + step_ * static_cast<double>(node);
  }
  constexpr double lowest() const noexcept { return lowest_; }
  constexpr double highest() const noexcept { return exponent(nodes - 1); }
  constexpr double step() const noexcept { return step_; }
  constexpr bool one_exponent() const noexcept { return step_ == 0.0; }

  constexpr double weight() const noexcept { return weight_; }                // Σ 1
  constexpr double force() const noexcept { return force_; }                  // Σ F
  constexpr double force_squared() const noexcept { return force_squared_; }  // Σ F²
  // Standard deviation of ln ξ. If it is zero the exponent is not identifiable, whatever rounding
  // adds to the sums.
  double depth_spread() const noexcept {
    if (!(touching_ > 0.0)) return 0.0;
    const double mean = depth_ / touching_;
    return std::sqrt(std::max(depth_squared_ / touching_ - mean * mean, 0.0));
  }
  constexpr const std::array<double, nodes>& column(Power power) const noexcept {
    return sums_[power];
  }

  constexpr Values node(std::size_t j) const noexcept {
    Values values;
    for (std::size_t power = 0; power < power_count; ++power) values[power] = sums_[power][j];
    return values;
  }

  // Adds a sample in scaled units; a sample out of contact (ξ ≤ 0) informs F₀ only.
  void add(const Sample& s, double forgetting_factor) noexcept {
    if (forgetting_factor != 1.0) forget(forgetting_factor);
    accumulate<false>(s, 1.0);
  }

  // Adds a sample with a weight; a negative weight removes it. Once the last sample is removed only
  // rounding errors remain, and the sums are cleared.
  [[gnu::noinline]] void add_weighted(const Sample& s, double weight) noexcept {
    accumulate<true>(s, weight);
    constexpr double smallest = 1e-6;
    if (weight_ < smallest) clear();
  }

  // Adds all samples of other sums, each with this weight.
  void include(const PowerSums& other, double weight) noexcept {
    weight_ += weight * other.weight_;
    force_ += weight * other.force_;
    force_squared_ += weight * other.force_squared_;
    touching_ += weight * other.touching_;
    depth_ += weight * other.depth_;
    depth_squared_ += weight * other.depth_squared_;
    for (std::size_t power = 0; power < power_count; ++power) {
      for (std::size_t j = 0; j < nodes; ++j) sums_[power][j] += weight * other.sums_[power][j];
    }
  }

  // Makes all forces relative to this one.
  void shift(double zero) noexcept {
    force_squared_ += zero * (zero * weight_ - 2.0 * force_);
    force_ -= zero * weight_;
    for (std::size_t j = 0; j < nodes; ++j) {
      sums_[pf][j] -= zero * sums_[p1][j];
      sums_[pwf][j] -= zero * sums_[pw][j];
    }
  }

  void forget(double factor) noexcept {
    for (double* sum : {&weight_, &force_, &force_squared_, &touching_, &depth_, &depth_squared_}) {
      *sum = faded(*sum * factor);
    }
    for (auto& column : sums_) {
      if (one_exponent()) {
        column.front() = faded(column.front() * factor);
        continue;
      }
      for (double& sum : column) sum *= factor;
      // A column grows or shrinks monotonically from node to node, so that one end of it fades
      // first. The test of two numbers of 34 costs 8 ns of the 420 ns per sample; a test of each
      // costs 33.
      if (faded(column.front()) != 0.0 && faded(column.back()) != 0.0) continue;
      for (double& sum : column) sum = faded(sum);
    }
  }

  void clear() noexcept { *this = PowerSums(lowest_, highest()); }

  // Interpolates the sums, not a function of them, between the ten nodes around an exponent. For a
  // single exponent the derivatives are not defined and returned as zero.
  Local at(double n) const noexcept {
    if (one_exponent()) {
      return {node(0), {}, {}};
    }
    // The first of the ten nodes around the exponent, and the distance of the exponent from it in
    // steps.
    const double position = (n - lowest_) / step_, centred = std::floor(position) - 4.0;
    const std::size_t first =
        centred <= 0.0 ? 0 : std::min(static_cast<std::size_t>(centred), nodes - lagrange_points);
    const double t = position - static_cast<double>(first);
    const LagrangeWeights weights = lagrange_weights(t);
    const double rate = growth_rate(first);
    if (rate == 0.0) return interpolated(first, weights, weights);
    return interpolated(first, rescaled(weights, t, rate), rescaled(weights, t, 2.0 * rate));
  }

 private:
  // From node to node Σ p grows by the factor e^rate and Σ p² by e^(2 rate). Fast growth, which
  // occurs if the unit is many times the depth, makes polynomial interpolation inaccurate; 0 for
  // slow growth.
  double growth_rate(std::size_t first) const noexcept {
    const double growth = sums_[pp][first + 5] / sums_[pp][first + 4];
    const bool even =
        growth > 0.9 && growth < 1.1;  // 2.4 times in nine steps: interpolated to 1e-9
    const bool known = growth > 1e-60 && growth < 1e60;  // its fifth power is finite
    return even || !known ? 0.0 : 0.5 * std::log(growth);
  }

  static constexpr double combine(const Vector<lagrange_points>& w, const double* sums) noexcept {
    return (w[0] * sums[0] + w[1] * sums[1]) + (w[2] * sums[2] + w[3] * sums[3]) +
           (w[4] * sums[4] + w[5] * sums[5]) + (w[6] * sums[6] + w[7] * sums[7]) +
           (w[8] * sums[8] + w[9] * sums[9]);
  }

  // The weights in `single` are for sums of p, those in `square` for sums of p².
  Local interpolated(std::size_t first, const LagrangeWeights& single,
                     const LagrangeWeights& square) const noexcept {
    const double per_step = 1.0 / step_;
    Local local{};
    for (std::size_t power = 0; power < power_count; ++power) {
      const LagrangeWeights& weights = power < local.second.size() ? square : single;
      const double* sums = &sums_[power][first];
      local.value[power] = combine(weights.value, sums);
      local.first[power] = combine(weights.first, sums) * per_step;
    }
    for (std::size_t power = 0; power < local.second.size(); ++power) {
      local.second[power] = combine(square.second, &sums_[power][first]) * (per_step * per_step);
    }
    return local;
  }

  // Sums that decay without new contributions, such as Σ p²w² while the probe is held, would become
  // subnormal numbers, which processors handle slowly: an update took 578 ns while the probe was
  // held instead of 307. A sum below 1e-150 is set to zero: a product of two would be subnormal,
  // and covariance.hpp treats such a column as absent.
  static constexpr double faded(double sum) noexcept {
    constexpr double smallest = 1e-150;
    return sum < smallest && sum > -smallest ? 0.0 : sum;
  }

  // If `Weighted` is false, the multiplications by the weight are omitted.
  template <bool Weighted>
  void accumulate(const Sample& s, double weight) noexcept {
    const auto times = [weight](double value) noexcept {
      return Weighted ? value * weight : value;
    };
    weight_ += times(1.0);
    force_ += times(s.force);
    force_squared_ += times(s.force * s.force);
    if (!(s.penetration > 0.0)) return;
    const double depth = std::log(s.penetration);
    touching_ += times(1.0);
    depth_ += times(depth);
    depth_squared_ += times(depth * depth);
    const double w = s.velocity, f = s.force, ww = w * w, wf = w * f;
    const auto add_node = [&](std::size_t j, double power) noexcept {
      const double once = times(power), square = times(power * power);
      sums_[pp][j] += square;
      sums_[ppw][j] += square * w;
      sums_[ppww][j] += square * ww;
      sums_[p1][j] += once;
      sums_[pw][j] += once * w;
      sums_[pf][j] += once * f;
      sums_[pwf][j] += once * wf;
    };
    if (one_exponent()) {
      add_node(0, std::exp(lowest_ * depth));
      return;
    }
    // ξ^(n₀ + jh) as products of two exponentials, in four independent chains that the processor
    // overlaps.
    std::array<double, nodes + 2> powers;
    const double ratio = std::exp(step_ * depth);
    powers[0] = std::exp(lowest_ * depth);
    powers[1] = powers[0] * ratio;
    powers[2] = powers[1] * ratio;
    powers[3] = powers[2] * ratio;
    const double fourth = (ratio * ratio) * (ratio * ratio);
    for (std::size_t j = 4; j < powers.size(); ++j) powers[j] = powers[j - 4] * fourth;
    for (std::size_t j = 0; j < nodes; ++j) add_node(j, powers[j]);
  }

  double lowest_;
  double step_;
  double weight_ = 0.0;
  double force_ = 0.0;
  double force_squared_ = 0.0;
  double touching_ = 0.0;  // weight of the samples with ξ > 0
  double depth_ = 0.0;     // Σ ln ξ of these samples
  double depth_squared_ = 0.0;
  alignas(32) std::array<std::array<double, nodes>, power_count> sums_{};
};

}  // namespace palpate::detail
