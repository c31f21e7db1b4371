// The linear part of a candidate at one exponent: k, c, m and F₀ by least squares, with c ≥ 0 and
// m ≥ 0 where a material remembers, as a passive one must.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/normal.hpp"

namespace palpate::viscoelastic {

// Which of the parts are fitted, a bit each.
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
  double gain = 0.0;   // bᵀA⁻¹b: by so much Σ F² is reduced
  PartSet fitted = 0;  // parts that have a sound pivot
};

// A = L Lᵀ of the fitted parts, from a unit diagonal; a part whose pivot is rounding is left out: its
// row is that of the unit matrix, and its column empty.
class Factored {
 public:
  Factored(const Normal& normal, PartSet wanted) noexcept {
    for (std::size_t i = 0; i < parts; ++i) {
      const double diagonal = normal.a[i][i];
      // Of sums that are squares; what is less than this is not there.
      const bool there = has(wanted, static_cast<Part>(i)) && diagonal > 1e-150;
      unit_[i] = there ? 1.0 / std::sqrt(diagonal) : 0.0;
      Vector<parts> row{};
      double pivot = 1.0;
      for (std::size_t j = 0; j < i; ++j) {
        double entry = normal.a[i][j] * unit_[i] * unit_[j];
        for (std::size_t k = 0; k < j; ++k) entry -= row[k] * lower_[j][k];
        row[j] = entry * per_pivot_[j];
        pivot -= row[j] * row[j];
      }
      // Sums of 1e4 samples, interpolated to 1e-9 and better, carry 1e-12.
      if (there && pivot > 1e-11) {
        fitted_ |= bit(static_cast<Part>(i));
        per_pivot_[i] = 1.0 / std::sqrt(pivot);
        lower_[i] = row;
      } else {
        unit_[i] = 0.0;
      }
    }
  }

  PartSet fitted() const noexcept { return fitted_; }

  Linear solve(const Vector<parts>& b) const noexcept {
    Linear result{.fitted = fitted_};
    Vector<parts> half;
    for (std::size_t i = 0; i < parts; ++i) {
      double rest = b[i] * unit_[i];
      for (std::size_t j = 0; j < i; ++j) rest -= lower_[i][j] * half[j];
      half[i] = rest * per_pivot_[i];
      result.gain += half[i] * half[i];
    }
    for (std::size_t i = parts; i-- > 0;) {
      double rest = half[i];
      for (std::size_t j = i + 1; j < parts; ++j) rest -= lower_[j][i] * result.value[j];
      result.value[i] = rest * per_pivot_[i];
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
      result[i] = solve(one).value;
    }
    return result;
  }

 private:
  Matrix<parts> lower_{};  // less its diagonal
  Vector<parts> per_pivot_{};
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
  const Linear rested = solve(normal, wanted & ~bit(memory));
  // Without memory a law may have any damping; but this one stands among those that have memory.
  const bool passive = !(rested.value[damping] < 0.0);
  if (sound && passive) return undamped.gain > rested.gain ? undamped : rested;
  if (sound) return undamped;
  if (passive) return rested;
  return solve(normal, wanted & ~(bit(memory) | bit(damping)));
}

}  // namespace palpate::viscoelastic
