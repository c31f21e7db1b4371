// The core of palpate: identification of contact models, one sample at a time.
#pragma once

#include "palpate/estimate.hpp"
#include "palpate/estimators.hpp"
#include "palpate/online_preparation.hpp"
#include "palpate/payload_compensation.hpp"
