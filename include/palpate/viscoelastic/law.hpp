// The laws that compete: F = k ξⁿ + c ξᵖ w + m Σ wᵢ gᵢ + F₀,  ġᵢ = d(ξⁿ)/dt − gᵢ/τᵢ,  Σ wᵢ = 1.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate::viscoelastic {

// Where the damper acts: not at all, with the spring (p = n: Hunt & Crossley), or as a body on a
// Kelvin–Voigt half-space (p = n − 1).
enum class Damping : std::uint8_t { none, hunt_crossley, half_space };

// How the weights wᵢ go with the relaxation times.
enum class Memory : std::uint8_t { none, flat, single, power_law };

struct Candidate {
  Damping damping;
  Memory memory;
  bool linear = false;  // n = 1 is not looked for: with p = n − 1 the Kelvin–Voigt law

  // Whether a relaxation time or the spectrum's exponent is looked for beside n.
  constexpr bool searches_memory() const noexcept {
    return memory == Memory::single || memory == Memory::power_law;
  }
  // Fitted numbers, F₀ among them.
  constexpr double parameters() const noexcept {
    return 2.0 + (linear ? 0.0 : 1.0) + (damping == Damping::none ? 0.0 : 1.0) +
           (memory == Memory::none ? 0.0 : 1.0) + (searches_memory() ? 1.0 : 0.0);
  }
  constexpr bool operator==(const Candidate&) const noexcept = default;
};

// The everyday ones first: what the small bank can tell apart.
inline constexpr std::array<Candidate, 11> candidates{{
    {Damping::half_space, Memory::none, true},
    {Damping::hunt_crossley, Memory::none},
    {Damping::half_space, Memory::none},
    {Damping::hunt_crossley, Memory::flat},
    {Damping::half_space, Memory::flat},
    {Damping::none, Memory::single},
    {Damping::hunt_crossley, Memory::single},
    {Damping::half_space, Memory::single},
    {Damping::none, Memory::power_law},
    {Damping::hunt_crossley, Memory::power_law},
    {Damping::half_space, Memory::power_law},
}};
inline constexpr std::size_t everyday_candidates = 5;

// Bit i stands for candidates[i].
using Offered = std::uint16_t;
inline constexpr Offered forgetful = 0b111;  // those without memory

}  // namespace palpate::viscoelastic
