// Cancels what a zero-impedance orthosis still weighs on its wearer, from the output encoder, the spring and EMG alone.
//
//   orthosis:  I_e a_e = tau_e + tau_c - b_e v_e - G_e sin q_e - F tanh(v_e/w)
//   limb:      I_k a_k = tau_k + d - tau_c - b_k v_k - G_k sin q_k
//   strap:     tau_c = k D + b dD,  D = q_k - q_e
//
// An observer follows both bodies, corrected by the encoder; d is what the EMG torque misses. The law asks the spring
// for what the orthosis needs to move as the limb is about to: its gravity, its friction and its inertia times the
// limb's acceleration; and drives what is left of tau_c to 0. The last step is the safety gate.
#pragma once

#include "safety.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// How many gains a swing is divided into.
constexpr std::size_t swing_phases = 8;

/// What was identified: two bodies and the strap between them.
template <class S> struct CoupledBodies {
  S orthosis_inertia{};  ///< I_e [kg m^2], > 0
  S orthosis_viscous{};  ///< b_e [N m s/rad], >= 0
  S orthosis_gravity{};  ///< G_e = m g l [N m]
  S coulomb{};           ///< F [N m], >= 0
  S friction_width{};    ///< w, over which friction changes its sign [rad/s], > 0
  S limb_inertia{};      ///< I_k [kg m^2], > 0
  S limb_viscous{};      ///< b_k [N m s/rad], >= 0
  S limb_gravity{};      ///< G_k = m g l [N m]
  S strap_stiffness{};   ///< k [N m/rad], > 0
  S strap_damping{};     ///< b [N m s/rad], >= 0
  S slack{};             ///< half the gap in which the strap's spring is slack [rad], >= 0
};

/// What the actuator's own torque loop does not cancel: tau_e = u - z, z the part faster than `leak` of
/// F_a sign(v_e) + b_a v_e + J_a a_e, behind the loop's lag.
template <class S> struct ActuatorResidual {
  S inertia{};  ///< J_a [kg m^2], >= 0
  S viscous{};  ///< b_a [N m s/rad], >= 0
  S coulomb{};  ///< F_a [N m], >= 0
  S leak{};     ///< rate at which the loop's integral forgets it [1/s], >= 0
};

template <class S> struct ResidualParams {
  CoupledBodies<S> bodies{};  ///< what was identified
  S correction[5]{};          ///< of q_e, v_e, D, dD, d, per angle that the encoder is off [1, 1/s, 1, 1/s, N m/rad]
  S innovation_limit{};       ///< of the angle that corrects in one period [rad], > 0
  S gravity_share{};          ///< of the orthosis's gravity that is carried [1]
  S viscous_share{};          ///< of its viscous friction [1]
  S friction_share{};         ///< of its Coulomb friction [1]
  S assist_width{};           ///< over which carried friction changes its sign [rad/s], > 0
  S inertia_share{};          ///< of its inertia times the limb's acceleration [1]
  ActuatorResidual<S> actuator{};  ///< what the torque loop lets through
  S torque_gain{};                 ///< on how far the spring is from the torque wanted [1]
  S proportional{};                ///< on the estimated strap torque [1]
  S integral{};                    ///< on its integral [1/s]
  S derivative{};                  ///< on its rate [s]
  S integral_limit{};              ///< of the integral's torque [N m], >= 0
  S preview{};                     ///< how far ahead the motion is predicted: the delay of what follows [s], >= 0
  S emg_limit{};                   ///< of |EMG torque| [N m], > 0
  S trust_time{};                  ///< over which EMG is faded in and out [s], > 0
  S swing_angle{};                 ///< where the middle of a swing is [rad]
  S swing_rate{};                  ///< angular frequency of a swing [rad/s], > 0
  S phase_gain[swing_phases] = {S(1), S(1), S(1), S(1), S(1), S(1), S(1), S(1)};  ///< of the whole torque [1]
  SafetyParams<S> gate{};  ///< of the gate; its period is the controller's
};

/// The order in which ResidualParams come as an array.
constexpr const char* residual_parameter_names[] = {"orthosis_inertia",
                                                    "orthosis_viscous",
                                                    "orthosis_gravity",
                                                    "coulomb",
                                                    "friction_width",
                                                    "limb_inertia",
                                                    "limb_viscous",
                                                    "limb_gravity",
                                                    "strap_stiffness",
                                                    "strap_damping",
                                                    "slack",
                                                    "correct_position",
                                                    "correct_velocity",
                                                    "correct_mismatch",
                                                    "correct_mismatch_rate",
                                                    "correct_disturbance",
                                                    "innovation_limit",
                                                    "gravity_share",
                                                    "viscous_share",
                                                    "friction_share",
                                                    "assist_width",
                                                    "inertia_share",
                                                    "actuator_inertia",
                                                    "actuator_viscous",
                                                    "actuator_coulomb",
                                                    "actuator_leak",
                                                    "torque_gain",
                                                    "proportional",
                                                    "integral",
                                                    "derivative",
                                                    "integral_limit",
                                                    "preview",
                                                    "emg_limit",
                                                    "trust_time",
                                                    "swing_angle",
                                                    "swing_rate",
                                                    "phase_gain_0",
                                                    "phase_gain_1",
                                                    "phase_gain_2",
                                                    "phase_gain_3",
                                                    "phase_gain_4",
                                                    "phase_gain_5",
                                                    "phase_gain_6",
                                                    "phase_gain_7",
                                                    "effort_limit",
                                                    "rate_limit",
                                                    "velocity_limit",
                                                    "position_min",
                                                    "position_max",
                                                    "stop_margin",
                                                    "max_age",
                                                    "max_repeats",
                                                    "period"};
constexpr std::size_t residual_parameter_count = sizeof residual_parameter_names / sizeof *residual_parameter_names;

/// ResidualParams from their array.
template <class S> ResidualParams<S> residual_params(const S (&v)[residual_parameter_count]) noexcept {
  ResidualParams<S> p;
  p.bodies = {v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9], v[10]};
  for (std::size_t i = 0; i < 5; ++i) p.correction[i] = v[11 + i];
  p.innovation_limit = v[16];
  p.gravity_share = v[17];
  p.viscous_share = v[18];
  p.friction_share = v[19];
  p.assist_width = v[20];
  p.inertia_share = v[21];
  p.actuator = {v[22], v[23], v[24], v[25]};
  p.torque_gain = v[26];
  p.proportional = v[27];
  p.integral = v[28];
  p.derivative = v[29];
  p.integral_limit = v[30];
  p.preview = v[31];
  p.emg_limit = v[32];
  p.trust_time = v[33];
  p.swing_angle = v[34];
  p.swing_rate = v[35];
  for (std::size_t i = 0; i < swing_phases; ++i) p.phase_gain[i] = v[36 + i];
  // Counts that a 32-bit integer cannot hold are none.
  const std::uint32_t repeats = v[51] >= S(0) && v[51] <= S(1e6) ? static_cast<std::uint32_t>(v[51]) : 0;
  p.gate = {v[44], v[45], v[46], v[47], v[48], v[49], v[50], repeats, v[52]};
  return p;
}

/// What follows from ResidualParams once.
template <class S> struct ResidualCoefficients {
  ResidualParams<S> params{};    ///< as they are
  SafetyCoefficients<S> gate{};  ///< of the last step; shut if anything makes no sense
  S inverse_orthosis_inertia{};  ///< [1/(kg m^2)]
  S inverse_limb_inertia{};      ///< [1/(kg m^2)]
  S inverse_friction_width{};    ///< [s/rad]
  S inverse_assist_width{};      ///< [s/rad]
  S inverse_swing_rate{};        ///< [s/rad]
  S inverse_period{};            ///< [1/s]
  S leak{};                      ///< of the actuator, a period [1]
  S trust_change{};              ///< in a period [1]
};

template <class S> ResidualCoefficients<S> coefficients(const ResidualParams<S>& p) noexcept {
  ResidualCoefficients<S> c;
  const CoupledBodies<S>& m = p.bodies;
  const S period = p.gate.period;
  c.params = p;
  c.gate = coefficients(p.gate);
  c.inverse_orthosis_inertia = S(1) / m.orthosis_inertia;
  c.inverse_limb_inertia = S(1) / m.limb_inertia;
  c.inverse_friction_width = S(1) / m.friction_width;
  c.inverse_assist_width = S(1) / p.assist_width;
  c.inverse_swing_rate = S(1) / p.swing_rate;
  c.inverse_period = S(1) / period;
  c.leak = p.actuator.leak * period;
  c.trust_change = period / p.trust_time;
  const S inverse_inertia = c.inverse_orthosis_inertia + c.inverse_limb_inertia;
  const S damping = m.strap_damping + m.orthosis_viscous + m.coulomb * c.inverse_friction_width;
  bool sound =
      m.orthosis_inertia > S(0) && m.limb_inertia > S(0) && m.strap_stiffness > S(0) && m.friction_width > S(0) &&
      m.orthosis_viscous >= S(0) && m.coulomb >= S(0) && m.limb_viscous >= S(0) && m.strap_damping >= S(0) &&
      m.slack >= S(0) && is_finite(m.slack) && is_finite(m.orthosis_gravity) && is_finite(m.limb_gravity) &&
      p.innovation_limit > S(0) && p.integral_limit >= S(0) && p.preview >= S(0) && p.emg_limit > S(0) &&
      p.trust_time > S(0) && p.swing_rate > S(0) && p.assist_width > S(0) &&
      is_finite(p.gravity_share + p.viscous_share + p.friction_share + p.inertia_share) &&
      is_finite(p.proportional + p.integral + p.derivative + p.integral_limit) &&
      is_finite(p.preview + p.emg_limit + p.swing_angle + p.innovation_limit) && is_finite(c.inverse_swing_rate);
  sound = sound && p.actuator.inertia >= S(0) && p.actuator.viscous >= S(0) && p.actuator.coulomb >= S(0) &&
          c.leak >= S(0) && c.leak < S(1) && is_finite(p.torque_gain) &&
          is_finite(p.actuator.inertia + p.actuator.viscous + p.actuator.coulomb);
  for (const S gain : p.correction) sound = sound && is_finite(gain);
  for (const S gain : p.phase_gain) sound = sound && is_finite(gain);
  // Semi-implicit Euler holds while a period turns the strap's resonance by less than 1 rad and damps it by less than 1.
  sound = sound && period * period * m.strap_stiffness * inverse_inertia < S(1) &&
          period * damping * inverse_inertia < S(1);
  c.gate.valid = c.gate.valid && sound;
  return c;
}

/// What a compensator remembers.
template <class S> struct ResidualState {
  S position{};                ///< q_e, observed [rad]
  S velocity{};                ///< v_e [rad/s]
  S mismatch{};                ///< D [rad]
  S mismatch_rate{};           ///< dD [rad/s]
  S disturbance{};             ///< d, what the EMG torque misses [N m]
  S strap_torque{};            ///< tau_c, estimated at the last period [N m]
  S limb_acceleration{};       ///< a_k, estimated at the last period [rad/s^2]
  S integral{};                ///< of tau_c, as a torque [N m]
  S slow{};                    ///< slow part of the actuator's residual [N m]
  S trust{};                   ///< in EMG, from 0 to 1
  S last_position{};           ///< as measured [rad]
  std::uint32_t sequence = 0;  ///< periods so far
  bool started = false;        ///< false until the first sample
  SafetyState<S> gate{};       ///< of the last step
};

/// What a compensator is given each period.
template <class S> struct ResidualInput {
  S position{};           ///< of the output encoder [rad]
  S torque{};             ///< tau_e, measured at the spring [N m]
  S emg_torque{};         ///< tau_k, estimated from EMG [N m]
  bool emg_valid = true;  ///< false: the electrodes say nothing
  std::int64_t time = 0;  ///< of the sample [us]
};

/// The strap's spring: k beyond its gap.
template <class S> S strap_spring(const CoupledBodies<S>& m, S mismatch) noexcept {
  return m.strap_stiffness * (mismatch - clamp(mismatch, -m.slack, m.slack));
}

/// What acts between the bodies and how they speed up.
template <class S> struct CoupledRates {
  S strap_torque{};           ///< tau_c [N m]
  S orthosis_acceleration{};  ///< a_e [rad/s^2]
  S limb_acceleration{};      ///< a_k [rad/s^2]
};

template <class S> CoupledRates<S> coupled_rates(const ResidualCoefficients<S>& c, const ResidualState<S>& s, S torque,
                                                 S muscle) noexcept {
  const CoupledBodies<S>& m = c.params.bodies;
  CoupledRates<S> r;
  r.strap_torque = strap_spring(m, s.mismatch) + m.strap_damping * s.mismatch_rate;
  const S friction = m.orthosis_viscous * s.velocity + m.coulomb * tanh(s.velocity * c.inverse_friction_width);
  r.orthosis_acceleration =
      (torque + r.strap_torque - friction - m.orthosis_gravity * sin(s.position)) * c.inverse_orthosis_inertia;
  r.limb_acceleration = (muscle + s.disturbance - r.strap_torque - m.limb_viscous * (s.velocity + s.mismatch_rate) -
                         m.limb_gravity * sin(s.position + s.mismatch)) *
                        c.inverse_limb_inertia;
  return r;
}

/// The gain at this place of a swing: phases evenly around the circle of angle and velocity, interpolated.
/// Phase 0 is the end at positive angles, 2 the middle on the way there, 4 the other end, 6 the middle on the way back.
template <class S> S swing_gain(const ResidualCoefficients<S>& c, S position, S velocity) noexcept {
  const S x = position - c.params.swing_angle;
  const S y = velocity * c.inverse_swing_rate;
  // The diamond angle: a quarter of the circle for each unit, without an arctangent.
  const S sum = abs(x) + abs(y);
  if (!(sum > S(0)) || !is_finite(sum)) return c.params.phase_gain[0];
  const S along = x / sum;
  const S turn = y >= S(0) ? S(1) - along : S(3) + along;
  const S place = turn * S(static_cast<value_t<S>>(swing_phases) / 4);
  std::size_t first = 0;
  while (first + 1 < swing_phases && place >= S(static_cast<value_t<S>>(first + 1))) ++first;
  const S share = clamp(place - S(static_cast<value_t<S>>(first)), S(0), S(1));
  const S low = c.params.phase_gain[first];
  return low + share * (c.params.phase_gain[(first + 1) % swing_phases] - low);
}

/// Forgets the motion, keeps the gate as it is.
template <class S> void forget(ResidualState<S>& s) noexcept {
  const SafetyState<S> gate = s.gate;
  const std::uint32_t sequence = s.sequence;
  s = {};
  s.gate = gate;
  s.sequence = sequence;
}

/// Opens the gate again and starts the observer from the next sample.
template <class S> void reset(ResidualState<S>& s) noexcept {
  forget(s);
  reset(s.gate);
}

/// One control period: the torque wanted from the spring [N m]. A fault latches the gate: zero-impedance mode.
/// EMG that is not valid or not finite is no fault: it fades out, and what needs no EMG stays.
template <class S>
S step(const ResidualCoefficients<S>& c, ResidualState<S>& s, const ResidualInput<S>& input) noexcept {
  const ResidualParams<S>& p = c.params;
  const CoupledBodies<S>& m = p.bodies;
  const S period = p.gate.period;
  const bool measured = is_finite(input.position) && is_finite(input.torque);
  const bool heard = input.emg_valid && is_finite(input.emg_torque);
  const S muscle = heard ? clamp(input.emg_torque, -p.emg_limit, p.emg_limit) : S(0);
  s.trust = clamp((heard ? S(1) : S(0)), s.trust - c.trust_change, s.trust + c.trust_change);

  S wanted = S(0);
  S speed = S(0);
  if (c.gate.valid && measured) {
    if (!s.started) {
      s.position = input.position;
      s.last_position = input.position;
      s.started = true;
    }
    speed = (input.position - s.last_position) * c.inverse_period;
    s.last_position = input.position;

    const S off = clamp(input.position - s.position, -p.innovation_limit, p.innovation_limit);
    s.position = s.position + p.correction[0] * off;
    s.velocity = s.velocity + p.correction[1] * off;
    s.mismatch = s.mismatch + p.correction[2] * off;
    s.mismatch_rate = s.mismatch_rate + p.correction[3] * off;
    s.disturbance = clamp(s.disturbance + p.correction[4] * off, -p.emg_limit, p.emg_limit);

    const CoupledRates<S> r = coupled_rates(c, s, input.torque, muscle);
    s.strap_torque = r.strap_torque;
    s.limb_acceleration = r.limb_acceleration;
    s.integral = clamp(s.integral + p.integral * period * r.strap_torque, -p.integral_limit, p.integral_limit);

    const S position = s.position + p.preview * s.velocity;
    const S limb_velocity = s.velocity + s.mismatch_rate + p.preview * r.limb_acceleration;
    // Without EMG the limb's motion is not known well enough to lead the orthosis.
    const S velocity = s.velocity + s.trust * (limb_velocity - s.velocity);
    const S smooth = tanh(velocity * c.inverse_assist_width);
    const S carried = p.gravity_share * m.orthosis_gravity * sin(position) +
                      p.viscous_share * m.orthosis_viscous * velocity + p.friction_share * m.coulomb * smooth +
                      s.trust * p.inertia_share * m.orthosis_inertia * r.limb_acceleration;
    const S drag = p.viscous_share * p.actuator.viscous * velocity + p.friction_share * p.actuator.coulomb * smooth +
                   s.trust * p.inertia_share * p.actuator.inertia * r.limb_acceleration;
    s.slow = s.slow + c.leak * (drag - s.slow);
    const S rate =
        m.strap_stiffness * s.mismatch_rate + m.strap_damping * (r.limb_acceleration - r.orthosis_acceleration);
    const S driven = p.proportional * r.strap_torque + s.integral + p.derivative * rate;
    const S spring = carried + driven;
    wanted =
        swing_gain(c, s.position, s.velocity) * (spring + (drag - s.slow) + p.torque_gain * (spring - input.torque));

    s.velocity = s.velocity + period * r.orthosis_acceleration;
    s.mismatch_rate = s.mismatch_rate + period * (r.limb_acceleration - r.orthosis_acceleration);
    s.position = s.position + period * s.velocity;
    s.mismatch = s.mismatch + period * s.mismatch_rate;
  }
  const S sum = abs(s.position) + abs(s.velocity) + abs(s.mismatch) + abs(s.mismatch_rate) + abs(s.disturbance);
  if (!is_finite(sum) || !is_finite(s.integral) || !is_finite(s.slow)) forget(s);
  ++s.sequence;
  return step(c.gate, s.gate, {wanted, input.position, speed, input.time, s.sequence, measured});
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
