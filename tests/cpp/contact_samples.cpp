// Which samples count as contact, what free air says, and sums that samples are taken out of.
#include "palpate/projection/contact_samples.hpp"

#include <cmath>
#include <cstddef>

#include "check.hpp"
#include "palpate/palpate.hpp"
#include "random_numbers.hpp"

using namespace palpate;
using detail::ContactSamples;
using detail::Role;

namespace {

double normal(RandomNumbers& random) {
  double sum = -6.0;
  for (int k = 0; k < 12; ++k) sum += random.between(0.0, 1.0);
  return sum;
}

}  // namespace

TEST("a sample's own force does not decide whether it counts") {
  for (const double own : {-50.0, 0.0, 50.0}) {
    ContactSamples recent;
    RandomNumbers random(3);
    for (int k = 0; k < 40; ++k) {
      const double force = k == 30 ? own : 1.0 + 0.05 * normal(random);
      recent.push({1e-3, 0.0, force}, Role::sure, false);
      if (k == 38) CHECK(recent.pressed(8, 0.0));
    }
  }
}

TEST("neighbours in free air on either side leave a sample in doubt") {
  ContactSamples recent;
  RandomNumbers random(4);
  for (int k = 0; k < 60; ++k) {
    const double force = (k < 30 ? 0.0 : 1.0) + 0.05 * normal(random);
    recent.push({1e-3, 0.0, force}, Role::sure, false);
    if (k == 37) CHECK(!recent.pressed(8, 0.0));  // of sample 29: free before, pressed after
    if (k == 30) CHECK(!recent.pressed(0, 0.0));
    if (k == 50) CHECK(recent.pressed(8, 0.0));
    if (k == 50) CHECK(!recent.pressed(8, 1.0));  // where free air shows 1 N
  }
}

TEST("what is withdrawn is no neighbour") {
  ContactSamples recent;
  for (int k = 0; k < 20; ++k) recent.push({1e-3, 0.0, 1.0 + 0.01 * (k % 3)}, Role::sure, false);
  for (int k = 0; k < 3; ++k) recent.push({1e-3, 0.0, -90.0}, Role::sure, false);
  CHECK(!recent.pressed(0, 0.0));
  for (std::size_t age = 0; age < 3; ++age) recent.withdraw(age);
  CHECK(recent.pressed(0, 0.0));
}

TEST("free air counts after ten samples clear of the surface") {
  detail::FreeAir air;
  for (int k = 0; k < 1000; ++k) air.add(-0.01, 3.0, 1.0);
  CHECK(!air.known());
  for (int k = 0; k < 19; ++k) air.add(-0.1, 3.0, 1.0);
  CHECK(!air.known());
  air.add(-0.1, 3.0, 1.0);
  CHECK(air.known());
  CHECK(air.mean() == 3.0);
}

TEST("free air is not known better than coarse steps and correlation let it be") {
  detail::FreeAir fine, coarse, slow;
  RandomNumbers random(5);
  double memory = 0.0;
  for (int k = 0; k < 10010; ++k) {
    const double noise = 0.05 * normal(random);
    memory = 0.9 * memory + std::sqrt(1.0 - 0.81) * noise;
    fine.add(-1.0, noise, 1.0);
    coarse.add(-1.0, 0.125 * std::round((0.03 + noise) / 0.125), 1.0);
    slow.add(-1.0, memory, 1.0);
  }
  const double white = 0.05 / 100.0;
  CHECK(std::abs(fine.prior(1e-9).deviation / white - 1.0) < 0.1);
  // (Δ/π) exp(−2π²σ²/Δ²) is 1.7 mN; √((1 + r)/(1 − r)) at 0.9 is 4.4. A few blocks tell it to a
  // third, which Student's quantile allows for.
  CHECK(std::abs(coarse.prior(0.125).deviation / 1.8e-3 - 1.0) < 0.2);
  CHECK(fine.inflation() == 1.0);
  CHECK(slow.prior(1e-9).deviation > 0.85 * 4.36 * white);
  CHECK(slow.prior(1e-9).deviation < 1.6 * 4.36 * white);
}

TEST("noise of a low-pass filter is not taken for one that decays as its neighbours do") {
  detail::FreeAir air;
  RandomNumbers random(6);
  // Poles 0.9 twice: r = 2φ/(1 + φ²) = 0.994, of which (1 + r)/(1 − r) is 361. At rest the spectrum
  // is (1 − φ²)³/((1 + φ²)(1 − φ)⁴) = 37.9 times that of white noise.
  double first = 0.0, second = 0.0;
  for (int k = 0; k < 20010; ++k) {
    first = 0.9 * first + normal(random);
    second = 0.9 * second + first;
    air.add(-1.0, second, 1.0);
  }
  CHECK(air.inflation() > 0.4 * 37.9 && air.inflation() < 2.5 * 37.9);
}

TEST("two levels alone leave a coarse sensor's mean as open as their shares do") {
  const double step = 0.125;
  detail::FreeAir air;
  RandomNumbers random(8);
  // σ = Δ/5 at 0.4 Δ: a third of the samples on the upper level, 0.09 Δ off, and the variance of
  // noise three times as large, which would hide that.
  for (int k = 0; k < 10010; ++k) {
    air.add(-1.0, step * (7.0 + std::round(0.4 + 0.2 * normal(random))), 1.0);
  }
  const double off = air.mean() - 7.4 * step;
  CHECK(std::abs(off) > 0.05 * step);
  CHECK(air.prior(step).deviation > 0.5 * std::abs(off));
  CHECK(air.prior(step).deviation < 0.2 * step);
}

TEST("in correlated noise neighbours have to show more than its deviation") {
  ContactSamples recent;
  RandomNumbers random(9);
  for (int k = 0; k < 40; ++k)
    recent.push({1e-3, 0.0, 0.1 + 0.01 * normal(random)}, Role::sure, false);
  CHECK(recent.pressed(8, 0.0));
  recent.set_correlated(0.05 * 0.05, 100.0);  // three of 0.05 from neighbours that are as one
  CHECK(!recent.pressed(8, 0.0));
  CHECK(recent.pressed(8, -0.1));
  recent.set_correlated(0.05 * 0.05, 1.0);
  CHECK(recent.pressed(8, 0.0));
}

TEST("a force that rises smoothly is not taken for a rounded one") {
  for (const double start : {0.0, 0.7, 1.6, 2.5}) {  // its slope rises, falls, and turns
    ContactSamples smooth, rounded;
    for (int k = 0; k < 400; ++k) {
      const double force = 2.0 + std::sin(start + 2e-3 * k);
      smooth.push({1e-3, 0.0, force}, Role::sure, false);
      CHECK(smooth.resolution() == 0.0);
      rounded.push({1e-3, 0.0, 0.01 * std::round(force / 0.01)}, Role::sure, false);
    }
    CHECK(std::abs(rounded.resolution() - 0.01) < 1e-9);
  }
}

TEST("the mean error of rounding is that of many noisy readings") {
  RandomNumbers random(3);
  for (const double deviation : {0.125, 0.2, 0.3}) {
    for (const double force : {-0.4, 0.1, 0.25, 0.45, 1.3}) {
      double sum = 0.0;
      constexpr int count = 20000;
      for (int k = 0; k < count; ++k) sum += std::round(force + deviation * normal(random));
      const double mean = sum / count;
      const double error = detail::ForceRounding::mean_error(force, deviation * deviation);
      CHECK(std::abs(force - mean - error) < 0.02);
    }
  }
  CHECK(detail::ForceRounding::mean_error(0.25, 0.2) == 0.0);
}

TEST("withdrawn samples change nothing in the end") {
  auto solver = detail::ContactSolver(ProjectionSettings{});
  auto clean = detail::ContactSolver(ProjectionSettings{});
  RandomNumbers random(7);
  const detail::ProjectionSolution none{};
  for (int k = 0; k < 3000; ++k) {
    const double t = 1e-3 * k, x = 0.6 + 0.3 * std::sin(4.0 * t), w = std::cos(4.0 * t);
    const Sample sample{x, w, x * (1.0 + 0.2 * w) + 0.01 * normal(random)};
    clean.add(sample, 1.0, 0.0, none);
    solver.add(sample, 1.0, 0.0, none);
    if (k % 700 != 699) continue;
    for (int bad = 0; bad < 5; ++bad) solver.add({x, w, 0.4}, 1.0, 0.0, none);
    solver.withdraw(5);
  }
  const auto one = solver.solve(), other = clean.solve();
  CHECK(std::abs(one.n - other.n) < 1e-9);
  CHECK(std::abs(one.k - other.k) < 1e-9);
}
