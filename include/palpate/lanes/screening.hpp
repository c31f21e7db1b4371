// What of a contact an estimator would take, without the estimator: which samples its gate lets in,
// and whether its rejection of outliers would leave one out.
//
// Lanes reject nothing. A contact of which nothing would be rejected goes through them as it would
// through an estimator that rejects.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "palpate/contact_gate.hpp"
#include "palpate/outlier_rejection.hpp"
#include "palpate/sample.hpp"
#include "palpate/trace_columns.hpp"

namespace palpate::lanes {

// Fills `touching` with 1 where a sample is in contact, as long as the recursion takes every such
// sample; how many it took says whether it did. False where a sample would be left out, or where
// that depends on the law by then, which is not known here: `touching` then means nothing.
inline bool screened(const Signals& in, double sample_time, const ContactGate::Settings& of_gate,
                     const std::optional<OutlierRejection::Settings>& of_outliers,
                     std::uint8_t* touching) noexcept {
  ContactGate gate(of_gate);
  OutlierRejection outliers(of_outliers.value_or(OutlierRejection::Settings{}));
  bool asked = false;
  const auto law = [&asked](double, double) noexcept {
    asked = true;
    return 0.0;
  };
  for (std::size_t k = 0; k < in.count; ++k) {
    const Sample sample{in.penetration[k], in.velocity[k], in.force[k]};
    touching[k] = 0;
    if (!palpate::detail::finite(sample)) continue;
    const ContactGate::Phase phase = gate.next(sample.penetration, sample.force);
    const bool touches = phase == ContactGate::Phase::contact;
    if (of_outliers && (outliers.rejects(sample, sample_time, touches, law) || asked)) return false;
    gate.enter(phase);
    touching[k] = touches ? 1 : 0;
  }
  return true;
}

}  // namespace palpate::lanes
