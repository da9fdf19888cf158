// A series-elastic orthosis strapped to a limb: three bodies under the actuator's own torque loop.
//
//   motor     J_m dv_m = u - tau_s - friction(q_m, v_m, tau_s)
//   orthosis  J_e dv_e = tau_s + tau_c + tau_b - m_e g l_e sin q_e - friction of its bearing,
//             tau_s = K (q_m - q_e) + D (v_m - v_e)
//   limb      J_k dv_k = tau_k - tau_c - m g l sin(q_k - q_c) - b_k v_k + passive tissue
//
// tau_c is the strap's torque, tau_k the muscles', tau_b what a moving thigh adds at the orthosis. Everything is on the joint's side of the gear. The loop reads both
// encoders once a period and holds its command; all bodies move in substeps of semi-implicit Euler, and motor and
// bearing can stick, to the bit; a motor whose contacts give does not. The substep must resolve the stiffest pair:
// h sqrt(K / J) below about 1.
#pragma once

#include "gear_friction.hpp"
#include "joint.hpp"
#include "limb.hpp"
#include "sensor.hpp"
#include "strap.hpp"
#include "torque_loop.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct CoupledPlantParams {
  S motor_inertia{};                       ///< J_m
  GearFrictionParams<S> motor_friction{};  ///< friction of motor and gear
  S spring_stiffness{}, spring_damping{};
  JointParams<S> orthosis{};         ///< behind the spring; its friction is its bearing's
  StrapParams<S> strap{};            ///< between orthosis and limb
  LimbParams<S> limb{};              ///< limb of the wearer
  TorqueLoopParams<S> loop{};        ///< the actuator's controller, and the control period
  EncoderParams<S> motor_encoder{};  ///< between gear and spring
  EncoderParams<S> output_encoder{};  ///< behind the spring
  std::uint32_t substeps = 10;        ///< integration steps per control period, >= 1

  /// Period, delay, span and substeps are no part of the walk.
  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.motor_inertia, {"motor_inertia", unit::inertia, above(0), "J_m, motor and gear, on the joint's side"});
    pellucid::walk(p.motor_friction, visit);
    visit(p.spring_stiffness, {"spring_stiffness", unit::stiffness, above(0), "K of the series spring"});
    visit(p.spring_damping, {"spring_damping", unit::viscous, at_least(0), "D of the series spring"});
    visit(p.orthosis.inertia, {"orthosis_inertia", unit::inertia, above(0), "J_e, behind the spring"});
    JointParams<S>::weight(p.orthosis, visit);
    FrictionParams<S>::bearing(p.orthosis.friction, visit);
    pellucid::walk(p.strap, visit);
    auto of_limb = prefixed(visit, "limb_");
    LimbParams<S>::pendulum(p.limb, of_limb);
    LimbParams<S>::passive(p.limb, visit);
    TorqueLoopParams<S>::gains(p.loop, visit);
    visit(p.motor_encoder.quantum, {"motor_quantum", unit::coordinate, any_number(),
                                    "the smallest step between gear and spring; <= 0: none"});
    visit(p.output_encoder.quantum, {"output_quantum", unit::coordinate, any_number(),
                                     "the smallest step behind the spring; <= 0: none"});
  }
};

constexpr std::size_t coupled_parameter_count = field_count<CoupledPlantParams<double>>;

/// Coefficients computed once from CoupledPlantParams.
template <class S> struct CoupledPlantCoefficients {
  S inverse_motor_inertia{};                     ///< 1 / J_m [1/(kg m^2)]
  GearFrictionCoefficients<S> motor_friction{};  ///< friction of motor and gear
  S spring_stiffness{};                          ///< K [N m/rad]
  S spring_damping{};                            ///< D [N m s/rad]
  JointCoefficients<S> orthosis{};               ///< behind the spring
  StrapCoefficients<S> strap{};                  ///< between orthosis and limb
  LimbCoefficients<S> limb{};                    ///< limb of the wearer
  TorqueLoopCoefficients<S> loop{};              ///< the actuator's controller
  EncoderCoefficients<S> motor_encoder{};        ///< between gear and spring
  EncoderCoefficients<S> output_encoder{};       ///< behind the spring
  S substep{};                                   ///< h [s]
  std::uint32_t substeps = 10;                   ///< per control period
};

template <class S> CoupledPlantCoefficients<S> coefficients(const CoupledPlantParams<S>& params) noexcept {
  CoupledPlantCoefficients<S> c;
  c.inverse_motor_inertia = S(1) / params.motor_inertia;
  c.motor_friction = coefficients(params.motor_friction);
  c.spring_stiffness = params.spring_stiffness;
  c.spring_damping = params.spring_damping;
  c.orthosis = coefficients(params.orthosis);
  c.strap = coefficients(params.strap);
  c.limb = coefficients(params.limb);
  c.loop = coefficients(params.loop);
  c.motor_encoder = coefficients(params.motor_encoder);
  c.output_encoder = coefficients(params.output_encoder);
  c.substeps = params.substeps > 0 ? params.substeps : 1;
  c.substep = params.loop.period / S(static_cast<value_t<S>>(c.substeps));
  return c;
}

template <class S> struct CoupledPlantState {
  S motor_position{};         ///< q_m [rad]
  S motor_velocity{};         ///< v_m [rad/s]
  S orthosis_position{};      ///< q_e [rad]
  S orthosis_velocity{};      ///< v_e [rad/s]
  S limb_position{};          ///< q_k [rad]
  S limb_velocity{};          ///< v_k [rad/s]
  StrapState<S> strap{};      ///< state of the strap
  PreslidingState<S> contacts{};  ///< contacts of the motor's friction
  TorqueLoopState<S> loop{};  ///< state of the actuator
};

/// Inputs of a plant in each period.
template <class S> struct CoupledPlantInput {
  S desired_torque{};  ///< tau_d, of the spring [N m]
  S muscle_torque{};   ///< tau_k [N m]
  S slip_jump{};       ///< angle by which the strap slips at once, now [rad]
  S base_torque{};     ///< tau_b: of the base that moves, on the orthosis [N m]
};

/// Values at one moment; `motor_torque` is that of the period that ended there.
template <class S> struct CoupledPlantOutput {
  S position{};        ///< reading of the output encoder [rad]
  S motor_position{};  ///< reading of the motor's encoder [rad]
  S torque{};          ///< spring torque from their difference [N m]
  S spring_torque{};   ///< tau_s [N m]
  S strap_torque{};    ///< tau_c, on the orthosis [N m]
  S motor_torque{};    ///< u [N m]
  S limb_torque{};     ///< tau_c, against the limb: the same but where the strap sits askew [N m]
};

/// Torque of the spring [N m].
template <class S> S spring_torque(const CoupledPlantCoefficients<S>& c, const CoupledPlantState<S>& state) noexcept {
  return c.spring_stiffness * (state.motor_position - state.orthosis_position) +
         c.spring_damping * (state.motor_velocity - state.orthosis_velocity);
}

/// Torques of the strap on orthosis and limb.
template <class S>
StrapPull<S> strap_pull(const CoupledPlantCoefficients<S>& c, const CoupledPlantState<S>& state) noexcept {
  return pull(c.strap, state.strap, state.orthosis_position, state.orthosis_velocity, state.limb_position,
              state.limb_velocity);
}

/// Present readings of the encoders, and the torques that they cannot distinguish. Reading changes nothing.
template <class S>
CoupledPlantOutput<S> read(const CoupledPlantCoefficients<S>& c, const CoupledPlantState<S>& state) noexcept {
  CoupledPlantOutput<S> out;
  out.position = step(c.output_encoder, state.orthosis_position, S(0));
  out.motor_position = step(c.motor_encoder, state.motor_position, S(0));
  out.torque = measured_torque(c.loop, out.motor_position, out.position);
  out.spring_torque = spring_torque(c, state);
  const StrapPull<S> strap = strap_pull(c, state);
  out.strap_torque = strap.robot;
  out.limb_torque = strap.limb;
  return out;
}

/// A state at rest in which the spring gives a torque, the orthosis is where one says, and the limb where the strap,
/// relaxed and without slip, carries what is left of the orthosis's weight.
template <class S>
CoupledPlantState<S> balanced(const CoupledPlantCoefficients<S>& c, const S& position, const S& torque) noexcept {
  CoupledPlantState<S> state;
  const StrapAlignment<S> at = alignment(c.strap, position);
  const S load = (gravity(c.orthosis, position) - torque) / at.lever;
  const S stretch = stretch_under(c.strap, load);
  const S gap = select(c.strap.stiffness > S(0), sign(load) * c.strap.half_slack, S(0));
  state.motor_position = position + torque / c.spring_stiffness;
  state.orthosis_position = position;
  state.limb_position = at.limb + (stretch + gap);
  state.strap = settled(c.strap, stretch);
  state.loop = settled(measured_torque(c.loop, state.motor_position, state.orthosis_position));
  return state;
}

/// Velocity of the motor one substep on, under its own torque and the spring's [rad/s].
template <class S>
S next_motor_velocity(const CoupledPlantCoefficients<S>& c, const PreslidingState<S>& contacts, const S& position,
                      const S& velocity, const S& motor_torque, const S& load) noexcept {
  const S net = motor_torque - load;
  return next_velocity(c.motor_friction, contacts, position, velocity, net, net, load, c.inverse_motor_inertia,
                       c.substep);
}

/// One control period. Total, as every step: whatever comes in, NaN included, it ends after as many operations.
template <class S> CoupledPlantOutput<S> step(const CoupledPlantCoefficients<S>& c, CoupledPlantState<S>& state,
                                              const CoupledPlantInput<S>& input) noexcept {
  static_assert(ScalarTraits<S>::is_real, "stiction resets the velocity, which would drop its derivative");
  const CoupledPlantOutput<S> before = read(c, state);
  const S motor_torque = step(c.loop, state.loop, input.desired_torque, before.torque);
  state.strap.slip = state.strap.slip + input.slip_jump;
  for (std::uint32_t i = 0; i < c.substeps; ++i) {
    const S spring = spring_torque(c, state);
    const StrapPull<S> strap = strap_pull(c, state);
    mask_t<S> rests{};
    const S effort = spring + strap.robot + input.base_torque;
    const S v_e = state.orthosis_velocity;
    const S a_e = acceleration(c.orthosis, gravity(c.orthosis, state.orthosis_position), v_e, effort, effort, rests);
    const S a_k = acceleration(c.limb, state.limb_position, state.limb_velocity, input.muscle_torque - strap.limb);
    state.motor_velocity =
        next_motor_velocity(c, state.contacts, state.motor_position, state.motor_velocity, motor_torque, spring);
    state.orthosis_velocity = stick(rests, v_e, v_e + c.substep * a_e);
    state.limb_velocity = state.limb_velocity + c.substep * a_k;
    const S way = c.substep * state.motor_velocity;
    if (c.motor_friction.presliding.any_gives) step(c.motor_friction.presliding, state.contacts, way);
    state.motor_position = state.motor_position + way;
    state.orthosis_position = state.orthosis_position + c.substep * state.orthosis_velocity;
    state.limb_position = state.limb_position + c.substep * state.limb_velocity;
    advance(c.strap, state.strap, strap, c.substep);
  }
  CoupledPlantOutput<S> out = read(c, state);
  out.motor_torque = motor_torque;
  return out;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
