// The kernels of whole curves for every instruction set that the build compiled.
#pragma once

#include "palpate/curves/curve_blocks.hpp"
#include "palpate/lanes/instruction_set.hpp"

namespace palpate::lanes {

extern const CurveKernels compiled_curves_baseline, compiled_curves_avx2, compiled_curves_avx512;

// Null where this build, or this processor, has none.
inline const CurveKernels* curve_kernels_of(InstructionSet set) noexcept {
  if (!has(set)) return nullptr;
  switch (set) {
    case InstructionSet::baseline:
      return &compiled_curves_baseline;
#if defined(PALPATE_COMPILED_AVX2)
    case InstructionSet::avx2:
      return &compiled_curves_avx2;
#endif
#if defined(PALPATE_COMPILED_AVX512)
    case InstructionSet::avx512:
      return &compiled_curves_avx512;
#endif
    default:
      return nullptr;
  }
}

}  // namespace palpate::lanes
