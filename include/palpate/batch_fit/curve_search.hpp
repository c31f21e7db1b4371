// The lowest minimum of a curve's cost (curve_cost.hpp) over all valleys. A search over means of
// samples, with the sums of the recursion, finds where to start descents; the descents over all
// samples decide which minimum is lowest.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "palpate/batch_fit/curve_cost.hpp"
#include "palpate/projection/projection_fit.hpp"

namespace palpate::detail {

// Means of blocks of equally many consecutive samples. Because ξⁿ is curved they are biased, and
// only serve to find starts.
class CurveMeans {
 public:
  static constexpr std::size_t most = CurveSamples::block;

  // Blocks of all parts; each part ends with its own shorter block.
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

// Starting points, with the lowest cost first.
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

// Settings for which a mean counts as one sample.
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

// The points where the recursion would end for the means: the lowest valleys of J(n).
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
  // Along a valley d and n change together, so that a finer grid has more local minima of the same
  // valley.
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

// The least difference between exponents of different valleys.
inline constexpr double valleys_apart = 0.3;

// The lowest of the minima that the coarse search leads to, and the lowest in a valley with another
// exponent.
struct CurveMinima {
  CurveMinimum best;
  CurveMinimum rival;  // infinite cost if there is none
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
  std::array<CurveMinimum, CurveStarts::most + 4> found;
  std::size_t count = 0, deepest = 0;
  const CurveDescent quick(coarse);
  const auto look = [&](const CurvePoint& start) noexcept {
    found[count] = quick.from(quick.bounded(start), coarse_passes, coarse_tolerance);
    if (found[count].cost < found[deepest].cost) deepest = count;
    ++count;
  };
  for (std::size_t i = 0; i < starts.count; ++i) look(starts.starts[i]);
  const CurvePoint least = found[deepest].at;
  const auto& [k, c, n, offset, surface] = least;
  const bool beyond = k < 0.0 || std::abs(c) > 0.5 * k;
  if (!model.priors().exponent_known() && (!known || beyond)) {
    std::array<CurvePoint, 4> others{};
    std::size_t more = 0;
    const auto add = [&](double stiffness, double damping, double exponent) noexcept {
      others[more++] = {stiffness, damping, exponent, offset, surface};
    };
    // At v = a − b x, as for a probe that slows down while it presses, xⁿ⁺¹ fits as well as xⁿ, and
    // the grid may miss one of the two valleys.
    if (!known) {
      add(k, c, n - 1.0);
      add(k, c, n + 1.0);
    }
    // The grid also misses valleys beyond the ridge at k = 0: a larger n with c ≥ 0, and k < 0 with
    // a large c.
    if (beyond && (k < 0.0 || c < 0.0)) {
      add(std::abs(k), 0.0, n + 1.0);
      if (k < 0.0) add(-k, -k, n + 0.4);
    } else if (beyond) {
      add(-k, 1.5 * k, n - 1.0);
    }
    for (std::size_t i = 0; i < more; ++i) {
      look(quick.with_linear_part(coarse.at(quick.bounded(others[i]))));
    }
  }
  const double lowest = found[deepest].cost, variance = found[deepest].state.variance;
  // The means distort the cost: a minimum within this many σ² of the lowest may be the lowest of
  // all.
  const double margin = (known ? 60.0 : 20.0) * variance / means.data().per_point;
  const CurveDescent descent(cost);
  CurveMinimum best{}, rival{};
  best.cost = rival.cost = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i) {
    if (!(found[i].cost <= lowest + margin)) continue;
    bool again = false;  // another start has led here too
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

// The lowest of the minima in which descents from these starts end.
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

// The cost of a curve around one point from fewer samples. Samples near the surface are kept,
// because J has a kink wherever the surface passes one; the others are replaced by means.
//
// A mean is placed where the law has the same mean residual at that point, and the remaining
// differences of J and of its slope there are added as a linear form. So J and its slope equal
// those of the whole curve at the point. Within two standard errors of it, J is mostly accurate to
// a thousandth of σ²; if the surface is known worst, to a tenth in 99 of 100 descents.
class CondensedCurve {
 public:
  // `at` is a state of the cost over all samples, whose residuals are in the arrays of `data`;
  // `reach` is the largest distance that the surface may move from it, and `memory` is as large as
  // those arrays.
  CondensedCurve(const CurveModel& model, const CurveData& data, const CurveState& at, double reach,
                 const CurveSamples& memory) noexcept
      : data_(data) {
    const CurveSamples& from = data.parts[0];
    const double surface = at.at[4];
    const auto mean = [&](std::size_t first) noexcept {
      return condenses(from, first, surface, reach);
    };
    std::size_t means = 0;
    for (std::size_t i = 0; i + length <= from.count; i += length) means += mean(i) ? 1 : 0;
    const std::size_t start = CurveSamples::padded(from.count - length * means);
    CurveSamples near = memory, far{memory.x + start,   memory.w + start,        memory.f + start,
                                    memory.log + start, memory.residual + start, 0};
    near.count = 0;
    for (std::size_t i = 0; i < from.count; i += length) {
      if (i + length <= from.count && mean(i)) {
        add_mean(from, from.residual, i, length, far);  // in place of the force
      } else {
        add_all(from, i, near);
      }
    }
    near.pad();
    far.pad();
    force_as_residual(model, at.at, far);
    data_.parts = {near, far};
    data_.used = 2;
    data_.weight = {1.0, static_cast<double>(length)};
    const CurveState rough = CurveCost(model, data_).at(at.at);
    data_.tangent.at = at.at;
    data_.tangent.squares = at.sums.squares - rough.sums.squares;
    for (std::size_t i = 0; i < 5; ++i) {
      data_.tangent.gradient[i] = at.sums.gradient[i] - rough.sums.gradient[i];
    }
  }

  const CurveData& data() const noexcept { return data_; }

 private:
  // Samples per mean. (Of 2000 one-way curves two lost their minimum with 16, and none with 8.)
  static constexpr std::size_t length = 8;

  // Whether the samples stay above the surface, or so far below it that xⁿ is nearly linear over
  // them.
  static bool condenses(const CurveSamples& from, std::size_t first, double surface,
                        double reach) noexcept {
    double low = from.x[first], high = low;
    for (std::size_t i = first + 1; i < first + length; ++i) {
      low = std::min(low, from.x[i]);
      high = std::max(high, from.x[i]);
    }
    constexpr double least = 4.0;  // depth in spreads of a mean: (1 + 1/8)ⁿ is still nearly linear
    return high < surface - reach || low - (surface + reach) > least * (high - low);
  }

  static void add_all(const CurveSamples& from, std::size_t first, CurveSamples& to) noexcept {
    for (std::size_t i = first; i < std::min(first + length, from.count); ++i) {
      to.x[to.count] = from.x[i];
      to.w[to.count] = from.w[i];
      to.f[to.count] = from.f[i];
      ++to.count;
    }
  }

  // Adds the force of the law to each mean, because a pass subtracts that force from r.
  static void force_as_residual(const CurveModel& model, const CurvePoint& at,
                                const CurveSamples& means) noexcept {
    curve_sums(means, at, true, *model.kernels);
    for (std::size_t i = 0; i < means.count; ++i) {
      means.f[i] += means.f[i] - means.residual[i];
    }
  }

  CurveData data_;
};

// A line through a minimum, and the step along it that moves the surface by one standard error.
struct CurveLine {
  Vector<5> deviation{};
  bool sound = false;

  CurveLine(const CurveCost& cost, const CurveState& state) noexcept {
    const CurveCost::Slope slope = cost.slope(state);
    const CurveStep along = solve_open(slope.information, slope.information,
                                       {0.0, 0.0, 0.0, 0.0, 1.0}, cost.model().open(), 1e-12);
    sound = along.by[4] > 0.0;
    if (!sound) return;
    const double unit = std::sqrt(state.variance / along.by[4]);
    for (std::size_t i = 0; i < 5; ++i) deviation[i] = unit * along.by[i];
  }

  CurvePoint from(CurvePoint centre, double deviations) const noexcept {
    for (std::size_t i = 0; i < 5; ++i) centre[i] += deviations * deviation[i];
    return centre;
  }
};

// Finds the lowest minimum if J has many: for n near 1 and below, J has a kink at every sample that
// the surface passes. The search follows the direction in which the surface is known worst.
class CurvePolish {
 public:
  // `memory` is as large as the arrays of `data`.
  CurvePolish(const CurveModel& model, const CurveData& data, const CurveSamples& memory) noexcept
      : model_(model), data_(data), memory_(memory), cost_(model, data) {}

  // `goal` is the cost below which a minimum is worth finding, and a valley to skip.
  CurveMinimum operator()(CurveMinimum best, const CurveAbandon& goal) const noexcept {
    for (int round = 0; round < 2; ++round) {
      best.state = cost_.at(best.at);
      const CurveLine line(cost_, best.state);
      if (!line.sound) break;
      // Descents also end beyond the outermost starting points. (With a factor of 1.4 one in 400
      // lost its minimum.)
      const double reach = 2.0 * farthest * line.deviation[4];
      const CondensedCurve condensed(model_, data_, best.state, reach, memory_);
      const CurveMinimum beside = lowest_beside({model_, condensed.data()}, best, line, goal);
      const double enough = 1e-6 * best.state.variance;
      if (!(beside.cost < std::min(goal.cost, best.cost) - enough)) break;
      const CurveMinimum here = CurveDescent(cost_).from(beside.at, 40, tolerance);
      const bool better = here.cost < best.cost - enough;
      if (here.cost < best.cost) best = here;
      if (!better) break;
    }
    return best.at[2] < 1.0 || !best.settled ? lowest_at_samples(best) : best;
  }

 private:
  static constexpr double farthest = 2.5;  // standard errors
  static constexpr double steps[] = {0.3, 0.7, 1.2, 1.8, farthest};
  static constexpr double tolerance = 1e-8;

  // The lowest minimum of descents from points on the line.
  static CurveMinimum lowest_beside(const CurveCost& cost, const CurveMinimum& centre,
                                    const CurveLine& line, const CurveAbandon& goal) noexcept {
    const CurveDescent descent(cost);
    // At n = 1 and below descents are slow, from kink to kink.
    const int passes = centre.at[2] < 1.0 ? 40 : 25;
    CurveMinimum lowest = centre;
    for (const double step : steps) {
      for (const double side : {-1.0, 1.0}) {
        const CurvePoint start = line.from(centre.at, side * step);
        CurveAbandon abandon = goal;
        abandon.at = lowest.at;
        abandon.cost = std::min(goal.cost, lowest.cost);
        abandon.near = 1e-4 * line.deviation[4];
        const CurveMinimum here = descent.from(descent.bounded(start), passes, tolerance, abandon);
        if (std::abs(here.at[2] - goal.elsewhere) < goal.apart) continue;
        if (here.cost < lowest.cost) lowest = here;
      }
    }
    return lowest;
  }

  // Below n = 1 the slope is infinite where the surface reaches a sample from above, and J may have
  // its minimum exactly there, where no Newton step ends.
  CurveMinimum lowest_at_samples(const CurveMinimum& least) const noexcept {
    constexpr double none = std::numeric_limits<double>::infinity();
    const CurveSamples& samples = data_.parts[0];
    double above = -none, below = none;  // the depths nearest to the surface
    for (std::size_t i = 0; i < samples.count; ++i) {
      const double x = samples.x[i], surface = least.at[4];
      above = x <= surface ? std::max(above, x) : above;
      below = x > surface ? std::min(below, x) : below;
    }
    std::array<bool, 5> open = model_.open();
    open[4] = false;
    const CurveDescent descent(cost_, open);
    CurveMinimum lowest = least;
    for (const double depth : {above, below}) {
      CurvePoint start = least.at;
      start[4] = depth;
      if (descent.bounded(start) != start) continue;
      CurveMinimum here = descent.from(start, 25, tolerance);
      // From n = 1 on J is lower there, but the minimum lies further on.
      here.settled = here.settled && here.at[2] < 1.0;
      if (here.cost < lowest.cost) lowest = here;
    }
    return lowest;
  }

  const CurveModel& model_;
  const CurveData& data_;
  const CurveSamples& memory_;
  CurveCost cost_;
};

}  // namespace palpate::detail
