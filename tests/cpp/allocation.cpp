// Counts every allocation of the program: none may happen between settings and answers.
#include <array>
#include <cstdlib>
#include <new>
#include <vector>

#include "check.hpp"
#include "estimators.hpp"
#include "palpate/online_preparation.hpp"
#include "palpate/payload_compensation.hpp"
#include "palpate/touching_loop.hpp"
#include "palpate/viscoelastic_estimators.hpp"

namespace {

long allocations = 0;

void* counted(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}

}  // namespace

// The array and nothrow forms end in these.
void* operator new(std::size_t size) { return counted(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

void* operator new(std::size_t size, std::align_val_t alignment) {
  ++allocations;
  const std::size_t unit = static_cast<std::size_t>(alignment);
  if (void* memory = std::aligned_alloc(unit, (size + unit - 1) / unit * unit)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

using namespace palpate;

TEST("an allocation is counted") {
  const long before = allocations;
  std::vector<double> memory(100);
  CHECK(allocations == before + 1);
  memory.resize(1000);
  CHECK(allocations == before + 2);
}

TEST("construction, update, predict, estimate and reset never allocate") {
  for_every_estimator([&]<class Estimator>() {
    const auto law = ball<typename Estimator::Law>;
    const long before = allocations;
    Estimator estimator;
    probe(estimator, law, 0.5);
    estimator.update(std::nan(""), 0.0, 0.0);
    estimator.update(-1e-3, 0.0, 0.0);
    estimator.leave_contact();
    // What it gives must be used, or the compiler may leave the work out.
    double used = estimator.predict(0.01, 0.02);
    used += estimator.estimate().covariance[0][0] + estimator.response().age;
    estimator.reset();
    const long after = allocations;
    CHECK(after == before);
    CHECK(std::isfinite(used));
  });
}

TEST("laws that may remember are told apart without an allocation") {
  const GeneralisedHuntCrossley law{.K = 2000.0, .n = 1.0, .B = 2000.0, .p = 1.0, .M = 0.0};
  const long before = allocations;
  ViscoelasticContact estimator({.method = {.offered = 0x7f}});
  probe(estimator, law, 2.0);
  estimator.update(-1e-3, 0.0, 0.0);
  estimator.leave_contact();
  estimator.finish_pending();
  double used = estimator.predict(0.01, 0.02);
  used += estimator.estimate().covariance[0][0] + estimator.response(0.01).age;
  const long after = allocations;
  CHECK(after == before);
  CHECK(std::isfinite(used));
}

TEST("replay never allocates") {
  constexpr std::size_t count = 200;
  std::vector<double> x(count), v(count), f(count), parameters(3 * count), errors(3 * count),
      predicted(count), margins(count);
  std::vector<std::uint8_t> status(count);
  for_each_estimator([&]<class Estimator>() {
    const auto law = ball<typename Estimator::Law>;
    for (std::size_t k = 0; k < count; ++k) {
      const Sample s = probed(law, 1e-3 * static_cast<double>(k));
      x[k] = s.penetration;
      v[k] = s.velocity;
      f[k] = s.force;
    }
    const long before = allocations;
    Estimator estimator;
    replay(estimator, {x.data(), v.data(), f.data(), nullptr, count},
           {parameters.data(), errors.data(), predicted.data(), margins.data(), status.data()});
    const long after = allocations;
    CHECK(after == before);
    CHECK(std::isfinite(parameters.back()));
  });
}

TEST("a preparation never allocates") {
  const long before = allocations;
  OnlinePreparation<> preparation;
  double used = 0.0;
  for (int k = 0; k < 1000; ++k) {
    const double x = 1e-5 * static_cast<double>(k);
    const Status status =
        k % 3 ? preparation.update(x, 100.0 * x) : preparation.update_at(x, 100.0 * x, 1.1e-3 * k);
    if (status == Status::updated) used += preparation.sample().velocity;
  }
  preparation.update(std::nan(""), 0.0);
  preparation.interrupt();
  preparation.reset();
  const long after = allocations;
  CHECK(after == before);
  CHECK(used > 0.0);
}

TEST("a compensation of the payload never allocates") {
  const long before = allocations;
  PayloadCompensation<> compensation({.delay = 0.0123, .mass = 0.5});
  double used = 0.0;
  for (int k = 0; k < 1000; ++k) {
    const double x = 1e-5 * static_cast<double>(k);
    const Status status =
        compensation.update({x, 0.0, -x}, {0.0, 0.0, 0.0, 1.0}, {0.0, 0.0, -5.0}, 1e-3 * k);
    if (status == Status::updated) used += compensation.output().wrench[2];
  }
  compensation.update({std::nan("")}, {}, {}, 1.0);
  compensation.start_tare();
  compensation.finish_tare();
  compensation.reset();
  const long after = allocations;
  CHECK(after == before);
  CHECK(std::isfinite(used));
}

TEST("a simulated touch never allocates") {
  const detail::TouchingLoop loop{{2000.0, 1.0, 2000.0, 1.0, 500.0},
                                  detail::Controller::force,
                                  1.0,
                                  0.5,
                                  2.0,
                                  4.0,
                                  0.0,
                                  20.0,
                                  1e-3,
                                  2e-3,
                                  600.0,
                                  1.0,
                                  10.0,
                                  0.02,
                                  5e-3,
                                  0.5};
  const viscoelastic::RelaxationBranches branches{0.0, 0.01, 1.0, 1.0};
  std::array<double, 8> commands{};
  const long before = allocations;
  const detail::TouchOutcome outcome = detail::Touch{loop, branches, commands.data()}.run(nullptr);
  CHECK(outcome.peak_force > 1.0);
  CHECK(allocations == before);
}
