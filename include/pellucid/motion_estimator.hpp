// Position, velocity and acceleration from an encoder: a Kalman filter of three states in its steady state.
//
// The model is an acceleration that a white jerk of density q changes, seen through noise of r per sample. In continuous
// time its steady state has closed-form gains: three Butterworth poles at the bandwidth (q / (r^2 h))^(1/6). They are
// placed here at exp(p h), so that the filter is stable at any period. A sample that lies outside the gate corrects
// nothing; after too many of them the motion has really jumped, and the filter starts again.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct MotionEstimatorParams {
  S bandwidth = S(100), gate = S(0.02);
  std::uint32_t max_rejections = 20;

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.bandwidth, {"bandwidth", unit::velocity, above(0),
                        "bandwidth of the estimator's poles; times the period below 2"});
    visit(p.gate, {"innovation_gate", unit::coordinate, above(0).or_infinite(), "largest innovation that corrects"});
    visit(p.max_rejections, {"max_rejections", unit::one, at_least(0),
                             "samples in a row outside the gate before the estimator starts again"});
  }
};

/// Coefficients computed once from MotionEstimatorParams and the period.
template <class S> struct MotionEstimatorCoefficients {
  MotionEstimatorParams<S> params{};  ///< as they are
  S period{};                         ///< [s]
  S position_gain{};                  ///< on the innovation [1]
  S velocity_gain{};                  ///< [1/s]
  S acceleration_gain{};              ///< [1/s^2]
  bool valid = false;                 ///< whether the parameters make sense
};

template <class S>
MotionEstimatorCoefficients<S> coefficients(const MotionEstimatorParams<S>& p, const S& period) noexcept {
  MotionEstimatorCoefficients<S> c;
  c.params = p;
  c.period = period;
  const S turn = p.bandwidth * period;
  c.valid = is_sound(p) && period > S(0) && turn < S(2);
  if (!c.valid) return c;
  // Poles: -w and w exp(+-2 pi i / 3), each mapped to exp(pole h).
  const S real = exp(-turn);
  const S radius = exp(S(-0.5) * turn);
  const S pair = S(2) * radius * cos(S(0.8660254037844386) * turn);
  const S s1 = real + pair;
  const S s2 = real * pair + radius * radius;
  const S s3 = real * (radius * radius);
  const S alpha = S(1) - s3;
  const S gamma = S(2) * (s2 - s1 + alpha);
  const S beta = S(3) - s1 - alpha - S(0.25) * gamma;
  c.position_gain = alpha;
  c.velocity_gain = beta / period;
  c.acceleration_gain = S(0.5) * gamma / (period * period);
  return c;
}

template <class S> struct MotionEstimatorState {
  S position{};                  ///< [rad]
  S velocity{};                  ///< [rad/s]
  S acceleration{};              ///< [rad/s^2]
  std::uint32_t rejections = 0;  ///< in a row
  bool started = false;          ///< false until the first sample
};

/// One sample; `state` is then the motion at its time. A sample that is not finite is a rejected one.
template <class S>
void step(const MotionEstimatorCoefficients<S>& c, MotionEstimatorState<S>& state, const S& measured) noexcept {
  if (!state.started) {
    if (is_finite(measured)) {
      state = {};
      state.position = measured;
      state.started = true;
    }
    return;
  }
  const S h = c.period;
  const S position = state.position + h * state.velocity + S(0.5) * h * h * state.acceleration;
  const S velocity = state.velocity + h * state.acceleration;
  const S innovation = measured - position;
  if (!(abs(innovation) <= c.params.gate)) {
    if (++state.rejections > c.params.max_rejections || !is_finite(position + velocity)) {
      state = {};
      return;
    }
    state.position = position;
    state.velocity = velocity;
    return;
  }
  state.rejections = 0;
  state.position = position + c.position_gain * innovation;
  state.velocity = velocity + c.velocity_gain * innovation;
  state.acceleration = state.acceleration + c.acceleration_gain * innovation;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
