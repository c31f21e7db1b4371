// Whole curves: any floats, no byte of memory more, and the minimum where J has kinks.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "check.hpp"
#include "palpate/batch_fit/curve_fit.hpp"
#include "random_numbers.hpp"

using namespace palpate;

namespace {

constexpr std::size_t samples = 600;

struct Curve {
  std::array<double, samples> x, v, f;

  CurveArrays arrays() const noexcept { return {x.data(), v.data(), f.data(), samples}; }
};

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

CurveFit fitted(const CurveArrays& arrays, const CurveSettings& settings) {
  std::vector<double> memory(curve_memory(arrays.count));
  std::vector<std::uint8_t> roles(arrays.count);
  return fit_curve(arrays, settings, memory.data(), roles.data());
}

}  // namespace

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
      settings.lowest_exponent = settings.highest_exponent = 1.5;
    }
    if (round % 4 == 1) {
      const double unit = std::pow(10.0, random.between(-30.0, 30.0));
      settings.scale = {unit, unit, unit};
    }
    const CurveFit fit = fitted({x.data(), v.data(), f.data(), x.size()}, settings);
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
    const CurveFit fit = fitted(curve.arrays(), settings);
    CHECK(fit.status == CurveStatus::fitted);
    for (const double x : curve.x) at_samples += std::abs(fit.parameters[4] - x) < 1e-14 ? 1 : 0;
  }
  CHECK(at_samples > 0);
}
