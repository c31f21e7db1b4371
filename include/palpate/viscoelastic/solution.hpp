// What a viscoelastic estimator answers: one candidate, fitted; its force, and its numbers in SI.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/force_laws.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"
#include "palpate/viscoelastic/power_table.hpp"
#include "palpate/viscoelastic/problem.hpp"
#include "palpate/viscoelastic/samples.hpp"

namespace palpate::viscoelastic {

// Of F₀, k, c and m, and then of n and of the second, in nodes of the grid.
inline constexpr std::size_t unknowns = parts + 2;
enum Unknown : std::size_t { exponent_node = parts, second_node };

// The place of an entry of the lower triangle of a symmetric matrix, which is kept row by row.
constexpr std::size_t in_triangle(std::size_t row, std::size_t column) noexcept {
  return row * (row + 1) / 2 + column;
}

// A candidate with its numbers, in scaled units.
struct Fitted {
  std::size_t candidate = 1;
  double n = 1.0;
  Place place{};
  Vector<parts> value{};

  const Candidate& law() const noexcept { return candidates[candidate]; }
  double second() const noexcept { return second_of(law().memory, place.second); }
};

struct Solution {
  Fitted fit;
  Vector<in_triangle(unknowns, 0)> covariance{};
  std::uint32_t at_edge = 0;  // whether it is, of the range of exponents
  std::uint16_t known = 0;    // 0 before the first
  std::uint16_t given = 0;    // whether the exponent is

  const Candidate& law() const noexcept { return fit.law(); }
};

// A candidate's force, in scaled units, once the branches have been advanced to the sample.
template <class Times>
[[gnu::noinline]] double force_of(const Fitted& fit, const Branches<Times>& branches,
                                  const Sample& s) noexcept {
  if (!(s.penetration > 0.0)) return fit.value[offset];
  const double power = std::exp(fit.n * std::log(s.penetration));
  const bool half_space = fit.law().damping == Damping::half_space;
  const double damped = half_space ? power / s.penetration : power;
  const double force =
      fit.value[offset] + fit.value[stiffness] * power + fit.value[damping] * s.velocity * damped;
  if (fit.value[memory] == 0.0) return force;
  const Window around = window(Grid::place_of_exponent(fit.n), Grid::exponents);
  const auto spectrum = spectrum_of<Times>(fit.law().memory, fit.second());
  Vector<window_points> mean{};
  for (std::size_t i = spectrum.first; i < spectrum.end; ++i) {
    const double* states = branches.states()[i].data() + around.first;
    for (std::size_t k = 0; k < window_points; ++k) mean[k] += spectrum.weight[i] * states[k];
  }
  return force + fit.value[memory] * detail::dot(around.weights, mean);
}

// As if the sample came `dt` after the last one.
template <class Times>
[[gnu::noinline]] double force_after(const Fitted& fit, const Branches<Times>& branches,
                                     const Sample& s, double dt) noexcept {
  Branches<Times> then = branches;
  then.advance(s.penetration > 0.0 ? s.penetration : 0.0, dt);
  return force_of(fit, then, s);
}

// What error bars of a spectrum's law owe to where its ends were assumed. A motion does not tell
// where a spectrum ends: what relaxes sooner than its shortest time is a damper, and later than its
// longest a spring. So K, B and M go together along the direction that leaves K′ and B′ at the
// motion's depth and frequency where they are,
//
//   dM = −ε M,  dK = ε M Σ w (ωτ)²/(1 + (ωτ)²),  dB xᵖ = ε M n xⁿ⁻¹ Σ w τ/(1 + (ωτ)²)
//
// and n, with what keeps n xⁿ⁻¹ K, n xⁿ⁻¹ M and B xᵖ there, by δ M/(K + M). Without noise, with
// ends up to fifteen times from those of the bank and M/K from a half to two, ε was 0.006 to 0.035
// and δ 0.002 to 0.1, most of them below 0.03.
inline constexpr double assumed_ends = 0.04;
inline constexpr double assumed_ends_exponent = 0.03;

// Adds to the covariance of the law's numbers in SI; nothing where the law has no spectrum. Of a
// motion that is not known, as where its samples were forgotten and the answer stands, depth and
// frequency are those of the units.
template <class Times, class Motion, std::size_t Size>
void add_assumed_ends(Matrix<Size>& joint, const Solution& s, const GeneralisedHuntCrossley& law,
                      const Times& times, const Motion& motion, const Units& u) noexcept {
  const Memory memory = s.law().memory;
  const bool spectrum = memory == Memory::flat || memory == Memory::power_law;
  if (!spectrum) return;
  const bool known = motion.depth > 0.0 && motion.frequency_squared > 0.0;
  const double omega =
      (known ? std::sqrt(motion.frequency_squared) : 1.0) * u.velocity * u.per_penetration;
  const double depth = (known ? motion.depth : 1.0) * u.penetration, log_depth = std::log(depth);
  const Spectrum<Times::count> weights = spectrum_of<Times>(memory, s.fit.second());
  double kept = 0.0, lost = 0.0, tau = times.time(0.0);
  for (std::size_t i = 0; i < Times::count; ++i, tau *= Times::ratio) {
    const double turn = omega * tau, per = weights.weight[i] / (1.0 + turn * turn);
    kept += per * turn * turn;
    lost += per * tau;
  }
  const double n = law.exponent, change = assumed_ends * law.relaxation_stiffness;
  // n xⁿ⁻¹ over xᵖ.
  const double slope = n * detail::bounded_exp((n - 1.0 - law.damping_exponent) * log_depth);
  const double damped = s.law().damping == Damping::none ? 0.0 : 1.0;
  const double whole = std::abs(law.stiffness) + law.relaxation_stiffness;
  const bool given = s.given != 0 || s.law().linear;
  const double by_exponent =
      given || !(whole > 0.0) ? 0.0 : assumed_ends_exponent * law.relaxation_stiffness / whole;
  const double growth = -by_exponent * (1.0 / n + log_depth);
  const std::array<std::array<double, 5>, 2> moved{
      {{change * kept, 0.0, damped * change * slope * lost, 0.0, -change},
       {growth * law.stiffness, by_exponent, -by_exponent * log_depth * law.damping, by_exponent,
        growth * law.relaxation_stiffness}}};
  for (const auto& part : moved) {
    for (std::size_t i = 0; i < part.size(); ++i) {
      for (std::size_t j = 0; j < part.size(); ++j) {
        joint[i][j] += detail::saturate(part[i]) * detail::saturate(part[j]);
      }
    }
  }
}

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
  Matrix<unknowns> lower{};
  for (std::size_t i = 0; i < unknowns; ++i) {
    for (std::size_t j = 0; j <= i; ++j) lower[i][j] = s.covariance[in_triangle(i, j)];
  }
  const Matrix<unknowns> root = detail::cholesky(lower);
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
  joint = detail::squared(rows);
  add_assumed_ends(joint, s, law, times, motion, u);
  detail::bound_variances(joint, detail::largest_variance);
  return joint;
}

}  // namespace palpate::viscoelastic
