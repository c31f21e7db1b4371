#include "palpate/force_laws.hpp"

#include "check.hpp"
#include "palpate/estimate.hpp"

using namespace palpate;

static_assert(KelvinVoigt{.K = 2000.0, .B = 20.0}.force(0.01, 0.0) == 20.0);
static_assert(ExtendedKelvinVoigt{.K1 = 1000.0, .K2 = 5e4, .B = 20.0}.force(-0.01, 1.0) == 0.0);

TEST("condition 10 is 1 at rest, 0 at |v| = 0.1 K/B and negative beyond") {
  const HuntCrossley phantom{.K = 1e5, .B = 2e5, .n = 2.0};
  CHECK(validity_margin(phantom, 0.0) == 1.0);
  CHECK_NEAR(validity_margin(phantom, 0.05), 0.0, 1e-15);
  CHECK_NEAR(validity_margin(phantom, -0.05), 0.0, 1e-15);
  CHECK_NEAR(validity_margin(phantom, 0.1), -1.0, 1e-15);
  CHECK(validity_margin(HuntCrossley{.K = 1e5, .B = 0.0, .n = 2.0}, 1e3) == 1.0);
}

TEST("condition 10 is a number whatever the law, and without stiffness holds at rest alone") {
  CHECK(validity_margin(HuntCrossley{.K = 0.0, .B = 1.0, .n = 1.0}, 0.1) == -largest_parameter);
  CHECK(validity_margin(HuntCrossley{.K = 0.0, .B = 1.0, .n = 1.0}, 0.0) == 1.0);
  CHECK(validity_margin(HuntCrossley{.K = 1e-100, .B = 1e100, .n = 1.0}, 1e130) ==
        -largest_parameter);
}

TEST("condition 10 concerns no law without a logarithm") {
  CHECK(validity_margin(KelvinVoigt{.K = 2000.0, .B = 2e6}, 10.0) == 1.0);
  CHECK(validity_margin(ExtendedKelvinVoigt{.K1 = 1000.0, .K2 = 0.0, .B = 2e6}, 10.0) == 1.0);
}
