// worst_update METHOD SAMPLES [INDEX …]: the dearest updates of a method.
//
// Without indices it takes the samples, times each update from a copy of its state, and prints the
// indices of the dearest and of every so many of all updates. With indices, under callgrind, it
// writes the instructions of these updates.
#include <valgrind/callgrind.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <vector>

#include "palpate/viscoelastic_estimators.hpp"

namespace {

using palpate::HuntCrossley;
using palpate::Sample;

// Inputs of many kinds, one block after the other: well-excited probing, taps, light contact, held,
// noise, jumps of the depth, and other materials.
class Inputs {
 public:
  Sample next() {
    if (tick_ % block == 0) choose();
    const double t = 1e-3 * static_cast<double>(tick_++);
    double x = mean_, v = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      x += amplitude_[i] * std::sin(rate_[i] * t + phase_[i]);
      v += amplitude_[i] * rate_[i] * std::cos(rate_[i] * t + phase_[i]);
    }
    if (jumps_ && uniform(0.0, 1.0) < 0.02) x = uniform(-2e-3, 15e-3);
    double force = law_.force(x, v) + noise_ * normal_(random_);
    if (step_ > 0.0) force = step_ * std::round(force / step_);
    return {x, v, force};
  }

 private:
  static constexpr std::size_t block = 5000;

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  void choose() {
    const auto kind = (tick_ / block) % 7;
    const double exponent = uniform(0.8, 2.5);
    law_ = {std::pow(10.0, uniform(0.0, 1.5)) / std::pow(8e-3, exponent), 0.0, exponent};
    law_.B = law_.K * uniform(0.0, 3.0);
    mean_ = kind == 1 ? -2e-3 : kind == 2 ? 0.3e-3 : 8e-3;
    for (std::size_t i = 0; i < 3; ++i) {
      amplitude_[i] = kind == 3   ? 0.0
                      : kind == 1 ? 4e-3
                      : kind == 2 ? 0.2e-3
                                  : uniform(0.5e-3, 2e-3);
      rate_[i] = uniform(2.0, 30.0);
      phase_[i] = uniform(0.0, 6.28);
    }
    noise_ = kind == 4 ? 1.0 : 0.05;
    jumps_ = kind == 5;
    step_ = kind == 6 ? 0.1 : 0.0;
  }

  std::mt19937 random_{62};
  std::normal_distribution<double> normal_{0.0, 1.0};
  std::size_t tick_ = 0;
  HuntCrossley law_{};
  std::array<double, 3> amplitude_{}, rate_{}, phase_{};
  double mean_ = 0.0, noise_ = 0.0, step_ = 0.0;
  bool jumps_ = false;
};

template <class Estimator>
[[gnu::noinline]] void update(Estimator& estimator, const Sample& s) {
  estimator.update(s.penetration, s.velocity, s.force);
}

template <class Estimator>
double seconds_of(const Estimator& before, const Sample& s) {
  double best = 1.0;
  for (int round = 0; round < 3; ++round) {
    Estimator again = before;
    const auto start = std::chrono::steady_clock::now();
    update(again, s);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    best = std::min(best, took.count());
  }
  return best;
}

template <class Estimator>
int run(std::size_t count, const std::vector<std::size_t>& indices) {
  static Estimator estimator;
  Inputs inputs;
  std::vector<std::pair<double, std::size_t>> dear;
  auto next = indices.begin();
  for (std::size_t k = 0; k < count; ++k) {
    const Sample sample = inputs.next();
    if (indices.empty()) dear.emplace_back(seconds_of(estimator, sample), k);
    const bool counted = next != indices.end() && *next == k;
    if (counted) CALLGRIND_START_INSTRUMENTATION;
    update(estimator, sample);
    if (counted) {
      CALLGRIND_STOP_INSTRUMENTATION;
      CALLGRIND_DUMP_STATS;
      ++next;
    }
  }
  if (!indices.empty()) return 0;
  std::sort(dear.rbegin(), dear.rend());
  constexpr std::size_t dearest = 60, others = 200;
  for (std::size_t i = 0; i < std::min(dearest, count); ++i) std::printf("%zu\n", dear[i].second);
  for (std::size_t i = 1; i < others; ++i) std::printf("%zu\n", i * count / others);
  std::printf("size %zu\n", sizeof(Estimator));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const auto count = static_cast<std::size_t>(std::atoll(argv[2]));
  std::vector<std::size_t> indices;
  for (int i = 3; i < argc; ++i) indices.push_back(static_cast<std::size_t>(std::atoll(argv[i])));
  std::sort(indices.begin(), indices.end());
  indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
  if (!std::strcmp(argv[1], "single-stage")) return run<palpate::SingleStageRLS>(count, indices);
  if (!std::strcmp(argv[1], "default")) return run<palpate::VariableProjection>(count, indices);
  if (!std::strcmp(argv[1], "relaxing")) return run<palpate::ViscoelasticContact>(count, indices);
  return 2;
}
