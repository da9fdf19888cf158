// Compensation of one coherent body, made so that it cannot chatter, drive, or wait for a motion that it could foresee.
//
//   u = s_G G(q) + s_F friction(v, load) + s_J J a + feedback of the interaction torque + s_D d + tremble
//
// q, v and a come from a Kalman filter of the encoder; friction changes its sign smoothly, is never negative, and may
// depend on the load; a may be led by EMG or by an oscillator that has learnt a periodic motion; d is what a force
// sensor shows beyond the model. No share is above 1, so that what is left keeps its sign; what drives passes the
// energy observer, and everything the gate.
#pragma once

#include "adaptive_oscillator.hpp"
#include "disturbance_observer.hpp"
#include "dither.hpp"
#include "emg_prediction.hpp"
#include "energy_observer.hpp"
#include "joint.hpp"
#include "motion_estimator.hpp"
#include "position_prediction.hpp"
#include "torque_feedback.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct TransparentCompensationParams {
  JointParams<S> body{};                  ///< identified; its friction's velocity_width > 0
  S gravity_share{};                      ///< s_G [1], 0 to 1
  S friction_share{};                     ///< s_F [1], 0 to 1
  S inertia_share{};                      ///< s_J [1], 0 to 1
  S friction_lead{};                      ///< how far ahead friction's velocity is foreseen [s], >= 0
  MotionEstimatorParams<S> estimator{};   ///< of the motion
  S acceleration_limit{};                 ///< of what is fed forward [rad/s^2], >= 0
  S energy_store{};                       ///< of the energy observer [J], >= 0
  TorqueFeedbackParams<S> feedback{};     ///< on a force sensor
  EmgPredictionParams<S> emg{};           ///< of the acceleration; its share 0: none
  AdaptiveOscillatorParams<S> oscillator{};  ///< of periodic motions
  S oscillator_share{};                      ///< how much of the acceleration is the oscillator's, 0 to 1
  S oscillator_lead{};                       ///< how far ahead it looks [s]
  DisturbanceObserverParams<S> observer{};   ///< of what resists beyond the model; its share 0: none
  DitherParams<S> dither{};                  ///< against sticking; its torque 0: none
  SafetyParams<S> gate{};                    ///< the last step; its period is the law's
};

/// How many numbers the law is, in the one order that every array of them has.
constexpr std::size_t transparent_parameter_count = 58;
constexpr const char* transparent_parameter_names[transparent_parameter_count] = {
    "inertia",           "gravity_sine",       "gravity_cosine",   "offset",
    "coulomb_positive",  "coulomb_negative",   "viscous_positive", "viscous_negative",
    "stribeck",          "stribeck_velocity",  "load_motoring",    "load_generating",
    "velocity_width",    "gravity_share",      "friction_share",   "inertia_share",
    "bandwidth",         "innovation_gate",    "max_rejections",   "acceleration_limit",
    "energy_store",      "proportional",       "integral",         "leak",
    "sensor_lowpass",    "sensor_drift",       "feedback_limit",   "limb_inertia",
    "limb_gravity",      "limb_viscous",       "emg_slow",         "emg_limit",
    "emg_share",         "frequency",          "frequency_min",    "frequency_max",
    "phase_rate",        "frequency_rate",     "amplitude_rate",   "least_amplitude",
    "oscillator_share",  "oscillator_lead",    "friction_lead",    "disturbance_share",
    "disturbance_lowpass", "disturbance_delay", "disturbance_limit", "dither",
    "dither_frequency",  "effort_limit",       "rate_limit",       "velocity_limit",
    "position_min",      "position_max",       "stop_margin",      "max_age",
    "max_repeats",       "period"};

/// TransparentCompensationParams from numbers in the order of their names.
template <class S>
TransparentCompensationParams<S> law_params(const S (&v)[transparent_parameter_count]) noexcept {
  TransparentCompensationParams<S> p;
  const S period = v[57];
  p.body = {v[0], v[1], v[2], v[3], {v[4], v[5], v[6], v[7], v[8], v[9], v[10], v[11], v[12]}};
  p.gravity_share = v[13];
  p.friction_share = v[14];
  p.inertia_share = v[15];
  p.estimator = {v[16], v[17], count_from(v[18]), period};
  p.acceleration_limit = v[19];
  p.energy_store = v[20];
  p.feedback = {v[21], v[22], v[23], v[24], v[25], v[26]};
  p.emg = {v[27], v[28], v[29], v[30], v[31], v[32]};
  p.oscillator = {v[33], v[34], v[35], v[36], v[37], v[38], v[39], period};
  p.oscillator_share = v[40];
  p.oscillator_lead = v[41];
  p.friction_lead = v[42];
  p.observer = {v[43], v[44], v[45], v[46]};
  p.dither = {v[47], v[48]};
  p.gate = gate_from(v + 49);
  return p;
}

/// What follows from TransparentCompensationParams once.
template <class S> struct TransparentCompensationCoefficients {
  TransparentCompensationParams<S> params{};         ///< as they are
  JointCoefficients<S> body{};                       ///< what is compensated
  MotionEstimatorCoefficients<S> estimator{};        ///< of the motion
  TorqueFeedbackCoefficients<S> feedback{};          ///< on a force sensor
  EmgPredictionCoefficients<S> emg{};                ///< of the acceleration
  AdaptiveOscillatorCoefficients<S> oscillator{};    ///< of periodic motions
  DisturbanceObserverCoefficients<S> observer{};     ///< of what resists beyond the model
  DitherCoefficients<S> dither{};                    ///< against sticking
  SafetyCoefficients<S> gate{};                      ///< shut where the parameters make no sense
};

template <class S>
TransparentCompensationCoefficients<S> coefficients(const TransparentCompensationParams<S>& p) noexcept {
  TransparentCompensationCoefficients<S> c;
  c.params = p;
  c.body = coefficients(p.body);
  c.estimator = coefficients(p.estimator);
  c.feedback = coefficients(p.feedback, p.gate.period);
  c.emg = coefficients(p.emg, p.gate.period);
  c.oscillator = coefficients(p.oscillator);
  c.observer = coefficients(p.observer, p.gate.period);
  c.dither = coefficients(p.dither, p.gate.period);
  c.gate = coefficients(p.gate);
  const auto share = [](const S& x) { return x >= S(0) && x <= S(1); };
  const FrictionParams<S>& f = p.body.friction;
  bool sound = c.estimator.valid && c.feedback.valid && c.emg.valid && c.oscillator.valid &&
               c.observer.valid && c.dither.valid;
  sound = sound && share(p.gravity_share) && share(p.friction_share) && share(p.inertia_share) &&
          share(p.oscillator_share) && p.acceleration_limit >= S(0) && is_finite(p.acceleration_limit) &&
          p.energy_store >= S(0) && is_finite(p.oscillator_lead) && p.friction_lead >= S(0) &&
          is_finite(p.friction_lead);
  sound = sound && p.body.inertia >= S(0) && is_finite(p.body.inertia + p.body.offset) &&
          is_finite(p.body.gravity_sine + p.body.gravity_cosine) && f.velocity_width > S(smallest_velocity);
  // Friction that could be negative would drive the joint.
  const S never_negative[] = {f.coulomb_positive, f.coulomb_negative, f.viscous_positive, f.viscous_negative,
                              f.stribeck,         f.load_motoring,    f.load_generating};
  for (const S x : never_negative)
    sound = sound && x >= S(0) && is_finite(x);
  c.gate.valid = c.gate.valid && sound;
  return c;
}

template <class S> struct TransparentCompensationState {
  MotionEstimatorState<S> motion{};         ///< of the encoder
  TorqueFeedbackState<S> feedback{};        ///< on a force sensor
  EmgPredictionState<S> emg{};              ///< of the acceleration
  AdaptiveOscillatorState<S> oscillator{};  ///< of periodic motions
  DisturbanceObserverState<S> observer{};   ///< of what resists beyond the model
  DitherState<S> dither{};                  ///< against sticking
  EnergyObserverState<S> energy{};          ///< of what drives
  SafetyState<S> gate{};                    ///< the last step
};

/// The acceleration to feed forward [rad/s^2].
template <class S> S foreseen_acceleration(const TransparentCompensationCoefficients<S>& c,
                                           TransparentCompensationState<S>& state,
                                           const LawInput<S>& input) noexcept {
  const TransparentCompensationParams<S>& p = c.params;
  const MotionEstimatorState<S>& m = state.motion;
  S a = step(c.emg, state.emg, input.muscle, input.has_muscle, m.position, m.velocity, m.acceleration);
  if (p.oscillator_share > S(0)) {
    step(c.oscillator, state.oscillator, m.position);
    const PredictedMotion<S> next = predict(c.oscillator, state.oscillator, p.oscillator_lead);
    a = a + p.oscillator_share * next.trust * (next.acceleration - a);
  }
  return clamp(a, -p.acceleration_limit, p.acceleration_limit);
}

/// One control period: the torque at the joint [N m].
template <class S> S step(const TransparentCompensationCoefficients<S>& c, TransparentCompensationState<S>& state,
                          const LawInput<S>& input) noexcept {
  const TransparentCompensationParams<S>& p = c.params;
  S wanted = S(0);
  if (c.gate.valid) {
    step(c.estimator, state.motion, input.position);
    const MotionEstimatorState<S>& m = state.motion;
    if (m.started && is_finite(m.position + m.velocity + m.acceleration)) {
      const S a = foreseen_acceleration(c, state, input);
      const S weight = gravity(c.body, m.position);
      const S soon = m.velocity + p.friction_lead * a;
      const S lost = friction(c.body.friction, soon, weight + p.inertia_share * c.body.inertia * a);
      const S fed_back = step(c.feedback, state.feedback, input.interaction, input.has_interaction);
      const S left = state.gate.output - weight - p.body.offset - friction(c.body.friction, m.velocity, weight);
      // The sensor as the feedback hears it: smooth, and without what is its own.
      const S felt = state.feedback.smooth - state.feedback.drift;
      const bool sensed = input.has_interaction && is_finite(input.interaction);
      const S unknown = step(c.observer, state.observer, left, felt, sensed, c.body.inertia * m.acceleration);
      const S drive = p.friction_share * lost + p.inertia_share * c.body.inertia * a + fed_back + unknown;
      wanted = p.gravity_share * weight + p.body.offset +
               step(p.energy_store, state.energy, p.gate.period, drive, m.velocity,
                    friction(c.body.friction, m.velocity, weight)) +
               step(c.dither, state.dither);
    } else {
      state.motion = {};
    }
  }
  return guard(c.gate, state.gate, wanted, state.motion.velocity, input);
}

template <class S> void reset(TransparentCompensationState<S>& state) noexcept {
  const SafetyState<S> gate = state.gate;
  state = {};
  state.gate = gate;
  reset(state.gate);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
