// Single samples of a channel that leave their neighbours.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "channel.hpp"

namespace palpate::rows {

// Whether the middle one of five samples is farther than `limit` from their median, and three times
// farther than its neighbours lie from each other: the top of a sine at 66 Hz is 2 % above them,
// and a lever that shakes for a tenth of a second is no noise of all the recording.
inline bool stands_out(const double* five, double limit) noexcept {
  constexpr double alone = 3.0;
  std::array<double, 5> order;
  std::copy_n(five, 5, order.begin());
  std::sort(order.begin(), order.end());
  const double away = std::abs(five[2] - order[2]);
  const auto [low, high] = std::minmax({five[0], five[1], five[3], five[4]});
  return away > limit && away > alone * (high - low);
}

// 99.9th percentile of the size of those that are finite, so that a spike sets nothing; 0 of none.
// `spare` holds as many numbers as the channel.
inline double largest_of(Channel channel, double* spare) noexcept {
  const Numbers all = kept(channel, std::numeric_limits<double>::infinity(), spare);
  for (std::size_t k = 0; k < all.count; ++k) all.data[k] = std::abs(all.data[k]);
  return all.count > 0 ? percentile(all, 99.9 / 100.0) : 0.0;
}

// How far a spike is from its neighbours at least: 8 σ, 2 % of the largest, or 1.5 steps, since a
// value that rounds up and down is none. `spare` holds twice as many numbers as the channel.
inline double least_spike(Channel channel, double* spare) noexcept {
  const double noisy = 8.0 * noise_of(channel, spare), part = 0.02 * largest_of(channel, spare);
  return std::max({noisy, part, 1.5 * step_of(channel, spare)});
}

// Writes 1 to `marks` where a finite sample is a spike among those. `spare` holds three
// times as many numbers as the channel.
inline void mark_spikes(Channel channel, std::uint8_t* marks, double* spare) noexcept {
  const Numbers all = kept(channel, std::numeric_limits<double>::infinity(), spare);
  if (all.count < 5) return;
  const double limit = least_spike({all.data, all.count}, spare + channel.count);
  std::size_t place = 0;  // of the sample among the finite ones
  for (std::size_t k = 0; k < channel.count; ++k) {
    if (!std::isfinite(channel.data[k])) continue;
    const std::size_t own = place++;
    if (own < 2 || own + 2 >= all.count) continue;
    const double* here = all.data + own;
    // Of the many samples that hardly leave their neighbours' mean none is a spike.
    if (!(std::abs(here[0] - 0.5 * (here[-1] + here[1])) > 0.5 * limit)) continue;
    if (stands_out(here - 2, limit)) marks[k] = 1;
  }
}

}  // namespace palpate::rows
