// A robot presses its probe into an unknown material, and identifies it as it moves.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <palpate/palpate.hpp>
#include <random>
#include <string>

namespace {

// The power of ten of a number once it is rounded to two digits.
int power_of(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", value);
  return std::stoi(std::string(text).substr(std::string(text).find('e') + 1));
}

// "1.495 ± 0.012": the error has two significant digits, and the value ends at the same decimal.
// Numbers below 0.001 or from 100000 on have a power of ten: "(1.0000 ± 0.0083)e5".
std::string with_error(double value, double error) {
  char text[80];
  if (!std::isfinite(value) || !std::isfinite(error)) return "unknown";
  if (!(error > 0.0)) {  // a parameter that is kept fixed has no error
    std::snprintf(text, sizeof text, "%.4g", value);
    return text;
  }
  const int power = power_of(std::max(std::abs(value), error)), last = power_of(error) - 1;
  if (power >= -3 && power < 5) {
    const int decimals = std::max(-last, 0);
    const double unit = std::pow(10.0, std::max(last, 0));
    const auto rounded = [&](double x) { return last > 0 ? unit * std::round(x / unit) : x; };
    std::snprintf(text, sizeof text, "%.*f ± %.*f", decimals, rounded(value), decimals,
                  rounded(error));
    return text;
  }
  const double unit = std::pow(10.0, power);
  std::snprintf(text, sizeof text, "(%.*f ± %.*f)e%d", power - last, value / unit, power - last,
                error / unit, power);
  return text;
}

}  // namespace

int main() {
  // The simulated material: soft rubber, F = K xⁿ + B xⁿ v; the force sensor has 0.05 N of noise.
  const palpate::HuntCrossley rubber{.K = 20000.0, .B = 20000.0, .n = 1.5};
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.05);

  // No sensor delivers a velocity: the preparation computes it from the positions, and delays all
  // three numbers by 9 ms.
  palpate::OnlinePreparation<> preparation({.filter = {.sample_time = 1e-3}});

  // The robot knows nothing of the material. The method uses the logarithm of the force, so contact
  // needs a force well above the noise: it begins at 1 N and ends at 0.8 N. Out of contact the
  // estimate is held.
  palpate::SingleStageRLS estimator(
      {.method = {.initial = {.K = 0.1, .B = 0.0, .n = 1.0},
                  .initial_covariance = palpate::diagonal<3>({1e3, 1e3, 1e3})},
       .forgetting = {.initial_factor = 0.99, .rate = 5.0},
       .gate = {.minimum_penetration = 1e-3, .make_force = 1.0, .break_force = 0.8}});

  for (int tick = 0; tick <= 3000; ++tick) {
    // Your 1 kHz loop: wait for the clock, read the encoder and the force sensor.
    const double t = 1e-3 * tick;
    const double approach = 12e-3 * std::exp(-3.0 * t);
    const double x = 10e-3 - approach + 1.8e-3 * std::sin(11.0 * t) + 1.8e-3 * std::sin(15.0 * t);
    const double v = 3.0 * approach + 19.8e-3 * std::cos(11.0 * t) + 27e-3 * std::cos(15.0 * t);
    const double force = rubber.force(x, v) + noise(random);

    if (preparation.update(x, force) == palpate::Status::updated) {  // m, N; none at first
      const palpate::FilteredSample late = preparation.sample();
      // Neither throws, allocates or blocks.
      estimator.update(late.penetration, late.velocity, late.force, late.dt);
    }

    if (tick % 250 != 0) continue;
    const auto now = estimator.estimate();
    if (now.samples == 0) {
      std::printf("%4.2f s  no contact yet\n", t);
      continue;
    }
    const auto number = [&](std::size_t i) {
      return with_error(now.parameters[i], std::sqrt(now.covariance[i][i]));
    };
    std::printf("%4.2f s  K = %-15s B = %-15s n = %s\n", t, number(0).c_str(), number(1).c_str(),
                number(2).c_str());
  }
  std::printf("truth   K = %-14.0f B = %-14.0f n = %.1f\n", rubber.K, rubber.B, rubber.n);

  const palpate::HuntCrossley found = estimator.law();
  const auto close = [](double a, double b) { return std::abs(a - b) < 0.02 * b; };
  const bool recovered =
      close(found.K, rubber.K) && close(found.B, rubber.B) && close(found.n, rubber.n);
  return recovered ? 0 : 1;
}
