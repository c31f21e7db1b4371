// The correlation of a signal with its own past, as an autoregression of fourth order: what is left
// once it is taken out is white (Levinson 1947).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"

namespace palpate::detail {

class Autoregression {
 public:
  // Four follow noise of AR(1) up to 0.98 and of low-passes of second order: with them these alarm
  // once in 9 h (docs/accuracy/alarms.md).
  static constexpr std::size_t order = 4;

  // Learns the autocovariances of a signal; new coefficients every 64 values, which is a tenth of
  // what it would cost at each.
  void learn(double value) noexcept {
    // A value beyond five deviations is an outlier or a change, and says nothing of correlation.
    const double most = 25.0 * covariances_[0];
    const bool beyond = learned_ > 0 && value * value > most;
    const double bounded = beyond ? std::copysign(std::sqrt(most), value) : value;
    following_ = std::min(following_ + 1, order + 1);
    if (knows_past()) {
      ++learned_;
      const auto count = static_cast<double>(learned_);
      const double gain = count < memory ? 1.0 / count : 1.0 / memory;
      covariances_[0] += gain * (bounded * bounded - covariances_[0]);
      for (std::size_t i = 0; i < order; ++i) {
        covariances_[i + 1] += gain * (bounded * past_[i] - covariances_[i + 1]);
      }
      constexpr std::uint64_t fewest = 64;
      if (learned_ % fewest == 0) solve();
    }
    for (std::size_t i = order; i-- > 1;) past_[i] = past_[i - 1];
    past_[0] = bounded;
  }

  // The next value does not follow the last one: of the first ones the past is unknown.
  void interrupt() noexcept { following_ = 0; }
  bool knows_past() const noexcept { return following_ > order; }

  // Forgets what it has learned, but not the coefficients, until new ones come.
  void relearn() noexcept {
    learned_ = 0;
    covariances_ = {};
  }

  const Vector<order>& coefficients() const noexcept { return coefficients_; }

 private:
  // Values that count: eighty correlation lengths of AR(1) 0.98.
  static constexpr double memory = 4000.0;

  // Levinson's recursion; a millionth of white noise keeps it stable for a signal without any.
  void solve() noexcept {
    const double power = covariances_[0] * (1.0 + 1e-6);
    if (!(power > 0.0)) return;
    Vector<order> a{};
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
    }
    coefficients_ = a;
  }

  Vector<order> coefficients_{};
  Vector<order> past_{};
  Vector<order + 1> covariances_{};
  std::uint64_t learned_ = 0;
  std::size_t following_ = 0;  // values since the last interruption
};

}  // namespace palpate::detail
