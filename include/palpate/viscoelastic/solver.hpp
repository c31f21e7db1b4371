// Which law it is, and its parameters, worked out a little at every sample: rounds in which every
// candidate that is offered is fitted to all samples so far, and in between the chosen one alone.
//
// It stands apart from the fit of one Hunt–Crossley law (projection/projection_fit.hpp): columns of
// other powers and of branches that relax take products of all of them at pairs of exponents, kept
// for every candidate, where that law needs seven sums an exponent, and an update would cost as
// much more.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/sample.hpp"
#include "palpate/viscoelastic/problem.hpp"
#include "palpate/viscoelastic/samples.hpp"
#include "palpate/viscoelastic/search.hpp"
#include "palpate/viscoelastic/solution.hpp"

namespace palpate::viscoelastic {

template <class Sums>
class Solver {
 public:
  static constexpr std::size_t count = Sums::full ? candidates.size() : everyday_candidates;

  Solver(double sample_time, Offered offered, const Priors& priors) noexcept
      : samples_(sample_time), priors_(priors), offered_(offered) {
    if (!(priors.exponent > 0.0)) return;
    solution_.fit.n = priors.exponent;
    solution_.given = 1;
  }

  Samples<Sums>& samples() noexcept { return samples_; }
  const Samples<Sums>& samples() const noexcept { return samples_; }
  const Solution& solution() const noexcept { return solution_; }
  const Priors& priors() const noexcept { return priors_; }
  Priors& priors() noexcept { return priors_; }
  const Verdict<count>& verdict() const noexcept { return verdict_; }
  // Whether the solution is of a verdict on these samples, and not of those before they were
  // cleared.
  bool decided() const noexcept { return decided_; }

  double predict(const Sample& s) const noexcept {
    return force_of(solution_.fit, samples_.branches(), s);
  }
  double predict_after(const Sample& s, double dt) const noexcept {
    return force_after(solution_.fit, samples_.branches(), s, dt);
  }

  // Takes the sample that the branches were advanced to, and works a little.
  void take(const Sample& s, double predicted, double forgetting_factor) noexcept {
    const bool same = closest_.candidate == solution_.fit.candidate;
    const double by_closest = same ? predicted : force_of(closest_, samples_.branches(), s);
    samples_.take(s, forgetting_factor);
    noise_.add(s.penetration, s.force - by_closest, priors_.variance, forgetting_factor);
    if (taken_ < fewest_) ++taken_;
    ++samples_since_round_;
    ++samples_since_fit_;
    work();
  }

  // Forgets the samples and how the candidates stood by them; the answer stands until there are so
  // many again.
  [[gnu::noinline]] void clear(double fewest) noexcept {
    fewest_ = std::max(static_cast<std::uint32_t>(std::min(fewest, 1e9)), least_fewest);
    samples_.clear();
    noise_.clear();
    verdict_ = {};
    decided_ = false;
    stage_ = Stage::idle;
    taken_ = samples_since_round_ = samples_since_fit_ = 0;
    searched_weight_ = 0.0;
  }

  void offer(Offered offered) noexcept { offered_ = offered; }

  // What free air or a tare says of the offset, unless the contact has contradicted it.
  void know_offset(const detail::OffsetPrior& prior) noexcept {
    if (!offset_refuted_) priors_.air = prior;
  }
  bool offset_refuted() const noexcept { return offset_refuted_; }

  // A verdict and an answer by all samples so far, at once: everything that take() would spread.
  [[gnu::noinline]] void finish_pending() noexcept {
    if (!(samples_.weight() > 0.0)) return;
    fewest_ = least_fewest;
    stage_ = Stage::idle;
    // Twice: the first verdict gives the noise by which the priors of the second weigh.
    for (int round = 0; round < 2; ++round) {
      searched_weight_ = 0.0;
      do {
        work();
      } while (stage_ != Stage::idle);
    }
  }

 private:
  enum class Stage : std::uint8_t { idle, searching, judging, publishing, refining, republishing };

  // Fewer samples than three for each number of the widest law say nothing.
  static constexpr std::uint32_t least_fewest = 20;

  // Where the minimum of a candidate was found last.
  struct Answer {
    Place place{};
    double stiffness = 0.0;  // k there, by which the prior of its damping weighs
  };

  bool competes(std::size_t candidate) const noexcept {
    if (((offered_ >> candidate) & 1U) == 0) return false;
    // Where n is known, that it is 1 is no law of its own.
    if (candidates[candidate].linear && priors_.exponent > 0.0) return false;
    // A law of five numbers and more fits any hundred samples.
    if ((offered_ & forgetful) == 0 || samples_.weight() >= 100.0) return true;
    return candidates[candidate].memory == Memory::none;
  }
  Problem<Sums> problem(std::size_t candidate, const Priors& priors) const noexcept {
    return {samples_, candidates[candidate], priors, answers_[candidate].stiffness};
  }
  Problem<Sums> problem(std::size_t candidate) const noexcept {
    return problem(candidate, priors_);
  }
  Fitted as_fitted(std::size_t candidate, const Point& point) const noexcept {
    return {candidate, problem(candidate).exponent(point.place), point.place, point.linear.value};
  }

  // Not inlined, like what it calls: a replay would hold the searches a dozen times.
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
        if (searched(chosen_)) stage_ = Stage::republishing;
        break;
      case Stage::publishing:
      case Stage::republishing:
        publish();
        break;
    }
  }

  // A step of the search; true when it is done.
  bool searched(std::size_t candidate) noexcept {
    if (!search_.advance(problem(candidate))) return false;
    answers_[candidate] = {search_.place(), std::max(search_.spring(), 0.0)};
    found_ = static_cast<Offered>(found_ | (1U << candidate));
    return true;
  }

  void start() noexcept {
    const double weight = samples_.weight();
    if (taken_ < fewest_) return;
    // A verdict after an eighth of the samples more; of the law itself the parameters after a 32nd,
    // which moves them by a sixth of a standard error (1/√32).
    const auto more = [weight](std::uint32_t samples, double fraction) noexcept {
      return static_cast<double>(samples) >= std::max(8.0, weight * fraction);
    };
    if (solution_.known == 0 || more(samples_since_round_, 1.0 / 8.0) || searched_weight_ == 0.0) {
      samples_since_round_ = 0;
      widely_ = !(weight < 1.5 * searched_weight_);
      if (widely_) searched_weight_ = weight;
      next_ = 0;
      stage_ = Stage::searching;
      begin_next();
    } else if (more(samples_since_fit_, 1.0 / 32.0)) {
      search_.begin_near(answers_[chosen_].place);
      stage_ = Stage::refining;
    }
  }

  void begin_next() noexcept {
    while (next_ < count && !competes(next_)) ++next_;
    if (next_ == count) {
      stage_ = Stage::judging;
    } else if (widely_ || ((found_ >> next_) & 1U) == 0) {
      search_.begin();
    } else {
      search_.begin_near(answers_[next_].place);
    }
  }

  // All candidates by the same samples.
  [[gnu::noinline]] void judge() noexcept {
    const double weight = samples_.weight(), square = samples_.force_squared();
    // Forces are no better than 1e-6 of them, and the sums hold no more.
    const double least = 1e-12 * square + 1e-300;
    verdict_.mean_square = {};
    Point point;  // of the closest
    for (std::size_t i = 0; i < count; ++i) {
      if (!competes(i)) continue;
      const Point found = problem(i).at(answers_[i].place);
      verdict_.mean_square[i] = std::max(square + found.cost, least) / weight;
      if (verdict_.closest() == i) point = found;
    }
    const std::size_t closest = verdict_.closest();
    if (closest == count) {
      stage_ = Stage::idle;
      return;
    }
    measure_noise(closest, weight);
    closest_ = as_fitted(closest, point);
    doubt_offset(closest, point);
    chosen_ = static_cast<std::uint8_t>(verdict_.chosen());
    stage_ = Stage::publishing;
  }

  // By what the candidate leaves that leaves least.
  void measure_noise(std::size_t closest, double weight) noexcept {
    const double mean_square = verdict_.mean_square[closest];
    priors_.variance =
        mean_square * weight / std::max(weight - candidates[closest].parameters(), 1.0);
    const double before = verdict_.mean_square[closest_.candidate];
    if (closest != closest_.candidate && before > 0.0) noise_.succeed(mean_square / before);
    noise_.measure(mean_square);
    verdict_.effective = std::max(weight / noise_.inflation(), 3.0);
  }

  // The prior of F₀ is dropped where the samples of the contact alone are five deviations from it:
  // a wrong tare, or a surface that is off, which looks like an offset, would bend the law.
  [[gnu::noinline]] void doubt_offset(std::size_t closest, const Point& point) noexcept {
    if (priors_.offset == 0 || !(priors_.air.deviation > 0.0)) return;
    // Of an approach alone all laws are alike: at some 25 samples 11 of 160 right ones were
    // dropped.
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

  // σ² by what a fit leaves. Few samples fit exactly: two more, with an error of 1 % of the rms
  // force, keep their error bars from vanishing.
  double variance_of(const Point& fit, double freedom) const noexcept {
    constexpr double fewest_degrees = 10.0;
    const double square = samples_.force_squared(), each = square / samples_.weight();
    const double residual = std::max(square + fit.cost, 0.0);
    if (freedom >= fewest_degrees) return std::max(residual / freedom, 1e-12 * each);
    return (residual + 2e-4 * each) / (std::max(freedom, 0.0) + 2.0);
  }

  [[gnu::noinline]] void publish() noexcept {
    const Problem<Sums> problem = this->problem(chosen_);
    // By the samples of now: since it was found others have come.
    const Place& place = answers_[chosen_].place;
    const Normal normal = problem.normal(place);
    const Point answer = problem.at(place, normal);
    const double variance = variance_of(answer, samples_.weight() - problem.law.parameters());
    // What the search saw last is of this candidate, if it was this one's.
    const bool refined = stage_ == Stage::republishing;
    const Matrix<unknowns> covariance =
        covariance_of(problem, answer, normal, variance, refined ? search_.curvature() : Place{});
    // Between the rungs one time is interpolated: without this, 80 to 82 % of 100 bars of K′ held
    // the truth at 40 dB.
    const double between = problem.law.memory == Memory::single ? 1.3 * 1.3 : 1.0;
    solution_.fit = as_fitted(chosen_, answer);
    const double wider = between * noise_.widening();
    for (std::size_t i = 0; i < unknowns; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        solution_.covariance[in_triangle(i, j)] = wider * covariance[i][j];
      }
    }
    constexpr double margin = 0.25, last = static_cast<double>(Grid::exponents - 1);
    const bool outside = place.exponent < margin || place.exponent > last - margin;
    solution_.at_edge = problem.searches_exponent() && outside ? 1 : 0;
    solution_.known = 1;
    decided_ = true;
    samples_since_fit_ = 0;
    stage_ = Stage::idle;
  }

  Samples<Sums> samples_;
  Priors priors_;
  Offered offered_;
  Offered found_ = 0;  // which have an answer
  std::array<Answer, count> answers_{};
  Verdict<count> verdict_;
  Search<Sums> search_;
  Solution solution_;
  Fitted closest_;       // of the candidate with the least residual at the last verdict
  ResidualNoise noise_;  // of its a-priori errors
  double searched_weight_ = 0.0;
  // How many were taken since they were forgotten, up to the fewest that an answer needs.
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
};

}  // namespace palpate::viscoelastic
