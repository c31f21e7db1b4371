// No sequence of numbers, of any length, makes an estimate or its covariance unsound.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <random>
#include <type_traits>

#include "check.hpp"
#include "estimators.hpp"
#include "random_numbers.hpp"
#include "soundness.hpp"

using namespace palpate;

namespace {

// Where arithmetic turns: limits of the type, of the estimators, and the everyday.
constexpr double corners[] = {0.0,
                              1.0,
                              1e-3,
                              1e-2,
                              20.0,
                              std::numeric_limits<double>::denorm_min(),
                              std::numeric_limits<double>::min(),
                              1e-200,
                              1e-100,
                              1e-30,
                              1e30,
                              1e40,
                              1e70,
                              0.999e100,
                              1e100,
                              1e150,
                              std::numeric_limits<double>::max(),
                              std::numeric_limits<double>::infinity(),
                              std::numeric_limits<double>::quiet_NaN()};

class Fuzz {
 public:
  explicit Fuzz(std::uint64_t seed) noexcept : random_(seed) {}

  struct Event {
    Sample sample;
    double dt;
  };

  // Each kind of sample lasts a while: a hold needs thousands of equal samples to wind P up.
  Event next() noexcept {
    if (left_-- == 0) {
      left_ = random_.below(2000);
      kind_ = random_.below(6);
      event_ = {
          {random_.between(1e-4, 0.02), random_.between(-0.1, 0.1), random_.between(0.1, 30.0)},
          1e-3};
    }
    switch (kind_) {
      case 0:  // any bits at all
        return {{random_.any(), random_.any(), random_.any()}, random_.any()};
      case 1:  // any bits, but as contact
        return {{std::abs(random_.any()), random_.any(), std::abs(random_.any())}, 1e-3};
      case 2:
        return {{corner(), random_.below(2) ? corner() : -corner(), corner()}, 1e-3};
      case 3:  // held
        return event_;
      case 4:  // a motion, with a strange sample now and then
        if (random_.below(20) == 0) event_.sample.force = std::abs(random_.any());
        event_.sample.velocity = random_.between(-0.1, 0.1);
        return event_;
      default:  // any size that is still accepted
        return {{size(), random_.below(2) ? size() : -size(), size()}, 1e-3};
    }
  }

 private:
  double corner() noexcept { return corners[random_.below(std::size(corners))]; }
  double size() noexcept { return std::pow(10.0, random_.between(-99.0, 99.0)); }

  RandomNumbers random_;
  std::uint64_t left_ = 0;
  std::uint64_t kind_ = 0;
  Event event_{};
};

// Settings from every corner of the ranges that the Python package allows.
template <class Estimator>
typename Estimator::Settings any_settings(RandomNumbers& random) noexcept {
  const auto one_of = [&](auto... values) {
    const double all[] = {values...};
    return all[random.below(sizeof...(values))];
  };
  typename Estimator::Settings settings;
  settings.forgetting = {one_of(1e-300, 0.5, 0.99, 1.0), one_of(0.0, 5.0, 1e6)};
  if (random.below(2)) settings.perturbation = {one_of(1e-9, 0.05, 1e20), one_of(2.5, 1e40)};
  if (random.below(2)) settings.gate = {1e-4, 0.1, 0.05};
  settings.scale = {one_of(1.0, 1e-3, 1e-30, 1e30), one_of(1.0, 1e-3, 1e-30, 1e30),
                    one_of(1.0, 1e-3, 1e-30, 1e30)};
  const double spring = one_of(0.1, 1e5, 1e-300, 1e300);
  settings.method.initial.B = one_of(0.0, 1e5, 1e300);
  if constexpr (std::is_same_v<Estimator, ExtendedKelvinVoigtRLS>) {
    settings.method.initial.K1 = spring;
  } else {
    settings.method.initial.K = spring;
  }
  const double variance = one_of(1e-20, 1e3, 1e20);
  if constexpr (std::is_same_v<Estimator, DoubleStageRLS>) {
    settings.method.initial_covariance =
        diagonal<3>({variance, one_of(1e-20, 1e8, 1e20), one_of(1e-20, 1e3, 1e20)});
    settings.method.initial.n = one_of(0.0, 1.0, -1e3, 1e300);
  } else {
    settings.method.initial_covariance[0][0] = variance;
    settings.method.initial_covariance[0][1] = settings.method.initial_covariance[1][0] =
        0.9 * std::sqrt(variance) * std::sqrt(settings.method.initial_covariance[1][1]);
  }
  return settings;
}

// The same of the methods that search the exponent.
template <class Estimator>
typename Estimator::Settings any_search(RandomNumbers& random) noexcept {
  const auto decades = [&](double most) { return std::pow(10.0, random.between(-most, most)); };
  typename Estimator::Settings settings;
  if (random.below(2)) settings.scale = {decades(30.0), decades(30.0), decades(30.0)};
  if (random.below(2)) settings.gate = {1e-3 * random.between(0.0, 1.0), 0.1, 0.05};
  if constexpr (requires { settings.method.lowest_exponent; }) {
    if (random.below(2)) settings.method.noise = decades(30.0);
    if (random.below(2)) settings.method.offset_deviation = decades(30.0);
    settings.method.offset = random.below(2) != 0;
    settings.method.lowest_exponent = random.between(0.1, 5.0);
    settings.method.highest_exponent = settings.method.lowest_exponent + random.between(0.25, 4.99);
  }
  if constexpr (requires { settings.changes.drift; }) {
    settings.changes.drift = random.between(1.0, 24.0);
    settings.changes.threshold = std::pow(10.0, random.between(-3.0, 12.0));
    settings.changes.adaptation = random.between(0.0, 1.0);
  }
  return settings;
}

template <class Estimator>
void fuzz(const typename Estimator::Settings& settings, std::uint64_t seed, int count) {
  Fuzz sequence(seed);
  Estimator estimator(settings);
  check_sound(estimator);
  for (int k = 0; k < count; ++k) {
    const auto [sample, dt] = sequence.next();
    const auto before = bytes_of(estimator);
    double predicted = 0.0;
    const Status status =
        k % 2 ? estimator.update(sample, dt, predicted)
              : estimator.update(sample.penetration, sample.velocity, sample.force, dt);
    if (status > Status::held) {
      CHECK(bytes_of(estimator) == before);
    } else {
      check_sound(estimator);
    }
  }
}

}  // namespace

TEST("fuzzing with arbitrary bit patterns leaves every estimator sound") {
  for_each_estimator(
      []<class Estimator>() { fuzz<Estimator>(typename Estimator::Settings{}, 1, 100000); });
}

TEST("the same under settings from every corner of their ranges") {
  for_each_estimator([]<class Estimator>() {
    RandomNumbers random(2);
    for (std::uint64_t round = 0; round < 40; ++round) {
      fuzz<Estimator>(any_settings<Estimator>(random), round, 5000);
    }
  });
}

// New seeds in each run; PALPATE_FUZZ_SEED repeats one.
TEST("no numbers break an estimator with change detection and outlier rejection") {
  const char* given = std::getenv("PALPATE_FUZZ_SEED");
  const std::uint64_t seed = given ? std::strtoull(given, nullptr, 10) : std::random_device{}();
  std::printf("    PALPATE_FUZZ_SEED=%llu\n", static_cast<unsigned long long>(seed));
  for_every_estimator([&]<class Estimator>() {
    RandomNumbers random(seed);
    for (std::uint64_t round = 0; round < 24; ++round) {
      Fuzz sequence(seed + round);
      const auto settings =
          round < 4 ? typename Estimator::Settings{} : any_search<Estimator>(random);
      CHECK(validate(settings) == nullptr);
      Estimator estimator(settings);
      for (int k = 0; k < 5000; ++k) {
        const auto [sample, dt] = sequence.next();
        estimator.update(sample.penetration, sample.velocity, sample.force, dt);
        if (k % 50) continue;
        const auto now = estimator.estimate();
        for (const double parameter : now.parameters) CHECK(std::isfinite(parameter));
        check_covariance(now.covariance);
      }
    }
  });
}

TEST("fuzzing with arbitrary rows leaves least squares of every order sound") {
  const auto fuzz_order = []<std::size_t Order>(std::integral_constant<std::size_t, Order>) {
    RandomNumbers random(Order);
    LeastSquares<Order> recursion({{}, diagonal([] {
                                     Vector<Order> variances{};
                                     variances.fill(1e3);
                                     return variances;
                                   }())});
    for (int k = 0; k < 30000; ++k) {
      Vector<Order> regressor{};
      for (double& entry : regressor) {
        entry = k % 3 ? random.any() : std::pow(10.0, random.between(-30.0, 30.0));
      }
      const double output = k % 2 ? random.any() : random.between(-1.0, 1.0);
      recursion.update(regressor, output, k % 5 ? 0.9 : 1.0, k % 7 ? 0.0 : std::abs(random.any()));
      check_sound(recursion);
    }
  };
  fuzz_order(std::integral_constant<std::size_t, 1>{});
  fuzz_order(std::integral_constant<std::size_t, 2>{});
  fuzz_order(std::integral_constant<std::size_t, 3>{});
  fuzz_order(std::integral_constant<std::size_t, 5>{});
  fuzz_order(std::integral_constant<std::size_t, 8>{});
}
