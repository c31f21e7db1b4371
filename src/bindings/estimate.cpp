#include "estimate.hpp"

#include <cmath>

#include "conversions.hpp"
#include "update_method.hpp"

namespace palpate::bindings {
namespace {

nb::object law_of(const EstimateValue& e) {
  static constexpr const char* names[] = {"KelvinVoigt", "ExtendedKelvinVoigt", "HuntCrossley"};
  const nb::object law =
      nb::module_::import_("palpate.force_laws").attr(names[static_cast<std::size_t>(e.kind)]);
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

}  // namespace

void bind_estimate(nb::module_& module) {
  nb::enum_<Status>(module, "Status", nb::is_arithmetic(),
                    "What one ``update`` did with its sample.")
      .value("WAITING", Status::waiting, "No contact so far; nothing was learned.")
      .value("UPDATED", Status::updated, "In contact; the sample was taken.")
      .value("GUARDED", Status::guarded,
             "Taken, but forgetting was withheld so that the covariance stays sound.")
      .value("HELD", Status::held, "Contact is lost; the estimate is held.")
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
    Of them, how many the covariance guard touched (``docs/numerics.md``).)")
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
      .def_prop_ro(
          "valid", [](const EstimateValue& e) { return e.validity_margin > 0.0; },
          "Whether condition 10 held at the last sample taken.")
      .def_ro("validity_margin", &EstimateValue::validity_margin,
              "Condition 10 as a margin: 1 at rest, 0 at the limit, negative beyond it.")
      .def_ro("status", &EstimateValue::status, "Of the last sample that was not refused.")
      .def_ro("samples", &EstimateValue::samples, "Samples taken.")
      .def_ro("guarded", &EstimateValue::guarded, "Of them, those that the guard touched.")
      .def("__repr__", [](const EstimateValue& e) {
        return nb::str("Estimate({}, standard_errors={}, samples={}, status={})")
            .format(nb::repr(law_of(e)),
                    nb::str("{}").format(standard_errors_of(e).attr("tolist")()), e.samples,
                    nb::cast(e.status).attr("name"));
      });
}

}  // namespace palpate::bindings
