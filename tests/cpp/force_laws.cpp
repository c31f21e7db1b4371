#include "palpate/force_laws.hpp"

#include "check.hpp"
#include "palpate/estimate.hpp"

using namespace palpate;

static_assert(KelvinVoigt{2000.0, 20.0}.force(0.01, 0.0) == 20.0);
static_assert(ExtendedKelvinVoigt{1000.0, 5e4, 20.0}.force(-0.01, 1.0) == 0.0);

TEST("out of contact there is no force, however fast") {
  for (const double v : {-1.0, 0.0, 1.0}) {
    CHECK(KelvinVoigt{2000.0, 20.0}.force(-1e-9, v) == 0.0);
    CHECK(ExtendedKelvinVoigt{1000.0, 5e4, 20.0}.force(-1e-9, v) == 0.0);
    CHECK(HuntCrossley{2000.0, 2000.0, 1.3}.force(-1e-9, v) == 0.0);
  }
}

TEST("at the surface only Kelvin-Voigt jumps, by B v") {
  CHECK(KelvinVoigt{2000.0, 20.0}.force(0.0, 0.5) == 10.0);
  CHECK(ExtendedKelvinVoigt{1000.0, 5e4, 20.0}.force(0.0, 0.5) == 10.0);
  CHECK(HuntCrossley{2000.0, 2000.0, 1.3}.force(0.0, 0.5) == 0.0);
  CHECK(HuntCrossley{2000.0, 2000.0, 1.3}.force(1e-12, 0.5) < 1e-10);
}

TEST("held still each law is its spring") {
  CHECK_NEAR(KelvinVoigt({2000.0, 20.0}).force(0.01, 0.0), 20.0, 1e-14);
  CHECK_NEAR(ExtendedKelvinVoigt({1000.0, 5e4, 20.0}).force(0.01, 0.0), 15.0, 1e-14);
  CHECK_NEAR(HuntCrossley({1e5, 2e5, 2.0}).force(0.01, 0.0), 10.0, 1e-14);
  CHECK_NEAR(HuntCrossley({1e5, 2e5, 1.5}).force(0.01, 0.0), 100.0, 1e-13);
}

TEST("moving adds the damper, which Hunt-Crossley scales with depth") {
  CHECK_NEAR(KelvinVoigt({2000.0, 20.0}).force(0.01, 0.05), 21.0, 1e-14);
  CHECK_NEAR(ExtendedKelvinVoigt({1000.0, 5e4, 20.0}).force(0.01, -0.05), 14.0, 1e-14);
  const HuntCrossley phantom{1e5, 2e5, 2.0};
  CHECK_NEAR(phantom.force(0.01, 0.05), 10.0 * (1.0 + 2.0 * 0.05), 1e-14);
  CHECK_NEAR(phantom.force(0.02, 0.05) / phantom.force(0.01, 0.05), 4.0, 1e-14);
}

TEST("on a fast rebound Kelvin-Voigt pulls; Hunt-Crossley only beyond v = -K/B") {
  CHECK(KelvinVoigt{2000.0, 20.0}.force(0.001, -0.2) < 0.0);
  const HuntCrossley ball{2000.0, 2000.0, 1.0};
  CHECK(ball.force(0.001, -0.999) > 0.0);
  CHECK(ball.force(0.001, -1.0) == 0.0);
  CHECK(ball.force(0.001, -1.001) < 0.0);
}

TEST("each law contains the simpler one") {
  for (const double x : {0.0, 0.003, 0.02}) {
    for (const double v : {-0.05, 0.0, 0.05}) {
      CHECK(ExtendedKelvinVoigt{2000.0, 0.0, 20.0}.force(x, v) ==
            KelvinVoigt{2000.0, 20.0}.force(x, v));
      CHECK_NEAR(HuntCrossley({2000.0, 0.0, 1.0}).force(x, v),
                 KelvinVoigt({2000.0, 0.0}).force(x, v), 1e-13);
    }
  }
}

TEST("condition 10 is 1 at rest, 0 at |v| = 0.1 K/B and negative beyond") {
  const HuntCrossley phantom{1e5, 2e5, 2.0};
  CHECK(validity_margin(phantom, 0.0) == 1.0);
  CHECK_NEAR(validity_margin(phantom, 0.05), 0.0, 1e-15);
  CHECK_NEAR(validity_margin(phantom, -0.05), 0.0, 1e-15);
  CHECK_NEAR(validity_margin(phantom, 0.1), -1.0, 1e-15);
  CHECK(validity_margin(HuntCrossley{1e5, 0.0, 2.0}, 1e3) == 1.0);
}

TEST("condition 10 is a number whatever the law, and without stiffness holds at rest alone") {
  CHECK(validity_margin(HuntCrossley{0.0, 1.0, 1.0}, 0.1) == -largest_parameter);
  CHECK(validity_margin(HuntCrossley{0.0, 1.0, 1.0}, 0.0) == 1.0);
  CHECK(validity_margin(HuntCrossley{1e-100, 1e100, 1.0}, 1e130) == -largest_parameter);
}

TEST("condition 10 concerns no law without a logarithm") {
  CHECK(validity_margin(KelvinVoigt{2000.0, 2e6}, 10.0) == 1.0);
  CHECK(validity_margin(ExtendedKelvinVoigt{1000.0, 0.0, 2e6}, 10.0) == 1.0);
}
