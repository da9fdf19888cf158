// What resists a robot beyond its model, with a force sensor where the wearer is: a disturbance observer.
//
//   d = low-pass of [u - G(q) - f(v)](t - delay) + tau(t) - J a(t)
//
// u is the torque that went out, tau the wearer's on the robot. The sensor's word is late, and so is the acceleration
// of an encoder's filter; what is known at once is held back by as much, so that all three tell of the same moment.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

constexpr std::uint32_t max_observer_delay = 31;  // periods

template <class S> struct DisturbanceObserverParams {
  S share{}, lowpass = S(20), delay{}, limit{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.share, {"disturbance_share", unit::one, Bounds{0, 1, false, true},
                    "fed forward share of d; at 1 a sticking joint is pushed harder and harder"});
    visit(p.lowpass, {"disturbance_lowpass", unit::velocity, above(0).or_infinite(), "low-pass on d"});
    visit(p.delay, {"disturbance_delay", unit::time, any_number(),
                    "delay of sensor and acceleration, from half a period to 31 periods"});
    visit(p.limit, {"disturbance_limit", unit::effort, at_least(0), "limit of the fed forward disturbance"});
  }
};
/// Coefficients computed once from DisturbanceObserverParams and the period.
template <class S> struct DisturbanceObserverCoefficients {
  DisturbanceObserverParams<S> params{};  ///< as they are
  S smoothing{};                     ///< share of a new sample [1]
  std::uint32_t delay = 0;           ///< periods
  bool valid = false;                ///< whether the parameters make sense
};

template <class S>
DisturbanceObserverCoefficients<S> coefficients(const DisturbanceObserverParams<S>& p, const S& period) noexcept {
  DisturbanceObserverCoefficients<S> c;
  c.params = p;
  c.smoothing = S(1) - exp(-p.lowpass * period);
  const S periods = round(p.delay / period);
  c.valid = is_sound(p) && periods >= S(0) && periods <= S(static_cast<value_t<S>>(max_observer_delay));
  if (c.valid) c.delay = static_cast<std::uint32_t>(periods);
  return c;
}

template <class S> struct DisturbanceObserverState {
  S known[max_observer_delay + 1]{};  ///< torque that was left to speed the robot up, in a ring [N m]
  std::uint32_t now = 0;              ///< where the ring is
  std::uint32_t held = 0;             ///< periods in the ring, up to the delay
  S disturbance{};                    ///< d [N m]
};

/// One period: what to feed forward [N m], from the torque left at once, the sensor's and what the acceleration takes.
template <class S>
S step(const DisturbanceObserverCoefficients<S>& c, DisturbanceObserverState<S>& state, const S& left,
       const S& interaction, bool measured, const S& accelerating) noexcept {
  if (!(c.params.share > S(0))) return S(0);
  state.now = (state.now + 1) % (max_observer_delay + 1);
  state.known[state.now] = left;
  const bool full = state.held >= c.delay;
  if (!full) ++state.held;
  const std::uint32_t then = (state.now + max_observer_delay + 1 - c.delay) % (max_observer_delay + 1);
  const S seen = full && measured ? state.known[then] + interaction - accelerating : S(0);
  state.disturbance = state.disturbance + c.smoothing * (seen - state.disturbance);
  if (!is_finite(state.disturbance)) state = {};
  return clamp(c.params.share * state.disturbance, -c.params.limit, c.params.limit);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
