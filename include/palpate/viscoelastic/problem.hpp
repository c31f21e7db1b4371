// A candidate law and its least-squares problem: J of the exponent and of a second nonlinear
// parameter, with the linear part projected out.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/projection/contact_samples.hpp"
#include "palpate/viscoelastic/power_table.hpp"
#include "palpate/viscoelastic/samples.hpp"

namespace palpate::viscoelastic {

// Prior information, in scaled units.
struct Priors {
  double variance = 0.0;  // σ² of the force, for their weight
  double exponent = 0.0;  // known n; 0: estimated
  double centre = 1.3;    // n ~ N(1.3, 1), between a spring and a cone
  double deviation = 1.0;
  detail::OffsetPrior air{0.0, 0.0};  // F₀ ~ N(mean, deviation²); 0: nothing is known
  std::uint64_t offset = 1;  // whether there is one; a word, so that no saved state has padding

  // c/k ~ N(0, 1): damping as large as the spring at the scale's speed.
  static constexpr double dissipation = 1.0;

  double offset_weight() const noexcept {
    return detail::offset_weight_of(air.deviation, variance);
  }
};

// The linear part, F₀, k, c, m, in the order of elimination: the least important is last, so that
// it is excluded if it is collinear with the others.
enum Part : std::size_t { offset, stiffness, damping, memory, parts };

// The least-squares problem A p = b of a candidate at one exponent; of A the lower triangle.
struct Normal {
  Matrix<parts> a{};
  Vector<parts> b{};
};

// Of a candidate at an exponent; `second` as of spectrum_of().
template <class Sums>
[[gnu::noinline]] Normal normal_of(const Samples<Sums>& samples, const Candidate& law, double n,
                                   double second) noexcept {
  using enum PowerTable::Kind;
  const PowerTable& table = samples.table();
  const Growth growth = table.growth(2.0 * n);
  const Interpolation once(Grid::place_of_power(n), growth);
  const Interpolation twice(Grid::place_of_power(2.0 * n), growth);
  const Window single = once.at(0, Grid::powers);
  Normal s{};
  s.a[offset][offset] = table.weight();
  s.a[stiffness][offset] = table.at(plain, single);
  s.a[stiffness][stiffness] = table.at(plain, twice.at(0, Grid::powers));
  s.b[offset] = table.force_sum();
  s.b[stiffness] = table.at(force, single);
  if (law.damping != Damping::none) {
    // ξᵖ = ξⁿ, or ξⁿ⁻¹.
    const std::size_t lower = law.damping == Damping::half_space ? Grid::one : 0;
    const Window alone = once.at(lower, Grid::powers);
    s.a[damping][offset] = table.at(speed, alone);
    s.a[damping][stiffness] = table.at(speed, twice.at(lower, Grid::powers));
    s.a[damping][damping] = table.at(speed_squared, twice.at(2 * lower, Grid::powers));
    s.b[damping] = table.at(power, alone);
  }
  if (law.memory != Memory::none) {
    // From exponent to exponent a sum of one power grows as from q to q, one of two powers twice.
    const MemoryColumn column =
        samples.sums().column(once.at(Grid::first_exponent, Grid::exponents),
                              once.square_at(Grid::first_exponent, Grid::exponents),
                              spectrum_of<typename Sums::Times>(law.memory, second));
    s.a[memory][offset] = column.one;
    s.a[memory][stiffness] = column.power;
    if (law.damping == Damping::hunt_crossley) s.a[memory][damping] = column.power_speed;
    if (law.damping == Damping::half_space) s.a[memory][damping] = column.slope_speed;
    s.a[memory][memory] = column.square;
    s.b[memory] = column.force;
  }
  const double per = 1.0 / samples.scale();
  for (std::size_t i = 0; i < parts; ++i) {
    s.b[i] *= per;
    for (std::size_t j = 0; j <= i; ++j) s.a[i][j] *= per;
  }
  return s;
}

// The fitted parts, one bit each.
using PartSet = std::uint32_t;

constexpr PartSet bit(Part part) noexcept { return PartSet{1} << part; }
constexpr bool has(PartSet set, Part part) noexcept { return (set & bit(part)) != 0; }

constexpr PartSet parts_of(const Candidate& law, bool with_offset) noexcept {
  PartSet set = bit(stiffness);
  if (law.damping != Damping::none) set |= bit(damping);
  if (law.memory != Memory::none) set |= bit(memory);
  if (with_offset) set |= bit(offset);
  return set;
}

struct Linear {
  Vector<parts> value{};
  double gain = 0.0;   // bᵀA⁻¹b: the reduction of Σ F²
  PartSet fitted = 0;  // parts with a valid pivot
};

// A = L D Lᵀ of the fitted parts; a part whose pivot is rounding error is excluded: its row and
// column are empty.
class Factored {
 public:
  Factored(const Normal& normal, PartSet wanted) noexcept {
    for (std::size_t i = 0; i < parts; ++i) {
      const double diagonal = normal.a[i][i];
      double pivot = diagonal;
      Vector<parts> row{};  // L D
      for (std::size_t j = 0; j < i; ++j) {
        row[j] = normal.a[i][j];
        for (std::size_t k = 0; k < j; ++k) row[j] -= row[k] * lower_[j][k];
        lower_[i][j] = row[j] * per_pivot_[j];
        pivot -= row[j] * lower_[i][j];
      }
      // Of sums that are squares, what is less than 1e-150 is not there; sums of 1e4 samples,
      // interpolated to 1e-9 and better, carry 1e-12.
      const Part part = static_cast<Part>(i);
      if (has(wanted, part) && diagonal > 1e-150 && pivot > 1e-11 * diagonal) {
        fitted_ |= bit(part);
        per_pivot_[i] = 1.0 / pivot;
      } else {
        lower_[i] = {};
      }
    }
  }

  PartSet fitted() const noexcept { return fitted_; }

  // Of the first so many parts alone.
  Linear solve(const Vector<parts>& b, std::size_t count = parts) const noexcept {
    Linear result{.fitted = fitted_ & (bit(static_cast<Part>(count)) - 1U)};
    Vector<parts> half{};
    for (std::size_t i = 0; i < count; ++i) {
      half[i] = b[i];
      for (std::size_t j = 0; j < i; ++j) half[i] -= lower_[i][j] * half[j];
      result.gain += half[i] * half[i] * per_pivot_[i];
    }
    for (std::size_t i = count; i-- > 0;) {
      result.value[i] = half[i] * per_pivot_[i];
      for (std::size_t j = i + 1; j < count; ++j) result.value[i] -= lower_[j][i] * result.value[j];
    }
    return result;
  }

  // A⁻¹; empty rows where a part is not fitted.
  Matrix<parts> inverse() const noexcept {
    Matrix<parts> result{};
    for (std::size_t i = 0; i < parts; ++i) {
      Vector<parts> one{};
      one[i] = 1.0;
      if (has(fitted_, static_cast<Part>(i))) result[i] = solve(one).value;
    }
    return result;
  }

 private:
  Matrix<parts> lower_{};  // less its diagonal of ones
  Vector<parts> per_pivot_{};
  PartSet fitted_ = 0;
};

// The linear part by least squares, with c ≥ 0 and m ≥ 0 where a material remembers, as a passive
// one must. A damper that gives energy back is what a Hunt–Crossley or Kelvin–Voigt fit may ask
// for, and is left to it. On the other laws it is no damper but a sign of another: they have to be
// passive, and of what is, the better fit counts.
[[gnu::noinline]] inline Linear solve_passive(const Normal& normal, const Candidate& law,
                                              bool with_offset) noexcept {
  const PartSet wanted = parts_of(law, with_offset);
  const Factored factored(normal, wanted);
  const Linear free = factored.solve(normal.b);
  const auto without = [&](PartSet left_out) noexcept {
    return Factored(normal, wanted & ~left_out).solve(normal.b);
  };
  if (!has(wanted, memory)) {
    const bool may = law.damping != Damping::half_space || law.linear;
    return may || !(free.value[damping] < 0.0) ? free : without(bit(damping));
  }
  if (!(free.value[memory] < 0.0) && !(free.value[damping] < 0.0)) return free;
  const Linear undamped = without(bit(damping));
  const bool sound = !(undamped.value[memory] < 0.0);
  const Linear rested = factored.solve(normal.b, memory);
  // Without memory a law may have any damping; but this one stands among those that have memory.
  const bool passive = !(rested.value[damping] < 0.0);
  if (sound && passive) return undamped.gain > rested.gain ? undamped : rested;
  if (sound) return undamped;
  return passive ? rested : without(bit(memory) | bit(damping));
}

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
