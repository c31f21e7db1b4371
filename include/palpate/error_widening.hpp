// The slopes and residuals of a fit by time scale, from which online standard errors are computed.
//
// The difference of the sums of two successive blocks of b = 2ᵏ samples is a Haar coefficient.
// Over the pairs of blocks of each level k, of the slopes J and of the residuals e,
//
//   D_k = Σ (ΣJ − ΣJ′)(ΣJ − ΣJ′)ᵀ/2b,    d_k = mean (Σe − Σe′)²/2b.
//
// For any kind of noise the coefficients are nearly uncorrelated within and between levels (Wornell
// 1990), so the scores Σ J e have the covariance Σ d_k D_k.
//
// Standard errors must grow because the residual is not white, and because few blocks measure it:
// the covariance is C = I⁻¹ [Σ d_k D_k] I⁻¹ instead of σ² I⁻¹, with d_k ≥ σ², and standard errors
// are multiplied by t₀.₉₇₅(ν)/1.96.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"

namespace palpate::detail {

// Decaying sums would become subnormal numbers, on which arithmetic is slow.
template <class Number>
constexpr Number faded(double sum) noexcept {
  constexpr double smallest = sizeof(Number) < sizeof(double) ? 1e-30 : 1e-150;
  return sum < smallest && sum > -smallest ? Number{0} : static_cast<Number>(sum);
}

template <class Number, std::size_t Size>
constexpr void fade_out(std::array<std::array<Number, Size>, Size>& sums, double fade) noexcept {
  for (auto& row : sums) {
    for (Number& entry : row) entry = faded<Number>(double{entry} * fade);
  }
}

// `Number` is the stored type: with floats, |slope| < 1e10 and |residual| < 1e10 give finite sums.
template <std::size_t Size, class Number = double>
struct HaarLevel {
  std::array<std::array<Number, Size>, Size> information{};  // D_k, the upper triangle
  std::array<Number, Size> half{};                           // ΣJ of the first block of a pair …
  Number half_residual = 0;                                  // … and its Σe
  Number older = 0;  // Σ (Σe − Σe′)²/2b since the last renewal but one
  Number newer = 0;  // the same since the last renewal
  Number older_pairs = 0;
  Number newer_pairs = 0;

  double residual_variance() const noexcept {  // d_k
    return double{older} / double{older_pairs};
  }

  void keep(const Vector<Size>& sum, double error) noexcept {
    for (std::size_t i = 0; i < Size; ++i) half[i] = static_cast<Number>(sum[i]);
    half_residual = static_cast<Number>(error);
  }

  void take(const Vector<Size>& sum, double error, double per_pair, double fade) noexcept {
    if (fade != 1.0) forget(fade);
    Vector<Size> apart;
    for (std::size_t i = 0; i < Size; ++i) apart[i] = double{half[i]} - sum[i];
    for (std::size_t i = 0; i < Size; ++i) {
      const double scaled = apart[i] * per_pair;
      for (std::size_t j = i; j < Size; ++j) add(information[i][j], scaled * apart[j]);
    }
    const double errors_apart = double{half_residual} - error;
    const double square = errors_apart * errors_apart * per_pair;
    add(older, square);
    add(newer, square);
    older_pairs += 1;
    newer_pairs += 1;
  }

  void forget(double fade) noexcept {
    fade_out(information, fade);
    for (Number* sum : {&older, &newer, &older_pairs, &newer_pairs}) {
      *sum = faded<Number>(double{*sum} * fade);
    }
  }

  void scale_residuals(double factor, double weight) noexcept {
    half_residual = static_cast<Number>(double{half_residual} * factor);
    const double energy = weight * factor * factor;
    older = faded<Number>(double{older} * energy);
    newer = faded<Number>(double{newer} * energy);
    older_pairs = static_cast<Number>(double{older_pairs} * weight);
    newer_pairs = static_cast<Number>(double{newer_pairs} * weight);
  }

  void renew() noexcept {
    older = newer;
    older_pairs = newer_pairs;
    newer = newer_pairs = 0;
  }

 private:
  static void add(Number& sum, double term) noexcept {
    sum = static_cast<Number>(double{sum} + term);
  }
};

template <std::size_t Size, class Number = double>
class HaarLevels {
 public:
  // Blocks of up to 2¹⁹ samples, 9 min at 1 kHz; slower noise counts on that level.
  static constexpr std::size_t most = 20;

  // The products must be finite: |slope| < 1e20, |residual| ≤ 1e100. Amortised, each sample closes
  // one pair of blocks.
  void add(const Vector<Size>& slope, double residual, double forgetting_factor) noexcept {
    if (++samples_ == renewal_) renew();
    if (forgetting_factor == 1.0) used_ = most;
    Vector<Size> sum = slope;
    double error = residual, per_pair = 0.5, fade = forgetting_factor * forgetting_factor;
    for (std::size_t k = 0; k < most; ++k) {
      if (fade < least_fade) return end(sum, 2.0 * per_pair, k, fade);
      HaarLevel<Size, Number>& level = levels_[k];
      waiting_ ^= 1U << k;
      if (waiting(k)) return level.keep(sum, error);
      level.take(sum, error, per_pair, fade);
      for (std::size_t i = 0; i < Size; ++i) sum[i] += double{level.half[i]};
      error += double{level.half_residual};
      per_pair *= 0.5;
      fade *= fade;
    }
    end(sum, 2.0 * per_pair, most, fade);
  }

  void clear() noexcept { *this = HaarLevels(); }

  // The fit has not converged yet, however many samples there were: the residuals until 16 samples
  // from now do not measure the noise.
  void start_again() noexcept {
    samples_ = 0;
    renewal_ = first_renewal;
  }

  // Multiplies all residuals so far by a factor, and their weight by another.
  void scale_residuals(double factor, double weight) noexcept {
    for (HaarLevel<Size, Number>& level : levels_) level.scale_residuals(factor, weight);
  }

  // Variance about the mean of the residuals since the last renewal but one: the sum over all
  // levels.
  double residual_variance() const noexcept {
    double energy = 0.0;
    for (const HaarLevel<Size, Number>& level : levels_) energy += double{level.older};
    const double samples = 2.0 * double{levels_[0].older_pairs};
    return samples > 0.0 ? energy / samples : 0.0;
  }

  std::size_t used() const noexcept { return used_; }
  // Whether a restored state is within its arrays.
  bool sound() const noexcept { return used_ <= most; }
  const HaarLevel<Size, Number>& operator[](std::size_t k) const noexcept { return levels_[k]; }
  HaarLevel<Size, Number>& operator[](std::size_t k) noexcept { return levels_[k]; }

  // Whether the first block of this level waits for the second, and the function that sets this.
  bool waiting(std::size_t k) const noexcept { return ((waiting_ >> k) & 1U) != 0; }
  void wait(std::size_t k) noexcept { waiting_ |= 1U << k; }

  // Σ (ΣJ)(ΣJ)ᵀ/b over blocks without a partner: waiting blocks, and those of the last level.
  // Together with all D_k it makes Σ JJᵀ. Only the upper triangle is set.
  Matrix<Size> rest() const noexcept {
    Matrix<Size> result = rest_;
    double per_block = 1.0;
    for (std::size_t k = 0; k < used_; ++k, per_block *= 0.5) {
      if (waiting(k)) add_square(result, levels_[k].half, per_block);
    }
    return result;
  }

 private:
  // With forgetting, blocks are not longer than the memory: the levels end at the first whose pairs
  // would fade before they are complete.
  static constexpr double least_fade = 0.6;

  template <class Sum>
  static void add_square(Matrix<Size>& m, const Sum& sum, double per_block) noexcept {
    for (std::size_t i = 0; i < Size; ++i) {
      for (std::size_t j = i; j < Size; ++j) m[i][j] += per_block * double{sum[i]} * double{sum[j]};
    }
  }

  void end(const Vector<Size>& sum, double per_block, std::size_t level, double fade) noexcept {
    used_ = static_cast<std::uint32_t>(level);
    if (fade != 1.0) fade_out(rest_, fade);
    add_square(rest_, sum, per_block);
  }

  // Keeps only the later half of the residuals, and none of the first sixteen: the errors of a fit
  // that has not converged do not measure the noise.
  void renew() noexcept {
    for (HaarLevel<Size, Number>& level : levels_) {
      level.renew();
      if (renewal_ == first_renewal) level.renew();
      // Information that is never renewed must not grow without limit either; only ratios of it
      // matter.
      if (renewal_ > longest_renewal) fade_out(level.information, 0.5);
    }
    if (renewal_ > longest_renewal) fade_out(rest_, 0.5);
    renewal_ += std::min(renewal_, longest_renewal);
  }

  static constexpr std::uint64_t first_renewal = 16;
  // Floats cannot count above 2²⁴; 2²³ samples are 2 h at 1 kHz.
  static constexpr std::uint64_t longest_renewal = 1ULL << (sizeof(Number) < 8 ? 23 : 63);

  std::array<HaarLevel<Size, Number>, most> levels_{};
  Matrix<Size> rest_{};
  std::uint32_t used_ = most;
  std::uint32_t waiting_ = 0;  // one bit per level
  std::uint64_t samples_ = 0;
  std::uint64_t renewal_ = first_renewal;
};

// t₀.₉₇₅(ν)/1.96 after Cornish & Fisher, accurate to 1 % for ν ≥ 3. The approximation fails for ν
// below 2, where the noise still grows with the longest blocks; there the value at 2 is used.
inline double widened_quantile(double freedom) noexcept {
  const double r = 1.0 / std::max(freedom, 2.0);
  return 1.0 + r * (1.210365 + r * (1.440077 + r * 1.304029));
}

// The number of fitted parameters; whether the residuals come from a fit to all samples instead of
// one-step predictions from earlier samples; and the number of pairs of blocks that measure a
// level.
struct Fitted {
  double parameters;
  bool all_samples = false;
  double fewest_pairs = 8.0;  // eight measure a variance to 50 %
};

// d_k/σ² of each level relative to white noise, at least 1; last, that of blocks without a partner.
struct LevelNoise {
  // The upper limit: standard errors a million times those of white noise.
  static constexpr double largest = 1e12;
  static constexpr std::size_t most = HaarLevels<1>::most + 1;
  using Each = std::array<double, most>;

  // `white` is d_k/σ² of white noise: 1, unless the residuals are averages that share samples.
  template <std::size_t Size, class Number>
  LevelNoise(const HaarLevels<Size, Number>& levels, double variance, const Fitted& fitted,
             const Each* white = nullptr) noexcept
      : used(levels.used()) {
    for (; measured < used && double{levels[measured].older_pairs} >= fitted.fewest_pairs;
         ++measured) {
      const HaarLevel<Size, Number>& level = levels[measured];
      pairs[measured] = level.older_pairs;
      // A fit of p parameters to all samples absorbs p/2m of the residuals, a fit to earlier
      // samples only half as much. (For AR(1) 0.98 over 1 s the coverage is 94 %, without this
      // correction 92 %.)
      const double lost = (fitted.all_samples ? 0.5 : 0.25) * fitted.parameters / pairs[measured];
      ratio[measured] = level.residual_variance() * (1.0 + lost) / variance;
      if (white != nullptr) ratio[measured] /= (*white)[measured];
    }
    if (measured > 0) extrapolate();
    for (double& value : ratio) value = value > 1.0 ? std::min(value, largest) : 1.0;
  }

  // Noise that grew by g per level up to the last measured level K is extrapolated as that of an
  // Ornstein–Uhlenbeck process, d_j = d_K (1 + u)/(1 + u 4^(K−j)) with u = (g − 1)/(4 − g).
  // g = √(d_K/d_{K−2}) counts if it exceeds 1 by half its standard deviation.
  void extrapolate() noexcept {
    const std::size_t last = measured - 1;
    scatter = 2.0 / pairs[last];
    double u = 0.0;
    if (last >= 2 && ratio[last - 2] > 0.0) {
      const double growth = std::sqrt(ratio[last] / ratio[last - 2]);
      const double before = 2.0 / pairs[last - 2];
      if (growth > 1.0 + 0.5 * std::sqrt(scatter + before)) {
        // A random walk grows by 4 without limit; for 3.5 the limit is 6 times the measured value.
        const double bounded = std::min(growth, 3.5);
        u = (bounded - 1.0) / (4.0 - bounded);
        // The scatter propagates by ∂ln d_∞/∂ln g = g/(4 − g), to first order, for g up to 3.
        const double slope = 0.5 * std::min(growth, 3.0) / (4.0 - std::min(growth, 3.0));
        scatter = scatter * (1.0 + slope) * (1.0 + slope) + before * slope * slope;
      }
    }
    double still = 1.0;  // 4^(K−j)
    for (std::size_t j = measured; j < used; ++j) {
      still *= 0.25;
      ratio[j] = ratio[last] * (1.0 + u) / (1.0 + u * still);
    }
    if (measured <= used) ratio[used] = ratio[last] * (1.0 + u);
  }

  // Satterthwaite's degrees of freedom of Σ term(k), where term(k) = d_k yᵀ D_k y. Each measured
  // level has its own scatter, all extrapolated levels share one, and levels that count as σ² have
  // almost none.
  template <class Term>
  double degrees(const Term& term) const noexcept {
    double whole = 0.0, spread = 0.0, common = 0.0;
    for (std::size_t k = 0; k <= used; ++k) {
      const double part = term(k);
      whole += part;
      if (!(ratio[k] > 1.0)) continue;
      if (k + 1 < measured) {
        spread += part * part * 2.0 / pairs[k];
      } else {
        common += part;
      }
    }
    spread += common * common * scatter;
    return spread > 0.0 ? std::min(2.0 * whole * whole / spread, most_freedom) : most_freedom;
  }

  static constexpr double most_freedom = 1e6;

  Each ratio{};
  Each pairs{};
  std::size_t used;
  std::size_t measured = 0;
  double scatter = 0.0;  // relative variance of the last measured and the extrapolated levels
};

// If R Rᵀ is the covariance for white residuals, (R W)(R W)ᵀ is the reported one. `prior` is the
// weight of the priors relative to the samples, on the diagonal of the information; `variance` is
// σ²; `rows` are the rows of R for the reported parameters. The slopes in the levels may differ
// from those of the fit, but must depend on the motion in the same way.
template <std::size_t Size, std::size_t Rows, class Number = double>
class ErrorWidening {
 public:
  ErrorWidening(const HaarLevels<Size, Number>& levels, const Vector<Size>& prior, double variance,
                bool of_all_samples = false) noexcept
      : levels_(levels),
        rest_(levels.rest()),
        noise_(levels, variance, {static_cast<double>(Size), of_all_samples}),
        root_(inverse_root(prior)) {}

  // The lower triangle W, or the unit matrix while there are too few samples. `of_prior` is the
  // variance of the last parameter's prior relative to the variance that its weight assumes.
  [[gnu::noinline]] Matrix<Size> root(const std::array<Vector<Size>, Rows>& rows,
                                      double of_prior = 1.0) const noexcept {
    Matrix<Size> unit{};
    for (std::size_t i = 0; i < Size; ++i) unit[i][i] = 1.0;
    if (noise_.measured == 0) return unit;
    double freedom = LevelNoise::most_freedom;
    for (const Vector<Size>& row : rows) freedom = std::min(freedom, degrees(multiply(root_, row)));
    const Matrix<Size> widened = cholesky(whitened(widened_quantile(freedom), of_prior));
    for (std::size_t i = 0; i < Size; ++i) {
      if (!(widened[i][i] >= 0.5 && widened[i][i] <= LevelNoise::largest)) return unit;
    }
    return widened;
  }

 private:
  // Calls with the information of a level, or of the blocks without a partner after the last one.
  template <class Use>
  auto with_part(std::size_t k, const Use& use) const noexcept {
    return k < noise_.used ? use(levels_[k].information) : use(rest_);
  }

  // 1 + Rᵀ [Σ (q² d_k/σ² − 1) D_k + (f − 1) P] R, where R is the root in the slopes of the levels
  // and P the information of the last prior, whose variance is f times the one that its weight
  // assumes. The other priors are not affected.
  Matrix<Size> whitened(double quantile, double of_prior) const noexcept {
    Matrix<Size> excess{};
    excess[Size - 1][Size - 1] = (of_prior - 1.0) * last_prior_;
    for (std::size_t k = 0; k <= noise_.used; ++k) {
      const double factor = quantile * quantile * noise_.ratio[k] - 1.0;
      with_part(k, [&](const auto& part) noexcept { add(excess, part, factor); });
    }
    mirror(excess);
    Matrix<Size> transposed{};
    for (std::size_t i = 0; i < Size; ++i) {
      for (std::size_t j = 0; j < Size; ++j) transposed[i][j] = root_[j][i];
    }
    Matrix<Size> result = multiply(transposed, multiply(excess, root_));
    for (std::size_t i = 0; i < Size; ++i) result[i][i] += 1.0;
    return result;
  }

  double degrees(const Vector<Size>& y) const noexcept {
    return noise_.degrees([&](std::size_t k) {
      return noise_.ratio[k] *
             with_part(k, [&](const auto& part) noexcept { return quadratic(part, y); });
    });
  }

  // Scaled to a unit diagonal, so that nothing overflows. A pivot lost to rounding carries no
  // information from the samples and gets no noise.
  Matrix<Size> inverse_root(const Vector<Size>& prior) noexcept {
    Matrix<Size> m = rest_;
    for (std::size_t k = 0; k < noise_.used; ++k) add(m, levels_[k].information, 1.0);
    mirror(m);
    Vector<Size> unit{}, kept{};
    for (std::size_t i = 0; i < Size; ++i) {
      last_prior_ = prior[i] * m[i][i];
      m[i][i] += last_prior_;
      unit[i] = m[i][i] > 0.0 ? 1.0 / std::sqrt(m[i][i]) : 0.0;
      kept[i] = std::max(prior[i] / (1.0 + prior[i]), 1e-30);
    }
    for (std::size_t i = 0; i < Size; ++i) {
      for (std::size_t j = 0; j < Size; ++j) m[i][j] *= unit[i] * unit[j];
    }
    InverseRoot<Size> inverse = guarded_inverse_root(m, kept);
    for (std::size_t i = 0; i < Size; ++i) {
      for (std::size_t j = 0; j < Size; ++j) {
        inverse.root[i][j] *= inverse.guarded[j] ? 0.0 : unit[i];
      }
    }
    return inverse.root;
  }

  template <class Part>
  static void add(Matrix<Size>& sum, const Part& upper, double factor) noexcept {
    for (std::size_t i = 0; i < Size; ++i) {
      for (std::size_t j = i; j < Size; ++j) sum[i][j] += factor * double{upper[i][j]};
    }
  }

  static void mirror(Matrix<Size>& upper) noexcept {
    for (std::size_t i = 0; i < Size; ++i) {
      for (std::size_t j = 0; j < i; ++j) upper[i][j] = upper[j][i];
    }
  }

  template <class Part>
  static double quadratic(const Part& upper, const Vector<Size>& y) noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < Size; ++i) {
      double line = 0.5 * double{upper[i][i]} * y[i];
      for (std::size_t j = i + 1; j < Size; ++j) line += double{upper[i][j]} * y[j];
      sum += 2.0 * y[i] * line;
    }
    return sum;
  }

  const HaarLevels<Size, Number>& levels_;
  Matrix<Size> rest_;
  LevelNoise noise_;
  double last_prior_ = 0.0;  // information of the last parameter's prior
  Matrix<Size> root_;
};

}  // namespace palpate::detail
