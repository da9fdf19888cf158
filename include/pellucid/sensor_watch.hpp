// Whether an optional sensor, a force sensor or EMG, can be believed by itself: it speaks, is within its range, and
// changes while the joint moves.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct SensorWatchParams {
  std::uint32_t expected = 0, quiet_samples = 50;
  S range = S(std::numeric_limits<S>::infinity());

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.expected, {"expected", unit::one, between(0, 1), "1: the law makes use of it, and it must speak"});
    visit(p.range, {"range", unit::effort, above(0).or_infinite(), "range of valid readings"});
    visit(p.quiet_samples, {"quiet_samples", unit::one, at_least(1),
                            "periods in a row without a word, or without a change while the joint moves, that are a fault"});
  }
};

template <class S> struct SensorWatchState {
  S value{};                ///< the last [N m]
  std::uint32_t quiet = 0;  ///< periods in a row
};

/// Return the fault of a sensor that is checked every `periods` periods, if any: `lost` without a new sample, otherwise
/// `implausible`.
template <class S> SafetyFault step(const SensorWatchParams<S>& p, SensorWatchState<S>& s, const Sample<S>& reading,
                                    bool moves, SafetyFault implausible, std::uint32_t periods) noexcept {
  if (p.expected == 0) return SafetyFault::none;
  const bool heard = is_heard(reading);
  if (heard && !(abs(reading.value) <= p.range)) return implausible;
  const bool quiet = !heard || (moves && reading.value == s.value);
  if (heard) s.value = reading.value;
  s.quiet = quiet ? (s.quiet < 0xffff0000u ? s.quiet + periods : s.quiet) : 0;
  return s.quiet >= p.quiet_samples ? SafetyFault::lost : SafetyFault::none;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
