// A robot that is led by hand under position control: each period it is sent to where it would be in a period.
//
//   q*_k = q_{k-1} + h v_{k-1},   u = K (q*_k - q_k) + g_s sin q + g_c cos q + F sign(v)
//
// v is the encoder's difference over a few samples. Gravity and Coulomb friction are one set for both directions;
// viscous friction and inertia are not compensated. The loop itself resists every change of the velocity it believes in.
#pragma once

#include "encoder_speed.hpp"
#include "law.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct PositionPredictionParams {
  S gravity_sine{}, gravity_cosine{}, coulomb{}, stiffness{}, dead_band{};
  EncoderSpeedParams<S> speed{};  ///< estimate of the velocity from the encoder
  SafetyParams<S> gate{};         ///< the last step; its period is the law's

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.gravity_sine, {"gravity_sine", unit::effort, any_number(), "g_s, gravity effort per sin q"});
    visit(p.gravity_cosine, {"gravity_cosine", unit::effort, any_number(), "g_c, gravity effort per cos q"});
    visit(p.coulomb, {"coulomb", unit::effort, at_least(0), "F, of both directions", by::level});
    visit(p.stiffness, {"stiffness", unit::stiffness, at_least(0), "K, of the loop"});
    visit(p.dead_band, {"dead_band", unit::velocity, at_least(0).or_infinite(), "speeds below are rest"});
    pellucid::walk(p.speed, visit);
    pellucid::walk(p.gate, visit);
  }
};

/// Coefficients computed once from PositionPredictionParams.
template <class S> struct PositionPredictionCoefficients {
  PositionPredictionParams<S> params{};  ///< as they are
  EncoderSpeedCoefficients<S> speed{};   ///< estimate of the velocity from the encoder
  SafetyCoefficients<S> gate{};          ///< shut where the parameters make no sense
};

template <class S> PositionPredictionCoefficients<S> coefficients(const PositionPredictionParams<S>& p) noexcept {
  PositionPredictionCoefficients<S> c{p, coefficients(p.speed, p.gate.period), coefficients(p.gate)};
  c.gate.valid = c.gate.valid && is_sound(p);
  return c;
}

template <class S> struct PositionPredictionState {
  EncoderSpeedState<S> speed{};  ///< estimate of the velocity from the encoder
  S predicted{};                 ///< q*, where this sample should be [rad]
  bool started = false;          ///< whether there is a prediction
  SafetyState<S> gate{};         ///< the last step
};

/// One control period: the torque at the joint [N m].
template <class S> S step(const PositionPredictionCoefficients<S>& c, PositionPredictionState<S>& state,
                          const Samples<S>& samples) noexcept {
  const S velocity = step(c.speed, state.speed, samples.position.value);
  S wanted = S(0);
  if (is_finite(samples.position.value)) {
    const SinCos<S> at = sincos(samples.position.value);
    const S direction = abs(velocity) > c.params.dead_band ? sign(velocity) : S(0);
    wanted = c.params.gravity_sine * at.sin + c.params.gravity_cosine * at.cos + c.params.coulomb * direction;
    if (state.started) wanted = wanted + c.params.stiffness * (state.predicted - samples.position.value);
    state.predicted = samples.position.value + c.params.gate.period * velocity;
  }
  state.started = is_finite(samples.position.value);
  return guard(c.gate, state.gate, wanted, velocity, samples.position);
}

template <class S> void reset(PositionPredictionState<S>& state) noexcept {
  state.speed = {};
  state.started = false;
  reset(state.gate);
}

template <class S> struct PositionPrediction {
  using Params = PositionPredictionParams<S>;
  using Coefficients = PositionPredictionCoefficients<S>;
  using State = PositionPredictionState<S>;
  static constexpr const char* name = "position_prediction";
  static constexpr const char* type = "PositionPrediction";
  static constexpr const char* title = "closed-loop position control of a worn elbow";
  static constexpr SensorUse sensors[] = {{Quantity::position, true, 0.8, 4e-4}};
};

}  // namespace PELLUCID_ABI
}  // namespace pellucid
