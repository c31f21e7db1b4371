// preparation FILE PASSES: the best pass, in seconds per sample, of the velocity filter on an even
// clock and on an uneven one, of the whole preparation, of the compensation of a payload, and of
// the estimators after it.
//
// FILE holds doubles: all penetrations, all velocities, all forces.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "palpate/palpate.hpp"

namespace {

std::vector<double> read_doubles(const char* path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const auto bytes = static_cast<std::size_t>(std::max<std::streamoff>(file.tellg(), 0));
  std::vector<double> values(bytes / sizeof(double));
  file.seekg(0);
  file.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(bytes));
  return values;
}

// Results must be used, or the compiler may remove the computation.
volatile double used = 0.0;

template <class Kind, class Update>
void run(const char* name, std::size_t count, int passes, const Update& update) {
  double best = 1e9;
  for (int i = 0; i < passes; ++i) {
    Kind kind;
    double sum = 0.0;
    const auto start = std::chrono::steady_clock::now();
    for (std::size_t k = 0; k < count; ++k) sum += update(kind, k);
    const auto time = std::chrono::steady_clock::now() - start;
    best = std::min(best, std::chrono::duration<double>(time).count());
    used = sum;
  }
  std::printf("%s %.17g\n", name, best / static_cast<double>(count));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const std::vector<double> data = read_doubles(argv[1]);
  const int passes = std::atoi(argv[2]);
  const std::size_t count = data.size() / 3;
  if (count == 0 || passes < 1) return 2;
  const double *x = data.data(), *v = x + count, *f = v + count;
  const auto velocity = [](auto& kind, palpate::Status status) {
    return status == palpate::Status::updated ? kind.sample().velocity : 0.0;
  };
  const auto learned = [&](auto& kind, std::size_t k) {
    return static_cast<double>(kind.update(x[k], v[k], f[k]) == palpate::Status::updated);
  };

  using Filter = palpate::VelocityFilter<>;
  using Preparation = palpate::OnlinePreparation<>;
  run<Filter>("even", count, passes,
              [&](Filter& kind, std::size_t k) { return velocity(kind, kind.update(x[k], f[k])); });
  run<Filter>("uneven", count, passes, [&](Filter& kind, std::size_t k) {
    return velocity(kind, kind.update(x[k], f[k], 1e-3 + 1e-9 * static_cast<double>(k % 97)));
  });
  run<Preparation>("prepared", count, passes, [&](Preparation& kind, std::size_t k) {
    return velocity(kind, kind.update(x[k], f[k]));
  });
  using Compensation = palpate::PayloadCompensation<>;
  run<Compensation>("compensated", count, passes, [&](Compensation& kind, std::size_t k) {
    kind.update({0.0, 0.0, -x[k]}, {1.0, x[k], 0.0, 0.0}, {0.0, 0.0, f[k]},
                1e-3 * static_cast<double>(k));
    return kind.output().wrench[2];
  });
  run<palpate::KelvinVoigtRLS>("KelvinVoigtRLS", count, passes, learned);
  run<palpate::SingleStageRLS>("SingleStageRLS", count, passes, learned);
  run<palpate::VariableProjection>("VariableProjection", count, passes, learned);
  return 0;
}
