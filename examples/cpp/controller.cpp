// A robot presses its probe into an unknown material with a force of 15 N. It scales the gain of
// its force control by the stiffness that it identifies as it moves.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <palpate/palpate.hpp>
#include <random>

int main() {
  // The simulated material: soft rubber, F = K xⁿ + B xⁿ v; the force sensor has 0.05 N of noise.
  const palpate::HuntCrossley rubber{.K = 20000.0, .B = 20000.0, .n = 1.5};
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.05);

  // No sensor delivers a velocity: the preparation computes it from the positions, and delays all
  // three numbers by 9 ms. The robot knows nothing of the material, and its estimator needs no
  // settings.
  palpate::OnlinePreparation<> preparation({.filter = {.sample_time = 1e-3}});
  palpate::WithOutlierRejection<palpate::VariableProjection> estimator;

  constexpr double bandwidth = 10.0;  // 1/s, of the force control on any material
  constexpr double slowest = 0.02;    // m/s, of an approach without contact
  double position = -2e-3, velocity = slowest, stiffness = 0.0;
  double largest_force = 0.0, force = 0.0;

  for (int tick = 0; tick <= 4000; ++tick) {
    // Your 1 kHz loop: wait for the clock, read the encoder and the force sensor.
    const double t = 1e-3 * tick;
    force = rubber.force(position, velocity) + noise(random);
    largest_force = std::max(largest_force, force);

    if (preparation.update(position, force) == palpate::Status::updated) {  // m, N; none at first
      const palpate::FilteredSample late = preparation.sample();
      // Neither throws, allocates or blocks.
      estimator.update(late.penetration, late.velocity, late.force, late.dt);
    }

    // A velocity that is proportional to the error of the force: on a stiffness K′ the force
    // follows with the bandwidth, if the gain is bandwidth/K′. Where K′ is not usable the gain only
    // falls: too stiff is safe, too soft may oscillate.
    const palpate::ContactResponse now = estimator.response();
    if (now.stiffness.usable) {
      stiffness = now.stiffness.value;
    } else {
      stiffness = std::max(stiffness, now.stiffness.value);
    }
    const double wanted = 15.0 + 3.0 * std::sin(11.0 * t) + 2.0 * std::sin(17.0 * t);
    const double gain = stiffness > 0.0 ? bandwidth / stiffness : 0.0;
    velocity = gain > 0.0 ? std::clamp(gain * (wanted - force), -0.05, 0.05) : slowest;
    position += 1e-3 * velocity;

    if (tick % 500 != 0) continue;
    std::printf("%.1f s  %5.1f N  K' = %4.0f N/m %s\n", t, force, now.stiffness.value,
                now.stiffness.usable ? "usable" : "not usable yet");
  }

  const palpate::ContactResponse last = estimator.response();
  const double n = rubber.n;
  const double exact = n * rubber.K * std::pow(last.depth, n - 1.0);
  std::printf("truth          K' = %4.0f N/m\n", exact);
  const bool recovered =
      last.stiffness.usable && std::abs(last.stiffness.value - exact) < 0.02 * exact;
  return recovered && largest_force < 25.0 ? 0 : 1;
}
