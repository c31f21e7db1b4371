// One Python class for the estimates of every law.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "palpate/estimate.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/status.hpp"

namespace palpate::bindings {

enum class LawKind : std::uint8_t { kelvin_voigt, extended_kelvin_voigt, hunt_crossley };

constexpr LawKind kind_of(const KelvinVoigt&) { return LawKind::kelvin_voigt; }
constexpr LawKind kind_of(const ExtendedKelvinVoigt&) { return LawKind::extended_kelvin_voigt; }
constexpr LawKind kind_of(const HuntCrossley&) { return LawKind::hunt_crossley; }

struct EstimateValue {
  static constexpr std::size_t capacity = 3;
  LawKind kind;
  std::size_t size;
  std::array<double, capacity> parameters;
  std::array<double, capacity * capacity> covariance;  // size × size, row-major
  double offset;
  double offset_variance;
  std::array<double, capacity> offset_covariance;
  double surface;
  double surface_variance;
  std::uint8_t doubts;
  double validity_margin;
  Status status;
  std::uint64_t samples;
  std::uint64_t guarded;
  std::uint64_t restarts;
};

template <class Law>
EstimateValue value_of(const Estimate<Law::size>& estimate) {
  EstimateValue value{.kind = kind_of(Law{}),
                      .size = Law::size,
                      .parameters = {},
                      .covariance = {},
                      .offset = estimate.offset.value,
                      .offset_variance = estimate.offset.variance,
                      .offset_covariance = {},
                      .surface = estimate.surface.value,
                      .surface_variance = estimate.surface.variance,
                      .doubts = estimate.doubts,
                      .validity_margin = estimate.validity_margin,
                      .status = estimate.status,
                      .samples = estimate.samples,
                      .guarded = estimate.guarded,
                      .restarts = estimate.restarts};
  for (std::size_t i = 0; i < Law::size; ++i) {
    value.parameters[i] = estimate.parameters[i];
    value.offset_covariance[i] = estimate.offset.covariance[i];
    for (std::size_t j = 0; j < Law::size; ++j) {
      value.covariance[i * Law::size + j] = estimate.covariance[i][j];
    }
  }
  return value;
}

}  // namespace palpate::bindings
