// The state of a viscoelastic estimator: the states of the branches, and the sums.
//
// A branch relaxes, ġ = d(ξⁿ)/dt − g/τ, for every exponent of the grid and a ladder of relaxation
// times: exact for ξⁿ linear between samples, whatever the time step.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "palpate/sample.hpp"
#include "palpate/viscoelastic/power_table.hpp"

namespace palpate::viscoelastic {

// The laws that compete: F = k ξⁿ + c ξᵖ w + m Σ wᵢ gᵢ + F₀,  ġᵢ = d(ξⁿ)/dt − gᵢ/τᵢ,  Σ wᵢ = 1.

// The damping form: none, p = n (Hunt & Crossley), or p = n − 1 (Kelvin–Voigt half-space).
enum class Damping : std::uint8_t { none, hunt_crossley, half_space };

// The weights wᵢ as a function of the relaxation times.
enum class Memory : std::uint8_t { none, flat, single, power_law };

struct Candidate {
  Damping damping;
  Memory memory;
  bool linear = false;  // n is fixed at 1: with p = n − 1 the Kelvin–Voigt law

  // Whether a relaxation time or the spectrum's exponent is estimated together with n.
  constexpr bool searches_memory() const noexcept {
    return memory == Memory::single || memory == Memory::power_law;
  }
  // Number of fitted parameters, including F₀.
  constexpr double parameters() const noexcept {
    return 2.0 + (linear ? 0.0 : 1.0) + (damping == Damping::none ? 0.0 : 1.0) +
           (memory == Memory::none ? 0.0 : 1.0) + (searches_memory() ? 1.0 : 0.0);
  }
  constexpr bool operator==(const Candidate&) const noexcept = default;
};

// The common laws first: those that the small bank can distinguish.
inline constexpr std::array<Candidate, 11> candidates{{
    {Damping::half_space, Memory::none, true},
    {Damping::hunt_crossley, Memory::none},
    {Damping::half_space, Memory::none},
    {Damping::hunt_crossley, Memory::flat},
    {Damping::half_space, Memory::flat},
    {Damping::none, Memory::single},
    {Damping::hunt_crossley, Memory::single},
    {Damping::half_space, Memory::single},
    {Damping::none, Memory::power_law},
    {Damping::hunt_crossley, Memory::power_law},
    {Damping::half_space, Memory::power_law},
}};
inline constexpr std::size_t everyday_candidates = 5;

// Bit i stands for candidates[i].
using Offered = std::uint16_t;
inline constexpr Offered forgetful = 0b111;  // those without memory

// Times τᵢ = τ₀ rⁱ with r = 2^Doublings and τ₀ = two time steps: what relaxes sooner is over
// before the next sample.
template <std::size_t Count, std::size_t Doublings>
class Ladder {
 public:
  static constexpr std::size_t count = Count;
  static constexpr double ratio = static_cast<double>(1U << Doublings);

  explicit Ladder(double sample_time) noexcept : shortest_(2.0 * sample_time) { set(sample_time); }

  double sample_time() const noexcept { return 0.5 * shortest_; }
  double time(double rung) const noexcept { return shortest_ * std::pow(ratio, rung); }

  // What is left of a branch after a step, and what it takes of a change of ξⁿ during it.
  struct Step {
    std::array<double, Count> kept;
    std::array<double, Count> gain;
  };

  Step over(double dt) noexcept {
    if (dt != dt_) set(dt);
    // In a step below rounding nothing relaxes; time over step would overflow in a still smaller.
    double per_step = shortest_ / std::max(dt, 1e-18 * shortest_);
    Step step;
    for (std::size_t i = 0; i < Count; ++i, per_step *= ratio) {
      step.kept[i] = 1.0 - lost_[i];
      step.gain[i] = lost_[i] * per_step;
    }
    return step;
  }

 private:
  // 1 − e^(−dt/τ) of the longest by expm1; half the time doubles the
  // exponent, e ← e (2 − e) = e (1 + a), and squares what is left, a ← a².
  void set(double dt) noexcept {
    constexpr double longest = static_cast<double>(1ULL << Doublings * (Count - 1));
    dt_ = dt;
    double lost = -std::expm1(-std::max(dt, 1e-18 * shortest_) / (longest * shortest_));
    double kept = 1.0 - lost;
    for (std::size_t i = Count; i-- > 0;) {
      lost_[i] = lost;
      for (std::size_t doubling = 0; doubling < Doublings; ++doubling) {
        lost *= 1.0 + kept;
        kept *= kept;
      }
    }
  }

  double shortest_;
  double dt_ = 0.0;
  std::array<double, Count> lost_{};
};

// The state of all branches. It depends on the penetration only, not on the force, and continues
// through loss of contact, where ξⁿ counts as 0.
template <class Times>
class Branches {
 public:
  explicit Branches(double sample_time) noexcept : times_(sample_time) {}

  // Advances to a depth (0 out of contact) by a time.
  void advance(double depth, double dt) noexcept {
    const auto step = times_.over(dt);
    if (depth == depth_) return decay(step);
    const NodeRow before = elastic_of(depth_), now = elastic_of(depth);
    depth_ = depth;
    NodeRow change;
    for (std::size_t j = 0; j < change.size(); ++j) change[j] = now[j] - before[j];
    for (std::size_t i = 0; i < Times::count; ++i) {
      const double kept = step.kept[i], gain = step.gain[i];
      for (std::size_t j = 0; j < change.size(); ++j) {
        states_[i][j] = states_[i][j] * kept + gain * change[j];
      }
    }
  }

  // Fully relaxed at this depth.
  void rest(double depth) noexcept {
    states_ = {};
    depth_ = depth;
  }

  const Times& times() const noexcept { return times_; }
  const std::array<NodeRow, Times::count>& states() const noexcept { return states_; }
  double depth() const noexcept { return depth_; }

 private:
  // Decaying values below 1e-76 are set to zero: subnormal numbers would be slow.
  void decay(const typename Times::Step& step) noexcept {
    for (std::size_t i = 0; i < Times::count; ++i) {
      for (double& state : states_[i]) state = (state * step.kept[i] + 1e-60) - 1e-60;
    }
  }

  Times times_;
  double depth_ = 0.0;  // at the last sample
  std::array<NodeRow, Times::count> states_{};
};

// The weights wᵢ of `Count` branches, Σ wᵢ = 1, of which those from `first` up to `end` count.
template <std::size_t Count>
struct Spectrum {
  std::array<double, Count> weight{};
  std::size_t first = 0;
  std::size_t end = Count;
};

// `second` is the place of the one relaxation time on the ladder, in rungs; or α of wᵢ ∝ τᵢ^−α.
template <class Times>
Spectrum<Times::count> spectrum_of(Memory memory, double second) noexcept {
  Spectrum<Times::count> result;
  if (memory == Memory::single) {
    // Of a time between the rungs it is the branches that are interpolated, not their sums: what
    // comes out is the residual of a law.
    const Window around = window(second, Times::count);
    result.first = around.first;
    result.end = around.first + window_points;
    for (std::size_t i = 0; i < window_points; ++i) {
      result.weight[around.first + i] = around.weights[i];
    }
    return result;
  }
  if (memory == Memory::flat) {
    result.weight.fill(1.0 / static_cast<double>(Times::count));
    return result;
  }
  double total = 0.0, next = 1.0;
  const double ratio = std::pow(Times::ratio, -second);
  for (double& weight : result.weight) {
    weight = next;
    total += next;
    next *= ratio;
  }
  for (double& weight : result.weight) weight /= total;
  return result;
}

// Of one column G = Σ wᵢ gᵢ at one exponent: the sums of G, GF, Gξⁿ, Gξⁿw, Gξⁿ⁻¹w and G². The first
// two go by a window of sums of one power of ξⁿ, the others of two, about the same nodes.
struct MemoryColumn {
  double one, force, power, power_speed, slope_speed, square;
};

// The five sums of a branch with what is no branch.
using Crossed = std::array<NodeRow, 5>;

inline void add_crossed(Crossed& sums, const NodeRow& g, const Powers& p, const Sample& s,
                        double weight) noexcept {
  const double wf = weight * s.force, wv = weight * s.velocity;
  const double* power = p.data() + Grid::first_exponent;
  const double* slope = power - Grid::one;  // ξⁿ⁻¹
  for (std::size_t j = 0; j < Grid::exponents; ++j) {
    const double once = weight * g[j], moving = wv * g[j];
    sums[0][j] += once;
    sums[1][j] += wf * g[j];
    sums[2][j] += once * power[j];
    sums[3][j] += moving * power[j];
    sums[4][j] += moving * slope[j];
  }
}

template <std::size_t Rows>
void scale_rows(std::array<NodeRow, Rows>& rows, double factor) noexcept {
  for (NodeRow& row : rows) {
    for (double& sum : row) sum *= factor;
  }
}

// The sums of the common laws: six times, a factor of four apart, and only their mean.
class FlatSums {
 public:
  using Times = Ladder<6, 2>;
  static constexpr bool full = false;

  void add(const Branches<Times>& branches, const Powers& p, const Sample& s,
           double weight) noexcept {
    NodeRow mean{};
    for (const NodeRow& state : branches.states()) {
      for (std::size_t j = 0; j < Grid::exponents; ++j) mean[j] += state[j];
    }
    constexpr double each = 1.0 / static_cast<double>(Times::count);
    for (double& value : mean) value *= each;
    add_crossed(crossed_, mean, p, s, weight);
    for (std::size_t j = 0; j < Grid::exponents; ++j) square_[j] += weight * mean[j] * mean[j];
  }

  MemoryColumn column(const Window& once, const Window& twice,
                      const Spectrum<Times::count>&) const noexcept {
    return {once.of(crossed_[0].data()),  once.of(crossed_[1].data()),
            twice.of(crossed_[2].data()), twice.of(crossed_[3].data()),
            twice.of(crossed_[4].data()), twice.of(square_.data())};
  }

  void scale(double factor) noexcept {
    scale_rows(crossed_, factor);
    for (double& sum : square_) sum *= factor;
  }

 private:
  Crossed crossed_{};
  NodeRow square_{};
};

// The sums of all laws: twelve times, a factor of two apart, and all their pairs.
class PairSums {
 public:
  using Times = Ladder<12, 1>;
  static constexpr bool full = true;

  void add(const Branches<Times>& branches, const Powers& p, const Sample& s,
           double weight) noexcept {
    const auto& states = branches.states();
    std::size_t pair = 0;
    for (std::size_t i = 0; i < Times::count; ++i) {
      add_crossed(crossed_[i], states[i], p, s, weight);
      NodeRow weighted;
      for (std::size_t j = 0; j < Grid::exponents; ++j) weighted[j] = weight * states[i][j];
      for (std::size_t other = i; other < Times::count; ++other, ++pair) {
        for (std::size_t j = 0; j < Grid::exponents; ++j) {
          pairs_[pair][j] += weighted[j] * states[other][j];
        }
      }
    }
  }

  MemoryColumn column(const Window& once, const Window& twice,
                      const Spectrum<Times::count>& spectrum) const noexcept {
    // Rows are mixed before they are interpolated: one window serves them all.
    std::array<Vector<window_points>, 6> mixed{};
    const auto mix = [](Vector<window_points>& sum, double weight, const double* row) noexcept {
      for (std::size_t k = 0; k < window_points; ++k) sum[k] += weight * row[k];
    };
    const std::size_t first = once.first;
    for (std::size_t i = spectrum.first; i < spectrum.end; ++i) {
      const double weight = spectrum.weight[i];
      for (std::size_t j = 0; j < 5; ++j) mix(mixed[j], weight, crossed_[i][j].data() + first);
      const double doubled = 2.0 * weight;
      mix(mixed[5], weight * weight, pairs_[pair_of(i, i)].data() + first);
      for (std::size_t other = i + 1; other < spectrum.end; ++other) {
        mix(mixed[5], doubled * spectrum.weight[other], pairs_[pair_of(i, other)].data() + first);
      }
    }
    const auto of = [first](const Window& window, const Vector<window_points>& values) noexcept {
      return window.of(values.data(), first);
    };
    return {of(once, mixed[0]),  of(once, mixed[1]),  of(twice, mixed[2]),
            of(twice, mixed[3]), of(twice, mixed[4]), of(twice, mixed[5])};
  }

  void scale(double factor) noexcept {
    for (Crossed& crossed : crossed_) scale_rows(crossed, factor);
    scale_rows(pairs_, factor);
  }

 private:
  // Rows of a triangle one after the other: i (2 count − i + 1)/2 stand before row i.
  static constexpr std::size_t pair_of(std::size_t i, std::size_t other) noexcept {
    return i * (2 * Times::count - i + 1) / 2 + other - i;
  }

  std::array<Crossed, Times::count> crossed_{};
  std::array<NodeRow, Times::count*(Times::count + 1) / 2> pairs_{};
};

template <class Sums>
class Samples {
 public:
  using Times = typename Sums::Times;

  explicit Samples(double sample_time) noexcept : branches_(sample_time) {}

  // A depth, 0 for none, after so much time. The branches feel every one.
  [[gnu::noinline]] void advance(double depth, double dt) noexcept { branches_.advance(depth, dt); }

  // The same where nothing is known of what came before: as if it had always been there.
  void begin(double depth) noexcept { branches_.rest(depth); }

  // Takes the sample whose depth was advanced to.
  [[gnu::noinline]] void take(const Sample& s, double forgetting_factor) noexcept {
    if (forgetting_factor != 1.0) fade(forgetting_factor);
    force_squared_ += scale_ * s.force * s.force;
    const Powers powers = powers_of(s.penetration);
    table_.add(powers, s, scale_);
    sums_.add(branches_, powers, s, scale_);
  }

  void clear() noexcept {
    scale_ = 1.0;
    force_squared_ = 0.0;
    table_ = {};
    sums_ = {};
  }

  double weight() const noexcept { return table_.weight() / scale_; }        // Σ 1
  double force_squared() const noexcept { return force_squared_ / scale_; }  // Σ F²
  // What the latest sample weighs in the sums.
  double scale() const noexcept { return scale_; }
  const PowerTable& table() const noexcept { return table_; }
  const Sums& sums() const noexcept { return sums_; }
  const Branches<Times>& branches() const noexcept { return branches_; }
  bool touching() const noexcept { return branches_.depth() > 0.0; }

  // Where the motion was, and how quick: its mean depth; the square of its frequency, mean square
  // speed over mean square way from there; and its mean velocity over the root of that mean square
  // speed, ±1 where it went one way at one speed.
  struct Motion {
    double depth;
    double frequency_squared;
    double one_way;
  };
  Motion motion() const noexcept {
    using enum PowerTable::Kind;
    constexpr std::size_t zero = Grid::zero, one = zero + Grid::one, two = one + Grid::one;
    const double weight = table_.weight();
    if (!(weight > 0.0)) return {0.0, 0.0, 0.0};
    const double depth = table_.at_node(plain, one) / weight;
    const double way = table_.at_node(plain, two) - weight * depth * depth;
    const double squared = table_.at_node(speed_squared, zero);
    return {depth, way > 0.0 ? squared / way : 0.0,
            squared > 0.0 ? table_.at_node(speed, zero) / std::sqrt(weight * squared) : 0.0};
  }

 private:
  // In place of every sum, what is new weighs more: e⁶⁰ and all are brought back.
  void fade(double factor) noexcept {
    scale_ /= factor;
    constexpr double largest = 1e26;
    if (scale_ < largest) return;
    const double per = 1.0 / scale_;
    table_.scale(per);
    sums_.scale(per);
    force_squared_ *= per;
    scale_ = 1.0;
  }

  Branches<Times> branches_;
  double scale_ = 1.0;
  double force_squared_ = 0.0;
  PowerTable table_{};
  Sums sums_{};
};

}  // namespace palpate::viscoelastic
