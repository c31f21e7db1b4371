// Which instruction sets there are for contacts in lanes.
#include "compiled_kernels.hpp"
#include "replay_many.hpp"

namespace palpate::bindings {
namespace {

constexpr const char* name_of_scalar = "scalar";

nb::list available_instruction_sets() {
  nb::list names;
  names.append(name_of_scalar);
  for (const lanes::InstructionSet set : lanes::instruction_sets) {
    if (lanes::kernels_of(set)) names.append(lanes::name_of(set));
  }
  return names;
}

}  // namespace

const lanes::Kernels* kernels_named(std::string_view name) {
  if (name == name_of_scalar) return nullptr;
  for (const lanes::InstructionSet set : lanes::instruction_sets) {
    const lanes::Kernels* kernels = lanes::kernels_of(set);
    if (kernels && name == lanes::name_of(set)) return kernels;
  }
  throw nb::value_error(("there is no instruction set " + std::string(name)).c_str());
}

void bind_lanes(nb::module_& module) {
  module.def("instruction_sets", &available_instruction_sets,
             "Names of what contacts in lanes can be computed with here, the quickest last; "
             "'scalar' is one contact at a time.",
             nb::sig("def instruction_sets() -> list[str]"));
}

}  // namespace palpate::bindings
