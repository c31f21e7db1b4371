// A candidate and what there is to fit it by: J of an exponent and of what is second, the linear
// part projected out.
#pragma once

#include <algorithm>
#include <cstddef>

#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/linear.hpp"
#include "palpate/viscoelastic/normal.hpp"
#include "palpate/viscoelastic/priors.hpp"
#include "palpate/viscoelastic/samples.hpp"

namespace palpate::viscoelastic {

// Nodes of the grid, from 0: of the exponent, and of what is second.
struct Place {
  double exponent;
  double second;

  bool operator==(const Place&) const noexcept = default;
};

// Of a power law α = 0, 0.14 … 0.98; of one relaxation time the rungs of the ladder. From 1 on a
// spectrum is that of its shortest time alone.
inline constexpr double highest_slope = 0.98;
inline constexpr std::size_t slopes = 8;

constexpr double second_of(Memory memory, double place) noexcept {
  constexpr double step = highest_slope / static_cast<double>(slopes - 1);
  return memory == Memory::power_law ? step * place : place;
}

// Beyond the ends of the grid the end: the sums know no other. Not a number is as good as none.
constexpr double exponent_at(const Candidate& law, const Priors& priors, double place) noexcept {
  if (law.linear) return 1.0;
  if (priors.exponent > 0.0) return priors.exponent;
  constexpr double last = static_cast<double>(Grid::exponents - 1);
  return Grid::exponent_at(place > 0.0 ? std::min(place, last) : 0.0);
}

// A candidate fitted at one place.
struct Point {
  Place place{};
  Linear linear{};
  double cost = 0.0;  // J less Σ F², with the priors
};

template <class Sums>
struct Problem {
  const Samples<Sums>& samples;
  const Candidate& law;
  const Priors& priors;
  double stiffness_before;  // k of the last answer, by which the prior of damping weighs; or 0

  bool searches_exponent() const noexcept { return !law.linear && !(priors.exponent > 0.0); }
  bool searches_memory() const noexcept { return law.searches_memory(); }
  double exponent(const Place& place) const noexcept {
    return exponent_at(law, priors, place.exponent);
  }
  PartSet wanted() const noexcept { return parts_of(law, priors.offset != 0); }

  // The last place of what is second.
  double last_second() const noexcept {
    const std::size_t nodes = law.memory == Memory::power_law ? slopes : Sums::Times::count;
    return searches_memory() ? static_cast<double>(nodes - 1) : 0.0;
  }

  // With the priors.
  Normal normal(const Place& place) const noexcept {
    Normal normal = normal_of(samples, law, exponent(place), second_of(law.memory, place.second));
    if (priors.offset != 0) {
      normal.a[offset][offset] += priors.offset_weight();
      normal.b[offset] += priors.offset_weight() * priors.air.mean;
    }
    const double spread = Priors::dissipation * stiffness_before;
    if (spread > 0.0) {
      normal.a[damping][damping] += std::min(priors.variance / (spread * spread), 1e100);
    }
    return normal;
  }

  [[gnu::noinline]] Point at(const Place& place) const noexcept { return at(place, normal(place)); }

  Point at(const Place& place, const Normal& normal) const noexcept {
    Point point{place, solve_passive(normal, law, priors.offset != 0), 0.0};
    const double away = (exponent(place) - priors.centre) / priors.deviation;
    point.cost = priors.variance * away * away - point.linear.gain;
    return point;
  }
};

}  // namespace palpate::viscoelastic
