// Drives the torque between wearer and robot to zero: a filtered proportional and leaky integral loop on a force sensor.
//
// The sensor's slow drift is taken for what changes slower than anyone moves, and left out. What feeds back is limited,
// and fades out while the sensor says nothing.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct TorqueFeedbackParams {
  S proportional{}, integral{}, leak{}, lowpass = S(100), drift{}, limit{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.proportional, {"proportional", unit::one, at_least(0), "gain on the interaction torque"});
    visit(p.integral, {"integral", unit::rate, at_least(0), "gain on its integral"});
    visit(p.leak, {"leak", unit::rate, at_least(0).or_infinite(), "rate at which the integral forgets"});
    visit(p.lowpass, {"sensor_lowpass", unit::velocity, above(0).or_infinite(), "low-pass on the force sensor"});
    visit(p.drift, {"sensor_drift", unit::velocity, at_least(0).or_infinite(),
                    "rate below which a torque is the sensor's own"});
    visit(p.limit, {"feedback_limit", unit::effort, at_least(0), "limit of the feedback"});
  }
};
/// Coefficients computed once from TorqueFeedbackParams and the period.
template <class S> struct TorqueFeedbackCoefficients {
  TorqueFeedbackParams<S> params{};  ///< as they are
  S period{};                        ///< [s]
  S smoothing{};                     ///< share of a new sample [1]
  S slow{};                          ///< share of a new sample in the drift [1]
  S forgetting{};                    ///< share of the integral that is forgotten in a period [1]
  bool valid = false;                ///< whether the parameters make sense
};

template <class S>
TorqueFeedbackCoefficients<S> coefficients(const TorqueFeedbackParams<S>& p, const S& period) noexcept {
  TorqueFeedbackCoefficients<S> c;
  c.params = p;
  c.period = period;
  c.smoothing = S(1) - exp(-p.lowpass * period);
  c.slow = S(1) - exp(-p.drift * period);
  c.forgetting = exp(-p.leak * period);
  c.valid = is_sound(p);
  return c;
}

template <class S> struct TorqueFeedbackState {
  S smooth{};            ///< filtered torque [N m]
  S drift{};             ///< its slow part [N m]
  S integral{};          ///< as a torque [N m]
  bool started = false;  ///< false until the first sample
};

/// One sample of the torque of the wearer on the robot; what the robot adds [N m].
template <class S> S step(const TorqueFeedbackCoefficients<S>& c, TorqueFeedbackState<S>& state, const S& torque,
                          bool measured) noexcept {
  const bool heard = measured && is_finite(torque);
  if (heard && !state.started) {
    state = {};
    state.smooth = torque;
    state.started = true;
  }
  const S seen = heard ? torque : state.drift;
  state.smooth = state.smooth + c.smoothing * (seen - state.smooth);
  state.drift = state.drift + c.slow * (state.smooth - state.drift);
  const S error = state.smooth - state.drift;
  state.integral = clamp(c.forgetting * state.integral + c.params.integral * c.period * error, -c.params.limit,
                         c.params.limit);
  if (!is_finite(state.smooth + state.drift + state.integral)) state = {};
  return clamp(c.params.proportional * error + state.integral, -c.params.limit, c.params.limit);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
