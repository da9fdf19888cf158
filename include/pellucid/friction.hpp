// Friction of a joint and its drive: Coulomb with a Stribeck rise, viscous, as the root of speed, and proportional to
// the load.
//
// The load-dependent part, with one coefficient while power flows from motor to load and another while it flows back,
// goes back to Hamon, Gautier and Garrec, "Dynamic identification of robots with a dry friction model depending on load
// and velocity", IROS 2010; the rise towards rest is Stribeck's in its exponential form, as surveyed by
// Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994. The root of speed stands for lubricants whose
// drag grows ever more slowly, as grease in harmonic drives does.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Friction of a joint. Efforts are N m and velocities rad/s on a rotary joint, N and m/s on a prismatic one.
template <class S> struct FrictionParams {
  S coulomb_positive{}, coulomb_negative{}, viscous_positive{}, viscous_negative{}, stribeck{}, stribeck_velocity{},
      load_motoring{}, load_generating{}, velocity_width{};
  S square_root{};

  /// Visit the coefficients of resistance and the velocity of its rise: all but the width of the sign.
  template <class P, class V> static constexpr void resisting(P& p, V& visit) noexcept {
    visit(p.coulomb_positive, {"coulomb_positive", unit::effort, at_least(0),
                               "F_c+, level while v > 0", by::level.only_one_way()});
    visit(p.coulomb_negative, {"coulomb_negative", unit::effort, at_least(0),
                               "F_c-, level while v < 0", by::level.only_one_way()});
    visit(p.viscous_positive, {"viscous_positive", unit::viscous, at_least(0),
                               "F_v+, slope while v > 0", by::speed.only_one_way()});
    visit(p.viscous_negative, {"viscous_negative", unit::viscous, at_least(0),
                               "F_v-, slope while v < 0", by::speed.only_one_way()});
    visit(p.stribeck, {"stribeck", unit::effort, at_least(0), "F_s, extra level at rest", by::level});
    visit(p.stribeck_velocity, {"stribeck_velocity", unit::velocity, at_least(0),
                                "v_s, where the extra level has fallen to 1/e; below 1e-9: no extra level"});
    visit(p.load_motoring, {"load_motoring", unit::one, between(0, 5),
                            "alpha_m, friction per load while power flows from motor to load",
                            by::load.only_one_way()});
    visit(p.load_generating, {"load_generating", unit::one, between(0, 0.9),
                              "alpha_g, friction per load while the load drives the motor",
                              by::load.only_one_way()});
    visit(p.square_root, {"square_root", unit::root_viscous, at_least(0), "F_r, friction per root of the speed",
                          by::root_of_speed});
  }
  /// Visit the friction of a bearing, the same both ways.
  template <class P, class V> static constexpr void bearing(P& p, V& visit) noexcept {
    both_are(visit, p.coulomb_positive, p.coulomb_negative,
             {"bearing_coulomb", unit::effort, at_least(0), "level of the bearing's friction", by::level});
    both_are(visit, p.viscous_positive, p.viscous_negative,
             {"bearing_viscous", unit::viscous, at_least(0), "slope of the bearing's friction", by::speed});
  }
  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    resisting(p, visit);
    visit(p.velocity_width, {"velocity_width", unit::velocity, at_least(0),
                             "w, of the smooth sign tanh(v / w); below 1e-9: the true sign"});
  }
};

/// Widths and velocities below count as 0, so that no inverse overflows [rad/s].
constexpr double smallest_velocity = 1e-9;

/// Coefficients computed once from FrictionParams.
template <class S> struct FrictionCoefficients {
  S coulomb_positive{};           ///< F_c+ [N m]
  S coulomb_negative{};           ///< F_c- [N m]
  S viscous_positive{};           ///< F_v+ [N m s/rad]
  S viscous_negative{};           ///< F_v- [N m s/rad]
  S stribeck{};                   ///< F_s [N m], 0 without a Stribeck term
  S inverse_stribeck_velocity{};  ///< 1 / v_s [s/rad], 0 without a Stribeck term
  S load_motoring{};              ///< alpha_m [1], at least -0.95
  S load_generating{};            ///< alpha_g [1], at most 0.95
  S square_root{};                ///< F_r [N m (s/rad)^(1/2)]
  S inverse_velocity_width{};     ///< 1 / w [s/rad], 0 for the true sign
  S velocity_width{};             ///< w [rad/s], 0 for the true sign
  mask_t<S> smooth{};             ///< whether the sign is smooth
  bool any_smooth = false;        ///< in some lane
  bool any_stribeck = false;      ///< whether the Stribeck term can be other than 0, in some lane
  bool any_load = false;          ///< whether the load terms can be other than 0, in some lane
  bool any_root = false;          ///< whether the root of speed can be other than 0, in some lane
};

template <class S> FrictionCoefficients<S> coefficients(const FrictionParams<S>& params) noexcept {
  const S smallest = S(smallest_velocity);
  const mask_t<S> has_stribeck = params.stribeck_velocity > smallest;
  FrictionCoefficients<S> c;
  c.coulomb_positive = params.coulomb_positive;
  c.coulomb_negative = params.coulomb_negative;
  c.viscous_positive = params.viscous_positive;
  c.viscous_negative = params.viscous_negative;
  c.stribeck = select(has_stribeck, params.stribeck, S(0));
  c.inverse_stribeck_velocity = select(has_stribeck, S(1) / select(has_stribeck, params.stribeck_velocity, S(1)), S(0));
  c.load_motoring = max(params.load_motoring, S(-0.95));  // keeps 1 + alpha_m and 1 - alpha_g positive
  c.load_generating = min(params.load_generating, S(0.95));
  c.smooth = params.velocity_width > smallest;
  c.inverse_velocity_width = select(c.smooth, S(1) / select(c.smooth, params.velocity_width, S(1)), S(0));
  c.square_root = params.square_root;
  c.velocity_width = select(c.smooth, params.velocity_width, S(0));
  c.any_smooth = any(c.smooth);
  c.any_root = !is_identically_zero(c.square_root);
  c.any_stribeck = any(has_stribeck) && !is_identically_zero(c.stribeck);
  c.any_load = !(is_identically_zero(c.load_motoring) && is_identically_zero(c.load_generating));
  return c;
}

/// The part of the friction that velocity alone decides, at one velocity.
template <class S> struct Resistance {
  S direction{};  ///< s, the (smooth) sign of the velocity [1], -1 to 1
  S effort{};     ///< level(v) s + F_v v + F_r sqrt|v| sign v [N m]
};

/// F_c of the direction s [N m].
template <class S> S coulomb(const FrictionCoefficients<S>& c, const S& direction) noexcept {
  return select(direction < S(0), c.coulomb_negative, c.coulomb_positive);
}
/// F_v of the direction s [N m s/rad].
template <class S> S viscous(const FrictionCoefficients<S>& c, const S& direction) noexcept {
  return select(direction < S(0), c.viscous_negative, c.viscous_positive);
}
/// alpha of the load y in the direction s: alpha_m where y s > 0 and alpha_g elsewhere [1].
template <class S> S load_coefficient(const FrictionCoefficients<S>& c, const S& load, const S& direction) noexcept {
  return select(same_sign(load, direction), c.load_motoring, c.load_generating);
}

/// level(v) = F_c + F_s exp(-(v / v_s)^2) with F_c of the direction s.
template <class S, class R> S level(const FrictionCoefficients<S>& c, const R& velocity, const S& direction) noexcept {
  const S at_speed = coulomb(c, direction);
  if (!c.any_stribeck) return at_speed;
  const S ratio = c.inverse_stribeck_velocity * velocity;
  return at_speed + c.stribeck * exp(-(ratio * ratio));
}

/// sqrt|v| sign v of a speed |v|, or smooth of a speed (v^2 + w^2)^(1/2) [(rad/s)^(1/2)]. Below 1e-18 rad/s, where a
/// root has no slope, it is a line.
template <class S, class R> S signed_root(const R& velocity, const S& speed) noexcept {
  return S(velocity) / sqrt(max(speed, S(static_cast<value_t<S>>(1e-18))));
}

/// The resistance at velocity v while the joint slips, or is about to slip, in the direction s.
template <class S, class R> Resistance<S> resistance(const FrictionCoefficients<S>& c, const R& velocity,
                                                     const S& direction, const S& speed) noexcept {
  const S dry = level(c, velocity, direction) * direction + viscous(c, direction) * velocity;
  return {direction, c.any_root ? dry + c.square_root * signed_root(velocity, speed) : dry};
}
template <class S, class R>
Resistance<S> resistance(const FrictionCoefficients<S>& c, const R& velocity, const S& direction) noexcept {
  return resistance(c, velocity, direction, S(abs(velocity)));
}

/// The resistance at velocity v, with s = tanh(v / w) and the root's speed (v^2 + w^2)^(1/2), or s = sign(v) where w is
/// 0.
template <class S, class R> Resistance<S> resistance(const FrictionCoefficients<S>& c, const R& velocity) noexcept {
  S direction = S(sign(velocity)), speed = S(abs(velocity));
  if (c.any_smooth) {
    const S ratio = c.inverse_velocity_width * velocity;
    // Mostly a joint moves much faster than w, where tanh is 1 to the bit, and its derivative 0.
    const bool all_fast = all(abs(ratio) > S(22));
    if (!all_fast) direction = select(c.smooth, tanh(ratio), direction);
    if (c.any_root) speed = select(c.smooth, sqrt(velocity * velocity + c.velocity_width * c.velocity_width), speed);
  }
  return resistance(c, velocity, direction, speed);
}

/// Friction while the load y passes through the drive: f = level(v) s + F_v v + F_r sqrt|v| sign v + alpha |y| s, with
/// alpha = alpha_m where y v > 0 and alpha_g elsewhere.
template <class S> S friction(const FrictionCoefficients<S>& c, const Resistance<S>& at, const S& load) noexcept {
  if (!c.any_load) return at.effort;
  return at.effort + load_coefficient(c, load, at.direction) * abs(load) * at.direction;
}
template <class S, class R> S friction(const FrictionCoefficients<S>& c, const R& velocity, const S& load) noexcept {
  return friction(c, resistance(c, velocity), load);
}

/// The load y that passes through the drive when the effort T is left after the resistance; the inverse of
/// T = y + alpha |y| s: y = T / (1 + alpha_m |s|) where T s > 0, y = T / (1 - alpha_g |s|) elsewhere.
template <class S>
S transmitted_load(const FrictionCoefficients<S>& c, const Resistance<S>& at, const S& effort) noexcept {
  if (!c.any_load) return effort;
  const S alpha = select(same_sign(effort, at.direction), c.load_motoring, -c.load_generating);
  return effort / (S(1) + alpha * abs(at.direction));
}

/// The next velocity with stiction: 0 where the joint rests, unless it moved and goes on in the same direction.
template <class S> S stick(const mask_t<S>& rests, const S& velocity, const S& next) noexcept {
  return select(both(rests, !same_sign(velocity, next)), S(0), next);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
