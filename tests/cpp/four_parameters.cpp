// A law of four parameters, outside the library, in its loop: nothing is sized for three.
#include <cmath>

#include "check.hpp"
#include "estimators.hpp"

using namespace palpate;

namespace {

// F = K₁ x + K₂ x² + B v + A for x > 0, else 0: what sticks pulls with −A.
struct Sticky {
  static constexpr std::size_t size = 4;
  double stiffness, quadratic_stiffness, damping, adhesion;

  double force(double x, double v) const noexcept {
    return x > 0.0 ? stiffness * x + quadratic_stiffness * x * x + damping * v + adhesion : 0.0;
  }
  Vector<size> parameters() const noexcept {
    return {stiffness, quadratic_stiffness, damping, adhesion};
  }
  bool operator==(const Sticky&) const = default;
};

// In SI: the units of the arithmetic are one.
struct StickyRegression {
  using Law = Sticky;
  static constexpr std::size_t order = 4;
  static constexpr Law initial{1.0, 0.0, 0.0, 0.0};
  static constexpr Vector<order> initial_variances{1e14, 1e14, 1e14, 1e14};

  static RegressionRow<order> row(const Sample& s) noexcept {
    return {{s.penetration, s.penetration * s.penetration, s.velocity, 1.0}, s.force};
  }
  static double force(const Vector<order>& theta, const Vector<order>& phi) noexcept {
    double sum = 0.0;
    for (std::size_t i = 0; i < order; ++i) sum += theta[i] * phi[i];
    return sum;
  }
  static Vector<order> coefficients(const Law& law, const Units&) noexcept {
    return law.parameters();
  }
  static Law law(const Vector<order>& t, const Units&) noexcept { return {t[0], t[1], t[2], t[3]}; }
  static Matrix<order> jacobian(const Law&, const Units&) noexcept {
    return diagonal<order>({1.0, 1.0, 1.0, 1.0});
  }
  static Vector<order> variances(const Matrix<order>& p, const Law&, const Units&) noexcept {
    return {p[0][0], p[1][1], p[2][2], p[3][3]};
  }
};

}  // namespace

TEST("a law of four parameters is identified, with and without a detector") {
  const auto check = []<class Estimator>() {
    Estimator estimator;
    const Sticky law{800.0, 3e4, 12.0, 0.5};
    probe(estimator, law, 3.0);
    const auto now = estimator.estimate();
    const auto truth = law.parameters();
    for (std::size_t i = 0; i < 4; ++i) {
      // The prior is worth a part in 1e7; what is left is rounding of P₀ φφᵀ.
      CHECK_NEAR(now.parameters[i], truth[i], 1e-4 * truth[i]);
    }
    const Sample s = probed(law, 0.3);
    CHECK_NEAR(estimator.predict(s.penetration, s.velocity), s.force, 1e-6 * s.force);
    // The library does not know the errors of such a law's K' and B'; bounds of materials hold.
    const ContactResponse felt = estimator.response();
    CHECK(!felt.stiffness.usable && !felt.damping.usable);
    const double slope = law.stiffness + 2.0 * law.quadratic_stiffness * felt.depth;
    CHECK(felt.stiffness.value > 0.5 * slope && felt.stiffness.value < 2.0 * slope);
  };
  using Estimator = RecursiveEstimator<RegressionMethod<StickyRegression>>;
  check.template operator()<Estimator>();
  check.template operator()<WithChangeDetector<Estimator>>();
}
