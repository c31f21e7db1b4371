#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <variant>

#include "conversions.hpp"
#include "palpate/least_squares.hpp"
#include "state.hpp"

namespace palpate::bindings {
namespace {

template <class Sequence>
struct EngineOf;

template <std::size_t... Index>
struct EngineOf<std::index_sequence<Index...>> {
  using type = std::variant<LeastSquares<Index + 1>...>;
};

constexpr std::size_t largest_order = 8;

// One compiled recursion for each order, behind one Python class.
struct Engine {
  typename EngineOf<std::make_index_sequence<largest_order>>::type recursion;
};

std::string name_of(const Engine& engine) {
  return "LeastSquares." + std::to_string(engine.recursion.index() + 1);
}

template <std::size_t Order>
Engine make_engine(const InputArray& initial, const InputArray& covariance) {
  typename LeastSquares<Order>::Settings settings;
  for (std::size_t i = 0; i < Order; ++i) {
    settings.initial[i] = initial.data()[i];
    for (std::size_t j = 0; j < Order; ++j) {
      settings.initial_covariance[i][j] = covariance.data()[i * Order + j];
    }
  }
  return {LeastSquares<Order>(settings)};
}

template <std::size_t... Index>
Engine make_engine(std::size_t order, const InputArray& initial, const InputArray& covariance,
                   std::index_sequence<Index...>) {
  using Make = Engine (*)(const InputArray&, const InputArray&);
  constexpr Make make[] = {&make_engine<Index + 1>...};
  return make[order - 1](initial, covariance);
}

// Reads a sequence of exactly `Order` numbers without allocating.
template <std::size_t Order>
Vector<Order> regressor_of(const nb::sequence& sequence) {
  if (nb::len(sequence) != Order) {
    throw nb::value_error(("regressor must have " + std::to_string(Order) + " entries").c_str());
  }
  Vector<Order> regressor{};
  for (std::size_t i = 0; i < Order; ++i) {
    if (!nb::try_cast(sequence[i], regressor[i])) {
      throw nb::type_error(
          ("regressor must hold numbers, and its entry " + std::to_string(i) + " is not one")
              .c_str());
    }
  }
  return regressor;
}

template <std::size_t Order>
Status update(LeastSquares<Order>& recursion, const nb::sequence& sequence, double output,
              double forgetting_factor, double perturbation) {
  const Vector<Order> regressor = regressor_of<Order>(sequence);
  const auto finite = [](double number) { return std::isfinite(number); };
  if (!finite(output) || !finite(perturbation) || !std::ranges::all_of(regressor, finite)) {
    return Status::not_finite;
  }
  if (!(forgetting_factor > 0.0 && forgetting_factor <= 1.0) || perturbation < 0.0) {
    return Status::out_of_range;
  }
  return recursion.update(regressor, output, forgetting_factor, perturbation);
}

template <std::size_t Order>
nb::object covariance_array(const LeastSquares<Order>& recursion) {
  return copied_array(recursion.covariance()[0].data(), {Order, Order});
}

}  // namespace

void bind_least_squares(nb::module_& module) {
  nb::class_<Engine>(module, "LeastSquares")
      .def("__init__",
           [](Engine* self, std::size_t order, const InputArray& initial,
              const InputArray& covariance) {
             new (self) Engine(make_engine(order, initial, covariance,
                                           std::make_index_sequence<largest_order>{}));
           })
      .def(
          "update",
          [](Engine& self, const nb::sequence& regressor, double output, double forgetting_factor,
             double perturbation) {
            return std::visit(
                [&](auto& recursion) {
                  return update(recursion, regressor, output, forgetting_factor, perturbation);
                },
                self.recursion);
          },
          nb::arg("regressor"), nb::arg("output"), nb::arg("forgetting_factor") = 1.0,
          nb::arg("perturbation") = 0.0,
          nb::sig("def update(self, regressor: collections.abc.Sequence[float] | "
                  "numpy.typing.NDArray[numpy.float64], output: float, forgetting_factor: float = "
                  "1.0, perturbation: float = 0.0) -> Status"),
          R"(Take one row y = φᵀθ (eq. 13): the regressor φ, a sequence of ``order`` numbers, the
output y, the forgetting factor λ in (0, 1] of this sample and what is added to the diagonal of P
before it is divided by λ. Numbers out of their range are refused with a :class:`Status`.)")
      .def(
          "predict",
          [](const Engine& self, const nb::sequence& regressor) {
            return std::visit(
                [&]<std::size_t Order>(const LeastSquares<Order>& recursion) {
                  return recursion.predict(regressor_of<Order>(regressor));
                },
                self.recursion);
          },
          nb::arg("regressor"),
          nb::sig("def predict(self, regressor: collections.abc.Sequence[float] | "
                  "numpy.typing.NDArray[numpy.float64]) -> float"),
          "φᵀθ.")
      .def_prop_ro(
          "parameters",
          [](const Engine& self) {
            return std::visit(
                [](const auto& recursion) {
                  return copied_array(recursion.parameters().data(),
                                      {recursion.parameters().size()});
                },
                self.recursion);
          },
          nb::sig("def parameters(self) -> numpy.typing.NDArray[numpy.float64]"), "θ.")
      .def_prop_ro(
          "covariance",
          [](const Engine& self) {
            return std::visit([](const auto& recursion) { return covariance_array(recursion); },
                              self.recursion);
          },
          nb::sig("def covariance(self) -> numpy.typing.NDArray[numpy.float64]"),
          "P. The covariance of θ is ``noise_variance`` times it.")
      .def_prop_ro(
          "noise_variance",
          [](const Engine& self) {
            return std::visit([](const auto& recursion) { return recursion.noise_variance(); },
                              self.recursion);
          },
          "Variance of y about φᵀθ; 1 until there are more samples than coefficients.")
      .def_prop_ro(
          "samples",
          [](const Engine& self) {
            return std::visit([](const auto& recursion) { return recursion.samples(); },
                              self.recursion);
          },
          "Rows taken.")
      .def("_state",
           [](const Engine& self) {
             return std::visit(
                 [&](const auto& recursion) { return saved(recursion, name_of(self)); },
                 self.recursion);
           })
      .def("_restore", [](Engine& self, const nb::bytes& state) {
        std::visit([&](auto& recursion) { restore(recursion, name_of(self), state); },
                   self.recursion);
      });
}

}  // namespace palpate::bindings
