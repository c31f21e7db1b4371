// An estimate of palpate on the wire. What each field is: docs/reference/wires.md
// Written by python docs/write_reference.py.
// clang-format off
#pragma once

#include <cstdint>

namespace palpate_wire {

constexpr std::uint32_t schema = 4;
enum Check : std::uint32_t { stuck_force = 1, saturation = 2, spikes = 4, late_force = 8, lost_contact = 16, baseline = 32, change = 64 };
enum State : std::uint8_t { free = 0, contact = 1, held = 2, changed = 3, invalid = 4, lost = 5, taring = 6 };
enum Mark : std::int8_t { not_diagnosed = -1, trust = 2, with_care = 1, do_not_trust = 0 };

#pragma pack(push, 1)
struct Estimate {  // texts follow
  std::uint32_t schema;
  std::uint32_t checks;
  std::uint64_t number;
  double time;
  double prepared_time;
  double learned_time;
  double age;
  double penetration;
  double velocity;
  double force;
  double predicted_force;
  double stiffness;
  double stiffness_standard_error;
  double damping;
  double damping_standard_error;
  double depth;
  double frequency;
  double offset;
  double surface;
  double margin;
  double parameters[8];
  double standard_errors[8];
  std::uint8_t state;
  std::uint8_t stiffness_usable;
  std::uint8_t damping_usable;
  std::int8_t stiffness_mark;
  std::int8_t damping_mark;
};
#pragma pack(pop)
static_assert(sizeof(Estimate) == 285);

}  // namespace palpate_wire
// clang-format on
