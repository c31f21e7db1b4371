// What a Python object holds: one compiled estimator of several kinds, such as with and without a
// change detector, of which the first, the plain one, lies in the object itself.
//
// Threads: a replay runs without the interpreter's lock, and is taken whole; whatever else is
// called on the same estimator meanwhile waits for its end. All other calls hold that lock, so
// they are taken one after the other.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <tuple>
#include <utility>
#include <variant>

#include "conversions.hpp"

namespace palpate::bindings {

template <class Usual, class... Others>
class Handle {
 public:
  using Law = typename Usual::Law;

  template <class Estimator>
  void emplace(const typename Estimator::Settings& settings) {
    if constexpr (std::is_same_v<Estimator, Usual>) {
      estimator_.template emplace<Usual>(settings);
    } else {
      estimator_ = std::make_unique<Estimator>(settings);
    }
  }

  std::size_t kind() const noexcept { return estimator_.index(); }

  // Calls `act` with the estimator, whichever kind it is.
  template <class Act>
  decltype(auto) with(Act&& act) {
    if (Usual* usual = std::get_if<Usual>(&estimator_)) return act(*usual);
    return with_other<Others...>(act);
  }

  // Waits, without the interpreter's lock, while another thread replays.
  void wait_until_free() {
    while (replaying_.load(std::memory_order_acquire)) [[unlikely]] {
      nb::gil_scoped_release release;
      replaying_.wait(true, std::memory_order_acquire);
    }
  }

  // Calls `act` with the estimator and without the interpreter's lock.
  template <class Act>
  void replay_with(Act&& act) {
    wait_until_free();
    replaying_.store(true, std::memory_order_relaxed);
    nb::gil_scoped_release release;
    with(act);
    replaying_.store(false, std::memory_order_release);
    replaying_.notify_all();
  }

 private:
  template <class Next, class... Rest, class Act>
  decltype(auto) with_other(Act&& act) {
    auto* other = std::get_if<std::unique_ptr<Next>>(&estimator_);
    if constexpr (sizeof...(Rest) > 0) {
      if (!other) return with_other<Rest...>(act);
    }
    return act(**other);
  }

  std::variant<Usual, std::unique_ptr<Others>...> estimator_;
  std::atomic<bool> replaying_ = false;
};

}  // namespace palpate::bindings
