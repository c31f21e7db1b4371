// The module: forces of laws, and estimates.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "face.hpp"
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
      throw nb::value_error(
          "the arrays must have the law's number of parameters and one entry per sample");
    }
    const Law law = law_of<Law>(parameters.data());
    for (std::size_t k = 0; k < penetration.size(); ++k) {
      force.data()[k] = law.force(penetration.data()[k], velocity.data()[k]);
    }
  });
}

void bind_force_laws(nb::module_& module) {
  bind_force<KelvinVoigt>(module, "kelvin_voigt_force");
  bind_force<ExtendedKelvinVoigt>(module, "extended_kelvin_voigt_force");
  bind_force<HuntCrossley>(module, "hunt_crossley_force");
  bind_force<GeneralisedHuntCrossley>(module, "generalised_hunt_crossley_force");
}

// The estimate of a method written in Python; its covariance may include the offset's row.
void make_estimate(EstimateValue* self, const InputArray& parameters, const InputArray& covariance,
                   Status status, std::uint64_t samples, double margin, std::uint64_t guarded,
                   std::uint64_t restarts, std::uint64_t rejected, double offset) {
  const std::size_t size = parameters.size();
  const std::size_t rows = size + (covariance.size() > size * size ? 1 : 0);
  if (size == 0 || size > EstimateValue::capacity || covariance.size() != rows * rows) {
    throw nb::value_error(("parameters must be 1 to " + std::to_string(EstimateValue::capacity) +
                           " numbers, and covariance their square matrix")
                              .c_str());
  }
  const AnyEstimate common{{}, 0, margin, status, samples, guarded, restarts, rejected};
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  constexpr ResponseNumber none{unknown, unknown, false};
  new (self)
      EstimateValue{common, size, offset, {}, {}, {none, none, unknown, unknown, unknown, 0}};
  std::copy_n(parameters.data(), size, self->parameters.begin());
  for (std::size_t i = 0; i < rows; ++i) {
    std::copy_n(covariance.data() + i * rows, rows, &self->entry(i, 0));
  }
}

double root(double variance) { return std::sqrt(variance < 0.0 ? 0.0 : variance); }

nb::object standard_errors_of(EstimateValue& e) {
  std::array<double, EstimateValue::capacity> errors{};
  for (std::size_t i = 0; i < e.size; ++i) errors[i] = std::sqrt(std::fmax(e.entry(i, i), 0.0));
  return copied_array(errors.data(), {e.size});
}

// Covariance of the first `size` numbers: the parameters and, last, the offset.
nb::object covariance_of(const EstimateValue& e, std::size_t count) {
  const auto row = static_cast<std::int64_t>(e.size + 1);
  return nb::ndarray<nb::numpy, const double>(e.covariance.data(), {count, count}, {}, {row, 1})
      .cast(nb::rv_policy::copy);
}

constexpr const char* status_doc = R"(Result of one ``update``.

Examples
--------
>>> import palpate
>>> estimator = palpate.KelvinVoigtRLS()
>>> estimator.update(0.001, 0.1, 2.0)
Status.UPDATED
>>> estimator.update(0.001, 0.1, float("nan")) is palpate.Status.NOT_FINITE
True)";

void bind_status(nb::module_& module) {
  nb::enum_<Status>(module, "Status", nb::is_arithmetic(), status_doc)
      .value("WAITING", Status::waiting, "No contact so far.")
      .value("UPDATED", Status::updated, "In contact; the sample was taken.")
      .value("GUARDED", Status::guarded,
             "Taken, but without forgetting, to keep the covariance positive definite.")
      .value("HELD", Status::held, "Contact is lost; the estimate is held.")
      .value("RESTARTED", Status::restarted,
             "Taken; the material has changed, and the estimate restarted from the latest "
             "samples.")
      .value("NOT_FINITE", Status::not_finite,
             "Refused: penetration, velocity or force is NaN or infinite.")
      .value("INVALID_STEP", Status::invalid_step,
             "Refused: ``dt`` is not a positive, finite time.")
      .value("OUT_OF_RANGE", Status::out_of_range,
             "Refused: finite, but too large for the arithmetic.")
      .value("REJECTED", Status::rejected, "Rejected as an outlier.");
  for (std::size_t value = 0; value < status_count; ++value) {
    status_members[value] = nb::cast(static_cast<Status>(value)).release().ptr();
  }
}

void bind_estimate(nb::module_& module) {
  bind_status(module);
  nb::class_<ResponseNumber>(module, "ResponseNumber",
                             "A number that a controller may act on while it is usable.")
      .def_ro("value", &ResponseNumber::value, "SI; within physical bounds if not usable.")
      .def_ro("standard_error", &ResponseNumber::standard_error, "SI.")
      .def_ro("usable", &ResponseNumber::usable, "Whether the samples determine it.");
  nb::class_<EstimateValue>(module, "EstimateValue", "The numbers of an estimate, SI.")
      .def(nb::init<const EstimateValue&>())
      .def("__init__", &make_estimate, nb::arg("parameters"), nb::arg("covariance"),
           nb::arg("status"), nb::arg("samples"), nb::arg("validity_margin") = 1.0,
           nb::arg("guarded") = 0, nb::arg("restarts") = 0, nb::arg("rejected") = 0,
           nb::arg("offset") = 0.0,
           nb::sig("def __init__(self, parameters: numpy.typing.NDArray[numpy.float64], "
                   "covariance: numpy.typing.NDArray[numpy.float64], status: Status, samples: int, "
                   "validity_margin: float = 1.0, guarded: int = 0, restarts: int = 0, "
                   "rejected: int = 0, offset: float = 0.0) -> None"))
      .def_prop_ro(
          "parameters",
          [](const EstimateValue& e) { return copied_array(e.parameters.data(), {e.size}); },
          "The law's parameters, in the law's order, SI.",
          nb::sig("def parameters(self) -> numpy.typing.NDArray[numpy.float64]"))
      .def_prop_ro(
          "covariance", [](const EstimateValue& e) { return covariance_of(e, e.size); },
          "Joint covariance of the law's parameters, SI.",
          nb::sig("def covariance(self) -> numpy.typing.NDArray[numpy.float64]"))
      .def_prop_ro("standard_errors", &standard_errors_of,
                   "Standard errors of the law's parameters, SI.",
                   nb::sig("def standard_errors(self) -> numpy.typing.NDArray[numpy.float64]"))
      .def_prop_ro(
          "joint_covariance", [](const EstimateValue& e) { return covariance_of(e, e.size + 1); },
          "Covariance of the law's parameters and, last, the offset, SI.",
          nb::sig("def joint_covariance(self) -> numpy.typing.NDArray[numpy.float64]"))
      .def_ro("offset", &EstimateValue::offset, "Force without contact, N.")
      .def_prop_ro(
          "offset_standard_error", [](EstimateValue& e) { return root(e.entry(e.size, e.size)); },
          "Its standard error, N; 0 if not estimated.")
      .def_prop_ro(
          "surface", [](const EstimateValue& e) { return e.surface.value; }, "Surface position, m.")
      .def_prop_ro(
          "surface_standard_error", [](const EstimateValue& e) { return root(e.surface.variance); },
          "Its standard error, m; 0 if not estimated.")
      .def_prop_ro(
          "stiffness", [](const EstimateValue& e) { return e.response.stiffness; },
          "Stiffness K′ = ∂F/∂x of small oscillations at ``depth`` and ``frequency``, N/m.")
      .def_prop_ro(
          "damping", [](const EstimateValue& e) { return e.response.damping; },
          "Damping B′ = ∂F/∂v of small oscillations at ``depth`` and ``frequency``, N·s/m.")
      .def_prop_ro(
          "depth", [](const EstimateValue& e) { return e.response.depth; },
          "Penetration of ``stiffness`` and ``damping``, m.")
      .def_prop_ro(
          "frequency", [](const EstimateValue& e) { return e.response.frequency; },
          "Angular frequency of the motion so far, rad/s.")
      .def_prop_ro(
          "age", [](const EstimateValue& e) { return e.response.age; },
          "Time since the latest sample that ``stiffness`` and ``damping`` contain, s.")
      .def_prop_ro("_checks", [](const EstimateValue& e) { return e.response.checks; })
      .def_ro("_flags", &EstimateValue::flags)
      .def_ro("validity_margin", &EstimateValue::validity_margin,
              "Condition 10 as a margin: 1 at rest, 0 at the limit, negative beyond it.")
      .def_ro("status", &EstimateValue::status,
              "Status of the last sample that was neither refused nor rejected.")
      .def_ro("samples", &EstimateValue::samples, "Number of samples taken.")
      .def_ro("guarded", &EstimateValue::guarded,
              "Number of samples at which the covariance guard acted.")
      .def_ro("restarts", &EstimateValue::restarts,
              "Number of restarts after a change of the material.")
      .def_ro("rejected", &EstimateValue::rejected, "Number of samples rejected as outliers.");
}

}  // namespace
}  // namespace palpate::bindings

NB_MODULE(_core, module) {
  using namespace palpate::bindings;
  module.doc() = "The compiled recursion of palpate.";
  module.attr("__version__") = PALPATE_VERSION;
  // The settings' defaults, by class and name; they are defined in the headers only.
  module.attr("defaults") = nb::dict();
  bind_force_laws(module);
  bind_estimate(module);
  bind_least_squares(module);
  bind_curves(module);
  bind_face(module);
  bind_estimators(module);
  bind_projection(module);
  bind_viscoelastic(module);
  bind_online_preparation(module);
  bind_rows(module);
}
