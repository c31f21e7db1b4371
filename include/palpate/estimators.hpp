// The estimators by name, as in Python. To add one: its method in methods/, and an alias here.
//
//   palpate::SingleStageRLS estimator(settings);            // without change detection
//   palpate::WithChangeDetector<palpate::SingleStageRLS>    // restarts at a detected change
//   palpate::WithOutlierRejection<palpate::SingleStageRLS>  // rejects outliers
#pragma once

#include "palpate/methods/drift_tracking.hpp"
#include "palpate/methods/regression.hpp"
#include "palpate/methods/variable_projection.hpp"
#include "palpate/recursive_estimator.hpp"

namespace palpate {

using KelvinVoigtRLS = RecursiveEstimator<RegressionMethod<KelvinVoigtRegression>>;
using ExtendedKelvinVoigtRLS = RecursiveEstimator<RegressionMethod<ExtendedKelvinVoigtRegression>>;
using SingleStageRLS = RecursiveEstimator<RegressionMethod<HuntCrossleyLogRegression>>;
// For a tip of known shape: the exponent is that of the initial law.
using SingleStageKnownExponentRLS =
    RecursiveEstimator<RegressionMethod<KnownExponentLogRegression>>;
using DoubleStageRLS = RecursiveEstimator<DoubleStageMethod>;
using VariableProjection = RecursiveEstimator<VariableProjectionMethod<detail::ContactSolver>>;
// Also estimates the surface position, with forty-one banks of sums, about 90 kB.
using VariableProjectionWithSurface =
    RecursiveEstimator<VariableProjectionMethod<detail::SurfaceSolver>>;
using DriftTracking = RecursiveEstimator<DriftTrackingMethod>;

template <class Estimator>
using WithChangeDetector =
    RecursiveEstimator<typename Estimator::Method, ChangeDetector, typename Estimator::Outliers>;

template <class Estimator>
using WithOutlierRejection =
    RecursiveEstimator<typename Estimator::Method, typename Estimator::Changes, OutlierRejection>;

}  // namespace palpate
