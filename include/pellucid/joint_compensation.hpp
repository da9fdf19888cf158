// Carries a joint's own gravity and friction, from its encoder alone.
//
//   u = s_G (G(q) + offset) + s_F friction(v, G(q))
//
// The velocity comes from an alpha-beta filter with both poles at exp(-w T). Friction changes its sign smoothly and
// only a share of it is carried, so that what is left resists: nothing is driven. The last step is the safety gate.
#pragma once

#include "joint.hpp"
#include "law.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct JointCompensationParams {
  JointParams<S> body{};  ///< identified body; its friction's velocity_width > 0
  S gravity_share = S(1), friction_share = S(0.8), bandwidth = S(200);
  SafetyParams<S> gate{};  ///< its period is the controller's

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pellucid::walk(p.body, visit);
    visit(p.gravity_share, {"gravity_share", unit::one, share(), "s_G, of gravity that is carried"});
    visit(p.friction_share, {"friction_share", unit::one, share(), "s_F, of friction that is carried"});
    visit(p.bandwidth, {"bandwidth", unit::rate, above(0), "w, of the velocity's filter"});
    pellucid::walk(p.gate, visit);
  }
};

/// Coefficients computed once from JointCompensationParams.
template <class S> struct JointCompensationCoefficients {
  JointCoefficients<S> body{};   ///< compensated body
  SafetyCoefficients<S> gate{};  ///< gate of the last step; shut if anything makes no sense
  S gravity_share{};             ///< s_G [1]
  S friction_share{};            ///< s_F [1]
  S correct_position{};          ///< per position that the encoder is off [1]
  S correct_velocity{};          ///< the same of the velocity [1/s]
};

template <class S>
JointCompensationCoefficients<S> coefficients(const JointCompensationParams<S>& p) noexcept {
  JointCompensationCoefficients<S> c;
  c.body = coefficients(p.body);
  c.gate = coefficients(p.gate);
  c.gravity_share = p.gravity_share;
  c.friction_share = p.friction_share;
  const S pole = exp(-p.bandwidth * p.gate.period);
  c.correct_position = S(1) - pole * pole;
  c.correct_velocity = (S(1) - pole) * (S(1) - pole) / p.gate.period;
  c.gate.valid = c.gate.valid && is_sound(p) && p.body.friction.velocity_width > S(smallest_velocity) &&
                 is_finite(c.correct_velocity);
  return c;
}

/// State of a compensation.
template <class S> struct JointCompensationState {
  S position{};                ///< filtered [rad]
  S velocity{};                ///< [rad/s]
  std::int64_t time = 0;       ///< time of the last new sample [us]
  std::uint32_t sequence = 0;  ///< sequence number of the last new sample
  bool started = false;        ///< false until the first sample
  SafetyState<S> gate{};       ///< gate of the last step
};

/// Follows the encoder over the time that really passed; a sample seen again teaches nothing.
template <class S> void follow(const JointCompensationCoefficients<S>& c, JointCompensationState<S>& s,
                               const Sample<S>& encoder) noexcept {
  if (!s.started) {
    s.position = encoder.value;
    s.velocity = S(0);
    s.started = true;
  } else if (encoder.sequence != s.sequence) {
    const std::uint64_t gap = static_cast<std::uint64_t>(encoder.time) - static_cast<std::uint64_t>(s.time);
    const S passed = gap < 1000000u ? static_cast<S>(static_cast<std::int32_t>(gap)) * S(1e-6) : S(0);
    const S foreseen = s.position + passed * s.velocity;
    const S off = encoder.value - foreseen;
    s.position = foreseen + c.correct_position * off;
    s.velocity = s.velocity + c.correct_velocity * off;
  }
  s.time = encoder.time;
  s.sequence = encoder.sequence;
}

/// Opens the gate again and starts the filter from the next sample.
template <class S> void reset(JointCompensationState<S>& s) noexcept {
  const SafetyState<S> gate = s.gate;
  s = {};
  s.gate = gate;
  reset(s.gate);
}

/// One control period: the effort for the drive [N m]. A fault latches the gate, and the effort ramps to 0.
template <class S> S step(const JointCompensationCoefficients<S>& c, JointCompensationState<S>& s,
                          const Samples<S>& samples) noexcept {
  S wanted = S(0);
  if (c.gate.valid && is_heard(samples.position)) {
    follow(c, s, samples.position);
    const S weight = gravity(c.body, s.position);
    wanted = c.gravity_share * (weight + c.body.offset) +
             c.friction_share * friction(c.body.friction, s.velocity, weight);
  }
  if (!is_finite(s.position) || !is_finite(s.velocity)) s.started = false;
  return guard(c.gate, s.gate, wanted, s.velocity, samples.position);
}

template <class S> struct JointCompensation {
  using Params = JointCompensationParams<S>;
  using Coefficients = JointCompensationCoefficients<S>;
  using State = JointCompensationState<S>;
  static constexpr const char* name = "joint";
  static constexpr const char* type = "JointCompensation";
  static constexpr const char* title = "compensation of a joint's gravity and friction";
  static constexpr SensorUse sensors[] = {{Quantity::position, true, 0.8, 4e-4}};
};

}  // namespace PELLUCID_ABI
}  // namespace pellucid
