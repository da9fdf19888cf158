// What a control law of a worn robot is given each period. The encoder is always there, the rest only where it is fitted.
#pragma once

#include "safety.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct LawInput {
  S position{};                ///< of the encoder, on the joint's side [rad]
  S interaction{};             ///< torque of the wearer on the robot, from a force sensor [N m]
  S muscle{};                  ///< torque of the wearer's muscles, estimated from EMG [N m]
  bool has_interaction = false;  ///< whether the force sensor says anything
  bool has_muscle = false;       ///< whether the electrodes say anything
  bool valid = true;             ///< false: the encoder itself says that this is no measurement
  std::int64_t time = 0;         ///< of the sample [us]
  std::uint32_t sequence = 0;    ///< number of the sample
};

/// The last step of every law: what was computed from this sample goes through the gate [N m].
template <class S> S guard(const SafetyCoefficients<S>& c, SafetyState<S>& state, const S& wanted, const S& velocity,
                           const LawInput<S>& input) noexcept {
  return step(c, state, SafetyInput<S>{wanted, input.position, velocity, input.time, input.sequence, input.valid});
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
