// Contacts of one length, of every kind that a fleet brings: clean and noisy ones, and rows in
// which something is wrong in a lane of its own.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "estimators.hpp"
#include "palpate/lanes/replay_contacts.hpp"
#include "random_numbers.hpp"

namespace palpate {

struct ContactRows {
  ContactRows(std::size_t rows, std::size_t columns) : count(rows), samples(columns) {
    for (auto* column : {&penetration, &velocity, &force}) column->resize(rows * columns);
  }

  void set(std::size_t contact, std::size_t k, const Sample& sample) {
    penetration[contact * samples + k] = sample.penetration;
    velocity[contact * samples + k] = sample.velocity;
    force[contact * samples + k] = sample.force;
  }

  Sample at(std::size_t contact, std::size_t k) const {
    const std::size_t i = contact * samples + k;
    return {penetration[i], velocity[i], force[i]};
  }

  lanes::Contacts view() const {
    return {penetration.data(), velocity.data(), force.data(), count, samples};
  }

  std::size_t count, samples;
  std::vector<double> penetration, velocity, force;
};

// The paper's motion over materials of any stiffness, 0.2 % of noise.
template <class Law>
ContactRows probed_rows(std::size_t count, std::size_t samples, std::uint64_t seed) {
  RandomNumbers random(seed);
  ContactRows rows(count, samples);
  for (std::size_t contact = 0; contact < count; ++contact) {
    const double firmness = std::pow(10.0, random.between(-1.0, 1.0));
    const double start = random.between(0.0, 6.0);
    for (std::size_t k = 0; k < samples; ++k) {
      Sample sample = probed(ball<Law>, start + 1e-3 * static_cast<double>(k));
      sample.force *= firmness * (1.0 + random.between(-2e-3, 2e-3));
      rows.set(contact, k, sample);
    }
  }
  return rows;
}

inline constexpr std::size_t hostile_kinds = 8;

// Something is wrong with each row but every eighth, at places of its own.
template <class Law>
ContactRows hostile_rows(std::size_t count, std::size_t samples, std::uint64_t seed) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double infinite = std::numeric_limits<double>::infinity();
  RandomNumbers random(seed);
  ContactRows rows = probed_rows<Law>(count, samples, seed + 1);
  for (std::size_t contact = 0; contact < count; ++contact) {
    for (std::size_t k = 0; k < samples; ++k) {
      Sample sample = rows.at(contact, k);
      const bool now = random.below(10) == 0;
      switch (contact % hostile_kinds) {
        case 1:  // single samples are missing
          if (now) (random.below(2) ? sample.penetration : sample.force) = nan;
          break;
        case 2:  // the probe leaves contact for a while, now and then
          if (k / 40 % 3 == contact / 8 % 3) sample = {-1e-3, sample.velocity, 0.0};
          break;
        case 3:  // beyond any range
          if (now) sample.force = random.below(2) ? 1e150 : infinite;
          if (now && random.below(2)) sample.velocity = -1e120;
          break;
        case 4:  // held at one place, which says nothing new
          if (k > samples / 3) sample = rows.at(contact, samples / 3);
          break;
        case 5:  // a force about the gate
          sample.force *= random.between(-0.2, 1.0);
          break;
        case 6:  // as small as numbers get
          if (now) sample.penetration = 1e-310;
          if (now && random.below(2)) sample.force = std::numeric_limits<double>::denorm_min();
          break;
        case 7:  // the row ends early
          if (k > samples / 2 + contact) sample = {nan, nan, nan};
          break;
        default:
          break;
      }
      rows.set(contact, k, sample);
    }
  }
  return rows;
}

}  // namespace palpate
