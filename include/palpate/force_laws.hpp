// Contact force laws F(x, v): x penetration [m], v velocity [m/s, positive while penetrating],
// F force [N, compression positive]. Equation numbers: Haddadi & Hashtrudi-Zaad, T-RO 2012.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "palpate/matrix.hpp"

namespace palpate {

// Parameters that data drove past this are reported at it: their squares, and products of those
// with units of 1e±30, stay finite.
inline constexpr double largest_parameter = 1e100;

namespace detail {

inline constexpr double largest_variance = largest_parameter * largest_parameter;

constexpr double bounded_variance(double value) noexcept {
  return value < largest_variance ? value : largest_variance;  // NaN is as good as unknown
}

constexpr double saturate(double value) noexcept {
  return std::clamp(value, -largest_parameter, largest_parameter);
}

// e^a kept within ±largest_parameter (ln 1e100 ≈ 230).
inline double bounded_exp(double a) noexcept { return std::exp(std::clamp(a, -230.0, 230.0)); }

}  // namespace detail

// F = K x + B v for x ≥ 0, else 0 (eq. 1).
struct KelvinVoigt {
  static constexpr std::size_t size = 2;
  double stiffness;  // K, N/m
  double damping;    // B, N·s/m

  constexpr double force(double x, double v) const noexcept {
    return x < 0.0 ? 0.0 : stiffness * x + damping * v;
  }
  constexpr Vector<size> parameters() const noexcept { return {stiffness, damping}; }
  bool operator==(const KelvinVoigt&) const = default;
};

// F = K₁ x + K₂ x² + B v for x ≥ 0, else 0 (eq. 14).
struct ExtendedKelvinVoigt {
  static constexpr std::size_t size = 3;
  double stiffness;            // K₁, N/m
  double quadratic_stiffness;  // K₂, N/m²
  double damping;              // B, N·s/m

  constexpr double force(double x, double v) const noexcept {
    return x < 0.0 ? 0.0 : stiffness * x + quadratic_stiffness * (x * x) + damping * v;
  }
  constexpr Vector<size> parameters() const noexcept {
    return {stiffness, quadratic_stiffness, damping};
  }
  bool operator==(const ExtendedKelvinVoigt&) const = default;
};

// F = K xⁿ + B xⁿ v for x > 0, else 0 (eq. 2).
struct HuntCrossley {
  static constexpr std::size_t size = 3;
  double stiffness;  // K, N/mⁿ
  double damping;    // B, N·s/mⁿ⁺¹
  double exponent;   // n

  double force(double x, double v) const noexcept {
    return x <= 0.0 ? 0.0 : std::pow(x, exponent) * (stiffness + damping * v);
  }
  constexpr Vector<size> parameters() const noexcept { return {stiffness, damping, exponent}; }
  bool operator==(const HuntCrossley&) const = default;
};

// F = K xⁿ + B xᵖ v + M Σ wᵢ gᵢ for x > 0, else 0;  ġᵢ = d(xⁿ)/dt − gᵢ/τᵢ, wᵢ ∝ τᵢ^−α from the
// shortest to the longest of the relaxation times. The state of the branches is its user's.
struct GeneralisedHuntCrossley {
  static constexpr std::size_t size = 8;
  double stiffness;             // K, N/mⁿ
  double exponent;              // n
  double damping;               // B, N·s/mᵖ⁺¹
  double damping_exponent;      // p
  double relaxation_stiffness;  // M, N/mⁿ; 0: it does not remember
  double spectrum_exponent;     // α; 0 is a flat spectrum
  double shortest_time;         // s; 0: the longest is the only one
  double longest_time;          // s

  // With all branches relaxed.
  double force(double x, double v) const noexcept {
    if (x <= 0.0) return 0.0;
    return stiffness * std::pow(x, exponent) + damping * std::pow(x, damping_exponent) * v;
  }
  constexpr Vector<size> parameters() const noexcept {
    return {stiffness,         exponent,      damping,     damping_exponent, relaxation_stiffness,
            spectrum_exponent, shortest_time, longest_time};
  }
  bool operator==(const GeneralisedHuntCrossley&) const = default;
};

// The law of so many parameters, in its order.
template <class Law>
constexpr Law law_of(const double* parameters) noexcept {
  return [parameters]<std::size_t... I>(std::index_sequence<I...>) {
    return Law{parameters[I]...};
  }(std::make_index_sequence<Law::size>{});
}

}  // namespace palpate
