// A solution in SI: the law, and the covariance of its eight numbers and the offset.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/force_laws.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"
#include "palpate/viscoelastic/assumed_ends.hpp"
#include "palpate/viscoelastic/solution.hpp"

namespace palpate::viscoelastic {

// The law's numbers and, last, the offset.
inline constexpr std::size_t joint_size = GeneralisedHuntCrossley::size + 1;

inline double damping_exponent(const Solution& s) noexcept {
  return s.law().damping == Damping::half_space ? s.fit.n - 1.0 : s.fit.n;
}

// What k and m are worth in N/mⁿ, and c in N·s/mᵖ⁺¹.
struct LawUnits {
  double stiffness;
  double damping;

  LawUnits(const Solution& s, const Units& u) noexcept
      : stiffness(detail::saturate(u.force * detail::bounded_exp(-s.fit.n * u.log_penetration))),
        damping(detail::saturate(u.force / u.velocity *
                                 detail::bounded_exp(-damping_exponent(s) * u.log_penetration))) {}
};

template <class Times>
GeneralisedHuntCrossley law_in_si(const Solution& s, const Times& times, const Units& u) noexcept {
  const LawUnits unit(s, u);
  GeneralisedHuntCrossley law{detail::saturate(s.fit.value[stiffness] * unit.stiffness),
                              s.fit.n,
                              detail::saturate(s.fit.value[damping] * unit.damping),
                              damping_exponent(s),
                              detail::saturate(s.fit.value[memory] * unit.stiffness),
                              0.0,
                              0.0,
                              0.0};
  if (s.law().memory == Memory::none) return law;
  if (s.law().memory == Memory::single) {
    law.longest_time = times.time(s.fit.place.second);
    return law;
  }
  if (s.law().memory == Memory::power_law) {
    law.spectrum_exponent = s.fit.second();
  }
  // Each branch stands for the times that are nearer to it than to the next.
  law.shortest_time = times.time(-0.5);
  law.longest_time = times.time(static_cast<double>(Times::count) - 0.5);
  return law;
}

// dK = U (dk − k ln x_r dn), and so for B and M. Before the first answer nothing is known.
template <class Times, class Motion>
[[gnu::noinline]] Matrix<joint_size> covariance_in_si(const Solution& s,
                                                      const GeneralisedHuntCrossley& law,
                                                      const Times& times, const Motion& motion,
                                                      const Units& u) noexcept {
  Matrix<joint_size> joint{};
  if (s.known == 0) {
    for (const std::size_t i : {0, 2, 8}) joint[i][i] = detail::largest_variance;
    if (s.given == 0) joint[1][1] = joint[3][3] = detail::largest_variance;
    return joint;
  }
  const Matrix<unknowns> root = detail::cholesky(s.covariance.full());
  const LawUnits unit(s, u);
  const double by_depth = -u.log_penetration * Grid::step;
  std::array<Vector<unknowns>, joint_size> rows{};
  for (std::size_t j = 0; j < unknowns; ++j) {
    const double n = root[exponent_node][j], second = root[second_node][j];
    rows[0][j] = unit.stiffness * root[stiffness][j] + law.stiffness * by_depth * n;
    rows[1][j] = rows[3][j] = Grid::step * n;
    rows[2][j] = unit.damping * root[damping][j] + law.damping * by_depth * n;
    rows[4][j] = unit.stiffness * root[memory][j] + law.relaxation_stiffness * by_depth * n;
    if (s.law().memory == Memory::power_law) {
      rows[5][j] = second_of(Memory::power_law, 1.0) * second;
    }
    if (s.law().memory == Memory::single) {
      rows[7][j] = law.longest_time * std::log(Times::ratio) * second;
    }
    rows[joint_size - 1][j] = u.force * root[offset][j];
  }
  for (std::size_t i = 0; i < joint_size; ++i) {
    for (std::size_t j = i; j < joint_size; ++j) {
      joint[i][j] = joint[j][i] = detail::dot(rows[i], rows[j]);
    }
  }
  add_assumed_ends(joint, s, law, times, motion, u);
  detail::bound_variances(joint, detail::largest_variance);
  return joint;
}

}  // namespace palpate::viscoelastic
