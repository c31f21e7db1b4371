// A robot presses its probe into a material that may relax, and selects its law as it moves.
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <palpate/viscoelastic_estimators.hpp>
#include <random>

#include "palpate/force_laws.hpp"

namespace {

namespace v = palpate::viscoelastic;

constexpr double dt = 1e-3;

const char* damper(v::Damping damping) {
  return damping == v::Damping::none            ? "no damping"
         : damping == v::Damping::hunt_crossley ? "Hunt-Crossley damping"
         : damping == v::Damping::half_space    ? "half-space damping"
                                                : "a linear damper";
}

// The rms error of the selected law over that of the best other law without memory.
double error_ratio(const v::Solver& solver) {
  const auto& verdict = solver.verdict();
  const std::size_t chosen = solver.solution().fit.candidate;
  double least = HUGE_VAL;
  for (std::size_t i = 0; i < solver.count; ++i) {
    const bool competes = verdict.mean_square[i] > 0.0 && !v::candidates[i].remembers();
    if (competes && i != chosen) least = std::fmin(least, verdict.mean_square[i]);
  }
  return std::sqrt(verdict.mean_square[chosen] / least);
}

}  // namespace

int main() {
  // The simulated material: F = K xⁿ + B xⁿ v, and 0.5 K xⁿ more, which relaxes over 2 ms to 2 s.
  const palpate::GeneralisedHuntCrossley foam{.K = 2e4, .n = 1.5, .B = 4e4, .p = 1.5, .M = 1e4};
  const v::RelaxationBranches branches(0.0, 2e-3, 2.048, foam.M);
  double state[v::RelaxationBranches::most + 1] = {};
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.05);

  palpate::ViscoelasticContact estimator({.method = {.sample_time = dt}});
  for (int tick = 0; tick <= 3000; ++tick) {
    // Your 1 kHz loop. A real one has no velocity: palpate::OnlinePreparation computes it.
    const double t = dt * tick;
    const double x = 4e-3 - 6e-3 * std::cos(11.0 * t);
    const double velocity = 66e-3 * std::sin(11.0 * t);
    v::relax(foam.n, branches, x, dt, state);
    const double force = v::relaxing_force(foam, branches, x, velocity, state) + noise(random);

    // Never throws, allocates or blocks; each call computes a part of verdict and parameters.
    estimator.update(x, velocity, force, dt);

    if (tick % 250 != 0) continue;
    const auto& solver = estimator.method().solver();
    if (!solver.decided()) {
      std::printf("%4.2f s  no verdict yet\n", t);
      continue;
    }
    const v::Candidate& law = solver.solution().law();
    std::printf("%4.2f s  %s, %s: %.2f of the error without memory, effective sample size %.0f\n",
                t, damper(law.damping), law.remembers() ? "memory" : "no memory",
                error_ratio(solver), solver.verdict().effective);
  }
  estimator.finish_pending();  // otherwise the next samples would finish it
  const v::Candidate& law = estimator.method().solver().solution().law();
  const bool right = law.damping == v::Damping::hunt_crossley && law.remembers();
  std::printf("truth: Hunt-Crossley damping, memory: %s\n", right ? "selected" : "not selected");
  return right ? 0 : 1;
}
