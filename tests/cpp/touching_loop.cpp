// A control loop that touches a material.
#include "palpate/touching_loop.hpp"

#include <cmath>
#include <vector>

#include "check.hpp"

using namespace palpate;
using detail::Controller;
using detail::Touch;
using detail::TouchingLoop;
using detail::TouchOutcome;

namespace {

constexpr double unfiltered = 2.0 * 3.141592653589793 * 200.0;

TouchingLoop loop_on_a_ball(Controller controller, double first, double second) {
  return {.law = {.K = 2000.0, .n = 1.0, .B = 2000.0, .p = 1.0, .M = 0.0},
          .controller = controller,
          .gain = 1.0,
          .first_gain = first,
          .second_gain = second,
          .mass = 4.0,
          .tool_mass = 0.0,
          .friction = 20.0,
          .sample_time = 1e-3,
          .delay = 2.3e-3,
          .filter = unfiltered,
          .bandwidth = 60.0,
          .wanted_force = 10.0,
          .speed = 0.02,
          .rest_depth = 5e-3,
          .duration = 3.0};
}

TouchOutcome touch(const TouchingLoop& loop, std::vector<double>& forces,
                   const viscoelastic::RelaxationBranches& branches = {0.0, 0.0, 0.0, 0.0}) {
  std::vector<double> commands(loop.whole_delay() + 2);
  forces.assign(loop.samples(), 0.0);
  return Touch{loop, branches, commands.data()}.run(forces.data());
}

}  // namespace

TEST("each controller settles at the wanted force, and swings when its gain is too high") {
  const TouchingLoop loops[] = {loop_on_a_ball(Controller::admittance, 4.0, 160.0),
                                loop_on_a_ball(Controller::impedance, 500.0, 60.0),
                                loop_on_a_ball(Controller::force, 0.5, 2.0)};
  std::vector<double> forces;
  for (TouchingLoop loop : loops) {
    const TouchOutcome calm = touch(loop, forces);
    CHECK(calm.losses == 0.0);
    CHECK(std::abs(forces.back() - 10.0) < 0.2);
    CHECK(calm.settling_time > 0.05);
    CHECK(calm.settling_time < 2.0);
    CHECK(calm.last_swing < 0.5);
    loop.gain = 300.0;
    const TouchOutcome wild = touch(loop, forces);
    CHECK(wild.losses > 0.0);
    CHECK(wild.last_swing > 5.0);
  }
}

TEST("a probe that is only pushed settles where the law has the push") {
  TouchingLoop loop = loop_on_a_ball(Controller::force, 1e-9, 0.0);
  std::vector<double> forces;
  loop.law = {.K = 3e4, .n = 1.5, .B = 600.0, .p = 0.5, .M = 0.0};
  loop.rest_depth = std::pow(10.0 / 3e4, 1.0 / 1.5);
  touch(loop, forces);
  CHECK(std::abs(forces.back() - 10.0) < 0.01);
}

TEST("memory stiffens a fast touch, and its force is that of the branches stepped one by one") {
  const viscoelastic::RelaxationBranches branches{0.0, 0.004, 4.0, 1.0};
  constexpr double step = 2e-4, stiffness = 1500.0;
  detail::RelaxingSteps steps{branches, stiffness, step};
  std::vector<double> state(branches.count), expected(branches.count + 1);
  double largest = 0.0;
  for (int k = 1; k <= 2000; ++k) {
    const double before = 5e-3 * std::sin(10.0 * step * (k - 1)),
                 x = 5e-3 * std::sin(10.0 * step * k);
    steps.begin(state.data(), before);
    const double force = steps.force(2, x);
    steps.end(state.data(), x);
    if (x <= 0.0) break;
    viscoelastic::relax(1.0, branches, x, step, expected.data());
    double reference = 0.0;
    for (std::size_t i = 0; i < branches.count; ++i) {
      reference += stiffness * branches.stiffnesses[i] * expected[1 + i];
    }
    largest = std::fmax(largest, reference);
    CHECK(std::abs(force - reference) < 1e-9 * (1.0 + largest));
  }
  CHECK(largest > 3.0);
}

TEST("a loop whose numbers no simulation ends with is not valid") {
  TouchingLoop loop = loop_on_a_ball(Controller::force, 0.5, 2.0);
  CHECK(loop.is_valid());
  for (double TouchingLoop::* number : {&TouchingLoop::mass, &TouchingLoop::sample_time,
                                        &TouchingLoop::rest_depth, &TouchingLoop::speed}) {
    TouchingLoop other = loop;
    other.*number = std::nan("");
    CHECK(!other.is_valid());
    other.*number = 0.0;
    CHECK(!other.is_valid());
  }
  loop.delay = 1e3;
  CHECK(!loop.is_valid());
}
