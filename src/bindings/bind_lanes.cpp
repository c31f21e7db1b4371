// Which instruction sets there are for contacts in lanes.
#include "compiled_kernels.hpp"
#include "palpate/lanes/screening.hpp"
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

// A threshold of 0 rejects nothing.
void screen_contacts(const InputRows& penetration, const InputRows& velocity,
                     const InputRows& force, const InputRows& gates, double sample_time,
                     double threshold, const StatusArray& touching, const StatusArray& sound,
                     std::size_t threads) {
  const std::size_t count = penetration.shape(0), samples = penetration.shape(1);
  if (velocity.size() != penetration.size() || force.size() != penetration.size() ||
      touching.size() != penetration.size() || gates.size() != 3 * count || sound.size() != count) {
    throw nb::value_error("the arrays must have the contacts' number and their samples'");
  }
  std::optional<OutlierRejection::Settings> outliers;
  if (threshold > 0.0) outliers = {threshold};
  const nb::gil_scoped_release release;
  in_parts(count, threads, [&](std::size_t first, std::size_t last) {
    for (std::size_t contact = first; contact < last; ++contact) {
      const std::size_t start = contact * samples;
      const double* gate = gates.data() + 3 * contact;
      const Signals in{penetration.data() + start, velocity.data() + start, force.data() + start,
                       nullptr, samples};
      sound.data()[contact] = lanes::screened(in, sample_time, {gate[0], gate[1], gate[2]},
                                              outliers, touching.data() + start);
    }
  });
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
  module.def(
      "screen_contacts", &screen_contacts, nb::arg("penetration"), nb::arg("velocity"),
      nb::arg("force"), nb::arg("gates"), nb::arg("sample_time"), nb::arg("threshold"),
      nb::arg("touching"), nb::arg("sound"), nb::arg("threads"),
      "Fills, for contacts as rows, which samples are in contact; and whether a rejection of "
      "outliers with this threshold would leave none of them out.");
}

}  // namespace palpate::bindings
