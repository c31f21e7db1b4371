// Rows shared out among threads, without the interpreter's lock.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

#include "conversions.hpp"

namespace palpate::bindings {

// Calls work(row, spare) for each row, on so many threads, this one among them; `spare` holds so
// many numbers, which are the thread's own.
template <class Work>
void each_row(std::size_t rows, std::size_t size, std::size_t threads, const Work& work) {
  // So many rows at once that threads do not meet at the counter, or in a cache line.
  constexpr std::size_t at_once = 16;
  const nb::gil_scoped_release release;
  const std::size_t parts = (rows + at_once - 1) / at_once;
  const std::size_t workers = std::clamp<std::size_t>(threads, 1, std::max<std::size_t>(parts, 1));
  std::vector<double> spare(workers * size);
  std::atomic<std::size_t> next = 0;
  const auto run = [&](std::size_t worker) noexcept {
    for (std::size_t first; (first = next.fetch_add(at_once)) < rows;) {
      const std::size_t last = std::min(first + at_once, rows);
      for (std::size_t row = first; row < last; ++row) work(row, spare.data() + worker * size);
    }
  };
  std::vector<std::jthread> others;
  others.reserve(workers - 1);
  for (std::size_t worker = 1; worker < workers; ++worker) others.emplace_back(run, worker);
  run(0);
}

}  // namespace palpate::bindings
