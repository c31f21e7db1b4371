#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <variant>

#include "conversions.hpp"
#include "palpate/error_widening.hpp"
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

// What it knows, whatever its order.
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

// Reads a sequence of as many numbers without allocating.
void read(const nb::sequence& sequence, std::span<double> regressor) {
  const std::size_t order = regressor.size();
  if (nb::len(sequence) != order) {
    throw nb::value_error(("regressor must have " + std::to_string(order) + " entries").c_str());
  }
  for (std::size_t i = 0; i < order; ++i) {
    if (!nb::try_cast(sequence[i], regressor[i])) {
      throw nb::type_error(
          ("regressor must hold numbers, and its entry " + std::to_string(i) + " is not one")
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

// Variances of influence · Σ J e over all samples, J and e of this order in time.
template <std::size_t Size>
void variances(const InputRows& slopes, const InputArray& residual, const InputRows& influence,
               const OutputArray& result) {
  detail::HaarLevels<Size> levels;
  double energy = 0.0;
  for (std::size_t i = 0; i < residual.size(); ++i) {
    Vector<Size> slope{};
    std::copy_n(slopes.data() + i * Size, Size, slope.begin());
    levels.add(slope, residual.data()[i], 1.0);
    energy += residual.data()[i] * residual.data()[i];
  }
  const double count = static_cast<double>(residual.size()), size = static_cast<double>(Size);
  const double variance = std::max(energy / std::max(count - size, 1.0), 1e-300);
  const detail::ErrorWidening<Size, 1> widening(levels, {}, variance);
  for (std::size_t i = 0; i < Size; ++i) {
    Vector<Size> row{};
    std::copy_n(influence.data() + i * Size, Size, row.begin());
    result.data()[i] = widening.variance(row);
  }
}

void correlated_variances(const InputRows& slopes, const InputArray& residual,
                          const InputRows& influence, const OutputArray& result) {
  const std::size_t size = slopes.shape(1);
  if ((size != 2 && size != 3) || slopes.shape(0) != residual.size() ||
      influence.shape(0) != size || influence.shape(1) != size || result.size() != size) {
    throw nb::value_error("slopes must have two or three columns, influence as many squared");
  }
  (size == 2 ? variances<2> : variances<3>)(slopes, residual, influence, result);
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
output y, the forgetting factor λ in (0, 1] of this sample and what is added to the diagonal of P
before it is divided by λ. Numbers out of their range are refused with a :class:`Status`.)")
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
          "samples", [](const Engine& self) { return known(self).samples; }, "Rows taken.")
      .def("_state",
           [](const Engine& self) { return saved(name_of(self), std::array{known(self).memory}); })
      .def("_restore", [](Engine& self, const nb::bytes& state) {
        std::visit([&](auto& recursion) { restore(recursion, name_of(self), state); }, self);
      });
  module.def("correlated_variances", &correlated_variances, nb::arg("slopes"), nb::arg("residual"),
             nb::arg("influence"), nb::arg("result"),
             "Fills the variances of influence · Σ J e, where the residual e is correlated: J by "
             "rows, influence too.");
}

}  // namespace palpate::bindings
