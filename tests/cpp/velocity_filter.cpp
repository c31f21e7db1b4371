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

}  // namespace

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
