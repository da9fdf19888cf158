// Whether the control task runs at its rate: everything that a law knows of time is its period.
//
// A task at half, double or a quarter of its rate, or called twice a period, turns every filter, observer and limit of rate
// into another. Single intervals jitter; the mean over some hundred does not. So the time that a number of periods took is
// held to what they should have taken, and a slow task is found as soon as it is beyond that.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct RateWatchParams {
  std::uint32_t samples = 0;
  S tolerance = S(0.2);

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.samples, {"rate_samples", unit::one, at_least(0), "number of periods of the mean interval; 0: no check"});
    visit(p.tolerance, {"rate_tolerance", unit::one, share(),
                        "largest relative difference of the mean interval from the period"});
  }
};

/// Coefficients computed once from RateWatchParams and the period.
template <class S> struct RateWatchCoefficients {
  std::uint32_t samples = 0;  ///< as they are
  std::uint32_t least = 0;    ///< shortest time that they may take [us]
  std::uint32_t most = 0;     ///< longest [us]
  std::uint32_t valid = 0;    ///< 1: the parameters make sense
};

template <class S> RateWatchCoefficients<S> coefficients(const RateWatchParams<S>& p, const S& period) noexcept {
  RateWatchCoefficients<S> c;
  const S whole = S(1e6) * period * static_cast<S>(p.samples);
  const bool valid = is_sound(p) && whole >= S(0) && (S(1) + p.tolerance) * whole < S(2e9);
  c.valid = valid ? 1 : 0;
  if (!valid) return c;
  c.samples = p.samples;
  c.least = static_cast<std::uint32_t>((S(1) - p.tolerance) * whole);
  c.most = static_cast<std::uint32_t>((S(1) + p.tolerance) * whole) + 1u;
  return c;
}

struct RateWatchState {
  std::int64_t began = 0;     ///< time of the first step that is judged [us]
  std::uint32_t count = 0;    ///< intervals since then
  std::uint32_t started = 0;  ///< 1: there was a first step
};

/// Return the fault of the step rate at the time `now` [us], if any. A clock that goes backwards is detected elsewhere.
template <class S> SafetyFault step(const RateWatchCoefficients<S>& c, RateWatchState& s, std::int64_t now) noexcept {
  if (c.samples == 0) return SafetyFault::none;
  const std::uint64_t passed = static_cast<std::uint64_t>(now) - static_cast<std::uint64_t>(s.began);
  const bool back = passed > 0x7fffffffffffffffu;
  if (s.started == 0 || back) {
    s = {now, 0, 1};
    return SafetyFault::none;
  }
  ++s.count;
  const bool slow = passed > c.most;
  if (!slow && s.count < c.samples) return SafetyFault::none;
  s = {now, 0, 1};
  return slow || passed < c.least ? SafetyFault::rate : SafetyFault::none;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
