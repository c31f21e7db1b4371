// One compiled class for the estimates of every law: numbers alone, which Python gives names.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "palpate/estimate.hpp"
#include "palpate/sample.hpp"

namespace palpate::bindings {

struct EstimateValue {
  // Parameters of a law; the bare recursion's largest order.
  static constexpr std::size_t capacity = 8;

  std::size_t size;
  std::array<double, capacity> parameters;
  std::array<double, capacity * capacity> covariance;  // size × size, row-major
  double offset;
  double offset_variance;
  std::array<double, capacity> offset_covariance;
  double surface;
  double surface_variance;
  std::uint8_t flags;
  double validity_margin;
  Status status;
  std::uint64_t samples;
  std::uint64_t guarded;
  std::uint64_t restarts;
  std::uint64_t rejected;
};

template <std::size_t Size>
EstimateValue value_of(const Estimate<Size>& estimate) {
  static_assert(Size <= EstimateValue::capacity);
  EstimateValue value;  // what lies beyond `size` is never read
  value.size = Size;
  value.offset = estimate.offset.value;
  value.offset_variance = estimate.offset.variance;
  value.surface = estimate.surface.value;
  value.surface_variance = estimate.surface.variance;
  value.flags = estimate.flags;
  value.validity_margin = estimate.validity_margin;
  value.status = estimate.status;
  value.samples = estimate.samples;
  value.guarded = estimate.guarded;
  value.restarts = estimate.restarts;
  value.rejected = estimate.rejected;
  for (std::size_t i = 0; i < Size; ++i) {
    value.parameters[i] = estimate.parameters[i];
    value.offset_covariance[i] = estimate.offset.covariance[i];
    for (std::size_t j = 0; j < Size; ++j)
      value.covariance[i * Size + j] = estimate.covariance[i][j];
  }
  return value;
}

}  // namespace palpate::bindings
