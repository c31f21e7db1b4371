#include "check.hpp"
#include "estimators.hpp"
#include "palpate/method.hpp"

using namespace palpate;
using Phase = ContactGate::Phase;

namespace {

constexpr ContactGate::Settings gate_settings{
    .minimum_penetration = 1e-3, .make_force = 1.0, .break_force = 0.8};

// Takes the sample and says where it led.
Phase after(ContactGate& gate, double penetration, double force) noexcept {
  gate.enter(gate.next(penetration, force));
  return gate.phase();
}

}  // namespace

TEST("before the first contact the gate waits") {
  ContactGate gate(gate_settings);
  CHECK(gate.phase() == Phase::waiting);
  CHECK(after(gate, -0.01, 0.0) == Phase::waiting);
  CHECK(after(gate, 0.01, 0.9) == Phase::waiting);
  CHECK(after(gate, 0.01, 1.0) == Phase::waiting);
}

TEST("contact is made above the one force and lost at or below the other") {
  ContactGate gate(gate_settings);
  CHECK(after(gate, 0.01, 1.01) == Phase::contact);
  CHECK(after(gate, 0.01, 0.9) == Phase::contact);
  CHECK(after(gate, 0.01, 0.81) == Phase::contact);
  CHECK(after(gate, 0.01, 0.8) == Phase::held);
  CHECK(after(gate, 0.01, 0.9) == Phase::held);
  CHECK(after(gate, 0.01, 1.01) == Phase::contact);
}

TEST("noise between the two forces neither makes nor breaks contact") {
  ContactGate gate(gate_settings);
  for (int k = 0; k < 100; ++k) CHECK(after(gate, 0.01, k % 2 ? 0.85 : 0.95) == Phase::waiting);
  after(gate, 0.01, 2.0);
  for (int k = 0; k < 100; ++k) CHECK(after(gate, 0.01, k % 2 ? 0.85 : 0.95) == Phase::contact);
}

TEST("a sample has to be deeper than the minimum, whatever its force") {
  ContactGate gate(gate_settings);
  CHECK(after(gate, 1e-3, 100.0) == Phase::waiting);
  CHECK(after(gate, 1.001e-3, 100.0) == Phase::contact);
  CHECK(after(gate, 1e-3, 100.0) == Phase::held);
}

TEST("asking what a sample leads to changes nothing") {
  ContactGate gate(gate_settings);
  CHECK(gate.next(0.01, 2.0) == Phase::contact);
  CHECK(gate.phase() == Phase::waiting);
}

TEST("an estimator waits, learns in contact, holds outside it and resumes") {
  for_each_estimator([]<class Estimator>() {
    typename Estimator::Settings settings = typename Estimator::Settings{};
    settings.gate = gate_settings;
    Estimator estimator(settings);
    const auto law = ball<typename Estimator::Law>;
    const auto start = estimator.law().parameters();
    CHECK(estimator.update(-1e-3, 0.0, 0.0) == Status::waiting);
    CHECK(estimator.law().parameters() == start);
    CHECK(estimator.estimate().samples == 0);

    probe(estimator, law, 0.5);
    const auto learned = estimator.estimate();
    CHECK(learned.samples == 500);
    CHECK(learned.status == Status::updated);

    for (int k = 0; k < 1000; ++k) CHECK(estimator.update(-1e-3, -0.01, 0.0) == Status::held);
    const auto held = estimator.estimate();
    CHECK(held.parameters == learned.parameters);
    CHECK(held.covariance == learned.covariance);
    CHECK(held.validity_margin == learned.validity_margin);
    CHECK(held.samples == 500);
    CHECK(held.status == Status::held);

    CHECK(update(estimator, probed(law, 0.6)) == Status::updated);
    CHECK(estimator.estimate().samples == 501);
  });
}
