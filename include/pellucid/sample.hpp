// One sensor's reading as it reaches a controller, with what it takes to tell whether it may still be believed.
#pragma once

#include "safety.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct Sample {
  S value{};                   ///< in the sensor's SI unit
  std::int64_t time = 0;       ///< when it was measured [us]
  std::uint32_t sequence = 0;  ///< its number; may wrap around
  bool valid = false;          ///< false: the sensor itself says that this is no measurement
};

/// What makes a sample too old.
struct SampleRules {
  std::int64_t max_age = 0;       ///< between measurement and use, and between two samples [us]
  std::uint32_t max_repeats = 0;  ///< how often one sample may be seen again
};

/// The rules of a gate, for every sensor of its controller.
template <class S> SampleRules sample_rules(const SafetyCoefficients<S>& gate) noexcept {
  return {gate.max_gap, gate.params.max_repeats};
}

/// What is remembered of one sensor.
struct SampleState {
  std::int64_t time = 0;       ///< of the last new sample [us]
  std::uint32_t sequence = 0;  ///< of the last new sample
  std::uint32_t repeats = 0;   ///< of it so far
  bool started = false;        ///< false until the first sample
};

/// What is wrong with this sample, if anything, seen at the time `now` [us] of its own clock. Also takes note of it.
template <class S>
SafetyFault examine(const SampleRules& rules, SampleState& state, const Sample<S>& sample, std::int64_t now) noexcept {
  if (!(sample.valid && is_finite(sample.value))) return SafetyFault::not_finite;
  const auto limit = static_cast<std::uint64_t>(rules.max_age);
  // Unsigned differences cannot overflow; more than half their range is a step back, or a sample from the future.
  constexpr std::uint64_t half = 0x7fffffffffffffffu;
  const std::uint64_t age = static_cast<std::uint64_t>(now) - static_cast<std::uint64_t>(sample.time);
  const std::uint64_t gap = static_cast<std::uint64_t>(sample.time) - static_cast<std::uint64_t>(state.time);
  const std::uint32_t ahead = sample.sequence - state.sequence;
  if (age > half) return SafetyFault::out_of_order;
  if (age > limit) return SafetyFault::stale;
  if (state.started) {
    if (ahead > 0x7fffffffu || gap > half) return SafetyFault::out_of_order;
    if (ahead == 0 || gap == 0) {
      if (state.repeats < 0xffffffffu) ++state.repeats;
      return state.repeats > rules.max_repeats ? SafetyFault::stale : SafetyFault::none;
    }
    if (gap > limit) return SafetyFault::stale;
  }
  state = {sample.time, sample.sequence, 0, true};
  return SafetyFault::none;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
