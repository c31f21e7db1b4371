// The filter gives the slope of a parabola through its window, at the window's middle, and the
// measured position and force of that instant; or it says why it gives nothing.
#include <cmath>
#include <cstddef>
#include <vector>

#include "check.hpp"
#include "estimators.hpp"
#include "palpate/online_preparation.hpp"
#include "random_numbers.hpp"

using namespace palpate;

namespace {

struct Measured {
  double dt;
  double position;
  double force;
};

// A probe's motion with a micrometre of noise; `jitter` is that of the clock's steps, as a
// fraction.
std::vector<Measured> motion(std::size_t samples, double jitter, std::uint64_t seed) {
  RandomNumbers random(seed);
  std::vector<Measured> measured;
  double t = 0.0;
  for (std::size_t k = 0; k < samples; ++k) {
    const double dt = jitter > 0.0 ? 1e-3 * (1.0 + random.between(-jitter, jitter)) : 1e-3;
    t += dt;
    const double x = 10e-3 + 1e-3 * std::sin(4.0 * t) + 1.8e-3 * std::sin(11.0 * t) +
                     1.8e-3 * std::sin(15.0 * t) + random.between(-1e-6, 1e-6);
    measured.push_back({dt, x, 2000.0 * x});
  }
  return measured;
}

// The slope at sample `middle` of the parabola through `half` samples on each side, by the normal
// equations in long double.
double direct_slope(const std::vector<Measured>& measured, std::size_t middle, std::size_t half) {
  long double m[3][4] = {};
  long double t = 0.0L;
  for (std::size_t k = 1; k <= half; ++k) t -= measured[middle - k + 1].dt;
  for (std::size_t i = middle - half; i <= middle + half; ++i) {
    if (i > middle - half) t += measured[i].dt;
    const long double s = 1e3L * t, row[4] = {1.0L, s, s * s, measured[i].position};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) m[r][c] += row[r] * row[c];
    }
  }
  for (int pivot = 0; pivot < 3; ++pivot) {
    for (int r = 0; r < 3; ++r) {
      if (r == pivot) continue;
      const long double factor = m[r][pivot] / m[pivot][pivot];
      for (int c = 0; c < 4; ++c) m[r][c] -= factor * m[pivot][c];
    }
  }
  return static_cast<double>(1e3L * m[1][3] / m[1][1]);
}

template <class Filter>
void check_against_direct_fit(const VelocityFilterSettings& settings, double jitter) {
  const auto measured = motion(500, jitter, 1);
  const std::size_t half = settings.samples / 2;
  const std::size_t lag = half + (settings.lost_positions ? 2 : 0);
  Filter filter(settings);
  for (std::size_t k = 0; k < measured.size(); ++k) {
    const Status status = filter.update(measured[k].position, measured[k].force, measured[k].dt);
    if (k < half + lag) {
      CHECK(status == Status::waiting);
      continue;
    }
    CHECK(status == Status::updated);
    const std::size_t middle = k - lag;
    const FilteredSample given = filter.sample();
    CHECK(given.penetration == measured[middle].position);
    CHECK(given.force == measured[middle].force);
    CHECK(given.dt == (k == half + lag ? settings.sample_time : measured[middle].dt));
    double age = 0.0;
    for (std::size_t i = middle + 1; i <= k; ++i) age += measured[i].dt;
    CHECK_NEAR(given.age, age, 1e-15);
    // A position of 14 mm is rounded at 2e-18 m, and its slope over a step of a millisecond at
    // 2e-15 m/s; a window sums up to 255 of them.
    CHECK_NEAR(given.velocity, direct_slope(measured, middle, half), 1e-13);
  }
}

}  // namespace

TEST("on an even clock the velocity is the slope of a direct fit, half a window ago") {
  check_against_direct_fit<VelocityFilter<>>({}, 0.0);
  check_against_direct_fit<VelocityFilter<>>({.lost_positions = false}, 0.0);
  check_against_direct_fit<VelocityFilter<3>>({.samples = 3}, 0.0);
  check_against_direct_fit<VelocityFilter<31>>({.samples = 31}, 0.0);
}

TEST("on an uneven clock too") {
  check_against_direct_fit<VelocityFilter<>>({}, 0.3);
  check_against_direct_fit<VelocityFilter<>>({.lost_positions = false}, 0.9);
  check_against_direct_fit<VelocityFilter<255>>({.samples = 255}, 0.3);
}

TEST("the even clock's weights are those of the general fit") {
  // A nominal time that no step is makes every window a general one.
  VelocityFilter<> even, general({.sample_time = 0.999e-3});
  for (const Measured& m : motion(300, 0.0, 2)) {
    const Status status = even.update(m.position, m.force, m.dt);
    CHECK(status == general.update(m.position, m.force, m.dt));
    if (status == Status::updated) {
      CHECK_NEAR(even.sample().velocity, general.sample().velocity, 1e-14);
    }
  }
}

TEST("a lost position is left out of every window, and is not given") {
  auto measured = motion(300, 0.0, 3);
  auto kept = measured;
  for (const std::size_t lost : {250, 160, 155}) {
    measured[lost].position = 0.0;
    kept[lost + 1].dt += kept[lost].dt;
    kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(lost));
  }
  VelocityFilter<> filter, without({.lost_positions = false});
  std::vector<FilteredSample> given, expected;
  int rejected = 0;
  for (const Measured& m : measured) {
    const Status status = filter.update(m.position, m.force, m.dt);
    if (status == Status::updated) given.push_back(filter.sample());
    if (status == Status::rejected) ++rejected;
  }
  for (const Measured& m : kept) {
    const Status status = without.update(m.position, m.force, m.dt);
    if (status == Status::updated) expected.push_back(without.sample());
  }
  CHECK(rejected == 3);
  CHECK(given.size() + 2 == expected.size());
  for (std::size_t k = 0; k < given.size(); ++k) {
    CHECK(given[k].penetration == expected[k].penetration);
    CHECK(given[k].velocity == expected[k].velocity);
    CHECK(given[k].dt == expected[k].dt);
  }
}

TEST("neither noise nor a shaking lever is a lost position") {
  RandomNumbers random(7);
  VelocityFilter<> noisy, shaking;
  for (int k = 0; k < 20000; ++k) {
    CHECK(noisy.update(10e-3 + random.between(-1e-3, 1e-3), 1.0) != Status::rejected);
    // 3 mm at 150 Hz for a tenth of a second, in a motion of 11 rad/s.
    const double t = 1e-3 * k, slow = 10e-3 + 2e-3 * std::sin(11.0 * t);
    const double quick = k >= 9000 && k < 9100 ? 3e-3 * std::sin(942.0 * t) : 0.0;
    CHECK(shaking.update(slow + quick, 1.0) != Status::rejected);
  }
}

TEST("a position that was none at the start does not hide lost ones for ever") {
  VelocityFilter<> filter;
  for (int k = 0; k < 2; ++k) filter.update(1e3, 1.0);
  const auto measured = motion(3000, 0.0, 8);
  for (const Measured& m : measured) filter.update(m.position, m.force);
  filter.update(0.0, 1.0);
  filter.update(measured.back().position, 1.0);
  CHECK(filter.update(measured.back().position, 1.0) == Status::rejected);
}

TEST("a refused sample leaves its time behind and nothing else") {
  auto measured = motion(220, 0.0, 4);
  VelocityFilter<> filter, skipping;
  for (std::size_t k = 0; k < measured.size(); ++k) {
    const Measured& m = measured[k];
    if (k % 50 == 49) {
      CHECK(filter.update(std::nan(""), m.force, m.dt) == Status::not_finite);
      CHECK(filter.update(m.position, m.force, 0.0) == Status::invalid_step);
      CHECK(filter.update(m.position, m.force, -1.0) == Status::invalid_step);
      CHECK(filter.update(m.position, m.force, std::nan("")) == Status::invalid_step);
      CHECK(filter.update(1e101, m.force, 1e-5) == Status::out_of_range);
      measured[k + 1].dt += m.dt + 1e-5;
      continue;
    }
    // The time of what was refused has passed; it is added in another order.
    const bool after = k % 50 == 0 && k > 0;
    CHECK(filter.update(m.position, m.force, after ? 1e-3 : m.dt) ==
          skipping.update(m.position, m.force, m.dt));
    CHECK_NEAR(filter.sample().velocity, skipping.sample().velocity, 1e-14);
  }
}

TEST("a window holds no gap, and says where it starts anew") {
  VelocityFilter<> filter;
  const auto measured = motion(100, 0.0, 5);
  for (const Measured& m : measured) filter.update(m.position, m.force);
  const double age = filter.sample().age;
  CHECK(filter.update(0.02, 1.0, 15e-3) == Status::updated);  // as long as the window
  filter.reset();
  for (const Measured& m : measured) filter.update(m.position, m.force);
  CHECK(filter.update(0.02, 1.0, 0.5) == Status::restarted);
  for (int k = 0; k < 15; ++k) CHECK(filter.update(0.02, 1.0) == Status::waiting);
  CHECK(filter.update(0.02, 1.0) == Status::updated);
  CHECK(filter.sample().velocity == 0.0);
  // From the one given before the gap to the middle of the first window after it.
  CHECK_NEAR(filter.sample().dt, age + 0.5 + 7e-3, 1e-15);
  filter.interrupt();
  CHECK(filter.update(0.02, 1.0) == Status::waiting);
}

TEST("samples that come less than half as often as they should give no flattened velocity") {
  VelocityFilter<> half, third, told({.sample_time = 3e-3});
  for (int k = 0; k < 40; ++k) {
    half.update(1e-4 * k, 1.0, 2e-3);
    CHECK(third.update(1e-4 * k, 1.0, 3e-3) == Status::waiting);
    told.update(1e-4 * k, 1.0);
  }
  CHECK_NEAR(half.sample().velocity, 0.05, 1e-14);
  CHECK_NEAR(told.sample().velocity, 0.1 / 3.0, 1e-14);
}

TEST("fuzzing with arbitrary bit patterns gives finite samples or none") {
  for (const bool lost_positions : {false, true}) {
    for (const double sample_time : {1e-100, 1e-3, 1e6}) {
      RandomNumbers random(6);
      VelocityFilter<7> filter(
          {.sample_time = sample_time, .samples = 7, .lost_positions = lost_positions});
      long given = 0;
      for (int k = 0; k < 200000; ++k) {
        const auto size = [&] { return std::pow(10.0, random.between(-110.0, 110.0)); };
        const bool wild = random.below(20) == 0;
        const double x = wild ? random.any() : random.below(2) ? size() : -size();
        const double force = wild ? random.any() : size();
        const std::uint64_t kind = random.below(40);
        const double dt = kind == 0   ? random.any()
                          : kind == 1 ? size()
                          : kind < 20 ? sample_time
                                      : sample_time * random.between(0.0, 2.0);
        const auto before = bytes_of(filter);
        const Status status = filter.update(x, force, dt);
        if (status == Status::invalid_step) CHECK(bytes_of(filter) == before);
        if (status != Status::updated) continue;
        ++given;
        const FilteredSample& sample = filter.sample();
        CHECK(detail::finite(sample));
        CHECK(std::isfinite(sample.dt) && sample.dt > 0.0);
        CHECK(std::isfinite(sample.age) && sample.age > 0.0);
      }
      CHECK(given > 1000);
    }
  }
}

TEST("settings that a filter cannot have are refused in words") {
  CHECK(validate(VelocityFilterSettings{}, 15) == nullptr);
  CHECK(validate(VelocityFilterSettings{.sample_time = 0.0}, 15) != nullptr);
  CHECK(validate(VelocityFilterSettings{.sample_time = std::nan("")}, 15) != nullptr);
  for (const std::uint32_t samples : {0U, 1U, 4U, 17U}) {
    CHECK(validate(VelocityFilterSettings{.samples = samples}, 15) != nullptr);
  }
  CHECK(validate(VelocityFilterSettings{.longest_gap = -1.0}, 15) != nullptr);
  CHECK(validate(OnlinePreparationSettings{}, 15) == nullptr);
  CHECK(validate(OnlinePreparationSettings{.surface = std::nan("")}, 15) != nullptr);
  CHECK(validate(OnlinePreparationSettings{.force_offset = 1e31}, 15) != nullptr);
  CHECK(validate(OnlinePreparationSettings{.tare_time = -1.0}, 15) != nullptr);
  CHECK(validate(OnlinePreparationSettings{.direction = {1.0, 1.0, 0.0}}, 15) != nullptr);
}

TEST("a preparation tares, projects, turns signs and counts from the surface") {
  OnlinePreparation<> preparation({.surface = 0.3,
                                   .force_offset = 1.0,
                                   .tare_time = 0.1,
                                   .flip_force = true,
                                   .direction = {0.6, 0.0, -0.8}});
  CHECK(std::isnan(preparation.tare()));
  Status status = Status::waiting;
  for (int k = 0; k < 200; ++k) {
    const double depth = k < 100 ? 0.29 : 0.29 + 1e-4 * (k - 100);
    // −(0.6 f_x − 0.8 f_z) − 1 is 0.5 N in the first tenth of a second, then 2.5 N.
    status = preparation.update({0.6 * depth, 7.0, -0.8 * depth},
                                {k < 100 ? -2.5 : -2.5 - 2.0 / 0.6, 9.0, 0.0});
    if (k < 100) CHECK(status == Status::waiting);
  }
  CHECK(status == Status::updated);
  CHECK_NEAR(preparation.tare(), 0.5, 1e-12);
  const FilteredSample sample = preparation.sample();
  CHECK_NEAR(sample.penetration, -0.01 + 1e-4 * (199 - 9 - 100), 1e-15);
  CHECK_NEAR(sample.velocity, 0.1, 1e-12);
  CHECK_NEAR(sample.force, 2.0, 1e-12);
  CHECK_NEAR(preparation.time(), 0.190, 1e-15);
}

TEST("a clock that is set starts a new window, and one that repeats itself is refused") {
  OnlinePreparation<> preparation;
  double time = 1.7e9;
  for (int k = 0; k < 20; ++k) preparation.update_at(0.01, 1.0, time += 1.0 / 1024.0);
  CHECK(preparation.status() == Status::updated);
  CHECK(preparation.time() == time - 9.0 / 1024.0);
  CHECK(preparation.update_at(0.01, 1.0, time) == Status::invalid_step);
  CHECK(preparation.update_at(0.01, 1.0, time - 1.0 / 1024.0) == Status::invalid_step);
  CHECK(preparation.update_at(0.01, 1.0, std::nan("")) == Status::invalid_step);
  CHECK(preparation.update_at(0.01, 1.0, time += 1.0 / 1024.0) == Status::updated);
  for (const double set : {5.0, 1.7e9, -3.0}) {
    CHECK(preparation.update_at(0.01, 1.0, set) == Status::restarted);
    for (int k = 1; k < 16; ++k) preparation.update_at(0.01, 1.0, set + k / 1024.0);
    CHECK(preparation.update_at(0.01, 1.0, set + 16.0 / 1024.0) == Status::updated);
    CHECK(preparation.time() == set + 7.0 / 1024.0);
  }
}
