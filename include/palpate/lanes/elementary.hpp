// Logarithm and exponential of doubles in lanes: additions, multiplications, a division and bits,
// with the same result in the last bit whatever the processor, and whatever the lanes beside it.
#pragma once

#include <cstdint>

#include "palpate/lanes/instruction_set.hpp"
#include "palpate/lanes/pack.hpp"

namespace palpate::lanes {
inline namespace PALPATE_LANES_SET {

// The leading bits of ln 2, of which any multiple up to 2¹¹ is exact, and the rest.
inline constexpr double ln2_high = 0x1.62e42feep-1;
inline constexpr double ln2_low = 0x1.a39ef35793c76p-33;

// ln x = k ln 2 + ln m,  m in [√½, √2),   ln m = 2 artanh s,  s = (m − 1)/(m + 1),  |s| < 0.1716
//
// artanh s = s + s³/3 + s⁵/5 …: what is left out after s¹⁹/19 is 2e-17 of it. Of x positive, finite
// and normal (≥ 2.2e-308) within 3.2e-16 of the result; of others the bits say nothing.
template <int Lanes>
PALPATE_LANES_INLINE Pack<Lanes> ln(const Pack<Lanes>& x) noexcept {
  using Doubles = Pack<Lanes>;
  constexpr std::uint64_t root_half = 0x3fe6a09e667f3bcdU;  // the bits of √½
  constexpr std::uint64_t exponent_bits = 0xfff0000000000000U;
  const Bits<Lanes> above = bits_of(x) - Bits<Lanes>::all(root_half);
  const Doubles m = Doubles::of_bits(bits_of(x) - (above & Bits<Lanes>::all(exponent_bits)));
  // k + 1024 as the last bits of 2⁵² + k + 1024.
  const Bits<Lanes> exponent = (above + Bits<Lanes>::all(std::uint64_t{1024} << 52)) >> 52;
  const Doubles k = Doubles::of_bits(exponent | Bits<Lanes>::all(0x4330000000000000U)) -
                    Doubles::all(0x1p52 + 1024.0);
  const Doubles one = Doubles::all(1.0);
  const Doubles s = (m - one) / (m + one);
  const Doubles z = s * s;
  Doubles sum = Doubles::all(2.0 / 19.0);
  sum = sum * z + Doubles::all(2.0 / 17.0);
  sum = sum * z + Doubles::all(2.0 / 15.0);
  sum = sum * z + Doubles::all(2.0 / 13.0);
  sum = sum * z + Doubles::all(2.0 / 11.0);
  sum = sum * z + Doubles::all(2.0 / 9.0);
  sum = sum * z + Doubles::all(2.0 / 7.0);
  sum = sum * z + Doubles::all(2.0 / 5.0);
  sum = sum * z + Doubles::all(2.0 / 3.0);
  const Doubles rest = s * z * sum + k * Doubles::all(ln2_low);
  return k * Doubles::all(ln2_high) + (s + s + rest);
}

// The same of any positive, finite x: one that is not normal counts as 2⁵⁴ x.
template <int Lanes>
PALPATE_LANES_INLINE Pack<Lanes> ln_of_any(const Pack<Lanes>& x) noexcept {
  using Doubles = Pack<Lanes>;
  const Mask<Lanes> small = x < Doubles::all(0x1p-1022);
  const Doubles lifted = ln(select(small, x * Doubles::all(0x1p54), x));
  const Doubles lowered = lifted - Doubles::all(54.0 * ln2_high) - Doubles::all(54.0 * ln2_low);
  return select(small, lowered, lifted);
}

// eˣ = 2ⁿ eʳ,  r = x − n ln 2,  |r| ≤ ½ ln 2;   eʳ = 1 + r + r²/2! …
//
// What is left out after r¹²/12! is 2e-16 of it. Of x in [−708, 709] within 4e-16 of the result; of
// others the bits say nothing.
template <int Lanes>
PALPATE_LANES_INLINE Pack<Lanes> exp(const Pack<Lanes>& x) noexcept {
  using Doubles = Pack<Lanes>;
  // Of a number near 1.5·2⁵² the last bit is 1: adding it rounds.
  const Doubles rounder = Doubles::all(0x1.8p52);
  const Doubles shifted = x * Doubles::all(0x1.71547652b82fep0) + rounder;  // 1/ln 2
  const Doubles n = shifted - rounder;
  const Doubles r = (x - n * Doubles::all(ln2_high)) - n * Doubles::all(ln2_low);
  Doubles sum = Doubles::all(1.0 / 479001600.0);
  sum = sum * r + Doubles::all(1.0 / 39916800.0);
  sum = sum * r + Doubles::all(1.0 / 3628800.0);
  sum = sum * r + Doubles::all(1.0 / 362880.0);
  sum = sum * r + Doubles::all(1.0 / 40320.0);
  sum = sum * r + Doubles::all(1.0 / 5040.0);
  sum = sum * r + Doubles::all(1.0 / 720.0);
  sum = sum * r + Doubles::all(1.0 / 120.0);
  sum = sum * r + Doubles::all(1.0 / 24.0);
  sum = sum * r + Doubles::all(1.0 / 6.0);
  sum = sum * r + Doubles::all(0.5);
  sum = sum * r + Doubles::all(1.0);
  sum = sum * r + Doubles::all(1.0);
  return Doubles::of_bits(bits_of(sum) + (bits_of(shifted) << 52));
}

}  // namespace PALPATE_LANES_SET
}  // namespace palpate::lanes
