// One table of every estimator, its defaults, and the motion that the paper probes with.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "palpate/palpate.hpp"

namespace palpate {

// Calls test.operator()<Estimator>() with each of the paper's methods.
template <class Test>
void for_each_estimator(Test&& test) {
  test.template operator()<KelvinVoigtRLS>();
  test.template operator()<ExtendedKelvinVoigtRLS>();
  test.template operator()<SingleStageRLS>();
  test.template operator()<DoubleStageRLS>();
}

// The same with every estimator, bare, with a change detector and with a rejection of outliers too.
template <class Test>
void for_every_estimator(Test&& test) {
  const auto all = [&]<class Estimator>() {
    test.template operator()<Estimator>();
    test.template operator()<WithChangeDetector<Estimator>>();
    test.template operator()<WithOutlierRejection<WithChangeDetector<Estimator>>>();
  };
  for_each_estimator(all);
  all.template operator()<VariableProjection>();
  all.template operator()<VariableProjectionWithSurface>();
  all.template operator()<DriftTracking>();
}

// A material for each law, near the paper's ball.
template <class Law>
inline constexpr Law ball{};
template <>
inline constexpr KelvinVoigt ball<KelvinVoigt>{.K = 2000.0, .B = 20.0};
template <>
inline constexpr ExtendedKelvinVoigt ball<ExtendedKelvinVoigt>{.K1 = 1000.0, .K2 = 5e4, .B = 20.0};
template <>
inline constexpr HuntCrossley ball<HuntCrossley>{.K = 2000.0, .B = 2000.0, .n = 1.0};

// The paper's motion: 10 mm deep on average, three sines, at most 50.8 mm/s. `t` in seconds.
template <class Law>
Sample probed(const Law& law, double t) noexcept {
  const double x =
      10e-3 + 1e-3 * std::sin(4.0 * t) + 1.8e-3 * std::sin(11.0 * t) + 1.8e-3 * std::sin(15.0 * t);
  const double v =
      4e-3 * std::cos(4.0 * t) + 19.8e-3 * std::cos(11.0 * t) + 27e-3 * std::cos(15.0 * t);
  return {x, v, law.force(x, v)};
}

template <class Estimator>
Status update(Estimator& estimator, const Sample& s) noexcept {
  return estimator.update(s.penetration, s.velocity, s.force);
}

// `seconds` of probing at 1 kHz.
template <class Estimator, class Law>
void probe(Estimator& estimator, const Law& law, double seconds) noexcept {
  const int count = static_cast<int>(seconds * 1e3);
  for (int k = 0; k < count; ++k) update(estimator, probed(law, 1e-3 * k));
}

template <class T>
std::array<unsigned char, sizeof(T)> bytes_of(const T& value) noexcept {
  std::array<unsigned char, sizeof(T)> bytes{};
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

}  // namespace palpate
