// Passes over the samples of a curve, one vector register at a time: residuals of f = p (k + c w) +
// F₀, p = (x − d)ⁿ below the surface and 0 above it, and the sums that Newton's method needs.
//
// The cost comes from residuals instead of sums of products: the difference between Σ F² and a
// nearly equal sum has no digits left if the noise is a millionth. Eight running sums of each kind
// are added at the end, so that the result has the same bits whether a processor adds two, four or
// eight numbers in parallel.
#pragma once

#include <cstddef>
#include <cstdint>

#include "palpate/batch_fit/curve_blocks.hpp"

// Vector registers of doubles, as wide as the source file is compiled for, with their logarithm and
// exponential from additions, multiplications, a division and bit operations. So each result has
// the same last bit for every register width, unless the compiler contracts operations
// (-ffp-contract=off prevents it).
//
// The code in PALPATE_INSTRUCTION_SET is compiled once per instruction set, with its own flags and
// in its own namespace: if an inline function were shared, the linker could keep the version that
// other processors cannot run. For the same reason this code does not call the standard library.
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

#else  // without vectors in the compiler a register has one number

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

// The leading bits of ln 2, whose multiples up to 2¹¹ are exact, and the rest.
inline constexpr double ln2_high = 0x1.62e42feep-1;
inline constexpr double ln2_low = 0x1.a39ef35793c76p-33;

// ln x = k ln 2 + ln m,  m in [√½, √2),   ln m = 2 artanh s,  s = (m − 1)/(m + 1),  |s| < 0.1716
//
// artanh s = s + s³/3 + s⁵/5 …: the terms after s¹⁹/19 are 2e-17 of the sum. For positive, finite
// and normal x (≥ 2.2e-308) the result is within 3.2e-16; for others it is meaningless.
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
// The terms after r¹²/12! are 2e-16 of the sum. For x in [−708, 709] the result is within 4e-16;
// for others it is meaningless.
PALPATE_INLINE Doubles exp(const Doubles& x) noexcept {
  // Near 1.5·2⁵² the last bit of a double is worth 1: the addition rounds to an integer.
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

inline constexpr std::size_t running_sums = 8;  // of each kind
inline constexpr double shallowest = 1e-290;    // least depth with a logarithm and an inverse

template <std::size_t Count>
struct alignas(64) RunningSums {
  double sum[Count][running_sums] = {};

  // Adds `terms` for each register of a block.
  template <class Terms>
  PALPATE_INLINE void add(const Terms& terms) noexcept {
    for (std::size_t own = 0; own < running_sums; own += register_size) {
      Doubles total[Count];
      for (std::size_t i = 0; i < Count; ++i) total[i] = load(&sum[i][own]);
      for (std::size_t i = own; i < curve_block; i += running_sums) terms(i, total);
      for (std::size_t i = 0; i < Count; ++i) store(&sum[i][own], total[i]);
    }
  }

  PALPATE_INLINE void give(double* to) const noexcept {
    for (std::size_t i = 0; i < Count; ++i) {
      const double* s = sum[i];
      to[i] = ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
    }
  }
};

// ξⁿ from ln ξ; results below e⁻⁷⁰⁰ are set to e⁻⁷⁰⁰.
PALPATE_INLINE Doubles power_of(const Doubles& log, double n) noexcept {
  const Doubles fall = -n * log, most = all(700.0);
  return exp(0.0 - (fall < most ? fall : most));
}

// The columns of a block.
struct alignas(64) CurveBlock {
  double p[curve_block], w[curve_block], r[curve_block], log[curve_block];
  double n[curve_block], d[curve_block], inverse[curve_block];
};

template <bool Surface>
PALPATE_INLINE void fill(CurveBlock& to, const CurveColumns& from, std::size_t first,
                         const CurveLaw& law) noexcept {
  for (std::size_t i = 0; i < curve_block; i += register_size) {
    Doubles log, power, inverse;
    if constexpr (Surface) {
      const Doubles depth = load(from.x + first + i) - law.surface;
      const auto below = depth > all(shallowest);
      const Doubles held = below ? depth : all(1.0);
      log = ln(held);
      power = below ? power_of(log, law.n) : all(0.0);
      inverse = 1.0 / held;
      store(to.inverse + i, inverse);
    } else {
      log = load(from.log + first + i);
      power = power_of(log, law.n);
    }
    const Doubles w = load(from.w + first + i);
    const Doubles force = power * (law.k + law.c * w);
    store(to.log + i, log);
    store(to.p + i, power);
    store(to.w + i, w);
    store(to.r + i, (load(from.f + first + i) - law.offset) - force);
    store(to.n + i, force * log);
    if constexpr (Surface) store(to.d + i, -law.n * force * inverse);
  }
}

// Stores the residuals; the padding of the last block gets none.
PALPATE_INLINE void keep_residuals(CurveBlock& block, const CurveColumns& of,
                                   std::size_t first) noexcept {
  for (std::size_t i = first + curve_block > of.count ? of.count - first : curve_block;
       i < curve_block; ++i) {
    block.r[i] = 0.0;
  }
  for (std::size_t i = 0; i < curve_block; i += register_size) {
    store(of.residual + first + i, load(block.r + i));
  }
}

PALPATE_INLINE bool is_above(const double* x, double surface) noexcept {
  Doubles deepest = load(x);
  for (std::size_t i = register_size; i < curve_block; i += register_size) {
    const Doubles next = load(x + i);
    deepest = next > deepest ? next : deepest;
  }
  double each[register_size];
  store(each, deepest);
  for (const double depth : each) {
    if (depth > surface) return false;
  }
  return true;
}

PALPATE_INLINE void add_first(RunningSums<8>& sums, const CurveBlock& from) noexcept {
  sums.add([&](std::size_t i, Doubles* total) noexcept {
    const Doubles p = load(from.p + i), r = load(from.r + i);
    const Doubles pw = p * load(from.w + i), n = load(from.n + i);
    total[0] += r * r;
    total[1] += r;
    total[2] += r * p;
    total[3] += r * pw;
    total[4] += r * n;
    total[5] += p;
    total[6] += pw;
    total[7] += n;
  });
}

PALPATE_INLINE void add_second(RunningSums<9>& sums, const CurveBlock& from) noexcept {
  sums.add([&](std::size_t i, Doubles* total) noexcept {
    const Doubles p = load(from.p + i), n = load(from.n + i);
    const Doubles pw = p * load(from.w + i);
    const Doubles rl = load(from.r + i) * load(from.log + i);
    total[0] += p * p;
    total[1] += p * pw;
    total[2] += pw * pw;
    total[3] += p * n;
    total[4] += pw * n;
    total[5] += n * n;
    total[6] += rl * p;
    total[7] += rl * pw;
    total[8] += rl * n;
  });
}

PALPATE_INLINE void add_third(RunningSums<10>& sums, const CurveBlock& from) noexcept {
  sums.add([&](std::size_t i, Doubles* total) noexcept {
    const Doubles p = load(from.p + i), pw = p * load(from.w + i);
    const Doubles d = load(from.d + i), r = load(from.r + i), r_d = r * d;
    const Doubles inverse = load(from.inverse + i), ri = r * inverse;
    total[0] += p * d;
    total[1] += pw * d;
    total[2] += load(from.n + i) * d;
    total[3] += d * d;
    total[4] += d;
    total[5] += r_d;
    total[6] += ri * p;
    total[7] += ri * pw;
    total[8] += r_d * load(from.log + i);
    total[9] += r_d * inverse;
  });
}

template <bool Surface>
void pass(const CurveColumns& columns, const CurveLaw& law, double* sums) noexcept {
  CurveBlock block;
  RunningSums<8> first_sums;
  RunningSums<9> second;
  RunningSums<10> third;
  RunningSums<2> above;
  for (std::size_t first = 0; first < columns.count; first += curve_block) {
    if constexpr (Surface) {
      // A block without contact only informs F₀.
      if (is_above(columns.x + first, law.surface)) {
        for (std::size_t i = 0; i < curve_block; i += register_size) {
          store(block.r + i, load(columns.f + first + i) - law.offset);
        }
        keep_residuals(block, columns, first);
        above.add([&](std::size_t i, Doubles* total) noexcept {
          const Doubles r = load(block.r + i);
          total[0] += r * r;
          total[1] += r;
        });
        continue;
      }
    }
    fill<Surface>(block, columns, first, law);
    keep_residuals(block, columns, first);
    add_first(first_sums, block);
    add_second(second, block);
    if constexpr (Surface) add_third(third, block);
  }
  first_sums.give(sums + rr);
  second.give(sums + p_p);
  if constexpr (Surface) {
    third.give(sums + p_d);
    double of_above[2];
    above.give(of_above);
    sums[rr] += of_above[0];
    sums[r1] += of_above[1];
  }
}

// ln x of whole blocks; smaller depths count as the shallowest.
inline void logarithms(const double* x, double* log, std::size_t count) noexcept {
  for (std::size_t i = 0; i < count; i += register_size) {
    const Doubles depth = load(x + i), least = all(shallowest);
    store(log + i, ln(depth > least ? depth : least));
  }
}

inline constexpr CurveKernels kernels{&pass<false>, &pass<true>, &logarithms};

}  // namespace PALPATE_INSTRUCTION_SET
}  // namespace palpate::curves
