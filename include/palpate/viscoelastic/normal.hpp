// The least-squares problem of a candidate at one exponent, from the sums.
#pragma once

#include <cstddef>

#include "palpate/matrix.hpp"
#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/memory_sums.hpp"
#include "palpate/viscoelastic/power_table.hpp"
#include "palpate/viscoelastic/samples.hpp"
#include "palpate/viscoelastic/spectrum.hpp"
#include "palpate/viscoelastic/window.hpp"

namespace palpate::viscoelastic {

// The linear part, F₀, k, c, m, in the order of elimination: what explains least is last, so that
// it is left out where it says what others do.
enum Part : std::size_t { offset, stiffness, damping, memory, parts };

// A p = b; of A the lower triangle.
struct Normal {
  Matrix<parts> a{};
  Vector<parts> b{};
};

// Fills in what a damper has in common with itself, the offset, the spring and the force.
inline void add_damping(Normal& s, const PowerTable& table, Damping kind, const Interpolation& once,
                        const Interpolation& twice) noexcept {
  if (kind == Damping::none) return;
  using enum PowerTable::Kind;
  // ξᵖ = ξⁿ, or ξⁿ⁻¹.
  const std::size_t lower = kind == Damping::half_space ? Grid::one : 0;
  const Window alone = once.at(lower, Grid::powers);
  s.a[damping][offset] = table.at(speed, alone);
  s.a[damping][stiffness] = table.at(speed, twice.at(lower, Grid::powers));
  s.a[damping][damping] = table.at(speed_squared, twice.at(2 * lower, Grid::powers));
  s.b[damping] = table.at(power, alone);
}

// The same of memory.
template <class Sums>
void add_memory(Normal& s, const Sums& sums, const Candidate& law, const Interpolation& once,
                double second) noexcept {
  // From exponent to exponent a sum of one power grows as from q to q, one of two powers twice.
  const MemoryWindows windows{once.at(Grid::first_exponent, Grid::exponents),
                              once.square_at(Grid::first_exponent, Grid::exponents)};
  const MemoryColumn column =
      sums.column(windows, spectrum_of<typename Sums::Times>(law.memory, second));
  s.a[memory][offset] = column.one;
  s.a[memory][stiffness] = column.power;
  if (law.damping == Damping::hunt_crossley) s.a[memory][damping] = column.power_speed;
  if (law.damping == Damping::half_space) s.a[memory][damping] = column.slope_speed;
  s.a[memory][memory] = column.square;
  s.b[memory] = column.force;
}

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
  add_damping(s, table, law.damping, once, twice);
  if (law.memory != Memory::none) add_memory(s, samples.sums(), law, once, second);
  const double per = 1.0 / samples.scale();
  for (std::size_t i = 0; i < parts; ++i) {
    s.b[i] *= per;
    for (std::size_t j = 0; j <= i; ++j) s.a[i][j] *= per;
  }
  return s;
}

}  // namespace palpate::viscoelastic
