// The widest register of doubles that a source file is compiled for, and what is done with it:
// AVX-512, AVX2, SSE2 or NEON by the compiler's own vectors, and an array where it knows none.
#pragma once

#include <bit>
#include <cstdint>
#include <utility>

#include "palpate/lanes/instruction_set.hpp"

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace palpate::lanes {
inline namespace PALPATE_LANES_SET {

#if defined(PALPATE_LANES_VECTORS)

// Doubles in a register.
#if defined(__AVX512F__) && defined(__AVX512DQ__) && defined(__AVX512VL__) && defined(__AVX512BW__)
inline constexpr int register_lanes = 8;
#elif defined(__AVX2__)
inline constexpr int register_lanes = 4;
#else
inline constexpr int register_lanes = 2;
#endif

typedef double RegisterDoubles __attribute__((vector_size(8 * register_lanes)));
typedef std::uint64_t RegisterBits __attribute__((vector_size(8 * register_lanes)));
typedef double UnalignedDoubles
    __attribute__((vector_size(8 * register_lanes), aligned(8), may_alias));

#else  // plain loops, which such a compiler may or may not turn into vectors

inline constexpr int register_lanes = 4;

template <class Number>
struct Array {
  Number lane[register_lanes];

  friend Array operator+(Array a, const Array& b) noexcept {
    for (int i = 0; i < register_lanes; ++i) a.lane[i] += b.lane[i];
    return a;
  }
  friend Array operator-(Array a, const Array& b) noexcept {
    for (int i = 0; i < register_lanes; ++i) a.lane[i] -= b.lane[i];
    return a;
  }
  friend Array operator*(Array a, const Array& b) noexcept {
    for (int i = 0; i < register_lanes; ++i) a.lane[i] *= b.lane[i];
    return a;
  }
  friend Array operator/(Array a, const Array& b) noexcept {
    for (int i = 0; i < register_lanes; ++i) a.lane[i] /= b.lane[i];
    return a;
  }
  friend Array operator&(Array a, const Array& b) noexcept {
    for (int i = 0; i < register_lanes; ++i) a.lane[i] &= b.lane[i];
    return a;
  }
  friend Array operator|(Array a, const Array& b) noexcept {
    for (int i = 0; i < register_lanes; ++i) a.lane[i] |= b.lane[i];
    return a;
  }
  friend Array operator~(Array a) noexcept {
    for (int i = 0; i < register_lanes; ++i) a.lane[i] = ~a.lane[i];
    return a;
  }
  friend Array operator<<(Array a, int by) noexcept {
    for (int i = 0; i < register_lanes; ++i) a.lane[i] <<= by;
    return a;
  }
  friend Array operator>>(Array a, int by) noexcept {
    for (int i = 0; i < register_lanes; ++i) a.lane[i] >>= by;
    return a;
  }
  Number& operator[](int i) noexcept { return lane[i]; }
  Number operator[](int i) const noexcept { return lane[i]; }
};

using RegisterDoubles = Array<double>;
using RegisterBits = Array<std::uint64_t>;

#endif

// What comparisons give: all bits of a lane, or none; with AVX-512 a bit a lane.
#if defined(PALPATE_LANES_VECTORS) && defined(__AVX512F__) && defined(__AVX512DQ__) && \
    defined(__AVX512VL__) && defined(__AVX512BW__)
#define PALPATE_LANES_BIT_MASKS 1
using RegisterMask = unsigned char;
#else
using RegisterMask = RegisterBits;
#endif

template <int I>
struct Index {
  static constexpr int value = I;
};

template <class Act, int... I>
PALPATE_LANES_INLINE void each_of(std::integer_sequence<int, I...>, const Act& act) noexcept {
  (act(Index<I>{}), ...);
}

// Calls act(Index<0>{}) … act(Index<Count − 1>{}): a loop that is none any more before the compiler
// decides what stays in registers.
template <int Count, class Act>
PALPATE_LANES_INLINE void each(const Act& act) noexcept {
  each_of(std::make_integer_sequence<int, Count>{}, act);
}

namespace register_of {

PALPATE_LANES_INLINE RegisterDoubles all(double value) noexcept {
  RegisterDoubles result{};
  for (int i = 0; i < register_lanes; ++i) result[i] = value;
  return result;
}

PALPATE_LANES_INLINE RegisterBits all_bits(std::uint64_t value) noexcept {
  RegisterBits result{};
  for (int i = 0; i < register_lanes; ++i) result[i] = value;
  return result;
}

PALPATE_LANES_INLINE RegisterDoubles load(const double* from) noexcept {
#if defined(PALPATE_LANES_VECTORS)
  return *reinterpret_cast<const UnalignedDoubles*>(from);
#else
  RegisterDoubles result{};
  for (int i = 0; i < register_lanes; ++i) result[i] = from[i];
  return result;
#endif
}

PALPATE_LANES_INLINE void store(double* to, const RegisterDoubles& values) noexcept {
#if defined(PALPATE_LANES_VECTORS)
  *reinterpret_cast<UnalignedDoubles*>(to) = values;
#else
  for (int i = 0; i < register_lanes; ++i) to[i] = values[i];
#endif
}

// Asks for what lies there to be in the cache soon; nothing has to lie there.
PALPATE_LANES_INLINE void fetch([[maybe_unused]] const double* from) noexcept {
#if defined(PALPATE_LANES_VECTORS)
  __builtin_prefetch(from);
#endif
}

PALPATE_LANES_INLINE RegisterBits bits(const RegisterDoubles& values) noexcept {
#if defined(PALPATE_LANES_VECTORS)
  return reinterpret_cast<RegisterBits>(values);
#else
  RegisterBits result{};
  for (int i = 0; i < register_lanes; ++i) result[i] = std::bit_cast<std::uint64_t>(values[i]);
  return result;
#endif
}

PALPATE_LANES_INLINE RegisterDoubles doubles(const RegisterBits& values) noexcept {
#if defined(PALPATE_LANES_VECTORS)
  return reinterpret_cast<RegisterDoubles>(values);
#else
  RegisterDoubles result{};
  for (int i = 0; i < register_lanes; ++i) result[i] = std::bit_cast<double>(values[i]);
  return result;
#endif
}

PALPATE_LANES_INLINE RegisterMask less(const RegisterDoubles& a,
                                       const RegisterDoubles& b) noexcept {
#if defined(PALPATE_LANES_BIT_MASKS)
  return _mm512_cmp_pd_mask(a, b, _CMP_LT_OQ);
#elif defined(PALPATE_LANES_VECTORS)
  return reinterpret_cast<RegisterMask>(a < b);
#else
  RegisterMask result{};
  for (int i = 0; i < register_lanes; ++i) result[i] = a[i] < b[i] ? ~std::uint64_t{0} : 0;
  return result;
#endif
}

PALPATE_LANES_INLINE RegisterMask less_equal(const RegisterDoubles& a,
                                             const RegisterDoubles& b) noexcept {
#if defined(PALPATE_LANES_BIT_MASKS)
  return _mm512_cmp_pd_mask(a, b, _CMP_LE_OQ);
#elif defined(PALPATE_LANES_VECTORS)
  return reinterpret_cast<RegisterMask>(a <= b);
#else
  RegisterMask result{};
  for (int i = 0; i < register_lanes; ++i) result[i] = a[i] <= b[i] ? ~std::uint64_t{0} : 0;
  return result;
#endif
}

PALPATE_LANES_INLINE RegisterMask both(const RegisterMask& a, const RegisterMask& b) noexcept {
  return static_cast<RegisterMask>(a & b);
}

PALPATE_LANES_INLINE RegisterMask either(const RegisterMask& a, const RegisterMask& b) noexcept {
  return static_cast<RegisterMask>(a | b);
}

PALPATE_LANES_INLINE RegisterDoubles select(const RegisterMask& mask, const RegisterDoubles& yes,
                                            const RegisterDoubles& no) noexcept {
#if defined(PALPATE_LANES_BIT_MASKS)
  return _mm512_mask_blend_pd(mask, no, yes);
#elif defined(__AVX2__) && defined(PALPATE_LANES_VECTORS)
  return _mm256_blendv_pd(no, yes, reinterpret_cast<__m256d>(mask));
#else
  return doubles((mask & bits(yes)) | (~mask & bits(no)));
#endif
}

// A bit a lane, the first lane's lowest.
PALPATE_LANES_INLINE unsigned bits_of(const RegisterMask& mask) noexcept {
#if defined(PALPATE_LANES_BIT_MASKS)
  return mask;
#elif defined(__AVX2__) && defined(PALPATE_LANES_VECTORS)
  return static_cast<unsigned>(_mm256_movemask_pd(reinterpret_cast<__m256d>(mask)));
#elif defined(__SSE2__) && defined(PALPATE_LANES_VECTORS)
  return static_cast<unsigned>(_mm_movemask_pd(reinterpret_cast<__m128d>(mask)));
#else
  unsigned result = 0;
  for (int i = 0; i < register_lanes; ++i) result |= static_cast<unsigned>(mask[i] & 1U) << i;
  return result;
#endif
}

#if !defined(PALPATE_LANES_BIT_MASKS)
// The mask of each set of lanes: looked up, as there is no instruction for it.
struct MaskTable {
  alignas(32) std::uint64_t mask[1 << register_lanes][register_lanes]{};

  constexpr MaskTable() noexcept {
    for (unsigned lanes = 0; lanes < 1U << register_lanes; ++lanes) {
      for (unsigned i = 0; i < register_lanes; ++i) {
        mask[lanes][i] = (lanes >> i) & 1U ? ~std::uint64_t{0} : 0;
      }
    }
  }
};
inline constexpr MaskTable mask_table;
#endif

PALPATE_LANES_INLINE RegisterMask mask_of(unsigned lanes) noexcept {
#if defined(PALPATE_LANES_BIT_MASKS)
  return static_cast<RegisterMask>(lanes);
#elif defined(PALPATE_LANES_VECTORS)
  const auto* found = mask_table.mask[lanes & ((1U << register_lanes) - 1U)];
  return bits(load(reinterpret_cast<const double*>(found)));
#else
  RegisterMask result{};
  for (int i = 0; i < register_lanes; ++i) {
    result[i] = (lanes >> i) & 1U ? ~std::uint64_t{0} : std::uint64_t{0};
  }
  return result;
#endif
}

// Exchanges rows and columns of register_lanes × register_lanes doubles.
PALPATE_LANES_INLINE void transpose(RegisterDoubles (&rows)[register_lanes]) noexcept {
#if defined(PALPATE_LANES_BIT_MASKS)
  each<4>([&](auto pair) PALPATE_LANES_LAMBDA {
    constexpr int i = 2 * decltype(pair)::value;
    const RegisterDoubles a = rows[i], b = rows[i + 1];
    rows[i] = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
    rows[i + 1] = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  });
  each<4>([&](auto pair) PALPATE_LANES_LAMBDA {
    constexpr int i = decltype(pair)::value + decltype(pair)::value / 2 * 2;  // 0, 1, 4, 5
    const RegisterDoubles a = rows[i], b = rows[i + 2];
    rows[i] = __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
    rows[i + 2] = __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
  });
  each<4>([&](auto pair) PALPATE_LANES_LAMBDA {
    constexpr int i = decltype(pair)::value;
    const RegisterDoubles a = rows[i], b = rows[i + 4];
    rows[i] = __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11);
    rows[i + 4] = __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
  });
#elif defined(__AVX2__) && defined(PALPATE_LANES_VECTORS)
  each<2>([&](auto pair) PALPATE_LANES_LAMBDA {
    constexpr int i = 2 * decltype(pair)::value;
    const RegisterDoubles a = rows[i], b = rows[i + 1];
    rows[i] = _mm256_unpacklo_pd(a, b);
    rows[i + 1] = _mm256_unpackhi_pd(a, b);
  });
  each<2>([&](auto pair) PALPATE_LANES_LAMBDA {
    constexpr int i = decltype(pair)::value;
    const RegisterDoubles a = rows[i], b = rows[i + 2];
    rows[i] = _mm256_permute2f128_pd(a, b, 0x20);
    rows[i + 2] = _mm256_permute2f128_pd(a, b, 0x31);
  });
#elif defined(__SSE2__) && defined(PALPATE_LANES_VECTORS)
  const RegisterDoubles a = rows[0], b = rows[1];
  rows[0] = _mm_unpacklo_pd(a, b);
  rows[1] = _mm_unpackhi_pd(a, b);
#else
  for (int i = 0; i < register_lanes; ++i) {
    for (int j = 0; j < i; ++j) {
      const double upper = rows[j][i];
      rows[j][i] = rows[i][j];
      rows[i][j] = upper;
    }
  }
#endif
}

}  // namespace register_of

}  // namespace PALPATE_LANES_SET
}  // namespace palpate::lanes
