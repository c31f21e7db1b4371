#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <variant>

#include "conversions.hpp"
#include "palpate/batch_fit/long_run_covariance.hpp"
#include "palpate/least_squares.hpp"

namespace palpate::bindings {
namespace {

// One compiled recursion for each order, behind one Python class.
using Engine = std::variant<LeastSquares<1>, LeastSquares<2>, LeastSquares<3>, LeastSquares<4>,
                            LeastSquares<5>, LeastSquares<6>, LeastSquares<7>, LeastSquares<8>>;

std::string name_of(const Engine& engine) {
  return "LeastSquares." + std::to_string(engine.index() + 1);
}

template <std::size_t Order = 1>
Engine make_engine(std::size_t order, const double* initial, const double* covariance) {
  if constexpr (Order < std::variant_size_v<Engine>) {
    if (order != Order) return make_engine<Order + 1>(order, initial, covariance);
  }
  typename LeastSquares<Order>::Settings settings;
  std::copy_n(initial, Order, settings.initial.begin());
  for (std::size_t i = 0; i < Order; ++i) {
    std::copy_n(covariance + i * Order, Order, settings.initial_covariance[i].begin());
  }
  return LeastSquares<Order>(settings);
}

// Its result, for any order.
struct Knowledge {
  std::size_t order;
  const double* parameters;
  const double* covariance;
  double noise_variance;
  std::uint64_t samples;
  Memory memory;
};

Knowledge known(const Engine& engine) {
  return std::visit(
      []<std::size_t Order>(const LeastSquares<Order>& recursion) {
        return Knowledge{Order,
                         recursion.parameters().data(),
                         recursion.covariance()[0].data(),
                         recursion.noise_variance(),
                         recursion.samples(),
                         memory_of(&recursion)};
      },
      engine);
}

// Reads a sequence of `order` numbers without allocating.
void read(const nb::sequence& sequence, std::span<double> regressor) {
  const std::size_t order = regressor.size();
  if (nb::len(sequence) != order) {
    throw nb::value_error(("regressor must have " + std::to_string(order) + " entries").c_str());
  }
  for (std::size_t i = 0; i < order; ++i) {
    if (!nb::try_cast(sequence[i], regressor[i])) {
      throw nb::type_error(
          ("regressor must hold numbers, but its entry " + std::to_string(i) + " is not one")
              .c_str());
    }
  }
}

Status update(Engine& engine, const nb::sequence& sequence, double output, double forgetting_factor,
              double perturbation) {
  return std::visit(
      [&]<std::size_t Order>(LeastSquares<Order>& recursion) {
        Vector<Order> regressor;
        read(sequence, regressor);
        const auto finite = [](double number) { return std::isfinite(number); };
        if (!finite(output) || !finite(perturbation) || !std::ranges::all_of(regressor, finite)) {
          return Status::not_finite;
        }
        if (!(forgetting_factor > 0.0 && forgetting_factor <= 1.0) || perturbation < 0.0) {
          return Status::out_of_range;
        }
        return recursion.update(regressor, output, forgetting_factor, perturbation);
      },
      engine);
}

double predict(const Engine& engine, const nb::sequence& sequence) {
  return std::visit(
      [&]<std::size_t Order>(const LeastSquares<Order>& recursion) {
        Vector<Order> regressor;
        read(sequence, regressor);
        return recursion.predict(regressor);
      },
      engine);
}

// Fills the long-run covariance of scores (one row per sample) and their residual.
void long_run_covariance(const InputRows& scores, const InputArray& residual,
                         const InputArray& shares, double fitted, const OutputArray& result) {
  const std::size_t size = scores.shape(1), count = residual.size();
  if (scores.shape(0) != count || result.size() != size * size) {
    throw nb::value_error(
        "scores must have a row per residual, and the result a row and a column per score");
  }
  detail::long_run_covariance({scores.data(), scores.size()}, {residual.data(), count},
                              {shares.data(), shares.size()}, fitted,
                              {result.data(), result.size()});
}

}  // namespace

void bind_least_squares(nb::module_& module) {
  nb::class_<Engine>(module, "LeastSquares")
      .def("__init__",
           [](Engine* self, std::size_t order, const InputArray& initial,
              const InputArray& covariance) {
             new (self) Engine(make_engine(order, initial.data(), covariance.data()));
           })
      .def("update", &update, nb::arg("regressor"), nb::arg("output"),
           nb::arg("forgetting_factor") = 1.0, nb::arg("perturbation") = 0.0,
           nb::sig("def update(self, regressor: collections.abc.Sequence[float] | "
                   "numpy.typing.NDArray[numpy.float64], output: float, forgetting_factor: float = "
                   "1.0, perturbation: float = 0.0) -> Status"),
           R"(Take one row y = φᵀθ (eq. 13): the regressor φ, a sequence of ``order`` numbers, the
output y, the forgetting factor λ in (0, 1] of this sample, and a perturbation that is added to the
diagonal of P before division by λ. Returns a :class:`Status`, which names numbers out of range.)")
      .def("predict", &predict, nb::arg("regressor"),
           nb::sig("def predict(self, regressor: collections.abc.Sequence[float] | "
                   "numpy.typing.NDArray[numpy.float64]) -> float"),
           "φᵀθ.")
      .def_prop_ro(
          "parameters",
          [](const Engine& self) {
            const Knowledge now = known(self);
            return copied_array(now.parameters, {now.order});
          },
          nb::sig("def parameters(self) -> numpy.typing.NDArray[numpy.float64]"), "θ.")
      .def_prop_ro(
          "covariance",
          [](const Engine& self) {
            const Knowledge now = known(self);
            return copied_array(now.covariance, {now.order, now.order});
          },
          nb::sig("def covariance(self) -> numpy.typing.NDArray[numpy.float64]"),
          "P. The covariance of θ is ``noise_variance`` times it.")
      .def_prop_ro(
          "noise_variance", [](const Engine& self) { return known(self).noise_variance; },
          "Variance of y about φᵀθ; 1 until there are more samples than coefficients.")
      .def_prop_ro(
          "samples", [](const Engine& self) { return known(self).samples; },
          "Number of rows taken.")
      .def("_state",
           [](const Engine& self) { return saved(name_of(self), std::array{known(self).memory}); })
      .def("_restore", [](Engine& self, const nb::bytes& state) {
        std::visit([&](auto& recursion) { restore(recursion, name_of(self), state); }, self);
      });
  module.def("long_run_covariance", &long_run_covariance, nb::arg("scores"), nb::arg("residual"),
             nb::arg("shares"), nb::arg("fitted"), nb::arg("result"),
             "Fills the covariance of Σ u e for scores u by rows and a correlated residual e.");
}

}  // namespace palpate::bindings
