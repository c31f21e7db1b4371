// Everything of palpate's core: identification of contact models, one sample at a time.
#pragma once

#include "palpate/recursive_estimator.hpp"
#include "palpate/replay.hpp"
