// What error bars of a spectrum's law owe to where its ends were assumed.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/force_laws.hpp"
#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"
#include "palpate/viscoelastic/samples.hpp"
#include "palpate/viscoelastic/solution.hpp"
#include "palpate/viscoelastic/spectrum.hpp"

namespace palpate::viscoelastic {

// A motion does not tell where a spectrum ends: what relaxes sooner than its shortest time is a
// damper, and later than its longest a spring. So K, B and M go together along the direction that
// leaves K′ and B′ at the motion's depth and frequency where they are,
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

}  // namespace palpate::viscoelastic
