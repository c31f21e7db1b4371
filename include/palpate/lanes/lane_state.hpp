// What a kernel works on: plain memory, laid out alike for every instruction set.
#pragma once

#include <cstddef>
#include <cstdint>

namespace palpate::lanes {

// Contacts that a kernel advances at once; with fewer the other lanes are idle.
inline constexpr int block_lanes = 16;

// Where the samples of each lane lie; lanes without a contact point to those of another.
struct LaneSignals {
  const double* penetration[block_lanes];
  const double* velocity[block_lanes];
  const double* force[block_lanes];
  std::size_t count;  // samples of each
  int lanes;          // with a contact, from the first on
};

// Settings a lane, and what follows from them.
struct LaneSettings {
  double per_penetration[block_lanes];  // scaled units, as Units'
  double per_velocity[block_lanes];
  double per_force[block_lanes];
  double minimum_penetration[block_lanes];  // of the gate, SI
  double make_force[block_lanes];
  double break_force[block_lanes];
  // Within these, SI, a sample makes contact and is in range without a closer look.
  double plain_penetration[2][block_lanes];
  double plain_force[2][block_lanes];
  double plain_velocity[block_lanes];
  double ceiling[block_lanes];    // of a variance of P
  double departure[block_lanes];  // 1 − λ₀
  double decay[block_lanes];      // of 1 − λ in a sample
};

// What each lane's estimator has learned.
template <int Order>
struct LaneState {
  static constexpr int entries = Order * (Order + 1) / 2;

  double parameters[Order][block_lanes];    // θ
  double covariance[entries][block_lanes];  // P, its upper triangle by rows
  double residual[block_lanes];             // as LeastSquares::State's
  double weight[block_lanes];
  double prior_weight[block_lanes];
  double departure[block_lanes];  // 1 − λ
  double samples[block_lanes];    // taken
  double last[block_lanes];       // of them, the last one's index; −1 for none
  double guarded_last[block_lanes];
  std::uint64_t guarded[block_lanes];
  double violated[block_lanes];  // samples taken without condition 10, by kernels that count them
  unsigned contact;              // a bit a lane: in contact
};

// Takes one sample of one lane as the scalar recursion does, from the lane's φ and y. True where
// the sample was taken; only θ, P and the sums change, and what was guarded is counted.
template <int Order>
using ScalarStep = bool (*)(void* context, int lane, const double* regressor, double output,
                            double forgetting_factor, std::size_t index, LaneState<Order>& state);

template <int Order>
using Kernel = void (*)(const LaneSignals&, const LaneSettings&, LaneState<Order>&,
                        ScalarStep<Order>, void* context);

// The kernels of one instruction set, by regression.
struct Kernels {
  Kernel<2> kelvin_voigt;
  Kernel<3> extended_kelvin_voigt;
  Kernel<3> single_stage;
  Kernel<3> single_stage_counting;  // where condition 10 did not hold
};

}  // namespace palpate::lanes
