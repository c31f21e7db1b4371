// The estimators of laws that may remember, by name; apart, as few loops need them.
#pragma once

#include "palpate/estimators.hpp"
#include "palpate/methods/viscoelastic.hpp"

namespace palpate {

// Six relaxation times, of which the sums hold the mean alone.
using ViscoelasticContact = RecursiveEstimator<ViscoelasticMethod<viscoelastic::FlatSums>>;
// Twelve, with all pairs of them: some 20 kB.
using FullViscoelasticContact = RecursiveEstimator<ViscoelasticMethod<viscoelastic::PairSums>>;

}  // namespace palpate
