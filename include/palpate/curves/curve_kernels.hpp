// Passes over the samples of a curve in vector lanes: residuals of f = p (k + c w) + F₀, p = (x −
// d)ⁿ below the surface and 0 above it, and the sums that Newton's method needs.
//
// Residuals and not sums of products make the cost: Σ F² less a sum as large has no digits left
// where noise is a millionth. Eight running sums of each kind are added up at the end: the same
// bits whether a processor takes two, four or eight at once.
#pragma once

#include <cstddef>

#include "palpate/curves/curve_blocks.hpp"
#include "palpate/lanes/elementary.hpp"
#include "palpate/lanes/instruction_set.hpp"
#include "palpate/lanes/pack.hpp"

namespace palpate::lanes {
inline namespace PALPATE_LANES_SET {

inline constexpr std::size_t sum_lanes = 8;
using Wide = Pack<sum_lanes>;                 // all of them
using Narrow = Pack<register_lanes>;          // those of a register
inline constexpr double shallowest = 1e-290;  // of a depth that has a logarithm and an inverse

template <std::size_t Count>
struct alignas(64) LaneSums {
  double sum[Count][sum_lanes] = {};

  // Adds up what `terms` makes of each register of a block.
  template <class Terms>
  PALPATE_LANES_INLINE void add(const Terms& terms) noexcept {
    for (std::size_t lane = 0; lane < sum_lanes; lane += register_lanes) {
      Narrow total[Count];
      for (std::size_t i = 0; i < Count; ++i) total[i] = Narrow::load(&sum[i][lane]);
      for (std::size_t i = lane; i < curve_block; i += sum_lanes) terms(i, total);
      for (std::size_t i = 0; i < Count; ++i) total[i].store(&sum[i][lane]);
    }
  }

  PALPATE_LANES_INLINE void give(double* to) const noexcept {
    for (std::size_t i = 0; i < Count; ++i) {
      const double* s = sum[i];
      to[i] = ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
    }
  }
};

PALPATE_LANES_INLINE void add_to(Narrow& sum, const Narrow& term) noexcept { sum = sum + term; }

// ξⁿ of ln ξ; what is below e⁻⁷⁰⁰ is as at it.
PALPATE_LANES_INLINE Wide power_of(const Wide& log, double n) noexcept {
  return exp(Wide::all(0.0) - lesser(Wide::all(-n) * log, Wide::all(700.0)));
}

// The columns of a block.
struct alignas(64) CurveBlock {
  double p[curve_block], w[curve_block], r[curve_block], log[curve_block];
  double n[curve_block], d[curve_block], inverse[curve_block];
};

template <bool Surface>
PALPATE_LANES_INLINE void fill(CurveBlock& to, const CurveColumns& from, std::size_t first,
                               const CurveLaw& law) noexcept {
  for (std::size_t i = 0; i < curve_block; i += sum_lanes) {
    Wide log, power, inverse;
    if constexpr (Surface) {
      const Wide depth = Wide::load(from.x + first + i) - Wide::all(law.surface);
      const auto below = depth > Wide::all(shallowest);
      const Wide held = select(below, depth, Wide::all(1.0));
      log = ln(held);
      power = select(below, power_of(log, law.n), Wide::all(0.0));
      inverse = Wide::all(1.0) / held;
      inverse.store(to.inverse + i);
    } else {
      log = Wide::load(from.log + first + i);
      power = power_of(log, law.n);
    }
    const Wide w = Wide::load(from.w + first + i);
    const Wide force = power * (Wide::all(law.k) + Wide::all(law.c) * w);
    log.store(to.log + i);
    power.store(to.p + i);
    w.store(to.w + i);
    ((Wide::load(from.f + first + i) - Wide::all(law.offset)) - force).store(to.r + i);
    (force * log).store(to.n + i);
    if constexpr (Surface) (Wide::all(-law.n) * force * inverse).store(to.d + i);
  }
}

// What fills the last block up has no residual.
PALPATE_LANES_INLINE void keep_residuals(CurveBlock& block, const CurveColumns& of,
                                         std::size_t first) noexcept {
  for (std::size_t i = first + curve_block > of.count ? of.count - first : curve_block;
       i < curve_block; ++i) {
    block.r[i] = 0.0;
  }
  for (std::size_t i = 0; i < curve_block; i += sum_lanes) {
    Wide::load(block.r + i).store(of.residual + first + i);
  }
}

PALPATE_LANES_INLINE bool is_above(const double* x, double surface) noexcept {
  Wide deepest = Wide::load(x);
  for (std::size_t i = sum_lanes; i < curve_block; i += sum_lanes) {
    const Wide next = Wide::load(x + i);
    deepest = select(next > deepest, next, deepest);
  }
  return (deepest > Wide::all(surface)).bits() == 0;
}

PALPATE_LANES_INLINE void add_first(LaneSums<8>& sums, const CurveBlock& from) noexcept {
  sums.add([&](std::size_t i, Narrow* total) noexcept {
    const Narrow p = Narrow::load(from.p + i), r = Narrow::load(from.r + i);
    const Narrow pw = p * Narrow::load(from.w + i), n = Narrow::load(from.n + i);
    add_to(total[0], r * r);
    add_to(total[1], r);
    add_to(total[2], r * p);
    add_to(total[3], r * pw);
    add_to(total[4], r * n);
    add_to(total[5], p);
    add_to(total[6], pw);
    add_to(total[7], n);
  });
}

PALPATE_LANES_INLINE void add_second(LaneSums<9>& sums, const CurveBlock& from) noexcept {
  sums.add([&](std::size_t i, Narrow* total) noexcept {
    const Narrow p = Narrow::load(from.p + i), n = Narrow::load(from.n + i);
    const Narrow pw = p * Narrow::load(from.w + i);
    const Narrow rl = Narrow::load(from.r + i) * Narrow::load(from.log + i);
    add_to(total[0], p * p);
    add_to(total[1], p * pw);
    add_to(total[2], pw * pw);
    add_to(total[3], p * n);
    add_to(total[4], pw * n);
    add_to(total[5], n * n);
    add_to(total[6], rl * p);
    add_to(total[7], rl * pw);
    add_to(total[8], rl * n);
  });
}

PALPATE_LANES_INLINE void add_third(LaneSums<10>& sums, const CurveBlock& from) noexcept {
  sums.add([&](std::size_t i, Narrow* total) noexcept {
    const Narrow p = Narrow::load(from.p + i), pw = p * Narrow::load(from.w + i);
    const Narrow d = Narrow::load(from.d + i), r = Narrow::load(from.r + i), r_d = r * d;
    const Narrow inverse = Narrow::load(from.inverse + i), ri = r * inverse;
    add_to(total[0], p * d);
    add_to(total[1], pw * d);
    add_to(total[2], Narrow::load(from.n + i) * d);
    add_to(total[3], d * d);
    add_to(total[4], d);
    add_to(total[5], r_d);
    add_to(total[6], ri * p);
    add_to(total[7], ri * pw);
    add_to(total[8], r_d * Narrow::load(from.log + i));
    add_to(total[9], r_d * inverse);
  });
}

template <bool Surface>
void pass(const CurveColumns& columns, const CurveLaw& law, double* sums) noexcept {
  CurveBlock block;
  LaneSums<8> first_sums;
  LaneSums<9> second;
  LaneSums<10> third;
  LaneSums<2> above;
  for (std::size_t first = 0; first < columns.count; first += curve_block) {
    if constexpr (Surface) {
      // A block without contact informs F₀ only.
      if (is_above(columns.x + first, law.surface)) {
        for (std::size_t i = 0; i < curve_block; i += sum_lanes) {
          (Wide::load(columns.f + first + i) - Wide::all(law.offset)).store(block.r + i);
        }
        keep_residuals(block, columns, first);
        above.add([&](std::size_t i, Narrow* total) noexcept {
          const Narrow r = Narrow::load(block.r + i);
          add_to(total[0], r * r);
          add_to(total[1], r);
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

// ln x of whole blocks; where there is no depth as of the shallowest.
inline void logarithms(const double* x, double* log, std::size_t count) noexcept {
  for (std::size_t i = 0; i < count; i += sum_lanes) {
    const Wide depth = Wide::load(x + i), least = Wide::all(shallowest);
    ln(select(depth > least, depth, least)).store(log + i);
  }
}

inline void place(const CurveColumns& means, const CurvePowers& to, double surface, double exponent,
                  double step) noexcept {
  const std::size_t padded = (means.count + curve_block - 1) / curve_block * curve_block;
  for (std::size_t i = 0; i < padded; i += sum_lanes) {
    const Wide depth = Wide::load(means.x + i) - Wide::all(surface);
    const auto below = depth > Wide::all(shallowest);
    const Wide log = ln(select(below, depth, Wide::all(1.0)));
    log.store(to.log + i);
    select(below, power_of(log, exponent), Wide::all(0.0)).store(to.power + i);
    power_of(log, step).store(to.ratio + i);
  }
}

PALPATE_LANES_INLINE void add_powers(Narrow* total, const Narrow& p, const Narrow& weighted,
                                     const Narrow& w, const Narrow& f) noexcept {
  const Narrow square = weighted * p, by_speed = square * w, once = weighted * w;
  add_to(total[0], square);
  add_to(total[1], by_speed);
  add_to(total[2], by_speed * w);
  add_to(total[3], weighted);
  add_to(total[4], once);
  add_to(total[5], weighted * f);
  add_to(total[6], once * f);
}

// The sums at the present exponent, and the powers on to the next.
template <bool Slopes>
void powers(const CurveColumns& means, const CurvePowers& at, double* sums) noexcept {
  LaneSums<power_sums> plain;
  LaneSums<Slopes ? power_sums : 1> sloped;
  for (std::size_t first = 0; first < means.count; first += curve_block) {
    plain.add([&](std::size_t i, Narrow* total) noexcept {
      const std::size_t j = first + i;
      const Narrow p = Narrow::load(at.power + j);
      add_powers(total, p, p, Narrow::load(means.w + j), Narrow::load(means.f + j));
    });
    if constexpr (Slopes) {
      sloped.add([&](std::size_t i, Narrow* total) noexcept {
        const std::size_t j = first + i;
        const Narrow p = Narrow::load(at.power + j);
        add_powers(total, p, p * Narrow::load(at.log + j), Narrow::load(means.w + j),
                   Narrow::load(means.f + j));
      });
    }
    for (std::size_t i = first; i < first + curve_block; i += sum_lanes) {
      (Wide::load(at.power + i) * Wide::load(at.ratio + i)).store(at.power + i);
    }
  }
  plain.give(sums);
  if constexpr (Slopes) sloped.give(sums + power_sums);
}

inline constexpr CurveKernels curve_kernels{&pass<false>, &pass<true>,    &logarithms,
                                            &place,       &powers<false>, &powers<true>};

}  // namespace PALPATE_LANES_SET
}  // namespace palpate::lanes
