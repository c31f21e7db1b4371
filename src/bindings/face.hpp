// The content of a Python object: one compiled estimator of any kind behind one interface, which is
// bound once, in bind_face.cpp; each estimator adds its constructor.
//
// Threads: a replay runs without the interpreter's lock; other calls on the same estimator wait for
// its end. All other calls hold that lock, so they run one after the other.
//
// Forks: a child process has no copy of the replaying thread, so the replay never ends there, and
// its copy of the estimator is incomplete. The estimator stores the process of a replay: in a child
// it raises RuntimeError until reset() is called.
#pragma once

#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "conversions.hpp"
#include "palpate/estimate.hpp"
#include "palpate/recursive_estimator.hpp"

namespace palpate::bindings {

using Pair = std::array<double, 2>;
using Triple = std::array<double, 3>;
// drift, threshold, noise, adaptation, warm-up, transition
using Detector = std::array<double, 6>;

// The settings that all estimators share: forgetting, perturbation, change detection, outlier
// threshold, gate, scale, sample time. Change detection and outlier rejection are optional.
using Loop =
    std::tuple<Pair, Pair, std::optional<Detector>, std::optional<double>, Triple, Triple, double>;

inline const Triple& scale_of(const Loop& loop) noexcept { return std::get<5>(loop); }

// One class for the estimates of all laws: plain numbers, named in Python.
struct EstimateValue : AnyEstimate {
  // Largest number of parameters of a law and of the plain recursion.
  static constexpr std::size_t capacity = 8;

  std::size_t size;
  double offset;
  std::array<double, capacity> parameters;
  std::array<double, (capacity + 1) * (capacity + 1)>
      covariance;  // rows of size + 1, the offset's last
  ContactResponse response;

  double& entry(std::size_t i, std::size_t j) { return covariance[i * (size + 1) + j]; }
};

template <std::size_t Size>
EstimateValue value_of(const Estimate<Size>& estimate, const ContactResponse& response) {
  static_assert(Size <= EstimateValue::capacity);
  EstimateValue value{estimate, Size, estimate.offset.value, {}, {}, response};
  for (std::size_t i = 0; i < Size; ++i) {
    value.parameters[i] = estimate.parameters[i];
    value.entry(i, Size) = value.entry(Size, i) = estimate.offset.covariance[i];
    for (std::size_t j = 0; j < Size; ++j) value.entry(i, j) = estimate.covariance[i][j];
  }
  value.entry(Size, Size) = estimate.offset.variance;
  return value;
}

// Memory of a saved object: padding is zero, so that equal estimators have equal states.
struct Zeroed {
  static void* operator new(std::size_t size);
  static void operator delete(void* memory) noexcept;
};

// A change detector or outlier rejection that is optional at run time. It is allocated separately,
// as most estimators have none and a detector is ten times their size.
template <class Watcher>
class Optional {
 public:
  struct Settings {
    bool present = false;
    typename Watcher::Settings watcher{};

    bool operator==(const Settings&) const = default;

    friend const char* validate(const Settings& settings) noexcept {
      return settings.present ? validate(settings.watcher) : nullptr;
    }
  };

  explicit Optional(const Settings& settings)
      : held_(settings.present ? new Held{{}, Watcher(settings.watcher)} : nullptr) {}

  Watcher* watcher() const noexcept { return held_ ? &held_->watcher : nullptr; }

 private:
  struct Held : Zeroed {
    Watcher watcher;
  };
  std::unique_ptr<Held> held_;
};

// A type-erased estimator.
class Core {
 public:
  explicit Core(double step) noexcept : sample_time(step) {}
  virtual ~Core() = default;

  virtual Status update(double penetration, double velocity, double force, double dt) noexcept = 0;
  virtual void replay(const Signals& in, const TraceColumns& out, const TraceRows& rows) = 0;
  virtual double predict(double penetration, double velocity) const = 0;
  virtual EstimateValue estimate(double depth, const ResponsePrior& prior) const = 0;
  virtual void leave_contact() = 0;
  virtual void reset() = 0;
  virtual nb::bytes state() = 0;
  virtual void restore(const nb::bytes& state) = 0;

  const double sample_time;
};

template <class Usual>
class CoreOf final : public Core, public Zeroed {
 public:
  using Estimator = RecursiveEstimator<typename Usual::Method, Optional<ChangeDetector>,
                                       Optional<OutlierRejection>>;
  using Settings = typename Estimator::Settings;

  // `name` distinguishes its states from those of other classes.
  CoreOf(std::string name, const Settings& settings)
      : Core(settings.sample_time), estimator(settings), name_(std::move(name)) {}

  Status update(double penetration, double velocity, double force, double dt) noexcept override {
    return estimator.update(penetration, velocity, force, dt);
  }
  void replay(const Signals& in, const TraceColumns& out, const TraceRows& rows) override {
    palpate::replay(estimator, in, out, rows);
  }
  double predict(double penetration, double velocity) const override {
    return estimator.predict(penetration, velocity);
  }
  EstimateValue estimate(double depth, const ResponsePrior& prior) const override {
    const auto fit = estimator.fit();
    return value_of(estimator.estimate(fit), estimator.response(depth, prior, &fit));
  }
  void leave_contact() override { estimator.leave_contact(); }
  void reset() override { estimator.reset(); }
  nb::bytes state() override { return saved(name_, parts()); }
  void restore(const nb::bytes& state) override {
    Memory memory = opened(name_, state, parts());
    check_settings(taken<Settings>(memory) == estimator.settings());
    // All parts are checked before one is replaced.
    const auto restored = taken<Recursion<typename Usual::Method>>(memory);
    auto* changes = estimator.changes();
    auto* outliers = estimator.outliers();
    const auto detector = changes ? std::optional(taken<ChangeDetector>(memory)) : std::nullopt;
    if (detector) check_settings(detector->settings() == changes->settings());
    if (outliers) *outliers = taken<OutlierRejection>(memory);
    if (detector) *changes = *detector;
    recursion() = restored;
  }

  Estimator estimator;

 private:
  Recursion<typename Usual::Method>& recursion() noexcept { return estimator; }

  std::array<Memory, 4> parts() noexcept {
    return {memory_of(&estimator.settings()), memory_of(&recursion()),
            memory_of(estimator.changes()), memory_of(estimator.outliers())};
  }

  std::string name_;
};

// Builds it from settings that Python has checked, with the requested change detector and outlier
// rejection. `kind` distinguishes variants with one name.
template <class Usual>
std::unique_ptr<Core> core_of(const char* name, int kind,
                              const typename Usual::Method::Settings& method, const Loop& loop) {
  const auto& [forgetting, perturbation, changes, outliers, gate, scale, sample_time] = loop;
  typename CoreOf<Usual>::Settings settings{.method = method,
                                            .forgetting = {forgetting[0], forgetting[1]},
                                            .perturbation = {perturbation[0], perturbation[1]},
                                            .changes = {},
                                            .outliers = {},
                                            .gate = {gate[0], gate[1], gate[2]},
                                            .scale = {scale[0], scale[1], scale[2]},
                                            .sample_time = sample_time};
  if (outliers) settings.outliers = {true, {*outliers}};
  if (changes) {
    const Detector& d = *changes;
    const auto warm_up = static_cast<std::uint32_t>(d[4]);
    const auto transition = static_cast<std::uint32_t>(d[5]);
    settings.changes = {true, {d[0], d[1], d[2], d[3], warm_up, transition}};
  }
  if (const char* fault = validate(settings)) throw nb::value_error(fault);
  kind = 4 * kind + 2 * settings.outliers.present + settings.changes.present;
  return std::make_unique<CoreOf<Usual>>(std::string(name) + "." + std::to_string(kind), settings);
}

class Face {
 public:
  explicit Face(std::unique_ptr<Core> core) noexcept : core_(std::move(core)) {}

  // The estimator, once no other thread replays it; throws if that thread is in the parent process
  // of a fork.
  Core& core() {
    if (replaying_.load(std::memory_order_acquire) != 0) [[unlikely]]
      wait_until_free();
    return *core_;
  }

  // Forgets everything but the settings, including an incomplete replay after a fork.
  void reset();

  // Runs without the interpreter's lock.
  void replay(const Signals& in, const TraceColumns& out, const TraceRows& rows);

 private:
  void wait_until_free();

  std::unique_ptr<Core> core_;
  std::atomic<int> replaying_ = 0;  // process of the replaying thread, or 0
};

// The interface of one Python class.
template <class Usual>
class FaceOf : public Face {
 public:
  using Face::Face;
};

template <class Usual>
nb::class_<FaceOf<Usual>, Face> bind_face(nb::module_& module, const char* name) {
  return {module, name};
}

}  // namespace palpate::bindings
