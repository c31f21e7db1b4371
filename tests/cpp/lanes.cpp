// Contacts in vector lanes come out as each would alone, with every instruction set of the machine.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "check.hpp"
#include "compiled_kernels.hpp"
#include "contact_rows.hpp"
#include "palpate/lanes/elementary.hpp"
#include "palpate/lanes/replay_contacts.hpp"
#include "palpate/lanes/screening.hpp"
#include "random_numbers.hpp"
#include "soundness.hpp"

using namespace palpate;

namespace {

template <class Test>
void for_each_lane_estimator(Test&& test) {
  test.template operator()<KelvinVoigtRLS>();
  test.template operator()<ExtendedKelvinVoigtRLS>();
  test.template operator()<SingleStageRLS>();
}

template <class Test>
void for_each_instruction_set(Test&& test) {
  for (const lanes::InstructionSet set : lanes::instruction_sets) {
    if (const lanes::Kernels* kernels = lanes::kernels_of(set)) test(*kernels);
  }
}

template <class Estimator>
std::vector<Estimator> replayed(const typename Estimator::Settings& settings,
                                const lanes::Contacts& contacts, const lanes::Kernels& kernels) {
  std::vector<Estimator> result(contacts.count);
  lanes::replay_contacts<Estimator>(
      settings, contacts, 0, contacts.count, kernels,
      [&](std::size_t contact, const Estimator& estimator) { result[contact] = estimator; });
  return result;
}

template <class Estimator>
std::vector<Estimator> replayed_alone(const typename Estimator::Settings& settings,
                                      const lanes::Contacts& contacts) {
  std::vector<Estimator> result(contacts.count);
  lanes::replay_one_by_one<Estimator>(
      settings, contacts, 0, contacts.count,
      [&](std::size_t contact, const Estimator& estimator) { result[contact] = estimator; });
  return result;
}

// All numbers of two estimates, bit by bit.
template <class Estimator>
bool same_bits(const Estimator& one, const Estimator& other) {
  const auto a = one.estimate(), b = other.estimate();
  return bytes_of(a.parameters) == bytes_of(b.parameters) &&
         bytes_of(a.covariance) == bytes_of(b.covariance) &&
         bytes_of(a.validity_margin) == bytes_of(b.validity_margin) && a.status == b.status &&
         a.samples == b.samples && a.guarded == b.guarded && a.rejected == b.rejected &&
         a.restarts == b.restarts;
}

// How far parameters are apart, over their value and standard error.
template <class Estimator>
double apart(const Estimator& one, const Estimator& other) {
  const auto a = one.estimate(), b = other.estimate();
  double worst = 0.0;
  for (std::size_t i = 0; i < Estimator::Law::size; ++i) {
    const double size = std::abs(b.parameters[i]) + std::sqrt(b.covariance[i][i]);
    worst = std::max(worst, std::abs(a.parameters[i] - b.parameters[i]) / size);
  }
  return worst;
}

// The same contacts with the last bit of every penetration and force changed.
ContactRows with_last_bits_changed(ContactRows rows, std::uint64_t seed) {
  RandomNumbers random(seed);
  for (auto* column : {&rows.penetration, &rows.force}) {
    for (double& value : *column) {
      value = std::nextafter(value, random.below(2) ? 1e308 : -1e308);
    }
  }
  return rows;
}

// A lane rounds a step differently in its last bits. What that comes to depends on the motion, so
// it is held against what the last bits of the data themselves come to, which is as little: of six
// contacts of each kind the worst, with a factor of ten for chance.
template <class Estimator>
void check_all_alike(const typename Estimator::Settings& settings, const ContactRows& rows,
                     const lanes::Contacts& contacts) {
  const auto alone = replayed_alone<Estimator>(settings, contacts);
  double bound[hostile_kinds] = {};
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    const ContactRows changed = with_last_bits_changed(rows, seed);
    lanes::Contacts others = changed.view();
    others.gates = contacts.gates;
    others.scales = contacts.scales;
    const auto beside = replayed_alone<Estimator>(settings, others);
    for (std::size_t contact = 0; contact < contacts.count; ++contact) {
      double& worst = bound[contact % hostile_kinds];
      worst = std::max(worst, apart(beside[contact], alone[contact]));
    }
  }
  for_each_instruction_set([&](const lanes::Kernels& kernels) {
    const auto together = replayed<Estimator>(settings, contacts, kernels);
    double found[hostile_kinds] = {};
    for (std::size_t contact = 0; contact < contacts.count; ++contact) {
      check_sound(together[contact]);
      const auto a = together[contact].estimate(), b = alone[contact].estimate();
      CHECK(a.samples == b.samples && a.guarded == b.guarded && a.status == b.status);
      const std::size_t kind = contact % hostile_kinds;
      found[kind] = std::max(found[kind], apart(together[contact], alone[contact]));
    }
    for (std::size_t kind = 0; kind < hostile_kinds; ++kind) {
      CHECK_NEAR(found[kind], 0.0, 10.0 * bound[kind] + 1e-14);
    }
  });
}

}  // namespace

TEST("ln and exp in lanes are right to the last bit or two") {
  using Doubles = lanes::Pack<16>;
  RandomNumbers random(3);
  double worst_ln = 0.0, worst_exp = 0.0;
  for (int round = 0; round < 20000; ++round) {
    double x[16], y[16], logarithms[16], exponentials[16];
    for (int i = 0; i < 16; ++i) {
      x[i] = round % 2 ? std::pow(10.0, random.between(-307.0, 308.0)) : random.between(0.5, 2.0);
      y[i] = round % 2 ? random.between(-708.0, 709.0) : random.between(-1.0, 1.0);
    }
    lanes::ln(Doubles::load(x)).store(logarithms);
    lanes::exp(Doubles::load(y)).store(exponentials);
    for (int i = 0; i < 16; ++i) {
      const long double ln_x = std::log(static_cast<long double>(x[i]));
      const long double exp_y = std::exp(static_cast<long double>(y[i]));
      worst_ln = std::max(worst_ln, static_cast<double>(std::abs((logarithms[i] - ln_x) / ln_x)));
      worst_exp =
          std::max(worst_exp, static_cast<double>(std::abs((exponentials[i] - exp_y) / exp_y)));
    }
  }
  std::printf("    ln %.2g, exp %.2g\n", worst_ln, worst_exp);
  CHECK(worst_ln < 3.4e-16);
  CHECK(worst_exp < 4.4e-16);
}

TEST("ln of numbers below the normal range is right too") {
  using Doubles = lanes::Pack<8>;
  const double x[8] = {
      4.9406564584124654e-324, 1e-320, 1e-310, 2.2e-308, 2.3e-308, 1.0, 3.0, 1e300};
  double result[8];
  lanes::ln_of_any(Doubles::load(x)).store(result);
  for (int i = 0; i < 8; ++i)
    CHECK_NEAR(result[i], std::log(x[i]), 4e-16 * std::abs(std::log(x[i])));
}

TEST("contacts in lanes come out as each would alone") {
  for_each_lane_estimator([]<class Estimator>() {
    const ContactRows rows = probed_rows<typename Estimator::Law>(37, 1003, 1);
    const typename Estimator::Settings settings;
    const auto alone = replayed_alone<Estimator>(settings, rows.view());
    for_each_instruction_set([&](const lanes::Kernels& kernels) {
      const auto together = replayed<Estimator>(settings, rows.view(), kernels);
      for (std::size_t contact = 0; contact < rows.count; ++contact) {
        // Of a second of three sines the last bits of the data come to 1e-12.
        CHECK_NEAR(apart(together[contact], alone[contact]), 0.0, 1e-11);
        CHECK(together[contact].estimate().samples == rows.samples);
      }
    });
  });
}

TEST("and so with samples missing, refused, out of contact or held in single lanes") {
  for_each_lane_estimator([]<class Estimator>() {
    for (const double factor : {1.0, 0.99, 0.9}) {
      const ContactRows rows = hostile_rows<typename Estimator::Law>(48, 700, 2);
      typename Estimator::Settings settings;
      settings.forgetting = {factor, factor == 0.99 ? 5.0 : 0.0};
      settings.gate = {1e-4, 0.5, 0.3};
      check_all_alike<Estimator>(settings, rows, rows.view());
    }
  });
}

TEST("a gate and units of a contact's own are heeded") {
  const ContactRows rows = hostile_rows<HuntCrossley>(40, 300, 4);
  std::vector<double> gates, scales;
  for (std::size_t contact = 0; contact < rows.count; ++contact) {
    const auto own = static_cast<double>(contact);
    gates.insert(gates.end(), {1e-3 * std::fmod(own, 4.0), 2.0 + own, 1.0 + 0.5 * own});
    scales.insert(scales.end(), {1e-3 * (1.0 + own), 0.01, 1.0 + own});
  }
  lanes::Contacts contacts = rows.view();
  contacts.gates = gates.data();
  contacts.scales = scales.data();
  for_each_lane_estimator([&]<class Estimator>() {
    check_all_alike<Estimator>(typename Estimator::Settings{}, rows, contacts);
    const auto own = replayed_alone<Estimator>(typename Estimator::Settings{}, contacts);
    const auto common = replayed_alone<Estimator>(typename Estimator::Settings{}, rows.view());
    CHECK(own[9].estimate().samples < common[9].estimate().samples);
  });
}

TEST("the guard acts in a lane as often as it does alone") {
  const ContactRows rows = hostile_rows<HuntCrossley>(16, 3000, 5);
  SingleStageRLS::Settings settings;
  settings.forgetting = {0.9, 0.0};
  const auto alone = replayed_alone<SingleStageRLS>(settings, rows.view());
  CHECK(alone[4].estimate().guarded > 100);
  for_each_instruction_set([&](const lanes::Kernels& kernels) {
    const auto together = replayed<SingleStageRLS>(settings, rows.view(), kernels);
    for (std::size_t contact = 0; contact < rows.count; ++contact) {
      const auto a = static_cast<double>(together[contact].estimate().guarded);
      const auto b = static_cast<double>(alone[contact].estimate().guarded);
      // At the very edge of a test the last bit decides: it may fall a sample earlier or later.
      CHECK_NEAR(a, b, 2.0);
    }
  });
}

TEST("every instruction set gives the same bits") {
  for_each_lane_estimator([]<class Estimator>() {
    const ContactRows rows = hostile_rows<typename Estimator::Law>(40, 500, 6);
    typename Estimator::Settings settings;
    settings.forgetting = {0.95, 0.0};
    const auto expected = replayed<Estimator>(settings, rows.view(),
                                              *lanes::kernels_of(lanes::InstructionSet::baseline));
    for_each_instruction_set([&](const lanes::Kernels& kernels) {
      const auto found = replayed<Estimator>(settings, rows.view(), kernels);
      for (std::size_t contact = 0; contact < rows.count; ++contact) {
        CHECK(same_bits(found[contact], expected[contact]));
      }
    });
  });
}

TEST("a contact does not depend on those beside it, nor on how many there are") {
  const ContactRows rows = hostile_rows<HuntCrossley>(35, 257, 7);
  for_each_instruction_set([&](const lanes::Kernels& kernels) {
    const SingleStageRLS::Settings settings;
    const auto all = replayed<SingleStageRLS>(settings, rows.view(), kernels);
    for (std::size_t contact = 0; contact < rows.count; ++contact) {
      ContactRows one(1, rows.samples);
      for (std::size_t k = 0; k < rows.samples; ++k) one.set(0, k, rows.at(contact, k));
      const auto alone = replayed<SingleStageRLS>(settings, one.view(), kernels);
      CHECK(same_bits(alone[0], all[contact]));
    }
  });
}

TEST("rows of any length, and of none, are taken to their end") {
  for (const std::size_t samples : {0U, 1U, 7U, 8U, 31U, 32U, 33U, 65U}) {
    const ContactRows rows = probed_rows<HuntCrossley>(19, samples, 8);
    for_each_instruction_set([&](const lanes::Kernels& kernels) {
      const auto found = replayed<SingleStageRLS>({}, rows.view(), kernels);
      for (const SingleStageRLS& estimator : found) {
        CHECK(estimator.estimate().samples == samples);
      }
    });
  }
}

TEST("any bits at all leave every lane sound") {
  RandomNumbers random(9);
  ContactRows rows(32, 2000);
  for (std::size_t contact = 0; contact < rows.count; ++contact) {
    for (std::size_t k = 0; k < rows.samples; ++k) {
      const auto value = [&] {
        return contact % 2 ? random.any() : std::pow(10.0, random.between(-99.0, 99.0));
      };
      rows.set(contact, k, {std::abs(value()), value(), std::abs(value())});
    }
  }
  for_each_lane_estimator([&]<class Estimator>() {
    for_each_instruction_set([&](const lanes::Kernels& kernels) {
      typename Estimator::Settings settings;
      settings.forgetting = {0.9, 0.0};
      for (const Estimator& estimator : replayed<Estimator>(settings, rows.view(), kernels)) {
        check_sound(estimator);
      }
    });
  });
}

TEST("settings that lanes do not take go through the estimator itself, bit for bit") {
  const ContactRows rows = hostile_rows<HuntCrossley>(20, 400, 10);
  const lanes::Kernels& kernels = *lanes::kernels_of(lanes::InstructionSet::baseline);
  SingleStageRLS::Settings settings;
  settings.perturbation = {0.05, 2.5};
  CHECK(!lanes::in_lanes<SingleStageRLS>(settings));
  const auto check = [&]<class Estimator>(const typename Estimator::Settings& given) {
    const auto found = replayed<Estimator>(given, rows.view(), kernels);
    const auto expected = replayed_alone<Estimator>(given, rows.view());
    for (std::size_t contact = 0; contact < rows.count; ++contact) {
      CHECK(same_bits(found[contact], expected[contact]));
    }
  };
  check.operator()<SingleStageRLS>(settings);
  check.operator()<DoubleStageRLS>({});
  check.operator()<WithChangeDetector<SingleStageRLS>>({});
  check.operator()<WithOutlierRejection<SingleStageRLS>>({});
}

TEST("samples without condition 10 are counted in lanes as one at a time") {
  ContactRows rows = hostile_rows<HuntCrossley>(24, 400, 11);
  for (double& velocity : rows.velocity) velocity *= 6.0;  // so that it is violated now and then
  SingleStageRLS::Settings settings;
  settings.forgetting = {0.97, 0.0};
  const auto nothing = [](std::size_t, const SingleStageRLS&) {};
  std::vector<std::uint64_t> alone(rows.count), together(rows.count);
  lanes::Contacts contacts = rows.view();
  contacts.violated = alone.data();
  lanes::replay_one_by_one<SingleStageRLS>(settings, contacts, 0, rows.count, nothing);
  CHECK(std::count(alone.begin(), alone.end(), 0U) < 12);
  contacts.violated = together.data();
  for_each_instruction_set([&](const lanes::Kernels& kernels) {
    lanes::replay_contacts<SingleStageRLS>(settings, contacts, 0, rows.count, kernels, nothing);
    CHECK(together == alone);
  });
}

TEST("counting changes no bit of what is learned") {
  const ContactRows rows = hostile_rows<HuntCrossley>(24, 400, 12);
  std::vector<std::uint64_t> violated(rows.count);
  lanes::Contacts counting = rows.view();
  counting.violated = violated.data();
  for_each_instruction_set([&](const lanes::Kernels& kernels) {
    const auto found = replayed<SingleStageRLS>({}, counting, kernels);
    const auto expected = replayed<SingleStageRLS>({}, rows.view(), kernels);
    for (std::size_t contact = 0; contact < rows.count; ++contact) {
      CHECK(same_bits(found[contact], expected[contact]));
    }
  });
}

TEST("of a contact that is screened as sound a rejection takes what its gate lets in") {
  const ContactRows rows = hostile_rows<HuntCrossley>(40, 500, 13);
  using Rejecting = WithOutlierRejection<SingleStageRLS>;
  Rejecting::Settings settings;
  settings.gate = {0.0, 0.5, 0.4};
  std::vector<std::uint8_t> touching(rows.samples);
  std::size_t sound = 0;
  for (std::size_t contact = 0; contact < rows.count; ++contact) {
    const std::size_t start = contact * rows.samples;
    const Signals in{&rows.penetration[start], &rows.velocity[start], &rows.force[start], nullptr,
                     rows.samples};
    Rejecting estimator(settings);
    std::size_t apart = 0;
    const bool none = lanes::screened(in, settings.sample_time, settings.gate, settings.outliers,
                                      touching.data());
    for (std::size_t k = 0; k < rows.samples; ++k) {
      const Sample sample = rows.at(contact, k);
      const Status status = estimator.update(sample.penetration, sample.velocity, sample.force);
      if (taken(status) != (touching[k] == 1)) ++apart;
    }
    if (none) CHECK(apart == 0 && estimator.estimate().rejected == 0);
    sound += none ? 1 : 0;
  }
  CHECK(sound >= 5);
  CHECK(sound < rows.count);
}
