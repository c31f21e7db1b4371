// Cubic smoothing spline of recorded positions, and its slope at the samples.
//
// The spline minimises Σ (x_i − f(t_i))² + λ ∫ f″² dt. With γ its second derivatives at the inner
// samples, R and Q the tridiagonal matrices of Reinsch (Numerische Mathematik 10, 177, 1967; Green
// and Silverman 1994, section 2.3),
//
//   (R + λ QᵀQ) γ = Qᵀx,   f = x − λ Q γ,
//
// a pentadiagonal system, solved by one forward and one backward pass for any spacing. At both ends
// f″ = 0, which no motion satisfies: there the slope is that of the least-squares quartic through
// twice the window of the filter.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace palpate {

// The window of a parabola whose slope has the same noise, in samples, over (λ/h³)^¼: σ_v² is 12 σ²
// h/T³ for the parabola, and √2/16 σ² h/(λh)^¾ for the spline.
constexpr double spline_window = 5.1398;

// The penalties λ/h³, with h the usual step. Each is four times the one before: the frequency at
// half gain, (λh)^-¼, falls by √2.
struct SplineLadder {
  static constexpr std::size_t size = 10;
  static constexpr double first = 0.003, ratio = 4.0;

  static constexpr std::array<double, size> penalties() noexcept {
    std::array<double, size> all{};
    for (std::size_t k = 0; k < size; ++k) all[k] = k == 0 ? first : ratio * all[k - 1];
    return all;
  }
};

namespace detail {

// The splines of one segment of samples, for several penalties in parallel.
template <std::size_t Lanes>
class Splines {
 public:
  using Values = std::array<double, Lanes>;

  // Needs at least three samples. Time stamps nearer than a hundredth of the usual step count as
  // that far apart: they would ruin the condition of the system.
  Splines(const double* time, const double* position, std::size_t count, double step)
      : position_(position), count_(count), step_(count + 1, 1.0), rate_(count + 1, 0.0) {
    for (std::size_t k = 0; k + 1 < count; ++k) {
      step_[k] = std::max((time[k + 1] - time[k]) / step, 0.01);
      rate_[k] = 1.0 / step_[k];
    }
    first_.resize(count);
    second_.resize(count);
    curvature_.resize(count);
  }

  // Calls visit(k, slopes) from the last inner sample to the first; slopes are per usual step.
  template <class Visit>
  void slopes(const Values& penalty, const Visit& visit) noexcept {
    factorise(penalty);
    Values right{}, farther{};  // γ of the next two samples
    Values next{};              // f of the next sample
    for (std::size_t k = count_ - 1; k > 0; --k) {
      // `right` is γ at k, `farther` at k + 1.
      const Values left = k > 1 ? solve(k - 2, right, farther) : Values{};
      Values value, slope;
      for (std::size_t i = 0; i < Lanes; ++i) {
        const double bend =
            (left[i] - right[i]) * rate_[k - 1] + (farther[i] - right[i]) * rate_[k];
        value[i] = position_[k] - penalty[i] * bend;
        slope[i] = (next[i] - value[i]) * rate_[k] - step_[k] * (2.0 * right[i] + farther[i]) / 6.0;
      }
      if (k + 1 < count_) visit(k, slope);
      next = value;
      farther = right;
      right = left;
    }
  }

 private:
  // LDLᵀ of R + λ QᵀQ, and the forward pass: row i belongs to the sample i + 1.
  void factorise(const Values& penalty) noexcept {
    Values pivot{}, side{}, before{};  // of rows i − 1: d, u; of i − 2: c
    Values forth{}, earlier{}, a{}, b{}, b_earlier{};
    for (std::size_t i = 0; i + 2 < count_; ++i) {
      const double q0 = rate_[i], q2 = rate_[i + 1], q1 = -(q0 + q2), q3 = rate_[i + 2];
      const double size = (step_[i] + step_[i + 1]) / 3.0, bend = q0 * q0 + q1 * q1 + q2 * q2;
      const double near = step_[i + 1] / 6.0, turn = q1 * q2 - q2 * (q2 + q3), far = q2 * q3;
      const double rise =
          (position_[i + 2] - position_[i + 1]) * q2 - (position_[i + 1] - position_[i]) * q0;
      for (std::size_t l = 0; l < Lanes; ++l) {
        const double p = penalty[l];
        const double d = size + p * bend - side[l] * a[l] - before[l] * b_earlier[l];
        const double u = near + p * turn - b[l] * side[l];
        const double z = rise - a[l] * forth[l] - b_earlier[l] * earlier[l];
        const double inverse = 1.0 / d;
        before[l] = pivot[l];
        pivot[l] = p * far;
        side[l] = u;
        earlier[l] = forth[l];
        forth[l] = z;
        b_earlier[l] = b[l];
        a[l] = u * inverse;
        b[l] = pivot[l] * inverse;
        curvature_[i][l] = z * inverse;
      }
      first_[i] = a;
      second_[i] = b;
    }
  }

  Values solve(std::size_t i, const Values& next, const Values& farther) const noexcept {
    Values own;
    for (std::size_t l = 0; l < Lanes; ++l)
      own[l] = curvature_[i][l] - first_[i][l] * next[l] - second_[i][l] * farther[l];
    return own;
  }

  const double* position_;
  std::size_t count_;
  std::vector<double> step_, rate_;
  std::vector<Values> first_, second_, curvature_;  // of the factor, and D⁻¹L⁻¹Qᵀx
};

// Slopes, per usual step, at samples `from` to `to` of the least-squares quartic through all
// samples, by orthogonal polynomials (Forsythe, J. SIAM 5, 74, 1957).
inline void quartic_slopes(const double* time, const double* position, std::size_t count,
                           double step, std::size_t from, std::size_t to, double* slopes) {
  constexpr std::size_t degree = 4;
  const double middle = 0.5 * (time[0] + time[count - 1]);
  const double unit = 0.5 * (time[count - 1] - time[0]);
  std::vector<double> now(count, 1.0), last(count, 0.0), rising(count, 0.0), rose(count, 0.0);
  std::fill(slopes, slopes + (to - from), 0.0);
  double before = 1.0;
  for (std::size_t order = 0;; ++order) {
    double size = 0.0, share = 0.0, mean = 0.0;
    for (std::size_t k = 0; k < count; ++k) {
      size += now[k] * now[k];
      share += now[k] * (position[k] - position[0]);
      mean += now[k] * now[k] * (time[k] - middle) / unit;
    }
    if (!(size > 1e-12)) return;
    for (std::size_t k = from; k < to; ++k)
      slopes[k - from] += share / size * rising[k] * step / unit;
    if (order == degree) return;
    const double back = order > 0 ? size / before : 0.0;
    for (std::size_t k = 0; k < count; ++k) {
      const double away = (time[k] - middle) / unit - mean / size;
      const double next = away * now[k] - back * last[k];
      const double rate = now[k] + away * rising[k] - back * rose[k];
      last[k] = now[k];
      now[k] = next;
      rose[k] = rising[k];
      rising[k] = rate;
    }
    before = size;
  }
}

}  // namespace detail

// Adds, for each step of the ladder, Σ (v_k+1 − v_k)² to `changes` and Σ v_k+1² to `sizes`: the
// change of the velocities of a segment by the next penalty, and their size afterwards.
inline void add_spline_changes(const double* time, const double* position, std::size_t count,
                               double step, double* changes, double* sizes) {
  constexpr std::size_t most = 2048, edge = 32;  // samples in a piece; excluded at its ends
  const std::size_t pieces = std::max<std::size_t>(count / most, 1);
  for (std::size_t piece = 0; piece < pieces; ++piece) {
    const std::size_t start = piece * count / pieces, stop = (piece + 1) * count / pieces;
    const std::size_t length = stop - start, margin = std::min(edge, length / 4);
    constexpr std::size_t lanes = SplineLadder::size;
    std::array<double, lanes> change{}, size{};
    detail::Splines<lanes> splines(time + start, position + start, length, step);
    splines.slopes(SplineLadder::penalties(), [&](std::size_t k, const auto& slope) noexcept {
      if (k < margin || k + margin >= length) return;
      for (std::size_t l = 0; l + 1 < lanes; ++l) {
        const double by = slope[l + 1] - slope[l];
        change[l] += by * by;
        size[l] += slope[l + 1] * slope[l + 1];
      }
    });
    for (std::size_t l = 0; l + 1 < lanes; ++l) {
      changes[l] += change[l];
      sizes[l] += size[l];
    }
  }
}

// A position that was measured at every `beat`-th sample, from `first` on, and interpolated
// linearly between; 1 and 0 if it was not interpolated.
struct Knots {
  std::size_t beat = 1, first = 0;
};

// Finds the knots by second differences that are more than twice those of both neighbours together.
// With interpolation nearly all are at one phase of the beat; a smooth or a noisy position has few,
// at any phase.
inline Knots find_knots(const double* position, std::size_t count) {
  constexpr std::size_t longest = 16, fewest = 20;  // samples of a beat; knots
  const auto bend = [&](std::size_t k) noexcept {
    return std::abs((position[k + 1] - position[k]) - (position[k] - position[k - 1]));
  };
  double sum = 0.0;
  for (std::size_t k = 1; k + 1 < count; ++k) sum += bend(k);
  // A tenth of the mean second difference: between the knots of a long beat there is rounding.
  const double least = 0.1 * sum / static_cast<double>(count);
  std::vector<std::size_t> at;
  double last = 0.0, own = count > 2 ? bend(1) : 0.0;
  for (std::size_t k = 1; k + 2 < count; ++k) {
    const double next = bend(k + 1);
    if (own > std::max(2.0 * (last + next), least)) at.push_back(k);
    last = std::exchange(own, next);
  }
  for (std::size_t beat = longest; beat >= 2 && at.size() >= fewest; --beat) {
    if (4 * beat * at.size() < count) break;  // fewer than a quarter of the knots were found
    std::array<std::size_t, longest> phases{};
    for (const std::size_t k : at) ++phases[k % beat];
    const auto most = std::max_element(phases.begin(), phases.end());
    if (10 * *most > 9 * at.size()) {
      return {beat, static_cast<std::size_t>(most - phases.begin())};
    }
  }
  return {};
}

// Penalty, over h³, of the spline with the noise of the parabola through `window` samples.
inline double spline_penalty(double window) noexcept {
  const double part = window / spline_window;
  return part * part * part * part;
}

// Chooses, from those sums, the penalty between the two whose velocities differ least: more
// smoothing begins to distort the motion, less adds noise (quasi-optimality; Tikhonov and Glasko
// 1965, USSR Comp. Math. 5(3), 93). It does not need the level of the noise, white or not.
// `longest` [samples] is the window of the smoothest parabola allowed.
inline double choose_spline(const double* changes, const double* sizes, double longest) noexcept {
  constexpr std::size_t pairs = SplineLadder::size - 1;
  // The same ratio for noise with the spectrum ω^-2.6: the spectrum of a motion falls more steeply,
  // at least as ω^-4, that of white and of AR(1) noise less, at most as ω^-2.
  constexpr std::array<double, pairs> flat = {1,     4.703, 9.073, 10.15, 9.403,
                                              8.303, 7.252, 6.318, 5.501};
  // A change this many times the smallest is noise; by chance it is 1.2 times.
  constexpr double risen = 1.5;
  constexpr auto penalties = SplineLadder::penalties();
  std::size_t count = 1;
  while (count < pairs && penalties[count + 1] <= spline_penalty(longest)) ++count;
  const auto change = [&](std::size_t k) { return changes[k] / sizes[k] / flat[k]; };
  std::size_t best = count - 1;
  for (std::size_t k = count; k-- > 0;) {
    if (change(k) <= change(best))
      best = k;
    else if (change(k) > risen * change(best))
      break;
  }
  return std::sqrt(penalties[best] * penalties[best + 1]);
}

// Velocities at the samples, at least six, from the spline with a penalty λ/h³, h = `step` [s].
inline void spline_velocity(const double* time, const double* position, std::size_t count,
                            double step, double penalty, double* velocity) {
  penalty = std::min(penalty, spline_penalty(0.25 * static_cast<double>(count)));
  detail::Splines<1> spline(time, position, count, step);
  spline.slopes({penalty},
                [&](std::size_t k, const auto& slope) noexcept { velocity[k] = slope[0]; });
  // Beyond this distance the error of f″ = 0 is below a thirtieth of its value at the end.
  const double window = spline_window * std::sqrt(std::sqrt(penalty));
  const auto reach = static_cast<std::size_t>(std::ceil(window));
  const std::size_t ends = std::min(std::max<std::size_t>(reach, 3), count / 2);
  const std::size_t used = std::min(2 * ends, count), first = count - used;
  detail::quartic_slopes(time, position, used, step, 0, ends, velocity);
  detail::quartic_slopes(time + first, position + first, used, step, used - ends, used,
                         velocity + count - ends);
  // Before a motion that starts from exact rest the slope falls by a constant factor per sample,
  // far below the resolution of the positions, where each would be an outlier relative to those
  // before it.
  constexpr double resolved = 4.0 * std::numeric_limits<double>::epsilon();
  for (std::size_t k = 0; k < count; ++k) {
    const bool rests = std::abs(velocity[k]) < resolved * std::abs(position[k]);
    velocity[k] = rests ? 0.0 : velocity[k] / step;
  }
}

}  // namespace palpate
