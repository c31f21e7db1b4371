// What one update did with its sample.
#pragma once

#include <cstddef>
#include <cstdint>

namespace palpate {

enum class Status : std::uint8_t {
  waiting,       // no contact so far; nothing was learned
  updated,       // in contact; the sample was taken
  guarded,       // taken, but forgetting was withheld so that the covariance stays sound
  held,          // contact was lost; the estimate is held until it is made again
  restarted,     // taken; what is touched has changed, and the estimate was reinitialised with the
                 // latest samples
  not_finite,    // refused: penetration, velocity or force is NaN or infinite
  invalid_step,  // refused: dt is not a positive, finite time
  out_of_range,  // refused: finite, but too large for the arithmetic
  rejected,      // left out as an outlier
};

inline constexpr std::size_t status_count = static_cast<std::size_t>(Status::rejected) + 1;

constexpr bool taken(Status status) noexcept {
  return status == Status::updated || status == Status::guarded || status == Status::restarted;
}

}  // namespace palpate
