// Variable projection, compiled on its own as its sums vectorise; drift tracking, which uses it;
// and laws with memory: their force along a motion, and their estimators.
#include <cmath>
#include <limits>

#include "face.hpp"
#include "palpate/viscoelastic_estimators.hpp"

namespace palpate::bindings {
namespace {

// Noise, the range of the exponent, the known exponent or 0, whether to estimate an offset, and its
// standard deviation.
using Projection = std::tuple<double, Pair, double, bool, double>;

ProjectionSettings settings_of(const Projection& given, const Loop& loop) {
  const auto& [noise, exponents, exponent, offset, offset_deviation] = given;
  const double force_unit = scale_of(loop)[2];
  return {.noise = noise / force_unit,
          .lowest_exponent = exponents[0],
          .highest_exponent = exponents[1],
          .exponent = exponent,
          .offset = offset,
          .offset_deviation = offset_deviation / force_unit};
}

nb::dict projection_defaults(const ProjectionSettings& settings) {
  nb::dict defaults;
  defaults["offset"] = settings.offset;
  defaults["exponent_range"] = nb::make_tuple(settings.lowest_exponent, settings.highest_exponent);
  return defaults;
}

// The surface search needs forty-one banks of sums; an estimator without it has none.
using Plain = VariableProjection;
using Searching = VariableProjectionWithSurface;

void make_projection(FaceOf<Plain>* self, const Projection& given,
                     const std::tuple<std::optional<Pair>, double>& surface, const Loop& loop) {
  const auto& [surfaces, surface_deviation] = surface;
  const double unit = scale_of(loop)[0];
  ProjectionSettings projection = settings_of(given, loop);
  projection.surface_deviation = surface_deviation / unit;
  if (surfaces) {
    const SurfaceSettings searched{projection, (*surfaces)[0] / unit, (*surfaces)[1] / unit};
    new (self) FaceOf<Plain>(core_of<Searching>("VariableProjection", 1, searched, loop));
  } else {
    new (self) FaceOf<Plain>(core_of<Plain>("VariableProjection", 0, projection, loop));
  }
}

void make_drift_tracking(FaceOf<DriftTracking>* self, const Projection& given, const Triple& drift,
                         const Loop& loop) {
  const Vector<3> scaled{drift[0], drift[1] * scale_of(loop)[1], drift[2]};
  new (self) FaceOf<DriftTracking>(
      core_of<DriftTracking>("DriftTracking", 0, {settings_of(given, loop), scaled}, loop));
}

using viscoelastic::RelaxationBranches;

GeneralisedHuntCrossley law_in(const InputArray& parameters) {
  if (parameters.size() != GeneralisedHuntCrossley::size) {
    throw nb::value_error("a generalised Hunt-Crossley law has eight parameters");
  }
  return law_of<GeneralisedHuntCrossley>(parameters.data());
}

// Relaxation times [s] and weights of the branches that approximate a law's spectrum.
nb::tuple branches_of(const InputArray& parameters) {
  const RelaxationBranches branches(law_in(parameters));
  return nb::make_tuple(copied_array(branches.times.data(), {branches.count}),
                        copied_array(branches.weights.data(), {branches.count}));
}

// Fills `force` along a motion and advances the state.
void force_along(const InputArray& parameters, const InputArray& time_steps,
                 const InputArray& penetration, const InputArray& velocity,
                 const OutputArray& state, const OutputArray& force) {
  const GeneralisedHuntCrossley law = law_in(parameters);
  const RelaxationBranches branches(law);
  const std::size_t count = penetration.size();
  if (time_steps.size() != count || velocity.size() != count || force.size() != count ||
      state.size() != branches.count + 1) {
    throw nb::value_error(
        "the arrays must have one entry per sample, the state one per branch and one more");
  }
  double passed = 0.0;  // since the last sample with a known penetration
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

using Everyday = ViscoelasticContact;
using Full = FullViscoelasticContact;
using ViscoelasticFace = FaceOf<Everyday>;
constexpr const char* viscoelastic_name = "ViscoelasticContact";

void make_viscoelastic(ViscoelasticFace* self, std::uint32_t offered, double exponent, bool offset,
                       double offset_deviation, double surface_deviation, const Loop& loop) {
  const ViscoelasticSettings method{.offered = static_cast<viscoelastic::Offered>(offered),
                                    .exponent = exponent,
                                    .offset = offset,
                                    .offset_deviation = offset_deviation / scale_of(loop)[2],
                                    .surface_deviation = surface_deviation / scale_of(loop)[0],
                                    .sample_time = std::get<6>(loop)};
  if ((offered >> viscoelastic::everyday_candidates) != 0) {
    new (self) ViscoelasticFace(core_of<Full>(viscoelastic_name, 1, method, loop));
  } else {
    new (self) ViscoelasticFace(core_of<Everyday>(viscoelastic_name, 0, method, loop));
  }
}

// The candidates at the last verdict on these samples, if any: rows of candidate, score and RSS/N
// [N²]; samples, N_eff, the selected one; the motion's mean depth, m, and frequency, rad/s; whether
// it began in contact; and mean velocity over rms velocity.
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

// Calls `act` with the estimator, of either type.
template <class Act>
decltype(auto) with(ViscoelasticFace& face, const Act& act) {
  Core& core = face.core();
  if (auto* plain = dynamic_cast<CoreOf<Everyday>*>(&core)) return act(plain->estimator);
  return act(static_cast<CoreOf<Full>&>(core).estimator);
}

}  // namespace

void bind_projection(nb::module_& module) {
  bind_face<Plain>(module, "VariableProjection")
      .def("__init__", &make_projection)
      .def(
          "_unround_as",
          [](FaceOf<Plain>& self, FaceOf<Plain>& earlier) {
            auto* own = dynamic_cast<CoreOf<Plain>*>(&self.core());
            auto* other = dynamic_cast<CoreOf<Plain>*>(&earlier.core());
            return own && other && own->estimator.unround_as(other->estimator);
          },
          nb::arg("earlier"),
          "Take the rounding of the force by the law that an earlier one has found in the same "
          "samples; false if there is none.");

  const SurfaceSettings surface;
  const Scale scale = VariableProjection::Method::default_scale;
  nb::dict projection = projection_defaults(surface.projection);
  projection["scale"] = nb::make_tuple(scale.penetration, scale.velocity, scale.force);
  projection["surface_range"] = nb::make_tuple(surface.lowest_surface, surface.highest_surface);
  module.attr("defaults")["VariableProjection"] = projection;

  bind_face<DriftTracking>(module, "DriftTracking").def("__init__", &make_drift_tracking);

  const DriftTracking::Method::Settings drift;
  nb::dict tracking = projection_defaults(drift.projection);
  tracking["stiffness_drift"] = drift.drift[0];
  tracking["dissipation_drift"] = drift.drift[1];
  tracking["exponent_drift"] = drift.drift[2];
  module.attr("defaults")["DriftTracking"] = tracking;
}

void bind_viscoelastic(nb::module_& module) {
  module.def("relaxation_branches", &branches_of, nb::arg("parameters"),
             nb::sig("def relaxation_branches(parameters: numpy.typing.NDArray[numpy.float64]) -> "
                     "tuple[numpy.typing.NDArray[numpy.float64], "
                     "numpy.typing.NDArray[numpy.float64]]"));
  module.def("generalised_force_along", &force_along);
  bind_face<Everyday>(module, viscoelastic_name)
      .def("__init__", &make_viscoelastic)
      .def(
          "finish_pending",
          [](ViscoelasticFace& self) { with(self, [](auto& core) { core.finish_pending(); }); },
          "Compute verdict and estimate from all samples so far, immediately: 0.1 ms, or 1 ms for "
          "all laws. Otherwise this work is spread over the next samples.")
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
  nb::list laws;  // damping, memory, whether n is fixed at 1
  for (const viscoelastic::Candidate& law : viscoelastic::candidates) {
    laws.append(
        nb::make_tuple(static_cast<int>(law.damping), static_cast<int>(law.memory), law.linear));
  }
  defaults["candidates"] = laws;
  module.attr("defaults")["ViscoelasticContact"] = defaults;
}

}  // namespace palpate::bindings
