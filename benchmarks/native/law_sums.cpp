// law_sums: difference of the residual by the sums from that of the samples, over Σ F², of
// every law at exponents between the nodes of the grid. A line for each kind of samples: the
// largest of the common and of the full tier at middling exponents, the same at low ones, and the
// name.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "palpate/viscoelastic/problem.hpp"

namespace {

using namespace palpate;
using namespace palpate::viscoelastic;

constexpr double sample_time = 1e-3;
// In units of depth: 2 % of the peak.
constexpr double gate = 0.025;
constexpr std::array<double, 5> middling{1.137, 1.63, 2.41, 3.11, 3.22};
constexpr std::array<double, 2> low{0.53, 0.61};

struct Case {
  const char* name;
  double unit = 1.0;  // of the depths, which go up to 1.5 of it
  bool uneven = false;
  double factor = 1.0;
};

struct Moved {
  Sample sample;
  double step;
};

// Out of contact in every period of the slowest of three sines. Any force will do, because any
// numbers have a residual; this one is near a law.
std::vector<Moved> motion(const Case& how) {
  std::mt19937 random(1);
  std::vector<Moved> all;
  double time = 0.0;
  for (int k = 0; k < 4400; ++k) {
    const double part = static_cast<double>(random()) / 4294967296.0;
    const double step = how.uneven ? sample_time * (0.5 + part) : sample_time;
    time += step;
    const double depth =
        0.5 - 0.55 * std::cos(4.0 * time) - 0.2 * (std::cos(11.0 * time) + std::cos(15.0 * time));
    const double speed =
        2.2 * std::sin(4.0 * time) + 2.2 * std::sin(11.0 * time) + 3.0 * std::sin(15.0 * time);
    const double elastic = depth > 0.0 ? std::pow(depth, 1.5) : 0.0;
    const double force = elastic * (1.0 + 0.1 * speed) + 0.05 * std::sin(37.0 * time) + 0.1;
    all.push_back({{depth * how.unit, speed, force}, step});
  }
  return all;
}

// ξⁿ and the branches for one exponent, without a grid.
template <class Times>
class Direct {
 public:
  explicit Direct(double n) noexcept : n_(n) {}

  void advance(double depth, double step) noexcept {
    const double now = depth > 0.0 ? std::pow(depth, n_) : 0.0;
    for (std::size_t i = 0; i < Times::count; ++i) {
      const double time = times_.time(static_cast<double>(i)), lost = -std::expm1(-step / time);
      states_[i] += lost * (time / step * (now - elastic_) - states_[i]);
    }
    elastic_ = now;
  }

  Vector<parts> row(const Candidate& law, double second, const Sample& s) const noexcept {
    const auto spectrum = spectrum_of<Times>(law.memory, second);
    double remembered = 0.0;
    for (std::size_t i = spectrum.first; i < spectrum.end; ++i) {
      remembered += spectrum.weight[i] * states_[i];
    }
    const bool half_space = law.damping == Damping::half_space;
    return {1.0, elastic_, s.velocity * (half_space ? elastic_ / s.penetration : elastic_),
            remembered};
  }

 private:
  Times times_{sample_time};
  double n_;
  double elastic_ = 0.0;
  std::array<double, Times::count> states_{};
};

template <class Sums>
double away(const Case& how, const std::vector<Moved>& moved, const Samples<Sums>& samples,
            const Candidate& law, double n, double second) {
  const Normal normal = normal_of(samples, law, n, second);
  const Vector<parts> p = solve_passive(normal, law, true).value;
  double by_sums = samples.force_squared();
  for (std::size_t i = 0; i < parts; ++i) {
    by_sums += p[i] * (p[i] * normal.a[i][i] - 2.0 * normal.b[i]);
    for (std::size_t j = 0; j < i; ++j) by_sums += 2.0 * p[i] * p[j] * normal.a[i][j];
  }
  Direct<typename Sums::Times> direct(n);
  double residual = 0.0;
  for (const auto& [sample, step] : moved) {
    direct.advance(sample.penetration, step);
    if (!(sample.penetration > gate * how.unit)) continue;
    const double rest = sample.force - detail::dot(p, direct.row(law, second, sample));
    residual = how.factor * residual + rest * rest;
  }
  return std::abs(by_sums - residual) / samples.force_squared();
}

template <class Sums, std::size_t Count>
double largest(const Case& how, const std::array<double, Count>& exponents) {
  const std::vector<Moved> moved = motion(how);
  Samples<Sums> samples(sample_time);
  for (const auto& [sample, step] : moved) {
    samples.advance(std::max(sample.penetration, 0.0), step);
    if (sample.penetration > gate * how.unit) samples.take(sample, how.factor);
  }
  double worst = 0.0;
  for (std::size_t i = 0; i < (Sums::full ? candidates.size() : everyday_candidates); ++i) {
    const Candidate& law = candidates[i];
    for (const double n : exponents) {
      for (const double second : {0.0, 0.37, 0.83, 4.6, 10.4}) {
        if (second > 0.0 && !law.searches_memory()) continue;
        if (second > 1.0 && law.memory == Memory::power_law) continue;
        worst = std::max(worst, away(how, moved, samples, law, law.linear ? 1.0 : n, second));
      }
    }
  }
  return worst;
}

}  // namespace

int main() {
  const std::array<Case, 7> cases{
      {{.name = "even time steps"},
       {.name = "uneven time steps", .uneven = true},
       {.name = "forgetting", .factor = 0.999},
       {.name = "uneven, forgetting", .uneven = true, .factor = 0.99},
       {.name = "depths of up to 15 units", .unit = 10.0, .uneven = true},
       {.name = "depths of up to 0.15 units", .unit = 0.1, .uneven = true},
       {.name = "depths of up to 150 units", .unit = 100.0}}};
  for (const Case& how : cases) {
    std::printf("%.3e %.3e %.3e %.3e %s\n", largest<FlatSums>(how, middling),
                largest<PairSums>(how, middling), largest<FlatSums>(how, low),
                largest<PairSums>(how, low), how.name);
  }
}
