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

// A = L D Lᵀ of the fitted parts; a part whose pivot is rounding is left out: its row and its
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

// A damper that gives energy back is what a Hunt–Crossley or Kelvin–Voigt fit may ask for, and is
// left to it. On the other laws it is no damper but a sign of another: they have to be passive, and
// of what is, the better fit counts.
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

}  // namespace palpate::viscoelastic
