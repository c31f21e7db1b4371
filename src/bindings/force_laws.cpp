#include "palpate/force_laws.hpp"

#include <cstddef>

#include "conversions.hpp"

namespace palpate::bindings {
namespace {

template <class Law>
void force_over_arrays(const Law& law, const InputArray& penetration, const InputArray& velocity,
                       const OutputArray& force) {
  for (std::size_t k = 0; k < penetration.size(); ++k) {
    force.data()[k] = law.force(penetration.data()[k], velocity.data()[k]);
  }
}

}  // namespace

void bind_force_laws(nb::module_& module) {
  module.def("kelvin_voigt_force",
             [](double stiffness, double damping, const InputArray& penetration,
                const InputArray& velocity, const OutputArray& force) {
               force_over_arrays(KelvinVoigt{stiffness, damping}, penetration, velocity, force);
             });
  module.def(
      "extended_kelvin_voigt_force",
      [](double stiffness, double quadratic_stiffness, double damping,
         const InputArray& penetration, const InputArray& velocity, const OutputArray& force) {
        force_over_arrays(ExtendedKelvinVoigt{stiffness, quadratic_stiffness, damping}, penetration,
                          velocity, force);
      });
  module.def("hunt_crossley_force", [](double stiffness, double damping, double exponent,
                                       const InputArray& penetration, const InputArray& velocity,
                                       const OutputArray& force) {
    force_over_arrays(HuntCrossley{stiffness, damping, exponent}, penetration, velocity, force);
  });
}

}  // namespace palpate::bindings
