// The smoothest movement from rest to rest: a quintic in time.
//
// T. Flash, N. Hogan, "The coordination of arm movements: an experimentally confirmed mathematical model", Journal of
// Neuroscience 5(7), 1985.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// A movement of one joint.
template <class S> struct MinimumJerk {
  S start{};      ///< when [s]
  S amplitude{};  ///< how far [rad]
  S duration{};   ///< [s], > 0
};

/// State of a planned movement.
template <class S> struct PlannedMotion {
  S position{};      ///< [rad]
  S velocity{};      ///< [rad/s]
  S acceleration{};  ///< [rad/s^2]
};

/// The movement's share of a plan at a time: 0 before it, its amplitude after it.
template <class S> PlannedMotion<S> at(const MinimumJerk<S>& m, const S& time) noexcept {
  const S s = clamp((time - m.start) / m.duration, S(0), S(1));
  const S rate = S(1) / m.duration;
  const S s2 = s * s;
  const S rest = S(1) - s;
  return {m.amplitude * s2 * s * (S(10) + s * (S(-15) + S(6) * s)), m.amplitude * rate * S(30) * s2 * rest * rest,
          m.amplitude * rate * rate * S(60) * s * rest * (rest - s)};
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
