// A candidate law and its least-squares problem: the cost J as a function of the exponent, with the
// linear part projected out.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/projection/contact_samples.hpp"
#include "palpate/viscoelastic/power_table.hpp"
#include "palpate/viscoelastic/samples.hpp"

namespace palpate::viscoelastic {

// The laws that compete: F = F₀ + k ξⁿ + c ξᵖ w + Σ mᵢ gᵢ,  ġᵢ = d(ξⁿ)/dt − gᵢ/τᵢ.

// The damping form: none, p = n (Hunt & Crossley), p = n − 1 (Kelvin–Voigt half-space), or p = 0.
enum class Damping : std::uint8_t { none, hunt_crossley, half_space, linear };

enum class Memory : std::uint8_t { none, spectrum };

struct Candidate {
  Damping damping;
  Memory memory;
  bool linear = false;  // n is fixed at 1: with p = n − 1 the Kelvin–Voigt law

  constexpr bool remembers() const noexcept { return memory != Memory::none; }
  constexpr bool operator==(const Candidate&) const noexcept = default;
};

// The candidates without memory come first.
inline constexpr std::array<Candidate, 7> candidates{{
    {Damping::half_space, Memory::none, true},
    {Damping::hunt_crossley, Memory::none},
    {Damping::half_space, Memory::none},
    {Damping::hunt_crossley, Memory::spectrum},
    {Damping::half_space, Memory::spectrum},
    {Damping::linear, Memory::spectrum},
    {Damping::none, Memory::spectrum},
}};

inline constexpr std::size_t hunt_crossley = 1;  // index among the candidates

// Mean velocity over rms velocity above which the motion counts as one-way at nearly constant
// speed: 1 at constant speed, 0.90 for a half sine, 0 for any motion that returns.
inline constexpr double one_way_limit = 0.8;

// A set of candidates: bit i represents candidates[i].
using Offered = std::uint16_t;
inline constexpr Offered forgetful = 0b111;  // the candidates without memory
// All candidates except the law that dissipates by its memory only: it is the others with c = 0.
inline constexpr Offered common = 0b0111111;

// Prior information, in scaled units.
struct Priors {
  double variance = 0.0;  // σ² of the force, which weights the priors
  double exponent = 0.0;  // known n; 0: estimated
  double centre = 1.3;    // n ~ N(1.3, 1), between a spring and a cone
  double deviation = 1.0;
  detail::OffsetPrior air{0.0, 0.0};  // F₀ ~ N(mean, deviation²); deviation 0: no prior
  std::uint64_t offset = 1;  // whether it is fitted; a word, so that no saved state has padding

  // c/k ~ N(0, 1): at the reference speed the damping force is as large as the elastic force.
  static constexpr double dissipation = 1.0;

  double offset_weight() const noexcept {
    return detail::offset_weight_of(air.deviation, variance);
  }
};

// The linear parameters: F₀, k, c, the weights of the start columns, and mᵢ.
enum Part : std::size_t { offset, stiffness, damping, start, memory = start + start_columns };
inline constexpr std::size_t elastic_parts = start;  // number of parts in a law without memory
inline constexpr std::size_t parts = memory + rungs;

// A set of parts, one bit each.
using PartSet = std::uint32_t;

constexpr PartSet bit(std::size_t part) noexcept { return PartSet{1} << part; }
constexpr bool has(PartSet set, std::size_t part) noexcept { return (set & bit(part)) != 0; }
inline constexpr PartSet all_memory = (bit(rungs) - 1U) << memory;
inline constexpr PartSet all_start = (bit(start_columns) - 1U) << start;

// The normal equations A p = b of a candidate at one exponent; only the lower triangle of A is set.
struct Normal {
  Matrix<parts> a;
  Vector<parts> b;
};

// Adds the entries of the start columns and branches to the normal equations.
inline void add_memory(Normal& s, const Samples& samples, Damping damper, const Window& once,
                       const Window& twice) noexcept {
  const BranchSums& sums = samples.sums();
  const StartSums& begun = samples.start_sums();
  for (std::size_t a = 0; a < start_columns; ++a) {
    const StartSums::Column& z = begun.column(a);
    auto& row = s.a[start + a];
    row[offset] = z.one;
    row[stiffness] = once.of(z.power.data());
    row[damping] = damper == Damping::hunt_crossley ? once.of(z.power_speed.data())
                   : damper == Damping::half_space  ? once.of(z.slope_speed.data())
                   : damper == Damping::linear      ? z.speed
                                                    : 0.0;
    for (std::size_t b = 0; b <= a; ++b) row[start + b] = z.start[b];
    s.b[start + a] = z.force;
  }
  for (std::size_t i = 0; i < rungs; ++i) {
    const auto crossed = [&](BranchSums::Kind kind, const Window& window) noexcept {
      return window.of(sums.crossed(i, kind).data());
    };
    auto& row = s.a[memory + i];
    row[offset] = crossed(BranchSums::one, once);
    row[stiffness] = crossed(BranchSums::power, twice);
    row[damping] = damper == Damping::hunt_crossley ? crossed(BranchSums::power_speed, twice)
                   : damper == Damping::half_space  ? crossed(BranchSums::slope_speed, twice)
                   : damper == Damping::linear      ? crossed(BranchSums::speed, once)
                                                    : 0.0;
    for (std::size_t a = 0; a < start_columns; ++a) {
      row[start + a] = once.of(begun.column(a).branch[i].data());
    }
    for (std::size_t j = 0; j <= i; ++j) row[memory + j] = twice.of(sums.pair(j, i).data());
    s.b[memory + i] = crossed(BranchSums::force, once);
  }
}

[[gnu::noinline]] inline Normal normal_of(const Samples& samples, const Candidate& law,
                                          double n) noexcept {
  using enum PowerTable::Kind;
  const PowerTable& table = samples.table();
  const Growth growth = table.growth(2.0 * n);
  const Interpolation once(Grid::place_of_power(n), growth);
  const Interpolation twice(Grid::place_of_power(2.0 * n), growth);
  const Window single = once.at(0, Grid::powers);
  Normal s;
  s.a[offset][offset] = table.weight();
  s.a[stiffness][offset] = table.at(plain, single);
  s.a[stiffness][stiffness] = table.at(plain, twice.at(0, Grid::powers));
  s.b[offset] = table.force_sum();
  s.b[stiffness] = table.at(force, single);
  if (law.damping == Damping::linear) {
    s.a[damping][offset] = table.at_node(speed, Grid::zero);
    s.a[damping][stiffness] = table.at(speed, single);
    s.a[damping][damping] = table.at_node(speed_squared, Grid::zero);
    s.b[damping] = table.at_node(power, Grid::zero);
  } else if (law.damping != Damping::none) {
    // ξᵖ = ξⁿ, or ξⁿ⁻¹.
    const std::size_t lower = law.damping == Damping::half_space ? Grid::one : 0;
    const Window alone = once.at(lower, Grid::powers);
    s.a[damping][offset] = table.at(speed, alone);
    s.a[damping][stiffness] = table.at(speed, twice.at(lower, Grid::powers));
    s.a[damping][damping] = table.at(speed_squared, twice.at(2 * lower, Grid::powers));
    s.b[damping] = table.at(power, alone);
  } else {
    s.a[damping].fill(0.0);
    s.b[damping] = 0.0;
  }
  if (law.remembers()) {
    // From exponent to exponent a sum of one power grows as from q to q; a sum of two powers grows
    // as its square.
    add_memory(s, samples, law.damping, once.at(Grid::first_exponent, Grid::exponents),
               once.square_at(Grid::first_exponent, Grid::exponents));
  }
  const double per = 1.0 / samples.scale();
  for (std::size_t i = 0; i < (law.remembers() ? parts : elastic_parts); ++i) {
    s.b[i] *= per;
    for (std::size_t j = 0; j <= i; ++j) s.a[i][j] *= per;
  }
  return s;
}

struct Linear {
  Vector<parts> value{};
  double gain = 0.0;   // the reduction of Σ F²
  PartSet fitted = 0;  // parts with a valid pivot that are not held at 0
};

// The Cholesky factor A = L Lᵀ for some of the parts. If the pivot of a part is only rounding
// error, the part is collinear with others and is excluded.
class Factored {
 public:
  Factored(const Normal& normal, PartSet wanted) noexcept {
    for (PartSet rest = wanted; rest != 0; rest &= rest - 1U) {
      const auto part = static_cast<std::size_t>(std::countr_zero(rest));
      const auto& from = normal.a[part];
      auto& row = lower_[count_];
      double pivot = from[part];
      for (std::size_t j = 0; j < count_; ++j) {
        double sum = from[parts_[j]];
        for (std::size_t k = 0; k < j; ++k) sum -= row[k] * lower_[j][k];
        row[j] = sum * per_pivot_[j];
        pivot -= row[j] * row[j];
      }
      // A sum of squares below 1e-150 counts as zero. Sums of 1e4 samples, interpolated to 1e-9 or
      // better, have an error of 1e-12.
      if (!(from[part] > 1e-150 && pivot > 1e-11 * from[part])) continue;
      per_pivot_[count_] = 1.0 / std::sqrt(pivot);
      parts_[count_++] = part;
      fitted_ |= bit(part);
    }
  }

  PartSet fitted() const noexcept { return fitted_; }

  Linear solve(const Vector<parts>& b) const noexcept {
    Linear result{.fitted = fitted_};
    std::array<double, parts> half;
    for (std::size_t i = 0; i < count_; ++i) {
      double sum = b[parts_[i]];
      for (std::size_t j = 0; j < i; ++j) sum -= lower_[i][j] * half[j];
      half[i] = sum * per_pivot_[i];
      result.gain += half[i] * half[i];
    }
    for (std::size_t i = count_; i-- > 0;) {
      double sum = half[i];
      for (std::size_t j = i + 1; j < count_; ++j) sum -= lower_[j][i] * result.value[parts_[j]];
      result.value[parts_[i]] = sum * per_pivot_[i];
    }
    return result;
  }

  // A⁻¹; the rows and columns of parts that are not fitted are zero.
  Matrix<parts> inverse() const noexcept {
    Matrix<parts> result{};
    for (std::size_t i = 0; i < count_; ++i) {
      Vector<parts> one{};
      one[parts_[i]] = 1.0;
      result[parts_[i]] = solve(one).value;
    }
    return result;
  }

 private:
  // Not initialised: only entries that the elimination has written are read.
  std::array<std::array<double, parts>, parts> lower_;
  std::array<double, parts> per_pivot_;
  std::array<std::size_t, parts> parts_;
  std::size_t count_ = 0;
  PartSet fitted_ = 0;
};

// The linear part by least squares with the constrained parts at or above 0 (Lawson & Hanson,
// Solving Least Squares Problems, 1974, chapter 23). `guess` are the parts that start above 0.
[[gnu::noinline]] inline Linear solve_nonnegative(const Normal& normal, PartSet wanted,
                                                  PartSet constrained, PartSet guess) noexcept {
  constrained &= wanted;
  PartSet open = (wanted & ~constrained) | (guess & constrained);
  double largest = 0.0;
  Vector<parts> per_size{};
  for (PartSet rest = wanted; rest != 0; rest &= rest - 1U) {
    const auto i = static_cast<std::size_t>(std::countr_zero(rest));
    if (!(normal.a[i][i] > 1e-150)) continue;
    per_size[i] = 1.0 / std::sqrt(normal.a[i][i]);
    largest = std::max(largest, std::abs(normal.b[i]) * per_size[i]);
  }
  Linear now;
  Factored factored(normal, open);
  for (std::size_t round = 0; round < 3 * parts; ++round) {
    // Moves to the least squares of the open parts, or along the way until one of them reaches 0.
    for (;;) {
      const Linear there = factored.solve(normal.b);
      double way = 1.0;
      PartSet below = 0;
      for (PartSet rest = there.fitted & constrained; rest != 0; rest &= rest - 1U) {
        const auto i = static_cast<std::size_t>(std::countr_zero(rest));
        if (there.value[i] > 0.0) continue;
        below |= bit(i);
        const double down = now.value[i] - there.value[i];
        way = std::min(way, down > 0.0 ? now.value[i] / down : 0.0);
      }
      if (below == 0) {
        now = there;
        break;
      }
      PartSet stopped = 0;
      for (PartSet rest = open; rest != 0; rest &= rest - 1U) {
        const auto i = static_cast<std::size_t>(std::countr_zero(rest));
        now.value[i] += way * (there.value[i] - now.value[i]);
        if (has(below, i) && !(now.value[i] > 1e-14 * per_size[i])) {
          stopped |= bit(i);
          now.value[i] = 0.0;
        }
      }
      open &= ~(stopped == 0 ? below : stopped);
      factored = Factored(normal, open);
    }
    // Opens the part with the steepest descent of J. If there is none, this is the minimum.
    double steepest = 1e-9 * largest;
    std::size_t joining = parts;
    for (PartSet rest = constrained & ~open; rest != 0; rest &= rest - 1U) {
      const auto i = static_cast<std::size_t>(std::countr_zero(rest));
      double slope = normal.b[i];
      for (PartSet held = now.fitted; held != 0; held &= held - 1U) {
        const auto j = static_cast<std::size_t>(std::countr_zero(held));
        slope -= (i > j ? normal.a[i][j] : normal.a[j][i]) * now.value[j];
      }
      slope *= per_size[i];
      if (!(slope > steepest)) continue;
      steepest = slope;
      joining = i;
    }
    if (joining == parts) break;
    open |= bit(joining);
    factored = Factored(normal, open);
    // A part that its pivot excludes again would be opened forever.
    if (!has(factored.fitted(), joining)) {
      constrained &= ~bit(joining);
      open &= ~bit(joining);
      factored = Factored(normal, open);
    }
  }
  return now;
}

// Places beyond the grid are clamped to its ends, where the sums end. NaN counts as 0.
constexpr double exponent_at(const Candidate& law, const Priors& priors, double place) noexcept {
  if (law.linear) return 1.0;
  if (priors.exponent > 0.0) return priors.exponent;
  constexpr double last = static_cast<double>(Grid::exponents - 1);
  return Grid::exponent_at(place > 0.0 ? std::min(place, last) : 0.0);
}

// A candidate fitted at one place, in nodes of the grid of exponents.
struct Point {
  double place = 0.0;
  Linear linear{};
  double cost = 0.0;  // J less Σ F², with the priors
};

struct Problem {
  const Samples& samples;
  const Candidate& law;
  const Priors& priors;
  double stiffness_before;    // from the last solution, weights the damping prior; 0: no prior
  PartSet left_out = 0;       // parts that are held at 0
  bool free_damping = false;  // whether c may be negative in a law with memory

  bool searches_exponent() const noexcept { return !law.linear && !(priors.exponent > 0.0); }
  double exponent(double place) const noexcept { return exponent_at(law, priors, place); }

  PartSet wanted() const noexcept {
    PartSet set = bit(stiffness);
    if (law.damping != Damping::none) set |= bit(damping);
    if (priors.offset != 0) set |= bit(offset);
    if (law.remembers()) {
      set |= (bit(samples.ladder().open()) - 1U) << memory;
      if (samples.start_sums().any()) set |= all_start;
    }
    return set & ~left_out;
  }

  // A relaxing material is passive, so its damper must be too. A Hunt–Crossley or Kelvin–Voigt fit
  // may have a negative damper.
  PartSet constrained() const noexcept {
    if (law.remembers()) return all_memory | bit(stiffness) | (free_damping ? 0 : bit(damping));
    return law.damping == Damping::half_space && !law.linear ? bit(damping) : 0;
  }

  // The normal equations with the priors.
  Normal normal(double place) const noexcept {
    Normal normal = normal_of(samples, law, exponent(place));
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

  // The nonnegative solution at a place. `near` is the guess of the parts above 0.
  [[gnu::noinline]] Point at(double place, PartSet near) const noexcept {
    return with(place, solve_nonnegative(normal(place), wanted(), constrained(), near));
  }

  // The solution with exactly these parts, of any sign.
  Point with_parts(double place, PartSet fixed) const noexcept {
    const Normal normal = this->normal(place);
    return with(place, Factored(normal, fixed).solve(normal.b));
  }

  Point with(double place, const Linear& linear) const noexcept {
    const double away = (exponent(place) - priors.centre) / priors.deviation;
    return {place, linear, priors.variance * away * away - linear.gain};
  }
};

}  // namespace palpate::viscoelastic
