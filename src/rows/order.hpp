// Order statistics of many numbers, none of which is NaN, in time that grows as their count.
//
// Numbers are dealt into cells of equal width first: only those of one cell, or two, are compared
// with each other. Where that gains nothing, as of numbers of which one is 1e300, it is a sort.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace palpate::rows {

struct Numbers {
  double* data;
  std::size_t count;
};

namespace detail {

// Of fewer numbers the cells take longer to look through than a sort.
constexpr std::size_t fewest = 128;

// The least and the largest of some, at least one.
inline std::array<double, 2> ends_of(Numbers all) noexcept {
  constexpr std::size_t abreast = 4;  // comparisons that need not wait for each other
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

// In which of so many cells a number is: never in an earlier one than a smaller number is.
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
  // Neighbours in a smooth channel share a cell, and would wait for each other to be counted.
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

// The number at a place of the sorted ones, and the next where there is one; `all` loses its order,
// and may lose numbers. `place` is less than their count.
inline std::array<double, 2> two_in_order(Numbers all, std::size_t place) noexcept {
  const std::size_t next = std::min(place + 1, all.count - 1);
  std::size_t before = 0;  // how many numbers are less than all that are left
  const detail::Cells<256> by(all);
  if (by.useful()) {
    const auto counts = detail::counted(all, by);
    std::size_t first = 0;
    while (before + counts[first] <= place) before += counts[first++];
    std::size_t last = first, until = before + counts[first];
    while (until <= next) until += counts[++last];
    std::size_t kept = 0;
    for (std::size_t k = 0; k < all.count; ++k) {
      // One comparison, which is nearly always false; two would be foreseen half of the time.
      if (by.of(all.data[k]) - first <= last - first) all.data[kept++] = all.data[k];
    }
    all.count = kept;
  }
  double* const found = all.data + (place - before);
  std::nth_element(all.data, found, all.data + all.count);
  if (next == place) return {*found, *found};
  return {*found, *std::min_element(found + 1, all.data + all.count)};
}

// As NumPy's of this kind, NaN of none; `all` loses its order.
inline double percentile(Numbers all, double part) noexcept {
  if (all.count == 0) return std::numeric_limits<double>::quiet_NaN();
  const double place = static_cast<double>(all.count - 1) * part, low = std::floor(place);
  const std::array<double, 2> ends = two_in_order(all, static_cast<std::size_t>(low));
  const double beyond = place - low, step = ends[1] - ends[0];
  if (beyond == 0.0) return ends[0];
  return beyond >= 0.5 ? ends[1] - step * (1.0 - beyond) : ends[0] + step * beyond;
}

// At least one; `all` loses its order.
inline double median(Numbers all) noexcept {
  const std::array<double, 2> ends = two_in_order(all, (all.count - 1) / 2);
  return all.count % 2 == 1 ? ends[0] : 0.5 * (ends[0] + ends[1]);
}

// Sorts; `spare` holds as many numbers.
inline void sort(Numbers all, double* spare) noexcept {
  const detail::Cells<1024> by(all);  // with few in each
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

}  // namespace palpate::rows
