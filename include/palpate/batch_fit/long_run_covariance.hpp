// The covariance of a least-squares fit from the scores and residuals of a whole recording.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "palpate/error_widening.hpp"

namespace palpate::detail {

// Fills Σ d_k D_k of scores (one row per sample, in the order of time) and the residual: the
// covariance of a least-squares fit whose influences are the scores, with Student's quantile.
// `shares` is the fraction of its window that a row shares with the next, the next but one …;
// `fitted` the number of fitted parameters.
inline void long_run_covariance(std::span<const double> scores, std::span<const double> residual,
                                std::span<const double> shares, double fitted,
                                std::span<double> result) {
  std::size_t count = residual.size();
  if (count == 0) {
    std::fill(result.begin(), result.end(), 0.0);
    return;
  }
  const std::size_t size = scores.size() / count, square = size * size;
  std::vector<double> sums(scores.begin(), scores.end());
  std::vector<double> errors(residual.begin(), residual.end());
  std::vector<double> parts(LevelNoise::most * square);
  const auto add = [&](std::size_t k, const double* a, const double* b, double per_pair) {
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) {
        parts[k * square + i * size + j] += (a[i] - b[i]) * (a[j] - b[j]) * per_pair;
      }
    }
  };
  double all = 1.0, energy = 0.0;
  for (const double share : shares) all += 2.0 * share;
  for (const double error : errors) energy += error * error;
  const double freedom = std::max(static_cast<double>(count) - all * fitted, 1.0);
  const double variance = std::max(energy / freedom, 1e-300);

  HaarLevels<1> levels;
  LevelNoise::Each white;
  white.fill(all);
  constexpr std::size_t rest = LevelNoise::most - 1;
  const std::vector<double> nothing(size);
  double length = 1.0;
  for (std::size_t k = 0; count > 0; ++k, length *= 2.0) {
    const std::size_t pairs = k < rest ? count / 2 : 0;
    for (std::size_t i = 2 * pairs; i < count; ++i) {
      add(rest, &sums[i * size], nothing.data(), 1.0 / length);
    }
    count = pairs;
    if (pairs == 0) break;
    for (std::size_t i = 0; i < pairs; ++i) {
      const double *const first = &sums[2 * i * size], *const second = first + size;
      add(k, first, second, 0.5 / length);
      for (std::size_t j = 0; j < size; ++j) sums[i * size + j] = first[j] + second[j];
      const double apart = errors[2 * i] - errors[2 * i + 1];
      levels[k].older += apart * apart * 0.5 / length;
      errors[i] = errors[2 * i] + errors[2 * i + 1];
    }
    levels[k].older_pairs = static_cast<double>(pairs);
    // The Haar wavelet's autocorrelation gives the variance of white noise in shared windows.
    white[k] = 1.0;
    for (std::size_t l = 0; l < shares.size(); ++l) {
      const double lag = static_cast<double>(l + 1) / length;
      white[k] += shares[l] * (lag < 1.0 ? 2.0 - 3.0 * lag : std::min(lag - 2.0, 0.0));
    }
    white[k] = std::max(white[k], 1e-3);
  }

  const LevelNoise noise(levels, variance, {fitted, true}, &white);
  const auto term = [&](std::size_t k, std::size_t entry) {
    return noise.ratio[k] * white[k] * parts[k * square + entry];
  };
  std::vector<double> quantile(size);
  for (std::size_t i = 0; i < size; ++i) {
    const auto own = [&](std::size_t k) { return term(k, i * size + i); };
    quantile[i] = noise.measured > 0 ? widened_quantile(noise.degrees(own)) : 1.0;
  }
  for (std::size_t entry = 0; entry < square; ++entry) {
    double sum = 0.0;
    for (std::size_t k = 0; k <= rest; ++k) sum += term(k, entry);
    result[entry] = quantile[entry / size] * quantile[entry % size] * variance * sum;
  }
}

}  // namespace palpate::detail
