// The kernels of every instruction set that the build compiled.
#pragma once

#include "palpate/lanes/instruction_set.hpp"
#include "palpate/lanes/lane_state.hpp"

namespace palpate::lanes {

extern const Kernels compiled_baseline, compiled_avx2, compiled_avx512;

// Null where this build, or this processor, has none.
inline const Kernels* kernels_of(InstructionSet set) noexcept {
  if (!has(set)) return nullptr;
  switch (set) {
    case InstructionSet::baseline:
      return &compiled_baseline;
#if defined(PALPATE_COMPILED_AVX2)
    case InstructionSet::avx2:
      return &compiled_avx2;
#endif
#if defined(PALPATE_COMPILED_AVX512)
    case InstructionSet::avx512:
      return &compiled_avx512;
#endif
    default:
      return nullptr;
  }
}

}  // namespace palpate::lanes
