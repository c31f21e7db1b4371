// Variable projection and what stands on it: sums in straight lines of arithmetic, which vectorise.
#include <memory>
#include <variant>

#include "estimator_face.hpp"

namespace palpate::bindings {
namespace {

// The search for the surface holds forty banks of sums; an estimator without it should not.
class Projection {
 public:
  using Law = HuntCrossley;
  using Known = ProjectionEstimator;
  using Searched = std::unique_ptr<SurfaceEstimator>;

  explicit Projection(const Known& estimator) : estimator_(estimator) {}
  explicit Projection(Searched estimator) : estimator_(std::move(estimator)) {}

  template <class Act>
  decltype(auto) with(Act&& act) {
    if (Known* known = std::get_if<Known>(&estimator_)) return act(*known);
    return act(**std::get_if<Searched>(&estimator_));
  }
  template <class Act>
  decltype(auto) with(Act&& act) const {
    if (const Known* known = std::get_if<Known>(&estimator_)) return act(*known);
    return act(static_cast<const SurfaceEstimator&>(**std::get_if<Searched>(&estimator_)));
  }

  Status update(double x, double v, double f) noexcept {
    return with([&](auto& core) { return core.update(x, v, f); });
  }
  Status update(double x, double v, double f, double dt) noexcept {
    return with([&](auto& core) { return core.update(x, v, f, dt); });
  }
  double predict(double x, double v) const noexcept {
    return with([&](auto& core) { return core.predict(x, v); });
  }
  Estimate<3> estimate() const noexcept {
    return with([](auto& core) { return core.estimate(); });
  }
  void reset() noexcept {
    with([](auto& core) { core.reset(); });
  }

 private:
  std::variant<Known, Searched> estimator_;
};

// Found by argument-dependent lookup, in place of the core's own.
void replay(Projection& estimator, const Signals& in, const TraceColumns& out) noexcept {
  estimator.with([&](auto& core) { palpate::replay(core, in, out); });
}

VariableProjection::Settings projection_settings(double noise, const Pair& exponents, bool offset,
                                                 double offset_deviation, double force_unit) {
  return {.noise = noise / force_unit,
          .lowest_exponent = exponents[0],
          .highest_exponent = exponents[1],
          .offset = offset,
          .offset_deviation = offset_deviation / force_unit};
}

template <class Method>
auto loop_settings(const typename Method::Settings& method, const Pair& forgetting,
                   const Detector& changes, const Triple& gate, const Triple& scale,
                   double sample_time) {
  return typename RecursiveEstimator<Method>::Settings{method,
                                                       {forgetting[0], forgetting[1]},
                                                       {},
                                                       detector_settings(changes),
                                                       {gate[0], gate[1], gate[2]},
                                                       {scale[0], scale[1], scale[2]},
                                                       sample_time};
}

void make_projection(Projection* self, double noise, const Pair& exponents, bool offset,
                     double offset_deviation, const std::optional<Pair>& surfaces,
                     const Pair& forgetting, const Detector& changes, const Triple& gate,
                     const Triple& scale, double sample_time) {
  const auto method = projection_settings(noise, exponents, offset, offset_deviation, scale[2]);
  if (surfaces) {
    const SurfaceSearch::Settings search{method, (*surfaces)[0] / scale[0],
                                         (*surfaces)[1] / scale[0]};
    new (self) Projection(
        std::make_unique<SurfaceEstimator>(loop_settings<ProjectionMethod<SurfaceSearch>>(
            search, forgetting, changes, gate, scale, sample_time)));
  } else {
    new (self) Projection(ProjectionEstimator(loop_settings<ProjectionMethod<VariableProjection>>(
        method, forgetting, changes, gate, scale, sample_time)));
  }
}

}  // namespace

void bind_projection(nb::module_& module) {
  bind_face<Projection>(module, "VariableProjection")
      .def("__init__", &make_projection, nb::arg(), nb::arg(), nb::arg(), nb::arg(),
           nb::arg().none(), nb::arg(), nb::arg(), nb::arg(), nb::arg(), nb::arg());
  bind_face<DriftEstimator>(module, "DriftTracking")
      .def("__init__", [](DriftEstimator* self, double noise, const Pair& exponents, bool offset,
                          double offset_deviation, const Triple& drift, const Detector& changes,
                          const Triple& gate, const Triple& scale, double sample_time) {
        const auto start =
            projection_settings(noise, exponents, offset, offset_deviation, scale[2]);
        new (self) DriftEstimator(
            loop_settings<DriftMethod>({start, {drift[0], drift[1] * scale[1], drift[2]}},
                                       {1.0, 0.0}, changes, gate, scale, sample_time));
      });
}

}  // namespace palpate::bindings
