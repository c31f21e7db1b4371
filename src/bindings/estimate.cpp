#include "estimate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "conversions.hpp"
#include "update_method.hpp"

namespace palpate::bindings {
namespace {

// The Python class of a law; looked up once, and kept for the life of the process.
nb::handle law_class(LawKind kind) {
  static constexpr const char* names[] = {"KelvinVoigt", "ExtendedKelvinVoigt", "HuntCrossley"};
  static std::array<PyObject*, 3> classes{};
  PyObject*& known = classes[static_cast<std::size_t>(kind)];
  if (!known) {
    known = nb::module_::import_("palpate.force_laws")
                .attr(names[static_cast<std::size_t>(kind)])
                .ptr();
    Py_INCREF(known);
  }
  return known;
}

nb::object law_of(const EstimateValue& e) {
  const nb::handle law = law_class(e.kind);
  if (e.size == 2) return law(e.parameters[0], e.parameters[1]);
  return law(e.parameters[0], e.parameters[1], e.parameters[2]);
}

nb::object standard_errors_of(const EstimateValue& e) {
  std::array<double, EstimateValue::capacity> errors{};
  for (std::size_t i = 0; i < e.size; ++i) {
    errors[i] = std::sqrt(std::fmax(e.covariance[i * e.size + i], 0.0));
  }
  return copied_array(errors.data(), {e.size});
}

// Of the law's parameters and, last, the force offset.
nb::object joint_covariance_of(const EstimateValue& e) {
  constexpr std::size_t most = EstimateValue::capacity + 1;
  std::array<double, most * most> joint{};
  const std::size_t size = e.size + 1;
  for (std::size_t i = 0; i < e.size; ++i) {
    for (std::size_t j = 0; j < e.size; ++j) joint[i * size + j] = e.covariance[i * e.size + j];
    joint[i * size + e.size] = joint[e.size * size + i] = e.offset_covariance[i];
  }
  joint[e.size * size + e.size] = e.offset_variance;
  return copied_array(joint.data(), {size, size});
}

nb::tuple flags_of(const EstimateValue& e) {
  nb::list flags;
  if (e.doubts & exponent_not_identifiable) {
    flags.append(
        "exponent not identifiable from this motion: reach shallow and deep penetrations in turn");
  }
  if (e.doubts & damping_not_identifiable) {
    flags.append("damping not identifiable: pass the same depths at different speeds, both ways");
  }
  if (e.doubts & exponent_at_edge) {
    flags.append("exponent at the edge of its range: widen exponent_range, or check the surface");
  }
  if (e.doubts & surface_at_edge) {
    flags.append("surface at the edge of its range: widen surface_range, or record the approach");
  }
  if (e.doubts & still_starting) {
    flags.append("not tracking yet: the start still waits for a motion that tells the exponent");
  }
  return nb::tuple(flags);
}

}  // namespace

void bind_estimate(nb::module_& module) {
  nb::enum_<Status>(module, "Status", nb::is_arithmetic(),
                    "What one ``update`` did with its sample.")
      .value("WAITING", Status::waiting, "No contact so far; nothing was learned.")
      .value("UPDATED", Status::updated, "In contact; the sample was taken.")
      .value("GUARDED", Status::guarded,
             "Taken, but forgetting was withheld so that the covariance stays sound.")
      .value("HELD", Status::held, "Contact is lost; the estimate is held.")
      .value(
          "RESTARTED", Status::restarted,
          "Taken; the material has changed, and the estimate began anew with the latest samples.")
      .value("NOT_FINITE", Status::not_finite,
             "Refused: penetration, velocity or force is NaN or infinite.")
      .value("INVALID_STEP", Status::invalid_step,
             "Refused: ``dt`` is not a positive, finite time.")
      .value("OUT_OF_RANGE", Status::out_of_range,
             "Refused: finite, but too large for the arithmetic.");

  for (std::size_t value = 0; value < status_count; ++value) {
    status_members[value] = nb::cast(static_cast<Status>(value)).release().ptr();
  }

  nb::class_<EstimateValue>(module, "Estimate", R"(What an estimator knows now.

Attributes
----------
law : KelvinVoigt, ExtendedKelvinVoigt or HuntCrossley
    The contact model, in SI.
covariance : numpy.ndarray, shape (p, p)
    Joint covariance of the law's parameters, in their order and in SI: the recursion's P times
    the variance of its residual, taken from θ to the law by the delta method.
standard_errors : numpy.ndarray, shape (p,)
    Square roots of its diagonal.
offset, offset_standard_error : float
    Force that the sensor shows without contact, N, by methods that estimate it; else 0.
surface, surface_standard_error : float
    Where the material begins, in the coordinate of the penetration, m, by methods that search for
    it; else 0.
joint_covariance : numpy.ndarray, shape (p + 1, p + 1)
    Covariance of the law's parameters and, last, the offset.
flags : tuple of str
    What this motion left undetermined, and what motion would help.
valid : bool
    Condition 10, |v| < 0.1 K/B, at the last sample taken. Always true for laws without a
    logarithm.
validity_margin : float
    1 − |v B/K| / 0.1: 1 at rest, 0 at the limit, negative beyond it.
status : Status
    Of the last sample that was not refused.
samples : int
    Samples taken.
guarded : int
    Of them, how many the covariance guard touched (``docs/numerics.md``).
restarts : int
    How often a change of the material was detected and the estimate began anew.)")
      .def_prop_ro("law", &law_of,
                   nb::sig("def law(self) -> palpate.force_laws.KelvinVoigt | "
                           "palpate.force_laws.ExtendedKelvinVoigt | "
                           "palpate.force_laws.HuntCrossley"),
                   "The contact model, SI.")
      .def_prop_ro(
          "parameters",
          [](const EstimateValue& e) { return copied_array(e.parameters.data(), {e.size}); },
          nb::sig("def parameters(self) -> numpy.typing.NDArray[numpy.float64]"),
          "The law's parameters in its own order, SI.")
      .def_prop_ro(
          "covariance",
          [](const EstimateValue& e) {
            return copied_array(e.covariance.data(), {e.size, e.size});
          },
          nb::sig("def covariance(self) -> numpy.typing.NDArray[numpy.float64]"),
          "Joint covariance of the law's parameters, SI.")
      .def_prop_ro("standard_errors", &standard_errors_of,
                   nb::sig("def standard_errors(self) -> numpy.typing.NDArray[numpy.float64]"),
                   "Standard errors of the law's parameters, SI.")
      .def_prop_ro("joint_covariance", &joint_covariance_of,
                   nb::sig("def joint_covariance(self) -> numpy.typing.NDArray[numpy.float64]"),
                   "Covariance of the law's parameters and, last, the offset, SI.")
      .def_ro("offset", &EstimateValue::offset, "Force without contact, N.")
      .def_prop_ro(
          "offset_standard_error",
          [](const EstimateValue& e) { return std::sqrt(std::max(e.offset_variance, 0.0)); },
          "Its standard error, N; 0 where it is not estimated.")
      .def_ro("surface", &EstimateValue::surface, "Where the material begins, m.")
      .def_prop_ro(
          "surface_standard_error",
          [](const EstimateValue& e) { return std::sqrt(std::max(e.surface_variance, 0.0)); },
          "Its standard error, m; 0 where it is not searched for.")
      .def_prop_ro("flags", &flags_of, nb::sig("def flags(self) -> tuple[str, ...]"),
                   "What this motion left undetermined, and what motion would help.")
      .def_prop_ro(
          "valid", [](const EstimateValue& e) { return e.validity_margin > 0.0; },
          "Whether condition 10 held at the last sample taken.")
      .def_ro("validity_margin", &EstimateValue::validity_margin,
              "Condition 10 as a margin: 1 at rest, 0 at the limit, negative beyond it.")
      .def_ro("status", &EstimateValue::status, "Of the last sample that was not refused.")
      .def_ro("samples", &EstimateValue::samples, "Samples taken.")
      .def_ro("guarded", &EstimateValue::guarded, "Of them, those that the guard touched.")
      .def_ro("restarts", &EstimateValue::restarts, "How often the estimate began anew.")
      .def("__repr__", [](const EstimateValue& e) {
        return nb::str("Estimate({}, standard_errors={}, samples={}, status={})")
            .format(nb::repr(law_of(e)),
                    nb::str("{}").format(standard_errors_of(e).attr("tolist")()), e.samples,
                    nb::cast(e.status).attr("name"));
      });
}

}  // namespace palpate::bindings
