#include <cstddef>
#include <optional>
#include <utility>

#include "conversions.hpp"
#include "palpate/force_laws.hpp"

namespace palpate::bindings {
namespace {

// law(parameters, penetration, velocity, force): fills `force`, by one law, or by one a row.
template <class Law>
void bind_force(nb::module_& module, const char* name) {
  module.def(name, [](const InputArray& parameters, const InputArray& penetration,
                      const InputArray& velocity, const OutputArray& force) {
    const std::size_t laws = parameters.size() / Law::size;
    if (laws == 0 || parameters.size() % Law::size != 0 || penetration.size() % laws != 0 ||
        velocity.size() != penetration.size() || force.size() != penetration.size()) {
      throw nb::value_error("the arrays must have the law's size and the samples' number");
    }
    const std::size_t samples = penetration.size() / laws;
    std::optional<nb::gil_scoped_release> release;
    if (laws > 1) release.emplace();
    for (std::size_t row = 0; row < laws; ++row) {
      const double* own = parameters.data() + row * Law::size;
      const Law law = [&]<std::size_t... I>(std::index_sequence<I...>) {
        return Law{own[I]...};
      }(std::make_index_sequence<Law::size>{});
      for (std::size_t k = row * samples; k < (row + 1) * samples; ++k) {
        force.data()[k] = law.force(penetration.data()[k], velocity.data()[k]);
      }
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
