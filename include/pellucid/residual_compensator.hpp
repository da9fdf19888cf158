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

#include "law.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Number of gains over a swing, one per phase.
constexpr std::size_t swing_phases = 8;

/// Identified model: two bodies and the strap between them.
template <class S> struct CoupledBodies {
  S orthosis_inertia{}, orthosis_viscous{}, orthosis_gravity{}, coulomb{}, friction_width = S(0.05), limb_inertia{},
    limb_viscous{}, limb_gravity{}, strap_stiffness{}, strap_damping{}, slack{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.orthosis_inertia, {"orthosis_inertia", unit::inertia, above(0), "I_e"});
    visit(p.orthosis_viscous, {"orthosis_viscous", unit::viscous, at_least(0), "b_e", by::speed});
    visit(p.orthosis_gravity, {"orthosis_gravity", unit::effort, any_number(), "G_e = m g l"});
    visit(p.coulomb, {"coulomb", unit::effort, at_least(0), "F, between spring and orthosis", by::level});
    visit(p.friction_width, {"friction_width", unit::velocity, above(0),
                             "w, over which friction changes its sign in the observer"});
    visit(p.limb_inertia, {"limb_inertia", unit::inertia, above(0), "I_k"});
    visit(p.limb_viscous, {"limb_viscous", unit::viscous, at_least(0), "b_k"});
    visit(p.limb_gravity, {"limb_gravity", unit::effort, any_number(), "G_k = m g l"});
    visit(p.strap_stiffness, {"strap_stiffness", unit::stiffness, above(0), "k"});
    visit(p.strap_damping, {"strap_damping", unit::viscous, at_least(0), "b"});
    visit(p.slack, {"slack", unit::coordinate, at_least(0), "half the gap in which the strap's spring is slack"});
  }
};

/// Residual that the actuator's torque loop does not cancel: tau_e = u - z, z the part faster than `leak` of
/// F_a sign(v_e) + b_a v_e + J_a a_e, behind the loop's lag.
template <class S> struct ActuatorResidual {
  S inertia{}, viscous{}, coulomb{}, leak{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.inertia, {"actuator_inertia", unit::inertia, at_least(0), "J_a"});
    visit(p.viscous, {"actuator_viscous", unit::viscous, at_least(0), "b_a", by::speed});
    visit(p.coulomb, {"actuator_coulomb", unit::effort, at_least(0), "F_a", by::level});
    visit(p.leak, {"actuator_leak", unit::rate, at_least(0), "rate at which the loop's integral forgets them"});
  }
};

template <class S> struct ResidualParams {
  CoupledBodies<S> bodies{};  ///< identified bodies
  S correction[5]{};          ///< change of q_e, v_e, D, dD and d per angle that the encoder is off
  S innovation_limit = S(0.05), gravity_share = S(0.8), viscous_share = S(0.8), friction_share = S(0.5),
    assist_width = S(0.6), inertia_share = S(0.7);
  ActuatorResidual<S> actuator{};  ///< residual of the torque loop
  S torque_gain{}, proportional{}, integral{}, derivative{}, integral_limit = S(1), preview{}, emg_limit = S(40),
    trust_time = S(0.3), swing_angle{}, swing_rate = S(4.4);
  S phase_gain[swing_phases] = {S(1), S(1), S(1), S(1), S(1), S(1), S(1), S(1)};
  SafetyParams<S> gate{};  ///< its period is the controller's

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    constexpr const char* phases[swing_phases] = {"_0", "_1", "_2", "_3", "_4", "_5", "_6", "_7"};
    pellucid::walk(p.bodies, visit);
    visit(p.correction[0], {"correct_position", unit::one, any_number(),
                            "correction of q_e, per angle error of the encoder"});
    visit(p.correction[1], {"correct_velocity", unit::rate, any_number(), "correction of v_e"});
    visit(p.correction[2], {"correct_mismatch", unit::one, any_number(), "correction of D"});
    visit(p.correction[3], {"correct_mismatch_rate", unit::rate, any_number(), "correction of dD"});
    visit(p.correction[4], {"correct_disturbance", unit::stiffness, any_number(), "correction of d"});
    visit(p.innovation_limit, {"innovation_limit", unit::coordinate, above(0),
                               "largest correction of the angle in one period"});
    visit(p.gravity_share, {"gravity_share", unit::one, any_number(), "compensated share of the orthosis's gravity"});
    visit(p.viscous_share, {"viscous_share", unit::one, any_number(), "compensated share of its viscous friction"});
    visit(p.friction_share, {"friction_share", unit::one, any_number(), "compensated share of its Coulomb friction"});
    visit(p.assist_width, {"assist_width", unit::velocity, above(0).or_infinite(),
                           "velocity over which compensated friction changes its sign"});
    visit(p.inertia_share, {"inertia_share", unit::one, any_number(),
                            "compensated share of its inertia times the limb's acceleration"});
    pellucid::walk(p.actuator, visit);
    visit(p.torque_gain, {"torque_gain", unit::one, any_number(),
                          "gain on the difference of the spring's torque from the command"});
    visit(p.proportional, {"proportional", unit::one, any_number(), "gain on the estimated strap torque"});
    visit(p.integral, {"integral", unit::rate, any_number(), "gain on its integral"});
    visit(p.derivative, {"derivative", unit::time, any_number(), "gain on its rate"});
    visit(p.integral_limit, {"integral_limit", unit::effort, at_least(0), "limit of the integral's torque"});
    visit(p.preview, {"preview", unit::time, at_least(0),
                      "prediction time of the motion, equal to the delay of the following loop"});
    visit(p.emg_limit, {"emg_limit", unit::effort, above(0), "limit of |EMG torque|"});
    visit(p.trust_time, {"trust_time", unit::time, above(0).or_infinite(), "time over which EMG is faded in and out"});
    visit(p.swing_angle, {"swing_angle", unit::coordinate, any_number(), "angle in the middle of a swing"});
    visit(p.swing_rate, {"swing_rate", unit::velocity, above(0), "angular frequency of a swing"});
    for (std::size_t i = 0; i < swing_phases; ++i)
      visit(p.phase_gain[i], {"phase_gain", unit::one, any_number(), "of the whole torque at this phase of a swing", {}, "",
                              phases[i]});
    pellucid::walk(p.gate, visit);
  }
};

/// Coefficients computed once from ResidualParams.
template <class S> struct ResidualCoefficients {
  ResidualParams<S> params{};    ///< as they are
  SafetyCoefficients<S> gate{};  ///< gate of the last step; shut if anything makes no sense
  S inverse_orthosis_inertia{};  ///< [1/(kg m^2)]
  S inverse_limb_inertia{};      ///< [1/(kg m^2)]
  S inverse_friction_width{};    ///< [s/rad]
  S inverse_assist_width{};      ///< [s/rad]
  S inverse_swing_rate{};        ///< [s/rad]
  S inverse_period{};            ///< [1/s]
  S leak{};                      ///< share of the actuator's error that is forgotten in a period [1]
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
  bool sound = is_sound(p) && is_finite(c.inverse_swing_rate) && c.leak < S(1);
  // Semi-implicit Euler holds while a period turns the strap's resonance by less than 1 rad and damps it by less than 1.
  sound = sound && period * period * m.strap_stiffness * inverse_inertia < S(1) &&
          period * damping * inverse_inertia < S(1);
  c.gate.valid = c.gate.valid && sound;
  return c;
}

/// State of a compensator.
template <class S> struct ResidualState {
  S position{};                ///< q_e, observed [rad]
  S velocity{};                ///< v_e [rad/s]
  S mismatch{};                ///< D [rad]
  S mismatch_rate{};           ///< dD [rad/s]
  S disturbance{};             ///< d, what the EMG torque misses [N m]
  S strap_torque{};            ///< tau_c, estimated at the last period [N m]
  S limb_acceleration{};       ///< a_k, estimated at the last period [rad/s^2]
  S integral{};                ///< integral of tau_c, as a torque [N m]
  S slow{};                    ///< slow part of the actuator's residual [N m]
  S trust{};                   ///< in EMG, from 0 to 1
  S last_position{};           ///< as measured [rad]
  bool started = false;        ///< false until the first sample
  SafetyState<S> gate{};       ///< gate of the last step
};

/// The strap's spring: k beyond its gap.
template <class S> S strap_spring(const CoupledBodies<S>& m, S mismatch) noexcept {
  return m.strap_stiffness * (mismatch - clamp(mismatch, -m.slack, m.slack));
}

/// Torques between the bodies, and accelerations of both.
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
  s = {};
  s.gate = gate;
}

/// Opens the gate again and starts the observer from the next sample.
template <class S> void reset(ResidualState<S>& s) noexcept {
  forget(s);
  reset(s.gate);
}

/// One control period: the torque wanted from the spring [N m]. A fault latches the gate: zero-impedance mode.
/// EMG that is not valid or not finite is no fault: it fades out, and what needs no EMG stays.
template <class S>
S step(const ResidualCoefficients<S>& c, ResidualState<S>& s, const Samples<S>& samples) noexcept {
  const ResidualParams<S>& p = c.params;
  const CoupledBodies<S>& m = p.bodies;
  const S period = p.gate.period;
  const Sample<S>& encoder = samples.position;
  const bool measured = is_heard(encoder) && is_heard(samples.torque);
  const bool heard = is_heard(samples.muscle);
  const S muscle = heard ? clamp(samples.muscle.value, -p.emg_limit, p.emg_limit) : S(0);
  s.trust = clamp((heard ? S(1) : S(0)), s.trust - c.trust_change, s.trust + c.trust_change);

  S wanted = S(0);
  S speed = S(0);
  if (c.gate.valid && measured) {
    if (!s.started) {
      s.position = encoder.value;
      s.last_position = encoder.value;
      s.started = true;
    }
    speed = (encoder.value - s.last_position) * c.inverse_period;
    s.last_position = encoder.value;

    const S off = clamp(encoder.value - s.position, -p.innovation_limit, p.innovation_limit);
    s.position = s.position + p.correction[0] * off;
    s.velocity = s.velocity + p.correction[1] * off;
    s.mismatch = s.mismatch + p.correction[2] * off;
    s.mismatch_rate = s.mismatch_rate + p.correction[3] * off;
    s.disturbance = clamp(s.disturbance + p.correction[4] * off, -p.emg_limit, p.emg_limit);

    const CoupledRates<S> r = coupled_rates(c, s, samples.torque.value, muscle);
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
        swing_gain(c, s.position, s.velocity) * (spring + (drag - s.slow) + p.torque_gain * (spring - samples.torque.value));

    s.velocity = s.velocity + period * r.orthosis_acceleration;
    s.mismatch_rate = s.mismatch_rate + period * (r.limb_acceleration - r.orthosis_acceleration);
    s.position = s.position + period * s.velocity;
    s.mismatch = s.mismatch + period * s.mismatch_rate;
  }
  const S sum = abs(s.position) + abs(s.velocity) + abs(s.mismatch) + abs(s.mismatch_rate) + abs(s.disturbance);
  if (!is_finite(sum) || !is_finite(s.integral) || !is_finite(s.slow)) forget(s);
  return guard(c.gate, s.gate, wanted, speed, {encoder.value, encoder.time, encoder.sequence, measured});
}

template <class S> struct ResidualCompensator {
  using Params = ResidualParams<S>;
  using Coefficients = ResidualCoefficients<S>;
  using State = ResidualState<S>;
  static constexpr const char* name = "worn";
  static constexpr const char* type = "ResidualCompensator";
  static constexpr const char* title = "zero-impedance mode of a worn orthosis, with its residual compensated";
  static constexpr SensorUse sensors[] = {{Quantity::position, true, 0.8, 4e-4},
                                          {Quantity::torque, true, 0.5, 5e-3},
                                          {Quantity::muscle, false, 4.0, 0.1}};
  /// Observed quantities.
  template <class V> static void estimates(const State& s, V&& visit) {
    visit(s.position, {"position", unit::coordinate, {}, "position of the orthosis"});
    visit(s.velocity, {"velocity", unit::velocity, {}, "velocity of the orthosis"});
    visit(s.mismatch, {"mismatch", unit::coordinate, {}, "limb less orthosis"});
    visit(s.mismatch_rate, {"mismatch_rate", unit::velocity, {}, "rate of the mismatch"});
    visit(s.disturbance, {"disturbance", unit::effort, {}, "torque that EMG misses"});
    visit(s.strap_torque, {"strap_torque", unit::effort, {}, "torque of the strap on the orthosis"});
    visit(s.limb_acceleration, {"limb_acceleration", unit::acceleration, {}, "acceleration of the limb"});
    visit(s.trust, {"trust", unit::one, {}, "weight of EMG"});
  }
};

}  // namespace PELLUCID_ABI
}  // namespace pellucid
