// Where a limb must be for its strap to pull at a robot as was measured: the strap's equation, solved for the stretch.
//
//   tau(e, de/dt, x) = tau_robot / a'(q),      q_limb = a(q) + slip + e + half the gap, on the flank that pulls
//
// A strap's torque is better known than its stretch: encoders tell it, an inertial sensor the limb. Backward differences
// of second order, Newton's steps on e. In the gap no torque tells where the limb is; it is then said to be on the flank
// that pulled last, unstretched, and whoever compares leaves that out.
#pragma once

#include "strap.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// What a response remembers: stretch and what the dashpot has given, now and a step ago, slip, and which flank pulled.
template <class S> struct StrapResponseState {
  S stretch{}, stretch_before{};  ///< e [rad]
  S flow{}, flow_before{};        ///< x [rad]
  S slip{};                       ///< angle by which the limb has slipped [rad]
  S flank{};                      ///< -1, 0 or 1
};

/// Torque of a strap against the limb, from the one on the robot [N m], which is at an angle [rad].
template <class S> S limb_torque(const StrapCoefficients<S>& c, const S& robot, const S& torque_on_robot) noexcept {
  return torque_on_robot / alignment(c, robot).lever;
}

/// A strap that has settled under a torque on the robot [N m], which is at an angle [rad].
template <class S>
StrapResponseState<S> settled_under(const StrapCoefficients<S>& c, const S& robot, const S& torque) noexcept {
  StrapResponseState<S> state;
  const S pull = limb_torque(c, robot, torque);
  state.stretch = stretch_under(c, pull);
  state.stretch_before = state.stretch;
  state.flow = c.relaxes ? state.stretch : S(0);
  state.flow_before = state.flow;
  state.flank = select(pull > S(0), S(1), select(pull < S(0), S(-1), S(0)));
  return state;
}

/// The limb's angle now [rad].
template <class S>
S limb_position(const StrapCoefficients<S>& c, const StrapResponseState<S>& state, const S& robot) noexcept {
  return alignment(c, robot).limb + state.slip + (state.flank * c.half_slack + state.stretch);
}

/// A time [s] later, under a torque on the robot [N m] at an angle [rad]; a torque that is `still`, or smaller, is none
/// where there is a gap.
template <class S> void respond(const StrapCoefficients<S>& c, StrapResponseState<S>& state, const S& robot,
                                const S& torque_on_robot, const S& still, const S& time) noexcept {
  StrapCoefficients<S> tight = c;
  tight.half_slack = S(0);
  tight.slack = S(0) > S(0);
  const S wanted = limb_torque(c, robot, torque_on_robot);
  const S carried = S(4) * state.stretch - state.stretch_before;
  const S flowed = c.relaxation_time * (S(4) * state.flow - state.flow_before);
  const S scale = S(1) / (S(3) * c.relaxation_time + S(2) * time);
  const S twice = S(2) * time;
  S e = state.stretch, x{};
  for (int i = 0; i < 8; ++i) {
    x = (flowed + twice * e) * scale;
    const S rate = (S(3) * e - carried) / twice;
    const S excess = torque(tight, e, rate, x) - wanted;
    const S slope =
        lasting_stiffness(c, e) + S(3) * c.damping / twice + c.relaxing_stiffness * (S(1) - twice * scale);
    const mask_t<S> strapped = slope > S(0);
    const S step = select(strapped, excess / select(strapped, slope, S(1)), S(0));
    e = e - step;
    if (i > 0 && all(abs(step) <= S(1e-12))) break;
  }
  // Nothing is stretched while nothing pulls.
  const mask_t<S> loose = both(c.slack, abs(wanted) <= still);
  e = select(loose, S(0), e);
  x = c.relaxes ? (flowed + twice * e) * scale : S(0);
  state.flank = select(loose, state.flank, select(wanted > S(0), S(1), select(wanted < S(0), S(-1), state.flank)));
  state.slip = state.slip + time * slip_rate(c, wanted);
  state.stretch_before = state.stretch;
  state.stretch = e;
  state.flow_before = state.flow;
  state.flow = x;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
