// The parts of ChangeDetector: the evidence of a change in prediction errors, the correlation of
// one-step prediction errors, the probe's earlier depths and speeds, and two tests for a growth of
// the errors.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"

namespace palpate::detail {

// F̂, F̂ v and F̂ x, the regressors for changes of stiffness, damping and exponent, and the error
// of the force.
using Regressed = Vector<4>;
constexpr std::size_t error_at = 3;

// The evidence that a change of the law explains N errors, from their sums of squares and products:
//
//   L = (N − p) ln(1 + (E − R) / max(R, (N − p) σ²)),   E = Σ e²,   R = min over θ of Σ (e − φᵀθ)²
//
// Without a change L is about χ² with the p degrees of freedom of θ, for p = 2 exactly, however
// large the noise is, because R grows with E.
class Evidence {
 public:
  void add(const Regressed& z) noexcept {
    std::size_t k = 0;
    for (std::size_t i = 0; i < z.size(); ++i) {
      for (std::size_t j = i; j < z.size(); ++j) sums_[k++] += z[i] * z[j];
    }
    count_ += 1.0;
  }

  void add(const Evidence& other) noexcept {
    for (std::size_t k = 0; k < sums_.size(); ++k) sums_[k] += other.sums_[k];
    count_ += other.count_;
  }

  // L for the first `moved` regressors; 0 if N ≤ p.
  double of_change(double variance, std::size_t moved = error_at) const noexcept {
    Vector<10> s = sums_;
    double spare = count_;
    // Elimination leaves R. A regressor collinear with those before it is skipped.
    for (std::size_t i = 0, at = 0; i < moved; at += z_size - i, ++i) {
      const double pivot = s[at];
      if (!(pivot > 1e-9 * sums_[at])) continue;
      spare -= 1.0;
      for (std::size_t r = 1, to = at + z_size - i; r < z_size - i; ++r) {
        const double ratio = s[at + r] / pivot;
        for (std::size_t c = r; c < z_size - i; ++c) s[to++] -= ratio * s[at + c];
      }
    }
    const double left = std::max(s[9], spare * variance);
    const double ratio = (sums_[9] - s[9]) / left;
    // This comparison is false for NaN.
    return spare > 0.0 && ratio > 0.0 ? spare * std::log(1.0 + std::min(ratio, 1e12)) : 0.0;
  }

 private:
  static constexpr std::size_t z_size = 4;
  Vector<10> sums_{};  // of zᵢ zⱼ, i ≤ j, row by row
  double count_ = 0.0;
};

// The correlation of errors with their own past, as an autoregression of fourth order whose
// residual is white (Levinson 1947).
//
//   ẽ = e − Σ aᵢ e₋ᵢ,   φ̃ = φ − Σ aᵢ φ₋ᵢ,   i = 1 … 4
class Autoregression {
 public:
  // Order four models noise of AR(1) up to 0.98 and of second-order low-pass filters: none of these
  // causes alarms (docs/validation/accuracy/alarms.md).
  static constexpr std::size_t order = 4;

  // The number of stored errors: a power of two, so that a remainder is a mask.
  static constexpr std::size_t memory = 256;

  // Adds the next error; returns it and its regressors, whitened with the present coefficients.
  Regressed whiten(const Regressed& now) noexcept {
    Regressed white = now;
    // An error beyond five standard deviations is an outlier or a change, not correlation.
    const double bounded = std::clamp(now[error_at], -most_, most_);
    Vector<order + 1> products{bounded * bounded};
    for (std::size_t i = 0; i < order; ++i) {
      products[i + 1] = bounded * bounded_[(count_ - 1 - i) % bounded_.size()];
    }
    for (std::size_t i = 0; i < used_; ++i) {
      const Regressed& before = past(i, count_);
      for (std::size_t j = 0; j < white.size(); ++j) white[j] -= coefficients_[i] * before[j];
    }
    past_[count_ % memory] = now;
    bounded_[count_ % bounded_.size()] = bounded;
    ++count_;
    if (++following_ > order) learn(products);
    return white;
  }

  // A past error with its regressors: age 0 is the latest.
  const Regressed& past(std::size_t age) const noexcept { return past(age, count_); }

  // L for a change of stiffness and damping `samples` ago, at most memory − order. The change had
  // no effect on earlier errors, so whitening uses only the regressors since then.
  double of_change(std::size_t samples, double variance, bool whitened) const noexcept {
    Evidence evidence;
    for (std::size_t age = samples; age-- > 0;) {
      Regressed white = past(age);
      for (std::size_t i = 0; whitened && i < used_; ++i) {
        const Regressed& before = past(age + 1 + i);
        white[error_at] -= coefficients_[i] * before[error_at];
        if (age + 1 + i >= samples) continue;
        for (std::size_t j = 0; j < error_at; ++j) white[j] -= coefficients_[i] * before[j];
      }
      evidence.add(white);
    }
    return evidence.of_change(variance, 2);
  }

  // Whether a restored state is within its arrays.
  bool sound() const noexcept { return used_ <= order; }

  // The next error does not continue the last one: the errors before it are unknown.
  void interrupt() noexcept { following_ = 0; }
  bool knows_past() const noexcept { return following_ > order; }

  // Forgets the learned covariances, but keeps the coefficients until there are new ones.
  void relearn() noexcept {
    learned_ = 0;
    covariances_ = {};
    sums_ = {};
  }

 private:
  // Errors between updates of the coefficients. An update at each error would cost a tenth of the
  // estimator's update.
  static constexpr std::uint64_t block = 64;
  // The number of blocks in the running average: eighty correlation lengths of AR(1) 0.98.
  static constexpr double blocks = 62.0;

  // Reflection coefficients of white noise scatter by 1/√4000; below three times that they count as
  // 0, which costs nothing.
  static constexpr double chance = 0.047;

  const Regressed& past(std::size_t age, std::uint64_t count) const noexcept {
    return past_[(count - 1 - age) % memory];
  }

  void learn(const Vector<order + 1>& products) noexcept {
    for (std::size_t i = 0; i <= order; ++i) sums_[i] += products[i];
    if (++learned_ % block == 0) solve();
  }

  // Levinson's recursion. An addition of a hundredth of white noise keeps it stable, and keeps
  // noise as slow as the motion from being whitened away: the errors of the estimate itself would
  // remain.
  void solve() noexcept {
    const double gain = 1.0 / std::min(static_cast<double>(learned_ / block), blocks);
    for (std::size_t i = 0; i <= order; ++i) {
      covariances_[i] += gain * (sums_[i] / static_cast<double>(block) - covariances_[i]);
    }
    sums_ = {};
    const double power = covariances_[0] * (1.0 + 1e-2);
    if (!(power > 0.0)) return;
    most_ = 5.0 * std::sqrt(covariances_[0]);
    Vector<order> a{};
    std::size_t known = 0;
    double error = power;
    for (std::size_t m = 0; m < order; ++m) {
      double reflection = covariances_[m + 1];
      for (std::size_t i = 0; i < m; ++i) reflection -= a[i] * covariances_[m - i];
      reflection /= error;
      // Autocovariances averaged with forgetting need not belong to any signal.
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

  std::array<Regressed, memory> past_{};
  Vector<8> bounded_{};           // the latest errors; a power of two, above the order
  Vector<order> coefficients_{};  // the first used_ ones apply
  std::size_t used_ = 0;
  Vector<order + 1> covariances_{};
  Vector<order + 1> sums_{};   // of the products in this block
  double most_ = 1e150;        // limit of an error; its square is finite
  std::uint64_t count_ = 0;    // errors taken
  std::uint64_t learned_ = 0;  // errors since the last relearn
  std::size_t following_ = 0;  // errors since the last interruption
};

// A cumulative sum of squared errors over their variance (Page 1954), which alarms only above its
// earlier peaks:
//
//   z = min(e²/s², 25);  g ← max(0, g + z − drift);  alarm at g > threshold and g > 3 × its peaks
//
// s² follows the clipped e² slowly.
class CumulativeSum {
 public:
  // Initial value and lower limit of s².
  void set_variance(double variance, double least) noexcept {
    variance_ = std::max(variance, least);
    least_ = least;
    per_variance_ = 1.0 / variance_;
  }
  double variance() const noexcept { return variance_; }

  // Moves s² towards a squared error by the fraction `gain`, without a test.
  void learn(double square, double gain) noexcept { follow(square * per_variance_, gain); }

  // Moves s² and adds to the sum; true above the threshold and above three times its peaks. A
  // suppressed alarm counts as a peak instead.
  bool add(double square, double gain, double drift, double threshold, bool withheld) noexcept {
    const double ratio = square * per_variance_;
    follow(ratio, gain);
    // z above 25 is an outlier; three of them reach 60.
    sum_ = std::max(0.0, sum_ + std::min(ratio, 25.0) - drift);
    if (zero()) {
      highest_ = std::max(highest_, peak_);
      peak_ = 0.0;
    }
    peak_ = std::max(peak_, sum_);
    if (withheld) highest_ = std::max(highest_, sum_);
    return sum_ > threshold && sum_ > 3.0 * highest_;
  }
  bool zero() const noexcept { return sum_ == 0.0; }

  // After an alarm.
  void restart() noexcept { sum_ = peak_ = 0.0; }

 private:
  // e² is clipped at three standard deviations, which keeps 99.7 % of white noise and little of a
  // change. One update in eight errors is enough for a variance, and saves a division.
  void follow(double ratio, double gain) noexcept {
    growth_ += gain * (std::min(ratio, 9.0) - 1.0);
    if (++followed_ % 8 != 0) return;
    // With a gain near one, eight errors would make it negative.
    set_variance(variance_ * std::max(1.0 + growth_, 0.1), least_);
    growth_ = 0.0;
  }

  double variance_ = 0.0;
  double least_ = 0.0;
  double per_variance_ = 0.0;
  double growth_ = 0.0;         // relative change of the variance, to be applied
  std::uint32_t followed_ = 0;  // errors
  double sum_ = 0.0;
  double peak_ = 0.0;     // of the sum since it was last zero
  double highest_ = 0.0;  // of the peaks without alarm
};

// The depths and speeds of earlier strokes. A wrong law fits only the depths and speeds that it was
// learned from, so an error at new ones does not indicate a change: a recording that presses, rests
// and withdraws is never twice at one depth and speed.
class KnownGround {
 public:
  // Adds the next depth, > 0, and velocity; true if an earlier stroke had both, or if this stroke
  // has rested there.
  bool visit(double depth, double velocity) noexcept {
    const double speed = std::abs(velocity);
    const bool back = inward_ ? depth<(1.0 - turn) * furthest_ : depth>(1.0 + turn) * furthest_;
    if (back) end_stroke(depth);
    const bool further =
        inward_ ? depth > (1.0 + step) * furthest_ : depth < (1.0 - step) * furthest_;
    if (further) {
      furthest_ = depth;
      fastest_there_ = fastest_now_;
      stay_ = {depth, depth, 0};
      rested_ = 0;
    }
    fastest_now_ = std::max(fastest_now_, speed);
    const std::size_t kind = kind_of(velocity);
    const std::uint64_t cell = cell_of(depth);
    current_[kind] |= cell;
    stay_ = {std::min(stay_.least, depth), std::max(stay_.most, depth), stay_.kinds | 1u << kind};
    if (++rested_ == rest) end_rest(depth);
    const bool stayed =
        depth >= known_stay_.least && depth <= known_stay_.most && known_stay_.kinds >> kind & 1u;
    return (stayed || (earlier_[kind] & cell) != 0) && speed <= 2.0 * fastest_;
  }

  // Forgets all strokes, because another law is learned.
  void forget() noexcept {
    earlier_ = {};
    current_ = {};
    known_stay_ = {};
  }

 private:
  // A stroke ends when the depth decreases by this fraction, …
  static constexpr double turn = 0.05;
  // … and rests when it has not advanced by this fraction …
  static constexpr double step = 0.01;
  // … for this many samples.
  static constexpr std::uint32_t rest = 1000;

  // Kinds of speed: outward and inward (0, 1), slowly outward and inward (2, 3; below a quarter of
  // the fastest), and at rest (below a sixteenth).
  static constexpr std::size_t resting = 4;
  using Cells = std::array<std::uint64_t, 5>;

  std::size_t kind_of(double velocity) const noexcept {
    const double speed = std::abs(velocity);
    if (speed < 0.0625 * fastest_now_) return resting;
    return (velocity > 0.0 ? 1u : 0u) + (speed < 0.25 * fastest_now_ ? 2u : 0u);
  }

  // Eight cells per octave of depth, repeating after eight octaves. The top bits of a double are
  // its exponent and, within an octave, its mantissa.
  static std::uint64_t cell_of(double depth) noexcept {
    const std::uint64_t bits = std::bit_cast<std::uint64_t>(depth);
    return std::uint64_t{1} << ((bits >> 49) & 63);
  }

  // A reversal is detected late: the cells since then belong to the new stroke.
  void end_stroke(double depth) noexcept {
    const std::size_t way = inward_ ? 1 : 0;
    for (const std::size_t kind : {resting, way, way + 2}) {
      earlier_[kind] |= current_[kind];
      current_[kind] = 0;
    }
    stay_ = {depth, depth, 0};
    known_stay_ = {};
    inward_ = !inward_;
    fastest_ = fastest_there_;
    furthest_ = depth;
    rested_ = 0;
  }

  // A cell is wide compared with the motion of a resting probe, so a rest stores its exact depths.
  void end_rest(double depth) noexcept {
    known_stay_ = {std::min(known_stay_.least, stay_.least), std::max(known_stay_.most, stay_.most),
                   known_stay_.kinds | stay_.kinds};
    stay_ = {depth, depth, 0};
    fastest_ = fastest_now_;
    rested_ = 0;
  }

  // The depths of a resting stroke, and the kinds of speed at those depths.
  struct Stay {
    double least = 1e300;
    double most = 0.0;
    unsigned kinds = 0;
  };

  Cells earlier_{};             // cells of earlier strokes
  Cells current_{};             // cells of this stroke
  Stay stay_{};                 // since this stroke last advanced or rested
  Stay known_stay_{};           // of earlier rests in this stroke
  double fastest_ = 0.0;        // |velocity| of earlier strokes
  double fastest_there_ = 0.0;  // largest |velocity| until this stroke was furthest
  double fastest_now_ = 0.0;    // largest |velocity| so far
  double furthest_ = 0.0;       // the furthest depth of this stroke
  std::uint32_t rested_ = 0;    // samples since it advanced
  bool inward_ = true;
};

// Finds changes too small to show in single errors: the score L of blocks of 32, 64 … 2048 white
// errors.
class ScoreBlocks {
 public:
  // The cumulative sum finds changes that show in fewer samples than this.
  static constexpr std::size_t shortest = 32;
  static constexpr std::size_t levels = 7;  // the longest block: 2048

  // Adds a whitened error with its regressors, and σ². Returns the length of a block whose score
  // exceeds the limit; otherwise 0.
  std::size_t add(Regressed white, double variance, bool withheld) noexcept {
    // An outlier counts as an error of four standard deviations.
    const double most = 16.0 * variance;
    double& error = white[error_at];
    if (error * error > most) error = std::copysign(std::sqrt(most), error);
    // The errors are added per block: one by one the sums would be loaded and stored each time.
    block_[samples_ % shortest] = white;
    if (++samples_ % shortest != 0) return 0;
    return close(variance, withheld);
  }

  // The factor on a score of few samples if errors remain correlated, ≥ 1.
  double inflation() const noexcept {
    const Level& first = levels_[0];
    return std::max(1.0, first.sum / (expected * std::max<double>(fewest, first.blocks)));
  }

  // Starts new blocks; the scores of earlier ones are kept.
  void restart() noexcept {
    samples_ = 0;
    for (Level& level : levels_) level.waiting = false;
  }

 private:
  // White noise exceeds 43 in a fraction 2e-9 of the blocks: once in 600 h.
  static constexpr double threshold = 43.0;
  static constexpr double expected = 3.0;  // mean score without a change
  // Errors that are not quite white, or errors of a wrong law, have had large scores before.
  static constexpr double over_largest = 3.0;
  static constexpr std::uint32_t fewest = 8;  // blocks that a length needs for its limit
  static constexpr double unknown = 1e300;

  struct Level {
    Evidence half{};       // the first of the two blocks that make the next longer one
    double sum = 0.0;      // of the scores of its blocks
    double largest = 0.0;  // largest score, with slow forgetting
    // The limit for the next score, from earlier blocks alone: a change raises the scores of
    // shorter blocks first, which must not hide it in the longer block that contains them.
    double limit = unknown;
    std::uint32_t blocks = 0;
    bool waiting = false;
  };

  std::size_t close(double variance, bool withheld) noexcept {
    Evidence block;
    for (const Regressed& white : block_) block.add(white);
    std::size_t found = 0;
    for (std::size_t i = 0; i < levels; ++i) {
      Level& level = levels_[i];
      const double score = block.of_change(variance);
      if (!withheld && score > level.limit) {
        found = shortest << i;
      } else {
        ++level.blocks;
        level.sum += score;
        level.largest = std::max(level.largest * (1.0 - 1.0 / 512.0), score);
      }
      level.limit = limit(i);
      level.waiting = !level.waiting;
      if (level.waiting) {
        level.half = block;
        return found;
      }
      block.add(level.half);
    }
    return found;
  }

  // A length with fewer than eight blocks uses the limit of the next shorter one if that has eight;
  // otherwise it has no limit yet.
  double limit(std::size_t index) const noexcept {
    double mean = expected, largest = 0.0;
    for (std::size_t down = 0; down <= std::min<std::size_t>(index, 1); ++down) {
      const Level& level = levels_[index - down];
      largest = std::max(largest, level.largest);
      if (level.blocks < fewest) continue;
      mean = std::max(mean, level.sum / static_cast<double>(level.blocks));
      return std::max(threshold * mean / expected, over_largest * largest);
    }
    return unknown;
  }

  std::array<Regressed, shortest> block_{};
  std::uint64_t samples_ = 0;
  std::array<Level, levels> levels_{};
};

}  // namespace palpate::detail
