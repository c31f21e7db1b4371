// What an estimator of laws with memory is asked for.
#pragma once

#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/power_table.hpp"

namespace palpate {

struct ViscoelasticSettings {
  // Which of viscoelastic::candidates compete, a bit each: those that the everyday bank tells
  // apart.
  viscoelastic::Offered offered = (1U << viscoelastic::everyday_candidates) - 1U;
  double exponent = 0.0;  // n where it is known, as of a tip whose shape is; 0: it is looked for
  bool offset = true;
  double offset_deviation = 0.0;  // of the prior F₀ ~ N(0, ·²), as a tare leaves; 0: none was made
  // Of the surface, in scaled units: one that is off looks like an offset of as many units of
  // force.
  double surface_deviation = 0.0;
  double sample_time = 1e-3;  // s; the shortest relaxation time is two of them

  bool operator==(const ViscoelasticSettings&) const = default;
};

constexpr const char* validate(const ViscoelasticSettings& s) noexcept {
  using viscoelastic::Grid;
  if (s.offered == 0 || (s.offered >> viscoelastic::candidates.size()) != 0) {
    return "method.offered must name at least one law";
  }
  const bool known = s.exponent >= Grid::lowest_exponent && s.exponent <= Grid::highest_exponent;
  if (s.exponent != 0.0 && !known) {
    return "method.exponent must be in [0.5, 3.25], or 0 where it is not known";
  }
  if (!(s.offset_deviation >= 0.0 && s.offset_deviation <= 1e60)) {
    return "method.offset_deviation must be in [0, 1e60] units of force";
  }
  if (!(s.surface_deviation >= 0.0 && s.surface_deviation <= 1e60)) {
    return "method.surface_deviation must be in [0, 1e60] units of penetration";
  }
  if (!(s.sample_time > 0.0 && s.sample_time <= 1e6)) {
    return "method.sample_time must be in (0, 1e6] s";
  }
  return nullptr;
}

}  // namespace palpate
