// Whole curves: the law of clean data, the choice of samples, any floats, and no byte of memory
// more.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "check.hpp"
#include "estimators.hpp"
#include "palpate/curves/curve_fit.hpp"
#include "palpate/estimators.hpp"
#include "random_numbers.hpp"

using namespace palpate;

namespace {

constexpr std::size_t samples = 600;

struct Curve {
  std::array<double, samples> x, v, f;

  CurveArrays arrays() const noexcept { return {x.data(), v.data(), f.data(), samples}; }
};

// Two sines that leave contact, over a material that begins at `surface`.
Curve palpation(const HuntCrossley& law, double surface, double offset) {
  Curve curve{};
  for (std::size_t i = 0; i < samples; ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(samples);
    const double slow = 6.0 * std::numbers::pi, fast = 14.6 * std::numbers::pi;
    const double x = 4e-3 + 4e-3 * std::sin(slow * t) + 2.5e-3 * std::sin(fast * t);
    curve.x[i] = x + surface;
    curve.v[i] = 0.1 * (4e-3 * slow * std::cos(slow * t) + 2.5e-3 * fast * std::cos(fast * t));
    curve.f[i] = law.force(x, curve.v[i]) + offset;
  }
  return curve;
}

// Going in, slower with depth, from free air on.
Curve one_way(const HuntCrossley& law) {
  Curve curve{};
  for (std::size_t i = 0; i < samples; ++i) {
    const double fall = std::exp(-3.0 * static_cast<double>(i) / static_cast<double>(samples));
    curve.x[i] = 1.35 * (1.0 - fall) - 0.3;
    curve.v[i] = fall;
    curve.f[i] = law.force(curve.x[i], fall);
  }
  return curve;
}

struct Fitted {
  CurveFit fit;
  std::vector<std::uint8_t> roles;
};

Fitted fitted(const CurveArrays& arrays, const CurveSettings& settings) {
  std::vector<double> memory(curve_memory(arrays.count));
  std::vector<std::uint8_t> roles(arrays.count);
  const CurveFit fit = fit_curve(arrays, settings, memory.data(), roles.data());
  return {fit, roles};
}

}  // namespace

TEST("the law of a clean curve comes out, with the surface known and without") {
  const HuntCrossley law{800.0, 900.0, 1.4};
  for (const bool find : {false, true}) {
    const double surface = find ? 0.7e-3 : 0.0;
    CurveSettings settings;
    settings.find_surface = find;
    const CurveFit fit = fitted(palpation(law, surface, 0.02).arrays(), settings).fit;
    CHECK(fit.status == CurveStatus::fitted);
    CHECK_NEAR(fit.parameters[0], law.stiffness, 1e-2 * law.stiffness);
    CHECK_NEAR(fit.parameters[1], law.damping, 1e-2 * law.damping);
    CHECK_NEAR(fit.parameters[2], law.exponent, 1e-3);
    CHECK_NEAR(fit.parameters[3], 0.02, 1e-3);
    CHECK_NEAR(fit.parameters[4], surface, 1e-5);
  }
}

TEST("samples are firm, light or free as their neighbours say, and NaN is none of these") {
  Curve curve = palpation({800.0, 900.0, 1.4}, 0.0, 0.0);
  curve.f[5] = NAN;
  const Fitted found = fitted(curve.arrays(), {});
  std::size_t firm = 0, light = 0;
  for (std::size_t i = 0; i < samples; ++i) {
    const auto role = static_cast<CurveRole>(found.roles[i]);
    firm += role == CurveRole::firm ? 1 : 0;
    light += role == CurveRole::light ? 1 : 0;
    CHECK((role == CurveRole::absent) == (i == 5));
    if (i != 5) CHECK((role == CurveRole::free) == (curve.x[i] <= 0.0));
  }
  CHECK(firm > samples / 2);
  CHECK(found.fit.taken == firm + light);
}

TEST("the choice of samples is that of variable projection") {
  RandomNumbers random(3);
  for (int round = 0; round < 20; ++round) {
    Curve curve = palpation({800.0, 900.0, 1.4}, 0.0, 0.05);
    for (double& force : curve.f) force += random.between(-0.1, 0.1);
    const Scale scale = detail::suggested_scale(curve.arrays());
    const Units units(scale);
    std::vector<double> memory(curve_memory(samples));
    detail::CurveSelection selection({memory.data(), samples});
    selection.choose(curve.arrays(), units, 1e8);
    detail::ContactSolver solver{detail::ContactSolver::Settings{}};
    solver.gate({}, units);
    for (std::size_t i = 0; i < samples; ++i) {
      const Sample s = detail::scaled({curve.x[i], curve.v[i], curve.f[i]}, units);
      // A law that never pulls: what is not firm is light.
      detail::ProjectionSolution law{};
      law.k = 1.0;
      if (curve.x[i] > 0.0) {
        solver.add(s, 1.0, law);
      } else {
        solver.free(s, 1.0);
      }
    }
    const detail::ProjectionSolution answer = solver.solve();
    CHECK_NEAR(answer.prior_mean, selection.air().mean(), 1e-12);
    const std::size_t chosen =
        selection.count(detail::Role::sure) + selection.count(detail::Role::light);
    CHECK_NEAR(solver.weight(), static_cast<double>(chosen), 1e-9);
  }
}

TEST("any floats give a finite answer or none") {
  RandomNumbers random(7);
  for (int round = 0; round < 400; ++round) {
    std::array<double, 70> x, v, f;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const bool wild = round % 2 == 0 && i % 5 == 0;
      x[i] = wild ? random.any() : random.between(-0.01, 0.02);
      v[i] = wild ? random.any() : random.between(-0.1, 0.1);
      f[i] = wild ? random.any() : random.between(-1.0, 30.0);
    }
    CurveSettings settings;
    settings.find_surface = round % 3 == 0;
    settings.offset = round % 7 != 0;
    if (round % 5 == 0) {
      settings.exponent_fixed = true;
      settings.lowest_exponent = settings.highest_exponent = 1.5;
    }
    const CurveFit fit = fitted({x.data(), v.data(), f.data(), x.size()}, settings).fit;
    for (std::size_t i = 0; i < 5; ++i) {
      CHECK(std::isfinite(fit.parameters[i]));
      CHECK(fit.covariance[i][i] >= 0.0);
      for (std::size_t j = 0; j < 5; ++j) CHECK(std::isfinite(fit.covariance[i][j]));
    }
  }
}

TEST("a condensed curve has J and its slope at its point, and J beside it to a tenth of σ²") {
  constexpr double noise = 0.01, n = 0.9;
  RandomNumbers random(11);
  const Curve curve = one_way({1.0, 0.2, n});
  constexpr std::size_t size =
      detail::CurveSamples::padded(samples) + 2 * detail::CurveSamples::block;
  std::array<std::vector<double>, 10> columns;
  for (auto& column : columns) column.resize(size);
  const auto memory = [&](std::size_t i) {
    return detail::CurveSamples{columns[i].data(),     columns[i + 1].data(), columns[i + 2].data(),
                                columns[i + 3].data(), columns[i + 4].data(), 0};
  };
  detail::CurveSamples all = memory(0);
  all.count = samples;
  for (std::size_t i = 0; i < samples; ++i) {
    all.x[i] = curve.x[i];
    all.w[i] = curve.v[i];
    all.f[i] = curve.f[i] + noise * random.between(-1.7, 1.7);
  }
  all.pad();
  detail::CurveModel model{};
  model.kernels = &curves::kernels;
  model.lowest_surface = -0.2;
  model.highest_surface = 0.2;
  double squared = 0.0;
  for (std::size_t i = 0; i < samples; ++i) squared += all.f[i] * all.f[i];
  const detail::CurveData data{{all}, 1, squared};
  const detail::CurveCost whole(model, data);
  const detail::CurveMinimum best =
      detail::CurveDescent(whole).from({1.0, 0.2, n, 0.0, 0.01}, 40, 1e-8);
  const detail::CurveState centre = whole.at(best.at);
  const detail::CurveLine line(whole, centre);
  CHECK(line.sound);
  const detail::CondensedCurve few(model, data, centre, 5.0 * line.deviation[4], memory(5));
  const detail::CurveCost condensed(model, few.data());
  const std::size_t left = few.data().parts[0].count + few.data().parts[1].count;
  CHECK(left < samples / 2);
  CHECK_NEAR(few.data().count(), static_cast<double>(samples), 0.0);

  const detail::CurveState same = condensed.at(best.at);
  const double j = whole.value(centre, centre.variance);
  CHECK_NEAR(condensed.value(same, same.variance), j, 1e-12 * j);
  const double slope = whole.slope(centre).gradient[4];
  CHECK_NEAR(condensed.slope(same).gradient[4], slope, 1e-9 * squared);
  for (const double away : {-2.0, -1.0, -0.3, 0.3, 1.0, 2.0}) {
    const detail::CurvePoint there = line.from(best.at, away);
    const detail::CurveState exact = whole.at(there), quick = condensed.at(there);
    CHECK(whole.value(exact, exact.variance) > j);
    CHECK_NEAR(condensed.value(quick, quick.variance), whole.value(exact, exact.variance),
               0.1 * centre.variance);
  }
}

TEST("where J has a cusp at a sample its minimum is found there, and settles") {
  // n of a half: where the surface comes to a sample from above the slope is infinite.
  RandomNumbers random(5);
  std::size_t at_samples = 0;
  for (int round = 0; round < 20; ++round) {
    Curve curve = one_way({1.0, 0.2, 0.5});
    for (double& force : curve.f) force += 0.03 * random.between(-1.0, 1.0);
    CurveSettings settings;
    settings.find_surface = true;
    const CurveFit fit = fitted(curve.arrays(), settings).fit;
    CHECK(fit.status == CurveStatus::fitted);
    for (const double x : curve.x) at_samples += std::abs(fit.parameters[4] - x) < 1e-14 ? 1 : 0;
  }
  CHECK(at_samples > 0);
}
