// Laws with memory: their force along a motion, and the estimators of them.
#include <cmath>
#include <limits>

#include "face.hpp"
#include "palpate/force_laws.hpp"
#include "palpate/viscoelastic_estimators.hpp"

namespace palpate::bindings {
namespace {

using viscoelastic::RelaxationBranches;

GeneralisedHuntCrossley law_in(const InputArray& parameters) {
  if (parameters.size() != GeneralisedHuntCrossley::size) {
    throw nb::value_error("a generalised Hunt-Crossley law has eight parameters");
  }
  return law_of<GeneralisedHuntCrossley>(parameters.data());
}

// Relaxation times [s] and weights of the branches that stand for a law's spectrum.
nb::tuple branches_of(const InputArray& parameters) {
  const RelaxationBranches branches(law_in(parameters));
  return nb::make_tuple(copied_array(branches.times.data(), {branches.count}),
                        copied_array(branches.weights.data(), {branches.count}));
}

// Fills `force` along a motion, and takes the state with it.
void force_along(const InputArray& parameters, const InputArray& time_steps,
                 const InputArray& penetration, const InputArray& velocity,
                 const OutputArray& state, const OutputArray& force) {
  const GeneralisedHuntCrossley law = law_in(parameters);
  const RelaxationBranches branches(law);
  const std::size_t count = penetration.size();
  if (time_steps.size() != count || velocity.size() != count || force.size() != count ||
      state.size() != branches.count + 1) {
    throw nb::value_error("the arrays must have the samples' number, the state one a branch more");
  }
  double passed = 0.0;  // since the last sample whose place is known
  for (std::size_t k = 0; k < count; ++k) {
    const double x = penetration.data()[k];
    passed += time_steps.data()[k];
    if (!std::isfinite(x)) {
      force.data()[k] = std::numeric_limits<double>::quiet_NaN();
      continue;
    }
    relax(law, branches, x, passed, state.data());
    passed = 0.0;
    force.data()[k] = relaxing_force(law, branches, x, velocity.data()[k], state.data());
  }
}

using Plain = ViscoelasticContact;
using Full = FullViscoelasticContact;
using ViscoelasticFace = FaceOf<Plain>;
constexpr const char* name = "ViscoelasticContact";

void make_viscoelastic(ViscoelasticFace* self, std::uint32_t offered, double exponent, bool offset,
                       double offset_deviation, double surface_deviation, const Loop& loop) {
  const ViscoelasticSettings method{.offered = static_cast<viscoelastic::Offered>(offered),
                                    .exponent = exponent,
                                    .offset = offset,
                                    .offset_deviation = offset_deviation / scale_of(loop)[2],
                                    .surface_deviation = surface_deviation / scale_of(loop)[0],
                                    .sample_time = std::get<6>(loop)};
  if ((offered >> viscoelastic::everyday_candidates) != 0) {
    new (self) ViscoelasticFace(core_of<Full>(name, 1, method, loop));
  } else {
    new (self) ViscoelasticFace(core_of<Plain>(name, 0, method, loop));
  }
}

// The candidates at the last verdict on these samples, if there was one: a row of candidate, score
// and RSS/N [N²]; samples, N_eff, the chosen one; of the motion the mean depth, m, and the
// frequency, rad/s; whether it began in contact; and mean velocity over its root mean square.
template <class Estimator>
nb::tuple evidence_of(const Estimator& core) {
  const auto& solver = core.method().solver();
  const auto& verdict = solver.verdict();
  const Units& units = core.units();
  nb::list rows;
  for (std::size_t i = 0; i < solver.count && solver.decided(); ++i) {
    if (!(verdict.mean_square[i] > 0.0)) continue;
    rows.append(nb::make_tuple(i, verdict.score(i, verdict.closest()),
                               verdict.mean_square[i] * units.force * units.force));
  }
  const auto motion = solver.samples().motion();
  return nb::make_tuple(rows, solver.samples().weight(), verdict.effective,
                        solver.solution().fit.candidate, motion.depth * units.penetration,
                        std::sqrt(motion.frequency_squared) * units.velocity / units.penetration,
                        core.method().began_in_contact(), motion.one_way);
}

// Calls `act` with the estimator, whichever of the two it is.
template <class Act>
decltype(auto) with(ViscoelasticFace& face, const Act& act) {
  Core& core = face.core();
  if (auto* plain = dynamic_cast<CoreOf<Plain>*>(&core)) return act(plain->estimator);
  return act(static_cast<CoreOf<Full>&>(core).estimator);
}

}  // namespace

void bind_viscoelastic(nb::module_& module) {
  module.def("relaxation_branches", &branches_of, nb::arg("parameters"),
             nb::sig("def relaxation_branches(parameters: numpy.typing.NDArray[numpy.float64]) -> "
                     "tuple[numpy.typing.NDArray[numpy.float64], "
                     "numpy.typing.NDArray[numpy.float64]]"));
  module.def("generalised_force_along", &force_along);
  bind_face<Plain>(module, name)
      .def("__init__", &make_viscoelastic)
      .def(
          "settle", [](ViscoelasticFace& self) { with(self, [](auto& core) { core.settle(); }); },
          "Work out verdict and estimate by all samples so far, at once, in 0.1 ms or, of all "
          "laws, 1 ms: what is spread over the next samples otherwise.")
      .def(
          "_evidence",
          [](ViscoelasticFace& self) {
            return with(self, [](const auto& core) { return evidence_of(core); });
          },
          nb::sig("def _evidence(self) -> tuple[list[tuple[int, float, float]], float, float, int, "
                  "float, float, bool, float]"));

  nb::dict defaults;
  const ViscoelasticSettings settings;
  defaults["offset"] = settings.offset;
  defaults["exponent_range"] =
      nb::make_tuple(viscoelastic::Grid::lowest_exponent, viscoelastic::Grid::highest_exponent);
  nb::list laws;  // damping, memory, whether n is 1 and not looked for
  for (const viscoelastic::Candidate& law : viscoelastic::candidates) {
    laws.append(
        nb::make_tuple(static_cast<int>(law.damping), static_cast<int>(law.memory), law.linear));
  }
  defaults["candidates"] = laws;
  module.attr("defaults")["ViscoelasticContact"] = defaults;
}

}  // namespace palpate::bindings
