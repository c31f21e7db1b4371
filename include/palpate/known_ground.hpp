// Where the probe has been before, and how fast. A law that is outside the material's class fits
// the ground that taught it and no other, so that an error on new ground says nothing of a change:
// a recording that goes in, rests and comes back is never twice at one depth and speed.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace palpate::detail {

class KnownGround {
 public:
  // Takes the next depth, > 0, and velocity; true where an earlier stroke has been at both.
  bool visit(double depth, double velocity) noexcept {
    const bool back = inward_ ? depth<(1.0 - turn) * furthest_ : depth>(1.0 + turn) * furthest_;
    if (back) end_stroke(depth);
    const bool further =
        inward_ ? depth > (1.0 + step) * furthest_ : depth < (1.0 - step) * furthest_;
    if (further) {
      furthest_ = depth;
      fastest_there_ = fastest_now_;
      rested_ = 0;
    } else if (++rested_ == rest) {
      end_rest();
    }
    const double speed = std::abs(velocity);
    fastest_now_ = std::max(fastest_now_, speed);
    const std::size_t kind = speed < 0.25 * fastest_ ? resting : velocity > 0.0;
    const std::uint64_t cell = cell_of(depth);
    current_[kind] |= cell;
    return (earlier_[kind] & cell) != 0 && speed <= 2.0 * fastest_;
  }

  // All ground is new: another law is learned.
  void forget() noexcept {
    earlier_ = {};
    current_ = {};
  }

 private:
  // A stroke ends where the depth comes back by this part of itself, …
  static constexpr double turn = 0.05;
  // … or has not gone further by this part …
  static constexpr double step = 0.01;
  // … for so many samples.
  static constexpr std::uint32_t rest = 1000;

  // Outward (0), inward (1) and at rest, which is below a quarter of the fastest.
  static constexpr std::size_t resting = 2;
  using Cells = std::array<std::uint64_t, 3>;

  // Eight cells an octave of depth; after eight octaves they come again. The top bits of a double
  // are its exponent and, within an octave, its mantissa.
  static std::uint64_t cell_of(double depth) noexcept {
    const std::uint64_t bits = std::bit_cast<std::uint64_t>(depth);
    return std::uint64_t{1} << ((bits >> 49) & 63);
  }

  // It turned some way before: what was visited the other way is of the new stroke.
  void end_stroke(double depth) noexcept {
    for (const std::size_t kind : {resting, std::size_t{inward_}}) {
      earlier_[kind] |= current_[kind];
      current_[kind] = 0;
    }
    inward_ = !inward_;
    fastest_ = fastest_there_;
    furthest_ = depth;
    rested_ = 0;
  }

  void end_rest() noexcept {
    for (std::size_t i = 0; i < current_.size(); ++i) earlier_[i] |= current_[i];
    current_ = {};
    fastest_ = fastest_now_;
    rested_ = 0;
  }

  Cells earlier_{};             // where earlier strokes have been
  Cells current_{};             // and this one
  double fastest_ = 0.0;        // |velocity| of earlier strokes
  double fastest_there_ = 0.0;  // |velocity| so far, when this stroke was furthest
  double fastest_now_ = 0.0;    // and with this one
  double furthest_ = 0.0;       // depth of this stroke
  std::uint32_t rested_ = 0;    // samples since it went further
  bool inward_ = true;
};

}  // namespace palpate::detail
