// Seeded random numbers that are the same on every platform (splitmix64).
#pragma once

#include <bit>
#include <cstdint>

class RandomNumbers {
 public:
  constexpr explicit RandomNumbers(std::uint64_t seed) noexcept : state_(seed) {}

  constexpr std::uint64_t bits() noexcept {
    state_ += 0x9e3779b97f4a7c15U;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    return z ^ (z >> 31U);
  }

  // 0 … count − 1
  constexpr std::uint64_t below(std::uint64_t count) noexcept { return bits() % count; }

  // Uniform in [low, high).
  constexpr double between(double low, double high) noexcept {
    return low + (high - low) * (static_cast<double>(bits() >> 11U) * 0x1p-53);
  }

  // Any double at all: subnormal, infinite or NaN as well.
  constexpr double any() noexcept { return std::bit_cast<double>(bits()); }

 private:
  std::uint64_t state_;
};
