#include "check.hpp"
#include "estimators.hpp"
#include "palpate/method.hpp"

using namespace palpate;
using Phase = ContactGate::Phase;

namespace {

constexpr ContactGate::Settings gate_settings{
    .minimum_penetration = 1e-3, .make_force = 1.0, .break_force = 0.8};

struct Step {
  double penetration;
  double force;
  Phase phase;  // that it leads to
};

}  // namespace

TEST("contact is made above one force, lost at or below the other, and deeper than the minimum") {
  constexpr Phase waiting = Phase::waiting, contact = Phase::contact, held = Phase::held;
  ContactGate gate(gate_settings);
  CHECK(gate.phase() == waiting);
  for (const Step& s : {Step{-0.01, 0.0, waiting},
                        {0.01, 0.9, waiting},
                        {0.01, 1.0, waiting},
                        {1e-3, 100.0, waiting},
                        {0.01, 1.01, contact},
                        {0.01, 0.81, contact},
                        {0.01, 0.95, contact},
                        {0.01, 0.8, held},
                        {0.01, 0.9, held},
                        {1.001e-3, 1.01, contact},
                        {1e-3, 100.0, held}}) {
    const Phase before = gate.phase();
    const Phase next = gate.next(s.penetration, s.force);
    CHECK(next == s.phase && gate.phase() == before);  // asking changes nothing
    gate.enter(next);
  }
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
