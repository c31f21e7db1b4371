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
