// Compiled once for each instruction set; see cmake/InstructionSets.cmake.
#include "palpate/batch_fit/curve_kernels.hpp"

#define PALPATE_COMPILED_(set) compiled_##set
#define PALPATE_COMPILED(set) PALPATE_COMPILED_(set)

namespace palpate::curves {

extern const CurveKernels PALPATE_COMPILED(PALPATE_INSTRUCTION_SET);
const CurveKernels PALPATE_COMPILED(PALPATE_INSTRUCTION_SET) = kernels;

}  // namespace palpate::curves
