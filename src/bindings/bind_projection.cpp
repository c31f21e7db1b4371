// Variable projection, compiled on its own as its sums vectorise; drift tracking, which uses it;
// and laws with memory: their force along a motion, and their estimators.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

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

// Branches from their relaxation times [s] and stiffnesses [N/mⁿ].
RelaxationBranches branches_in(const InputArray& times, const InputArray& stiffnesses) {
  if (times.size() != stiffnesses.size() || times.size() > RelaxationBranches::most) {
    throw nb::value_error("a relaxation has one stiffness per time, and at most 128 of them");
  }
  return {{times.data(), times.size()}, {stiffnesses.data(), stiffnesses.size()}};
}

// Relaxation times [s] and weights of the branches that approximate a spectrum.
nb::tuple branches_of(double alpha, double shortest_time, double longest_time) {
  const RelaxationBranches branches(alpha, shortest_time, longest_time, 1.0);
  return nb::make_tuple(copied_array(branches.times.data(), {branches.count}),
                        copied_array(branches.stiffnesses.data(), {branches.count}));
}

// Advances a state along a motion. Calls `use` with each sample of known penetration, and `skip`
// with the others, whose time is added to the step of the next known one.
template <class Use, class Skip>
void relax_along(double exponent, const RelaxationBranches& branches, const InputArray& time_steps,
                 const InputArray& penetration, double* state, const Use& use, const Skip& skip) {
  double passed = 0.0;  // since the last sample with a known penetration
  for (std::size_t k = 0; k < penetration.size(); ++k) {
    const double x = penetration.data()[k];
    passed += time_steps.data()[k];
    if (!std::isfinite(x)) {
      skip(k);
      continue;
    }
    relax(exponent, branches, x, passed, state);
    passed = 0.0;
    use(k, x);
  }
}

// Fills `force` along a motion and advances the state; `elastic` is K, n, B and p.
void force_along(const InputArray& elastic, const InputArray& times, const InputArray& stiffnesses,
                 const InputArray& time_steps, const InputArray& penetration,
                 const InputArray& velocity, const OutputArray& state, const OutputArray& force) {
  const RelaxationBranches branches = branches_in(times, stiffnesses);
  const std::size_t count = penetration.size();
  if (elastic.size() != 4 || time_steps.size() != count || velocity.size() != count ||
      force.size() != count || state.size() != branches.count + 1) {
    throw nb::value_error(
        "the arrays must have one entry per sample, the state one per branch and one more, and "
        "the law four numbers");
  }
  GeneralisedHuntCrossley law{};
  law.K = elastic.data()[0];
  law.n = elastic.data()[1];
  law.B = elastic.data()[2];
  law.p = elastic.data()[3];
  relax_along(
      law.n, branches, time_steps, penetration, state.data(),
      [&](std::size_t k, double x) {
        force.data()[k] = relaxing_force(law, branches, x, velocity.data()[k], state.data());
      },
      [&](std::size_t k) { force.data()[k] = std::numeric_limits<double>::quiet_NaN(); });
}

// The states of branches at each sample, (samples, branches), in units of xⁿ: relaxed at the first
// known penetration, and NaN where the penetration is.
nb::object states_along(double exponent, const InputArray& times, const InputArray& time_steps,
                        const InputArray& penetration) {
  const RelaxationBranches branches = branches_in(times, times);
  const std::size_t count = penetration.size();
  if (time_steps.size() != count) throw nb::value_error("there must be one time step per sample");
  std::vector<double> state(branches.count + 1, 0.0);
  std::vector<double> rows(count * branches.count, std::numeric_limits<double>::quiet_NaN());
  const double* const known = std::find_if(penetration.data(), penetration.data() + count,
                                           [](double x) { return std::isfinite(x); });
  if (known != penetration.data() + count && *known > 0.0) state[0] = std::pow(*known, exponent);
  relax_along(
      exponent, branches, time_steps, penetration, state.data(),
      [&](std::size_t k, double) {
        std::copy_n(state.begin() + 1, branches.count, rows.data() + k * branches.count);
      },
      [](std::size_t) {});
  return copied_array(rows.data(), {count, branches.count});
}

using ViscoelasticFace = FaceOf<ViscoelasticContact>;

void make_viscoelastic(ViscoelasticFace* self, std::uint32_t offered, double exponent, bool offset,
                       double offset_deviation, double surface_deviation, double longest_time,
                       const Loop& loop) {
  const ViscoelasticSettings method{.offered = static_cast<viscoelastic::Offered>(offered),
                                    .exponent = exponent,
                                    .offset = offset,
                                    .offset_deviation = offset_deviation / scale_of(loop)[2],
                                    .surface_deviation = surface_deviation / scale_of(loop)[0],
                                    .sample_time = std::get<6>(loop),
                                    .longest_time = longest_time};
  new (self) ViscoelasticFace(core_of<ViscoelasticContact>("ViscoelasticContact", 0, method, loop));
}

auto& core_of(ViscoelasticFace& face) {
  return static_cast<CoreOf<ViscoelasticContact>&>(face.core()).estimator;
}

// The candidates at the last verdict on these samples, if any: rows of candidate, score and RSS/N
// [N²]; samples, N_eff, the selected one; the motion's mean depth, m, and frequency, rad/s; whether
// it began in contact; and mean velocity over rms velocity.
nb::tuple evidence_of(ViscoelasticFace& face) {
  const auto& core = core_of(face);
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

// The spectrum of the solution: relaxation times, s; K, n, B, p and mᵢ; their covariance with the
// offset as the last; and the force, N, that each column for an unknown start adds, with its decay
// time.
nb::tuple spectrum_of(ViscoelasticFace& face) {
  const auto& core = core_of(face);
  const viscoelastic::Solution& now = core.method().solver().solution();
  const viscoelastic::Ladder& ladder = core.method().solver().samples().ladder();
  const auto numbers = viscoelastic::numbers_in_si(now.fit, core.units());
  const auto covariance = viscoelastic::covariance_in_si(now, core.units());
  nb::list start;
  for (std::size_t a = 0; a < viscoelastic::start_columns; ++a) {
    const double time =
        a == 0 ? viscoelastic::first_start_steps * ladder.sample_time() : ladder.longest();
    start.append(nb::make_tuple(now.fit.value[viscoelastic::start + a] * core.units().force, time));
  }
  return nb::make_tuple(
      copied_array(ladder.times().data(), {viscoelastic::rungs}),
      copied_array(numbers.data(), {viscoelastic::spectrum_size}),
      copied_array(&covariance[0][0], {viscoelastic::joint_size, viscoelastic::joint_size}), start);
}

// Fits a candidate to all samples with some relaxation times excluded, one bit each, or with a
// damper of any sign: RSS/N [N²]; K, n, B, p and mᵢ; and the offset, N.
nb::tuple beside_of(ViscoelasticFace& face, std::uint32_t candidate, std::uint32_t without,
                    bool free_damping) {
  const auto& core = core_of(face);
  if (candidate >= viscoelastic::candidates.size()) throw nb::value_error("no such candidate");
  const viscoelastic::Beside found = core.method().solver().beside(
      candidate, (without << viscoelastic::memory) & viscoelastic::all_memory, free_damping);
  const auto numbers = viscoelastic::numbers_in_si(found.fit, core.units());
  const double unit = core.units().force;
  return nb::make_tuple(found.mean_square * unit * unit,
                        copied_array(numbers.data(), {viscoelastic::spectrum_size}),
                        found.fit.value[viscoelastic::offset] * unit);
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
  module.def("relaxation_branches", &branches_of, nb::arg("alpha"), nb::arg("shortest_time"),
             nb::arg("longest_time"),
             nb::sig("def relaxation_branches(alpha: float, shortest_time: float, longest_time: "
                     "float) -> tuple[numpy.typing.NDArray[numpy.float64], "
                     "numpy.typing.NDArray[numpy.float64]]"));
  module.def("generalised_force_along", &force_along, nb::arg("elastic"), nb::arg("times"),
             nb::arg("stiffnesses"), nb::arg("time_steps"), nb::arg("penetration"),
             nb::arg("velocity"), nb::arg("state"), nb::arg("force"));
  module.def("relaxation_states", &states_along, nb::arg("exponent"), nb::arg("times"),
             nb::arg("time_steps"), nb::arg("penetration"),
             nb::sig("def relaxation_states(exponent: float, times: "
                     "numpy.typing.NDArray[numpy.float64], time_steps: "
                     "numpy.typing.NDArray[numpy.float64], penetration: "
                     "numpy.typing.NDArray[numpy.float64]) -> "
                     "numpy.typing.NDArray[numpy.float64]"));
  bind_face<ViscoelasticContact>(module, "ViscoelasticContact")
      .def("__init__", &make_viscoelastic)
      .def(
          "finish_pending", [](ViscoelasticFace& self) { core_of(self).finish_pending(); },
          "Compute verdict and estimate from all samples so far, immediately, in about 1 ms. "
          "Otherwise this work is spread over the next samples.")
      .def("_evidence", &evidence_of,
           nb::sig("def _evidence(self) -> tuple[list[tuple[int, float, float]], float, float, "
                   "int, float, float, bool, float]"))
      .def("_spectrum", &spectrum_of,
           nb::sig("def _spectrum(self) -> tuple[numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], "
                   "list[tuple[float, float]]]"))
      .def("_beside", &beside_of,
           nb::sig("def _beside(self, candidate: int, without: int, free_damping: bool) -> "
                   "tuple[float, numpy.typing.NDArray[numpy.float64], float]"));

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
  defaults["one_way"] = viscoelastic::one_way_limit;
  module.attr("defaults")["ViscoelasticContact"] = defaults;
}

}  // namespace palpate::bindings
