// Carries a joint's own gravity and friction, from its encoder alone.
//
//   u = s_G (G(q) + offset) + s_F friction(v, G(q))
//
// The velocity comes from an alpha-beta filter with both poles at exp(-w T). Friction changes its sign smoothly and
// only a share of it is carried, so that what is left resists: nothing is driven. The last step is the safety gate.
#pragma once

#include "joint.hpp"
#include "safety.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct JointCompensationParams {
  JointParams<S> body{};   ///< what was identified; its friction's velocity_width > 0
  S gravity_share{};       ///< s_G [1], 0 to 1
  S friction_share{};      ///< s_F [1], 0 to 1
  S bandwidth{};           ///< w, of the velocity's filter [rad/s], > 0
  SafetyParams<S> gate{};  ///< of the gate; its period is the controller's
};

/// The order in which JointCompensationParams come as an array.
constexpr const char* joint_compensation_parameter_names[] = {
    "inertia",           "gravity_sine",     "gravity_cosine",   "offset",         "coulomb_positive",
    "coulomb_negative",  "viscous_positive", "viscous_negative", "stribeck",       "stribeck_velocity",
    "load_motoring",     "load_generating",  "velocity_width",   "gravity_share",  "friction_share",
    "bandwidth",         "effort_limit",     "rate_limit",       "velocity_limit", "position_min",
    "position_max",      "stop_margin",      "max_age",          "max_repeats",    "period"};
constexpr std::size_t joint_compensation_parameter_count =
    sizeof joint_compensation_parameter_names / sizeof *joint_compensation_parameter_names;

/// JointCompensationParams from their array.
template <class S>
JointCompensationParams<S> joint_compensation_params(const S (&v)[joint_compensation_parameter_count]) noexcept {
  JointCompensationParams<S> p;
  p.body = {v[0], v[1], v[2], v[3], {v[4], v[5], v[6], v[7], v[8], v[9], v[10], v[11], v[12]}};
  p.gravity_share = v[13];
  p.friction_share = v[14];
  p.bandwidth = v[15];
  // Counts that a 32-bit integer cannot hold are none.
  const std::uint32_t repeats = v[23] >= S(0) && v[23] <= S(1e6) ? static_cast<std::uint32_t>(v[23]) : 0;
  p.gate = {v[16], v[17], v[18], v[19], v[20], v[21], v[22], repeats, v[24]};
  return p;
}

/// What follows from JointCompensationParams once.
template <class S> struct JointCompensationCoefficients {
  JointCoefficients<S> body{};   ///< what is carried
  SafetyCoefficients<S> gate{};  ///< of the last step; shut if anything makes no sense
  S gravity_share{};             ///< s_G [1]
  S friction_share{};            ///< s_F [1]
  S correct_position{};          ///< per position that the encoder is off [1]
  S correct_velocity{};          ///< the same of the velocity [1/s]
};

template <class S>
JointCompensationCoefficients<S> coefficients(const JointCompensationParams<S>& p) noexcept {
  JointCompensationCoefficients<S> c;
  const FrictionParams<S>& f = p.body.friction;
  c.body = coefficients(p.body);
  c.gate = coefficients(p.gate);
  c.gravity_share = p.gravity_share;
  c.friction_share = p.friction_share;
  const S pole = exp(-p.bandwidth * p.gate.period);
  c.correct_position = S(1) - pole * pole;
  c.correct_velocity = (S(1) - pole) * (S(1) - pole) / p.gate.period;
  bool sound = p.gravity_share >= S(0) && p.gravity_share <= S(1) && p.friction_share >= S(0) &&
               p.friction_share <= S(1) && p.bandwidth > S(0) && is_finite(p.bandwidth) &&
               is_finite(c.correct_velocity) && is_finite(p.body.gravity_sine + p.body.gravity_cosine) &&
               is_finite(p.body.offset) && f.velocity_width > S(smallest_velocity) && is_finite(f.velocity_width) &&
               is_finite(f.stribeck_velocity);
  // Friction that could be negative would drive the joint.
  const S resisting[] = {f.coulomb_positive, f.coulomb_negative, f.viscous_positive, f.viscous_negative,
                         f.stribeck,         f.load_motoring,    f.load_generating};
  for (const S x : resisting) sound = sound && x >= S(0) && is_finite(x);
  c.gate.valid = c.gate.valid && sound;
  return c;
}

/// What a compensation remembers.
template <class S> struct JointCompensationState {
  S position{};                ///< filtered [rad]
  S velocity{};                ///< [rad/s]
  std::int64_t time = 0;       ///< of the last new sample [us]
  std::uint32_t sequence = 0;  ///< of the last new sample
  bool started = false;        ///< false until the first sample
  SafetyState<S> gate{};       ///< of the last step
};

/// What a compensation is given each period.
template <class S> struct JointCompensationInput {
  S position{};                ///< of the encoder [rad]
  std::int64_t time = 0;       ///< of the sample [us]
  std::uint32_t sequence = 0;  ///< number of the sample
  bool valid = true;           ///< false: the encoder itself says that this is no measurement
};

/// Follows the encoder over the time that really passed; a sample seen again teaches nothing.
template <class S> void follow(const JointCompensationCoefficients<S>& c, JointCompensationState<S>& s,
                               const JointCompensationInput<S>& input) noexcept {
  if (!s.started) {
    s.position = input.position;
    s.velocity = S(0);
    s.started = true;
  } else if (input.sequence != s.sequence) {
    const std::uint64_t gap = static_cast<std::uint64_t>(input.time) - static_cast<std::uint64_t>(s.time);
    const S passed = gap < 1000000u ? static_cast<S>(static_cast<std::int32_t>(gap)) * S(1e-6) : S(0);
    const S foreseen = s.position + passed * s.velocity;
    const S off = input.position - foreseen;
    s.position = foreseen + c.correct_position * off;
    s.velocity = s.velocity + c.correct_velocity * off;
  }
  s.time = input.time;
  s.sequence = input.sequence;
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
                          const JointCompensationInput<S>& input) noexcept {
  S wanted = S(0);
  if (c.gate.valid && input.valid && is_finite(input.position)) {
    follow(c, s, input);
    const S weight = gravity(c.body, s.position);
    wanted = c.gravity_share * (weight + c.body.offset) +
             c.friction_share * friction(c.body.friction, s.velocity, weight);
  }
  if (!is_finite(s.position) || !is_finite(s.velocity)) s.started = false;
  return step(c.gate, s.gate, {wanted, input.position, s.velocity, input.time, input.sequence, input.valid});
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
