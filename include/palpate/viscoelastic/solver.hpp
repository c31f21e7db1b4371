// Selects the contact model and fits its parameters, with a little work at every sample. In a
// round, every competing candidate is fitted to all samples so far; between rounds only the
// selected one is refitted.
//
// This solver is separate from the fit of one Hunt–Crossley law (projection/projection_fit.hpp),
// which needs seven sums per exponent; the branches need all their products.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/sample.hpp"
#include "palpate/viscoelastic/problem.hpp"
#include "palpate/viscoelastic/samples.hpp"
#include "palpate/viscoelastic/search.hpp"
#include "palpate/viscoelastic/solution.hpp"

namespace palpate::viscoelastic {

// The result of fitting one candidate with the requested parts excluded.
struct Beside {
  Fitted fit;
  double mean_square;  // RSS/N
};

class Solver {
 public:
  static constexpr std::size_t count = candidates.size();

  Solver(double sample_time, double longest_time, Offered offered, const Priors& priors) noexcept
      : samples_(sample_time, longest_time), priors_(priors), offered_(offered) {
    if (!(priors.exponent > 0.0)) return;
    solution_.fit.n = priors.exponent;
    solution_.given = 1;
  }

  Samples& samples() noexcept { return samples_; }
  const Samples& samples() const noexcept { return samples_; }
  const Solution& solution() const noexcept { return solution_; }
  const Priors& priors() const noexcept { return priors_; }
  Priors& priors() noexcept { return priors_; }
  const Verdict& verdict() const noexcept { return verdict_; }
  // Whether the solution comes from a verdict on these samples, and not on samples that were
  // cleared since.
  bool decided() const noexcept { return decided_; }
  bool renewed() const noexcept { return samples_since_fit_ == 0; }

  double predict(const Sample& s) const noexcept {
    return force_of(solution_.fit, samples_.branches(), s);
  }
  double predict_after(const Sample& s, double dt) const noexcept {
    return force_after(solution_.fit, samples_.branches(), s, dt);
  }

  // Adds the sample that the branches were advanced to, and does one step of the work.
  void take(const Sample& s, double predicted, double forgetting_factor) noexcept {
    const bool same = closest_.candidate == solution_.fit.candidate;
    const double by_closest = same ? predicted : force_of(closest_, samples_.branches(), s);
    samples_.take(s, forgetting_factor);
    // Before the first verdict no law was fitted to these samples: the error would be the whole
    // force.
    if (decided_) {
      noise_.add(s.penetration, s.force - by_closest, priors_.variance, forgetting_factor);
    }
    if (taken_ < fewest_) ++taken_;
    ++samples_since_round_;
    ++samples_since_fit_;
    work();
  }

  // Forgets the samples and the ranking of the candidates. The solution remains until `fewest` new
  // samples have been taken.
  [[gnu::noinline]] void clear(double fewest) noexcept {
    fewest_ = std::max(static_cast<std::uint32_t>(std::min(fewest, 1e9)), least_fewest);
    samples_.clear();
    noise_.clear();
    verdict_ = {};
    decided_ = false;
    stage_ = Stage::idle;
    taken_ = samples_since_round_ = samples_since_fit_ = 0;
    searched_weight_ = remembered_weight_ = 0.0;
    found_ = 0;
  }

  // Sets the offset prior from free air or a tare, unless the contact has contradicted it.
  void know_offset(const detail::OffsetPrior& prior) noexcept {
    if (!offset_refuted_) priors_.air = prior;
  }
  bool offset_refuted() const noexcept { return offset_refuted_; }

  // Computes the verdict and the solution from all samples so far, in one call: all the work that
  // take() would spread over samples.
  [[gnu::noinline]] void finish_pending() noexcept {
    if (!(samples_.weight() > 0.0)) return;
    fewest_ = least_fewest;
    finishing_ = true;
    stage_ = Stage::idle;
    // Two rounds: the first verdict gives the noise variance that weights the priors of the second.
    for (int round = 0; round < 2; ++round) {
      searched_weight_ = 0.0;
      do {
        work();
      } while (stage_ != Stage::idle);
    }
    finishing_ = false;
  }

  // Whether a restored state names candidates, steps and branches that exist.
  bool sound() const noexcept {
    const bool known =
        priors_.exponent == 0.0 ||
        detail::lies_in(priors_.exponent, Grid::lowest_exponent, Grid::highest_exponent);
    return known && solution_.fit.candidate < count && closest_.candidate < count &&
           chosen_ < count && next_ <= count && stage_ <= Stage::refining &&
           samples_.ladder().open() <= rungs && noise_.sound();
  }

  // Fits one candidate to all samples so far, with some of its parts excluded, or with damping of
  // any sign. The solver does not change.
  Beside beside(std::size_t candidate, PartSet left_out, bool free_damping) const noexcept {
    Problem own = problem(candidate);
    own.left_out = left_out;
    own.free_damping = free_damping;
    Search search;
    const Answer& last = answers_[candidate];
    const auto near = static_cast<PartSet>(last.near);
    ((found_ >> candidate) & 1U) != 0 ? search.begin_near(last.place, near) : search.begin(near);
    while (!search.advance(own)) continue;
    const Point found = own.at(search.place(), search.near());
    return {as_fitted(candidate, found), mean_square_of(found)};
  }

 private:
  enum class Stage : std::uint8_t { idle, searching, judging, publishing, refining };

  // The minimum number of samples: three for each parameter of the largest law, as parameters_of
  // counts.
  static constexpr std::uint32_t least_fewest = 20;

  // The last minimum of a candidate.
  struct Answer {
    double place = 0.0;
    double stiffness = 0.0;  // k + Σ mᵢ there, which sets the weight of the damping prior
    double curvature = 0.0;  // second derivative of J, per node squared
    std::uint64_t near = 0;  // the parts that are above 0
  };

  bool competes(std::size_t candidate) const noexcept {
    if (((offered_ >> candidate) & 1U) == 0) return false;
    // If n is known, the candidate that fixes n at 1 is not a separate law.
    if (candidates[candidate].linear && priors_.exponent > 0.0) return false;
    // A spectrum needs a hundred samples. Once the recording has ended, twenty are enough, because
    // a short recording may come from such a law.
    const double fewest = finishing_ ? 20.0 : 100.0;
    return (offered_ & forgetful) == 0 || samples_.weight() >= fewest ||
           !candidates[candidate].remembers();
  }
  // Whether this round searches the candidate again instead of evaluating it at its last minimum.
  bool due(std::size_t candidate) const noexcept {
    return remembering_ || !candidates[candidate].remembers() || ((found_ >> candidate) & 1U) == 0;
  }
  Problem problem(std::size_t candidate, const Priors& priors) const noexcept {
    return {samples_, candidates[candidate], priors, answers_[candidate].stiffness};
  }
  Problem problem(std::size_t candidate) const noexcept { return problem(candidate, priors_); }
  Point fitted(std::size_t candidate) const noexcept {
    const Answer& answer = answers_[candidate];
    return problem(candidate).at(answer.place, static_cast<PartSet>(answer.near));
  }
  Fitted as_fitted(std::size_t candidate, const Point& point) const noexcept {
    return {candidate, problem(candidate).exponent(point.place), point.linear.value};
  }
  // The relative error of a force sensor is at least 1e-6, and the sums resolve no less.
  double mean_square_of(const Point& point) const noexcept {
    const double square = samples_.force_squared();
    return std::max(square + point.cost, 1e-12 * square + 1e-300) / samples_.weight();
  }
  // The number of fitted parameters: F₀ and n, with the parts above 0. Neighbouring relaxation
  // times are nearly collinear, so one of them counts as less than a parameter. Counted as a
  // quarter, a law with memory was selected in 98 % of 360 contacts that relax and in none of 504
  // that do not; counted as one, in 91 %.
  double parameters_of(std::size_t candidate, PartSet fitted) const noexcept {
    const Candidate& law = candidates[candidate];
    const PartSet own = (fitted & ~all_memory) | bit(offset) | bit(stiffness) |
                        (law.damping == Damping::none || law.remembers() ? 0 : bit(damping));
    return static_cast<double>(std::popcount(own)) + (law.linear ? 0.0 : 1.0) +
           0.25 * static_cast<double>(std::popcount(fitted & all_memory));
  }

  // Not inlined, like the functions it calls: a replay would contain the searches a dozen times.
  [[gnu::noinline]] void work() noexcept {
    switch (stage_) {
      case Stage::idle:
        start();
        break;
      case Stage::searching:
        if (!searched(next_)) break;
        ++next_;
        begin_next();
        break;
      case Stage::judging:
        judge();
        break;
      case Stage::refining:
        if (searched(chosen_)) stage_ = Stage::publishing;
        break;
      case Stage::publishing:
        publish();
        break;
    }
  }

  // One step of the search; true when it has converged.
  bool searched(std::size_t candidate) noexcept {
    if (!search_.advance(problem(candidate))) return false;
    answers_[candidate] = {search_.place(), std::max(search_.spring(), 0.0), search_.curvature(),
                           search_.near()};
    found_ = static_cast<Offered>(found_ | (1U << candidate));
    return true;
  }

  void start() noexcept {
    const double weight = samples_.weight();
    if (taken_ < fewest_) return;
    // A verdict follows when the samples have grown by an eighth. The parameters of the selected
    // law follow after a 32nd, which changes them by a sixth of a standard error (1/√32), or with
    // memory after a 16th.
    const auto more = [weight](std::uint32_t samples, double fraction) noexcept {
      return static_cast<double>(samples) >= std::max(8.0, weight * fraction);
    };
    if (solution_.known == 0 || more(samples_since_round_, 1.0 / 8.0) || searched_weight_ == 0.0) {
      samples_since_round_ = 0;
      widely_ = !(weight < 1.5 * searched_weight_);
      if (widely_) searched_weight_ = weight;
      // Laws with memory cost ten times as much, so they are searched only after a growth by a
      // quarter.
      remembering_ = !(weight < 1.25 * remembered_weight_) || finishing_;
      if (remembering_) remembered_weight_ = weight;
      next_ = 0;
      stage_ = Stage::searching;
      begin_next();
    } else if (more(samples_since_fit_,
                    candidates[chosen_].remembers() ? 1.0 / 16.0 : 1.0 / 32.0)) {
      begin_near(chosen_);
      stage_ = Stage::refining;
    }
  }

  void begin_next() noexcept {
    while (next_ < count && !(competes(next_) && due(next_))) ++next_;
    const bool known = next_ < count && ((found_ >> next_) & 1U) != 0;
    if (next_ == count) {
      stage_ = Stage::judging;
    } else if (!known || (widely_ && !candidates[next_].remembers())) {
      search_.begin(static_cast<PartSet>(answers_[next_].near));
    } else {
      begin_near(next_);
    }
  }

  void begin_near(std::size_t candidate) noexcept {
    const Answer& answer = answers_[candidate];
    search_.begin_near(answer.place, static_cast<PartSet>(answer.near));
  }

  // Evaluates all candidates on the same samples, one per call.
  [[gnu::noinline]] void judge() noexcept {
    if (next_ == count) {
      verdict_.mean_square = {};
      next_ = 0;
    }
    while (next_ < count && !competes(next_)) ++next_;
    if (next_ < count) {
      const Point found = fitted(next_);
      verdict_.mean_square[next_] = mean_square_of(found);
      verdict_.parameters[next_] = parameters_of(next_, found.linear.fitted);
      answers_[next_].near = found.linear.fitted;
      ++next_;
      while (next_ < count && !competes(next_)) ++next_;
      if (next_ < count) return;
    }
    decide();
  }

  void decide() noexcept {
    const std::size_t closest = verdict_.closest();
    if (closest == count) {
      stage_ = Stage::idle;
      return;
    }
    const Point point = fitted(closest);
    measure_noise(closest);
    closest_ = as_fitted(closest, point);
    doubt_offset(closest, point);
    const bool one_way = std::abs(samples_.motion().one_way) > one_way_limit;
    chosen_ = static_cast<std::uint8_t>(verdict_.chosen(one_way));
    stage_ = Stage::publishing;
  }

  // Measures the noise from the residual of the candidate that fits best.
  void measure_noise(std::size_t closest) noexcept {
    const double mean_square = verdict_.mean_square[closest], weight = samples_.weight();
    priors_.variance = mean_square * weight / std::max(weight - verdict_.parameters[closest], 1.0);
    const double before = verdict_.mean_square[closest_.candidate];
    if (closest != closest_.candidate && before > 0.0) noise_.succeed(mean_square / before);
    noise_.measure(mean_square);
    verdict_.effective = std::max(weight / noise_.inflation(), 3.0);
  }

  // Drops the prior of F₀ if the samples in contact alone contradict it by five standard
  // deviations: a wrong tare, or a wrong surface position, which looks like an offset, would
  // distort the law.
  [[gnu::noinline]] void doubt_offset(std::size_t closest, const Point& point) noexcept {
    if (priors_.offset == 0 || !(priors_.air.deviation > 0.0)) return;
    // On an approach alone the laws are nearly equivalent: at about 25 samples, 11 of 160 correct
    // priors were dropped.
    if (samples_.weight() < 50.0) return;
    Priors open = priors_;
    open.air = {0.0, 0.0};
    const Normal normal = problem(closest, open).normal(point.place);
    const Factored factored(normal, point.linear.fitted);
    const double variance =
        priors_.variance * noise_.widening() * factored.inverse()[offset][offset];
    const double away = factored.solve(normal.b).value[offset] - priors_.air.mean;
    const double deviation = detail::combined(std::sqrt(variance), priors_.air.deviation);
    constexpr double largest = 5.0;
    if (!(std::abs(away) > largest * deviation)) return;
    priors_.air = {0.0, 0.0};
    offset_refuted_ = true;
  }

  // σ² from the residual of a fit. A fit to few samples is exact: two additional samples with an
  // error of 1 % of the rms force keep the error bars from vanishing.
  double variance_of(const Point& fit, double freedom) const noexcept {
    constexpr double fewest_degrees = 10.0;
    const double square = samples_.force_squared(), each = square / samples_.weight();
    const double residual = std::max(square + fit.cost, 0.0);
    if (freedom >= fewest_degrees) return std::max(residual / freedom, 1e-12 * each);
    return (residual + 2e-4 * each) / (std::max(freedom, 0.0) + 2.0);
  }

  [[gnu::noinline]] void publish() noexcept {
    const Problem problem = this->problem(chosen_);
    // Refits to the samples of now, because new ones have arrived since the minimum was found.
    const Point answer = fitted(chosen_);
    const double parameters = parameters_of(chosen_, answer.linear.fitted);
    const double variance = variance_of(answer, samples_.weight() - parameters);
    const Matrix<unknowns> covariance =
        covariance_of(problem, answer, variance, answers_[chosen_].curvature);
    solution_.fit = as_fitted(chosen_, answer);
    const double wider = noise_.widening();
    for (std::size_t i = 0; i < unknowns; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        solution_.covariance[in_triangle(i, j)] = wider * covariance[i][j];
      }
    }
    constexpr double margin = 0.25, last = static_cast<double>(Grid::exponents - 1);
    const bool outside = answer.place < margin || answer.place > last - margin;
    solution_.at_edge = problem.searches_exponent() && outside ? 1 : 0;
    solution_.known = 1;
    decided_ = true;
    samples_since_fit_ = 0;
    stage_ = Stage::idle;
  }

  Samples samples_;
  Priors priors_;
  Offered offered_;
  Offered found_ = 0;  // candidates that have a last minimum
  std::array<Answer, count> answers_{};
  Verdict verdict_;
  Search search_;
  Solution solution_;
  Fitted closest_;       // of the candidate with the least residual at the last verdict
  ResidualNoise noise_;  // noise of the one-step prediction errors of `closest_`
  double searched_weight_ = 0.0;
  double remembered_weight_ = 0.0;
  // Samples taken since the last clear, counted up to the number that a solution needs.
  std::uint32_t taken_ = 0;
  std::uint32_t fewest_ = least_fewest;
  std::uint32_t samples_since_round_ = 0;
  std::uint32_t samples_since_fit_ = 0;
  std::uint8_t chosen_ = 1;
  std::uint8_t next_ = 0;
  Stage stage_ = Stage::idle;
  bool widely_ = true;
  bool offset_refuted_ = false;
  bool decided_ = false;
  bool finishing_ = false;
  bool remembering_ = true;
};

}  // namespace palpate::viscoelastic
