// Compiled once for each instruction set; see cmake/InstructionSets.cmake.
#include "palpate/curves/curve_kernels.hpp"

#include "compiled_curve_kernels.hpp"

#define PALPATE_COMPILED_(set) compiled_curves_##set
#define PALPATE_COMPILED(set) PALPATE_COMPILED_(set)

namespace palpate::lanes {

const CurveKernels PALPATE_COMPILED(PALPATE_LANES_SET) = curve_kernels;

}  // namespace palpate::lanes
