// Doubles side by side: Pack<8> is one register of AVX-512, two of AVX2, four of SSE2 or NEON.
// Arithmetic is that of each lane alone, so a lane's bits are the same in all of them, if the
// compiler contracts nothing (-ffp-contract=off).
#pragma once

#include <cstdint>

#include "palpate/lanes/instruction_set.hpp"
#include "palpate/lanes/registers.hpp"

namespace palpate::lanes {
inline namespace PALPATE_LANES_SET {

// A pack whose part i is act(Index<i>{}).
template <class Result, class Act>
PALPATE_LANES_INLINE Result in_parts(const Act& act) noexcept {
  Result result;
  each<Result::parts>([&](auto i) PALPATE_LANES_LAMBDA { result.part[i.value] = act(i); });
  return result;
}

template <int Lanes>
struct Mask {
  static constexpr int parts = Lanes / register_lanes;
  static constexpr unsigned full = Lanes == 32 ? ~0U : (1U << Lanes) - 1U;
  RegisterMask part[parts];

  PALPATE_LANES_INLINE static Mask of_bits(unsigned lanes) noexcept {
    return in_parts<Mask>([&](auto i) PALPATE_LANES_LAMBDA {
      return register_of::mask_of(lanes >> (i.value * register_lanes));
    });
  }

  // A bit a lane, the first lane's lowest.
  PALPATE_LANES_INLINE unsigned bits() const noexcept {
    unsigned result = 0;
    each<parts>([&](auto i) PALPATE_LANES_LAMBDA {
      result |= register_of::bits_of(part[i.value]) << (i.value * register_lanes);
    });
    return result;
  }

  PALPATE_LANES_INLINE friend Mask operator&(const Mask& a, const Mask& b) noexcept {
    return in_parts<Mask>([&](auto i) PALPATE_LANES_LAMBDA {
      return register_of::both(a.part[i.value], b.part[i.value]);
    });
  }
  PALPATE_LANES_INLINE friend Mask operator|(const Mask& a, const Mask& b) noexcept {
    return in_parts<Mask>([&](auto i) PALPATE_LANES_LAMBDA {
      return register_of::either(a.part[i.value], b.part[i.value]);
    });
  }
};

// The bits of doubles, as whole numbers without a sign.
template <int Lanes>
struct Bits {
  static constexpr int parts = Lanes / register_lanes;
  RegisterBits part[parts];

  PALPATE_LANES_INLINE static Bits all(std::uint64_t value) noexcept {
    return in_parts<Bits>([&](auto) PALPATE_LANES_LAMBDA { return register_of::all_bits(value); });
  }

  PALPATE_LANES_INLINE friend Bits operator+(const Bits& a, const Bits& b) noexcept {
    return in_parts<Bits>([&](auto i)
                              PALPATE_LANES_LAMBDA { return a.part[i.value] + b.part[i.value]; });
  }
  PALPATE_LANES_INLINE friend Bits operator-(const Bits& a, const Bits& b) noexcept {
    return in_parts<Bits>([&](auto i)
                              PALPATE_LANES_LAMBDA { return a.part[i.value] - b.part[i.value]; });
  }
  PALPATE_LANES_INLINE friend Bits operator&(const Bits& a, const Bits& b) noexcept {
    return in_parts<Bits>([&](auto i)
                              PALPATE_LANES_LAMBDA { return a.part[i.value] & b.part[i.value]; });
  }
  PALPATE_LANES_INLINE friend Bits operator|(const Bits& a, const Bits& b) noexcept {
    return in_parts<Bits>([&](auto i)
                              PALPATE_LANES_LAMBDA { return a.part[i.value] | b.part[i.value]; });
  }
  PALPATE_LANES_INLINE friend Bits operator<<(const Bits& a, int by) noexcept {
    return in_parts<Bits>([&](auto i) PALPATE_LANES_LAMBDA { return a.part[i.value] << by; });
  }
  PALPATE_LANES_INLINE friend Bits operator>>(const Bits& a, int by) noexcept {
    return in_parts<Bits>([&](auto i) PALPATE_LANES_LAMBDA { return a.part[i.value] >> by; });
  }
};

template <int Lanes>
struct Pack {
  static_assert(Lanes % register_lanes == 0 && Lanes <= 32);
  static constexpr int lanes = Lanes;
  static constexpr int parts = Lanes / register_lanes;
  RegisterDoubles part[parts];

  PALPATE_LANES_INLINE static Pack all(double value) noexcept {
    return in_parts<Pack>([&](auto) PALPATE_LANES_LAMBDA { return register_of::all(value); });
  }
  PALPATE_LANES_INLINE static Pack load(const double* from) noexcept {
    return in_parts<Pack>([&](auto i) PALPATE_LANES_LAMBDA {
      return register_of::load(from + i.value * register_lanes);
    });
  }
  PALPATE_LANES_INLINE void store(double* to) const noexcept {
    each<parts>([&](auto i) PALPATE_LANES_LAMBDA {
      register_of::store(to + i.value * register_lanes, part[i.value]);
    });
  }

  PALPATE_LANES_INLINE friend Pack operator+(const Pack& a, const Pack& b) noexcept {
    return in_parts<Pack>([&](auto i)
                              PALPATE_LANES_LAMBDA { return a.part[i.value] + b.part[i.value]; });
  }
  PALPATE_LANES_INLINE friend Pack operator-(const Pack& a, const Pack& b) noexcept {
    return in_parts<Pack>([&](auto i)
                              PALPATE_LANES_LAMBDA { return a.part[i.value] - b.part[i.value]; });
  }
  PALPATE_LANES_INLINE friend Pack operator*(const Pack& a, const Pack& b) noexcept {
    return in_parts<Pack>([&](auto i)
                              PALPATE_LANES_LAMBDA { return a.part[i.value] * b.part[i.value]; });
  }
  PALPATE_LANES_INLINE friend Pack operator/(const Pack& a, const Pack& b) noexcept {
    return in_parts<Pack>([&](auto i)
                              PALPATE_LANES_LAMBDA { return a.part[i.value] / b.part[i.value]; });
  }
  PALPATE_LANES_INLINE friend Mask<Lanes> operator<(const Pack& a, const Pack& b) noexcept {
    return in_parts<Mask<Lanes>>([&](auto i) PALPATE_LANES_LAMBDA {
      return register_of::less(a.part[i.value], b.part[i.value]);
    });
  }
  PALPATE_LANES_INLINE friend Mask<Lanes> operator<=(const Pack& a, const Pack& b) noexcept {
    return in_parts<Mask<Lanes>>([&](auto i) PALPATE_LANES_LAMBDA {
      return register_of::less_equal(a.part[i.value], b.part[i.value]);
    });
  }
  PALPATE_LANES_INLINE friend Mask<Lanes> operator>(const Pack& a, const Pack& b) noexcept {
    return b < a;
  }
  PALPATE_LANES_INLINE friend Mask<Lanes> operator>=(const Pack& a, const Pack& b) noexcept {
    return b <= a;
  }

  PALPATE_LANES_INLINE friend Pack select(const Mask<Lanes>& mask, const Pack& yes,
                                          const Pack& no) noexcept {
    return in_parts<Pack>([&](auto i) PALPATE_LANES_LAMBDA {
      return register_of::select(mask.part[i.value], yes.part[i.value], no.part[i.value]);
    });
  }

  PALPATE_LANES_INLINE friend Bits<Lanes> bits_of(const Pack& values) noexcept {
    return in_parts<Bits<Lanes>>(
        [&](auto i) PALPATE_LANES_LAMBDA { return register_of::bits(values.part[i.value]); });
  }
  PALPATE_LANES_INLINE static Pack of_bits(const Bits<Lanes>& bits) noexcept {
    return in_parts<Pack>(
        [&](auto i) PALPATE_LANES_LAMBDA { return register_of::doubles(bits.part[i.value]); });
  }

  PALPATE_LANES_INLINE friend Pack abs(const Pack& values) noexcept {
    return of_bits(bits_of(values) & Bits<Lanes>::all(0x7fffffffffffffffU));
  }
  // Where either is NaN, the second: a test for NaN has to stand elsewhere.
  PALPATE_LANES_INLINE friend Pack lesser(const Pack& a, const Pack& b) noexcept {
#if defined(__SSE2__) && defined(PALPATE_LANES_VECTORS)
    Pack result;
    each<parts>([&](auto i) PALPATE_LANES_LAMBDA {
#if defined(PALPATE_LANES_BIT_MASKS)
      // Under a full mask: the plain one of GCC 12 warns of its own undefined operand.
      result.part[i.value] =
          _mm512_mask_min_pd(a.part[i.value], 0xff, a.part[i.value], b.part[i.value]);
#elif defined(__AVX2__)
      result.part[i.value] = _mm256_min_pd(a.part[i.value], b.part[i.value]);
#else
      result.part[i.value] = _mm_min_pd(a.part[i.value], b.part[i.value]);
#endif
    });
    return result;
#else
    return select(a < b, a, b);
#endif
  }
};

}  // namespace PALPATE_LANES_SET
}  // namespace palpate::lanes
