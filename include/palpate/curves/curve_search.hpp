// The lowest minimum of a curve's cost (curve_cost.hpp), among those of all valleys: a search over
// means of samples says where to go down, and the descents over all samples say which is lowest.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "palpate/curves/curve_cost.hpp"
#include "palpate/curves/curve_minimum.hpp"
#include "palpate/curves/curve_starts.hpp"

namespace palpate::detail {

inline void take_logarithms(const CurveModel& model, const CurveSamples& samples) noexcept {
  model.kernels->logarithms(samples.x, samples.log, CurveSamples::padded(samples.count));
}

// Exponents of different valleys.
inline constexpr double valleys_apart = 0.3;

// The lowest of the minima that the coarse search leads to, and the lowest in a valley of another
// exponent.
struct CurveMinima {
  CurveMinimum best;
  CurveMinimum rival;  // of infinite cost where there is none
};

inline CurveMinima lowest_minima(const CurveModel& model, const CurveData& data) noexcept {
  constexpr double coarse_tolerance = 1e-4, tolerance = 1e-8;
  constexpr int coarse_passes = 12, most_passes = 40;
  const bool known = !model.finds_surface();
  const CurveMeans means(data);
  if (known) take_logarithms(model, means.samples());
  const CurveCost coarse(model, means.data()), cost(model, data);
  const CurveStarts starts =
      known ? known_surface_starts(means, coarse) : unknown_surface_starts(means, coarse);
  std::array<CurveMinimum, CurveStarts::most + 2> found;
  std::size_t count = 0, deepest = 0;
  const CurveDescent quick(coarse);
  const auto look = [&](const CurvePoint& start) noexcept {
    found[count] = quick.from(quick.bounded(start), coarse_passes, coarse_tolerance);
    if (found[count].cost < found[deepest].cost) deepest = count;
    ++count;
  };
  for (std::size_t i = 0; i < starts.count; ++i) look(starts.starts[i]);
  if (!known && !model.priors().exponent_known()) {
    // At v = a − b x, as of a probe that slows down while it goes in, xⁿ⁺¹ does in place of xⁿ: the
    // grid does not see the valleys of both.
    const CurvePoint least = found[deepest].at;
    for (const double away : {-1.0, 1.0}) {
      CurvePoint other = least;
      other[2] += away;
      look(quick.with_linear_part(coarse.at(quick.bounded(other))));
    }
  }
  const double lowest = found[deepest].cost, variance = found[deepest].state.variance;
  // Means bend the cost: what is within so many σ² of the lowest may be the lowest of all.
  const double margin = (known ? 60.0 : 20.0) * variance / means.data().per_point;
  const CurveDescent descent(cost);
  CurveMinimum best{}, rival{};
  best.cost = rival.cost = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i) {
    if (!(found[i].cost <= lowest + margin)) continue;
    bool again = false;  // another start has come here too
    for (std::size_t j = 0; j < i; ++j) {
      again = again || (std::abs(found[i].at[2] - found[j].at[2]) < 1e-4 &&
                        std::abs(found[i].at[4] - found[j].at[4]) < 1e-5 &&
                        found[j].cost <= lowest + margin);
    }
    if (again) continue;
    const CurveMinimum here = descent.from(found[i].at, most_passes, tolerance);
    const bool lower = here.cost < best.cost;
    const CurveMinimum other = lower ? best : here;
    if (std::abs((lower ? here : best).at[2] - other.at[2]) > valleys_apart &&
        other.cost < rival.cost) {
      rival = other;
    }
    if (lower) {
      best = here;
    } else {
      best.latest = false;
    }
  }
  rival.latest = false;
  return {best, rival};
}

inline CurveMinimum global_minimum(const CurveModel& model, const CurveData& data) noexcept {
  return lowest_minima(model, data).best;
}

// Of the minima that descents from these starts end in the lowest.
template <class Starts>
CurveMinimum lowest_of(const CurveModel& model, const CurveData& data,
                       const Starts& starts) noexcept {
  constexpr double tolerance = 1e-8;
  constexpr int most_passes = 40;
  const CurveCost cost(model, data);
  const CurveDescent descent(cost);
  CurveMinimum best{};
  best.cost = std::numeric_limits<double>::infinity();
  for (const CurvePoint& start : starts) {
    const CurveMinimum here = descent.from(descent.bounded(start), most_passes, tolerance);
    if (here.cost < best.cost) best = here;
  }
  return best;
}

}  // namespace palpate::detail
