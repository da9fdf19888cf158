// A forearm strapped to a robot's carriage: limb, strap, link, cable with backlash, motor.
//
//   J_h a_h = tau_muscle - tau_c - limb's gravity and friction
//   J a     = tau + tau_c - link's gravity and bearing,   and the motor of geared_plant.hpp behind the cable
//
// tau_c is the strap's torque on the robot. What is not worn is a limb alone, and the robot then stays as it is.
#pragma once

#include "geared_plant.hpp"
#include "limb.hpp"
#include "strap.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct WornGearedPlantParams {
  GearedPlantParams<S> robot{};  ///< its loop counts for its period only
  StrapParams<S> strap{};        ///< between link and limb
  LimbParams<S> limb{};          ///< the wearer's
  bool worn = true;              ///< false: the limb alone
};

/// Coefficients computed once from WornGearedPlantParams.
template <class S> struct WornGearedPlantCoefficients {
  GearedPlantCoefficients<S> robot{};  ///< motor, cable, link
  StrapCoefficients<S> strap{};        ///< between link and limb
  LimbCoefficients<S> limb{};          ///< the wearer's
  bool worn = true;                    ///< whether there is a robot
};

template <class S> WornGearedPlantCoefficients<S> coefficients(const WornGearedPlantParams<S>& p) noexcept {
  return {coefficients(p.robot), coefficients(p.strap), coefficients(p.limb), p.worn};
}

template <class S> struct WornGearedPlantState {
  S motor_position{};     ///< [rad]
  S motor_velocity{};     ///< [rad/s]
  S link_position{};      ///< [rad]
  S link_velocity{};      ///< [rad/s]
  S limb_position{};      ///< [rad]
  S limb_velocity{};      ///< [rad/s]
  S limb_acceleration{};  ///< acceleration of the limb in the last substep [rad/s^2]
  StrapState<S> strap{};  ///< state of the strap
  PreslidingState<S> contacts{};  ///< contacts of the motor's friction
};

/// Everything at rest where the limb goes through the cuff, the cable carrying the robot.
template <class S>
WornGearedPlantState<S> balanced(const WornGearedPlantCoefficients<S>& c, const S& position) noexcept {
  const S link = robot_at(c.strap, position);
  const GearedPlantState<S> robot = balanced(c.robot, link, S(0));
  return {robot.motor_position, S(0), link, S(0), position, S(0), S(0), {}, {}};
}

/// Torques of the strap on wearer and robot.
template <class S>
StrapPull<S> interaction(const WornGearedPlantCoefficients<S>& c, const WornGearedPlantState<S>& state) noexcept {
  if (!c.worn) return {};
  return pull(c.strap, state.strap, state.link_position, state.link_velocity, state.limb_position,
              state.limb_velocity);
}

/// One control period under a command of the drive and a torque of the muscles [N m].
template <class S> void step(const WornGearedPlantCoefficients<S>& c, WornGearedPlantState<S>& state, const S& command,
                             const S& muscle) noexcept {
  const S h = c.robot.substep;
  for (std::uint32_t i = 0; i < c.robot.substeps; ++i) {
    const StrapPull<S> strap = interaction(c, state);
    state.limb_acceleration = acceleration(c.limb, state.limb_position, state.limb_velocity, muscle - strap.limb);
    if (c.worn) {
      const S cable = torque(c.robot.transmission, state.motor_position - state.link_position,
                             state.motor_velocity - state.link_velocity);
      state.motor_velocity =
          next_motor_velocity(c.robot, state.contacts, state.motor_position, state.motor_velocity, command, cable);
      state.link_velocity = next_link_velocity(c.robot, state.link_position, state.link_velocity, cable + strap.robot);
      state.motor_position = next_motor_position(c.robot, state.contacts, state.motor_position, state.motor_velocity);
      state.link_position = state.link_position + h * state.link_velocity;
      advance(c.strap, state.strap, strap, h);
    }
    state.limb_velocity = state.limb_velocity + h * state.limb_acceleration;
    state.limb_position = state.limb_position + h * state.limb_velocity;
  }
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
