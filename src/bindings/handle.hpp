// What a Python object holds: one compiled estimator of several kinds, such as with and without a
// change detector, of which the first, the plain one, lies in the object itself.
//
// Threads: a replay runs without the interpreter's lock, and is taken whole; whatever else is
// called on the same estimator meanwhile waits for its end. All other calls hold that lock, so
// they are taken one after the other.
//
// Forks: a child has no copy of the thread that replays, so no replay ever ends there, and its copy
// of the estimator is half replayed. Who replays is therefore known by its process: a child raises
// RuntimeError, until it resets the estimator.
#pragma once

#ifndef _WIN32
#include <unistd.h>
#endif

#include <atomic>
#include <cstddef>
#include <memory>
#include <stdexcept>
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

  // Waits, without the interpreter's lock, while another thread replays; throws where that thread
  // is in the process that this one was forked from.
  void wait_until_free() {
    int process;
    while ((process = replaying_.load(std::memory_order_acquire)) != 0) [[unlikely]] {
      if (process != this_process()) {
        throw std::runtime_error(
            "the process was forked while another thread replayed this estimator: it is half "
            "replayed here; call reset(), or make a new one with replace()");
      }
      nb::gil_scoped_release release;
      replaying_.wait(process, std::memory_order_acquire);
    }
  }

  // Forgets everything but the settings, what a fork left half replayed too.
  void reset() {
    if (replaying_.load() == this_process()) wait_until_free();
    replaying_.store(0);
    with([](auto& estimator) { estimator.reset(); });
  }

  // Calls `act` with the estimator and without the interpreter's lock.
  template <class Act>
  void replay_with(Act&& act) {
    wait_until_free();
    replaying_.store(this_process(), std::memory_order_relaxed);
    nb::gil_scoped_release release;
    with(act);
    replaying_.store(0, std::memory_order_release);
    replaying_.notify_all();
  }

 private:
  static int this_process() noexcept {
#ifdef _WIN32
    return 1;  // which cannot be forked
#else
    return static_cast<int>(::getpid());
#endif
  }

  template <class Next, class... Rest, class Act>
  decltype(auto) with_other(Act&& act) {
    auto* other = std::get_if<std::unique_ptr<Next>>(&estimator_);
    if constexpr (sizeof...(Rest) > 0) {
      if (!other) return with_other<Rest...>(act);
    }
    return act(**other);
  }

  std::variant<Usual, std::unique_ptr<Others>...> estimator_;
  std::atomic<int> replaying_ = 0;  // the process whose thread replays, or 0
};

}  // namespace palpate::bindings
