// A few dozen samples of every lane, packed and made ready for the recursion.
#pragma once

#include <cstddef>

#include "palpate/lanes/instruction_set.hpp"
#include "palpate/lanes/lane_state.hpp"
#include "palpate/lanes/pack.hpp"
#include "palpate/lanes/regressors.hpp"

namespace palpate::lanes {
inline namespace PALPATE_LANES_SET {

struct SampleBlock {
  static constexpr int length = 64;  // with 16 lanes 24 kB, which stays in the first cache

  // [sample][lane]: penetration, velocity and force, and from prepare() on the row's channels.
  alignas(64) double depth[length][block_lanes];
  alignas(64) double velocity[length][block_lanes];
  alignas(64) double output[length][block_lanes];
  // A bit a lane: whether a sample makes contact, keeps it, is finite, and is in range.
  unsigned makes[length], keeps[length], finite[length], in_range[length];
};

// Asks for lines of the memory of the next block, those of sample k: forty-eight streams are more
// than the processor follows by itself. A few at each sample, while the recursion computes: at
// once, while a block is packed, they are more than the processor keeps in flight, and it waits.
// (Not at all, at once and at each sample: 7.3, 6.7 and 5.7 ns a sample with AVX-512.)
template <int Lanes>
PALPATE_LANES_INLINE void fetch_next(const LaneSignals& in, int lane, std::size_t first,
                                     int k) noexcept {
  constexpr int line = 8;  // samples
  const std::size_t at = first + SampleBlock::length + static_cast<std::size_t>(k % line * line);
  for (int i = lane + k / line; i < lane + Lanes; i += SampleBlock::length / line) {
    register_of::fetch(in.penetration[i] + at);
    register_of::fetch(in.velocity[i] + at);
    register_of::fetch(in.force[i] + at);
  }
}

// Eight samples of a lane at a time are a line of the cache, which is used up at once.
PALPATE_LANES_INLINE void pack_tile(const double* const* from, std::size_t first,
                                    double (*to)[block_lanes], int lane) noexcept {
  each<8 / register_lanes>([&](auto index) PALPATE_LANES_LAMBDA {
    constexpr int part = decltype(index)::value * register_lanes;
    RegisterDoubles rows[register_lanes];
    each<register_lanes>([&](auto i) PALPATE_LANES_LAMBDA {
      rows[i.value] = register_of::load(from[lane + i.value] + first + part);
    });
    register_of::transpose(rows);
    each<register_lanes>([&](auto i) PALPATE_LANES_LAMBDA {
      register_of::store(&to[part + i.value][lane], rows[i.value]);
    });
  });
}

PALPATE_LANES_INLINE void pack_channel(const double* const* from, std::size_t first, int count,
                                       int lanes, double (*to)[block_lanes]) noexcept {
  const int whole = count / 8 * 8;
  for (int lane = 0; lane < lanes; lane += register_lanes) {
    for (int k = 0; k < whole; k += 8) {
      pack_tile(from, first + static_cast<std::size_t>(k), to + k, lane);
    }
    for (int k = whole; k < count; ++k) {
      for (int i = lane; i < lane + register_lanes; ++i) {
        to[k][i] = from[i][first + static_cast<std::size_t>(k)];
      }
    }
  }
}

// The settings of as many lanes as a pack has.
template <int Lanes>
struct PackSettings {
  using Doubles = Pack<Lanes>;

  PALPATE_LANES_INLINE PackSettings(const LaneSettings& of, int lane) noexcept
      : per_penetration(Doubles::load(of.per_penetration + lane)),
        per_velocity(Doubles::load(of.per_velocity + lane)),
        per_force(Doubles::load(of.per_force + lane)),
        least_penetration(Doubles::load(of.plain_penetration[0] + lane)),
        most_penetration(Doubles::load(of.plain_penetration[1] + lane)),
        least_force(Doubles::load(of.plain_force[0] + lane)),
        most_force(Doubles::load(of.plain_force[1] + lane)),
        most_velocity(Doubles::load(of.plain_velocity + lane)) {}

  Doubles per_penetration, per_velocity, per_force;
  Doubles least_penetration, most_penetration, least_force, most_force, most_velocity;
};

// Of samples that a first look leaves open: the gate and the range as the scalar recursion has
// them.
template <class Row, int Lanes>
PALPATE_LANES_INLINE void look_closely(SampleBlock& block, int k, int lane,
                                       const LaneSettings& settings, const PackSettings<Lanes>& own,
                                       Channels<Lanes>& sample) noexcept {
  using Doubles = Pack<Lanes>;
  const Doubles penetration = Doubles::load(&block.depth[k][lane]);
  const Doubles velocity = Doubles::load(&block.velocity[k][lane]);
  const Doubles force = Doubles::load(&block.output[k][lane]);
  const Doubles largest = Doubles::all(1.7976931348623157e308);
  const Mask<Lanes> finite =
      (abs(penetration) <= largest) & (abs(velocity) <= largest) & (abs(force) <= largest);
  const Mask<Lanes> deep =
      finite & (penetration > Doubles::load(settings.minimum_penetration + lane));
  const Doubles x = penetration * own.per_penetration, v = velocity * own.per_velocity,
                f = force * own.per_force;
  const Doubles limit = Doubles::all(1e100), zero = Doubles::all(0.0), one = Doubles::all(1.0);
  const Mask<Lanes> in_range =
      (x > zero) & (f > zero) & (x < limit) & (f < limit) & (abs(v) < limit);
  block.finite[k] |= finite.bits() << lane;
  block.makes[k] |= (deep & (force > Doubles::load(settings.make_force + lane))).bits() << lane;
  block.keeps[k] |= (deep & (force > Doubles::load(settings.break_force + lane))).bits() << lane;
  block.in_range[k] |= in_range.bits() << lane;
  sample = {select(in_range, x, one), select(in_range, v, zero), select(in_range, f, one)};
  const Doubles normal = Doubles::all(0x1p-1022);
  if (((sample.depth < normal) | (sample.output < normal)).bits() == 0) {
    Row::template prepare<true>(sample);
  } else {
    Row::template prepare<false>(sample);
  }
}

template <class Row, int Lanes>
PALPATE_LANES_INLINE void prepare(SampleBlock& block, int count, int lane,
                                  const LaneSettings& settings) noexcept {
  using Doubles = Pack<Lanes>;
  const PackSettings<Lanes> own(settings, lane);
  for (int k = 0; k < count; ++k) {
    const Doubles penetration = Doubles::load(&block.depth[k][lane]);
    const Doubles velocity = Doubles::load(&block.velocity[k][lane]);
    const Doubles force = Doubles::load(&block.output[k][lane]);
    const Mask<Lanes> plain = (penetration > own.least_penetration) &
                              (penetration < own.most_penetration) & (force > own.least_force) &
                              (force < own.most_force) & (abs(velocity) < own.most_velocity);
    Channels<Lanes> sample;
    if (plain.bits() == Mask<Lanes>::full) [[likely]] {
      constexpr unsigned full = Mask<Lanes>::full;
      block.makes[k] |= full << lane;
      block.keeps[k] |= full << lane;
      block.finite[k] |= full << lane;
      block.in_range[k] |= full << lane;
      sample = {penetration * own.per_penetration, velocity * own.per_velocity,
                force * own.per_force};
      Row::template prepare<true>(sample);
    } else {
      look_closely<Row>(block, k, lane, settings, own, sample);
    }
    sample.depth.store(&block.depth[k][lane]);
    sample.velocity.store(&block.velocity[k][lane]);
    sample.output.store(&block.output[k][lane]);
  }
}

// Samples `first` … `first + count − 1`, in the lanes' first `lanes`.
template <class Row>
PALPATE_LANES_INLINE void fill(SampleBlock& block, const LaneSignals& in, std::size_t first,
                               int count, int lanes, const LaneSettings& settings) noexcept {
  pack_channel(in.penetration, first, count, lanes, block.depth);
  pack_channel(in.velocity, first, count, lanes, block.velocity);
  pack_channel(in.force, first, count, lanes, block.output);
  for (int k = 0; k < count; ++k) {
    block.makes[k] = block.keeps[k] = block.finite[k] = block.in_range[k] = 0;
  }
  for (int lane = 0; lane < lanes; lane += register_lanes) {
    prepare<Row, register_lanes>(block, count, lane, settings);
  }
}

}  // namespace PALPATE_LANES_SET
}  // namespace palpate::lanes
