// The estimators by name, as in Python. To add one: its method in methods/, and an alias here.
//
//   palpate::SingleStageRLS estimator(settings);            // no change is looked for
//   palpate::WithChangeDetector<palpate::SingleStageRLS>    // reinitialised when one is found
//   palpate::WithOutlierRejection<palpate::SingleStageRLS>  // outliers are left out
#pragma once

#include "palpate/methods/drift_tracking.hpp"
#include "palpate/methods/regression.hpp"
#include "palpate/methods/variable_projection.hpp"
#include "palpate/recursive_estimator.hpp"

namespace palpate {

using KelvinVoigtRLS = RecursiveEstimator<RegressionMethod<KelvinVoigtRegression>>;
using ExtendedKelvinVoigtRLS = RecursiveEstimator<RegressionMethod<ExtendedKelvinVoigtRegression>>;
using SingleStageRLS = RecursiveEstimator<RegressionMethod<HuntCrossleyLogRegression>>;
// For a tip whose shape is known: the exponent is the start's.
using SingleStageKnownExponentRLS =
    RecursiveEstimator<RegressionMethod<KnownExponentLogRegression>>;
using DoubleStageRLS = RecursiveEstimator<DoubleStageMethod>;
using VariableProjection = RecursiveEstimator<VariableProjectionMethod<detail::ContactSolver>>;
// Searches for the surface too; it holds forty-one banks of sums, some 90 kB.
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
