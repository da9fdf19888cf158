// One joint: inertia, gravity, friction. The same equations both ways, without iteration.
//
// y = J a + g_s sin q + g_c cos q + k q is the load that passes through the drive; the effort is
// y + friction(v, y) + offset. q = 0 hangs along gravity and positive q lifts. k is a spring beside the drive, such as a
// cable, a hose or a balancing spring; where it is slack is in the offset. A prismatic joint is the same with
// g_s = g_c = 0 and N, kg, m.
#pragma once

#include "friction.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Identified parameters of a joint.
template <class S> struct JointParams {
  S inertia{}, gravity_sine{}, gravity_cosine{}, offset{};
  FrictionParams<S> friction{};  ///< friction of joint and drive
  S parallel_stiffness{};        ///< k of a spring beside the drive [N m/rad]; below 0 it pushes from its middle

  template <class P, class V> static constexpr void weight(P& p, V& visit) noexcept {
    visit(p.gravity_sine, {"gravity_sine", unit::effort, any_number(), "g_s, gravity effort per sin q"});
    visit(p.gravity_cosine, {"gravity_cosine", unit::effort, any_number(), "g_c, gravity effort per cos q"});
  }
  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.inertia, {"inertia", unit::inertia, at_least(0), "J, all that turns, at the joint"});
    weight(p, visit);
    visit(p.offset, {"offset", unit::effort, any_number(), "effort that is always there"});
    pellucid::walk(p.friction, visit);
    visit(p.parallel_stiffness, {"parallel_stiffness", unit::stiffness, any_number(),
                                 "k, stiffness of a spring in parallel to the drive"});
  }
};

/// Number of parameters of a joint.
constexpr std::size_t parameter_count = field_count<JointParams<double>>;

/// Coefficients computed once from JointParams.
template <class S> struct JointCoefficients {
  S inertia{};                         ///< J [kg m^2]
  S inverse_inertia{};                 ///< 1 / J [1/(kg m^2)]
  S gravity_sine{};                    ///< g_s [N m]
  S gravity_cosine{};                  ///< g_c [N m]
  S offset{};                          ///< [N m]
  FrictionCoefficients<S> friction{};  ///< friction of joint and drive
  S parallel_stiffness{};              ///< k [N m/rad]
  bool any_gravity = false;            ///< whether gravity can be other than 0, in some lane
  bool any_gravity_cosine = false;     ///< whether gravity can be other than 0 at q = 0, in some lane
  bool any_parallel_stiffness = false;          ///< whether there is a spring beside the drive, in some lane
};

template <class S> JointCoefficients<S> coefficients(const JointParams<S>& params) noexcept {
  JointCoefficients<S> c;
  c.inertia = params.inertia;
  c.inverse_inertia = S(1) / params.inertia;
  c.gravity_sine = params.gravity_sine;
  c.gravity_cosine = params.gravity_cosine;
  c.offset = params.offset;
  c.friction = coefficients(params.friction);
  c.parallel_stiffness = params.parallel_stiffness;
  c.any_parallel_stiffness = !is_identically_zero(params.parallel_stiffness);
  c.any_gravity_cosine = !is_identically_zero(params.gravity_cosine);
  c.any_gravity = c.any_gravity_cosine || !is_identically_zero(params.gravity_sine);
  return c;
}

/// Effort of the place alone: gravity's and the spring's, g_s sin q + g_c cos q + k q [N m].
template <class S, class R> S gravity(const JointCoefficients<S>& c, const R& position) noexcept {
  S effort = S(0);
  if (c.any_gravity_cosine) {
    const SinCos<R> at = sincos(position);
    effort = c.gravity_sine * at.sin + c.gravity_cosine * at.cos;
  } else if (c.any_gravity) {
    effort = c.gravity_sine * sin(position);
  }
  if (c.any_parallel_stiffness) effort = effort + c.parallel_stiffness * position;
  return effort;
}

/// Load y = J a + g_s sin q + g_c cos q + k q [N m].
template <class S, class R> S load(const JointCoefficients<S>& c, const R& position, const R& acceleration) noexcept {
  return c.inertia * acceleration + gravity(c, position);
}

/// Effort that moves the joint so: y + friction(v, y) + offset [N m].
template <class S, class R> S inverse_dynamics(const JointCoefficients<S>& c, const R& position, const R& velocity,
                                               const R& acceleration) noexcept {
  const S y = load(c, position, acceleration);
  return y + friction(c.friction, velocity, y) + c.offset;
}

/// Acceleration under gravity and an effort, given what friction resists [rad/s^2].
template <class S>
S acceleration(const JointCoefficients<S>& c, const S& gravity, const Resistance<S>& at, const S& effort) noexcept {
  return (transmitted_load(c.friction, at, effort - c.offset - at.effort) - gravity) * c.inverse_inertia;
}

/// Acceleration that an effort gives; the inverse of inverse_dynamics in its last argument [rad/s^2].
template <class S, class R, class E>
S forward_dynamics(const JointCoefficients<S>& c, const R& position, const R& velocity, const E& effort) noexcept {
  return acceleration(c, gravity(c, position), resistance(c.friction, velocity), S(effort));
}

/// Effort that must be exceeded before a joint at rest moves, by |effort - offset - gravity|:
/// F_c of the direction of the net effort + F_s + alpha |gravity| [N m].
template <class S> S breakaway(const JointCoefficients<S>& c, const S& gravity, const S& net_effort) noexcept {
  const S level = coulomb(c.friction, net_effort) + c.friction.stribeck;
  if (!c.friction.any_load) return level;
  return level + load_coefficient(c.friction, gravity, net_effort) * abs(gravity);
}

/// Acceleration with true stiction under an effort [rad/s^2], 0 at rest; `effort_at_rest` is what the effort would be
/// at v = 0, and `rests` becomes true where that holds the joint there.
template <class S> S acceleration(const JointCoefficients<S>& c, const S& gravity, const S& velocity, const S& effort,
                                  const S& effort_at_rest, mask_t<S>& rests) noexcept {
  const S net = effort_at_rest - c.offset - gravity;
  rests = abs(net) <= breakaway(c, gravity, net);
  const S direction = sign(select(velocity == S(0), net, velocity));
  const S slipping = acceleration(c, gravity, resistance(c.friction, velocity, direction), effort);
  return select(both(rests, velocity == S(0)), S(0), slipping);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
