// The rules that a change is detected by, each by itself.
#include <cmath>

#include "check.hpp"
#include "palpate/change_tests.hpp"
#include "random_numbers.hpp"

using namespace palpate::detail;

TEST("ground is known where an earlier stroke was as deep and as fast") {
  KnownGround ground;
  int known = 0;
  const auto stroke = [&](double from, double to, double velocity) {
    known = 0;
    for (int k = 0; k < 100; ++k) {
      known += ground.visit(from + (to - from) * (k + 0.5) / 100.0, velocity);
    }
  };
  stroke(1.0, 2.0, 1.0);
  CHECK(known == 0);
  stroke(2.0, 1.0, -1.0);  // outward is another ground
  CHECK(known == 0);
  stroke(1.0, 2.0, 1.0);
  CHECK(known > 80);       // all but a few at the turn
  stroke(2.0, 1.0, -3.0);  // never so fast
  CHECK(known == 0);
  stroke(1.0, 4.0, 1.0);
  CHECK(known > 20 && known < 40);  // a third of it is no deeper than before
  ground.forget();
  stroke(4.0, 1.0, -1.0);
  CHECK(known == 0);
}

TEST("a probe that rests knows its ground after a thousand samples") {
  KnownGround ground;
  for (int k = 0; k < 100; ++k) ground.visit(1.0 + 0.01 * k, 1.0);
  int known = 0;
  for (int k = 0; k < 1100; ++k) {
    const bool now = ground.visit(1.99 + 1e-3 * std::sin(k), 0.01 * std::sin(k));
    if (k < 900) CHECK(!now);
    known += now;
  }
  CHECK(known > 90);
}

TEST("whitening leaves of correlated errors the white ones that they were made of") {
  RandomNumbers random(3);
  Autoregression correlation;
  double error = 0.0, off = 0.0, power = 0.0;
  for (int k = 0; k < 20000; ++k) {
    const double fresh = random.between(-1.0, 1.0);
    error = 0.9 * error + fresh;
    const double white = correlation.whiten({0.0, 0.0, 0.0, error})[error_at];
    if (k < 10000) continue;
    off += (white - fresh) * (white - fresh);
    power += fresh * fresh;
  }
  // Of four coefficients known from 4000 errors: 4/4000.
  CHECK(off < 5e-3 * power);
}

TEST("white errors stay as they are, and a pause in them takes four to be bridged") {
  RandomNumbers random(4);
  Autoregression correlation;
  for (int k = 0; k < 8000; ++k) {
    const double error = random.between(-1.0, 1.0);
    const double white = correlation.whiten({error, 0.0, 0.0, error})[error_at];
    if (k > 4000) CHECK(white == error);
  }
  correlation.interrupt();
  for (int k = 0; k < 5; ++k) {
    CHECK(!correlation.knows_past());
    correlation.whiten({0.0, 0.0, 0.0, 0.1});
  }
  CHECK(correlation.knows_past());
}

TEST("noise that has grown is no evidence of a change, a force that has is") {
  RandomNumbers random(5);
  const auto evidence = [&](double noise, double change, int samples) {
    Evidence sums;
    for (int k = 0; k < samples; ++k) {
      const double force = 10.0 + std::sin(0.1 * k), by_speed = force * std::cos(0.1 * k);
      sums.add(
          {force, by_speed, force * force, change * force + noise * random.between(-1.0, 1.0)});
    }
    return sums.of_change(0.01 / 3.0);  // of `noise` 0.1
  };
  double mean = 0.0;
  for (int k = 0; k < 100; ++k) mean += evidence(10.0, 0.0, 64) / 100.0;
  CHECK(mean > 2.0 && mean < 4.0);  // χ² with three degrees of freedom
  CHECK(evidence(0.1, 0.05, 64) > 200.0);
  CHECK(evidence(0.1, 0.05, 3) == 0.0);  // three numbers explain three errors
  CHECK(evidence(0.1, 1e200, 64) == 0.0);
}

TEST("a change in correlated errors is explained from its first sample on, a burst is not") {
  RandomNumbers random(6);
  Autoregression correlation;
  double noise = 0.0;
  const auto learn = [&](int samples, double change, double scale) {
    for (int k = 0; k < samples; ++k) {
      noise = 0.95 * noise + scale * random.between(-1.0, 1.0);
      correlation.whiten({10.0, 1.0, 0.1, noise + change * 10.0});
    }
  };
  constexpr double variance = 1.0 / 3.0;
  learn(8000, 0.0, 1.0);
  CHECK(correlation.of_change(20, variance, true) < 20.0);
  learn(12, 0.0, 6.0);
  CHECK(correlation.of_change(12, variance, true) < 20.0);
  learn(100, 0.0, 1.0);
  learn(8, 1.5, 1.0);
  CHECK(correlation.of_change(8, variance, true) > 20.0);
  CHECK(correlation.of_change(200, variance, true) < 20.0);  // it came later
}

TEST("a small change is found in a block though it has shown in the shorter ones") {
  RandomNumbers random(7);
  ScoreBlocks blocks;
  std::size_t found = 0;
  const auto feed = [&](int samples, double change, bool withheld) {
    for (int k = 0; k < samples && found == 0; ++k) {
      const double force = 10.0 + std::sin(0.02 * k);
      found = blocks.add(
          {force, std::cos(0.02 * k), force * force, change * force + random.between(-1.0, 1.0)},
          1.0 / 3.0, withheld);
    }
  };
  feed(1024, 0.0, true);
  feed(7168, 0.0, false);
  CHECK(found == 0);
  feed(2048, 0.012, false);
  CHECK(found >= 256);
}

TEST("a cumulative sum alarms beyond thrice what it came back from") {
  const auto run = [](CumulativeSum& sum, double square, int samples, bool withheld = false) {
    bool alarm = false;
    for (int k = 0; k < samples; ++k) alarm = sum.add(square, 0.0, 4.0, 60.0, withheld) || alarm;
    return alarm;
  };
  CumulativeSum fresh;
  fresh.set_variance(1.0, 1e-300);
  CHECK(!run(fresh, 100.0, 2));  // 21 a sample: two outliers are none
  CHECK(run(fresh, 100.0, 1));
  CumulativeSum used;
  used.set_variance(1.0, 1e-300);
  CHECK(!run(used, 100.0, 10, true));  // 210, while nothing alarms
  run(used, 0.0, 100);
  CHECK(used.zero());
  CHECK(!run(used, 100.0, 30));
  CHECK(run(used, 100.0, 1));
}

TEST("the variance of a cumulative sum follows errors and hardly follows a change") {
  CumulativeSum sum;
  sum.set_variance(4.0, 1e-300);
  for (int k = 0; k < 20000; ++k) sum.learn(1.0, 5e-4);
  CHECK_NEAR(sum.variance(), 1.0, 1e-3);
  for (int k = 0; k < 80; ++k) sum.learn(1e6, 5e-4);
  CHECK(sum.variance() < 1.5);
}
