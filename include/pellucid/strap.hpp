// The strap between a limb and what is worn on it: a spring and a damper, and how straps differ from those.
//
//   tau  = K e (1 + (e / e_h)^2 / 3) + K_m (e - x) + D rate,      dx/dt = (e - x) / T_m
//   e    = mismatch beyond the gap,    mismatch = q_limb - a(q_robot) - slip
//   a(q) = q + along (sin q - sin q_0) - across (cos q - cos q_0)
//
// It hardens, as skin and cloth do: at e_h its tangent stiffness has doubled. A branch of spring and dashpot relaxes, so
// that K is what is left in the end, and K + K_m what fast motions meet. With slack it carries nothing inside the gap,
// and on leaving a flank it cannot hold back, as no cloth can; pulled tight it works both ways. It slips, when it does,
// as skin and cloth creep: at a rate in proportion to the torque beyond what it holds. It sits askew where the limb
// turns about another point than the robot: a(q) is where the limb then goes through the cuff, to first order in the
// offset over the cuff's lever, and the robot feels tau a'(q). One potential of both angles stands behind all of it, so
// that a strap gives back at most what it was given (while mobility times damping is below 1).
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct StrapParams {
  S stiffness{}, damping{}, slack{}, hold{}, slip_mobility{};
  S hardening{};                             ///< e_h
  S relaxing_stiffness{}, relaxation_time{}; ///< K_m, T_m
  S across{}, along{}, fitted{};             ///< and q_0

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.stiffness, {"strap_stiffness", unit::stiffness, at_least(0),
                        "K of the strap, at no stretch and in the end; 0, undamped and nothing relaxing: none is worn"});
    visit(p.damping, {"strap_damping", unit::viscous, at_least(0), "D of the strap"});
    visit(p.slack, {"strap_slack", unit::coordinate, any_number(), "the whole gap; <= 0: none"});
    visit(p.hold, {"strap_hold", unit::effort, any_number(), "torque that it carries without slipping"});
    visit(p.slip_mobility, {"strap_mobility", unit::mobility, at_least(0),
                            "slip rate per torque beyond that; 0: it never creeps"});
    visit(p.hardening, {"strap_hardening", unit::coordinate, any_number(),
                        "e_h, stretch at which its tangent stiffness has doubled; <= 0: it never hardens"});
    visit(p.relaxing_stiffness, {"strap_relaxing_stiffness", unit::stiffness, at_least(0),
                                 "K_m, stiffness that is added to K at first and relaxes; 0: none"});
    visit(p.relaxation_time, {"strap_relaxation_time", unit::time, at_least(0),
                              "T_m, over which a held stretch loses that"});
    visit(p.across, {"strap_across", unit::one, between(-0.5, 0.5),
                     "how far the limb's axis lies towards positive angles of a hanging segment, over the cuff's lever"});
    visit(p.along, {"strap_along", unit::one, between(-0.5, 0.5),
                    "how far the limb's axis lies towards the cuff of a hanging segment, over the cuff's lever"});
    visit(p.fitted, {"strap_fitted", unit::coordinate, any_number(),
                     "q_0, angle of the robot at which an askew strap was put on"});
  }
};

/// Coefficients computed once from StrapParams.
template <class S> struct StrapCoefficients {
  S stiffness{};           ///< K [N m/rad]
  S damping{};             ///< D [N m s/rad]
  S half_slack{};          ///< half the gap, at least 0 [rad]
  mask_t<S> slack{};       ///< whether there is a gap
  S hold{};                ///< [N m]
  S slip_mobility{};       ///< [rad/(N m s)]
  S cubic{};               ///< 1 / (3 e_h^2) [1/rad^2]
  S relaxing_stiffness{};  ///< K_m [N m/rad]
  S relaxation_time{};     ///< T_m, at least 0 [s]
  S across{};              ///< place of the limb's axis across the cuff, over the cuff's lever [1]
  S along{};               ///< the same [1]
  S fitted{};              ///< along sin q_0 - across cos q_0 [rad]
  bool creeps = false;     ///< whether it can creep, in some lane
  bool hardens = false;    ///< whether it hardens, in some lane
  bool relaxes = false;    ///< whether something relaxes, in some lane
  bool askew = false;      ///< whether it sits askew, in some lane
};

template <class S> StrapCoefficients<S> coefficients(const StrapParams<S>& params) noexcept {
  StrapCoefficients<S> c;
  c.stiffness = params.stiffness;
  c.damping = params.damping;
  c.half_slack = max(S(0.5) * params.slack, S(0));
  c.slack = params.slack > S(0);
  c.hold = abs(params.hold);
  c.slip_mobility = params.slip_mobility;
  c.creeps = !is_identically_zero(params.slip_mobility);
  const mask_t<S> hardens = params.hardening > S(0);
  const S doubled = select(hardens, params.hardening, S(1));
  c.cubic = select(hardens, S(1) / (S(3) * doubled * doubled), S(0));
  c.hardens = any(hardens);
  c.relaxing_stiffness = params.relaxing_stiffness;
  c.relaxation_time = max(params.relaxation_time, S(0));
  c.relaxes = !is_identically_zero(params.relaxing_stiffness);
  c.across = params.across;
  c.along = params.along;
  c.askew = !(is_identically_zero(params.across) && is_identically_zero(params.along));
  if (c.askew) c.fitted = c.along * sin(params.fitted) - c.across * cos(params.fitted);
  return c;
}

/// State of a strap.
template <class S> struct StrapState {
  S slip{};  ///< angle by which the limb has slipped in the strap [rad]
  S flow{};  ///< x, what its dashpot has given [rad]
};

/// Angle at which a limb passes through the cuff, and its derivative with respect to the robot's angle.
template <class S> struct StrapAlignment {
  S limb{};        ///< a(q) [rad]
  S lever = S(1);  ///< a'(q) [1]
};

template <class S> StrapAlignment<S> alignment(const StrapCoefficients<S>& c, const S& robot) noexcept {
  if (!c.askew) return {robot, S(1)};
  const SinCos<S> at = sincos(robot);
  return {robot + (c.along * at.sin - c.across * at.cos - c.fitted), S(1) + c.along * at.cos + c.across * at.sin};
}

/// Return the robot's angle at which a limb at an angle passes through the cuff [rad].
template <class S> S robot_at(const StrapCoefficients<S>& c, const S& limb) noexcept {
  S robot = limb;
  if (!c.askew) return robot;
  for (int i = 0; i < 40; ++i) robot = robot - (alignment(c, robot).limb - limb);
  return robot;
}

/// Part of a mismatch beyond the gap [rad].
template <class S> S stretch(const StrapCoefficients<S>& c, const S& mismatch) noexcept {
  return mismatch - clamp(mismatch, -c.half_slack, c.half_slack);
}

/// Torque of the spring that stays, at a stretch [N m].
template <class S> S lasting_torque(const StrapCoefficients<S>& c, const S& stretch) noexcept {
  const S linear = c.stiffness * stretch;
  return c.hardens ? linear * (S(1) + c.cubic * (stretch * stretch)) : linear;
}

/// Its stiffness there: the tangent [N m/rad].
template <class S> S lasting_stiffness(const StrapCoefficients<S>& c, const S& stretch) noexcept {
  return c.hardens ? c.stiffness * (S(1) + S(3) * (c.cubic * (stretch * stretch))) : c.stiffness;
}

/// Stretch at which a strap in the end carries a torque; 0 where nothing is strapped on [rad].
template <class S> S stretch_under(const StrapCoefficients<S>& c, const S& torque) noexcept {
  const mask_t<S> strapped = c.stiffness > S(0);
  const S linear = torque / select(strapped, c.stiffness, S(1));
  S e = linear;
  // Newton's steps from beyond the root of a convex function stay beyond it; far out each takes a third off.
  for (int i = 0; c.hardens && i < 60; ++i) {
    const S square = c.cubic * (e * e);
    e = e - (e * (S(1) + square) - linear) / (S(1) + S(3) * square);
  }
  return select(strapped, e, S(0));
}

/// Torque against the limb, for a mismatch, its rate, and what the dashpot has given [N m].
template <class S>
S torque(const StrapCoefficients<S>& c, const S& mismatch, const S& rate, const S& flow = S(0)) noexcept {
  const S e = stretch(c, mismatch);
  S pull = lasting_torque(c, e) + c.damping * rate;
  if (c.relaxes) pull = pull + c.relaxing_stiffness * (e - flow);
  return select(both(c.slack, e * pull <= S(0)), S(0), pull);
}

/// Return the velocity at which the strap slips under a torque [rad/s].
template <class S> S slip_rate(const StrapCoefficients<S>& c, const S& torque) noexcept {
  if (!c.creeps) return S(0);
  return c.slip_mobility * (torque - clamp(torque, -c.hold, c.hold));
}

/// Torques of a strap at one moment.
template <class S> struct StrapPull {
  S limb{};      ///< against the limb [N m]
  S robot{};     ///< on the robot [N m]
  S mismatch{};  ///< limb less where it would go through the cuff, less slip [rad]
};

/// Torques of a strap on robot and limb, at positions [rad] and velocities [rad/s].
template <class S> StrapPull<S> pull(const StrapCoefficients<S>& c, const StrapState<S>& state, const S& robot_position,
                                     const S& robot_velocity, const S& limb_position, const S& limb_velocity) noexcept {
  const StrapAlignment<S> at = alignment(c, robot_position);
  const S mismatch = limb_position - at.limb - state.slip;
  const S turning = c.askew ? at.lever * robot_velocity : robot_velocity;
  const S limb = torque(c, mismatch, limb_velocity - turning, state.flow);
  return {limb, c.askew ? at.lever * limb : limb, mismatch};
}

/// A strap some time [s] later, under what it did at its beginning.
template <class S> void advance(const StrapCoefficients<S>& c, StrapState<S>& state, const StrapPull<S>& pull,
                                const S& time) noexcept {
  state.slip = state.slip + time * slip_rate(c, pull.limb);
  // Implicit in what it gives: stable however short the relaxation is.
  if (c.relaxes)
    state.flow = state.flow + (stretch(c, pull.mismatch) - state.flow) * (time / (c.relaxation_time + time));
}

/// A strap that has settled with a stretch [rad].
template <class S> StrapState<S> settled(const StrapCoefficients<S>& c, const S& stretch) noexcept {
  return {S(0), c.relaxes ? stretch : S(0)};
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
