// Compiled once for each instruction set; see cmake/InstructionSets.cmake.
#include "compiled_kernels.hpp"
#include "palpate/lanes/kernel.hpp"

#define PALPATE_COMPILED_(set) compiled_##set
#define PALPATE_COMPILED(set) PALPATE_COMPILED_(set)

namespace palpate::lanes {

const Kernels PALPATE_COMPILED(PALPATE_LANES_SET) = kernels;

}  // namespace palpate::lanes
