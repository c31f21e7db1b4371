// Where the minimum of each candidate was found last.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/problem.hpp"
#include "palpate/viscoelastic/samples.hpp"

namespace palpate::viscoelastic {

template <class Sums>
class Answers {
 public:
  static constexpr std::size_t count = Sums::full ? candidates.size() : everyday_candidates;

  Answers(Offered offered, double exponent) noexcept
      : offered_(offered), exponent_known_(exponent > 0.0) {}

  void offer(Offered offered) noexcept { offered_ = offered; }

  // A law of five numbers and more fits any hundred samples.
  bool competes(std::size_t candidate, double weight) const noexcept {
    if (((offered_ >> candidate) & 1U) == 0) return false;
    // Where n is known, that it is 1 is no law of its own.
    if (candidates[candidate].linear && exponent_known_) return false;
    if ((offered_ & forgetful) == 0 || weight >= 100.0) return true;
    return candidates[candidate].memory == Memory::none;
  }

  void keep(std::size_t candidate, const Place& place, double stiffness) noexcept {
    places_[candidate] = place;
    stiffness_[candidate] = std::max(stiffness, 0.0);
    found_ = static_cast<Offered>(found_ | (1U << candidate));
  }

  bool found(std::size_t candidate) const noexcept { return ((found_ >> candidate) & 1U) != 0; }
  const Place& place(std::size_t candidate) const noexcept { return places_[candidate]; }

  Problem<Sums> problem(const Samples<Sums>& samples, std::size_t candidate,
                        const Priors& priors) const noexcept {
    return {samples, candidates[candidate], priors, stiffness_[candidate]};
  }

  // By the samples of now.
  Point fitted(const Samples<Sums>& samples, std::size_t candidate,
               const Priors& priors) const noexcept {
    return problem(samples, candidate, priors).at(places_[candidate]);
  }

 private:
  std::array<Place, count> places_{};
  std::array<double, count> stiffness_{};  // k there, by which the prior of its damping weighs
  Offered offered_;
  Offered found_ = 0;
  bool exponent_known_;
};

}  // namespace palpate::viscoelastic
