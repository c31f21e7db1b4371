// Registers of doubles, as wide as a source file is compiled for, with logarithm and exponential of
// each: additions, multiplications, a division and bits. So a double's result has the same last bit
// whatever the register, if the compiler contracts nothing (-ffp-contract=off).
//
// What stands in PALPATE_INSTRUCTION_SET is compiled once per set, each with its own flags, and
// each in a namespace of its own: were an inline function shared, the linker could keep the one
// that other processors cannot run. For the same reason nothing there calls into the standard
// library.
#pragma once

#include <cstddef>
#include <cstdint>

#if defined(__AVX512F__) && defined(__AVX512DQ__) && defined(__AVX512VL__) && defined(__AVX512BW__)
#define PALPATE_INSTRUCTION_SET avx512
#define PALPATE_REGISTER_SIZE 8
#elif defined(__AVX2__)
#define PALPATE_INSTRUCTION_SET avx2
#define PALPATE_REGISTER_SIZE 4
#else
#define PALPATE_INSTRUCTION_SET baseline
#define PALPATE_REGISTER_SIZE 2  // SSE2, NEON
#endif

#if defined(__GNUC__)
#define PALPATE_INLINE [[gnu::always_inline]] inline
#else
#define PALPATE_INLINE inline
#endif

namespace palpate::curves {
inline namespace PALPATE_INSTRUCTION_SET {

#if defined(__GNUC__)

inline constexpr std::size_t register_size = PALPATE_REGISTER_SIZE;
typedef double Doubles __attribute__((vector_size(8 * register_size)));
typedef std::uint64_t Bits __attribute__((vector_size(8 * register_size)));
typedef double StoredDoubles __attribute__((vector_size(8 * register_size), aligned(8), may_alias));

#else  // a compiler without vectors of its own goes one by one

inline constexpr std::size_t register_size = 1;
using Doubles = double;
using Bits = std::uint64_t;
using StoredDoubles = double;

#endif

PALPATE_INLINE Doubles all(double value) noexcept { return Doubles{} + value; }

PALPATE_INLINE Doubles load(const double* from) noexcept {
  return *reinterpret_cast<const StoredDoubles*>(from);
}

PALPATE_INLINE void store(double* to, const Doubles& values) noexcept {
  *reinterpret_cast<StoredDoubles*>(to) = values;
}

// The leading bits of ln 2, of which any multiple up to 2¹¹ is exact, and the rest.
inline constexpr double ln2_high = 0x1.62e42feep-1;
inline constexpr double ln2_low = 0x1.a39ef35793c76p-33;

// ln x = k ln 2 + ln m,  m in [√½, √2),   ln m = 2 artanh s,  s = (m − 1)/(m + 1),  |s| < 0.1716
//
// artanh s = s + s³/3 + s⁵/5 …: what is left out after s¹⁹/19 is 2e-17 of it. Of x positive, finite
// and normal (≥ 2.2e-308) within 3.2e-16 of the result; of others the bits say nothing.
PALPATE_INLINE Doubles ln(const Doubles& x) noexcept {
  constexpr std::uint64_t root_half = 0x3fe6a09e667f3bcdU;  // the bits of √½
  constexpr std::uint64_t exponent_bits = 0xfff0000000000000U;
  const Bits own = __builtin_bit_cast(Bits, x), above = own - root_half;
  const Doubles m = __builtin_bit_cast(Doubles, own - (above & exponent_bits));
  // k + 1024 as the last bits of 2⁵² + k + 1024.
  const Bits exponent = (above + (std::uint64_t{1024} << 52)) >> 52;
  const Doubles k = __builtin_bit_cast(Doubles, exponent | 0x4330000000000000U) - (0x1p52 + 1024.0);
  const Doubles s = (m - 1.0) / (m + 1.0);
  const Doubles z = s * s;
  Doubles sum = all(2.0 / 19.0);
  sum = sum * z + 2.0 / 17.0;
  sum = sum * z + 2.0 / 15.0;
  sum = sum * z + 2.0 / 13.0;
  sum = sum * z + 2.0 / 11.0;
  sum = sum * z + 2.0 / 9.0;
  sum = sum * z + 2.0 / 7.0;
  sum = sum * z + 2.0 / 5.0;
  sum = sum * z + 2.0 / 3.0;
  const Doubles rest = s * z * sum + k * ln2_low;
  return k * ln2_high + (s + s + rest);
}

// eˣ = 2ⁿ eʳ,  r = x − n ln 2,  |r| ≤ ½ ln 2;   eʳ = 1 + r + r²/2! …
//
// What is left out after r¹²/12! is 2e-16 of it. Of x in [−708, 709] within 4e-16 of the result; of
// others the bits say nothing.
PALPATE_INLINE Doubles exp(const Doubles& x) noexcept {
  // Of a number near 1.5·2⁵² the last bit is 1: adding it rounds.
  constexpr double rounder = 0x1.8p52;
  const Doubles shifted = x * 0x1.71547652b82fep0 + rounder;  // 1/ln 2
  const Doubles n = shifted - rounder;
  const Doubles r = (x - n * ln2_high) - n * ln2_low;
  Doubles sum = all(1.0 / 479001600.0);
  sum = sum * r + 1.0 / 39916800.0;
  sum = sum * r + 1.0 / 3628800.0;
  sum = sum * r + 1.0 / 362880.0;
  sum = sum * r + 1.0 / 40320.0;
  sum = sum * r + 1.0 / 5040.0;
  sum = sum * r + 1.0 / 720.0;
  sum = sum * r + 1.0 / 120.0;
  sum = sum * r + 1.0 / 24.0;
  sum = sum * r + 1.0 / 6.0;
  sum = sum * r + 0.5;
  sum = sum * r + 1.0;
  sum = sum * r + 1.0;
  return __builtin_bit_cast(
      Doubles, __builtin_bit_cast(Bits, sum) + (__builtin_bit_cast(Bits, shifted) << 52));
}

}  // namespace PALPATE_INSTRUCTION_SET
}  // namespace palpate::curves
