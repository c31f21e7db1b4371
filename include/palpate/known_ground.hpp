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
  // Takes the next depth, > 0, and velocity; true where an earlier stroke has been at both, or this
  // one has rested.
  bool visit(double depth, double velocity) noexcept {
    const double speed = std::abs(velocity);
    const bool back = inward_ ? depth<(1.0 - turn) * furthest_ : depth>(1.0 + turn) * furthest_;
    if (back) end_stroke(depth);
    const bool further =
        inward_ ? depth > (1.0 + step) * furthest_ : depth < (1.0 - step) * furthest_;
    if (further) {
      furthest_ = depth;
      fastest_there_ = fastest_now_;
      stay_ = {depth, depth, 0};
      rested_ = 0;
    }
    fastest_now_ = std::max(fastest_now_, speed);
    const std::size_t kind = kind_of(velocity);
    const std::uint64_t cell = cell_of(depth);
    current_[kind] |= cell;
    stay_ = {std::min(stay_.least, depth), std::max(stay_.most, depth), stay_.kinds | 1u << kind};
    if (++rested_ == rest) end_rest(depth);
    const bool stayed =
        depth >= known_stay_.least && depth <= known_stay_.most && known_stay_.kinds >> kind & 1u;
    return (stayed || (earlier_[kind] & cell) != 0) && speed <= 2.0 * fastest_;
  }

  // All ground is new: another law is learned.
  void forget() noexcept {
    earlier_ = {};
    current_ = {};
    known_stay_ = {};
  }

 private:
  // A stroke ends where the depth comes back by this part of itself, …
  static constexpr double turn = 0.05;
  // … and rests where it has not gone further by this part …
  static constexpr double step = 0.01;
  // … for so many samples.
  static constexpr std::uint32_t rest = 1000;

  // Outward and inward (0, 1), slowly so (2, 3), which is below a quarter of the fastest, and at
  // rest, below a sixteenth.
  static constexpr std::size_t resting = 4;
  using Cells = std::array<std::uint64_t, 5>;

  std::size_t kind_of(double velocity) const noexcept {
    const double speed = std::abs(velocity);
    if (speed < 0.0625 * fastest_now_) return resting;
    return (velocity > 0.0 ? 1u : 0u) + (speed < 0.25 * fastest_now_ ? 2u : 0u);
  }

  // Eight cells an octave of depth; after eight octaves they come again. The top bits of a double
  // are its exponent and, within an octave, its mantissa.
  static std::uint64_t cell_of(double depth) noexcept {
    const std::uint64_t bits = std::bit_cast<std::uint64_t>(depth);
    return std::uint64_t{1} << ((bits >> 49) & 63);
  }

  // It turned some way before: what was visited the other way is of the new stroke.
  void end_stroke(double depth) noexcept {
    const std::size_t way = inward_ ? 1 : 0;
    for (const std::size_t kind : {resting, way, way + 2}) {
      earlier_[kind] |= current_[kind];
      current_[kind] = 0;
    }
    stay_ = {depth, depth, 0};
    known_stay_ = {};
    inward_ = !inward_;
    fastest_ = fastest_there_;
    furthest_ = depth;
    rested_ = 0;
  }

  // A cell is wide beside the way of a probe that rests: what it knows is where it truly was.
  void end_rest(double depth) noexcept {
    known_stay_ = {std::min(known_stay_.least, stay_.least), std::max(known_stay_.most, stay_.most),
                   known_stay_.kinds | stay_.kinds};
    stay_ = {depth, depth, 0};
    fastest_ = fastest_now_;
    rested_ = 0;
  }

  // The depths of a stroke that goes no further, and at which kinds of speed.
  struct Stay {
    double least = 1e300;
    double most = 0.0;
    unsigned kinds = 0;
  };

  Cells earlier_{};             // where earlier strokes have been
  Cells current_{};             // and this one
  Stay stay_{};                 // since it went further or rested
  Stay known_stay_{};           // before
  double fastest_ = 0.0;        // |velocity| of earlier strokes
  double fastest_there_ = 0.0;  // |velocity| so far, when this stroke was furthest
  double fastest_now_ = 0.0;    // and with this one
  double furthest_ = 0.0;       // depth of this stroke
  std::uint32_t rested_ = 0;    // samples since it went further
  bool inward_ = true;
};

}  // namespace palpate::detail
