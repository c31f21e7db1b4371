// Which instructions a source file is compiled for, and which this processor has.
//
// What stands in PALPATE_LANES_SET is compiled once per set, each with its own flags, and each in a
// namespace of its own: were an inline function shared, the linker could keep the one that other
// processors cannot run. For the same reason nothing there calls into the standard library.
#pragma once

#if defined(__AVX512F__) && defined(__AVX512DQ__) && defined(__AVX512VL__) && defined(__AVX512BW__)
#define PALPATE_LANES_SET avx512
#elif defined(__AVX2__)
#define PALPATE_LANES_SET avx2
#else
#define PALPATE_LANES_SET baseline
#endif

#if defined(__GNUC__)
#define PALPATE_LANES_INLINE [[gnu::always_inline]] inline
#define PALPATE_LANES_LAMBDA __attribute__((always_inline))
#else
#define PALPATE_LANES_INLINE inline
#define PALPATE_LANES_LAMBDA
#endif

// PALPATE_LANES_PLAIN: plain loops as for compilers without vectors of their own, for a comparison.
#if defined(__GNUC__) && !defined(PALPATE_LANES_PLAIN)
#define PALPATE_LANES_VECTORS 1
#endif

namespace palpate::lanes {

// In order: each has what those before it have.
enum class InstructionSet : unsigned char { baseline, avx2, avx512 };

inline constexpr InstructionSet instruction_sets[] = {InstructionSet::baseline,
                                                      InstructionSet::avx2, InstructionSet::avx512};

constexpr const char* name_of(InstructionSet set) noexcept {
  constexpr const char* names[] = {"baseline", "avx2", "avx512"};
  return names[static_cast<unsigned char>(set)];
}

// Whether processor and system have it. What a compiler does not say of its processor it has not.
inline bool has(InstructionSet set) noexcept {
  if (set == InstructionSet::baseline) return true;
#if defined(__GNUC__) && (defined(__x86_64__) || defined(__i386__))
  __builtin_cpu_init();
  if (set == InstructionSet::avx2) return __builtin_cpu_supports("avx2") > 0;
  return __builtin_cpu_supports("avx2") > 0 && __builtin_cpu_supports("avx512f") > 0 &&
         __builtin_cpu_supports("avx512dq") > 0 && __builtin_cpu_supports("avx512vl") > 0 &&
         __builtin_cpu_supports("avx512bw") > 0;
#else
  return false;
#endif
}

}  // namespace palpate::lanes
