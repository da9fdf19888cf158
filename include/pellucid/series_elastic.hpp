// A motor behind a spring: a body of its own between a drive's effort and what it moves.
//
//   J_m dv_m = u - tau - friction(v_m, J_m dv_m + tau),   tau = K (q_m - q) + D (v_m - v) while flanks touch
// Where there is no spring, or no motor's inertia, the effort passes as it is. One substep of semi-implicit Euler with
// true stiction; it must resolve the spring: h sqrt(K / J_m) below about 1.
#pragma once

#include "joint.hpp"
#include "transmission.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct SeriesElasticParams {
  S motor_inertia{};
  FrictionParams<S> friction{};          ///< friction of motor and gear
  TransmissionParams<S> transmission{};  ///< behind them

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.motor_inertia, {"motor_inertia", unit::inertia, at_least(0), "J_m, motor and gear; 0: no spring"});
    FrictionParams<S>::resisting(p.friction, visit);
    pellucid::walk(p.transmission, visit);
  }
};

/// Coefficients computed once from SeriesElasticParams.
template <class S> struct SeriesElasticCoefficients {
  JointCoefficients<S> motor{};                ///< a joint on which the spring acts as a weight
  TransmissionCoefficients<S> transmission{};  ///< behind it
  mask_t<S> gives{};                           ///< whether there is a spring
  bool any_gives = false;                      ///< in some lane
};

template <class S> SeriesElasticCoefficients<S> coefficients(const SeriesElasticParams<S>& params) noexcept {
  SeriesElasticCoefficients<S> c;
  c.gives = both(params.motor_inertia > S(0), params.transmission.stiffness > S(0));
  c.any_gives = any(c.gives);
  SeriesElasticParams<S> sound = params;
  sound.motor_inertia = select(c.gives, params.motor_inertia, S(1));
  sound.transmission.stiffness = select(c.gives, params.transmission.stiffness, S(1));
  JointParams<S> motor;
  motor.inertia = sound.motor_inertia;
  motor.friction = sound.friction;
  c.motor = coefficients(motor);
  c.transmission = coefficients(sound.transmission);
  return c;
}

template <class S> struct SeriesElasticState {
  S position{};  ///< q_m [rad]
  S velocity{};  ///< v_m [rad/s]
};

/// At rest behind a spring that carries a torque.
template <class S> SeriesElasticState<S> balanced(const SeriesElasticCoefficients<S>& c, const S& position,
                                                  const S& velocity, const S& torque) noexcept {
  return {position + select(c.gives, twist(c.transmission, torque), S(0)), velocity};
}

/// One substep h under a drive's effort; gives what reaches the other side, which is at q and moves at v [N m].
template <class S> S step(const SeriesElasticCoefficients<S>& c, SeriesElasticState<S>& state, const S& h,
                          const S& effort, const S& position, const S& velocity) noexcept {
  const S carried = torque(c.transmission, state.position - position, state.velocity - velocity);
  mask_t<S> rests{};
  const S slipping = acceleration(c.motor, carried, state.velocity, effort, effort, rests);
  state.velocity = select(c.gives, stick(rests, state.velocity, state.velocity + h * slipping), velocity);
  state.position = select(c.gives, state.position + h * state.velocity, position);
  return select(c.gives, carried, effort);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
