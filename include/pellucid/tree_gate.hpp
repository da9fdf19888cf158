// The last step of a law of several joints: every joint's own limits, and those of the whole.
//
// Each joint has the gate of one joint: finite, within effort and rate, no push into a stop. Power is the sum over
// joints, speed that of an end point; beyond their limits either is a fault, because a share of what carries an arm
// would let it fall. A fault of one joint shuts all: efforts go to 0 together, in proportion, as fast as the slowest may.
#pragma once

#include "tree_law.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Coefficients computed once from the limits of each joint and of the whole.
template <class S, std::size_t N> struct TreeGateCoefficients {
  std::size_t joints = 0;            ///< how many
  SafetyCoefficients<S> joint[N]{};  ///< gate of each joint
  S power_limit{};                   ///< limit of |sum of effort times velocity| [W]
  S speed_limit{};                   ///< limit of the end point's speed [m/s]
  bool valid = false;                ///< whether all of them make sense, and have one period
};

template <class S, std::size_t N> TreeGateCoefficients<S, N> tree_gate(const SafetyParams<S>* params, std::size_t joints,
                                                                       const S& power_limit,
                                                                       const S& speed_limit) noexcept {
  TreeGateCoefficients<S, N> c;
  c.joints = joints < N ? joints : N;
  c.power_limit = power_limit;
  c.speed_limit = speed_limit;
  c.valid = joints >= 1 && joints <= N && power_limit > S(0) && speed_limit > S(0);
  for (std::size_t k = 0; k < c.joints; ++k) {
    c.joint[k] = coefficients(params[k]);
    c.valid = c.valid && c.joint[k].valid && params[k].period == params[0].period;
  }
  return c;
}

template <class S, std::size_t N> struct TreeGateState {
  TreeFault fault{};        ///< latched
  S output[N]{};            ///< the last ones [N m; N]
  S position[N]{};          ///< the last ones that were numbers [rad; m]
  SampleState sample[N]{};  ///< state of each encoder's samples
};

/// Opens a gate again; outputs go on from where they are, within their rate limits.
template <class S, std::size_t N> void reset(TreeGateState<S, N>& state) noexcept {
  state.fault = {};
  for (SampleState& sample : state.sample) sample = {};
}

/// Efforts closer to 0 by one period: all by the same share, the largest that no joint's rate forbids.
template <class S, std::size_t N> void fade(const TreeGateCoefficients<S, N>& c, S* output) noexcept {
  S share = S(1);
  for (std::size_t k = 0; k < c.joints; ++k)
    if (!(abs(output[k]) * share <= c.joint[k].max_change)) share = c.joint[k].max_change / abs(output[k]);
  for (std::size_t k = 0; k < c.joints; ++k) output[k] = share < S(1) ? output[k] - share * output[k] : S(0);
}

/// Effort that a stop of joint k allows at a position.
template <class S>
S before_stop(const SafetyCoefficients<S>& c, const S& position, const S& effort) noexcept {
  const S limit = c.params.effort_limit;
  const S highest = limit * stop_taper(c, c.params.position_max - position);
  const S lowest = -limit * stop_taper(c, position - c.params.position_min);
  const S output = clamp(effort, lowest, highest);
  return output >= -limit && output <= limit ? output : S(0);
}

/// One control period of all joints: efforts that may go to the drives, in `state.output`.
template <class S, std::size_t N>
void step(const TreeGateCoefficients<S, N>& c, TreeGateState<S, N>& state, const S* wanted, const S* velocity,
          const Sample<S>* position, const S& end_speed) noexcept {
  if (!c.valid) {
    state.fault = {SafetyFault::configuration, 0};
    for (S& output : state.output) output = S(0);
    return;
  }
  const std::uint32_t whole = static_cast<std::uint32_t>(c.joints);
  for (std::size_t k = 0; k < c.joints; ++k) {
    const Sample<S>& read = position[k];
    if (is_finite(read.value)) state.position[k] = read.value;
    if (state.fault.fault != SafetyFault::none) continue;
    const SafetyInput<S> input{wanted[k], read.value, velocity[k], read.time, read.sequence, read.valid};
    SafetyState<S> one;
    one.sample = state.sample[k];
    SafetyFault found = examine(c.joint[k], one, input);
    state.sample[k] = one.sample;
    if (found == SafetyFault::none && !(abs(velocity[k]) <= c.joint[k].params.velocity_limit)) found = SafetyFault::velocity;
    if (found != SafetyFault::none) state.fault = {found, static_cast<std::uint32_t>(k)};
  }
  if (state.fault.fault == SafetyFault::none && !(end_speed <= c.speed_limit))
    state.fault = {SafetyFault::velocity, whole};
  if (state.fault.fault == SafetyFault::none) {
    S power = S(0), next[N]{};
    for (std::size_t k = 0; k < c.joints; ++k) {
      const S limit = c.joint[k].params.effort_limit, change = c.joint[k].max_change;
      const S ramped = clamp(clamp(wanted[k], -limit, limit), state.output[k] - change, state.output[k] + change);
      next[k] = before_stop(c.joint[k], state.position[k], ramped);
      power = power + next[k] * velocity[k];
    }
    if (!(abs(power) <= c.power_limit)) state.fault = {SafetyFault::power, whole};
    else
      for (std::size_t k = 0; k < c.joints; ++k) state.output[k] = next[k];
  }
  if (state.fault.fault == SafetyFault::none) return;
  fade(c, state.output);
  for (std::size_t k = 0; k < c.joints; ++k)
    state.output[k] = before_stop(c.joint[k], state.position[k], state.output[k]);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
