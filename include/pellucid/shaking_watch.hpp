// Whether the joint goes to and fro for seconds, faster than anybody reaches: a wearer who shakes it, or a drive that
// adds an effort which its measurement does not show.
//
// Without a force sensor both are the same: whatever motion and command are, some torque of the wearer explains them. But
// people who reach rest between two movements. With w the velocity beyond its slow part, so that a reach under the shaking
// hides nothing of it, and w+ and w- its sizes in either direction, the smaller of both mean sizes of late is small in a
// single movement and large in one that reverses; its mean over seconds has a limit:
//
//   w = v - l,   l' = c (v - l),   s+' = a (w+ - s+),   s-' = a (w- - s-),   m' = b (min(s+, s-) - m),   m <= limit
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct ShakingWatchParams {
  S limit = S(std::numeric_limits<S>::infinity()), recent = S(12), memory = S(0.7), slow = S(6);

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.limit, {"shaking_limit", unit::velocity, above(0).or_infinite(),
                    "largest mean speed of an oscillation; infinite: any"});
    visit(p.recent, {"shaking_recent", unit::rate, above(0),
                     "rate of the mean speed in one direction. Times the period below 1"});
    visit(p.memory, {"shaking_memory", unit::rate, above(0),
                     "rate of the mean of the smaller one. Times the period below 1"});
    visit(p.slow, {"shaking_slow", unit::rate, at_least(0),
                   "rate of the slow part of the velocity. Times the period below 1"});
  }
};

/// Coefficients computed once from ShakingWatchParams and the period.
template <class S> struct ShakingWatchCoefficients {
  S limit{};                ///< as it is [rad/s]
  S following{};            ///< share of a new speed in the mean of its direction [1]
  S forgetting{};           ///< share of a new smaller one in the mean [1]
  S slowing{};              ///< share of a new velocity in its slow part [1]
  std::uint32_t valid = 0;  ///< 1: the parameters make sense
};

template <class S> ShakingWatchCoefficients<S> coefficients(const ShakingWatchParams<S>& p, const S& period) noexcept {
  ShakingWatchCoefficients<S> c{p.limit, p.recent * period, p.memory * period, p.slow * period, 0};
  c.valid = is_sound(p) && c.following < S(1) && c.forgetting < S(1) && c.slowing < S(1) ? 1 : 0;
  return c;
}

template <class S> struct ShakingWatchState {
  S forward{};   ///< mean speed of late towards larger positions [rad/s]
  S backward{};  ///< and towards smaller ones [rad/s]
  S mean{};      ///< mean of the smaller of both [rad/s]
  S slow{};      ///< slow part of the velocity [rad/s]
};

/// One period at a velocity.
template <class S>
SafetyFault step(const ShakingWatchCoefficients<S>& c, ShakingWatchState<S>& s, const S& velocity) noexcept {
  s.slow = s.slow + c.slowing * (velocity - s.slow);
  const S quick = velocity - s.slow;
  s.forward = s.forward + c.following * (max(quick, S(0)) - s.forward);
  s.backward = s.backward + c.following * (max(-quick, S(0)) - s.backward);
  s.mean = s.mean + c.forgetting * (min(s.forward, s.backward) - s.mean);
  if (!is_finite(s.forward) || !is_finite(s.backward) || !is_finite(s.mean) || !is_finite(s.slow)) s = {};
  return s.mean <= c.limit ? SafetyFault::none : SafetyFault::shaking;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
