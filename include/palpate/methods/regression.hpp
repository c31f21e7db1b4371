// A force law identified by one recursive least squares: KV-RLS, EKV-RLS and the single-stage
// method.
//
// Each law is a linear regression y = φᵀθ in scaled units, with a conversion from θ to the law in
// SI.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "palpate/estimate.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/least_squares.hpp"
#include "palpate/matrix.hpp"
#include "palpate/method.hpp"
#include "palpate/sample.hpp"

namespace palpate {

template <std::size_t Order>
struct RegressionRow {
  Vector<Order> regressor;  // φ
  double output;            // y
};

// The variables that multiply the parameters in a force that is linear in all of them.
enum class Term : std::uint8_t { depth, depth_squared, velocity };

// y = F; φ and θ follow from the terms.
template <class FittedLaw, Term... terms>
struct LinearRegression {
  using Law = FittedLaw;
  static constexpr std::size_t order = Law::size;

  static constexpr RegressionRow<order> row(const Sample& s) noexcept {
    return {{times(1.0, terms, s.penetration, s.velocity)...}, s.force};
  }
  static constexpr double force(const Vector<order>& theta, const Vector<order>& phi) noexcept {
    return detail::dot(phi, theta);
  }
  static constexpr Vector<order> coefficients(const Law& law, const Units& u) noexcept {
    Vector<order> theta = law.parameters();
    for (std::size_t i = 0; i < order; ++i) {
      theta[i] = detail::saturate(times(theta[i], all[i], u.penetration, u.velocity) / u.force);
    }
    return theta;
  }
  static constexpr Law law(Vector<order> theta, const Units& u) noexcept {
    for (std::size_t i = 0; i < order; ++i) {
      theta[i] = detail::saturate(per(theta[i] * u.force, all[i], u));
    }
    return law_of<Law>(theta.data());
  }
  static constexpr Matrix<order> jacobian(const Law&, const Units& u) noexcept {
    return diagonal<order>({per(u.force, terms, u)...});
  }
  static constexpr Vector<order> variances(const Matrix<order>& p, const Law& law,
                                           const Units& u) noexcept {
    const Matrix<order> j = jacobian(law, u);
    Vector<order> result{};
    for (std::size_t i = 0; i < order; ++i) result[i] = j[i][i] * j[i][i] * p[i][i];
    return result;
  }

 private:
  static constexpr std::array<Term, order> all{terms...};

  static constexpr double times(double value, Term term, double depth, double velocity) noexcept {
    if (term == Term::velocity) return value * velocity;
    return term == Term::depth ? value * depth : value * depth * depth;
  }
  static constexpr double per(double value, Term term, const Units& u) noexcept {
    if (term == Term::velocity) return value / u.velocity;
    return term == Term::depth ? value / u.penetration : value / u.penetration / u.penetration;
  }
};

// φ = [x, v], θ = [K, B].
struct KelvinVoigtRegression : LinearRegression<KelvinVoigt, Term::depth, Term::velocity> {
  // Near 0, as in the paper (0 has no logarithm; equivalent methods have the same start).
  static constexpr Law initial{0.1, 0.0};
  // In SI φ² is near 1e-4 (at 10 mm), so a thousand samples far outweigh a prior variance of 1e4 or
  // more.
  static constexpr Vector<order> initial_variances{1e8, 1e8};
};

// φ = [x, x², v], θ = [K₁, K₂, B].
struct ExtendedKelvinVoigtRegression
    : LinearRegression<ExtendedKelvinVoigt, Term::depth, Term::depth_squared, Term::velocity> {
  static constexpr Law initial{0.1, 0.0, 0.0};
  // In SI x² is near 1e-4 and φ² near 1e-8; with a smaller variance K₂ stays at its start.
  static constexpr Vector<order> initial_variances{1e10, 1e10, 1e10};
};

// The single-stage method (eqs. 9, 12): y = ln F, φ = [1, v, ln x], θ = [ln K, B/K, n].
struct HuntCrossleyLogRegression {
  using Law = HuntCrossley;
  static constexpr std::size_t order = 3;
  static constexpr Law initial{0.1, 0.0, 1.0};
  // Variances of θ: from 10 on all starts converge (section V-B of the paper); larger values
  // converge faster and overshoot more.
  static constexpr Vector<order> initial_variances{1e3, 1e3, 1e3};

  static RegressionRow<order> row(const Sample& s) noexcept {
    return {{1.0, s.velocity, std::log(s.penetration)}, std::log(s.force)};
  }
  static double force(const Vector<order>& theta, const Vector<order>& phi) noexcept {
    return detail::bounded_exp(theta[0] + theta[2] * phi[2]) * (1.0 + theta[1] * phi[1]);
  }
  static Vector<order> coefficients(const Law& law, const Units& u) noexcept {
    return {detail::saturate(std::log(law.K) + law.n * u.log_penetration - u.log_force),
            detail::saturate(law.B / law.K * u.velocity), detail::saturate(law.n)};
  }
  static Law law(const Vector<order>& theta, const Units& u) noexcept {
    const double stiffness =
        detail::bounded_exp(theta[0] - theta[2] * u.log_penetration + u.log_force);
    return {stiffness, detail::saturate(theta[1] / u.velocity * stiffness),
            detail::saturate(theta[2])};
  }
  // dK = K (dθ₁ − ln x₀ dθ₃), dB = (K/v₀) dθ₂ + (B/K) dK, dn = dθ₃, at the scale x₀, v₀.
  static Matrix<order> jacobian(const Law& law, const Units& u) noexcept {
    const double depth = -u.log_penetration;
    return {{{law.K, 0.0, detail::saturate(law.K * depth)},
             {law.B, detail::saturate(law.K / u.velocity), detail::saturate(law.B * depth)},
             {0.0, 0.0, 1.0}}};
  }
  // The diagonal of J P Jᵀ in closed form, because a trace needs it at every sample.
  static Vector<order> variances(const Matrix<order>& p, const Law& law, const Units& u) noexcept {
    const double depth = -u.log_penetration;
    const double log_stiffness = p[0][0] + depth * (2.0 * p[0][2] + depth * p[2][2]);
    const double dissipation = detail::saturate(law.K / u.velocity);
    const double shared = dissipation * (p[0][1] + depth * p[1][2]);
    return {law.K * law.K * log_stiffness,
            law.B * (law.B * log_stiffness + 2.0 * shared) + dissipation * dissipation * p[1][1],
            p[2][2]};
  }
};

// The single-stage method with a known exponent: y = ln F − n ln x, φ = [1, v], θ = [ln K, B/K].
struct KnownExponentLogRegression : HuntCrossleyLogRegression {
  static constexpr std::size_t order = 2;
  static constexpr Law initial{0.1, 0.0, 1.5};  // n is the known exponent; default: a sphere's
  static constexpr Vector<order> initial_variances{1e3, 1e3};

  struct Row : RegressionRow<order> {
    double power;  // n ln x
  };

  explicit KnownExponentLogRegression(const Law& start) noexcept : exponent(start.n) {}

  Row row(const Sample& s) const noexcept {
    const double power = exponent * std::log(s.penetration);
    return {{{1.0, s.velocity}, std::log(s.force) - power}, power};
  }
  static double predict(const Vector<order>& theta, const Row& row) noexcept {
    return detail::bounded_exp(theta[0] + row.power) * (1.0 + theta[1] * row.regressor[1]);
  }
  static Vector<order> coefficients(const Law& law, const Units& u) noexcept {
    const Vector<3> all = HuntCrossleyLogRegression::coefficients(law, u);
    return {all[0], all[1]};
  }
  Law law(const Vector<order>& theta, const Units& u) const noexcept {
    return HuntCrossleyLogRegression::law({theta[0], theta[1], exponent}, u);
  }
  double exponent;  // known, without error
};

namespace detail {

// Checks that the squares and reciprocals of the variances are far from both ends of a double.
template <std::size_t Size>
constexpr const char* validate_covariance(const Matrix<Size>& p) noexcept {
  for (std::size_t i = 0; i < Size; ++i) {
    if (!lies_in(p[i][i], 1e-20, 1e20)) {
      return "method.initial_covariance must have variances in [1e-20, 1e20]";
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (!(p[i][j] == p[j][i])) return "method.initial_covariance must be symmetric";
    }
  }
  if (!is_positive_definite(p)) return "method.initial_covariance must be positive definite";
  return nullptr;
}

// Checks a known exponent.
constexpr const char* validate_known_exponent(double exponent) noexcept {
  return lies_in(exponent, 0.1, 10.0) ? nullptr : "method: a known exponent must be in [0.1, 10]";
}

template <class Law>
constexpr const char* validate_initial(const Law& law) noexcept {
  for (const double value : law.parameters()) {
    if (!lies_in(value, -largest_parameter, largest_parameter)) {
      return "method.initial must be finite parameters, within ±1e100";
    }
  }
  return nullptr;
}

}  // namespace detail

template <class Regression>
struct RegressionSettings {
  typename Regression::Law initial = Regression::initial;
  // Covariance of θ, in scaled units.
  Matrix<Regression::order> initial_covariance = diagonal(Regression::initial_variances);

  bool operator==(const RegressionSettings&) const = default;
};

template <class Regression>
constexpr const char* validate(const RegressionSettings<Regression>& settings) noexcept {
  if (const char* fault = detail::validate_initial(settings.initial)) return fault;
  if constexpr (std::is_same_v<typename Regression::Law, HuntCrossley>) {
    if (!(settings.initial.K > 0.0)) {
      return "method.initial must have K > 0, as its logarithm is taken";
    }
  }
  if constexpr (std::is_same_v<Regression, KnownExponentLogRegression>) {
    if (const char* fault = detail::validate_known_exponent(settings.initial.n)) {
      return fault;
    }
  }
  return detail::validate_covariance(settings.initial_covariance);
}

namespace detail {

// Tests the standard errors of a regression of ln F by its residuals e. Noise of the force has a
// variance of σ²/F² in ln F and biases it by −σ²/2F², most in light contact, whereas s² P assumes
// the same variance everywhere. With Q = P W/N, where N counts all samples without forgetting and W
// is the weight of the samples in P, Q [Σ e² φφᵀ] Q is the variance and −½ Q Σ e² φ the bias.
template <std::size_t Order>
class LightContact {
 public:
  static constexpr std::uint64_t stride = 4;  // every fourth sample suffices, and saves time

  // φ₀ = 1, so the first row of the sum is Σ e² φ. A separate function, so that the step of every
  // sample stays in registers.
  [[gnu::noinline]] void add(const Vector<Order>& phi, double error) noexcept {
    for (std::size_t i = 0; i < Order; ++i) {
      const double part = error * error * phi[i];
      for (std::size_t j = i; j < Order; ++j) scatter_[i][j] += part * phi[j];
    }
    count_ += 1.0;
  }

  // Whether there are enough samples, with e² above rounding and the error of condition 10.
  bool measured() const noexcept { return count_ >= 25.0 && scatter_[0][0] > 1e-6 * count_; }

  // The rms error of a parameter over its standard error; `slope` is its derivative with respect to
  // θ.
  double excess(const LeastSquares<Order>& fit, const Vector<Order>& slope) const noexcept {
    const Vector<Order> a = multiply(fit.covariance(), slope);
    const double bias = 0.5 * dot(a, scatter_[0]);
    double square = stride * bias * bias;
    for (std::size_t i = 0; i < Order; ++i) {
      square += a[i] * a[i] * scatter_[i][i];
      for (std::size_t j = i + 1; j < Order; ++j) square += 2.0 * a[i] * a[j] * scatter_[i][j];
    }
    return std::sqrt(square * fit.state().weight / (scatter_[0][0] * dot(a, slope)));
  }

 private:
  Matrix<Order> scatter_{};  // the upper triangle
  double count_ = 0.0;
};

struct NoLightContact {};

// A regression with its known parameters from the start.
template <class Regression>
Regression regression_of(const typename Regression::Law& initial) noexcept {
  if constexpr (std::is_empty_v<Regression>) {
    return {};
  } else {
    return Regression(initial);
  }
}

// The matrix with rows and columns of 0 for known parameters, which come last.
template <std::size_t Size, std::size_t Order>
constexpr Matrix<Size> among_known(const Matrix<Order>& m) noexcept {
  if constexpr (Size == Order) {
    return m;
  } else {
    Matrix<Size> result{};
    for (std::size_t i = 0; i < Order; ++i) {
      for (std::size_t j = 0; j < Order; ++j) result[i][j] = m[i][j];
    }
    return result;
  }
}

}  // namespace detail

template <class Regression>
class RegressionMethod {
 public:
  using Law = typename Regression::Law;
  static constexpr std::size_t order = Regression::order;
  static constexpr std::size_t size = Law::size;
  using Row = decltype(std::declval<const Regression&>().row(Sample{}));
  using Settings = RegressionSettings<Regression>;

  static constexpr Forgetting::Settings default_forgetting = fading_forgetting;
  static constexpr Scale default_scale{};
  static constexpr bool forgets = true;
  static constexpr bool perturbs = true;
  // Larger scaled inputs are refused: up to this squares and products stay finite.
  static constexpr double largest_input = 1e100;

  RegressionMethod(const Settings& settings, const Units& units) noexcept
      : regression_(detail::regression_of<Regression>(settings.initial)),
        initial_covariance_(settings.initial_covariance),
        least_squares_(
            {Regression::coefficients(settings.initial, units), settings.initial_covariance}) {}

  bool in_range(const Sample& s) const noexcept {
    return detail::touching(s) && detail::within(s, largest_input);
  }

  Row prepare(const Sample& sample, double) const noexcept { return regression_.row(sample); }

  double predict(const Row& row) const noexcept {
    if constexpr (requires { Regression::predict(least_squares_.parameters(), row); }) {
      return Regression::predict(least_squares_.parameters(), row);
    } else {
      return Regression::force(least_squares_.parameters(), row.regressor);
    }
  }

  Status learn(const Row& row, double, double forgetting_factor, double perturbation) noexcept {
    const Status status =
        least_squares_.update(row.regressor, row.output, forgetting_factor, perturbation);
    if constexpr (logarithmic) {
      if (taken(status) && least_squares_.samples() % light_.stride == 0) {
        light_.add(row.regressor, row.output - least_squares_.predict(row.regressor));
      }
    }
    return status;
  }

  // Restarts at the present estimate, with the initial covariance.
  void reinitialise() noexcept {
    least_squares_ = LeastSquares<order>({least_squares_.parameters(), initial_covariance_});
    light_ = {};
  }
  void reinitialise_after_transient() noexcept { reinitialise(); }

  const LeastSquares<order>& least_squares() const noexcept { return least_squares_; }

  Law law(const Units& units) const noexcept {
    return regression_.law(least_squares_.parameters(), units);
  }

  double force(const Units& units, double x, double v) const noexcept {
    return law(units).force(x, v);
  }

  Fit<Law> fit(const Units& units) const noexcept {
    const Law now = law(units);
    const auto jacobian = Regression::jacobian(now, units);
    Fit<Law> fit{
        now, detail::congruence(jacobian, detail::among_known<size>(least_squares_.scaled_root()))};
    if constexpr (logarithmic) {
      // An excess of 1.4 lowers the coverage of 95 % to 84 %.
      constexpr double most = 1.4;
      for (std::size_t i = 0; i < size && light_.measured(); ++i) {
        Vector<order> slope;
        std::copy_n(jacobian[i].begin(), order, slope.begin());
        if (light_.excess(least_squares_, slope) > most) fit.flags = light_contact;
      }
    }
    return fit;
  }

  Snapshot<Law> snapshot(const Units& units) const noexcept {
    const Law now = law(units);
    return {now, variances(now, units)};
  }

 private:
  // The diagonal of fit().covariance.
  Vector<size> variances(const Law& law, const Units& units) const noexcept {
    Vector<size> result =
        Regression::variances(detail::among_known<size>(least_squares_.covariance()), law, units);
    const double noise = least_squares_.noise_variance();
    for (double& entry : result) entry *= noise;
    return result;
  }

  static constexpr bool logarithmic = std::is_same_v<Law, HuntCrossley>;

  [[no_unique_address]] Regression regression_;
  Matrix<order> initial_covariance_;
  LeastSquares<order> least_squares_;
  [[no_unique_address]] std::conditional_t<logarithmic, detail::LightContact<order>,
                                           detail::NoLightContact> light_;
};

// The double-stage method (Diolaiti, Melchiorri & Stramigioli 2005; the paper's eqs. 3–6).
//
//   stage 1:  y = F,                φ = [x^n̂, x^n̂ v]  → K̂, B̂   (n̂ of the previous sample)
//   stage 2:  y = ln(F / (K̂ + B̂ v)), φ = ln x          → n̂       (skipped while K̂ + B̂ v ≤ 0)
//
// Each stage treats the other's estimate as the truth, so from most starts it stalls on a ridge
// between K and n. This is a property of the published method.
class DoubleStageMethod {
 public:
  using Law = HuntCrossley;

  struct Settings {
    Law initial{0.1, 0.0, 1.0};
    // The covariance of [K, B], in scaled units, and the variance of n, with no covariance between
    // the stages. In SI φ² is near 1e-4: a smaller variance would keep K at its start.
    Matrix<3> initial_covariance = diagonal<3>({1e8, 1e8, 1e3});
    // The exponent of the start is known, as for a tip of known shape: no stage 2.
    bool exponent_known = false;

    bool operator==(const Settings&) const = default;
  };

  // The regressors of both stages; n̂ is that of the previous sample.
  struct Row {
    Vector<2> regressor;  // of stage 1
    double depth;         // ln ξ, the regressor of stage 2
    double velocity;
    double force;
  };

  static constexpr Forgetting::Settings default_forgetting = fading_forgetting;
  static constexpr Scale default_scale{};
  static constexpr bool forgets = true;
  static constexpr bool perturbs = true;
  static constexpr double largest_input = 1e100;  // as RegressionMethod's

  DoubleStageMethod(const Settings& settings, const Units& units) noexcept
      : settings_(settings),
        stage_one_({in_scaled_units(settings.initial, units), of_stage_one(settings)}),
        stage_two_({{detail::saturate(settings.initial.n)}, of_stage_two(settings)}) {}

  bool in_range(const Sample& s) const noexcept {
    return detail::touching(s) && detail::within(s, largest_input);
  }

  Row prepare(const Sample& sample, double) const noexcept {
    const double depth = std::log(sample.penetration);
    // xⁿ stays within e^±100, so that its square is finite and far from the subnormal.
    const double power = std::exp(std::clamp(stage_two_.parameters()[0] * depth, -100.0, 100.0));
    return {{power, power * sample.velocity}, depth, sample.velocity, sample.force};
  }

  double predict(const Row& row) const noexcept { return stage_one_.predict(row.regressor); }

  Status learn(const Row& row, double, double forgetting_factor, double perturbation) noexcept {
    const LeastSquares<2>::State before = stage_one_.state();
    const Status status =
        stage_one_.update(row.regressor, row.force, forgetting_factor, perturbation);
    if (!taken(status)) return status;

    if (settings_.exponent_known) return status;
    const Vector<2>& stiffness = stage_one_.parameters();
    const double rate = stiffness[0] + stiffness[1] * row.velocity;
    if (!(rate > 0.0)) return status;
    const double output = std::log(row.force / rate);
    if (!std::isfinite(output)) return status;
    const Status second = stage_two_.update({row.depth}, output, forgetting_factor, perturbation);
    if (!taken(second)) stage_one_.restore(before);  // a refused sample changes nothing
    return second == Status::updated ? status : second;
  }

  // Restarts at the present estimate, with the initial covariance.
  void reinitialise() noexcept {
    stage_one_ = LeastSquares<2>({stage_one_.parameters(), of_stage_one(settings_)});
    stage_two_ = LeastSquares<1>({stage_two_.parameters(), of_stage_two(settings_)});
  }
  void reinitialise_after_transient() noexcept { reinitialise(); }

  const LeastSquares<2>& stage_one() const noexcept { return stage_one_; }
  const LeastSquares<1>& stage_two() const noexcept { return stage_two_; }

  Law law(const Units& u) const noexcept {
    const double exponent = detail::saturate(stage_two_.parameters()[0]);
    const double unit = u.force * detail::bounded_exp(-exponent * u.log_penetration);
    return {detail::saturate(stage_one_.parameters()[0] * unit),
            detail::saturate(stage_one_.parameters()[1] * unit / u.velocity), exponent};
  }

  double force(const Units& u, double x, double v) const noexcept { return law(u).force(x, v); }

  // The covariance is that of the separate stages: K and n appear independent except for the unit
  // of K, which depends on n.
  Fit<Law> fit(const Units& u) const noexcept {
    const Law now = law(u);
    return {now,
            detail::congruence(jacobian(now, u), of_stages(stage_one_.scaled_root(),
                                                           of_exponent(stage_two_.scaled_root())))};
  }

  Snapshot<Law> snapshot(const Units& u) const noexcept {
    const Law now = law(u);
    return {now, detail::congruent_diagonal(
                     jacobian(now, u), of_stages(stage_one_.scaled_covariance(),
                                                 of_exponent(stage_two_.scaled_covariance())))};
  }

 private:
  static Matrix<2> of_stage_one(const Settings& settings) noexcept {
    const auto& p = settings.initial_covariance;
    return {{{p[0][0], p[0][1]}, {p[1][0], p[1][1]}}};
  }
  static Matrix<1> of_stage_two(const Settings& settings) noexcept {
    return {{{settings.initial_covariance[2][2]}}};
  }

  static Vector<2> in_scaled_units(const Law& law, const Units& u) noexcept {
    const double unit = detail::bounded_exp(law.n * u.log_penetration) / u.force;
    return {detail::saturate(law.K * unit), detail::saturate(law.B * unit * u.velocity)};
  }

  // Derivative of (K, B, n) in SI by [K, B] in scaled units and n.
  static Matrix<3> jacobian(const Law& law, const Units& u) noexcept {
    const double unit = detail::saturate(u.force * detail::bounded_exp(-law.n * u.log_penetration));
    return {
        {{unit, 0.0, detail::saturate(-law.K * u.log_penetration)},
         {0.0, detail::saturate(unit / u.velocity), detail::saturate(-law.B * u.log_penetration)},
         {0.0, 0.0, 1.0}}};
  }

  Matrix<1> of_exponent(const Matrix<1>& two) const noexcept {
    return settings_.exponent_known ? Matrix<1>{} : two;
  }

  static Matrix<3> of_stages(const Matrix<2>& one, const Matrix<1>& two) noexcept {
    return {{{one[0][0], one[0][1], 0.0}, {one[1][0], one[1][1], 0.0}, {0.0, 0.0, two[0][0]}}};
  }

  Settings settings_;
  LeastSquares<2> stage_one_;
  LeastSquares<1> stage_two_;
};

constexpr const char* validate(const DoubleStageMethod::Settings& settings) noexcept {
  if (const char* fault = detail::validate_initial(settings.initial)) return fault;
  if (settings.exponent_known) {
    if (const char* fault = detail::validate_known_exponent(settings.initial.n)) {
      return fault;
    }
  }
  const auto& p = settings.initial_covariance;
  if (p[0][2] != 0.0 || p[1][2] != 0.0) {
    return "method.initial_covariance must be zero between [K, B] and n";
  }
  return detail::validate_covariance(p);
}

}  // namespace palpate
