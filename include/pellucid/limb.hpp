// A limb's segment about one joint: inertia, gravity, a viscous loss, and the passive tissue at the end of the range.
//
//   J a = effort - m g l sin(q - q_c) - b v + T exp(-(q - q_s) / s)
//
// q = 0 where the segment's own line hangs, positive flexes; its centre of mass lies off that line by q_c, as a foot in
// front of a shank does. The last term is ligaments: T at the stop q_s, steeper the smaller s, nothing well inside.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct LimbParams {
  S inertia{}, gravity{}, centre{}, viscous{}, passive_torque{}, passive_angle{}, passive_scale{};

  template <class P, class V> static constexpr void pendulum(P& p, V& visit) noexcept {
    visit(p.inertia, {"inertia", unit::inertia, above(0), "J about the joint"});
    visit(p.gravity, {"gravity", unit::effort, any_number(), "m g l"});
    visit(p.centre, {"centre", unit::coordinate, any_number(), "q_c, where it hangs by itself"});
    visit(p.viscous, {"viscous", unit::viscous, at_least(0), "b"});
  }
  template <class P, class V> static constexpr void passive(P& p, V& visit) noexcept {
    visit(p.passive_torque, {"passive_torque", unit::effort, at_least(0), "T, of passive tissue at the stop"});
    visit(p.passive_angle, {"passive_angle", unit::coordinate, any_number(), "q_s, the stop"});
    visit(p.passive_scale, {"passive_scale", unit::coordinate, any_number(),
                            "s, over which it falls to 1/e; below 1e-9: no passive torque"});
  }
  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pendulum(p, visit);
    passive(p, visit);
  }
};

/// Coefficients computed once from LimbParams.
template <class S> struct LimbCoefficients {
  S inverse_inertia{};        ///< 1 / J [1/(kg m^2)]
  S gravity{};                ///< m g l [N m]
  S centre{};                 ///< q_c [rad]
  S viscous{};                ///< b [N m s/rad]
  S passive_torque{};         ///< T, 0 where there is none [N m]
  S passive_angle{};          ///< q_s [rad]
  S inverse_passive_scale{};  ///< 1 / s [1/rad]
};

template <class S> LimbCoefficients<S> coefficients(const LimbParams<S>& params) noexcept {
  const mask_t<S> has_passive = params.passive_scale > S(1e-9);
  LimbCoefficients<S> c;
  c.inverse_inertia = S(1) / params.inertia;
  c.gravity = params.gravity;
  c.centre = params.centre;
  c.viscous = params.viscous;
  c.passive_torque = select(has_passive, params.passive_torque, S(0));
  c.passive_angle = params.passive_angle;
  c.inverse_passive_scale = select(has_passive, S(1) / select(has_passive, params.passive_scale, S(1)), S(0));
  return c;
}

/// m g l sin(q - q_c) [N m].
template <class S> S gravity(const LimbCoefficients<S>& c, const S& position) noexcept {
  return c.gravity * sin(position - c.centre);
}

/// Torque of the passive tissue, towards flexion [N m]. Far beyond the stop it grows no further: no bone lets it.
template <class S> S passive_torque(const LimbCoefficients<S>& c, const S& position) noexcept {
  const S depth = (c.passive_angle - position) * c.inverse_passive_scale;
  return c.passive_torque * exp(clamp(depth, S(-80), S(5)));
}

/// Acceleration under an effort [rad/s^2].
template <class S>
S acceleration(const LimbCoefficients<S>& c, const S& position, const S& velocity, const S& effort) noexcept {
  const S net = effort - gravity(c, position) - c.viscous * velocity + passive_torque(c, position);
  return net * c.inverse_inertia;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
