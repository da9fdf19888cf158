// A robot that is led by hand under position control: each period it is sent to where it would be in a period.
//
//   q*_k = q_{k-1} + h v_{k-1},   u = K (q*_k - q_k) + g_s sin q + g_c cos q + F sign(v)
//
// v is the encoder's difference over a few samples. Gravity and Coulomb friction are one set for both directions;
// viscous friction and inertia are not compensated. The loop itself resists every change of the velocity it believes in.
#pragma once

#include "encoder_speed.hpp"
#include "law_input.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct PositionPredictionParams {
  S gravity_sine{};            ///< g_s [N m]
  S gravity_cosine{};          ///< g_c [N m]
  S coulomb{};                 ///< F [N m], >= 0
  S stiffness{};               ///< K [N m/rad], >= 0
  S dead_band{};               ///< speeds below are rest [rad/s], >= 0
  EncoderSpeedParams<S> speed{};  ///< of the velocity
  SafetyParams<S> gate{};         ///< the last step; its period is the law's
};

/// How many numbers the law is, in the one order that every array of them has.
constexpr std::size_t position_prediction_parameter_count = 15;
constexpr const char* position_prediction_parameter_names[position_prediction_parameter_count] = {
    "gravity_sine", "gravity_cosine", "coulomb",      "stiffness",    "dead_band",
    "speed_span",   "effort_limit",   "rate_limit",   "velocity_limit", "position_min",
    "position_max", "stop_margin",    "max_age",      "max_repeats",  "period"};

/// A count from a number of an array: 0 where it is none.
template <class S> std::uint32_t count_from(const S& number) noexcept {
  return number >= S(0) && number <= S(1e6) ? static_cast<std::uint32_t>(number) : 0;
}
/// The gate from the nine numbers with which every law's array ends.
template <class S> SafetyParams<S> gate_from(const S* v) noexcept {
  return {v[0], v[1], v[2], v[3], v[4], v[5], v[6], count_from(v[7]), v[8]};
}

/// PositionPredictionParams from numbers in the order of their names.
template <class S>
PositionPredictionParams<S> law_params(const S (&v)[position_prediction_parameter_count]) noexcept {
  return {v[0], v[1], v[2], v[3], v[4], {count_from(v[5]), v[14]}, gate_from(v + 6)};
}

/// What follows from PositionPredictionParams once.
template <class S> struct PositionPredictionCoefficients {
  PositionPredictionParams<S> params{};  ///< as they are
  EncoderSpeedCoefficients<S> speed{};   ///< of the velocity
  SafetyCoefficients<S> gate{};          ///< shut where the parameters make no sense
};

template <class S> PositionPredictionCoefficients<S> coefficients(const PositionPredictionParams<S>& p) noexcept {
  PositionPredictionCoefficients<S> c{p, coefficients(p.speed), coefficients(p.gate)};
  c.gate.valid = c.gate.valid && is_finite(p.gravity_sine + p.gravity_cosine) && p.coulomb >= S(0) &&
                 is_finite(p.coulomb) && p.stiffness >= S(0) && is_finite(p.stiffness) && p.dead_band >= S(0);
  return c;
}

template <class S> struct PositionPredictionState {
  EncoderSpeedState<S> speed{};  ///< of the velocity
  S predicted{};                 ///< q*, where this sample should be [rad]
  bool started = false;          ///< whether there is a prediction
  SafetyState<S> gate{};         ///< the last step
};

/// One control period: the torque at the joint [N m].
template <class S> S step(const PositionPredictionCoefficients<S>& c, PositionPredictionState<S>& state,
                          const LawInput<S>& input) noexcept {
  const S velocity = step(c.speed, state.speed, input.position);
  S wanted = S(0);
  if (is_finite(input.position)) {
    const SinCos<S> at = sincos(input.position);
    const S direction = abs(velocity) > c.params.dead_band ? sign(velocity) : S(0);
    wanted = c.params.gravity_sine * at.sin + c.params.gravity_cosine * at.cos + c.params.coulomb * direction;
    if (state.started) wanted = wanted + c.params.stiffness * (state.predicted - input.position);
    state.predicted = input.position + c.params.gate.period * velocity;
  }
  state.started = is_finite(input.position);
  return guard(c.gate, state.gate, wanted, velocity, input);
}

template <class S> void reset(PositionPredictionState<S>& state) noexcept {
  state.speed = {};
  state.started = false;
  reset(state.gate);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
