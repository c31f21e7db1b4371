// What the numbers of one channel say of it alone: its noise, its steps, its spikes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "order.hpp"
#include "palpate/outliers.hpp"

namespace palpate::rows {

struct Channel {
  const double* data;
  std::size_t count;
};

// Beyond it, in SI units, no estimator takes a sample.
constexpr double largest = 1e100;
// Distinct values are sought among so many samples; noise fills the gaps of a fine channel by then.
constexpr std::size_t most_distinct = 20'000;

// Those of a channel that are finite and below `bound` in size, in its order.
inline Numbers kept(Channel channel, double bound, double* to) noexcept {
  std::size_t count = 0;
  for (std::size_t k = 0; k < channel.count; ++k) {
    to[count] = channel.data[k];  // there is no branch to foresee
    count += static_cast<std::size_t>(std::abs(channel.data[k]) < bound);
  }
  return {to, count};
}

// The standard deviation of white noise on a smooth signal, from its fourth differences: they
// suppress the signal as (ωT)⁴ and have 70 times the noise's variance. `spare` holds as many
// numbers as the channel.
inline double noise_of(Channel channel, double* spare) noexcept {
  std::array<double, 4> before{};  // the sample before, and its first three differences
  std::size_t count = 0;
  for (std::size_t k = 0; k < channel.count; ++k) {
    double difference = channel.data[k];
    if (!(std::abs(difference) < largest)) continue;
    for (double& last : before) difference -= std::exchange(last, difference);
    if (count >= before.size()) spare[count - before.size()] = std::abs(difference);
    ++count;
  }
  if (count <= before.size()) return 0.0;
  return median({spare, count - before.size()}) / 0.6745 / std::sqrt(70.0);
}

// Median gap between the distinct values; 0 of a constant channel. `spare` holds twice as many
// numbers as the channel.
inline double step_of(Channel channel, double* spare) noexcept {
  constexpr double finite = std::numeric_limits<double>::infinity();
  Numbers all = kept(channel, finite, spare);
  all.count = std::min(all.count, most_distinct);
  sort(all, spare + all.count);
  std::size_t gaps = 0;
  for (std::size_t k = 1; k < all.count; ++k) {
    const double gap = all.data[k] - all.data[k - 1];
    spare[gaps] = gap;  // in front of what is read next
    gaps += static_cast<std::size_t>(gap != 0.0);
  }
  return gaps > 0 ? median({spare, gaps}) : 0.0;
}

// Twice the noise, rounding included: the zero of an encoder lies anywhere within a step, and stays
// there for a whole recording. NaN where there is none of either, or no estimator is set to it.
inline double resolution_of(Channel penetration, double* spare) noexcept {
  const double rounding = step_of(penetration, spare) / std::sqrt(12.0);
  const double deviation = 2.0 * std::max(noise_of(penetration, spare), rounding);
  return deviation > 0.0 && deviation < 1e30 ? deviation : NAN;
}

// Whether a number may leave its two neighbours as a spike does. One is 8 σ beyond the median of
// five, and three times farther than its neighbours are apart: at least 5.3 σ beyond their mean,
// whose own median distance from white noise is 0.83 σ. A median of every fourth sample is as good
// here: of 250 it is known to a tenth. True also where more than half of the samples are missing.
inline bool may_hold_a_spike(Channel channel, double* spare) noexcept {
  constexpr double typical = 5.3 / 0.83;
  constexpr std::size_t every = 4;
  if (channel.count < 5) return false;
  const std::size_t inner = channel.count - 2;
  double* const away = spare;
  for (std::size_t k = 0; k < inner; ++k) {
    away[k] = std::abs(channel.data[k + 1] - 0.5 * (channel.data[k] + channel.data[k + 2]));
  }
  std::array<double, every> farthest{};  // comparisons that need not wait for each other
  std::size_t k = 0;
  for (; k + every <= inner; k += every) {
    for (std::size_t i = 0; i < every; ++i) {
      farthest[i] = away[k + i] > farthest[i] ? away[k + i] : farthest[i];
    }
  }
  for (; k < inner; ++k) farthest[0] = away[k] > farthest[0] ? away[k] : farthest[0];
  std::size_t few = 0, known = 0;
  for (k = 0; k < inner; k += every, ++few) {
    away[known] = away[k];
    known += static_cast<std::size_t>(away[k] == away[k]);
  }
  const std::size_t middle = few / 2;  // what is missing is the largest
  if (middle >= known) return true;
  const double limit = typical * two_in_order({away, known}, middle)[0];
  return !(*std::max_element(farthest.begin(), farthest.end()) < limit);
}

// 99.9th percentile of the size of those that are finite, so that a spike sets nothing; 0 of none.
// `spare` holds as many numbers as the channel.
inline double largest_of(Channel channel, double* spare) noexcept {
  const Numbers all = kept(channel, std::numeric_limits<double>::infinity(), spare);
  for (std::size_t k = 0; k < all.count; ++k) all.data[k] = std::abs(all.data[k]);
  return all.count > 0 ? percentile(all, 99.9 / 100.0) : 0.0;
}

// Writes 1 to `marks` where a finite sample is a spike among those. `spare` holds three
// times as many numbers as the channel.
inline void mark_spikes(Channel channel, std::uint8_t* marks, double* spare) noexcept {
  const Numbers all = kept(channel, std::numeric_limits<double>::infinity(), spare);
  if (all.count < 5) return;
  const Channel finite{all.data, all.count};
  double* const more = spare + channel.count;
  const double noise = noise_of(finite, more), top = largest_of(finite, more);
  const double limit = palpate::detail::least_spike(noise, top, step_of(finite, more));
  std::size_t place = 0;  // of the sample among the finite ones
  for (std::size_t k = 0; k < channel.count; ++k) {
    if (!std::isfinite(channel.data[k])) continue;
    const std::size_t own = place++;
    if (own < 2 || own + 2 >= all.count) continue;
    if (palpate::detail::is_spike(all.data + own - 2, limit)) marks[k] = 1;
  }
}

}  // namespace palpate::rows
