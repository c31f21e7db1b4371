// Doubles side by side: Pack<8> is one register of AVX-512, two of AVX2, four of SSE2 or NEON, and
// an array where the compiler knows no vectors. Arithmetic is that of each lane alone, so a lane's
// bits are the same in all of them, if the compiler contracts nothing (-ffp-contract=off).
#pragma once

#include <cstddef>
#include <cstdint>

#include "palpate/lanes/instruction_set.hpp"

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace palpate::lanes {
inline namespace PALPATE_LANES_SET {

#if defined(__GNUC__)

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
#if defined(__GNUC__) && defined(__AVX512F__) && defined(__AVX512DQ__) && defined(__AVX512VL__) && \
    defined(__AVX512BW__)
#define PALPATE_LANES_BIT_MASKS 1
using RegisterMask = unsigned char;
#else
using RegisterMask = RegisterBits;
#endif

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
#if defined(__GNUC__)
  return *reinterpret_cast<const UnalignedDoubles*>(from);
#else
  RegisterDoubles result{};
  for (int i = 0; i < register_lanes; ++i) result[i] = from[i];
  return result;
#endif
}

PALPATE_LANES_INLINE void store(double* to, const RegisterDoubles& values) noexcept {
#if defined(__GNUC__)
  *reinterpret_cast<UnalignedDoubles*>(to) = values;
#else
  for (int i = 0; i < register_lanes; ++i) to[i] = values[i];
#endif
}

PALPATE_LANES_INLINE RegisterBits bits(const RegisterDoubles& values) noexcept {
#if defined(__GNUC__)
  return reinterpret_cast<RegisterBits>(values);
#else
  RegisterBits result{};
  for (int i = 0; i < register_lanes; ++i) result[i] = std::bit_cast<std::uint64_t>(values[i]);
  return result;
#endif
}

PALPATE_LANES_INLINE RegisterDoubles doubles(const RegisterBits& values) noexcept {
#if defined(__GNUC__)
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
#elif defined(__GNUC__)
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
#elif defined(__GNUC__)
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
#elif defined(__AVX2__) && defined(__GNUC__)
  return _mm256_blendv_pd(no, yes, reinterpret_cast<__m256d>(mask));
#else
  return doubles((mask & bits(yes)) | (~mask & bits(no)));
#endif
}

// A bit a lane, the first lane's lowest.
PALPATE_LANES_INLINE unsigned bits_of(const RegisterMask& mask) noexcept {
#if defined(PALPATE_LANES_BIT_MASKS)
  return mask;
#elif defined(__AVX2__) && defined(__GNUC__)
  return static_cast<unsigned>(_mm256_movemask_pd(reinterpret_cast<__m256d>(mask)));
#elif defined(__SSE2__) && defined(__GNUC__)
  return static_cast<unsigned>(_mm_movemask_pd(reinterpret_cast<__m128d>(mask)));
#else
  unsigned result = 0;
  for (int i = 0; i < register_lanes; ++i) result |= static_cast<unsigned>(mask[i] & 1U) << i;
  return result;
#endif
}

PALPATE_LANES_INLINE RegisterMask mask_of(unsigned lanes) noexcept {
#if defined(PALPATE_LANES_BIT_MASKS)
  return static_cast<RegisterMask>(lanes);
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
  for (int i = 0; i < 8; i += 2) {
    const RegisterDoubles a = rows[i], b = rows[i + 1];
    rows[i] = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
    rows[i + 1] = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int i = 0; i < 8; i = i % 4 == 1 ? i + 3 : i + 1) {
    const RegisterDoubles a = rows[i], b = rows[i + 2];
    rows[i] = __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
    rows[i + 2] = __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
  }
  for (int i = 0; i < 4; ++i) {
    const RegisterDoubles a = rows[i], b = rows[i + 4];
    rows[i] = __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11);
    rows[i + 4] = __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
  }
#elif defined(__AVX2__) && defined(__GNUC__)
  for (int i = 0; i < 4; i += 2) {
    const RegisterDoubles a = rows[i], b = rows[i + 1];
    rows[i] = _mm256_unpacklo_pd(a, b);
    rows[i + 1] = _mm256_unpackhi_pd(a, b);
  }
  for (int i = 0; i < 2; ++i) {
    const RegisterDoubles a = rows[i], b = rows[i + 2];
    rows[i] = _mm256_permute2f128_pd(a, b, 0x20);
    rows[i + 2] = _mm256_permute2f128_pd(a, b, 0x31);
  }
#elif defined(__SSE2__) && defined(__GNUC__)
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

// All parts of a pack, one after the other, without a loop left.
#if defined(__clang__)
#define PALPATE_LANES_EACH(i) _Pragma("clang loop unroll(full)") for (int i = 0; i < parts; ++i)
#elif defined(__GNUC__)
#define PALPATE_LANES_EACH(i) _Pragma("GCC unroll 16") for (int i = 0; i < parts; ++i)
#else
#define PALPATE_LANES_EACH(i) for (int i = 0; i < parts; ++i)
#endif

template <int Lanes>
struct Mask {
  static constexpr int parts = Lanes / register_lanes;
  static constexpr unsigned full = Lanes == 32 ? ~0U : (1U << Lanes) - 1U;
  RegisterMask part[parts];

  PALPATE_LANES_INLINE static Mask of_bits(unsigned lanes) noexcept {
    Mask result;
    PALPATE_LANES_EACH(i) result.part[i] = register_of::mask_of(lanes >> (i * register_lanes));
    return result;
  }

  // A bit a lane, the first lane's lowest.
  PALPATE_LANES_INLINE unsigned bits() const noexcept {
    unsigned result = 0;
    PALPATE_LANES_EACH(i) result |= register_of::bits_of(part[i]) << (i * register_lanes);
    return result;
  }

  PALPATE_LANES_INLINE friend Mask operator&(const Mask& a, const Mask& b) noexcept {
    Mask result;
    PALPATE_LANES_EACH(i) result.part[i] = register_of::both(a.part[i], b.part[i]);
    return result;
  }
  PALPATE_LANES_INLINE friend Mask operator|(const Mask& a, const Mask& b) noexcept {
    Mask result;
    PALPATE_LANES_EACH(i) result.part[i] = register_of::either(a.part[i], b.part[i]);
    return result;
  }
};

// The bits of doubles, as whole numbers without a sign.
template <int Lanes>
struct Bits {
  static constexpr int parts = Lanes / register_lanes;
  RegisterBits part[parts];

  PALPATE_LANES_INLINE static Bits all(std::uint64_t value) noexcept {
    Bits result;
    PALPATE_LANES_EACH(i) result.part[i] = register_of::all_bits(value);
    return result;
  }

  PALPATE_LANES_INLINE friend Bits operator+(const Bits& a, const Bits& b) noexcept {
    Bits result;
    PALPATE_LANES_EACH(i) result.part[i] = a.part[i] + b.part[i];
    return result;
  }
  PALPATE_LANES_INLINE friend Bits operator-(const Bits& a, const Bits& b) noexcept {
    Bits result;
    PALPATE_LANES_EACH(i) result.part[i] = a.part[i] - b.part[i];
    return result;
  }
  PALPATE_LANES_INLINE friend Bits operator&(const Bits& a, const Bits& b) noexcept {
    Bits result;
    PALPATE_LANES_EACH(i) result.part[i] = a.part[i] & b.part[i];
    return result;
  }
  PALPATE_LANES_INLINE friend Bits operator|(const Bits& a, const Bits& b) noexcept {
    Bits result;
    PALPATE_LANES_EACH(i) result.part[i] = a.part[i] | b.part[i];
    return result;
  }
  PALPATE_LANES_INLINE friend Bits operator<<(const Bits& a, int by) noexcept {
    Bits result;
    PALPATE_LANES_EACH(i) result.part[i] = a.part[i] << by;
    return result;
  }
  PALPATE_LANES_INLINE friend Bits operator>>(const Bits& a, int by) noexcept {
    Bits result;
    PALPATE_LANES_EACH(i) result.part[i] = a.part[i] >> by;
    return result;
  }
};

template <int Lanes>
struct Pack {
  static_assert(Lanes % register_lanes == 0 && Lanes <= 32);
  static constexpr int lanes = Lanes;
  static constexpr int parts = Lanes / register_lanes;
  RegisterDoubles part[parts];

  PALPATE_LANES_INLINE static Pack all(double value) noexcept {
    Pack result;
    PALPATE_LANES_EACH(i) result.part[i] = register_of::all(value);
    return result;
  }
  PALPATE_LANES_INLINE static Pack load(const double* from) noexcept {
    Pack result;
    PALPATE_LANES_EACH(i) result.part[i] = register_of::load(from + i * register_lanes);
    return result;
  }
  PALPATE_LANES_INLINE void store(double* to) const noexcept {
    PALPATE_LANES_EACH(i) register_of::store(to + i * register_lanes, part[i]);
  }

  PALPATE_LANES_INLINE friend Pack operator+(const Pack& a, const Pack& b) noexcept {
    Pack result;
    PALPATE_LANES_EACH(i) result.part[i] = a.part[i] + b.part[i];
    return result;
  }
  PALPATE_LANES_INLINE friend Pack operator-(const Pack& a, const Pack& b) noexcept {
    Pack result;
    PALPATE_LANES_EACH(i) result.part[i] = a.part[i] - b.part[i];
    return result;
  }
  PALPATE_LANES_INLINE friend Pack operator*(const Pack& a, const Pack& b) noexcept {
    Pack result;
    PALPATE_LANES_EACH(i) result.part[i] = a.part[i] * b.part[i];
    return result;
  }
  PALPATE_LANES_INLINE friend Pack operator/(const Pack& a, const Pack& b) noexcept {
    Pack result;
    PALPATE_LANES_EACH(i) result.part[i] = a.part[i] / b.part[i];
    return result;
  }
  PALPATE_LANES_INLINE friend Mask<Lanes> operator<(const Pack& a, const Pack& b) noexcept {
    Mask<Lanes> result;
    PALPATE_LANES_EACH(i) result.part[i] = register_of::less(a.part[i], b.part[i]);
    return result;
  }
  PALPATE_LANES_INLINE friend Mask<Lanes> operator<=(const Pack& a, const Pack& b) noexcept {
    Mask<Lanes> result;
    PALPATE_LANES_EACH(i) result.part[i] = register_of::less_equal(a.part[i], b.part[i]);
    return result;
  }
  PALPATE_LANES_INLINE friend Mask<Lanes> operator>(const Pack& a, const Pack& b) noexcept {
    return b < a;
  }
  PALPATE_LANES_INLINE friend Mask<Lanes> operator>=(const Pack& a, const Pack& b) noexcept {
    return b <= a;
  }

  PALPATE_LANES_INLINE friend Pack select(const Mask<Lanes>& mask, const Pack& yes,
                                          const Pack& no) noexcept {
    Pack result;
    PALPATE_LANES_EACH(i) {
      result.part[i] = register_of::select(mask.part[i], yes.part[i], no.part[i]);
    }
    return result;
  }

  PALPATE_LANES_INLINE friend Bits<Lanes> bits_of(const Pack& values) noexcept {
    Bits<Lanes> result;
    PALPATE_LANES_EACH(i) result.part[i] = register_of::bits(values.part[i]);
    return result;
  }
  PALPATE_LANES_INLINE static Pack of_bits(const Bits<Lanes>& bits) noexcept {
    Pack result;
    PALPATE_LANES_EACH(i) result.part[i] = register_of::doubles(bits.part[i]);
    return result;
  }

  PALPATE_LANES_INLINE friend Pack abs(const Pack& values) noexcept {
    return of_bits(bits_of(values) & Bits<Lanes>::all(0x7fffffffffffffffU));
  }
  // Where either is NaN, the second: a test for NaN has to stand elsewhere.
  PALPATE_LANES_INLINE friend Pack lesser(const Pack& a, const Pack& b) noexcept {
#if defined(__SSE2__) && defined(__GNUC__)
    Pack result;
    PALPATE_LANES_EACH(i) {
#if defined(PALPATE_LANES_BIT_MASKS)
      // Under a full mask: the plain one of GCC 12 warns of its own undefined operand.
      result.part[i] = _mm512_mask_min_pd(a.part[i], 0xff, a.part[i], b.part[i]);
#elif defined(__AVX2__)
      result.part[i] = _mm256_min_pd(a.part[i], b.part[i]);
#else
      result.part[i] = _mm_min_pd(a.part[i], b.part[i]);
#endif
    }
    return result;
#else
    return select(a < b, a, b);
#endif
  }
};

}  // namespace PALPATE_LANES_SET
}  // namespace palpate::lanes
