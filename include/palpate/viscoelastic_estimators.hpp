// The estimator of laws with memory; in a separate header, because few loops need it.
#pragma once

#include "palpate/estimators.hpp"
#include "palpate/methods/viscoelastic.hpp"

namespace palpate {

// Ten relaxation times, with all their pairs: about 20 kB.
using ViscoelasticContact = RecursiveEstimator<ViscoelasticMethod>;

}  // namespace palpate
