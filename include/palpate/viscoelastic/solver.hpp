// Which law it is, and its parameters, worked out a little at every sample: rounds in which every
// candidate that is offered is fitted to all samples so far, and in between the chosen one alone.
//
// The least N_eff ln(RSS/N) + 2 p ln N_eff wins: Schwarz's criterion with twice the penalty, and as
// many samples as noise of the residual's correlation leaves (docs/viscoelastic.md).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/matrix.hpp"
#include "palpate/sample.hpp"
#include "palpate/viscoelastic/law.hpp"
#include "palpate/viscoelastic/prediction.hpp"
#include "palpate/viscoelastic/residual_noise.hpp"
#include "palpate/viscoelastic/samples.hpp"
#include "palpate/viscoelastic/search.hpp"
#include "palpate/viscoelastic/solution.hpp"

namespace palpate::viscoelastic {

// How one candidate stood at the last verdict.
struct Standing {
  double score;        // of the criterion; 0 for what was not offered
  double mean_square;  // RSS/N, in units of force squared
};

template <class Sums>
class Solver {
 public:
  using Times = typename Sums::Times;
  static constexpr std::size_t count = Sums::full ? candidates.size() : everyday_candidates;

  Solver(double sample_time, Offered offered, const Priors& priors) noexcept
      : samples_(sample_time), offered_(offered), priors_(priors) {
    if (!(priors.exponent > 0.0)) return;
    solution_.n = priors.exponent;
    solution_.given = 1;
  }

  Samples<Sums>& samples() noexcept { return samples_; }
  const Samples<Sums>& samples() const noexcept { return samples_; }
  const Solution& solution() const noexcept { return solution_; }
  const Priors& priors() const noexcept { return priors_; }
  Priors& priors() noexcept { return priors_; }
  const std::array<Standing, count>& standings() const noexcept { return standings_; }
  double effective_samples() const noexcept { return effective_; }
  // Whether the solution is of a verdict on these samples, and not of those before they were
  // cleared.
  bool decided() const noexcept { return decided_; }

  double predict(const Sample& s) const noexcept { return chosen_.force(samples_.branches(), s); }
  double predict_after(const Sample& s, double dt) const noexcept {
    return chosen_.force_after(samples_.branches(), s, dt);
  }

  // Takes the sample that the branches were advanced to, and works a little.
  void take(const Sample& s, double predicted, double forgetting_factor) noexcept {
    const double by_best =
        best_ == solution_.candidate ? predicted : best_fit_.force(samples_.branches(), s);
    samples_.take(s, forgetting_factor);
    noise_.add(s.penetration, s.force - by_best, priors_.variance, forgetting_factor);
    taken_ += 1.0;
    samples_since_round_ += 1.0;
    samples_since_fit_ += 1.0;
    work();
  }

  // Forgets the samples and how the candidates stood by them; the answer stands until there are so
  // many again.
  [[gnu::noinline]] void clear(double fewest) noexcept {
    fewest_ = std::max(fewest, least_fewest);
    samples_.clear();
    noise_.clear();
    standings_ = {};
    effective_ = 0.0;
    decided_ = false;
    stage_ = Stage::idle;
    taken_ = samples_since_round_ = samples_since_fit_ = 0.0;
    searched_weight_ = 0.0;
  }

  void offer(Offered offered) noexcept { offered_ = offered; }

  // What free air or a tare says of the offset, unless the contact has contradicted it.
  void know_offset(const detail::OffsetPrior& prior) noexcept {
    if (!offset_refuted_) priors_.air = prior;
  }
  bool offset_refuted() const noexcept { return offset_refuted_; }

  // A verdict and an answer by all samples so far, at once: everything that take() would spread.
  [[gnu::noinline]] void settle() noexcept {
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
  enum class Stage : std::uint8_t { idle, searching, judging, refining, publishing };

  // Fewer samples than three for each number of the widest law say nothing.
  static constexpr double least_fewest = 20.0;

  bool offers(std::size_t candidate) const noexcept {
    return ((offered_ >> candidate) & 1U) != 0 && candidate < count;
  }

  // A law of five numbers and more fits any hundred samples.
  bool competes(std::size_t candidate) const noexcept {
    constexpr Offered forgetful = 0b111;
    if (!offers(candidate)) return false;
    // Where n is known, that it is 1 is no law of its own.
    if (candidates[candidate].linear && priors_.exponent > 0.0) return false;
    if ((offered_ & forgetful) == 0 || samples_.weight() >= 100.0) return true;
    return candidates[candidate].memory == Memory::none;
  }

  // Not inlined, like what it calls: a replay would hold the searches a dozen times.
  [[gnu::noinline]] void work() noexcept {
    switch (stage_) {
      case Stage::idle:
        start();
        break;
      case Stage::searching:
        if (search_.advance(samples_)) keep_found();
        break;
      case Stage::judging:
        judge();
        break;
      case Stage::refining:
        if (search_.advance(samples_)) {
          keep(chosen_candidate_, search_.best());
          stage_ = Stage::publishing;
        }
        break;
      case Stage::publishing:
        publish();
        break;
    }
  }

  void start() noexcept {
    const double weight = samples_.weight();
    if (taken_ < fewest_) return;
    // A verdict after an eighth of the samples more; of the law itself the parameters after a 32nd,
    // which moves them by a sixth of a standard error (1/√32).
    if (solution_.known == 0 || samples_since_round_ >= std::max(8.0, weight / 8.0) ||
        searched_weight_ == 0.0) {
      samples_since_round_ = 0.0;
      widely_ = !(weight < 1.5 * searched_weight_);
      if (widely_) searched_weight_ = weight;
      next_ = 0;
      stage_ = Stage::searching;
      begin_next();
    } else if (samples_since_fit_ >= std::max(8.0, weight / 32.0)) {
      const Answer& last = answers_[chosen_candidate_];
      search_.begin_near(candidates[chosen_candidate_], priors_, last.place, last.stiffness);
      stage_ = Stage::refining;
    }
  }

  // Of a candidate: where its minimum is, and k there, by which the prior of its damping weighs.
  struct Answer {
    Place place{};
    double stiffness = 0.0;
    std::uint64_t found = 0;  // 0 before the first
  };

  void keep(std::size_t candidate, const Point& found) noexcept {
    answers_[candidate] = {found.place, std::max(found.linear.value[stiffness], 0.0), 1};
  }

  // By the samples of now.
  Point fitted(std::size_t candidate) const noexcept {
    const Answer& answer = answers_[candidate];
    return point_at(samples_, candidates[candidate], priors_, answer.place, answer.stiffness);
  }

  void begin_next() noexcept {
    while (next_ < count && !competes(next_)) ++next_;
    if (next_ == count) {
      stage_ = Stage::judging;
      return;
    }
    const Answer& last = answers_[next_];
    if (widely_ || last.found == 0) {
      search_.begin(candidates[next_], priors_, last.stiffness);
    } else {
      search_.begin_near(candidates[next_], priors_, last.place, last.stiffness);
    }
  }

  void keep_found() noexcept {
    keep(next_, search_.best());
    ++next_;
    begin_next();
  }

  // All candidates by the same samples.
  [[gnu::noinline]] void judge() noexcept {
    const double weight = samples_.weight(), square = samples_.force_squared();
    // Forces are no better than 1e-6 of them, and the sums hold no more.
    const double least = 1e-12 * square + 1e-300;
    std::size_t best = count;
    double least_square = 0.0;
    standings_ = {};
    for (std::size_t i = 0; i < count; ++i) {
      if (!competes(i)) continue;
      const double residual = std::max(square + fitted(i).cost, least);
      standings_[i].mean_square = residual / weight;
      if (best == count || residual < least_square) {
        best = i;
        least_square = residual;
      }
    }
    if (best == count) {
      stage_ = Stage::idle;
      return;
    }
    priors_.variance = least_square / std::max(weight - candidates[best].parameters(), 1.0);
    // What another law left says nothing of the noise, if it left a tenth more than this one.
    if (best != best_ && !(standings_[best_].mean_square < 1.1 * standings_[best].mean_square)) {
      noise_.clear();
    }
    noise_.measure(least_square / weight);
    effective_ = std::max(weight / noise_.inflation(), 3.0);
    std::size_t chosen = best;
    for (std::size_t i = 0; i < count; ++i) {
      if (!competes(i)) continue;
      standings_[i].score = effective_ * std::log(standings_[i].mean_square / priors_.variance) +
                            2.0 * candidates[i].parameters() * std::log(effective_);
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (competes(i) && standings_[i].score < standings_[chosen].score) chosen = i;
    }
    best_ = best;
    const Point best_point = fitted(best);
    best_fit_ = prediction_of(best, best_point);
    doubt_offset(best, best_point);
    chosen_candidate_ = chosen;
    stage_ = Stage::publishing;
  }

  // The prior of F₀ is dropped where the samples of the contact alone are five deviations from it:
  // a wrong tare, or a surface that is off, which looks like an offset, would bend the law.
  [[gnu::noinline]] void doubt_offset(std::size_t best, const Point& point) noexcept {
    if (priors_.offset == 0 || !(priors_.air.deviation > 0.0)) return;
    Priors open = priors_;
    open.air = {0.0, 0.0};
    const Normal normal =
        normal_with_priors(samples_, candidates[best], open, point.place, answers_[best].stiffness);
    const Factored factored(normal, point.linear.fitted);
    const double variance =
        priors_.variance * noise_.widening() * factored.inverse()[offset][offset];
    const double away = factored.solve(normal.b).value[offset] - priors_.air.mean;
    const double deviation = std::hypot(std::sqrt(variance), priors_.air.deviation);
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

  Prediction<Times> prediction_of(std::size_t candidate, const Point& point) const noexcept {
    const Candidate& law = candidates[candidate];
    return {candidate, exponent_at(law, priors_, point.place.exponent),
            second_of(law.memory, point.place.second), point.linear.value};
  }

  [[gnu::noinline]] void publish() noexcept {
    const std::size_t chosen = chosen_candidate_;
    const Candidate& law = candidates[chosen];
    // By the samples of now: since it was found others have come.
    const Point answer = fitted(chosen);
    Solution& s = solution_;
    s.candidate = chosen;
    s.weight = samples_.weight();
    s.variance = variance_of(answer, s.weight - law.parameters());
    s.n = exponent_at(law, priors_, answer.place.exponent);
    s.place = answer.place;
    s.value = answer.linear.value;
    const Curvature<Sums> curvature(samples_, law, priors_, answer, answers_[chosen].stiffness,
                                    s.variance);
    s.covariance = curvature.covariance();
    // Between the rungs one time is interpolated: without this, 80 to 82 % of 100 bars of K′ held
    // the truth at 40 dB.
    const double between = law.memory == Memory::single ? 1.3 * 1.3 : 1.0;
    for (auto& row : s.covariance) {
      for (double& entry : row) entry *= between * noise_.widening();
    }
    constexpr double margin = 0.25, last = static_cast<double>(Grid::exponents - 1);
    const bool outside = s.place.exponent < margin || s.place.exponent > last - margin;
    s.at_edge = !law.linear && !(priors_.exponent > 0.0) && outside ? 1 : 0;
    s.known = 1;
    decided_ = true;
    chosen_ = prediction_of(chosen, answer);
    samples_since_fit_ = 0.0;
    stage_ = Stage::idle;
  }

  Samples<Sums> samples_;
  Offered offered_;
  Priors priors_;
  std::array<Answer, count> answers_{};
  std::array<Standing, count> standings_{};
  Search<Sums> search_{};
  Solution solution_{};
  Prediction<Times> chosen_{};    // of the solution
  Prediction<Times> best_fit_{};  // of the candidate with the least residual
  std::size_t best_ = 1;
  std::size_t chosen_candidate_ = 1;
  ResidualNoise noise_;  // of the best fit's a-priori errors
  double effective_ = 0.0;
  double taken_ = 0.0;  // samples since they were forgotten
  double samples_since_round_ = 0.0;
  double samples_since_fit_ = 0.0;
  double searched_weight_ = 0.0;
  double fewest_ = least_fewest;
  std::size_t next_ = 0;
  Stage stage_ = Stage::idle;
  bool widely_ = true;
  bool offset_refuted_ = false;
  bool decided_ = false;
};

}  // namespace palpate::viscoelastic
