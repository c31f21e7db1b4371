// The result of a viscoelastic estimator: the fitted candidate, its force, and its parameters in
// SI.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/contact_response.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"
#include "palpate/viscoelastic/power_table.hpp"
#include "palpate/viscoelastic/problem.hpp"
#include "palpate/viscoelastic/samples.hpp"
#include "palpate/viscoelastic/search.hpp"

namespace palpate::viscoelastic {

// Index of an entry in the lower triangle of a symmetric matrix, stored row by row.
constexpr std::size_t in_triangle(std::size_t row, std::size_t column) noexcept {
  return row * (row + 1) / 2 + column;
}

// A candidate with its fitted parameters, in scaled units.
struct Fitted {
  std::size_t candidate = 1;
  double n = 1.0;
  Vector<parts> value{};

  const Candidate& law() const noexcept { return candidates[candidate]; }
};

struct Solution {
  Fitted fit;
  Vector<in_triangle(unknowns, 0)> covariance{};
  std::uint32_t at_edge = 0;  // whether the exponent is at an edge of its range
  std::uint16_t known = 0;    // 0 before the first solution
  std::uint16_t given = 0;    // whether the exponent is specified by the user

  const Candidate& law() const noexcept { return fit.law(); }
};

// A candidate's force, in scaled units. The branches must have been advanced to the sample.
[[gnu::noinline]] inline double force_of(const Fitted& fit, const Branches& branches,
                                         const Sample& s) noexcept {
  if (!(s.penetration > 0.0)) return fit.value[offset];
  const double power = std::exp(fit.n * std::log(s.penetration));
  const Damping damper = fit.law().damping;
  const double damped = damper == Damping::half_space ? power / s.penetration
                        : damper == Damping::linear   ? 1.0
                                                      : power;
  double force =
      fit.value[offset] + fit.value[stiffness] * power + fit.value[damping] * s.velocity * damped;
  if (!fit.law().remembers()) return force;
  const Window around = window(Grid::place_of_exponent(fit.n), Grid::exponents);
  Vector<window_points> sum{};
  for (std::size_t i = 0; i < rungs; ++i) {
    const double weight = fit.value[memory + i];
    if (weight == 0.0) continue;
    const double* states = branches.states()[i].data() + around.first;
    for (std::size_t k = 0; k < window_points; ++k) sum[k] += weight * states[k];
  }
  for (std::size_t a = 0; a < start_columns; ++a) {
    force += fit.value[start + a] * branches.start()[a];
  }
  return force + detail::dot(around.weights, sum);
}

// The force if the sample came `dt` after the last one.
[[gnu::noinline]] inline double force_after(const Fitted& fit, const Branches& branches,
                                            const Sample& s, double dt) noexcept {
  Branches then = branches;
  then.advance(s.penetration > 0.0 ? s.penetration : 0.0, dt);
  return force_of(fit, then, s);
}

// The parameters of a law with its relaxation spectrum: K, n, B, p, and mᵢ.
inline constexpr std::size_t spectrum_size = 4 + rungs;
enum Number : std::size_t { stiffness_number, exponent_number, damping_number, power_number };

inline double damping_exponent(const Fitted& fit) noexcept {
  const Damping damper = fit.law().damping;
  return damper == Damping::linear ? 0.0 : damper == Damping::half_space ? fit.n - 1.0 : fit.n;
}

// The units of k and m in N/mⁿ, and of c in N·s/mᵖ⁺¹.
struct LawUnits {
  double stiffness;
  double damping;

  LawUnits(const Fitted& fit, const Units& u) noexcept
      : stiffness(detail::saturate(u.force * detail::bounded_exp(-fit.n * u.log_penetration))),
        damping(detail::saturate(u.force / u.velocity *
                                 detail::bounded_exp(-damping_exponent(fit) * u.log_penetration))) {
  }
};

inline Vector<spectrum_size> numbers_in_si(const Fitted& fit, const Units& u) noexcept {
  const LawUnits unit(fit, u);
  Vector<spectrum_size> numbers{detail::saturate(fit.value[stiffness] * unit.stiffness), fit.n,
                                detail::saturate(fit.value[damping] * unit.damping),
                                damping_exponent(fit)};
  for (std::size_t i = 0; i < rungs; ++i) {
    numbers[4 + i] = detail::saturate(fit.value[memory + i] * unit.stiffness);
  }
  return numbers;
}

inline GeneralisedHuntCrossley law_in_si(const Fitted& fit, const Units& u) noexcept {
  const Vector<spectrum_size> numbers = numbers_in_si(fit, u);
  double whole = 0.0;
  for (std::size_t i = 0; i < rungs; ++i) whole += numbers[4 + i];
  return {numbers[stiffness_number], numbers[exponent_number], numbers[damping_number],
          numbers[power_number], detail::saturate(whole)};
}

// The covariance of these parameters, with the offset as the last: dK = U (dk − k ln x_r dn), and
// likewise for B and mᵢ. Before the first solution every variance is the largest.
inline constexpr std::size_t joint_size = spectrum_size + 1;

[[gnu::noinline]] inline Matrix<joint_size> covariance_in_si(const Solution& s,
                                                             const Units& u) noexcept {
  Matrix<joint_size> joint{};
  if (s.known == 0) {
    for (const std::size_t i :
         {std::size_t{stiffness_number}, std::size_t{damping_number}, joint_size - 1}) {
      joint[i][i] = detail::largest_variance;
    }
    if (s.given == 0) {
      joint[exponent_number][exponent_number] = joint[power_number][power_number] =
          detail::largest_variance;
    }
    return joint;
  }
  Matrix<unknowns> lower{};
  for (std::size_t i = 0; i < unknowns; ++i) {
    for (std::size_t j = 0; j <= i; ++j) lower[i][j] = s.covariance[in_triangle(i, j)];
  }
  const Matrix<unknowns> root = detail::cholesky(lower);
  const LawUnits unit(s.fit, u);
  const Vector<spectrum_size> numbers = numbers_in_si(s.fit, u);
  const double by_depth = -u.log_penetration * Grid::step;
  const bool fixed_power = s.law().damping == Damping::linear;
  std::array<Vector<unknowns>, joint_size> rows{};
  for (std::size_t j = 0; j < unknowns; ++j) {
    const double n = root[exponent_node][j];
    rows[stiffness_number][j] =
        unit.stiffness * root[stiffness][j] + numbers[stiffness_number] * by_depth * n;
    rows[exponent_number][j] = Grid::step * n;
    rows[power_number][j] = fixed_power ? 0.0 : Grid::step * n;
    rows[damping_number][j] = unit.damping * root[damping][j] +
                              (fixed_power ? 0.0 : numbers[damping_number] * by_depth * n);
    for (std::size_t i = 0; i < rungs; ++i) {
      rows[4 + i][j] = unit.stiffness * root[memory + i][j] + numbers[4 + i] * by_depth * n;
    }
    rows[joint_size - 1][j] = u.force * root[offset][j];
  }
  joint = detail::squared(rows);
  detail::bound_variances(joint, detail::largest_variance);
  return joint;
}

// The covariance of K, n, B, p, M = Σ mᵢ, and the offset.
inline Matrix<GeneralisedHuntCrossley::size + 1> law_covariance(
    const Matrix<joint_size>& joint) noexcept {
  constexpr std::size_t size = GeneralisedHuntCrossley::size + 1, own = 4;
  const auto place = [](std::size_t i) noexcept { return i < own ? i : joint_size - 1; };
  Matrix<size> result{};
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = 0; j < size; ++j) {
      if (i != own && j != own) result[i][j] = joint[place(i)][place(j)];
    }
  }
  for (std::size_t r = 0; r < rungs; ++r) {
    for (std::size_t i = 0; i < size; ++i) {
      if (i != own) result[i][own] = result[own][i] += joint[place(i)][own + r];
    }
    for (std::size_t q = 0; q < rungs; ++q) result[own][own] += joint[own + r][own + q];
  }
  detail::bound_variances(result, detail::largest_variance);
  return result;
}

// K′ and B′ of small oscillations, with their variances by the delta method:
//
//   K′ + iωB′ = n x^(n−1) [K + Σ mᵢ iωτᵢ/(1 + iωτᵢ)] + iωB xᵖ.
[[gnu::noinline]] inline detail::LawResponse response_of(const Solution& s,
                                                         const std::array<double, rungs>& times,
                                                         const Units& u, double depth,
                                                         double frequency) noexcept {
  if (s.known == 0) {
    constexpr double unknown = detail::largest_variance;
    return {0.0, unknown, 0.0, unknown, 0.0, unknown, 0.0, unknown};
  }
  const double n = s.fit.n, p = damping_exponent(s.fit),
               log_depth = std::log(depth / u.penetration);
  const double slope = n * detail::bounded_exp((n - 1.0) * log_depth);
  const double power = detail::bounded_exp(p * log_depth);
  // In scaled units, with rows of derivatives.
  Vector<unknowns> stiff{}, damped{};
  stiff[stiffness] = slope;
  damped[damping] = power;
  const double per_time = u.velocity / u.penetration;  // 1/s
  for (std::size_t i = 0; i < rungs; ++i) {
    const double phase = frequency * times[i], share = 1.0 / (1.0 + phase * phase);
    stiff[memory + i] = slope * phase * phase * share;
    damped[memory + i] = slope * times[i] * share * per_time;
  }
  double spring = 0.0, lossy = 0.0;
  for (std::size_t i = stiffness; i < parts; ++i) {
    if (i != damping) spring += stiff[i] * s.fit.value[i];
    if (i >= memory && i < memory + rungs) lossy += damped[i] * s.fit.value[i];
  }
  const double damper = power * s.fit.value[damping];
  const double by_node = Grid::step * (1.0 / n + log_depth);
  const bool moves = s.law().damping != Damping::linear;
  stiff[exponent_node] = spring * by_node;
  damped[exponent_node] = lossy * by_node + (moves ? damper * Grid::step * log_depth : 0.0);
  const auto variance = [&s](const Vector<unknowns>& row) noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < unknowns; ++i) {
      if (row[i] == 0.0) continue;
      for (std::size_t j = 0; j <= i; ++j) {
        sum += (j < i ? 2.0 : 1.0) * row[i] * row[j] * s.covariance[in_triangle(i, j)];
      }
    }
    return std::max(sum, 0.0);
  };
  const double k = u.force / u.penetration, b = u.force / u.velocity;
  return {spring * k,
          variance(stiff) * k * k,
          (lossy + damper) * b,
          variance(damped) * b * b,
          n,
          Grid::step * Grid::step * s.covariance[in_triangle(exponent_node, exponent_node)],
          s.fit.value[offset] * u.force,
          s.covariance[in_triangle(offset, offset)] * u.force * u.force,
          1.0};
}

}  // namespace palpate::viscoelastic
