// The law that may relax: interpolation, branches, non-negative least squares from sums, and what
// no data breaks.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <type_traits>
#include <vector>

#include "check.hpp"
#include "palpate/estimate.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/viscoelastic_estimators.hpp"
#include "random_numbers.hpp"
#include "soundness.hpp"

using namespace palpate;
using namespace palpate::viscoelastic;

namespace {

constexpr Scale probing{10e-3, 50e-3, 20.0};
constexpr ContactGate::Settings gate{1e-3, 0.0, 0.0};

ViscoelasticContact estimator_of(Offered offered = common) noexcept {
  return ViscoelasticContact({.method = {.offered = offered}, .gate = gate, .scale = probing});
}

// Three sines about 10 mm after an approach of 0.4 s.
Sample moved(double t) noexcept {
  if (t < 0.4) return {-2e-3 + 30e-3 * t, 30e-3, 0.0};
  const double s = t - 0.4;
  return {
      10e-3 + 1e-3 * std::sin(4.0 * s) + 1.8e-3 * (std::sin(11.0 * s) + std::sin(15.0 * s)),
      4e-3 * std::cos(4.0 * s) + 1.8e-3 * (11.0 * std::cos(11.0 * s) + 15.0 * std::cos(15.0 * s)),
      0.0};
}

// What a law says along that motion, with noise.
std::vector<Sample> pressed(const GeneralisedHuntCrossley& law, const RelaxationBranches& branches,
                            std::size_t count, double noise) {
  std::vector<double> state(branches.count + 1, 0.0);
  RandomNumbers random(3);
  std::vector<Sample> samples;
  for (std::size_t k = 0; k < count; ++k) {
    Sample s = moved(1e-3 * static_cast<double>(k));
    relax(law.n, branches, s.penetration, 1e-3, state.data());
    s.force = relaxing_force(law, branches, s.penetration, s.velocity, state.data()) +
              noise * random.between(-1.0, 1.0);
    samples.push_back(s);
  }
  return samples;
}

constexpr GeneralisedHuntCrossley rubber{.K = 1e4, .n = 1.5, .B = 4e4, .p = 1.5, .M = 0.0};

// Hunt–Crossley with half of its stiffness in a flat spectrum beside it, or in one time.
std::vector<Sample> relaxing(double shortest, double longest, std::size_t count, double noise) {
  return pressed(rubber, {0.0, shortest, longest, 5e3}, count, noise);
}
std::vector<Sample> relaxing(std::size_t count) { return relaxing(1e-3, 4.096, count, 0.1); }

template <class Estimator>
void fuzz(Estimator estimator, std::uint64_t seed, int count) {
  RandomNumbers random(seed);
  for (int k = 0; k < count; ++k) {
    const bool wild = random.below(5) == 0;
    const Sample s = wild ? Sample{random.any(), random.any(), random.any()}
                          : Sample{random.between(-1e-3, 0.02), random.between(-0.1, 0.1),
                                   random.between(-1.0, 30.0)};
    const double dt = random.below(9) == 0 ? random.any() : 1e-3;
    estimator.update(s.penetration, s.velocity, s.force, dt);
    if (random.below(900) == 0) estimator.leave_contact();
    if (random.below(2000) == 0) estimator.finish_pending();
    if (k % 50 != 0) continue;
    const auto now = estimator.estimate();
    for (const double parameter : now.parameters) CHECK(std::isfinite(parameter));
    check_covariance(now.covariance);
    for (const double variance : estimator.snapshot().variances) CHECK(std::isfinite(variance));
    CHECK(std::isfinite(estimator.predict(5e-3, 0.02)));
  }
}

}  // namespace

static_assert(std::is_trivially_copyable_v<ViscoelasticContact>);
static_assert(sizeof(ViscoelasticContact) <= 20000);

TEST(
    "a window interpolates what grows exponentially times a polynomial of seventh degree exactly") {
  constexpr std::size_t nodes = 12;
  const double rate = -1.3;
  const auto value = [&](double t) {
    double polynomial = 0.0;
    for (int k = 7; k >= 0; --k) polynomial = polynomial * (t - 5.0) / 6.0 + 0.3 + 0.1 * k;
    return std::exp(rate * t) * polynomial;
  };
  const Growth growth = Growth::by(std::exp(rate)),
               half_as_quick = Growth::by(std::exp(rate / 2.0));
  std::array<double, nodes> values{};
  for (std::size_t j = 0; j < nodes; ++j) values[j] = value(static_cast<double>(j));
  for (double t = 0.0; t <= 11.0; t += 0.0371) {
    const double found = Interpolation(t, growth).at(0, nodes).of(values.data());
    CHECK_NEAR(found / value(t), 1.0, 1e-11);  // weights of up to 10 at the ends, and roundings
    const double below = Interpolation(t + 4.0, growth).at(4, nodes).of(values.data());
    CHECK_NEAR(below / found, 1.0, 1e-11);
    const double squared = Interpolation(t, half_as_quick).square_at(0, nodes).of(values.data());
    CHECK_NEAR(squared / found, 1.0, 1e-11);
  }
  CHECK(window(4.0, nodes).of(values.data()) == values[4]);
  CHECK(Interpolation(1.5, growth).at(4, nodes).of(values.data()) == values[0]);
  CHECK(Interpolation(11.5, growth).at(0, nodes).of(values.data()) == values[11]);
}

TEST("branches are exact under a ramp, whatever the time steps") {
  RandomNumbers random(1);
  Branches branches(1e-3, 4.096);
  double t = 0.0;
  const double speed = 0.7;      // of ξ
  const std::size_t spring = 2;  // n = 1
  for (int k = 0; k < 400; ++k) {
    const double dt = random.between(1e-4, 5e-2);
    t += dt;
    branches.advance(speed * t, dt);
  }
  for (std::size_t i = 0; i < rungs; ++i) {
    const double time = branches.ladder().times()[i];
    const double expected = speed * time * -std::expm1(-t / time);
    CHECK_NEAR(branches.states()[i][spring] / expected, 1.0, 1e-11);
  }
}

TEST("a branch that decays ends near zero and not among the subnormal numbers") {
  Branches branches(1e-3, 4.096);
  branches.advance(0.5, 1e-3);
  for (int k = 0; k < 20000; ++k) branches.advance(0.0, 1e-3);
  for (const auto& row : branches.states()) {
    for (const double state : row) {
      CHECK(state == 0.0 || std::abs(state) > std::numeric_limits<double>::min());
    }
  }
  CHECK(std::abs(branches.states()[0][0]) < 1e-70);
}

TEST("powers of a quarter are those of the exponential") {
  for (const double depth : {1e-3, 0.02, 0.37, 1.0, 2.9}) {
    const Powers powers = powers_of(depth);
    for (std::size_t j = 0; j < Grid::powers; ++j) {
      const double q = Grid::lowest_power + Grid::step * static_cast<double>(j);
      CHECK_NEAR(powers[j] / std::pow(depth, q), 1.0, 1e-14);
    }
  }
}

TEST(
    "the ladder begins at two steps and ends at the longest time, at least a factor of two apart") {
  for (const double longest : {4e-3, 0.1, 4.096, 1e3}) {
    const Ladder ladder(1e-3, longest);
    const auto& times = ladder.times();
    CHECK_NEAR(times[0], 2e-3, 1e-15);
    CHECK(ladder.ratio() >= 2.0 && ladder.open() >= 2);
    const double last = times[ladder.open() - 1];
    CHECK(last <= longest * (1.0 + 1e-6) && last * ladder.ratio() > longest * (1.0 - 1e-6));
  }
}

TEST("least squares from a singular matrix leaves out what says what others do") {
  Normal normal{};
  // Damping is twice the spring, and memory stands alone.
  normal.a[offset][offset] = normal.a[stiffness][stiffness] = 1.0;
  normal.a[stiffness][offset] = 0.5;
  normal.a[damping][offset] = 1.0;
  normal.a[damping][stiffness] = 2.0;
  normal.a[damping][damping] = 4.0;
  normal.a[memory][memory] = 3.0;
  normal.b[offset] = 0.5;
  normal.b[stiffness] = 1.0;
  normal.b[damping] = 2.0;
  normal.b[memory] = 6.0;
  const PartSet wanted = bit(offset) | bit(stiffness) | bit(damping) | bit(memory);
  const Linear found = Factored(normal, wanted).solve(normal.b);
  CHECK(!has(found.fitted, damping) && has(found.fitted, memory));
  CHECK_NEAR(found.value[stiffness], 1.0, 1e-12);
  CHECK_NEAR(found.value[memory], 2.0, 1e-12);
  CHECK_NEAR(found.value[offset], 0.0, 1e-12);
}

TEST("non-negative least squares meets the conditions of Karush, Kuhn and Tucker from any guess") {
  RandomNumbers random(11);
  constexpr PartSet wanted = (bit(parts) - 1U), constrained = all_memory | bit(stiffness);
  for (int trial = 0; trial < 300; ++trial) {
    Normal normal{};
    double squares = 0.0;
    for (int row = 0; row < 40; ++row) {
      // Neighbours are alike, as branches are.
      Vector<parts> x{};
      double slow = 0.0;
      for (double& each : x) each = slow = 0.9 * slow + random.between(-1.0, 1.0);
      const double y = random.between(-1.0, 1.0) + x[memory] - x[memory + 3];
      squares += y * y;
      for (std::size_t i = 0; i < parts; ++i) {
        normal.b[i] += x[i] * y;
        for (std::size_t j = 0; j <= i; ++j) normal.a[i][j] += x[i] * x[j];
      }
    }
    const PartSet guess = static_cast<PartSet>(random.below(1U << parts));
    const Linear found = solve_nonnegative(normal, wanted, constrained, guess);
    double gain = 0.0;
    for (std::size_t i = 0; i < parts; ++i) {
      double slope = normal.b[i];
      for (std::size_t j = 0; j < parts; ++j) {
        slope -= (i > j ? normal.a[i][j] : normal.a[j][i]) * found.value[j];
      }
      gain += normal.b[i] * found.value[i];
      const double size = std::sqrt(normal.a[i][i] * squares);
      const bool held = has(constrained, i) && found.value[i] == 0.0;
      CHECK(!has(constrained, i) || found.value[i] >= 0.0);
      CHECK(held ? slope < 1e-7 * size : std::abs(slope) < 1e-7 * size);
    }
    CHECK_NEAR(found.gain / gain, 1.0, 1e-9);
  }
}

TEST("of forms of damping that fit alike to rounding the first is named") {
  Verdict verdict;
  verdict.mean_square = {9.0, 9.0, 9.0, 1.0, 1.0 - 1e-9, 1.0 - 2e-9, 1.0};
  verdict.parameters.fill(4.0);
  verdict.effective = 1000.0;
  CHECK(verdict.chosen(false) == 3);
  verdict.mean_square[4] = 0.99;
  CHECK(verdict.chosen(false) == 4);
}

TEST("what forgetting weighs the sums with is brought back before it is too large") {
  ViscoelasticContact::Settings settings{.gate = gate, .scale = probing};
  settings.forgetting = {.initial_factor = 0.9, .rate = 0.0};
  ViscoelasticContact estimator(settings);
  const auto samples = pressed(rubber, {{}, {}}, 4000, 0.0);
  for (const Sample& s : samples) estimator.update(s.penetration, s.velocity, s.force);
  // 1/(1 − λ) samples count.
  CHECK_NEAR(estimator.method().solver().samples().weight(), 10.0, 1e-6);
  const Sample& last = samples.back();
  CHECK_NEAR(estimator.predict(last.penetration, last.velocity) / last.force, 1.0, 0.05);
}

TEST("a state that is stored and restored at any sample goes on to the last bit") {
  const auto samples = relaxing(1200);
  auto kept = estimator_of();
  for (std::size_t k = 0; k < samples.size(); ++k) {
    // A copy of bytes, in the middle of whatever search there is.
    std::array<std::byte, sizeof(ViscoelasticContact)> stored;
    std::memcpy(stored.data(), &kept, sizeof kept);
    ViscoelasticContact restored;
    std::memcpy(static_cast<void*>(&restored), stored.data(), sizeof kept);
    const Sample& s = samples[k];
    kept.update(s.penetration, s.velocity, s.force);
    restored.update(s.penetration, s.velocity, s.force);
    CHECK(restored.estimate().parameters == kept.estimate().parameters);
    CHECK(restored.estimate().covariance == kept.estimate().covariance);
    kept = restored;
  }
  auto never_stopped = estimator_of();
  for (const Sample& s : samples) never_stopped.update(s.penetration, s.velocity, s.force);
  CHECK(never_stopped.estimate().covariance == kept.estimate().covariance);
  CHECK(never_stopped.method().solver().solution().known != 0);
}

TEST("steps of time from the least number to the largest, and inputs up to the limit, are borne") {
  constexpr double least = std::numeric_limits<double>::denorm_min();
  constexpr double most = std::numeric_limits<double>::max();
  auto estimator = estimator_of(0x7f);
  const auto samples = relaxing(1500);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const Sample& s = samples[k];
    const std::array<double, 6> steps{1e-3, least, 1e-300, 1e-12, 1e6, most};
    estimator.update(s.penetration, s.velocity, s.force, steps[k % 97 < 6 ? k % 97 : 0]);
    // 1e8 units of each, or just less, and just more: the one is taken and the other not.
    if (k % 300 == 250) {
      const auto before = estimator.estimate();
      CHECK(estimator.update(1e6, 5e6, 2.1e9) == Status::out_of_range);
      CHECK(estimator.update(0.01, 0.1, 1.0, 0.0) == Status::invalid_step);
      CHECK(estimator.estimate().parameters == before.parameters);
      CHECK(estimator.estimate().samples == before.samples);
    }
    if (k == 1400) estimator.update(0.99e6, 4.9e6, 1.9e9);
  }
  estimator.finish_pending();
  for (const double parameter : estimator.estimate().parameters) CHECK(std::isfinite(parameter));
  check_covariance(estimator.estimate().covariance);
}

TEST("levels of floats say of the noise what those of doubles say") {
  RandomNumbers random(7);
  detail::HaarLevels<1> doubles;
  detail::HaarLevels<1, float> floats;
  double slow = 0.0;
  for (int k = 0; k < 20000; ++k) {
    slow = 0.9 * slow + random.between(-1.0, 1.0);
    const Vector<1> slope{std::sin(0.01 * k)};
    const double factor = k < 10000 ? 1.0 : 0.999;
    doubles.add(slope, slow, factor);
    floats.add(slope, slow, factor);
  }
  const detail::ErrorWidening<1, 1> by_doubles(doubles, {0.0}, 1.0);
  const detail::ErrorWidening<1, 1, float> by_floats(floats, {0.0}, 1.0);
  const double expected = by_doubles.root({{{1.0}}})[0][0];
  CHECK(expected > 2.0);
  // Ten thousand roundings of 6e-8.
  CHECK_NEAR(by_floats.root({{{1.0}}})[0][0] / expected, 1.0, 1e-4);
}

TEST("arbitrary samples leave it sound") {
  fuzz(estimator_of(), 1, 40000);
  fuzz(estimator_of(0x7f), 2, 20000);
  ViscoelasticContact::Settings settings{.scale = probing};
  settings.forgetting = {.initial_factor = 0.99, .rate = 0.0};
  fuzz(ViscoelasticContact(settings), 3, 20000);
  fuzz(WithOutlierRejection<WithChangeDetector<ViscoelasticContact>>{}, 4, 20000);
}

TEST("settings that cannot be are named") {
  CHECK(validate(ViscoelasticSettings{.offered = 0}) != nullptr);
  CHECK(validate(ViscoelasticSettings{.offered = 0x80}) != nullptr);
  CHECK(validate(ViscoelasticSettings{.exponent = 4.0}) != nullptr);
  CHECK(validate(ViscoelasticSettings{.offset_deviation = -1.0}) != nullptr);
  CHECK(validate(ViscoelasticSettings{.sample_time = 0.0}) != nullptr);
  CHECK(validate(ViscoelasticSettings{.longest_time = 3e-3}) != nullptr);
  CHECK(validate(ViscoelasticSettings{}) == nullptr);
}
