// What a method must offer to run in the loop of recursive_estimator.hpp.
//
// A method knows one force law and how samples teach it: an object with state, trivially copyable,
// that neither allocates nor throws. It sees samples in scaled units, within contact and within its
// range only, and answers in SI.
//
// Where it has them, the loop also calls `free(sample, λ)`, or `free(sample, dt, λ)`, for a finite
// sample out of contact, `interrupt()` where contact ends without one, `pass(dt)` for a sample that
// is refused or left out, and `prepare(sample, dt)` in place of `prepare(sample)`. A sample of
// which it is in doubt whether it touches has status `held` from learn(), whatever the method keeps
// of it.
#pragma once

#include <concepts>
#include <cstddef>
#include <type_traits>

#include "palpate/contact_gate.hpp"
#include "palpate/estimate.hpp"
#include "palpate/forgetting.hpp"
#include "palpate/sample.hpp"
#include "palpate/status.hpp"

namespace palpate {

template <class M>
concept Method = std::is_trivially_copyable_v<M> &&
                 requires(M method, const M known, const Sample& sample, const Units& units,
                          double number, const typename M::Settings& settings,
                          const typename M::Row& row, const ContactGate::Settings& gate) {
                   // The force law that it identifies, of M::Law::size parameters.
                   typename M::Law;
                   // Built from settings, whose defaults are those of the named estimator, and the
                   // units. What is wrong with them `validate` says in words; it returns null where
                   // they are sound.
                   requires std::constructible_from<M, const typename M::Settings&, const Units&>;
                   { validate(settings) } -> std::same_as<const char*>;
                   { M::default_forgetting } -> std::convertible_to<Forgetting::Settings>;
                   { M::default_scale } -> std::convertible_to<Scale>;

                   // Whether it heeds the forgetting factor and the self-perturbation that learn()
                   // is given. Settings that would be ignored are refused by `validate`.
                   { M::forgets } -> std::convertible_to<bool>;
                   { M::perturbs } -> std::convertible_to<bool>;

                   // The gate that it works behind: the given one, unless it wants more samples.
                   { method.gate(gate, units) } -> std::same_as<ContactGate::Settings>;
                   // Whether its arithmetic can take a sample.
                   { known.in_range(sample) } -> std::same_as<bool>;

                   // What the sample is to the method, such as a regressor and an output.
                   { method.prepare(sample) } -> std::same_as<typename M::Row>;
                   // The a-priori force in scaled units, before the sample is learned.
                   { known.predict(row) } -> std::same_as<double>;
                   // Takes a prepared sample, `dt` [s] after the one before it, with the forgetting
                   // factor λ and the perturbation π: whole (updated, guarded) or not at all (any
                   // other status).
                   {
                     method.learn(row, number /* dt */, number /* λ */, number /* π */)
                   } -> std::same_as<Status>;

                   // Starts again from the present answer as a prior, after a change of what is
                   // touched …
                   { method.reinitialise() };
                   // … and once more when its transient is over, from the same prior.
                   { method.reinitialise_after_transient() };

                   // The answer now, in SI: force [N] that the sensor would show, the law,
                   // everything that is known, and the part of it that a trace writes down.
                   {
                     known.force(units, number /* x, m */, number /* v, m/s */)
                   } -> std::same_as<double>;
                   { known.law(units) } -> std::same_as<typename M::Law>;
                   { known.fit(units) } -> std::same_as<Fit<typename M::Law>>;
                   { known.snapshot(units) } -> std::same_as<Snapshot<typename M::Law>>;
                 };

// A method may also offer `withdraw(count)`: at most eight of the latest samples were outliers
// after all, and it is to forget them. Those that do not keep them, as they are few. And
// `latest(units)`, where the present answer costs too much to be worked out at each sample: the one
// of a few samples ago, without its errors, against which predict() measures.

}  // namespace palpate
