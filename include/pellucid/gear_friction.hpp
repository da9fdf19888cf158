// Friction of a motor and its gear, richer than what is identified: four more terms, each measured on real drives.
//
// The friction of friction.hpp, and: the share of the load that is lost rises towards rest; the Coulomb level swings
// along the travel, as a cable's tension does; the viscous slope declines with speed, as grease shears thin; and below
// slip contacts give, as presliding.hpp says, so that nothing sticks. The load is the torque in a compliant
// transmission, which is a function of the state, so nothing has to be solved.
#pragma once

#include "presliding.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct GearFrictionParams {
  FrictionParams<S> friction{};  ///< the terms that an identified model knows; velocity_width counts for nothing
  S load_rise{}, swing{}, wave_number{}, viscous_decline{};
  PreslidingParams<S> presliding{};  ///< below slip

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    FrictionParams<S>::resisting(p.friction, visit);
    visit(p.load_rise, {"load_rise", unit::one, at_least(0),
                        "rho, load coefficients are 1 + rho exp(-(v / v_s)^2) times themselves"});
    visit(p.swing, {"friction_swing", unit::one, Bounds{0, 1, false, true},
                    "eps, the Coulomb level is 1 + eps sin(n q) times itself"});
    visit(p.wave_number, {"friction_wave_number", unit::wave_number, any_number(),
                          "n, swings of the Coulomb level per angle times 2 pi"});
    visit(p.viscous_decline, {"viscous_decline", unit::velocity, at_least(0),
                              "v_d, where the viscous slope has fallen to a half; below 1e-9: none"});
    pellucid::walk(p.presliding, visit);
  }
};

/// Coefficients computed once from GearFrictionParams.
template <class S> struct GearFrictionCoefficients {
  FrictionCoefficients<S> friction{};  ///< the terms that an identified model knows
  S load_rise{};                       ///< rho [1], 0 without a Stribeck velocity
  S swing{};                           ///< eps [1]
  S wave_number{};                     ///< n [1/rad]
  S inverse_decline{};                 ///< 1 / v_d [s/rad], 0 where the slope does not decline
  mask_t<S> swings{};                  ///< whether the Coulomb level swings
  PreslidingCoefficients<S> presliding{};  ///< below slip
  bool any_rise = false;               ///< whether anything depends on exp(-(v / v_s)^2), in some lane
  bool any_swing = false;              ///< in some lane
  bool any_decline = false;            ///< in some lane
};

template <class S> GearFrictionCoefficients<S> coefficients(const GearFrictionParams<S>& params) noexcept {
  const S smallest = S(smallest_velocity);
  const mask_t<S> has_rise = params.friction.stribeck_velocity > smallest;
  const mask_t<S> has_decline = params.viscous_decline > smallest;
  GearFrictionCoefficients<S> c;
  c.friction = coefficients(params.friction);
  c.load_rise = select(has_rise, params.load_rise, S(0));
  c.swing = params.swing;
  c.wave_number = params.wave_number;
  c.inverse_decline = select(has_decline, S(1) / select(has_decline, params.viscous_decline, S(1)), S(0));
  c.swings = params.swing != S(0);
  c.presliding = coefficients(params.presliding);
  c.any_rise = !(is_identically_zero(c.friction.stribeck) && is_identically_zero(c.load_rise));
  c.any_swing = any(c.swings);
  c.any_decline = any(has_decline);
  return c;
}

/// Factor of the Coulomb level at a position: 1 + eps sin(n q).
template <class S> S coulomb_share(const GearFrictionCoefficients<S>& c, const S& position) noexcept {
  if (!c.any_swing) return S(1);
  return select(c.swings, S(1) + c.swing * sin(c.wave_number * position), S(1));
}

/// exp(-80), as exp() has it.
constexpr double smallest_rise = 1.804851387845415e-35;

/// exp(-(v / v_s)^2): 1 at rest, nothing at speed [1]. From 1e-35 on it falls no further: no sum shows it, and the
/// processor is many times slower where results fall below its normal numbers.
template <class S> S rise(const GearFrictionCoefficients<S>& c, const S& velocity) noexcept {
  if (!c.any_rise) return S(0);
  const S ratio = c.friction.inverse_stribeck_velocity * velocity;
  const S exponent = -(ratio * ratio);
  if (all(exponent <= S(-80))) return S(smallest_rise);  // mostly a joint moves much faster than v_s
  return exp(max(exponent, S(-80)));
}

/// Level of dry friction in the direction s, under a load, `at` being rise(v), 1 at rest [N m]:
/// share F_c + F_s at + alpha (1 + rho at) |load|, alpha_m where load s > 0 and alpha_g elsewhere. Only the sign of s
/// counts.
template <class S>
S level(const GearFrictionCoefficients<S>& c, const S& share, const S& at, const S& load, const S& direction) noexcept {
  const S alpha = select(load * direction > S(0), c.friction.load_motoring, c.friction.load_generating);
  return (coulomb(c.friction, direction) * share + c.friction.stribeck * at) +
         (alpha * (S(1) + c.load_rise * at)) * abs(load);
}

/// Torque that must be exceeded before a motor at rest moves, in the direction of the net torque [N m].
template <class S>
S breakaway(const GearFrictionCoefficients<S>& c, const S& share, const S& load, const S& net_torque) noexcept {
  return level(c, share, S(1), load, net_torque);
}

/// Friction at velocity v in the direction s, which is -1 or 1 while it slips or is about to, and less where contacts
/// are bent: level s + F_v v / (1 + |v| / v_d) + F_r sqrt|v| sign v, F_v that of the sign of v.
template <class S> S friction(const GearFrictionCoefficients<S>& c, const S& share, const S& load, const S& velocity,
                              const S& direction) noexcept {
  S slope_effort = viscous(c.friction, velocity) * velocity;
  if (c.any_decline) slope_effort = slope_effort / (S(1) + abs(velocity) * c.inverse_decline);
  if (c.friction.any_root) slope_effort = slope_effort + c.friction.square_root * signed_root(velocity, abs(velocity));
  return level(c, share, rise(c, velocity), load, direction) * direction + slope_effort;
}

/// Velocity of a motor one substep h on [rad/s]: under the torque `net` while it rests and `effort` at its velocity,
/// both without friction, with contacts bent as they are. After q <- q + dq they have to be told: step(presliding).
template <class S>
S next_velocity(const GearFrictionCoefficients<S>& c, const PreslidingState<S>& contacts, const S& position,
                const S& velocity, const S& net, const S& effort, const S& load, const S& inverse_inertia,
                const S& substep) noexcept {
  const S share = coulomb_share(c, position);
  mask_t<S> rests = abs(net) <= breakaway(c, share, load, net);
  S s = sign(select(velocity == S(0), net, velocity));
  if (c.presliding.any_gives) {
    rests = both(rests, !c.presliding.gives);
    s = select(c.presliding.gives, direction(contacts), s);
  }
  const S slipping = (effort - friction(c, share, load, velocity, s)) * inverse_inertia;
  return stick(rests, velocity, velocity + substep * slipping);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
