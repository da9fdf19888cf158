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
#include "law.hpp"
#include "motion_estimator.hpp"
#include "torque_feedback.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct TransparentCompensationParams {
  JointParams<S> body{};  ///< identified; its friction's velocity_width > 0
  S gravity_share = S(1), friction_share = S(0.95), inertia_share = S(0.4), friction_lead{};
  MotionEstimatorParams<S> estimator{};  ///< estimate of the motion
  S acceleration_limit = S(25), energy_store{};
  TorqueFeedbackParams<S> feedback{};        ///< on a force sensor
  EmgPredictionParams<S> emg{};              ///< prediction of the acceleration from EMG; its share 0: none
  AdaptiveOscillatorParams<S> oscillator{};  ///< oscillator for periodic motions
  S oscillator_share{}, oscillator_lead{};
  DisturbanceObserverParams<S> observer{};  ///< observer of what resists beyond the model; its share 0: none
  DitherParams<S> dither{};                 ///< against sticking; its torque 0: none
  SafetyParams<S> gate{};                   ///< the last step; its period is the law's

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pellucid::walk(p.body, visit);
    visit(p.gravity_share, {"gravity_share", unit::one, share(), "s_G, of gravity that is compensated"});
    visit(p.friction_share, {"friction_share", unit::one, share(), "s_F, of friction that is compensated"});
    visit(p.inertia_share, {"inertia_share", unit::one, share(), "s_J, of inertia times acceleration"});
    pellucid::walk(p.estimator, visit);
    visit(p.acceleration_limit, {"acceleration_limit", unit::acceleration, at_least(0),
                                 "limit of the fed forward acceleration"});
    visit(p.energy_store, {"energy_store", unit::energy, at_least(0).or_infinite(), "capacity of the energy observer"});
    pellucid::walk(p.feedback, visit);
    pellucid::walk(p.emg, visit);
    pellucid::walk(p.oscillator, visit);
    visit(p.oscillator_share, {"oscillator_share", unit::one, share(),
                               "share of the acceleration from the oscillator"});
    visit(p.oscillator_lead, {"oscillator_lead", unit::time, any_number(), "prediction time of the oscillator"});
    visit(p.friction_lead, {"friction_lead", unit::time, at_least(0), "prediction time of the velocity for friction"});
    pellucid::walk(p.observer, visit);
    pellucid::walk(p.dither, visit);
    pellucid::walk(p.gate, visit);
  }
};

/// Coefficients computed once from TransparentCompensationParams.
template <class S> struct TransparentCompensationCoefficients {
  TransparentCompensationParams<S> params{};         ///< as they are
  JointCoefficients<S> body{};                       ///< compensated body
  MotionEstimatorCoefficients<S> estimator{};        ///< estimate of the motion
  TorqueFeedbackCoefficients<S> feedback{};          ///< on a force sensor
  EmgPredictionCoefficients<S> emg{};                ///< prediction of the acceleration from EMG
  AdaptiveOscillatorCoefficients<S> oscillator{};    ///< oscillator for periodic motions
  DisturbanceObserverCoefficients<S> observer{};     ///< observer of what resists beyond the model
  DitherCoefficients<S> dither{};                    ///< against sticking
  SafetyCoefficients<S> gate{};                      ///< shut where the parameters make no sense
};

template <class S>
TransparentCompensationCoefficients<S> coefficients(const TransparentCompensationParams<S>& p) noexcept {
  TransparentCompensationCoefficients<S> c;
  c.params = p;
  c.body = coefficients(p.body);
  c.estimator = coefficients(p.estimator, p.gate.period);
  c.feedback = coefficients(p.feedback, p.gate.period);
  c.emg = coefficients(p.emg, p.gate.period);
  c.oscillator = coefficients(p.oscillator, p.gate.period);
  c.observer = coefficients(p.observer, p.gate.period);
  c.dither = coefficients(p.dither, p.gate.period);
  c.gate = coefficients(p.gate);
  c.gate.valid = c.gate.valid && is_sound(p) && p.body.friction.velocity_width > S(smallest_velocity) &&
                 c.estimator.valid && c.feedback.valid && c.emg.valid && c.oscillator.valid && c.observer.valid &&
                 c.dither.valid;
  return c;
}

template <class S> struct TransparentCompensationState {
  MotionEstimatorState<S> motion{};         ///< motion, estimated from the encoder
  TorqueFeedbackState<S> feedback{};        ///< on a force sensor
  EmgPredictionState<S> emg{};              ///< prediction of the acceleration from EMG
  AdaptiveOscillatorState<S> oscillator{};  ///< oscillator for periodic motions
  DisturbanceObserverState<S> observer{};   ///< observer of what resists beyond the model
  DitherState<S> dither{};                  ///< against sticking
  EnergyObserverState<S> energy{};          ///< observer of the energy that drives the wearer
  SafetyState<S> gate{};                    ///< the last step
};

/// The acceleration to feed forward [rad/s^2].
template <class S> S foreseen_acceleration(const TransparentCompensationCoefficients<S>& c,
                                           TransparentCompensationState<S>& state,
                                           const Samples<S>& samples) noexcept {
  const TransparentCompensationParams<S>& p = c.params;
  const MotionEstimatorState<S>& m = state.motion;
  S a = step(c.emg, state.emg, samples.muscle.value, samples.muscle.valid, m.position, m.velocity, m.acceleration);
  if (p.oscillator_share > S(0)) {
    step(c.oscillator, state.oscillator, m.position);
    const PredictedMotion<S> next = predict(c.oscillator, state.oscillator, p.oscillator_lead);
    a = a + p.oscillator_share * next.trust * (next.acceleration - a);
  }
  return clamp(a, -p.acceleration_limit, p.acceleration_limit);
}

/// One control period, with `more` of angle and velocity, in N m, beside what drives: the torque at the joint [N m].
template <class S, class More>
S compensate(const TransparentCompensationCoefficients<S>& c, TransparentCompensationState<S>& state,
             const Samples<S>& samples, const More& more) noexcept {
  const TransparentCompensationParams<S>& p = c.params;
  S wanted = S(0);
  if (c.gate.valid) {
    step(c.estimator, state.motion, samples.position.value);
    const MotionEstimatorState<S>& m = state.motion;
    if (m.started && is_finite(m.position + m.velocity + m.acceleration)) {
      const S a = foreseen_acceleration(c, state, samples);
      const S weight = gravity(c.body, m.position);
      const S soon = m.velocity + p.friction_lead * a;
      const S lost = friction(c.body.friction, soon, weight + p.inertia_share * c.body.inertia * a);
      const S fed_back = step(c.feedback, state.feedback, samples.interaction.value, samples.interaction.valid);
      const S left = state.gate.output - weight - p.body.offset - friction(c.body.friction, m.velocity, weight);
      // The sensor as the feedback hears it: smooth, and without what is its own.
      const S felt = state.feedback.smooth - state.feedback.drift;
      const bool sensed = is_heard(samples.interaction);
      const S unknown = step(c.observer, state.observer, left, felt, sensed, c.body.inertia * m.acceleration);
      const S drive = p.friction_share * lost + p.inertia_share * c.body.inertia * a + fed_back + unknown +
                      more(m.position, m.velocity);
      wanted = p.gravity_share * weight + p.body.offset +
               step(p.energy_store, state.energy, p.gate.period, drive, m.velocity,
                    friction(c.body.friction, m.velocity, weight)) +
               step(c.dither, state.dither);
    } else {
      state.motion = {};
    }
  }
  return guard(c.gate, state.gate, wanted, state.motion.velocity, samples.position);
}

/// One control period: the torque at the joint [N m].
template <class S> S step(const TransparentCompensationCoefficients<S>& c, TransparentCompensationState<S>& state,
                          const Samples<S>& samples) noexcept {
  return compensate(c, state, samples, [](const S&, const S&) { return S(0); });
}

template <class S> void reset(TransparentCompensationState<S>& state) noexcept {
  const SafetyState<S> gate = state.gate;
  state = {};
  state.gate = gate;
  reset(state.gate);
}

template <class S> struct TransparentCompensation {
  using Params = TransparentCompensationParams<S>;
  using Coefficients = TransparentCompensationCoefficients<S>;
  using State = TransparentCompensationState<S>;
  static constexpr const char* name = "transparent";
  static constexpr const char* type = "TransparentCompensation";
  static constexpr const char* title = "compensation of a worn elbow's whole body, with or without a force sensor";
  static constexpr SensorUse sensors[] = {
      {Quantity::position, true, 0.8, 4e-4}, {Quantity::interaction, false, 1.0, 1e-2}, {Quantity::muscle, false, 2.0, 0.05}};
};

}  // namespace PELLUCID_ABI
}  // namespace pellucid
