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
#include "law.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Parameters of compensation in one direction of motion.
template <class S> struct DirectionTerms {
  S gravity_sine{}, gravity_cosine{}, coulomb{}, viscous{}, inertia{}, exponent{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.gravity_sine, {"gravity_sine", unit::effort, any_number(), "g_s, gravity effort per sin q"});
    visit(p.gravity_cosine, {"gravity_cosine", unit::effort, any_number(), "g_c, gravity effort per cos q"});
    visit(p.coulomb, {"coulomb", unit::effort, any_number(), "F; may be negative, as published tables are",
                       by::level.only_one_way()});
    visit(p.viscous, {"viscous", unit::viscous, any_number(), "nu", by::speed.only_one_way()});
    visit(p.inertia, {"inertia", unit::inertia, any_number(), "J"});
    visit(p.exponent, {"exponent", unit::one, any_number(), "k, of |v| in the term that stands in for inertia"});
  }
};

template <class S> struct DirectionalCompensationParams {
  DirectionTerms<S> up{};    ///< v > 0
  DirectionTerms<S> down{};  ///< v < 0
  S dead_band{}, inertia_limit{};
  EncoderSpeedParams<S> speed{};  ///< estimate of the velocity from the encoder
  SafetyParams<S> gate{};         ///< the last step; its period is the law's

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    auto upwards = suffixed(visit, "_up"), downwards = suffixed(visit, "_down");
    pellucid::walk(p.up, upwards);
    pellucid::walk(p.down, downwards);
    visit(p.dead_band, {"dead_band", unit::velocity, above(0), "speeds below are rest"});
    visit(p.inertia_limit, {"inertia_limit", unit::effort, at_least(0), "limit of |J |v|^k|"});
    pellucid::walk(p.speed, visit);
    pellucid::walk(p.gate, visit);
  }
};

/// Coefficients computed once from DirectionalCompensationParams.
template <class S> struct DirectionalCompensationCoefficients {
  DirectionalCompensationParams<S> params{};  ///< as they are
  EncoderSpeedCoefficients<S> speed{};        ///< estimate of the velocity from the encoder
  SafetyCoefficients<S> gate{};               ///< shut where the parameters make no sense
};

template <class S>
DirectionalCompensationCoefficients<S> coefficients(const DirectionalCompensationParams<S>& p) noexcept {
  DirectionalCompensationCoefficients<S> c{p, coefficients(p.speed, p.gate.period), coefficients(p.gate)};
  c.gate.valid = c.gate.valid && is_sound(p);
  return c;
}

template <class S> struct DirectionalCompensationState {
  EncoderSpeedState<S> speed{};  ///< estimate of the velocity from the encoder
  SafetyState<S> gate{};         ///< the last step
};

/// J |v|^k within its limit, for a speed above the dead band [N m].
template <class S> S inertia_term(const DirectionTerms<S>& t, const S& limit, const S& speed) noexcept {
  return clamp(t.inertia * exp(t.exponent * log(speed)), -limit, limit);
}

/// One control period: the torque at the joint [N m].
template <class S> S step(const DirectionalCompensationCoefficients<S>& c, DirectionalCompensationState<S>& state,
                          const Samples<S>& samples) noexcept {
  const DirectionalCompensationParams<S>& p = c.params;
  const S velocity = step(c.speed, state.speed, samples.position.value);
  S wanted = S(0);
  if (is_finite(samples.position.value)) {
    const SinCos<S> at = sincos(samples.position.value);
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
  return guard(c.gate, state.gate, wanted, velocity, samples.position);
}

template <class S> void reset(DirectionalCompensationState<S>& state) noexcept {
  state.speed = {};
  reset(state.gate);
}

template <class S> struct DirectionalCompensation {
  using Params = DirectionalCompensationParams<S>;
  using Coefficients = DirectionalCompensationCoefficients<S>;
  using State = DirectionalCompensationState<S>;
  static constexpr const char* name = "directional";
  static constexpr const char* type = "DirectionalCompensation";
  static constexpr const char* title = "open-loop compensation of a worn elbow, by direction";
  static constexpr SensorUse sensors[] = {{Quantity::position, true, 0.8, 4e-4}};
};

}  // namespace PELLUCID_ABI
}  // namespace pellucid
