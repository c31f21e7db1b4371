// The correlation of errors with their own past, as an autoregression of fourth order: what is left
// once it is taken out is white (Levinson 1947).
//
//   ẽ = e − Σ aᵢ e₋ᵢ,   φ̃ = φ − Σ aᵢ φ₋ᵢ,   i = 1 … 4
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"

namespace palpate::detail {

// An error and what it is compared with.
struct Regressed {
  double error;
  Vector<2> regressor;
};

class Autoregression {
 public:
  // Four follow noise of AR(1) up to 0.98 and of low-passes of second order: with them none of
  // these alarms (docs/accuracy/alarms.md).
  static constexpr std::size_t order = 4;

  // Takes the next error; gives it and its regressor white, as far as is known by now.
  Regressed whiten(const Regressed& now) noexcept {
    Regressed white = now;
    // An error beyond five deviations is an outlier or a change, and says nothing of correlation.
    const double bounded = std::clamp(now.error, -most_, most_);
    Vector<order + 1> products{bounded * bounded};
    for (std::size_t i = 0; i < order; ++i) {
      products[i + 1] = bounded * bounded_[(count_ - 1 - i) % past_.size()];
    }
    for (std::size_t i = 0; i < used_; ++i) {
      const Regressed& past = past_[(count_ - 1 - i) % past_.size()];
      white.error -= coefficients_[i] * past.error;
      white.regressor[0] -= coefficients_[i] * past.regressor[0];
      white.regressor[1] -= coefficients_[i] * past.regressor[1];
    }
    past_[count_ % past_.size()] = now;
    bounded_[count_ % past_.size()] = bounded;
    ++count_;
    if (++following_ > order) learn(products);
    return white;
  }

  // The next error does not follow the last one: of the first ones the past is unknown.
  void interrupt() noexcept { following_ = 0; }
  bool knows_past() const noexcept { return following_ > order; }

  // Forgets what it has learned, but not the coefficients, until new ones come.
  void relearn() noexcept {
    learned_ = 0;
    covariances_ = {};
    sums_ = {};
  }

 private:
  // New coefficients come with so many errors, which is a tenth of what they would cost with each.
  static constexpr std::uint64_t block = 64;
  // Blocks that count: eighty correlation lengths of AR(1) 0.98.
  static constexpr double memory = 62.0;

  // White noise gives reflections of 1/√4000: below three of those they are none, and cost nothing.
  static constexpr double chance = 0.047;

  void learn(const Vector<order + 1>& products) noexcept {
    for (std::size_t i = 0; i <= order; ++i) sums_[i] += products[i];
    if (++learned_ % block == 0) solve();
  }

  // Levinson's recursion; a millionth of white noise keeps it stable for a signal without any.
  void solve() noexcept {
    const double gain = 1.0 / std::min(static_cast<double>(learned_ / block), memory);
    for (std::size_t i = 0; i <= order; ++i) {
      covariances_[i] += gain * (sums_[i] / static_cast<double>(block) - covariances_[i]);
    }
    sums_ = {};
    const double power = covariances_[0] * (1.0 + 1e-6);
    if (!(power > 0.0)) return;
    most_ = 5.0 * std::sqrt(covariances_[0]);
    Vector<order> a{};
    std::size_t known = 0;
    double error = power;
    for (std::size_t m = 0; m < order; ++m) {
      double reflection = covariances_[m + 1];
      for (std::size_t i = 0; i < m; ++i) reflection -= a[i] * covariances_[m - i];
      reflection /= error;
      // Autocovariances that are averaged with forgetting need not be those of any signal.
      if (!(std::abs(reflection) < 1.0)) break;
      Vector<order> next = a;
      next[m] = reflection;
      for (std::size_t i = 0; i < m; ++i) next[i] = a[i] - reflection * a[m - 1 - i];
      a = next;
      error *= 1.0 - reflection * reflection;
      if (std::abs(reflection) > chance) known = m + 1;
      if (known == m + 1) coefficients_ = a;
    }
    used_ = known;
  }

  std::array<Regressed, 8> past_{};  // a power of two, above the order
  Vector<8> bounded_{};              // their errors
  Vector<order> coefficients_{};     // of which so many are used
  std::size_t used_ = 0;
  Vector<order + 1> covariances_{};
  Vector<order + 1> sums_{};   // of the products of this block
  double most_ = 1e150;        // that an error counts; its square is finite
  std::uint64_t count_ = 0;    // errors taken
  std::uint64_t learned_ = 0;  // of them, since the last beginning
  std::size_t following_ = 0;  // since the last interruption
};

}  // namespace palpate::detail
