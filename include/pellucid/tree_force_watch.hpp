// Whether the force sensors of a robot of several joints say what its motion says: the wearer's effort on each joint by
// the sensors, J'F, beside the residual r of the momentum observer.
//
//   d = r - w/(s + w) J'F,    |lasting part of d| <= tolerance + open friction,    |d| <= burst + friction
//
// A sensor whose gain is too large hides in friction, which d allows for: the law then answers each motion of the wearer
// more strongly, and less is felt. What it says faster than postures change is louder than r all the same:
//
//   l = mean of (|fast part of J'F| - 1.5 |fast part of r|) / scale,    sum over joints <= excess
//
// At rest friction may be anything up to its level, and so may r; in motion it is known but for a share.
#pragma once

#include "body_residual.hpp"
#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct TreeForceWatchParams {
  S slow = S(5), wearer_torque = S(std::numeric_limits<S>::infinity()), tolerance = wearer_torque, burst = wearer_torque,
    scale = wearer_torque;

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.slow, {"residual_slow", unit::rate, above(0),
                   "rate of the low-pass that defines a lasting difference; times the period below a half"});
    visit(p.wearer_torque, {"wearer_torque", unit::effort, above(0).or_infinite(),
                            "the most that a wearer gives lastingly, beyond friction; infinite: not checked"});
    visit(p.tolerance, {"force_tolerance", unit::effort, above(0).or_infinite(),
                        "lasting difference from the force sensor beyond friction; infinite: not checked"});
    visit(p.burst, {"force_burst", unit::effort, above(0).or_infinite(),
                    "difference at once from the force sensor beyond friction; infinite: not checked"});
    visit(p.scale, {"force_scale", unit::effort, above(0).or_infinite(),
                    "unit of the joint's loudness, its friction; infinite: the joint does not count"});
  }
};

/// Coefficients computed once from TreeForceWatchParams, the observer's bandwidth and the period of the watch.
template <class S> struct TreeForceWatchCoefficients {
  TreeForceWatchParams<S> params{};  ///< as they are
  S following{};                     ///< share of a new force in what is as late as the residual [1]
  S smoothing{};                     ///< share of a new residual in what lasts [1]
  S averaging{};                     ///< share of a new loudness in its mean [1]
  S inverse_scale{};                 ///< [1/(N m)]
  bool valid = false;                ///< whether the parameters make sense
};

constexpr double loudness_slow = 0.2;   ///< how slowly loudness is judged, of what lasts [1]
constexpr double settled_share = 0.9;   ///< share of a lasting part that must have come in before anything is judged [1]
constexpr double quiet_start = -0.25;  ///< loudness of each joint before anything was felt, so that a start is no fault [1]

template <class S> TreeForceWatchCoefficients<S> coefficients(const TreeForceWatchParams<S>& p, const S& bandwidth,
                                                              const S& period) noexcept {
  TreeForceWatchCoefficients<S> c;
  c.params = p;
  c.following = bandwidth * period;
  c.smoothing = p.slow * period;
  c.averaging = S(loudness_slow) * c.smoothing;
  c.inverse_scale = S(1) / p.scale;
  c.valid = is_sound(p) && c.smoothing < S(1) && c.following < S(1);
  return c;
}

template <class S> struct TreeForceWatchState {
  S felt{};           ///< what the sensors say, as late as r [N m]
  S burst{};          ///< r less that [N m]
  S contradiction{};  ///< its slow part [N m]
  S open{};           ///< slow part of the friction that is not known [N m]
  S lasting{};        ///< slow part of r [N m]
  S felt_slow{};      ///< slow part of what the sensors say [N m]
  S settled{};        ///< share of a lasting part that has come in since the law began [1]
  S loudness = S(quiet_start);  ///< by how much they are too loud, in units of the scale [1]
};

/// One period of one joint: `level` is its friction at rest under the load, `known` the size of friction at its
/// velocity.
template <class S> void step(const TreeForceWatchCoefficients<S>& c, TreeForceWatchState<S>& s, const S& residual,
                             const S& felt, bool sensed, const S& level, const S& known) noexcept {
  s.felt = s.felt + c.following * ((sensed ? felt : S(0)) - s.felt);
  s.burst = sensed ? residual - s.felt : S(0);
  s.contradiction = s.contradiction + c.smoothing * (s.burst - s.contradiction);
  s.open = s.open + c.smoothing * (level - S(known_friction) * min(known, level) - s.open);
  s.lasting = s.lasting + c.smoothing * (residual - s.lasting);
  s.settled = s.settled + c.smoothing * (S(1) - s.settled);
  s.felt_slow = s.felt_slow + c.smoothing * (s.felt - s.felt_slow);
  const S loud = sensed ? abs(s.felt - s.felt_slow) - S(louder) * abs(residual - s.lasting) : S(0);
  s.loudness = s.loudness + c.averaging * (loud * c.inverse_scale - s.loudness);
  if (!is_finite(s.felt + s.contradiction + s.open + s.lasting + s.loudness)) s = {};
}

/// Return the fault of one joint, if any: `force_sensor` if the sensors alone contradict the motion. The test is
/// suspended while the law ramps up the compensation of the robot's weight.
template <class S>
SafetyFault shown(const TreeForceWatchCoefficients<S>& c, const TreeForceWatchState<S>& s, const S& level) noexcept {
  const TreeForceWatchParams<S>& p = c.params;
  if (s.settled < S(settled_share)) return SafetyFault::none;
  if (!(abs(s.lasting) <= p.wearer_torque + s.open)) return SafetyFault::unexplained;
  const bool agrees = abs(s.contradiction) <= p.tolerance + s.open && abs(s.burst) <= p.burst + level;
  return agrees ? SafetyFault::none : SafetyFault::force_sensor;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
