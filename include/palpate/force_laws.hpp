// Contact force laws F(x, v): x penetration [m], v velocity [m/s, positive while penetrating],
// F force [N, compression positive]. Equation numbers: Haddadi & Hashtrudi-Zaad, T-RO 2012.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "palpate/matrix.hpp"

namespace palpate {

// Larger parameters are reported as this value: their squares, and products of those with units of
// 1e±30, stay finite.
inline constexpr double largest_parameter = 1e100;

namespace detail {

inline constexpr double largest_variance = largest_parameter * largest_parameter;

constexpr double bounded_variance(double value) noexcept {
  return value < largest_variance ? value : largest_variance;  // NaN counts as unknown
}

constexpr double saturate(double value) noexcept {
  return std::clamp(value, -largest_parameter, largest_parameter);
}

// e^a limited to ±largest_parameter (ln 1e100 ≈ 230).
inline double bounded_exp(double a) noexcept { return std::exp(std::clamp(a, -230.0, 230.0)); }

}  // namespace detail

// F = K x + B v for x ≥ 0, else 0 (eq. 1).
struct KelvinVoigt {
  static constexpr std::size_t size = 2;
  double K;  // N/m
  double B;  // N·s/m

  constexpr double force(double x, double v) const noexcept {
    return x < 0.0 ? 0.0 : K * x + B * v;
  }
  constexpr Vector<size> parameters() const noexcept { return {K, B}; }
  bool operator==(const KelvinVoigt&) const = default;
};

// F = K₁ x + K₂ x² + B v for x ≥ 0, else 0 (eq. 14).
struct ExtendedKelvinVoigt {
  static constexpr std::size_t size = 3;
  double K1;  // N/m
  double K2;  // N/m²
  double B;   // N·s/m

  constexpr double force(double x, double v) const noexcept {
    return x < 0.0 ? 0.0 : K1 * x + K2 * (x * x) + B * v;
  }
  constexpr Vector<size> parameters() const noexcept { return {K1, K2, B}; }
  bool operator==(const ExtendedKelvinVoigt&) const = default;
};

// F = K xⁿ + B xⁿ v for x > 0, else 0 (eq. 2).
struct HuntCrossley {
  static constexpr std::size_t size = 3;
  double K;  // N/mⁿ
  double B;  // N·s/mⁿ⁺¹
  double n;

  double force(double x, double v) const noexcept {
    return x <= 0.0 ? 0.0 : std::pow(x, n) * (K + B * v);
  }
  constexpr Vector<size> parameters() const noexcept { return {K, B, n}; }
  bool operator==(const HuntCrossley&) const = default;
};

// F = K xⁿ + B xᵖ v + Σ mᵢ gᵢ for x > 0, else 0;  ġᵢ = d(xⁿ)/dt − gᵢ/τᵢ,  Σ mᵢ = M. The caller
// keeps the relaxation times and the state of the branches.
struct GeneralisedHuntCrossley {
  static constexpr std::size_t size = 5;
  double K;  // N/mⁿ
  double n;
  double B;  // N·s/mᵖ⁺¹
  double p;
  double M;  // N/mⁿ; 0: no memory

  // The force with all branches relaxed.
  double force(double x, double v) const noexcept {
    if (x <= 0.0) return 0.0;
    return K * std::pow(x, n) + B * std::pow(x, p) * v;
  }
  constexpr Vector<size> parameters() const noexcept { return {K, n, B, p, M}; }
  bool operator==(const GeneralisedHuntCrossley&) const = default;
};

// The law with these parameters, in the law's order.
template <class Law>
constexpr Law law_of(const double* parameters) noexcept {
  return [parameters]<std::size_t... I>(std::index_sequence<I...>) {
    return Law{parameters[I]...};
  }(std::make_index_sequence<Law::size>{});
}

}  // namespace palpate

namespace palpate::viscoelastic {

// The relaxation branches of a law, for an identified law and for the simulated laboratory.
struct RelaxationBranches {
  static constexpr std::size_t most = 128;

  std::array<double, most> times{};        // s
  std::array<double, most> stiffnesses{};  // N/mⁿ
  std::size_t count = 0;

  // The branches with these times and stiffnesses; those beyond `most` are ignored.
  RelaxationBranches(std::span<const double> own_times,
                     std::span<const double> own_stiffnesses) noexcept
      : count(std::min({own_times.size(), own_stiffnesses.size(), most})) {
    std::copy_n(own_times.begin(), count, times.begin());
    std::copy_n(own_stiffnesses.begin(), count, stiffnesses.begin());
  }

  // Branches with mᵢ ∝ τᵢ^−α between the shortest and the longest time, with the sum `stiffness`;
  // one time if the shortest is 0, and none if both are. Two branches per factor of two, each in
  // the middle of its part of ln τ. The ripple of K′ and B′ is then below 1e-10, near the ends of
  // the spectrum below 1e-3.
  RelaxationBranches(double alpha, double shortest_time, double longest_time,
                     double stiffness) noexcept {
    if (!(longest_time > 0.0)) return;
    const double shortest = shortest_time > 0.0 ? shortest_time : longest_time;
    const double width = std::log(std::max(longest_time / shortest, 1.0));
    const double wanted = std::ceil(2.0 * width / std::log(2.0) - 1e-9);
    count = static_cast<std::size_t>(std::clamp(wanted, 1.0, static_cast<double>(most)));
    const double step = width / static_cast<double>(count);
    double total = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double place = step * (static_cast<double>(i) + 0.5);
      times[i] = shortest * std::exp(place);
      stiffnesses[i] = std::exp(-alpha * place);
      total += stiffnesses[i];
    }
    for (std::size_t i = 0; i < count; ++i) stiffnesses[i] *= stiffness / total;
  }
};

// Advances the state by `dt` to a penetration: `state` is xⁿ at the last penetration, then one
// number per branch. Exact if xⁿ is linear in between.
inline void relax(double exponent, const RelaxationBranches& branches, double x, double dt,
                  double* state) noexcept {
  const double elastic = x > 0.0 ? std::pow(x, exponent) : 0.0;
  const double change = elastic - state[0];
  state[0] = elastic;
  for (std::size_t i = 0; i < branches.count; ++i) {
    const double lost = -std::expm1(-dt / branches.times[i]);
    const double gain = dt > 0.0 ? lost * branches.times[i] / dt : 1.0;
    // Sets a branch below 1e-76 to zero, because arithmetic on subnormal numbers is slow.
    state[1 + i] = (state[1 + i] * (1.0 - lost) + gain * change + 1e-60) - 1e-60;
  }
}

// The force at the penetration of the state; `law` has K, n, B and p.
inline double relaxing_force(const GeneralisedHuntCrossley& law, const RelaxationBranches& branches,
                             double x, double v, const double* state) noexcept {
  if (x <= 0.0) return 0.0;
  double memory = 0.0;
  for (std::size_t i = 0; i < branches.count; ++i) memory += branches.stiffnesses[i] * state[1 + i];
  return law.force(x, v) + memory;
}

}  // namespace palpate::viscoelastic
