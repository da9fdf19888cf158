// A series-elastic orthosis strapped to a limb: three bodies under the actuator's own torque loop.
//
//   motor     J_m dv_m = u - tau_s - friction(q_m, v_m, tau_s)
//   orthosis  J_e dv_e = tau_s + tau_c - m_e g l_e sin q_e - friction of its bearing,   tau_s = K (q_m - q_e) + D (v_m - v_e)
//   limb      J_k dv_k = tau_k - tau_c - m g l sin(q_k - q_c) - b_k v_k + passive tissue
//
// tau_c is the strap's torque, tau_k the muscles'. Everything is on the joint's side of the gear. The loop reads both
// encoders once a period and holds its command; all bodies move in substeps of semi-implicit Euler, and motor and
// bearing can stick, to the bit. The substep must resolve the stiffest pair: h sqrt(K / J) below about 1.
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
  S motor_inertia{};                       ///< J_m, motor and gear, on the joint's side [kg m^2], > 0
  GearFrictionParams<S> motor_friction{};  ///< of motor and gear
  S spring_stiffness{};                    ///< K [N m/rad], > 0
  S spring_damping{};                      ///< D [N m s/rad], >= 0
  JointParams<S> orthosis{};               ///< behind the spring; its friction is its bearing's
  StrapParams<S> strap{};                  ///< between orthosis and limb
  LimbParams<S> limb{};                    ///< what wears it
  TorqueLoopParams<S> loop{};              ///< the actuator's controller, and the control period
  EncoderParams<S> motor_encoder{};        ///< between gear and spring
  EncoderParams<S> output_encoder{};       ///< behind the spring
  std::uint32_t substeps = 10;             ///< integration steps per control period, >= 1
};

/// How many numbers a coupled plant is, in the one order that every array of them has.
constexpr std::size_t coupled_parameter_count = 40;
constexpr const char* coupled_parameter_names[coupled_parameter_count] = {"motor_inertia",     "coulomb_positive",
                                                                          "coulomb_negative",  "viscous_positive",
                                                                          "viscous_negative",  "stribeck",
                                                                          "stribeck_velocity", "load_motoring",
                                                                          "load_generating",   "load_rise",
                                                                          "friction_swing",    "friction_wave_number",
                                                                          "viscous_decline",   "spring_stiffness",
                                                                          "spring_damping",    "orthosis_inertia",
                                                                          "gravity_sine",      "gravity_cosine",
                                                                          "bearing_coulomb",   "bearing_viscous",
                                                                          "strap_stiffness",   "strap_damping",
                                                                          "strap_slack",       "strap_hold",
                                                                          "strap_mobility",    "limb_inertia",
                                                                          "limb_gravity",      "limb_centre",
                                                                          "limb_viscous",      "passive_torque",
                                                                          "passive_angle",     "passive_scale",
                                                                          "torque_kp",         "torque_ki",
                                                                          "torque_kd",         "torque_limit",
                                                                          "motor_limit",       "calibrated_stiffness",
                                                                          "motor_quantum",     "output_quantum"};

/// CoupledPlantParams from numbers in the order of coupled_parameter_names; period, delay, span and substeps as they are.
template <class S> CoupledPlantParams<S> coupled_plant_params(const S (&p)[coupled_parameter_count]) noexcept {
  CoupledPlantParams<S> params;
  params.motor_inertia = p[0];
  params.motor_friction = {{p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8], S(0)}, p[9], p[10], p[11], p[12]};
  params.spring_stiffness = p[13];
  params.spring_damping = p[14];
  params.orthosis = {p[15], p[16], p[17], S(0), {p[18], p[18], p[19], p[19], S(0), S(0), S(0), S(0), S(0)}};
  params.strap = {p[20], p[21], p[22], p[23], p[24]};
  params.limb = {p[25], p[26], p[27], p[28], p[29], p[30], p[31]};
  params.loop.kp = p[32];
  params.loop.ki = p[33];
  params.loop.kd = p[34];
  params.loop.torque_limit = p[35];
  params.loop.motor_limit = p[36];
  params.loop.stiffness = p[37];
  params.motor_encoder = {p[38]};
  params.output_encoder = {p[39]};
  return params;
}

/// What follows from CoupledPlantParams once.
template <class S> struct CoupledPlantCoefficients {
  S inverse_motor_inertia{};                     ///< 1 / J_m [1/(kg m^2)]
  GearFrictionCoefficients<S> motor_friction{};  ///< of motor and gear
  S spring_stiffness{};                          ///< K [N m/rad]
  S spring_damping{};                            ///< D [N m s/rad]
  JointCoefficients<S> orthosis{};               ///< behind the spring
  StrapCoefficients<S> strap{};                  ///< between orthosis and limb
  LimbCoefficients<S> limb{};                    ///< what wears it
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
  S slip{};                   ///< of the strap [rad]
  TorqueLoopState<S> loop{};  ///< what the actuator remembers
};

/// What a plant is given each period.
template <class S> struct CoupledPlantInput {
  S desired_torque{};  ///< tau_d, of the spring [N m]
  S muscle_torque{};   ///< tau_k [N m]
  S slip_jump{};       ///< by which the strap slips at once, now [rad]
};

/// What holds at one moment; `motor_torque` is of the period that ended there.
template <class S> struct CoupledPlantOutput {
  S position{};        ///< what the output encoder says [rad]
  S motor_position{};  ///< what the motor's encoder says [rad]
  S torque{};          ///< what their difference says of the spring's torque [N m]
  S spring_torque{};   ///< tau_s [N m]
  S strap_torque{};    ///< tau_c [N m]
  S motor_torque{};    ///< u [N m]
};

/// Torque of the spring [N m].
template <class S> S spring_torque(const CoupledPlantCoefficients<S>& c, const CoupledPlantState<S>& state) noexcept {
  return c.spring_stiffness * (state.motor_position - state.orthosis_position) +
         c.spring_damping * (state.motor_velocity - state.orthosis_velocity);
}

/// Torque of the strap on the orthosis, and against the limb [N m].
template <class S> S strap_torque(const CoupledPlantCoefficients<S>& c, const CoupledPlantState<S>& state) noexcept {
  return torque(c.strap, state.limb_position - state.orthosis_position - state.slip,
                state.limb_velocity - state.orthosis_velocity);
}

/// What encoders say now, and the torques that they cannot tell apart. Reading changes nothing.
template <class S>
CoupledPlantOutput<S> read(const CoupledPlantCoefficients<S>& c, const CoupledPlantState<S>& state) noexcept {
  CoupledPlantOutput<S> out;
  out.position = step(c.output_encoder, state.orthosis_position, S(0));
  out.motor_position = step(c.motor_encoder, state.motor_position, S(0));
  out.torque = measured_torque(c.loop, out.motor_position, out.position);
  out.spring_torque = spring_torque(c, state);
  out.strap_torque = strap_torque(c, state);
  return out;
}

/// A state at rest in which the spring gives a torque, the orthosis is where one says, and the limb where the strap,
/// without slip, carries what is left of the orthosis's weight.
template <class S>
CoupledPlantState<S> balanced(const CoupledPlantCoefficients<S>& c, const S& position, const S& torque) noexcept {
  CoupledPlantState<S> state;
  const S load = gravity(c.orthosis, position) - torque;
  const mask_t<S> strapped = c.strap.stiffness > S(0);
  const S stretch = load / select(strapped, c.strap.stiffness, S(1)) + sign(load) * c.strap.half_slack;
  state.motor_position = position + torque / c.spring_stiffness;
  state.orthosis_position = position;
  state.limb_position = position + select(strapped, stretch, S(0));
  state.loop = settled(measured_torque(c.loop, state.motor_position, state.orthosis_position));
  return state;
}

/// Velocity of the motor one substep on, under its own torque and the spring's [rad/s].
template <class S> S next_motor_velocity(const CoupledPlantCoefficients<S>& c, const S& position, const S& velocity,
                                         const S& motor_torque, const S& load) noexcept {
  const S net = motor_torque - load;
  const S share = coulomb_share(c.motor_friction, position);
  const mask_t<S> rests = abs(net) <= breakaway(c.motor_friction, share, load, net);
  const S direction = sign(select(velocity == S(0), net, velocity));
  const S slipping = (net - friction(c.motor_friction, share, load, velocity, direction)) * c.inverse_motor_inertia;
  return stick(rests, velocity, velocity + c.substep * slipping);
}

/// One control period. Total, as every step: whatever comes in, NaN included, it ends after as many operations.
template <class S> CoupledPlantOutput<S> step(const CoupledPlantCoefficients<S>& c, CoupledPlantState<S>& state,
                                              const CoupledPlantInput<S>& input) noexcept {
  static_assert(ScalarTraits<S>::is_real, "stiction resets the velocity, which would drop its derivative");
  const CoupledPlantOutput<S> before = read(c, state);
  const S motor_torque = step(c.loop, state.loop, input.desired_torque, before.torque);
  state.slip = state.slip + input.slip_jump;
  for (std::uint32_t i = 0; i < c.substeps; ++i) {
    const S spring = spring_torque(c, state);
    const S strap = strap_torque(c, state);
    mask_t<S> rests{};
    const S effort = spring + strap;
    const S v_e = state.orthosis_velocity;
    const S a_e = acceleration(c.orthosis, gravity(c.orthosis, state.orthosis_position), v_e, effort, effort, rests);
    const S a_k = acceleration(c.limb, state.limb_position, state.limb_velocity, input.muscle_torque - strap);
    state.motor_velocity = next_motor_velocity(c, state.motor_position, state.motor_velocity, motor_torque, spring);
    state.orthosis_velocity = stick(rests, v_e, v_e + c.substep * a_e);
    state.limb_velocity = state.limb_velocity + c.substep * a_k;
    state.motor_position = state.motor_position + c.substep * state.motor_velocity;
    state.orthosis_position = state.orthosis_position + c.substep * state.orthosis_velocity;
    state.limb_position = state.limb_position + c.substep * state.limb_velocity;
    state.slip = state.slip + c.substep * slip_rate(c.strap, strap);
  }
  CoupledPlantOutput<S> out = read(c, state);
  out.motor_torque = motor_torque;
  return out;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
