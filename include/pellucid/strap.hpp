// The strap between a limb and what is worn on it: a spring and a damper, with slack and slip where there are any.
//
// Pulled tight it is linear both ways, tau = K e + D rate. With slack it carries nothing inside the gap, and on leaving
// a flank it cannot hold back, as no cloth can. It slips, when it does, as skin and cloth creep: at a rate in
// proportion to the torque beyond what it holds. Slip is part of the state, an offset between limb and robot.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct StrapParams {
  S stiffness{}, damping{}, slack{}, hold{}, slip_mobility{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.stiffness, {"strap_stiffness", unit::stiffness, at_least(0),
                        "K of the strap; 0 and no damping: nothing is strapped on"});
    visit(p.damping, {"strap_damping", unit::viscous, at_least(0), "D of the strap"});
    visit(p.slack, {"strap_slack", unit::coordinate, any_number(), "the whole gap; <= 0: none"});
    visit(p.hold, {"strap_hold", unit::effort, any_number(), "torque that it carries without slipping"});
    visit(p.slip_mobility, {"strap_mobility", unit::mobility, at_least(0),
                            "slip rate per torque beyond that; 0: it never creeps"});
  }
};

/// What follows from StrapParams once.
template <class S> struct StrapCoefficients {
  S stiffness{};       ///< K [N m/rad]
  S damping{};         ///< D [N m s/rad]
  S half_slack{};      ///< half the gap, at least 0 [rad]
  mask_t<S> slack{};   ///< whether there is a gap
  S hold{};            ///< [N m]
  S slip_mobility{};   ///< [rad/(N m s)]
  bool creeps = true;  ///< whether it can creep, in some lane
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
  return c;
}

/// Torque on the robot, and against the limb, for a mismatch (limb less robot, less slip) and its rate [N m].
template <class S> S torque(const StrapCoefficients<S>& c, const S& mismatch, const S& rate) noexcept {
  const S stretch = mismatch - clamp(mismatch, -c.half_slack, c.half_slack);
  const S pull = c.stiffness * stretch + c.damping * rate;
  return select(both(c.slack, stretch * pull <= S(0)), S(0), pull);
}

/// How fast the strap slips under a torque [rad/s].
template <class S> S slip_rate(const StrapCoefficients<S>& c, const S& torque) noexcept {
  if (!c.creeps) return S(0);
  return c.slip_mobility * (torque - clamp(torque, -c.hold, c.hold));
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
