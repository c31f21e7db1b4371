// Settings that variable projection and what stands on it share.
#pragma once

#include "face.hpp"
#include "palpate/estimators.hpp"

namespace palpate::bindings {

// `exponent` is 0 where it is looked for, within `exponents`.
inline ProjectionSettings projection_settings(double noise, const Pair& exponents, double exponent,
                                              bool offset, double offset_deviation,
                                              double force_unit) {
  return {.noise = noise / force_unit,
          .lowest_exponent = exponents[0],
          .highest_exponent = exponents[1],
          .exponent = exponent,
          .offset = offset,
          .offset_deviation = offset_deviation / force_unit};
}

inline nb::dict projection_defaults(const ProjectionSettings& settings, const Scale& scale) {
  nb::dict defaults;
  defaults["offset"] = settings.offset;
  defaults["exponent_range"] = nb::make_tuple(settings.lowest_exponent, settings.highest_exponent);
  defaults["scale"] = nb::make_tuple(scale.penetration, scale.velocity, scale.force);
  return defaults;
}

constexpr Pair not_perturbed{no_perturbation.gain, no_perturbation.sensitivity};

}  // namespace palpate::bindings
