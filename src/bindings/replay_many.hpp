// Many contacts of one length through an estimator's recursion, each from a fresh start: in vector
// lanes where they take its settings, one at a time where not; on several threads, without the
// interpreter's lock.
#pragma once

#include <nanobind/stl/optional.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "conversions.hpp"
#include "palpate/lanes/replay_contacts.hpp"

namespace palpate::bindings {

using InputRows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using CountArray = nb::ndarray<std::uint64_t, nb::c_contig, nb::device::cpu>;

// The kernels of an instruction set by name; null for "scalar", which means none.
const lanes::Kernels* kernels_named(std::string_view name);

// A row a contact.
struct EstimateColumns {
  double* parameters;
  double* covariance;
  double* others;         // offset, its variance, surface, its variance, validity margin
  std::uint8_t* status;   // and flags
  std::uint64_t* counts;  // samples, guarded, restarts, rejected

  template <class Estimator>
  void write(std::size_t contact, const Estimator& estimator) const noexcept {
    constexpr std::size_t size = Estimator::Law::size;
    const palpate::Estimate<size> now = estimator.estimate();
    for (std::size_t i = 0; i < size; ++i) {
      parameters[contact * size + i] = now.parameters[i];
      for (std::size_t j = 0; j < size; ++j) {
        covariance[(contact * size + i) * size + j] = now.covariance[i][j];
      }
    }
    double* other = others + 5 * contact;
    other[0] = now.offset.value;
    other[1] = now.offset.variance;
    other[2] = now.surface.value;
    other[3] = now.surface.variance;
    other[4] = now.validity_margin;
    status[2 * contact] = static_cast<std::uint8_t>(now.status);
    status[2 * contact + 1] = now.flags;
    std::uint64_t* count = counts + 4 * contact;
    count[0] = now.samples;
    count[1] = now.guarded;
    count[2] = now.restarts;
    count[3] = now.rejected;
  }
};

// Calls work(first, last) for parts of 0 … count, on so many threads, this one among them.
template <class Work>
void in_parts(std::size_t count, std::size_t threads, const Work& work) {
  // Sixteen parts a thread even out what differs between contacts; lanes want whole blocks.
  const std::size_t wanted = count / (16 * threads) + 1;
  const std::size_t part =
      (wanted + lanes::block_lanes - 1) / lanes::block_lanes * lanes::block_lanes;
  std::atomic<std::size_t> next = 0;
  const auto run = [&] {
    for (std::size_t first; (first = next.fetch_add(part)) < count;) {
      work(first, std::min(first + part, count));
    }
  };
  struct Threads {
    ~Threads() {
      for (std::thread& thread : running) thread.join();
    }
    std::vector<std::thread> running;
  } others;
  for (std::size_t i = 1; i < threads && i * part < count; ++i) others.running.emplace_back(run);
  run();
}

// Gates and scales of their own are for validate() to check, a contact at a time.
template <class Settings>
void check_own_settings(const Settings& settings, const lanes::Contacts& contacts) {
  if (!contacts.gates && !contacts.scales) return;
  for (std::size_t contact = 0; contact < contacts.count; ++contact) {
    if (const char* fault = validate(contacts.settings_of(settings, contact))) {
      throw nb::value_error(("contact " + std::to_string(contact) + ": " + fault).c_str());
    }
  }
}

// True where the contacts went through lanes.
template <class Handle>
bool replay_many(Handle& handle, const InputRows& penetration, const InputRows& velocity,
                 const InputRows& force, const std::optional<InputRows>& gates,
                 const std::optional<InputRows>& scales, const OutputArray& parameters,
                 const OutputArray& covariance, const OutputArray& others,
                 const StatusArray& status, const CountArray& counts,
                 const std::optional<CountArray>& violated,
                 const std::optional<StatusArray>& statuses, std::size_t threads,
                 const char* instruction_set) {
  const lanes::Contacts contacts{penetration.data(),
                                 velocity.data(),
                                 force.data(),
                                 penetration.shape(0),
                                 penetration.shape(1),
                                 gates ? gates->data() : nullptr,
                                 scales ? scales->data() : nullptr,
                                 violated ? violated->data() : nullptr,
                                 statuses ? statuses->data() : nullptr};
  const EstimateColumns out{parameters.data(), covariance.data(), others.data(), status.data(),
                            counts.data()};
  const lanes::Kernels* kernels = kernels_named(instruction_set);
  handle.wait_until_free();
  return handle.with([&]<class Estimator>(Estimator& core) {
    const typename Estimator::Settings settings = core.settings();
    check_own_settings(settings, contacts);
    const bool in_lanes = kernels && !statuses && lanes::in_lanes<Estimator>(settings);
    const auto write = [&out](std::size_t contact, const Estimator& estimator) {
      out.write(contact, estimator);
    };
    const nb::gil_scoped_release release;
    in_parts(contacts.count, threads, [&](std::size_t first, std::size_t last) {
      if (in_lanes) {
        lanes::replay_contacts<Estimator>(settings, contacts, first, last, *kernels, write);
      } else {
        lanes::replay_one_by_one<Estimator>(settings, contacts, first, last, write);
      }
    });
    return in_lanes;
  });
}

}  // namespace palpate::bindings
