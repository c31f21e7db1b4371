// Fits the Hunt–Crossley law to a whole curve: the minimum of its cost (curve_cost.hpp) over the
// samples that variable projection selects, with the same error bars.
//
// This is one of three fits of a law; it needs all samples at the same time. Passes over the
// samples compute the cost from residuals, which is exact however small the noise, also with a free
// surface; a curve of 1000 samples takes 40 µs. The recursion (projection/projection_fit.hpp)
// returns an estimate while samples arrive and keeps only sums; both share the selection of
// samples, the priors, the search for starts and the error bars. The law with relaxation
// (viscoelastic/solver.hpp) has states that depend on the whole motion.
//
//   std::vector<double> memory(palpate::curve_memory(samples));
//   const palpate::CurveFit fit = palpate::fit_curve(arrays, settings, memory.data());
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/batch_fit/curve_cost.hpp"
#include "palpate/batch_fit/curve_kernels.hpp"
#include "palpate/batch_fit/curve_search.hpp"
#include "palpate/batch_fit/curve_selection.hpp"
#include "palpate/error_widening.hpp"
#include "palpate/matrix.hpp"
#include "palpate/projection/covariance.hpp"
#include "palpate/sample.hpp"

namespace palpate {

namespace detail {

// The slopes and residuals of a whole contact by time scale. `columns` are (ξ, ξw, ξ ln ξ, r) in
// the order of time, and are overwritten. The slope of F₀ is one, so that only blocks without a
// partner contain it.
inline HaarLevels<4> haar_levels(const std::array<double*, 4>& columns,
                                 std::size_t samples) noexcept {
  HaarLevels<4> levels;
  double length = 1.0;
  std::size_t count = samples;
  for (std::size_t k = 0; k < HaarLevels<4>::most && count > 0; ++k, length *= 2.0) {
    HaarLevel<4>& level = levels[k];
    const std::size_t pairs = count / 2;
    const double per_pair = 0.5 / length;
    const auto [a, b, c, r] = columns;
    std::array<std::array<double, 2>, 7> sums{};  // two of each, for two parallel additions
    const auto pair = [&](std::size_t i, std::size_t lane) noexcept {
      const double da = a[2 * i] - a[2 * i + 1], db = b[2 * i] - b[2 * i + 1];
      const double dc = c[2 * i] - c[2 * i + 1], dr = r[2 * i] - r[2 * i + 1];
      a[i] = a[2 * i] + a[2 * i + 1];
      b[i] = b[2 * i] + b[2 * i + 1];
      c[i] = c[2 * i] + c[2 * i + 1];
      r[i] = r[2 * i] + r[2 * i + 1];
      sums[0][lane] += da * da;
      sums[1][lane] += da * db;
      sums[2][lane] += da * dc;
      sums[3][lane] += db * db;
      sums[4][lane] += db * dc;
      sums[5][lane] += dc * dc;
      sums[6][lane] += dr * dr;
    };
    if (count % 2 == 1) {
      const std::size_t last = count - 1;
      levels.wait(k);
      level.half = {a[last], b[last], c[last], length};
      level.half_residual = r[last];
    }
    std::size_t i = 0;
    for (; i + 1 < pairs; i += 2) {
      pair(i, 0);
      pair(i + 1, 1);
    }
    if (i < pairs) pair(i, 0);
    const auto sum = [&](std::size_t j) noexcept { return (sums[j][0] + sums[j][1]) * per_pair; };
    level.information[0] = {sum(0), sum(1), sum(2), 0.0};
    level.information[1] = {0.0, sum(3), sum(4), 0.0};
    level.information[2] = {0.0, 0.0, sum(5), 0.0};
    level.older = level.newer = sum(6);
    level.older_pairs = level.newer_pairs = static_cast<double>(pairs);
    count = pairs;
  }
  return levels;
}

class CurveFitter {
 public:
  CurveFitter(const CurveArrays& curve, const CurveSettings& settings, double* memory,
              const curves::CurveKernels& kernels) noexcept
      : curve_(curve),
        settings_(settings),
        memory_(memory, curve.count),
        units_(scale_of(curve, settings)),
        selection_(memory_) {
    model_.kernels = &kernels;
    ProjectionSettings& s = model_.settings;
    s.noise = settings.noise / units_.force;
    s.lowest_exponent = settings.lowest_exponent;
    s.highest_exponent = settings.highest_exponent;
    s.offset = settings.offset;
    s.offset_deviation = settings.offset_deviation / units_.force;
    s.surface_deviation = settings.surface_deviation / units_.penetration;
    if (!(s.highest_exponent > s.lowest_exponent)) s.exponent = s.lowest_exponent;
    if (settings.find_surface) {
      model_.lowest_surface = settings.lowest_surface / units_.penetration;
      model_.highest_surface = settings.highest_surface / units_.penetration;
      if (settings.lowest_surface == settings.highest_surface) {
        model_.lowest_surface = -0.2;
        model_.highest_surface = 0.2;
      }
    }
  }

  CurveFit operator()(std::uint8_t* roles) noexcept {
    choose();
    CurveFit fit;
    fit.scale = units_;
    if (firm_.count > 0) answer(fit);
    if (roles) tell(roles, fit);
    return fit;
  }

 private:
  static Scale scale_of(const CurveArrays& curve, const CurveSettings& settings) noexcept {
    return settings.scale.penetration > 0.0 ? settings.scale : suggested_scale(curve);
  }

  void choose() noexcept {
    const double largest = std::pow(1e29, 1.0 / model_.settings.highest_exponent);
    if (model_.finds_surface()) {
      selection_.take_all(curve_, units_, model_.lowest_surface - 0.1, largest);
    } else {
      selection_.choose(curve_, units_, largest);
      choose_offset_prior();
    }
    // Firm samples, and from the next whole block on light ones, share the columns.
    const std::size_t firm = selection_.count(Role::sure), start = CurveSamples::padded(firm);
    for (CurveSamples* part : {&firm_, &light_}) {
      const std::size_t from = part == &light_ ? start : 0;
      *part = {memory_.column(6) + from, memory_.column(7) + from,  memory_.column(8) + from,
               memory_.column(9) + from, memory_.column(10) + from, 0};
    }
    firm_index_ = memory_.column(11);
    light_index_ = memory_.column(11) + start;
    selection_.copy(Role::sure, prior_mean_, firm_, firm_index_);
    if (model_.finds_surface()) return;
    selection_.copy(Role::light, prior_mean_, light_, light_index_);
    take_logarithms(model_, firm_);
    take_logarithms(model_, light_);
  }

  void choose_offset_prior() noexcept {
    ProjectionSettings& s = model_.settings;
    const Tare tare = measured_offset(s.offset, s.offset_deviation, s.surface_deviation,
                                      selection_.air(), selection_.least_step());
    prior_mean_ = tare.prior.mean;
    s.offset_deviation = tare.prior.deviation;
    of_air_ = tare.of_air;
    tare_refuted_ = tare.refuted;
  }

  static CurveData of(const CurveSamples& one) noexcept { return {{one}, 1, squared_force(one)}; }
  static CurveData of(const CurveSamples& one, const CurveSamples& other) noexcept {
    return {{one, other}, 2, squared_force(one) + squared_force(other)};
  }

  void answer(CurveFit& fit) noexcept {
    CurveMinimum best = model_.finds_surface() ? with_surface() : chosen();
    // Three rounds, because where the force dwells a correction changes the fit that it is based
    // on.
    const double level = firm_.f[0];
    for (int round = 0; round < 3 && unround(best, level); ++round) best = chosen();
    const CurveData data = joined_ ? of(firm_, light_) : of(firm_);
    const CurveCost cost(model_, data);
    if (!best.latest) best.state = cost.at(best.state.at);
    best.state.at = best.at;
    finish(fit, best, cost);
  }

  // Subtracts the mean error of rounding, given a fit, from the forces; true if the forces are
  // rounded. `level` is one of the readings.
  bool unround(const CurveMinimum& fit, double level) noexcept {
    const double step = selection_.resolution();
    if (!(step > 0.0) || model_.finds_surface()) return false;
    const CurveData data = joined_ ? of(firm_, light_) : of(firm_);
    CurveCost(model_, data).at(fit.at);  // its residuals
    const auto reading = [&](double force) noexcept {
      return level + step * std::round((force - level) / step);
    };
    const auto away = [&](const CurveSamples& part, std::size_t i) noexcept {
      return (part.f[i] - part.residual[i] - reading(part.f[i])) / step;
    };
    double square = 0.0;
    for (std::size_t k = 0; k < data.used; ++k) {
      for (std::size_t i = 0; i < data.parts[k].count; ++i) {
        const double steps = away(data.parts[k], i);
        square += std::min(steps * steps, 1.0);
      }
    }
    const double variance = square / data.count() - 1.0 / 12.0;
    if (!ForceRounding::applies(variance)) return false;
    for (std::size_t k = 0; k < data.used; ++k) {
      const CurveSamples& part = data.parts[k];
      for (std::size_t i = 0; i < part.count; ++i) {
        const double error = ForceRounding::mean_error(away(part, i), variance);
        part.f[i] = reading(part.f[i]) + step * error;
      }
    }
    return true;
  }

  CurveMinimum with_surface() const noexcept {
    // Above the exponent `kinked` J is smooth enough. Below it a minimum that is higher than the
    // best by up to `margin`, in σ², may lead to the lowest one.
    constexpr double kinked = 1.5, margin = 6.0;
    // The condensed cost of a rival may be too high by this much: 99 in 100 are nearer.
    constexpr double rough = 0.1;
    const CurveData data = of(firm_);
    auto [best, rival] = lowest_minima(model_, data);
    const double variance = best.state.variance;
    const auto kinks = [&](const CurveMinimum& found) noexcept {
      return found.at[2] < kinked && found.cost <= best.cost + margin * variance;
    };
    // The selection has already been copied from these columns, and the errors do not use them yet.
    const CurveSamples free{memory_.column(0), memory_.column(1),  memory_.column(2),
                            memory_.column(3), memory_.column(12), 0};
    const CurvePolish polished(model_, data, free);
    if (kinks(rival)) {
      rival = polished(rival, {{}, best.cost + rough * variance, 0.0, best.at[2], valleys_apart});
    }
    if (kinks(best)) best = polished(best, {{}, best.cost});
    best.latest = false;
    return rival.cost < best.cost ? rival : best;
  }

  // The minimum for a consistent choice of samples and of the offset's prior.
  CurveMinimum chosen() noexcept {
    const CurveData firm = of(firm_);
    if (light_.count > 0) {
      const CurveData all = of(firm_, light_);
      const CurveMinimum both = lowest_minima(model_, all).best;
      joined_ = true;
      if (evident(both, firm)) return both;
      joined_ = false;
    } else {
      const CurveMinimum alone = lowest_minima(model_, firm).best;
      if (evident(alone, firm)) return alone;
    }
    return decided(firm);
  }

  // Whether a Newton step from the minimum already shows that both tests below would pass: the
  // light samples have no more than noise left, and the offset agrees with its prior.
  bool evident(const CurveMinimum& found, const CurveData& firm) const noexcept {
    constexpr double plain_excess = 0.5 * largest_excess, plain_offset = 0.5 * suspect_offset;
    const auto pulling = [&](double w) noexcept { return pulls(found.at, w); };
    if (joined_ && std::any_of(light_.w, light_.w + light_.count, pulling)) return false;
    CurveState alone = found.state;
    alone.sums = found.state.part[0];
    const CurveCost cost(model_, firm);
    alone.variance = cost.variance(alone.sums.squares);
    const double count = firm.count(), light = static_cast<double>(light_.count);
    if (joined_ && count - 4.0 >= 10.0) {
      const CurveDescent::Gain gain = CurveDescent(cost).gain(alone);
      if (!gain.sound) return false;
      const double squares = std::max(alone.sums.squares - gain.gain, 0.0);
      const double variance = std::max(squares / (count - 4.0), tiny);
      const double more = found.state.sums.squares - squares;
      if (!(excess_of(more, light, variance) < plain_excess)) return false;
    }
    if (!(model_.settings.offset && model_.settings.offset_deviation > 0.0)) return true;
    CurveModel wide = model_;
    wide.settings.offset_deviation = 0.0;
    const CurveCost open(wide, firm);
    const CurveDescent::Gain gain = CurveDescent(open).gain(alone);
    if (!gain.sound) return false;
    const double error = std::sqrt(gain.offset_variance);
    const double away =
        std::abs(alone.at[3] + gain.by[3]) / combined(error, model_.settings.offset_deviation);
    return away < plain_offset;
  }

  // The same decision from separate fits, as in ContactSolver::solve.
  CurveMinimum decided(const CurveData& firm) noexcept {
    CurveMinimum best = lowest_minima(model_, firm).best;
    ProjectionSettings& s = model_.settings;
    if (s.offset && s.offset_deviation > 0.0) {
      CurveModel wide = model_;
      wide.settings.offset_deviation = 0.0;
      const CurveMinimum open = lowest_minima(wide, firm).best;
      const CurveCost cost(wide, firm);
      const double error = std::sqrt(CurveDescent(cost).gain(open.state).offset_variance);
      const double away = std::abs(open.at[3]) / combined(error, s.offset_deviation);
      tare_refuted_ = tare_refuted_ || (!of_air_ && away > suspect_offset);
      if (away > largest_offset) {
        s.offset_deviation = 0.0;
        best = open;
      } else {
        best.latest = false;
      }
    }
    if (light_.count == 0) return best;
    const std::size_t light = light_.count;
    leave_out_pulling(best.at);
    const double usable = static_cast<double>(light_.count);
    if (!(usable >= fewest_usable * static_cast<double>(light)) || light_.count == 0) return best;
    const CurveMinimum both = lowest_minima(model_, of(firm_, light_)).best;
    const double freedom = firm.count() - 4.0;
    const double variance = std::max(best.state.sums.squares / freedom, tiny);
    joined_ =
        freedom < 10.0 || !(excess_of(both.cost - best.cost, usable, variance) > largest_excess);
    best.latest = false;
    return joined_ ? both : best;
  }

  static bool pulls(const CurvePoint& at, double w) noexcept { return at[0] + at[1] * w < 0.0; }

  void leave_out_pulling(const CurvePoint& at) noexcept {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < light_.count; ++i) {
      const bool pulling = pulls(at, light_.w[i]);
      light_.x[kept] = light_.x[i];
      light_.w[kept] = light_.w[i];
      light_.f[kept] = light_.f[i];
      light_index_[kept] = light_index_[i];
      kept += pulling ? 0 : 1;
    }
    light_.count = kept;
    light_.pad();
    take_logarithms(model_, light_);
  }

  void finish(CurveFit& fit, const CurveMinimum& best, const CurveCost& cost) noexcept {
    const CurveState& state = best.state;
    const double k = state.at[0], surface = state.at[4];
    const double force = units_.force;
    // The motion and the residuals, in the order of time.
    const std::array<double*, 4> columns{memory_.column(0), memory_.column(1), memory_.column(2),
                                         memory_.column(3)};
    const std::size_t padded = CurveSamples::padded(firm_.count);
    for (std::size_t i = 0; i < padded; ++i) columns[0][i] = firm_.x[i] - surface;
    model_.kernels->logarithms(columns[0], columns[2], padded);
    double touching = 0.0, depth = 0.0, depth_squared = 0.0;
    for (std::size_t i = 0; i < padded; ++i) {
      const double x = columns[0][i], all = columns[2][i];
      const bool below = x > curves::shallowest;
      const double held = below ? x : 0.0, log = below ? all : 0.0;
      columns[0][i] = held;
      columns[1][i] = held * firm_.w[i];
      columns[2][i] = held * log;
      columns[3][i] = firm_.residual[i];
      touching += below ? 1.0 : 0.0;
      depth += log;
      depth_squared += log * log;
    }
    const double mean = depth / std::max(touching, 1.0);
    const double spread =
        std::sqrt(std::max(depth_squared / std::max(touching, 1.0) - mean * mean, 0.0));
    const CurveData& data = cost.data();
    const std::array<bool, 5> open = model_.open();
    const double fitted = static_cast<double>(std::count(open.begin(), open.end(), true));
    const double rounding = 1e-30 * data.force_squared;
    const double noise = model_.priors().noise_variance(state.sums.squares, rounding,
                                                        data.count() - fitted, state.variance);
    const double variance = std::max(noise, least_variance(data.force_squared, data.count()));
    const Information known(state.sums.information, model_.priors(), k, variance,
                            model_.surface_range());
    const InverseRoot<5> inverse = known.covariance_root();
    ProjectionSolution p{};
    static_cast<ScaledLaw&>(p) = {k, state.at[1], state.at[3] + prior_mean_, state.at[2], surface};
    p.root_variance = variance;
    p.root = inverse.root;
    say_identifiable(p, inverse.guarded, model_.priors(), spread);
    p.at_edge = model_.priors().at_edge(p.n);
    // Half of the step between two candidates of the recursion counts as the edge.
    const double margin = model_.surface_range() / 80.0;
    p.surface_found = !model_.finds_surface() || (surface >= model_.lowest_surface + margin &&
                                                  surface <= model_.highest_surface - margin);
    p.tare_refuted = tare_refuted_;
    const Matrix<5> widening =
        projection_widening(haar_levels(columns, firm_.count), known.prior_fractions(), p,
                            units_.log_penetration, true);
    const Matrix<5> root = multiply(p.root, widening);
    const HuntCrossley law = law_in_si(p, units_);
    fit.parameters = {law.K, law.B, law.n, p.offset * force, p.surface * units_.penetration};
    fit.covariance = covariance_in_si(root, law, units_);
    fit.noise = std::sqrt(noise) * force;
    fit.cost = best.cost * force * force;
    fit.taken = static_cast<std::uint64_t>(data.count());
    fit.flags = open_flags(p, root);
    fit.status = !best.settled                   ? CurveStatus::unsettled
                 : (fit.flags & surface_at_edge) ? CurveStatus::surface_at_edge
                                                 : CurveStatus::fitted;
    fit.offset_mean = prior_mean_ * force;
    fit.offset_deviation = model_.settings.offset_deviation * force;
    fit.prior_variance = state.variance * force * force;
  }

  void tell(std::uint8_t* roles, const CurveFit& fit) const noexcept {
    const auto code = [](CurveRole role) noexcept { return static_cast<std::uint8_t>(role); };
    std::fill_n(roles, curve_.count, code(CurveRole::absent));
    for (std::size_t i = 0; i < selection_.count(); ++i) {
      const Role role = selection_.at(i);
      roles[selection_.index(i)] = code(role == Role::free   ? CurveRole::free
                                        : role == Role::sure ? CurveRole::firm
                                                             : CurveRole::left_out);
    }
    if (!joined_ || fit.status == CurveStatus::no_contact) return;
    for (std::size_t i = 0; i < light_.count; ++i) {
      roles[static_cast<std::size_t>(light_index_[i])] = code(CurveRole::light);
    }
  }

  const CurveArrays& curve_;
  const CurveSettings& settings_;
  CurveMemory memory_;
  Units units_;
  CurveSelection selection_;
  CurveModel model_;
  CurveSamples firm_{};
  CurveSamples light_{};
  double* firm_index_ = nullptr;
  double* light_index_ = nullptr;
  double prior_mean_ = 0.0;
  bool of_air_ = true;
  bool tare_refuted_ = false;
  bool joined_ = false;
};

// The default range of surfaces, widened to all depths of the curve and as far again above them: in
// a recording without an approach the curvature of the force determines the surface. It ends an
// 80th of the range beyond the deepest sample, because within an 80th the surface counts as at the
// edge, and a tip may touch that late.
inline CurveSettings widened(CurveSettings settings, const CurveArrays& curve,
                             double unit) noexcept {
  constexpr double largest = 1e100;  // as suggested_scale
  double low = largest, high = -largest;
  for (std::size_t i = 0; i < curve.count; ++i) {
    const Sample s{curve.penetration[i], curve.velocity[i], curve.force[i]};
    if (!finite(s) || !(std::abs(s.penetration) < largest)) continue;
    low = std::min(low, s.penetration);
    high = std::max(high, s.penetration);
  }
  settings.lowest_surface = std::min(-0.2 * unit, low - (high - low));
  settings.highest_surface = std::max(0.2 * unit, high + (high - low) / 79.0);
  return settings;
}

}  // namespace detail

// `memory` holds curve_memory(curve.count) doubles; `roles`, if not null, a number per sample.
// Kernels of other instruction sets give the same bits. If the best surface is at an edge of the
// default range, the fit is repeated in a wider one.
inline CurveFit fit_curve(const CurveArrays& curve, const CurveSettings& settings, double* memory,
                          std::uint8_t* roles = nullptr,
                          const curves::CurveKernels& kernels = curves::kernels) noexcept {
  const CurveFit fit = detail::CurveFitter(curve, settings, memory, kernels)(roles);
  if (!(fit.flags & surface_at_edge) || settings.lowest_surface != settings.highest_surface) {
    return fit;
  }
  const CurveSettings wide = detail::widened(settings, curve, fit.scale.penetration);
  return detail::CurveFitter(curve, wide, memory, kernels)(roles);
}

}  // namespace palpate
