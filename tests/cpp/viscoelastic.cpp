// Laws that may remember: interpolation, branches, least squares from sums, and what no data
// breaks.
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

template <class Estimator>
Estimator estimator_of(Offered offered) noexcept {
  return Estimator({.method = {.offered = offered}, .gate = gate, .scale = probing});
}

constexpr Offered everyday = (1U << everyday_candidates) - 1U;
constexpr Offered all = (1U << candidates.size()) - 1U;

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
std::vector<Sample> pressed(const GeneralisedHuntCrossley& law, std::size_t count, double noise) {
  const RelaxationBranches branches(law);
  std::vector<double> state(branches.count + 1, 0.0);
  RandomNumbers random(3);
  std::vector<Sample> samples;
  for (std::size_t k = 0; k < count; ++k) {
    Sample s = moved(1e-3 * static_cast<double>(k));
    relax(law, branches, s.penetration, 1e-3, state.data());
    s.force = relaxing_force(law, branches, s.penetration, s.velocity, state.data()) +
              noise * random.between(-1.0, 1.0);
    samples.push_back(s);
  }
  return samples;
}

GeneralisedHuntCrossley remembering(double time_shortest, double time_longest) noexcept {
  return {1e4, 1.5, 4e4, 1.5, 5e3, 0.0, time_shortest, time_longest};
}

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
static_assert(std::is_trivially_copyable_v<FullViscoelasticContact>);
static_assert(sizeof(ViscoelasticContact) <= 4608);
static_assert(sizeof(FullViscoelasticContact) <= 20000);

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
  Branches<FlatSums::Times> branches(1e-3);
  double t = 0.0;
  const double speed = 0.7;      // of ξ
  const std::size_t spring = 2;  // n = 1
  for (int k = 0; k < 400; ++k) {
    const double dt = random.between(1e-4, 5e-2);
    t += dt;
    branches.advance(speed * t, dt);
  }
  for (std::size_t i = 0; i < FlatSums::Times::count; ++i) {
    const double time = branches.times().time(static_cast<double>(i));
    const double expected = speed * time * -std::expm1(-t / time);
    CHECK_NEAR(branches.states()[i][spring] / expected, 1.0, 1e-11);
  }
}

TEST("a branch that decays ends near zero and not among the subnormal numbers") {
  Branches<PairSums::Times> branches(1e-3);
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

TEST("least squares from a singular matrix leaves out what says what others do") {
  Normal normal{};
  // Offset, spring, damping and memory: damping is twice the spring, and memory stands alone.
  normal.a = {
      {{1.0, 0.0, 0.0, 0.0}, {0.5, 1.0, 0.0, 0.0}, {1.0, 2.0, 4.0, 0.0}, {0.0, 0.0, 0.0, 3.0}}};
  normal.b = {0.5, 1.0, 2.0, 6.0};
  const Linear found = Factored(normal, 0b1111).solve(normal.b);
  CHECK(!has(found.fitted, damping) && has(found.fitted, memory));
  CHECK_NEAR(found.value[stiffness], 1.0, 1e-12);
  CHECK_NEAR(found.value[memory], 2.0, 1e-12);
  CHECK_NEAR(found.value[offset], 0.0, 1e-12);
}

TEST("each law is found where it is the truth, and no memory where there is none") {
  const std::array<std::pair<GeneralisedHuntCrossley, std::size_t>, 3> truths{{
      {{1e4, 1.5, 4e4, 1.5, 0.0, 0.0, 0.0, 0.0}, 1},
      {remembering(1e-3, 4.096), 3},
      {remembering(0.0, 0.05), 6},
  }};
  for (const auto& [law, expected] : truths) {
    auto quick = estimator_of<ViscoelasticContact>(everyday);
    auto full = estimator_of<FullViscoelasticContact>(all);
    for (const Sample& s : pressed(law, 4000, 0.1)) {
      quick.update(s.penetration, s.velocity, s.force);
      full.update(s.penetration, s.velocity, s.force);
    }
    quick.finish_pending();
    full.finish_pending();
    if (expected < everyday_candidates) {
      CHECK(quick.method().solver().solution().fit.candidate == expected);
    }
    if (expected != 3) CHECK(full.method().solver().solution().fit.candidate == expected);
    const double error = std::sqrt(full.estimate().covariance[1][1]);
    // Of a spectrum it holds where else that may end.
    CHECK(error < (expected == 3 ? 0.02 : 0.01));
    if (expected != 3) CHECK_NEAR(full.law().exponent, 1.5, 5.0 * error);
  }
}

TEST("what forgetting weighs the sums with is brought back before it is too large") {
  ViscoelasticContact::Settings settings{.gate = gate, .scale = probing};
  settings.forgetting = {.initial_factor = 0.9, .rate = 0.0};
  ViscoelasticContact estimator(settings);
  const auto samples = pressed({1e4, 1.5, 4e4, 1.5, 0.0, 0.0, 0.0, 0.0}, 4000, 0.0);
  for (const Sample& s : samples) estimator.update(s.penetration, s.velocity, s.force);
  // 1/(1 − λ) samples count.
  CHECK_NEAR(estimator.method().solver().samples().weight(), 10.0, 1e-6);
  const Sample& last = samples.back();
  CHECK_NEAR(estimator.predict(last.penetration, last.velocity) / last.force, 1.0, 0.05);
}

TEST("a replay is what update does, to the last bit") {
  const auto samples = pressed(remembering(1e-3, 4.096), 1500, 0.1);
  constexpr std::size_t size = GeneralisedHuntCrossley::size;
  std::vector<double> x, v, f, parameters(size * samples.size()), errors(parameters.size()),
      predicted(samples.size()), margins(samples.size());
  std::vector<std::uint8_t> status(samples.size());
  for (const Sample& s : samples) {
    x.push_back(s.penetration);
    v.push_back(s.velocity);
    f.push_back(s.force);
  }
  auto replayed = estimator_of<ViscoelasticContact>(everyday), updated = replayed;
  replay(replayed, {x.data(), v.data(), f.data(), nullptr, samples.size()},
         {parameters.data(), errors.data(), predicted.data(), margins.data(), status.data()});
  for (std::size_t k = 0; k < samples.size(); ++k) {
    double expected = 0.0;
    const Status done = updated.update(samples[k], 1e-3, expected);
    CHECK(status[k] == static_cast<std::uint8_t>(done) && predicted[k] == expected);
    CHECK(parameters[size * k] == updated.law().stiffness);
  }
}

TEST("a state that is stored and restored at any sample goes on to the last bit") {
  const auto samples = pressed(remembering(1e-3, 4.096), 1200, 0.1);
  auto kept = estimator_of<ViscoelasticContact>(everyday);
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
  auto never_stopped = estimator_of<ViscoelasticContact>(everyday);
  for (const Sample& s : samples) never_stopped.update(s.penetration, s.velocity, s.force);
  CHECK(never_stopped.estimate().covariance == kept.estimate().covariance);
  CHECK(never_stopped.method().solver().solution().known != 0);
}

TEST("steps of time from the least number to the largest, and inputs up to the limit, are borne") {
  constexpr double least = std::numeric_limits<double>::denorm_min();
  constexpr double most = std::numeric_limits<double>::max();
  auto estimator = estimator_of<FullViscoelasticContact>(all);
  const auto samples = pressed(remembering(1e-3, 4.096), 1500, 0.1);
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
  fuzz(estimator_of<ViscoelasticContact>(everyday), 1, 40000);
  fuzz(estimator_of<FullViscoelasticContact>(all), 2, 20000);
  ViscoelasticContact::Settings settings{.scale = probing};
  settings.forgetting = {.initial_factor = 0.99, .rate = 0.0};
  fuzz(ViscoelasticContact(settings), 3, 20000);
  fuzz(WithOutlierRejection<WithChangeDetector<ViscoelasticContact>>{}, 4, 20000);
}

TEST("settings that cannot be are named") {
  CHECK(validate(ViscoelasticSettings{.offered = 0}) != nullptr);
  CHECK(validate(ViscoelasticSettings{.offered = 0x800}) != nullptr);
  CHECK(validate(ViscoelasticSettings{.exponent = 4.0}) != nullptr);
  CHECK(validate(ViscoelasticSettings{.offset_deviation = -1.0}) != nullptr);
  CHECK(validate(ViscoelasticSettings{.sample_time = 0.0}) != nullptr);
  CHECK(validate(ViscoelasticSettings{}) == nullptr);
}
