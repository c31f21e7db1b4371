// A force law identified by one recursive least squares: KV-RLS, EKV-RLS and the single stage.
#pragma once

#include <cstddef>

#include "palpate/estimate.hpp"
#include "palpate/least_squares.hpp"
#include "palpate/matrix.hpp"
#include "palpate/regressions.hpp"
#include "palpate/scale.hpp"
#include "palpate/status.hpp"

namespace palpate {

template <class Regression>
class RegressionMethod {
 public:
  static constexpr bool prediction_lags = false;
  static constexpr bool takes_approach = false;
  // Scaled inputs beyond this are refused: squares and products stay finite below it.
  static constexpr double largest_input = 1e100;
  using Law = typename Regression::Law;
  static constexpr std::size_t order = Regression::order;

  struct Settings {
    Law initial;
    Matrix<order> initial_covariance;  // of θ, in scaled units
  };

  RegressionMethod(const Settings& settings, const Units& units) noexcept
      : initial_covariance_(settings.initial_covariance),
        least_squares_(
            {Regression::coefficients(settings.initial, units), settings.initial_covariance}) {}

  // `adapt` is called with a function that gives the a-priori force, which only some need, and
  // returns λ and π.
  template <class Adapt>
  Status learn(const Sample& sample, double, Adapt&& adapt) noexcept {
    const auto row = Regression::row(sample);
    const auto [forgetting_factor, perturbation] = adapt(
        [&]() noexcept { return Regression::force(least_squares_.parameters(), row.regressor); });
    return least_squares_.update(row.regressor, row.output, forgetting_factor, perturbation);
  }

  // Begins anew from the old answer, as uncertain as at the start.
  void restart() noexcept {
    least_squares_ = LeastSquares<order>({least_squares_.parameters(), initial_covariance_});
  }

  void restart_again() noexcept { restart(); }
  const LeastSquares<order>& least_squares() const noexcept { return least_squares_; }

  Law law(const Units& units) const noexcept {
    return Regression::law(least_squares_.parameters(), units);
  }

  double force(const Units& units, double x, double v) const noexcept {
    return law(units).force(x, v);
  }

  Fit<Law> fit(const Units& units) const noexcept {
    const Law now = law(units);
    return {now, congruence(Regression::jacobian(now, units), least_squares_.scaled_root())};
  }

  Moment<Law> moment(const Units& units) const noexcept {
    const Law now = law(units);
    return {now, variances(now, units)};
  }

 private:
  // The diagonal of fit().covariance.
  Vector<order> variances(const Law& law, const Units& units) const noexcept {
    Vector<order> result = Regression::variances(least_squares_.covariance(), law, units);
    const double noise = least_squares_.noise_variance();
    for (double& entry : result) entry *= noise;
    return result;
  }

  Matrix<order> initial_covariance_;
  LeastSquares<order> least_squares_;
};

}  // namespace palpate
