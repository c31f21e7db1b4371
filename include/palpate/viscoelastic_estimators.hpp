// The estimators of laws with memory, by name; in their own header, as few loops need them.
#pragma once

#include "palpate/estimators.hpp"
#include "palpate/methods/viscoelastic.hpp"

namespace palpate {

// Six relaxation times, of which the sums hold only the mean.
using ViscoelasticContact = RecursiveEstimator<ViscoelasticMethod<viscoelastic::FlatSums>>;
// Twelve, with all their pairs: about 20 kB.
using FullViscoelasticContact = RecursiveEstimator<ViscoelasticMethod<viscoelastic::PairSums>>;

}  // namespace palpate
