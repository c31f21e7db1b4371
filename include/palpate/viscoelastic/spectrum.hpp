// The weights wᵢ of the branches, Σ wᵢ = 1, for each kind of memory.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/window.hpp"

namespace palpate::viscoelastic {

// Of `Count` branches, those from `first` up to `end` count.
template <std::size_t Count>
struct Spectrum {
  std::array<double, Count> weight{};
  std::size_t first = 0;
  std::size_t end = Count;
};

// `second` is the place of the one relaxation time on the ladder, in rungs; or α of wᵢ ∝ τᵢ^−α.
template <class Times>
Spectrum<Times::count> spectrum_of(Memory memory, double second) noexcept {
  Spectrum<Times::count> result;
  if (memory == Memory::single) {
    // Of a time between the rungs it is the branches that are interpolated, not their sums: what
    // comes out is the residual of a law.
    const Window around = window(second, Times::count);
    result.first = around.first;
    result.end = around.first + window_points;
    for (std::size_t i = 0; i < window_points; ++i) {
      result.weight[around.first + i] = around.weights[i];
    }
    return result;
  }
  if (memory == Memory::flat) {
    result.weight.fill(1.0 / static_cast<double>(Times::count));
    return result;
  }
  double total = 0.0, next = 1.0;
  const double ratio = std::pow(Times::ratio, -second);
  for (double& weight : result.weight) {
    weight = next;
    total += next;
    next *= ratio;
  }
  for (double& weight : result.weight) weight /= total;
  return result;
}

}  // namespace palpate::viscoelastic
