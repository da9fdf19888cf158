// A joint's muscles as they hold a posture or follow a motion: what was learnt, what muscles give, and a late reflex.
//
//   tau = u + K e + D de/dt + K_r e(t - T) + D_r de/dt(t - T),   e = q_wanted - q
// u is what a person has learnt to give for the motion; muscles resist at once, reflexes after the delay T. Limited by
// what the muscles can. Errors are kept at the start of control periods.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// The longest delay of a reflex [periods]; a power of two.
constexpr std::uint32_t reflex_periods = 256;

template <class S> struct PostureServoParams {
  S stiffness{}, damping{}, reflex_stiffness{}, reflex_damping{}, strength{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.stiffness, {"stiffness", unit::stiffness, at_least(0), "K, of muscles that are tense"});
    visit(p.damping, {"damping", unit::viscous, at_least(0), "D"});
    visit(p.reflex_stiffness, {"reflex_stiffness", unit::stiffness, at_least(0), "K_r, of the late part"});
    visit(p.reflex_damping, {"reflex_damping", unit::viscous, at_least(0), "D_r"});
    visit(p.strength, {"strength", unit::effort, at_least(0), "largest torque either way; 0: no limit"});
  }
};

/// State of a servo: errors of the last periods.
template <class S> struct PostureServoState {
  S error[reflex_periods]{};  ///< e, a ring [rad]
  S rate[reflex_periods]{};   ///< de/dt [rad/s]
};

/// The reflex's torque in the period that begins with an error; keeps the error. `now` counts periods.
template <class S> S reflex(const PostureServoParams<S>& p, PostureServoState<S>& state, std::uint32_t now,
                            std::uint32_t delay, const S& error, const S& rate) noexcept {
  constexpr std::uint32_t wrap = reflex_periods - 1;
  state.error[now & wrap] = error;
  state.rate[now & wrap] = rate;
  const std::uint32_t then = (now - (delay < wrap ? delay : wrap)) & wrap;
  return p.reflex_stiffness * state.error[then] + p.reflex_damping * state.rate[then];
}

/// The torque of all [N m].
template <class S> S muscle_torque(const PostureServoParams<S>& p, const S& learnt_and_late, const S& error,
                                   const S& rate) noexcept {
  const S wanted = learnt_and_late + p.stiffness * error + p.damping * rate;
  return select(p.strength > S(0), clamp(wanted, -p.strength, p.strength), wanted);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
