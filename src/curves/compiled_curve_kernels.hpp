// The kernels of whole curves for every instruction set that the build compiled.
#pragma once

#include <string_view>

#include "palpate/curves/curve_blocks.hpp"

namespace palpate::curves {

extern const CurveKernels compiled_baseline, compiled_avx2, compiled_avx512;

// Those of this name, or the quickest of none; null where this build, or this processor, has none.
inline const CurveKernels* kernels_of(std::string_view name) noexcept {
  const auto asked = [name](std::string_view set) { return name.empty() || name == set; };
#if defined(PALPATE_COMPILED_AVX512)
  if (asked("avx512") && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw")) {
    return &compiled_avx512;
  }
#endif
#if defined(PALPATE_COMPILED_AVX2)
  if (asked("avx2") && __builtin_cpu_supports("avx2")) return &compiled_avx2;
#endif
  return asked("baseline") ? &compiled_baseline : nullptr;
}

}  // namespace palpate::curves
