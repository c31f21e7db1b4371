// The kernels of the instruction set that a source file is compiled for.
#pragma once

#include <cstddef>

#include "palpate/lanes/instruction_set.hpp"
#include "palpate/lanes/lane_recursion.hpp"
#include "palpate/lanes/lane_state.hpp"
#include "palpate/lanes/pack.hpp"
#include "palpate/lanes/regressors.hpp"
#include "palpate/lanes/sample_block.hpp"

namespace palpate::lanes {
inline namespace PALPATE_LANES_SET {

// Lanes that go through the recursion abreast. Each sample waits for the one before it; two
// registers of lanes fill the time, more would not fit beside their state.
inline constexpr int group_lanes = 2 * register_lanes;
static_assert(block_lanes % group_lanes == 0);

// `Counting`: samples taken at which condition 10 did not hold are counted.
template <class Row, bool Counting = false>
void advance(const LaneSignals& in, const LaneSettings& settings, LaneState<Row::order>& state,
             ScalarStep<Row::order> scalar_step, void* context) noexcept {
  SampleBlock block;
  const int lanes = (in.lanes + group_lanes - 1) / group_lanes * group_lanes;
  for (std::size_t first = 0; first < in.count; first += SampleBlock::length) {
    const std::size_t left = in.count - first;
    const int count = left < SampleBlock::length ? static_cast<int>(left) : SampleBlock::length;
    fill<Row>(block, in, first, count, lanes, settings);
    for (int lane = 0; lane < lanes; lane += group_lanes) {
      LaneGroup<Row, group_lanes, Counting>(settings, state, lane, scalar_step, context)
          .run(block, in, first, count);
    }
  }
}

inline constexpr Kernels kernels{&advance<KelvinVoigtRow>, &advance<ExtendedKelvinVoigtRow>,
                                 &advance<SingleStageRow>, &advance<SingleStageRow, true>};

}  // namespace PALPATE_LANES_SET
}  // namespace palpate::lanes
