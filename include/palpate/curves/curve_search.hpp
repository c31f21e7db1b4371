// The lowest minimum of a curve's cost (curve_cost.hpp), among those of all valleys: a search over
// means of samples, by the sums of the recursion, says where to go down, and the descents over all
// samples say which is lowest.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "palpate/curves/curve_cost.hpp"
#include "palpate/curves/curve_minimum.hpp"
#include "palpate/projection/projection_fit.hpp"

namespace palpate::detail {

// Means of blocks of equally many consecutive samples; they bend where ξⁿ does, so they only start.
class CurveMeans {
 public:
  static constexpr std::size_t most = CurveSamples::block;

  // Of all parts together, but for the rounding of each.
  explicit CurveMeans(const CurveData& data) noexcept {
    const double per_point =
        std::max(1.0, std::ceil(data.count() / static_cast<double>(most - data.used + 1)));
    const auto length = static_cast<std::size_t>(per_point);
    data_ = {{CurveSamples{columns_[0].data(), columns_[1].data(), columns_[2].data(),
                           columns_[3].data(), columns_[4].data(), 0}},
             1,
             0.0,
             per_point};
    CurveSamples& means = data_.parts[0];
    for (std::size_t part = 0; part < data.used; ++part) {
      const CurveSamples& from = data.parts[part];
      for (std::size_t first = 0; first < from.count; first += length) {
        add_mean(from, from.f, first, std::min(length, from.count - first), means);
      }
    }
    means.pad();
    data_.force_squared = squared_force(means);
  }
  CurveMeans(const CurveMeans&) = delete;
  CurveMeans& operator=(const CurveMeans&) = delete;

  const CurveData& data() const noexcept { return data_; }
  const CurveSamples& samples() const noexcept { return data_.parts[0]; }

 private:
  alignas(64) std::array<std::array<double, most>, 5> columns_;
  CurveData data_{};
};

// Places to start from, the lowest cost first.
struct CurveStarts {
  static constexpr std::size_t most = 8;

  void add(const CurvePoint& at, double cost) noexcept {
    std::size_t place = std::min(count, most - 1);
    if (count == most && !(cost < costs[place])) return;
    if (count < most) ++count;
    for (; place > 0 && cost < costs[place - 1]; --place) {
      starts[place] = starts[place - 1];
      costs[place] = costs[place - 1];
    }
    starts[place] = at;
    costs[place] = cost;
  }

  std::array<CurvePoint, most> starts{};
  std::array<double, most> costs{};
  std::size_t count = 0;
};

// The settings under which a mean counts as one sample.
inline ProjectionSettings settings_of_means(const CurveCost& cost) noexcept {
  ProjectionSettings settings = cost.model().settings;
  settings.noise /= std::sqrt(cost.data().per_point);
  return settings;
}

inline PowerSums sums_below(const CurveSamples& means, double surface,
                            const ProjectionSettings& settings) noexcept {
  PowerSums sums = empty_sums(settings);
  for (std::size_t i = 0; i < means.count; ++i) {
    sums.add({means.x[i] - surface, means.w[i], means.f[i]}, 1.0);
  }
  return sums;
}

// Where the recursion would end, of the means: in the lowest valleys of J(n).
inline CurveStarts known_surface_starts(const CurveMeans& means, const CurveCost& cost) noexcept {
  const ProjectionSettings settings = settings_of_means(cost);
  const PowerSums sums = sums_below(means.samples(), 0.0, settings);
  const ProjectionProblem problem(sums, settings);
  const Valleys valleys = search_grid(problem);
  CurveStarts found;
  for (std::size_t i = 0; i < valleys.count; ++i) {
    const SearchStart& start = valleys.start[i];
    const auto [n, at, linear] = refine(problem, start);
    found.add({linear.k, linear.c, n, linear.offset, 0.0},
              linear.cost + problem.exponent_penalty(n, start.variance));
  }
  return found;
}

// The lowest local minima of J(d, n) over a grid, without the prior on c/k.
inline CurveStarts unknown_surface_starts(const CurveMeans& means, const CurveCost& cost) noexcept {
  constexpr std::size_t surfaces = 24, nodes = PowerSums::nodes, most = 6;
  const CurveModel& model = cost.model();
  const ProjectionSettings settings = settings_of_means(cost);
  const double step = model.surface_range() / static_cast<double>(surfaces - 1);
  const auto surface = [&](std::size_t i) noexcept {
    return model.lowest_surface + step * static_cast<double>(i);
  };
  const auto bank = [&]<std::size_t... Index>(std::index_sequence<Index...>) noexcept {
    return std::array{sums_below(means.samples(), surface(Index), settings)...};
  }(std::make_index_sequence<surfaces>());
  const ProjectionProblem any(bank[0], settings);
  std::array<GridCosts, surfaces> costs;
  double fraction = any.offset_fraction(settings.noise * settings.noise);
  const auto lowest_of_all = [&]() noexcept {
    double least = 0.0;
    for (std::size_t i = 0; i < surfaces; ++i) {
      costs[i] = grid_costs(bank[i], fraction);
      least = std::min(least, *std::min_element(costs[i].begin(), costs[i].end()));
    }
    return least - fraction * bank[0].force() * bank[0].force();
  };
  const double variance = any.prior_variance(lowest_of_all());
  if (any.offset_fraction(variance) != fraction) {
    fraction = any.offset_fraction(variance);
    lowest_of_all();
  }
  const std::size_t used = any.exponent_known() ? 1 : nodes;
  for (GridCosts& row : costs) {
    for (std::size_t j = 0; j < used; ++j) {
      row[j] += any.exponent_penalty(bank[0].exponent(j), variance);
    }
  }
  // Along a valley d and n change together, so that a finer grid has more minima and no more of it.
  constexpr std::size_t reach = 3;
  CurveStarts found;
  for (std::size_t i = 0; i < surfaces; ++i) {
    for (std::size_t j = 0; j < used; ++j) {
      bool least = true;
      for (std::size_t a = i > 0 ? i - 1 : i; least && a <= std::min(i + 1, surfaces - 1); ++a) {
        for (std::size_t b = j - std::min(j, reach); least && b <= std::min(j + reach, used - 1);
             ++b) {
          least = !(costs[a][b] < costs[i][j]);
        }
      }
      if (!least) continue;
      const LinearSolution linear =
          solve_linear({bank[i], settings}, bank[i].node(j), 0.0, fraction);
      found.add({linear.k, linear.c, bank[i].exponent(j), linear.offset, surface(i)}, costs[i][j]);
    }
  }
  found.count = std::min(found.count, most);
  return found;
}

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
