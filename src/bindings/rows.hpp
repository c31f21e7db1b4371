// Statistics of samples before any fit: order statistics, properties of one channel, and the gate
// of one contact.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "palpate/method.hpp"
#include "palpate/outliers.hpp"

namespace palpate::rows {

inline constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// Order statistics of many numbers without NaN, in linear time.
//
// The numbers are first distributed into cells of equal width: only those of one or two cells are
// compared with each other. If that does not help, as with a single 1e300, it is a sort.
struct Numbers {
  double* data;
  std::size_t count;
};

namespace detail {

// For fewer numbers a sort is faster than the cells.
constexpr std::size_t fewest = 128;

// The least and the largest of at least one number.
inline std::array<double, 2> ends_of(Numbers all) noexcept {
  constexpr std::size_t abreast = 4;  // independent comparisons, so that none waits for another
  std::array<double, abreast> low, high;
  low.fill(all.data[0]);
  high.fill(all.data[0]);
  std::size_t k = 0;
  for (; k + abreast <= all.count; k += abreast) {
    for (std::size_t i = 0; i < abreast; ++i) {
      const double value = all.data[k + i];
      low[i] = value < low[i] ? value : low[i];
      high[i] = value > high[i] ? value : high[i];
    }
  }
  for (; k < all.count; ++k) {
    low[0] = std::min(low[0], all.data[k]);
    high[0] = std::max(high[0], all.data[k]);
  }
  return {*std::min_element(low.begin(), low.end()), *std::max_element(high.begin(), high.end())};
}

// The cell of a number, monotonic in the number.
template <std::size_t Count>
class Cells {
 public:
  explicit Cells(Numbers all) noexcept {
    if (all.count < fewest) return;
    const std::array<double, 2> ends = ends_of(all);
    low_ = ends[0];
    const double per_unit = static_cast<double>(Count - 1) / (ends[1] - ends[0]);
    useful_ = per_unit > 0.0 && per_unit < std::numeric_limits<double>::infinity();
    per_unit_ = per_unit;
  }

  bool useful() const noexcept { return useful_; }
  std::size_t of(double value) const noexcept {
    return static_cast<std::size_t>(static_cast<std::int32_t>((value - low_) * per_unit_));
  }

 private:
  double low_ = 0.0, per_unit_ = 0.0;
  bool useful_ = false;
};

template <std::size_t Count>
std::array<std::uint32_t, Count> counted(Numbers all, const Cells<Count>& by) noexcept {
  // Neighbours in a smooth channel share a cell; separate counters keep them from waiting for each
  // other.
  std::array<std::array<std::uint32_t, Count>, 2> counts{};
  std::size_t k = 0;
  for (; k + 2 <= all.count; k += 2) {
    ++counts[0][by.of(all.data[k])];
    ++counts[1][by.of(all.data[k + 1])];
  }
  if (k < all.count) ++counts[0][by.of(all.data[k])];
  for (std::size_t cell = 0; cell < Count; ++cell) counts[0][cell] += counts[1][cell];
  return counts[0];
}

}  // namespace detail

// The number at `place` (below the count) in sorted order, and the next if there is one; `all`
// loses its order, and may lose numbers.
inline std::array<double, 2> two_in_order(Numbers all, std::size_t place) noexcept {
  const std::size_t next = std::min(place + 1, all.count - 1);
  std::size_t before = 0;  // number of values below all remaining ones
  const detail::Cells<256> by(all);
  if (by.useful()) {
    const auto counts = detail::counted(all, by);
    std::size_t first = 0;
    while (before + counts[first] <= place) before += counts[first++];
    std::size_t last = first, until = before + counts[first];
    while (until <= next) until += counts[++last];
    std::size_t kept = 0;
    for (std::size_t k = 0; k < all.count; ++k) {
      // One comparison, nearly always false; the processor would mispredict two half of the time.
      if (by.of(all.data[k]) - first <= last - first) all.data[kept++] = all.data[k];
    }
    all.count = kept;
  }
  double* const found = all.data + (place - before);
  std::nth_element(all.data, found, all.data + all.count);
  if (next == place) return {*found, *found};
  return {*found, *std::min_element(found + 1, all.data + all.count)};
}

// Percentile as in NumPy, NaN without numbers; `all` loses its order.
inline double percentile(Numbers all, double part) noexcept {
  if (all.count == 0) return std::numeric_limits<double>::quiet_NaN();
  const double place = static_cast<double>(all.count - 1) * part, low = std::floor(place);
  const std::array<double, 2> ends = two_in_order(all, static_cast<std::size_t>(low));
  const double beyond = place - low, step = ends[1] - ends[0];
  if (beyond == 0.0) return ends[0];
  return beyond >= 0.5 ? ends[1] - step * (1.0 - beyond) : ends[0] + step * beyond;
}

// Median of at least one number; `all` loses its order.
inline double median(Numbers all) noexcept {
  const std::array<double, 2> ends = two_in_order(all, (all.count - 1) / 2);
  return all.count % 2 == 1 ? ends[0] : 0.5 * (ends[0] + ends[1]);
}

// Sorts; `spare` has the same size.
inline void sort(Numbers all, double* spare) noexcept {
  const detail::Cells<1024> by(all);  // few numbers in each
  if (!by.useful()) {
    std::sort(all.data, all.data + all.count);
    return;
  }
  auto ends = detail::counted(all, by);
  std::uint32_t sum = 0;
  for (std::uint32_t& end : ends) {
    const std::uint32_t own = end;
    end = sum;
    sum += own;
  }
  std::copy_n(all.data, all.count, spare);
  for (std::size_t k = 0; k < all.count; ++k) all.data[ends[by.of(spare[k])]++] = spare[k];
  std::size_t first = 0;
  for (const std::size_t end : ends) {
    if (end - first > 2) {
      std::sort(all.data + first, all.data + end);
    } else if (end - first == 2 && all.data[first + 1] < all.data[first]) {
      std::swap(all.data[first], all.data[first + 1]);
    }
    first = end;
  }
}

struct Channel {
  const double* data;
  std::size_t count;
};

// Estimators refuse samples above it, in SI units.
constexpr double largest = 1e100;
// Samples searched for distinct values; by then noise fills the gaps of a fine channel.
constexpr std::size_t most_distinct = 20'000;

// The values of a channel whose sample numbers satisfy a condition, in order.
template <class Holds>
Numbers chosen(const double* channel, std::size_t count, double* to, const Holds& holds) noexcept {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < count; ++k) {
    to[kept] = channel[k];  // without a branch, which could be mispredicted
    kept += static_cast<std::size_t>(holds(k));
  }
  return {to, kept};
}

// The values of a channel that are finite and below `bound` in size, in order.
inline Numbers kept(Channel channel, double bound, double* to) noexcept {
  return chosen(channel.data, channel.count, to,
                [&](std::size_t k) noexcept { return std::abs(channel.data[k]) < bound; });
}

// The standard deviation of white noise on a smooth signal, from its fourth differences: they
// suppress the signal as (ωT)⁴ and have 70 times the noise's variance. `spare` has the channel's
// size.
inline double noise_of(Channel channel, double* spare) noexcept {
  std::array<double, 4> before{};  // the previous sample and its first three differences
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

// Median gap between the distinct values; 0 for a constant channel. `spare` has twice the channel's
// size.
inline double step_of(Channel channel, double* spare) noexcept {
  constexpr double finite = std::numeric_limits<double>::infinity();
  Numbers all = kept(channel, finite, spare);
  all.count = std::min(all.count, most_distinct);
  sort(all, spare + all.count);
  std::size_t gaps = 0;
  for (std::size_t k = 1; k < all.count; ++k) {
    const double gap = all.data[k] - all.data[k - 1];
    spare[gaps] = gap;  // before the values that are read next
    gaps += static_cast<std::size_t>(gap != 0.0);
  }
  return gaps > 0 ? median({spare, gaps}) : 0.0;
}

// Twice the noise including rounding: the zero of an encoder lies anywhere within a step, and stays
// there for a whole recording. NaN without noise and rounding, or out of the estimators' range.
inline double resolution_of(Channel penetration, double* spare) noexcept {
  const double rounding = step_of(penetration, spare) / std::sqrt(12.0);
  const double deviation = 2.0 * std::max(noise_of(penetration, spare), rounding);
  return deviation > 0.0 && deviation < 1e30 ? deviation : unknown;
}

// Whether some sample may differ from its two neighbours as a spike does. A spike is 8 σ off the
// median of five, and three times as far off as its neighbours are apart: at least 5.3 σ off their
// mean, whose median distance for white noise is 0.83 σ. A median of every fourth sample suffices
// here: from 250 samples it is accurate to 10 %. True also if more than half of the samples miss.
inline bool may_hold_a_spike(Channel channel, double* spare) noexcept {
  constexpr double typical = 5.3 / 0.83;
  constexpr std::size_t every = 4;
  if (channel.count < 5) return false;
  const std::size_t inner = channel.count - 2;
  double* const away = spare;
  for (std::size_t k = 0; k < inner; ++k) {
    away[k] = std::abs(channel.data[k + 1] - 0.5 * (channel.data[k] + channel.data[k + 2]));
  }
  std::array<double, every> farthest{};  // independent comparisons, so that none waits for another
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
  const std::size_t middle = few / 2;  // missing values are the largest
  if (middle >= known) return true;
  const double limit = typical * two_in_order({away, known}, middle)[0];
  return !(*std::max_element(farthest.begin(), farthest.end()) < limit);
}

// 99.9th percentile of the absolute finite values (robust to spikes); 0 if there are none. `spare`
// has the channel's size.
inline double largest_of(Channel channel, double* spare) noexcept {
  const Numbers all = kept(channel, std::numeric_limits<double>::infinity(), spare);
  for (std::size_t k = 0; k < all.count; ++k) all.data[k] = std::abs(all.data[k]);
  return all.count > 0 ? percentile(all, 99.9 / 100.0) : 0.0;
}

// Whether one of the two samples at an end is a spike: as in the middle, but twice as far off,
// since nothing beyond it shows that the channel comes back.
inline bool ends_with_spike(const double* five, std::size_t place, double limit) noexcept {
  std::array<double, 5> turned;
  std::copy_n(five, 5, turned.begin());
  std::swap(turned[place], turned[2]);
  std::array<double, 5> sorted = turned;
  std::sort(sorted.begin(), sorted.end());
  const double away = std::abs(turned[2] - sorted[2]);
  const auto [low, high] = std::minmax({turned[0], turned[1], turned[3], turned[4]});
  return away > 2.0 * limit && away > 3.0 * (high - low);
}

// Writes 1 to `marks` where a finite sample is a spike among the finite ones. `spare` has three
// times the channel's size.
inline void mark_spikes(Channel channel, std::uint8_t* marks, double* spare) noexcept {
  const Numbers all = kept(channel, std::numeric_limits<double>::infinity(), spare);
  if (all.count < 5) return;
  const Channel finite{all.data, all.count};
  double* const more = spare + channel.count;
  const double noise = noise_of(finite, more), top = largest_of(finite, more);
  const double limit = palpate::detail::least_spike(noise, top, step_of(finite, more));
  std::size_t place = 0;  // index of the sample among the finite ones
  for (std::size_t k = 0; k < channel.count; ++k) {
    if (!std::isfinite(channel.data[k])) continue;
    const std::size_t own = place++;
    const std::size_t last = all.count - 5, first = own > 2 ? std::min(own - 2, last) : 0;
    const bool inner = own == first + 2;
    const double* const five = all.data + first;
    if (inner ? palpate::detail::is_spike(five, limit)
              : ends_with_spike(five, own - first, limit)) {
      marks[k] = 1;
    }
  }
}

// The channels have equal length.
struct Pressed {
  const double* penetration;
  const double* force;
  std::size_t count;

  // Whether a sample is in contact by the signs of penetration and force.
  bool touches(std::size_t k) const noexcept {
    const double x = penetration[k], f = force[k];
    return (x > 0.0) & (f > 0.0) & (x < largest) & (f < largest);
  }
};

// F ≥ 10 σ keeps the bias of the logarithm, σ²/2F², below 0.5 %.
constexpr double noise_factor = 10.0;
// Fraction of the contact within 3 σ of the gate; deep probing has below 0.5 %.
constexpr double most_undecided = 0.03;

// Ten times the noise, between 1 % and 10 % of the 99th percentile, which is robust to spikes.
inline double threshold(double noise, double top) noexcept {
  return std::min(std::max(noise_factor * noise, 0.01 * top), 0.10 * top);
}

// Contact thresholds from the samples `touching`; `spare` has one entry per sample.
//
// A force near its threshold is selected if noise makes it large, which biases: probing near the
// surface of a soft material lowers K by 10 %. If more than 3 % of the contact is that close, a
// threshold of the depth replaces it if it separates them: at the depth above which all forces but
// one in a thousand exceed the force threshold, at most half the largest depth.
template <class Touching>
ContactGate::Settings gate_of(const Pressed& in, const Touching& touching, double* spare) noexcept {
  const std::size_t touched = chosen(in.penetration, in.count, spare, touching).count;
  if (touched == 0) return {};
  const double deepest = percentile({spare, touched}, 0.99);
  const double highest = percentile(chosen(in.force, in.count, spare, touching), 0.99);
  const double noise = noise_of({in.force, in.count}, spare);
  const double make = threshold(noise, highest);
  const double least = threshold(noise_of({in.penetration, in.count}, spare), deepest);
  std::size_t inside = 0, undecided = 0;
  for (std::size_t k = 0; k < in.count; ++k) {
    const bool deep = touching(k) & (in.penetration[k] > least);
    inside += static_cast<std::size_t>(deep);
    undecided += static_cast<std::size_t>(deep & (std::abs(in.force[k] - make) < 3.0 * noise));
  }
  if (static_cast<double>(undecided) > most_undecided * static_cast<double>(inside)) {
    const Numbers light = chosen(in.penetration, in.count, spare, [&](std::size_t k) noexcept {
      const double x = in.penetration[k];
      return (x > least) & (x < largest) & (in.force[k] <= make);
    });
    const std::size_t spared = touched / 1000;
    if (light.count > spared) {
      const double depth = two_in_order(light, light.count - 1 - spared)[0];
      if (depth <= 0.5 * deepest) return {depth, make, 0.0};
    }
  }
  return {least, make, 0.8 * make};
}

// Median and largest penetration in firm contact by the gate; NaN if there is none. `spare` has one
// entry per sample.
inline std::array<double, 2> working_depths(const Pressed& in, double* spare) noexcept {
  const auto touching = [&](std::size_t k) noexcept { return in.touches(k); };
  const ContactGate::Settings gate = gate_of(in, touching, spare);
  const Numbers firm = chosen(in.penetration, in.count, spare, [&](std::size_t k) noexcept {
    return (in.penetration[k] > gate.minimum_penetration) & (in.force[k] > gate.make_force);
  });
  if (firm.count == 0) return {unknown, unknown};
  const double deepest = detail::ends_of(firm)[1];
  return {percentile(firm, 0.5), deepest};
}

}  // namespace palpate::rows
