// Where a limb must be for its strap to pull at a robot as was measured: the strap's equation, solved for the stretch.
//
//   tau(e, de/dt, x) + F z = tau_robot / a'(q),      q_limb = a(q) + slip + e + s + half the gap, on the
//   s = s_0 arsinh(tau_robot / (a'(q) tau_0))        flank that pulls
//   z moves by de / w and stays within -1 and 1
//
// Cloth that rubs on itself or on the limb carries up to F beside the spring: it bends over the way w before it slips
// (an elastic-plastic element). Soft tissue in series is compressed by s: its force grows exponentially, as that of
// cuffs on limbs does.
//
// A strap's torque is better known than its stretch: encoders tell it, an inertial sensor the limb. Backward differences
// of second order, Newton's steps on e. In the gap no torque tells where the limb is; it is then said to be on the flank
// that pulled last, unstretched, and whoever compares leaves that out.
#pragma once

#include "strap.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Soft tissue between strap and limb, and friction in parallel with the strap.
template <class S> struct StrapContactParams {
  S friction{}, friction_way{}, tissue_depth{}, tissue_torque{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.friction, {"strap_friction", unit::effort, at_least(0), "F, dry friction in parallel with the spring"});
    visit(p.friction_way, {"strap_friction_way", unit::coordinate, at_least(0),
                           "w, way over which cloth bends from its middle before it slips; 0: none"});
    visit(p.tissue_depth, {"strap_tissue_depth", unit::coordinate, at_least(0),
                           "s_0, by which soft tissue in series gives more where the torque grows e-fold; 0: none"});
    visit(p.tissue_torque, {"strap_tissue_torque", unit::effort, at_least(0),
                            "tau_0, torque up to which that tissue is a linear spring of tau_0 / s_0"});
  }
};

/// Return the compression of the soft tissue in series under a torque on the limb [rad].
template <class S> S compression(const StrapContactParams<S>& contact, const S& torque) noexcept {
  const mask_t<S> soft = both(contact.tissue_depth > S(0), contact.tissue_torque > S(0));
  const S share = abs(torque) / select(soft, contact.tissue_torque, S(1));
  const S way = contact.tissue_depth * log(share + sqrt(share * share + S(1)));
  return select(soft, select(torque < S(0), S(0) - way, way), S(0));
}

/// State of a response: stretch and flow of the dashpot, now and one step ago, slip, the flank that pulls, and the
/// deflection of the rubbing cloth.
template <class S> struct StrapResponseState {
  S stretch{}, stretch_before{};  ///< e [rad]
  S flow{}, flow_before{};        ///< x [rad]
  S slip{};                       ///< angle by which the limb has slipped [rad]
  S flank{};                      ///< -1, 0 or 1
  S bend{};                       ///< z, share of the friction that the bent cloth carries, -1 to 1
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
/// where there is a gap. Dry friction beside the spring [N m] builds up while the stretch changes by a way [rad].
template <class S> void respond(const StrapCoefficients<S>& c, StrapResponseState<S>& state, const S& robot,
                                const S& torque_on_robot, const S& still, const S& time, const S& friction = S(0),
                                const S& friction_way = S(0)) noexcept {
  StrapCoefficients<S> tight = c;
  tight.half_slack = S(0);
  tight.slack = S(0) > S(0);
  const S given = limb_torque(c, robot, torque_on_robot);
  const S carried = S(4) * state.stretch - state.stretch_before;
  const S flowed = c.relaxation_time * (S(4) * state.flow - state.flow_before);
  const S scale = S(1) / (S(3) * c.relaxation_time + S(2) * time);
  const S twice = S(2) * time;
  S e = state.stretch, x{};
  // A way of 0 is so short that friction changes its sign at once.
  const S way = max(friction_way, S(1e-6));
  for (int i = 0; i < 8; ++i) {
    x = (flowed + twice * e) * scale;
    const S rate = (S(3) * e - carried) / twice;
    const S bent = state.bend + (e - state.stretch) / way;
    const S excess = torque(tight, e, rate, x) + friction * clamp(bent, S(-1), S(1)) - given;
    // Cloth that is about to slip still bends if the stretch turns back.
    const mask_t<S> bends = both(abs(bent) <= S(1), !both(abs(bent) >= S(1), bent * excess < S(0)));
    const S slope = lasting_stiffness(c, e) + S(3) * c.damping / twice + c.relaxing_stiffness * (S(1) - twice * scale) +
                    select(bends, friction / way, S(0));
    const mask_t<S> strapped = slope > S(0);
    const S step = select(strapped, excess / select(strapped, slope, S(1)), S(0));
    e = e - step;
    if (i > 0 && all(abs(step) <= S(1e-12))) break;
  }
  // Nothing is stretched while nothing pulls.
  const mask_t<S> loose = both(c.slack, abs(given) <= still);
  e = select(loose, S(0), e);
  x = c.relaxes ? (flowed + twice * e) * scale : S(0);
  state.flank = select(loose, state.flank, select(given > S(0), S(1), select(given < S(0), S(-1), state.flank)));
  state.slip = state.slip + time * slip_rate(c, given);
  state.bend = clamp(state.bend + (e - state.stretch) / way, S(-1), S(1));
  state.stretch_before = state.stretch;
  state.stretch = e;
  state.flow_before = state.flow;
  state.flow = x;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
