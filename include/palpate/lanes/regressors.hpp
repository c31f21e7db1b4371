// The regressions of methods/regressions.hpp in lanes: of scaled x, v and F what each sample brings
// (`channels`, worked out ahead of the recursion), and of those φ.
#pragma once

#include "palpate/lanes/elementary.hpp"
#include "palpate/lanes/instruction_set.hpp"
#include "palpate/lanes/pack.hpp"

namespace palpate::lanes {
inline namespace PALPATE_LANES_SET {

// A sample's scaled x, v and F; then what φ is made of, and y.
template <int Lanes>
struct Channels {
  Pack<Lanes> depth, velocity, output;
};

// y = F, φ = [x, v].
struct KelvinVoigtRow {
  static constexpr int order = 2;

  template <bool Normal, int Lanes>
  PALPATE_LANES_INLINE static void prepare(Channels<Lanes>&) noexcept {}

  template <int Lanes>
  PALPATE_LANES_INLINE static void regressor(const Pack<Lanes>& depth, const Pack<Lanes>& velocity,
                                             Pack<Lanes> (&phi)[order]) noexcept {
    phi[0] = depth;
    phi[1] = velocity;
  }
};

// y = F, φ = [x, x², v].
struct ExtendedKelvinVoigtRow {
  static constexpr int order = 3;

  template <bool Normal, int Lanes>
  PALPATE_LANES_INLINE static void prepare(Channels<Lanes>&) noexcept {}

  template <int Lanes>
  PALPATE_LANES_INLINE static void regressor(const Pack<Lanes>& depth, const Pack<Lanes>& velocity,
                                             Pack<Lanes> (&phi)[order]) noexcept {
    phi[0] = depth;
    phi[1] = depth * depth;
    phi[2] = velocity;
  }
};

// y = ln F, φ = [1, v, ln x].
struct SingleStageRow {
  static constexpr int order = 3;

  // `Normal`: no x and no F is below the normal range of a double.
  template <bool Normal, int Lanes>
  PALPATE_LANES_INLINE static void prepare(Channels<Lanes>& sample) noexcept {
    if constexpr (Normal) {
      sample.depth = ln(sample.depth);
      sample.output = ln(sample.output);
    } else {
      sample.depth = ln_of_any(sample.depth);
      sample.output = ln_of_any(sample.output);
    }
  }

  template <int Lanes>
  PALPATE_LANES_INLINE static void regressor(const Pack<Lanes>& depth, const Pack<Lanes>& velocity,
                                             Pack<Lanes> (&phi)[order]) noexcept {
    phi[0] = Pack<Lanes>::all(1.0);
    phi[1] = velocity;
    phi[2] = depth;
  }

  // Where |v B/K| < 0.1, condition 10 of the paper, does not hold: θ₁ is B/K.
  template <int Lanes>
  PALPATE_LANES_INLINE static Mask<Lanes> violated(const Pack<Lanes> (&parameters)[order],
                                                   const Pack<Lanes> (&phi)[order]) noexcept {
    return abs(parameters[1] * phi[1]) >= Pack<Lanes>::all(0.1);
  }
};

}  // namespace PALPATE_LANES_SET
}  // namespace palpate::lanes
