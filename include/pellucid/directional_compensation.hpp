// Open-loop compensation with one set of parameters for each direction of motion, as published for an arm exoskeleton:
//
//   u = g_s sin q + g_c cos q + F sign(v) + nu v + sign(v) J |v|^k,    every symbol that of the direction of v
//
// D. Verdel et al., "An identification-based method improving the transparency of a robotic upper limb exoskeleton",
// Robotica 39, 2021, figure 5 and equation 8. The last term stands in for inertia; printed as J v^k it is infinite at
// rest, has no value for v < 0 and a broken k, and pushes at constant velocity. Here it has a sign, a dead band and a
// limit. At rest gravity is the mean of both sets, and nothing else acts: crossing the dead band is a step of torque.
#pragma once

#include "encoder_speed.hpp"
#include "position_prediction.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// What is compensated while the joint moves one way.
template <class S> struct DirectionTerms {
  S gravity_sine{};    ///< g_s [N m]
  S gravity_cosine{};  ///< g_c [N m]
  S coulomb{};         ///< F [N m]; may be negative, as published tables are
  S viscous{};         ///< nu [N m s/rad]
  S inertia{};         ///< J [kg m^2]
  S exponent{};        ///< k [1]
};

template <class S> struct DirectionalCompensationParams {
  DirectionTerms<S> up{};         ///< v > 0
  DirectionTerms<S> down{};       ///< v < 0
  S dead_band{};                  ///< speeds below are rest [rad/s], > 0
  S inertia_limit{};              ///< of |J |v|^k| [N m], >= 0
  EncoderSpeedParams<S> speed{};  ///< of the velocity
  SafetyParams<S> gate{};         ///< the last step; its period is the law's
};

/// How many numbers the law is, in the one order that every array of them has.
constexpr std::size_t directional_parameter_count = 24;
constexpr const char* directional_parameter_names[directional_parameter_count] = {
    "gravity_sine_up",   "gravity_cosine_up",   "coulomb_up",   "viscous_up",     "inertia_up",    "exponent_up",
    "gravity_sine_down", "gravity_cosine_down", "coulomb_down", "viscous_down",   "inertia_down",  "exponent_down",
    "dead_band",         "inertia_limit",       "speed_span",   "effort_limit",   "rate_limit",    "velocity_limit",
    "position_min",      "position_max",        "stop_margin",  "max_age",        "max_repeats",   "period"};

/// DirectionalCompensationParams from numbers in the order of their names.
template <class S> DirectionalCompensationParams<S> law_params(const S (&v)[directional_parameter_count]) noexcept {
  return {{v[0], v[1], v[2], v[3], v[4], v[5]},
          {v[6], v[7], v[8], v[9], v[10], v[11]},
          v[12],
          v[13],
          {count_from(v[14]), v[23]},
          gate_from(v + 15)};
}

/// What follows from DirectionalCompensationParams once.
template <class S> struct DirectionalCompensationCoefficients {
  DirectionalCompensationParams<S> params{};  ///< as they are
  EncoderSpeedCoefficients<S> speed{};        ///< of the velocity
  SafetyCoefficients<S> gate{};               ///< shut where the parameters make no sense
};

template <class S>
DirectionalCompensationCoefficients<S> coefficients(const DirectionalCompensationParams<S>& p) noexcept {
  DirectionalCompensationCoefficients<S> c{p, coefficients(p.speed), coefficients(p.gate)};
  bool sound = p.dead_band > S(0) && is_finite(p.dead_band) && p.inertia_limit >= S(0) && is_finite(p.inertia_limit);
  const DirectionTerms<S>* const both_ways[] = {&p.up, &p.down};
  for (const DirectionTerms<S>* t : both_ways)
    sound = sound && is_finite(t->gravity_sine + t->gravity_cosine) && is_finite(t->coulomb + t->viscous) &&
            is_finite(t->inertia + t->exponent);
  c.gate.valid = c.gate.valid && sound;
  return c;
}

template <class S> struct DirectionalCompensationState {
  EncoderSpeedState<S> speed{};  ///< of the velocity
  SafetyState<S> gate{};         ///< the last step
};

/// J |v|^k within its limit, for a speed above the dead band [N m].
template <class S> S inertia_term(const DirectionTerms<S>& t, const S& limit, const S& speed) noexcept {
  return clamp(t.inertia * exp(t.exponent * log(speed)), -limit, limit);
}

/// One control period: the torque at the joint [N m].
template <class S> S step(const DirectionalCompensationCoefficients<S>& c, DirectionalCompensationState<S>& state,
                          const LawInput<S>& input) noexcept {
  const DirectionalCompensationParams<S>& p = c.params;
  const S velocity = step(c.speed, state.speed, input.position);
  S wanted = S(0);
  if (is_finite(input.position)) {
    const SinCos<S> at = sincos(input.position);
    const S speed = abs(velocity);
    if (speed > p.dead_band) {
      const DirectionTerms<S>& t = velocity > S(0) ? p.up : p.down;
      wanted = t.gravity_sine * at.sin + t.gravity_cosine * at.cos + t.viscous * velocity +
               sign(velocity) * (t.coulomb + inertia_term(t, p.inertia_limit, speed));
    } else {
      wanted = S(0.5) * ((p.up.gravity_sine + p.down.gravity_sine) * at.sin +
                         (p.up.gravity_cosine + p.down.gravity_cosine) * at.cos);
    }
  }
  return guard(c.gate, state.gate, wanted, velocity, input);
}

template <class S> void reset(DirectionalCompensationState<S>& state) noexcept {
  state.speed = {};
  reset(state.gate);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
