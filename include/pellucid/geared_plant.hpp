// A motor and a link, coupled by a compliant transmission with backlash, under the motor's own controller: a plant that
// is richer than any model identified from it.
//
//   J_m dv_m = k u - k_e v_m + ripple(q_m) - tau - friction(q_m, v_m, tau)
//   J dv     = tau + disturbance - g_s sin q - g_c cos q - friction of the link's bearing
//
// tau is the transmission's torque. Everything is on the joint's side of the gear. The loop reads the motor's encoder
// once a period and holds its command; both bodies move in substeps of semi-implicit Euler, and either can stick, to
// the bit; a motor whose contacts give does not. The substep must resolve the transmission: h sqrt(K / J) below about 1
// for the smaller inertia.
#pragma once

#include "gear_friction.hpp"
#include "plant.hpp"
#include "transmission.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// The mechanism.
template <class S> struct GearedJointParams {
  JointParams<S> link{};                   ///< what moves behind the transmission; its friction is its bearing's
  S motor_inertia{};                       ///< J_m
  TransmissionParams<S> transmission{};    ///< between the two
  GearFrictionParams<S> motor_friction{};  ///< friction of motor and gear

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.link.inertia, {"link_inertia", unit::inertia, above(0), "J, behind the transmission"});
    JointParams<S>::weight(p.link, visit);
    visit(p.motor_inertia, {"motor_inertia", unit::inertia, above(0), "J_m, motor and gear, on the joint's side"});
    pellucid::walk(p.transmission, visit);
    pellucid::walk(p.motor_friction, visit);
    FrictionParams<S>::bearing(p.link.friction, visit);
  }
};

constexpr std::size_t geared_parameter_count = field_count<GearedJointParams<double>>;

template <class S> struct GearedPlantParams {
  GearedJointParams<S> joint{};  ///< the mechanism
  DriveParams<S> drive{};        ///< dynamics from command to effort, at the motor
  LoopParams<S> loop{};          ///< the controller, and the control period
  EncoderParams<S> encoder{};    ///< the controller's encoder, on the motor
  std::uint32_t substeps = 4;    ///< integration steps per control period, >= 1
};

/// Coefficients computed once from GearedPlantParams.
template <class S> struct GearedPlantCoefficients {
  JointCoefficients<S> link{};                   ///< behind the transmission
  S inverse_motor_inertia{};                     ///< 1 / J_m [1/(kg m^2)]
  TransmissionCoefficients<S> transmission{};    ///< between motor and link
  GearFrictionCoefficients<S> motor_friction{};  ///< friction of motor and gear
  DriveCoefficients<S> drive{};                  ///< dynamics from command to effort
  LoopCoefficients<S> loop{};                    ///< the controller
  EncoderCoefficients<S> encoder{};              ///< the controller's encoder
  S substep{};                                   ///< h [s]
  std::uint32_t substeps = 4;                    ///< per control period
};

template <class S> GearedPlantCoefficients<S> coefficients(const GearedPlantParams<S>& params) noexcept {
  GearedPlantCoefficients<S> c;
  c.link = coefficients(params.joint.link);
  c.inverse_motor_inertia = S(1) / params.joint.motor_inertia;
  c.transmission = coefficients(params.joint.transmission);
  c.motor_friction = coefficients(params.joint.motor_friction);
  c.drive = coefficients(params.drive);
  c.loop = coefficients(params.loop);
  c.encoder = coefficients(params.encoder);
  c.substeps = params.substeps > 0 ? params.substeps : 1;
  c.substep = params.loop.period / S(static_cast<value_t<S>>(c.substeps));
  return c;
}

template <class S> struct GearedPlantState {
  S motor_position{};   ///< q_m [rad]
  S motor_velocity{};   ///< v_m [rad/s]
  S link_position{};    ///< q [rad]
  S link_velocity{};    ///< v [rad/s]
  LoopState<S> loop{};  ///< state of the controller
  PreslidingState<S> contacts{};  ///< contacts of the motor's friction
};

/// A state in which the link is at q, both bodies move at v, and the transmission's spring carries gravity.
template <class S>
GearedPlantState<S> balanced(const GearedPlantCoefficients<S>& c, const S& position, const S& velocity) noexcept {
  GearedPlantState<S> state;
  state.motor_position = position + twist(c.transmission, gravity(c.link, position));
  state.motor_velocity = velocity;
  state.link_position = position;
  state.link_velocity = velocity;
  return state;
}

/// Values at the start of the period.
template <class S> struct GearedPlantOutput {
  S motor_position{};       ///< q_m [rad]
  S motor_velocity{};       ///< v_m [rad/s]
  S link_position{};        ///< q [rad]
  S link_velocity{};        ///< v [rad/s]
  S command{};              ///< u, limited, with what was injected [u]
  S measured_position{};    ///< reading of the motor's encoder [rad]
  S transmission_torque{};  ///< tau [N m]
};

/// Velocity of the motor one substep on, under a command and the transmission's torque [rad/s].
template <class S>
S next_motor_velocity(const GearedPlantCoefficients<S>& c, const PreslidingState<S>& contacts, const S& position,
                      const S& velocity, const S& command, const S& load) noexcept {
  const S net = c.drive.params.gain * command + (ripple(c.drive, position) - load);
  return next_velocity(c.motor_friction, contacts, position, velocity, net, net - c.drive.params.back_emf * velocity,
                       load, c.inverse_motor_inertia, c.substep);
}

/// Return the motor's position after one substep at a velocity [rad], and update its contacts.
template <class S> S next_motor_position(const GearedPlantCoefficients<S>& c, PreslidingState<S>& contacts,
                                         const S& position, const S& velocity) noexcept {
  const S way = c.substep * velocity;
  if (c.motor_friction.presliding.any_gives) step(c.motor_friction.presliding, contacts, way);
  return position + way;
}

/// Velocity of the link one substep on, under an effort [rad/s].
template <class S> S next_link_velocity(const GearedPlantCoefficients<S>& c, const S& position, const S& velocity,
                                        const S& effort) noexcept {
  mask_t<S> rests{};
  const S slipping = acceleration(c.link, gravity(c.link, position), velocity, effort, effort, rests);
  return stick(rests, velocity, velocity + c.substep * slipping);
}

/// One control period. Total, as every step: whatever comes in, NaN included, it ends after as many operations.
template <class S> GearedPlantOutput<S> step(const GearedPlantCoefficients<S>& c, GearedPlantState<S>& state,
                                             const PlantInput<S>& input) noexcept {
  static_assert(ScalarTraits<S>::is_real, "stiction resets the velocity, which would drop its derivative");
  S q_m = state.motor_position;
  S v_m = state.motor_velocity;
  S q = state.link_position;
  S v = state.link_velocity;
  GearedPlantOutput<S> out;
  out.motor_position = q_m;
  out.motor_velocity = v_m;
  out.link_position = q;
  out.link_velocity = v;
  out.measured_position = step(c.encoder, q_m, input.encoder_noise);
  out.command = step(c.loop, state.loop, LoopInput<S>{input.reference, out.measured_position, v_m}) + input.injected;

  for (std::uint32_t i = 0; i < c.substeps; ++i) {
    const S load = torque(c.transmission, q_m - q, v_m - v);
    if (i == 0) out.transmission_torque = load;
    v_m = next_motor_velocity(c, state.contacts, q_m, v_m, out.command, load);
    v = next_link_velocity(c, q, v, load + input.disturbance);
    q_m = next_motor_position(c, state.contacts, q_m, v_m);
    q = q + c.substep * v;
  }
  state.motor_position = q_m;
  state.motor_velocity = v_m;
  state.link_position = q;
  state.link_velocity = v;
  return out;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
