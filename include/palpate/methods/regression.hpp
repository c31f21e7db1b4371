// A force law identified by one recursive least squares: KV-RLS, EKV-RLS and the single stage.
#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>

#include "palpate/contact_gate.hpp"
#include "palpate/estimate.hpp"
#include "palpate/forgetting.hpp"
#include "palpate/least_squares.hpp"
#include "palpate/matrix.hpp"
#include "palpate/methods/regressions.hpp"
#include "palpate/sample.hpp"
#include "palpate/status.hpp"

namespace palpate {

template <class Regression>
struct RegressionSettings {
  typename Regression::Law initial = Regression::initial;
  // Of θ, in scaled units.
  Matrix<Regression::order> initial_covariance = diagonal(Regression::initial_variances);

  bool operator==(const RegressionSettings&) const = default;
};

template <class Regression>
constexpr const char* validate(const RegressionSettings<Regression>& settings) noexcept {
  if (const char* fault = detail::validate_initial(settings.initial)) return fault;
  if constexpr (std::is_same_v<typename Regression::Law, HuntCrossley>) {
    if (!(settings.initial.stiffness > 0.0)) {
      return "method.initial must have stiffness > 0, for its logarithm";
    }
  }
  if constexpr (std::is_same_v<Regression, KnownExponentLogRegression>) {
    if (const char* fault = detail::validate_known_exponent(settings.initial.exponent)) {
      return fault;
    }
  }
  return detail::validate_covariance(settings.initial_covariance);
}

namespace detail {

// A regression of its own, where something of it is in the start.
template <class Regression>
Regression regression_of(const typename Regression::Law& initial) noexcept {
  if constexpr (std::is_empty_v<Regression>) {
    return {};
  } else {
    return Regression(initial);
  }
}

// The matrix of the first coefficients among all, of which the others are known.
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
  // Scaled inputs beyond this are refused: squares and products stay finite below it.
  static constexpr double largest_input = 1e100;

  RegressionMethod(const Settings& settings, const Units& units) noexcept
      : regression_(detail::regression_of<Regression>(settings.initial)),
        initial_covariance_(settings.initial_covariance),
        least_squares_(
            {Regression::coefficients(settings.initial, units), settings.initial_covariance}) {}

  constexpr ContactGate::Settings gate(const ContactGate::Settings& given,
                                       const Units&) const noexcept {
    return given;
  }
  bool in_range(const Sample& s) const noexcept {
    return detail::touching(s) && detail::within(s, largest_input);
  }

  Row prepare(const Sample& sample) const noexcept { return regression_.row(sample); }

  double predict(const Row& row) const noexcept {
    if constexpr (requires { Regression::predict(least_squares_.parameters(), row); }) {
      return Regression::predict(least_squares_.parameters(), row);
    } else {
      return Regression::force(least_squares_.parameters(), row.regressor);
    }
  }

  Status learn(const Row& row, double, double forgetting_factor, double perturbation) noexcept {
    return least_squares_.update(row.regressor, row.output, forgetting_factor, perturbation);
  }

  // From the old answer, as uncertain as at the start.
  void reinitialise() noexcept {
    least_squares_ = LeastSquares<order>({least_squares_.parameters(), initial_covariance_});
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
    return {now, detail::congruence(Regression::jacobian(now, units),
                                    detail::among_known<size>(least_squares_.scaled_root()))};
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

  [[no_unique_address]] Regression regression_;
  Matrix<order> initial_covariance_;
  LeastSquares<order> least_squares_;
};

}  // namespace palpate
