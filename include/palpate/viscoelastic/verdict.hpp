// Which law it is, of candidates that are fitted to the same samples:
//
//   score = N_eff ln(RSS/N) + 2 p ln N_eff
//
// The least wins: Schwarz's criterion with twice the penalty, and as many samples as noise of the
// residual's correlation leaves (docs/viscoelastic.md).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "palpate/viscoelastic/law.hpp"

namespace palpate::viscoelastic {

// How one candidate stood at the last verdict.
struct Standing {
  double score;  // of the criterion, less N_eff ln of the least RSS/N; 0 for what did not compete
  double mean_square;  // RSS/N, in units of force squared; 0 for what did not compete
};

template <std::size_t Count>
class Verdict {
 public:
  void clear() noexcept { mean_square_ = {}; }
  void enter(std::size_t candidate, double mean_square) noexcept {
    mean_square_[candidate] = mean_square;
  }
  void count_samples(double effective) noexcept { effective_ = effective; }

  double effective_samples() const noexcept { return effective_; }
  double mean_square(std::size_t candidate) const noexcept { return mean_square_[candidate]; }

  // The candidate that leaves least, and that of the least score; `Count` where none competes.
  std::size_t closest() const noexcept {
    return least([this](std::size_t i) noexcept { return mean_square_[i]; });
  }
  std::size_t chosen() const noexcept {
    const std::size_t by = closest();
    return least([this, by](std::size_t i) noexcept { return score(i, by); });
  }

  Standing standing(std::size_t candidate) const noexcept {
    if (!competes(candidate)) return {0.0, 0.0};
    return {score(candidate, closest()), mean_square_[candidate]};
  }

 private:
  bool competes(std::size_t candidate) const noexcept { return mean_square_[candidate] > 0.0; }

  double score(std::size_t candidate, std::size_t by) const noexcept {
    return effective_ * std::log(mean_square_[candidate] / mean_square_[by]) +
           2.0 * candidates[candidate].parameters() * std::log(effective_);
  }

  template <class Of>
  std::size_t least(Of of) const noexcept {
    std::size_t result = Count;
    double smallest = 0.0;
    for (std::size_t i = 0; i < Count; ++i) {
      if (!competes(i)) continue;
      const double value = of(i);
      if (result != Count && !(value < smallest)) continue;
      result = i;
      smallest = value;
    }
    return result;
  }

  std::array<double, Count> mean_square_{};
  double effective_ = 0.0;
};

}  // namespace palpate::viscoelastic
