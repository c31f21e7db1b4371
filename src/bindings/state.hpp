// A saved state: a line that says what it is of, and the memory of a trivially copyable core.
//
//   palpate-state 2;0.1.0;VariableProjection.0;4320;1f0c…\n<bytes>
//
// What is restored has to be what was saved: of the same version, class and size, whole (by its
// checksum), and learned under the same settings. Anything else is refused in words.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

#include "conversions.hpp"

namespace palpate::bindings {

// FNV-1a, 64 bits.
inline std::uint64_t checksum_of(std::string_view bytes) {
  std::uint64_t hash = 14695981039346656037u;
  for (const char byte : bytes) {
    hash = (hash ^ static_cast<unsigned char>(byte)) * 1099511628211u;
  }
  return hash;
}

// `name` distinguishes what has the same size.
template <class Core>
std::string heading_of(const std::string& name) {
  return "palpate-state 2;" PALPATE_VERSION ";" + name + ";" + std::to_string(sizeof(Core)) + ";";
}

inline std::string in_hex(std::uint64_t number) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(number));
  return text;
}

template <class Core>
nb::bytes saved(const Core& core, const std::string& name) {
  static_assert(std::is_trivially_copyable_v<Core>);
  const std::string_view memory(reinterpret_cast<const char*>(&core), sizeof(Core));
  std::string state = heading_of<Core>(name) + in_hex(checksum_of(memory)) + "\n";
  state += memory;
  return nb::bytes(state.data(), state.size());
}

template <class Core>
void restore(Core& core, const std::string& name, const nb::bytes& bytes) {
  static_assert(std::is_trivially_copyable_v<Core>);
  const std::string_view state(bytes.c_str(), bytes.size());
  const std::string heading = heading_of<Core>(name);
  if (!state.starts_with("palpate-state ")) {
    throw nb::value_error("state must be what an estimator saved: these bytes are something else");
  }
  if (!state.starts_with(heading)) {
    const std::string found(state.substr(0, std::min<std::size_t>(state.find('\n'), 80)));
    std::string words = "state must be of this version and class, " + heading + " not ";
    for (const char c : found) words += c >= ' ' && c <= '~' ? c : '?';
    throw nb::value_error(words.c_str());
  }
  constexpr std::size_t checksum_size = 17;  // and the end of the line
  const std::string_view memory =
      state.substr(std::min(heading.size() + checksum_size, state.size()));
  const std::string expected = heading + in_hex(checksum_of(memory)) + "\n";
  if (memory.size() != sizeof(Core) || !state.starts_with(expected)) {
    throw nb::value_error("state must be whole: its checksum says that bytes of it were changed");
  }
  alignas(Core) std::byte copy[sizeof(Core)];
  std::memcpy(copy, memory.data(), sizeof(Core));
  const Core& candidate = *reinterpret_cast<const Core*>(copy);
  if (!(candidate.settings() == core.settings())) {
    throw nb::value_error("state must be of an estimator with these settings: others learned it");
  }
  core = candidate;
}

}  // namespace palpate::bindings
