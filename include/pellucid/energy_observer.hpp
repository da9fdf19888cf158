// Keeps a compensation from driving the joint: what it puts in may not exceed what the joint is known to take out.
//
// A store holds the energy that may still be put in. Friction that is known to be there fills it, work that is done on
// the joint empties it, and work taken back fills it again, as when an inertia that was sped up is slowed down. With
// an empty store only a torque against the motion passes.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct EnergyObserverState {
  S spent{};  ///< how far the store is below full [J], 0 to its size and a period's work beyond
};

/// One period: the torque that may pass, of a torque that acts at a velocity while friction is known to take `friction`
/// [N m], from a store of a size [J].
template <class S> S step(const S& size, EnergyObserverState<S>& state, const S& period, const S& torque,
                          const S& velocity, const S& friction) noexcept {
  const bool drives = torque * velocity > S(0);
  const S passed = drives && !(state.spent < size) ? S(0) : torque;
  state.spent = max(state.spent + period * (passed * velocity - abs(friction * velocity)), S(0));
  if (!is_finite(state.spent)) state.spent = size;
  return passed;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
