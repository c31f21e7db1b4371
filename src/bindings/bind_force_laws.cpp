#include <cstddef>
#include <utility>

#include "conversions.hpp"
#include "palpate/force_laws.hpp"

namespace palpate::bindings {
namespace {

// law(parameters, penetration, velocity, force): fills `force`.
template <class Law>
void bind_force(nb::module_& module, const char* name) {
  module.def(name, [](const InputArray& parameters, const InputArray& penetration,
                      const InputArray& velocity, const OutputArray& force) {
    if (parameters.size() != Law::size || velocity.size() != penetration.size() ||
        force.size() != penetration.size()) {
      throw nb::value_error("the arrays must have the law's size and the samples' number");
    }
    const Law law = [own = parameters.data()]<std::size_t... I>(std::index_sequence<I...>) {
      return Law{own[I]...};
    }(std::make_index_sequence<Law::size>{});
    for (std::size_t k = 0; k < penetration.size(); ++k) {
      force.data()[k] = law.force(penetration.data()[k], velocity.data()[k]);
    }
  });
}

}  // namespace

void bind_force_laws(nb::module_& module) {
  bind_force<KelvinVoigt>(module, "kelvin_voigt_force");
  bind_force<ExtendedKelvinVoigt>(module, "extended_kelvin_voigt_force");
  bind_force<HuntCrossley>(module, "hunt_crossley_force");
  bind_force<GeneralisedHuntCrossley>(module, "generalised_hunt_crossley_force");
}

}  // namespace palpate::bindings
