// laws FILE PASSES: sizes and times of the estimators of laws with memory.
//
// FILE holds doubles: all penetrations, velocities, forces and time steps. A line for each of the
// two tiers, without and with forgetting: bytes, ns a sample, that of the later half, the longest
// call in µs by the minimum of all passes at each sample, the longest of all passes, and the
// longest of ten times as many empty calls.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "palpate/viscoelastic_estimators.hpp"

namespace {

using palpate::Sample;
using Clock = std::chrono::steady_clock;

struct Motion {
  std::vector<Sample> samples;
  std::vector<double> steps;
};

Motion read(const char* path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const auto bytes = static_cast<std::size_t>(std::max<std::streamoff>(file.tellg(), 0));
  std::vector<double> all(bytes / sizeof(double));
  file.seekg(0);
  file.read(reinterpret_cast<char*>(all.data()), static_cast<std::streamsize>(bytes));
  const std::size_t count = all.size() / 4;
  Motion motion;
  for (std::size_t k = 0; k < count; ++k) {
    motion.samples.push_back({all[k], all[count + k], all[2 * count + k]});
    motion.steps.push_back(all[3 * count + k]);
  }
  return motion;
}

double nanoseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::nano>(Clock::now() - start).count();
}

// Other processes only ever add time: for each segment the minimum of all passes counts.
template <class Each>
std::vector<double> least_times(std::size_t count, std::size_t segment, int passes, double& longest,
                                const Each& each) {
  std::vector<double> least(count / segment, 1e18);
  for (int pass = 0; pass < passes; ++pass) {
    auto step = each();
    for (std::size_t part = 0; part < least.size(); ++part) {
      const auto start = Clock::now();
      for (std::size_t k = part * segment; k < (part + 1) * segment; ++k) step(k);
      const double spent = nanoseconds_since(start);
      least[part] = std::min(least[part], spent);
      longest = std::max(longest, spent);
    }
  }
  return least;
}

double mean(const std::vector<double>& times, std::size_t begin, std::size_t segment) {
  double sum = 0.0;
  for (std::size_t i = begin; i < times.size(); ++i) sum += times[i];
  return sum / static_cast<double>((times.size() - begin) * segment);
}

template <class Estimator>
void run(const char* name, palpate::viscoelastic::Offered offered, double factor,
         const Motion& motion, int passes) {
  typename Estimator::Settings settings{
      .method = {.offered = offered}, .gate = {1e-3, 0.0, 0.0}, .scale = {10e-3, 50e-3, 20.0}};
  settings.forgetting = {.initial_factor = factor, .rate = 0.0};
  const auto fresh = [&] {
    return [&motion, estimator = Estimator(settings)](std::size_t k) mutable {
      const Sample& s = motion.samples[k];
      estimator.update(s.penetration, s.velocity, s.force, motion.steps[k]);
    };
  };
  const auto nothing = [] { return [](std::size_t) {}; };
  constexpr std::size_t segment = 50;
  const std::size_t count = motion.samples.size();
  double ignored = 0.0, longest = 0.0, of_machine = 0.0;
  const auto segments = least_times(count, segment, passes, ignored, fresh);
  const auto calls = least_times(count, 1, passes, longest, fresh);
  least_times(count * 10, 1, passes, of_machine, nothing);
  std::printf("%s %zu %.1f %.1f %.2f %.1f %.1f\n", name, sizeof(Estimator),
              mean(segments, 0, segment), mean(segments, segments.size() / 2, segment),
              *std::max_element(calls.begin(), calls.end()) / 1e3, longest / 1e3, of_machine / 1e3);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const Motion motion = read(argv[1]);
  const int passes = std::atoi(argv[2]);
  if (motion.samples.size() < 100 || passes < 1) return 2;
  using palpate::ViscoelasticContact, palpate::FullViscoelasticContact;
  run<ViscoelasticContact>("common", 0x1f, 1.0, motion, passes);
  run<ViscoelasticContact>("common,forgetting", 0x1f, 0.999, motion, passes);
  run<FullViscoelasticContact>("full", 0x7ff, 1.0, motion, passes);
  run<FullViscoelasticContact>("full,forgetting", 0x7ff, 0.999, motion, passes);
}
