// A saved state: a line that says what it is of, and the memory of a trivially copyable core, or of
// the parts of one.
//
//   palpate-state 3;0.1.0;VariableProjection.0;4320;1f0c…\n<bytes>
//
// What is restored has to be what was saved: of the same version, class and size, whole (by its
// checksum), and learned under the same settings. Anything else is refused in words.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "conversions.hpp"

namespace palpate::bindings {

using Memory = std::string_view;

// `name` distinguishes what has the same size.
nb::bytes saved(const std::string& name, std::span<const Memory> parts);

// The bytes of the parts one after the other, as they are in a state of the like of `present`.
Memory opened(const std::string& name, const nb::bytes& state, std::span<const Memory> present);

void check_settings(bool same);

// Of a part that there may not be.
template <class Part>
Memory memory_of(const Part* part) noexcept {
  static_assert(std::is_trivially_copyable_v<Part>);
  return part ? Memory(reinterpret_cast<const char*>(part), sizeof(Part)) : Memory();
}

// Takes a part off the front.
template <class Part>
Part taken(Memory& memory) noexcept {
  std::array<std::byte, sizeof(Part)> bytes;
  std::memcpy(bytes.data(), memory.data(), sizeof(Part));
  memory.remove_prefix(sizeof(Part));
  return std::bit_cast<Part>(bytes);
}

template <class Core>
nb::bytes saved(const Core& core, const std::string& name) {
  return saved(name, std::array{memory_of(&core)});
}

template <class Core>
void restore(Core& core, const std::string& name, const nb::bytes& state) {
  Memory memory = opened(name, state, std::array{memory_of(&core)});
  const Core candidate = taken<Core>(memory);
  check_settings(candidate.settings() == core.settings());
  core = candidate;
}

}  // namespace palpate::bindings
