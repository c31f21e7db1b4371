// replay FILE PASSES: replays a contact with every estimator, with its default settings, and prints
// the best pass in seconds per sample, into memory used before and into new memory, and the last
// law.
//
// FILE holds doubles: all penetrations, all velocities, all forces.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
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

// Memory for a trace, uninitialised; the first pass touches its pages first.
struct Trace {
  Trace(std::size_t count, std::size_t size)
      : parameters(std::make_unique_for_overwrite<double[]>(count * size)),
        errors(std::make_unique_for_overwrite<double[]>(count * size)),
        predicted(std::make_unique_for_overwrite<double[]>(count)),
        margin(std::make_unique_for_overwrite<double[]>(count)),
        status(std::make_unique_for_overwrite<std::uint8_t[]>(count)) {}

  palpate::TraceColumns columns() const {
    return {parameters.get(), errors.get(), predicted.get(), margin.get(), status.get()};
  }

  std::unique_ptr<double[]> parameters, errors, predicted, margin;
  std::unique_ptr<std::uint8_t[]> status;
};

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// The best pass into the same memory repeatedly, and into new memory each time.
template <class Estimator>
void run(const char* name, const palpate::Signals& in, int passes) {
  double again = 1e9, anew = 1e9;
  Estimator estimator;
  const Trace kept(in.count, Estimator::Law::size);
  for (int i = 0; i <= passes; ++i) {
    estimator.reset();
    auto start = std::chrono::steady_clock::now();
    palpate::replay(estimator, in, kept.columns());
    if (i > 0) again = std::min(again, seconds_since(start));

    estimator.reset();
    start = std::chrono::steady_clock::now();
    const Trace fresh(in.count, Estimator::Law::size);
    palpate::replay(estimator, in, fresh.columns());
    anew = std::min(anew, seconds_since(start));
  }
  const auto count = static_cast<double>(in.count);
  std::printf("%s %.17g %.17g", name, again / count, anew / count);
  for (const double value : estimator.law().parameters()) std::printf(" %.17g", value);
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const std::vector<double> data = read_doubles(argv[1]);
  const int passes = std::atoi(argv[2]);
  const std::size_t count = data.size() / 3;
  if (count == 0 || passes < 1) return 2;
  const palpate::Signals in{data.data(), data.data() + count, data.data() + 2 * count, nullptr,
                            count};

  run<palpate::KelvinVoigtRLS>("KelvinVoigtRLS", in, passes);
  run<palpate::ExtendedKelvinVoigtRLS>("ExtendedKelvinVoigtRLS", in, passes);
  run<palpate::SingleStageRLS>("SingleStageRLS", in, passes);
  run<palpate::DoubleStageRLS>("DoubleStageRLS", in, passes);
  return 0;
}
