// The linear part of a candidate at one exponent: k, c, m and F₀ by least squares, with c ≥ 0 and
// m ≥ 0 where a material remembers, as a passive one must.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/samples.hpp"

namespace palpate::viscoelastic {

// Which of the parts are fitted, a bit each; of a word's size, so that no saved state has padding.
using PartSet = std::uint64_t;

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
  double gain = 0.0;   // bᵀA⁻¹b: by so much Σ F² is reduced
  PartSet fitted = 0;  // parts that have a sound pivot
};

// A = L Lᵀ of the fitted parts, from a unit diagonal; a part whose pivot is rounding is left out.
class Factored {
 public:
  Factored(const Normal& normal, PartSet wanted) noexcept {
    for (const Part part : order) {
      if (!has(wanted, part)) continue;
      const double diagonal = normal.a[part][part];
      // Of sums that are squares; what is less than this is not there.
      if (!(diagonal > 1e-150)) continue;
      unit_[part] = 1.0 / std::sqrt(diagonal);
      double pivot = 1.0;
      Vector<parts> row{};
      for (const Part before : order) {
        if (before == part) break;
        if (!has(fitted_, before)) continue;
        double entry = normal.a[part][before] * unit_[part] * unit_[before];
        for (const Part earlier : order) {
          if (earlier == before) break;
          entry -= row[earlier] * lower_[before][earlier];
        }
        row[before] = entry / lower_[before][before];
        pivot -= row[before] * row[before];
      }
      // Sums of 1e4 samples, interpolated to 1e-9 and better, carry 1e-12.
      if (!(pivot > 1e-11)) continue;
      row[part] = std::sqrt(pivot);
      lower_[part] = row;
      fitted_ |= bit(part);
    }
  }

  PartSet fitted() const noexcept { return fitted_; }

  Linear solve(const Vector<parts>& b) const noexcept {
    Linear result{.fitted = fitted_};
    Vector<parts> half{};
    for (const Part part : order) {
      if (!has(fitted_, part)) continue;
      double rest = b[part] * unit_[part];
      for (const Part before : order) {
        if (before == part) break;
        rest -= lower_[part][before] * half[before];
      }
      half[part] = rest / lower_[part][part];
      result.gain += half[part] * half[part];
    }
    for (std::size_t k = parts; k-- > 0;) {
      const Part part = order[k];
      if (!has(fitted_, part)) continue;
      double rest = half[part];
      for (std::size_t later = k + 1; later < parts; ++later) {
        rest -= lower_[order[later]][part] * result.value[order[later]];
      }
      result.value[part] = rest / lower_[part][part];
    }
    for (std::size_t i = 0; i < parts; ++i) result.value[i] *= unit_[i];
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
  // What explains least is taken last, so that it is left out where it says what others do.
  static constexpr std::array<Part, parts> order{offset, stiffness, damping, memory};

  Matrix<parts> lower_{};
  Vector<parts> unit_{};
  PartSet fitted_ = 0;
};

[[gnu::noinline]] inline Linear solve(const Normal& normal, PartSet wanted) noexcept {
  return Factored(normal, wanted).solve(normal.b);
}

// A damper that gives energy back is what a Hunt–Crossley or Kelvin–Voigt fit may ask for, and is
// left to it. On the other laws it is no damper but a sign of another: they have to be passive, and
// of what is, the better fit counts.
[[gnu::noinline]] inline Linear solve_passive(const Normal& normal, const Candidate& law,
                                              bool with_offset) noexcept {
  const PartSet wanted = parts_of(law, with_offset);
  const Linear free = solve(normal, wanted);
  if (!has(wanted, memory)) {
    const bool may = law.damping != Damping::half_space || law.linear;
    if (may || !(free.value[damping] < 0.0)) return free;
    return solve(normal, wanted & ~bit(damping));
  }
  if (!(free.value[memory] < 0.0) && !(free.value[damping] < 0.0)) return free;
  const Linear undamped = solve(normal, wanted & ~bit(damping));
  const bool sound = !(undamped.value[memory] < 0.0);
  const Linear forgetful = solve(normal, wanted & ~bit(memory));
  // Without memory a law may have any damping; but this one stands among those that have memory.
  const bool passive = !(forgetful.value[damping] < 0.0);
  if (sound && passive) return undamped.gain > forgetful.gain ? undamped : forgetful;
  if (sound) return undamped;
  if (passive) return forgetful;
  return solve(normal, wanted & ~(bit(memory) | bit(damping)));
}

}  // namespace palpate::viscoelastic
