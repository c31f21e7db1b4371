#include "estimators.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <vector>

#include "check.hpp"

using namespace palpate;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

template <class Estimator>
void check_same(const Estimator& a, const Estimator& b) {
  CHECK(a.estimate().parameters == b.estimate().parameters);
  CHECK(a.estimate().covariance == b.estimate().covariance);
  CHECK(a.estimate().validity_margin == b.estimate().validity_margin);
  CHECK(a.estimate().status == b.estimate().status);
  CHECK(a.estimate().samples == b.estimate().samples);
  CHECK(a.estimate().guarded == b.estimate().guarded);
}

}  // namespace

TEST("a refused sample changes no byte, before contact, in it and after it") {
  for_every_estimator([]<class Estimator>() {
    Estimator estimator;
    const auto check_refusals = [&] {
      const auto before = bytes_of(estimator);
      for (const double bad : {infinity, -infinity, not_a_number}) {
        CHECK(estimator.update(bad, 0.01, 20.0) == Status::not_finite);
        CHECK(estimator.update(0.01, bad, 20.0) == Status::not_finite);
        CHECK(estimator.update(0.01, 0.01, bad) == Status::not_finite);
        CHECK(estimator.update(bad, bad, bad, -1.0) == Status::not_finite);
      }
      for (const double bad : {0.0, -0.0, -1e-3, infinity, -infinity, not_a_number}) {
        CHECK(estimator.update(0.01, 0.01, 20.0, bad) == Status::invalid_step);
        CHECK(estimator.update(-0.01, 0.01, -20.0, bad) == Status::invalid_step);
      }
      for (const double bad : {1e100, 1e200, std::numeric_limits<double>::max()}) {
        CHECK(estimator.update(bad, 0.01, 20.0) == Status::out_of_range);
        CHECK(estimator.update(0.01, bad, 20.0) == Status::out_of_range);
        CHECK(estimator.update(0.01, -bad, 20.0) == Status::out_of_range);
        CHECK(estimator.update(0.01, 0.01, bad) == Status::out_of_range);
      }
      CHECK(bytes_of(estimator) == before);
    };
    check_refusals();
    probe(estimator, ball<typename Estimator::Law>, 0.2);
    check_refusals();
    estimator.update(-0.01, 0.0, 0.0);
    check_refusals();
  });
}

TEST("replay is update, bit for bit, and writes down what each sample met") {
  for_each_estimator([]<class Estimator>() {
    using Law = typename Estimator::Law;
    constexpr std::size_t count = 1500;
    std::vector<double> x, v, f, dt;
    for (std::size_t k = 0; k < count; ++k) {
      Sample s = probed(ball<Law>, 1e-3 * static_cast<double>(k));
      if (k < 20 || (k > 700 && k < 750)) s = {-1e-3, 0.01, 0.0};
      if (k % 97 == 0) s.force = not_a_number;
      x.push_back(s.penetration);
      v.push_back(s.velocity);
      f.push_back(s.force);
      dt.push_back(k % 2 ? 0.8e-3 : 1.2e-3);
    }
    std::vector<double> parameters(count * Law::size), errors(count * Law::size), predicted(count),
        margins(count);
    std::vector<std::uint8_t> status(count);
    const TraceColumns trace{parameters.data(), errors.data(), predicted.data(), margins.data(),
                             status.data()};
    const double half = 0.5e-3;
    const Signals forms[] = {{x.data(), v.data(), f.data(), nullptr, count},
                             {x.data(), v.data(), f.data(), &half, count, true},
                             {x.data(), v.data(), f.data(), dt.data(), count}};
    typename Estimator::Settings settings;
    settings.scale = {0.02, 0.05, 30.0};
    for (const Signals& signals : forms) {
      Estimator replayed(settings);
      Estimator updated(settings);
      replay(replayed, signals, trace);
      for (std::size_t k = 0; k < count; ++k) {
        const double step = !signals.time_steps ? 1e-3 : signals.one_time_step ? half : dt[k];
        double a_priori = 0.0;
        const Status done = updated.update({x[k], v[k], f[k]}, step, a_priori);
        CHECK(status[k] == static_cast<std::uint8_t>(done));
        const auto now = updated.estimate();
        for (std::size_t i = 0; i < Law::size; ++i) {
          const double error = errors[k * Law::size + i];
          CHECK_NEAR(parameters[k * Law::size + i], now.parameters[i], 0.0);
          CHECK_NEAR(error, std::sqrt(now.covariance[i][i]), 1e-9 * error);
        }
        CHECK_NEAR(margins[k], validity_margin(updated.latest_law(), updated.last_velocity()), 0.0);
        if (done == Status::not_finite) {
          CHECK(std::isnan(predicted[k]));
        } else {
          CHECK_NEAR(predicted[k], a_priori, 0.0);
        }
      }
      check_same(replayed, updated);
    }
  });
}

TEST("an estimator restored from its bytes continues as if never stopped, bit for bit") {
  for_every_estimator([]<class Estimator>() {
    const auto law = ball<typename Estimator::Law>;
    Estimator whole;
    probe(whole, law, 0.3);
    const auto saved = bytes_of(whole);
    Estimator restored;
    std::memcpy(static_cast<void*>(&restored), saved.data(), saved.size());
    probe(whole, law, 0.3);
    probe(restored, law, 0.3);
    check_same(restored, whole);
  });
}

TEST("a reset forgets everything but the settings") {
  for_every_estimator([]<class Estimator>() {
    const auto law = ball<typename Estimator::Law>;
    Estimator used;
    probe(used, law, 0.3);
    used.reset();
    Estimator fresh;
    check_same(used, fresh);
    probe(used, law, 0.3);
    probe(fresh, law, 0.3);
    check_same(used, fresh);
  });
}

TEST("scaling the units scales the answer") {
  // The same material in SI and as a microscope sees it, with P₀ meant in scaled units.
  const Scale micro{1e-6, 1e-5, 1e-9};
  for_each_estimator([&]<class Estimator>() {
    using Law = typename Estimator::Law;
    typename Estimator::Settings settings;
    Estimator plain(settings);
    settings.scale = micro;
    settings.method.initial.stiffness *= micro.force / micro.penetration;  // every start has n = 1
    Estimator scaled_one(settings);
    for (int k = 0; k < 1000; ++k) {
      const Sample s = probed(ball<Law>, 1e-3 * k);
      update(plain, s);
      scaled_one.update(s.penetration * micro.penetration, s.velocity * micro.velocity,
                        s.force * micro.force);
    }
    for (int k = 0; k < 1000; k += 100) {
      const Sample s = probed(ball<Law>, 1e-3 * k);
      const double predicted = plain.predict(s.penetration, s.velocity) * micro.force;
      CHECK_NEAR(scaled_one.predict(s.penetration * micro.penetration, s.velocity * micro.velocity),
                 predicted, 1e-6 * predicted);
    }
  });
}

TEST(
    "the scale changes neither the law nor its standard errors, where the start no longer "
    "matters") {
  for_each_estimator([]<class Estimator>() {
    // The double stage never forgets its start.
    if constexpr (!std::is_same_v<Estimator, DoubleStageRLS>) {
      const auto estimate_under = [](const Scale& scale) {
        typename Estimator::Settings settings;
        settings.scale = scale;
        for (std::size_t i = 0; i < Estimator::Law::size; ++i) {
          settings.method.initial_covariance[i][i] = 1e10;
        }
        Estimator estimator(settings);
        for (int k = 0; k < 5000; ++k) {
          Sample s = probed(ball<typename Estimator::Law>, 1e-3 * k);
          s.force *= k % 3 == 0 ? 1.01 : 0.995;
          update(estimator, s);
        }
        return estimator.estimate();
      };
      const auto plain = estimate_under({});
      const auto under = estimate_under({0.02, 0.05, 30.0});
      for (std::size_t i = 0; i < Estimator::Law::size; ++i) {
        CHECK_NEAR(under.parameters[i], plain.parameters[i], 1e-3 * plain.parameters[i]);
        for (std::size_t j = 0; j < Estimator::Law::size; ++j) {
          CHECK_NEAR(under.covariance[i][j], plain.covariance[i][j],
                     1e-3 * std::abs(plain.covariance[i][j]));
        }
      }
    }
  });
}

TEST("an estimate reports condition 10 of its law at the last velocity") {
  for_each_estimator([]<class Estimator>() {
    Estimator estimator;
    probe(estimator, ball<typename Estimator::Law>, 0.5);
    const double velocity = probed(ball<typename Estimator::Law>, 0.499).velocity;
    CHECK(estimator.estimate().validity_margin == validity_margin(estimator.law(), velocity));
    CHECK(estimator.estimate().valid());
  });
}

TEST("the double stage skips its second stage while K + B v is not positive") {
  DoubleStageRLS::Settings settings;
  settings.method.initial = {1.0, 100.0, 1.0};
  settings.method.initial_covariance = diagonal<3>({1e-9, 1e-9, 1e3});
  DoubleStageRLS estimator(settings);
  CHECK(estimator.update(0.01, -0.05, 1.0) == Status::updated);
  CHECK(estimator.law().exponent == 1.0);
  CHECK(estimator.update(0.01, 0.05, 1.0) == Status::updated);
  CHECK(estimator.law().exponent != 1.0);
}

TEST("an absurd exponent does not stop the double stage") {
  DoubleStageRLS::Settings settings;
  settings.method.initial.exponent = 1000.0;
  DoubleStageRLS estimator(settings);
  CHECK(taken(estimator.update(10.0, 0.01, 20.0)));
}

TEST("an estimate says how sure it is: errors shrink as samples come and grow with noise") {
  for_each_estimator([]<class Estimator>() {
    const auto law = ball<typename Estimator::Law>;
    const auto error_after = [&](int count, double noise) {
      typename Estimator::Settings settings;
      settings.forgetting = {};
      settings.method.initial = law;
      Estimator estimator(settings);
      for (int k = 0; k < count; ++k) {
        Sample s = probed(law, 1e-3 * k);
        s.force *= 1.0 + (k % 3 == 0 ? noise : -0.5 * noise);
        update(estimator, s);
      }
      return std::sqrt(estimator.estimate().covariance[0][0]);
    };
    // Four times the time halves the error, ten times the noise makes it tenfold.
    const double once = error_after(7000, 1e-3);
    CHECK_NEAR(error_after(28000, 1e-3) / once, 0.5, 0.15);
    CHECK_NEAR(error_after(7000, 1e-2) / once, 10.0, 1.5);
  });
}
