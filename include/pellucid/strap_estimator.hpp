// The strap's stiffness and damping, estimated while it is worn, without a sensor on the limb.
//
// The orthosis side gives the strap's torque: the momentum p = I_e v_e grows by what acts on it, so
//   tau_x = a (p - integral(tau_e - friction - gravity + tau_x))       is tau_c behind a low-pass of bandwidth a.
// The limb side gives its motion: the limb's pendulum under EMG torque and -tau_x. Both, behind the same low-pass and
// with their slow parts taken off, are fitted by recursive least squares with forgetting,
//   tau_x = k D + b dD,
// only while the strap is worked, and within bounds. Errors of the EMG torque bias k low, as in any regression on noise.
#pragma once

#include "residual_compensator.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct StrapEstimatorParams {
  CoupledBodies<S> bodies{};  ///< identified bodies; k and b are the initial estimate
  S bandwidth{}, slowest{}, forgetting{}, prior_mismatch{}, excitation{}, stiffness_min{}, stiffness_max{},
      damping_min{}, damping_max{}, period{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pellucid::walk(p.bodies, visit);
    visit(p.bandwidth, {"bandwidth", unit::velocity, above(0), "a, of the low-pass"});
    visit(p.slowest, {"slowest", unit::velocity, above(0), "velocity below which nothing is fitted"});
    visit(p.forgetting, {"forgetting", unit::time, above(0), "time over which the past is forgotten"});
    visit(p.prior_mismatch, {"prior_mismatch", unit::coordinate, above(0),
                             "RMS mismatch, over the forgetting time, that weighs as much as the start"});
    visit(p.excitation, {"excitation", unit::coordinate, above(0), "RMS mismatch below which nothing is learnt"});
    visit(p.stiffness_min, {"stiffness_min", unit::stiffness, above(0), "lower bound of k"});
    visit(p.stiffness_max, {"stiffness_max", unit::stiffness, above(0), "upper bound of k"});
    visit(p.damping_min, {"damping_min", unit::viscous, at_least(0), "lower bound of b"});
    visit(p.damping_max, {"damping_max", unit::viscous, at_least(0), "upper bound of b"});
    visit(p.period, {"period", unit::time, above(0), "between two steps"});
  }
};

/// Coefficients computed once from StrapEstimatorParams.
template <class S> struct StrapEstimatorCoefficients {
  StrapEstimatorParams<S> params{};  ///< as they are
  bool valid = false;                ///< whether they make sense
  S smooth{};                        ///< a period, of the low-pass [1]
  S drift{};                         ///< share that the high-pass forgets in a period [1]
  S keep{};                          ///< forgetting factor [1]
  S prior[2]{};                      ///< information that pulls k and b to where they started [rad^2, rad^2/s^2]
};

template <class S> StrapEstimatorCoefficients<S> coefficients(const StrapEstimatorParams<S>& p) noexcept {
  StrapEstimatorCoefficients<S> c;
  c.params = p;
  c.valid = is_sound(p) && p.stiffness_max >= p.stiffness_min && p.damping_max >= p.damping_min &&
            p.bandwidth * p.period < S(1) && p.slowest * p.period < S(1) && p.forgetting > p.period;
  c.smooth = p.bandwidth * p.period;
  c.drift = p.slowest * p.period;
  c.keep = S(1) - p.period / p.forgetting;
  const S square = p.prior_mismatch * p.prior_mismatch * p.forgetting / p.period;
  // A swing of 4 rad/s works spring and damper alike.
  c.prior[0] = square;
  c.prior[1] = square * S(16);
  return c;
}

/// State of the estimator.
template <class S> struct StrapEstimatorState {
  S stiffness{};         ///< k [N m/rad]
  S damping{};           ///< b [N m s/rad]
  S last_position{};     ///< last angle of the encoder [rad]
  S momentum{};          ///< what should have become of I_e v_e [kg m^2 rad/s]
  S torque{};            ///< tau_x [N m]
  S limb_position{};     ///< angle of the pendulum [rad]
  S limb_velocity{};     ///< [rad/s]
  S smooth[2]{};         ///< D and dD behind the low-pass
  S slow[3]{};           ///< slow parts of tau_x, D and dD
  S information[3]{};    ///< sums of D D, D dD, dD dD
  S projection[2]{};     ///< sums of D tau_x, dD tau_x
  S power{};             ///< mean square of D [rad^2]
  bool learns = false;   ///< whether the last period taught anything
  bool started = false;  ///< false until the first sample
};

/// One control period. Whatever comes in, k and b stay within their bounds.
template <class S>
void step(const StrapEstimatorCoefficients<S>& c, StrapEstimatorState<S>& s, const Samples<S>& samples) noexcept {
  const StrapEstimatorParams<S>& p = c.params;
  const CoupledBodies<S>& m = p.bodies;
  const S stiffness = clamp(m.strap_stiffness, p.stiffness_min, p.stiffness_max);
  const S damping = clamp(m.strap_damping, p.damping_min, p.damping_max);
  const bool heard = is_heard(samples.muscle);
  if (!s.started || !c.valid) {
    s = {};
    s.stiffness = stiffness;
    s.damping = damping;
  }
  s.learns = false;
  if (!c.valid || !is_finite(samples.position.value) || !is_finite(samples.torque.value)) return;
  if (!s.started) {
    s.started = true;
    s.last_position = samples.position.value;
    s.limb_position = samples.position.value;
  }
  const S velocity = (samples.position.value - s.last_position) / p.period;
  s.last_position = samples.position.value;

  // The orthosis side: tau_x follows what the momentum gained beyond what is known.
  const S known = samples.torque.value - m.orthosis_viscous * velocity - m.orthosis_gravity * sin(samples.position.value) -
                  m.coulomb * tanh(velocity / m.friction_width);
  s.momentum = s.momentum + p.period * (known + s.torque);
  s.torque = p.bandwidth * (m.orthosis_inertia * velocity - s.momentum);

  // The limb side: a pendulum under EMG torque, held to the orthosis over the slow part that is not fitted.
  const S muscle = heard ? samples.muscle.value : S(0);
  const S acceleration =
      (muscle - s.torque - m.limb_viscous * s.limb_velocity - m.limb_gravity * sin(s.limb_position)) / m.limb_inertia;
  s.limb_velocity = s.limb_velocity + p.period * acceleration;
  s.limb_position = s.limb_position + p.period * s.limb_velocity;
  s.limb_velocity = s.limb_velocity - c.drift * (s.limb_velocity - velocity);
  s.limb_position = s.limb_position - c.drift * (s.limb_position - samples.position.value);

  const S raw[2] = {s.limb_position - samples.position.value, s.limb_velocity - velocity};
  for (std::size_t i = 0; i < 2; ++i) s.smooth[i] = s.smooth[i] + c.smooth * (raw[i] - s.smooth[i]);
  const S signal[3] = {s.torque, s.smooth[0], s.smooth[1]};
  S x[3];
  for (std::size_t i = 0; i < 3; ++i) {
    s.slow[i] = s.slow[i] + c.drift * (signal[i] - s.slow[i]);
    x[i] = signal[i] - s.slow[i];
  }
  s.power = s.power + (S(1) - c.keep) * (x[1] * x[1] - s.power);

  const bool worked = heard && s.power > p.excitation * p.excitation;
  if (worked) {
    s.information[0] = c.keep * s.information[0] + x[1] * x[1];
    s.information[1] = c.keep * s.information[1] + x[1] * x[2];
    s.information[2] = c.keep * s.information[2] + x[2] * x[2];
    s.projection[0] = c.keep * s.projection[0] + x[1] * x[0];
    s.projection[1] = c.keep * s.projection[1] + x[2] * x[0];
    // The start is a prior that is not forgotten: both sums stay positive definite.
    const S a = s.information[0] + c.prior[0], b = s.information[1], d = s.information[2] + c.prior[1];
    const S u = s.projection[0] + c.prior[0] * stiffness, v = s.projection[1] + c.prior[1] * damping;
    const S determinant = a * d - b * b;
    const S k = (d * u - b * v) / determinant;
    const S l = (a * v - b * u) / determinant;
    if (determinant > S(0) && is_finite(k) && is_finite(l)) {
      s.stiffness = clamp(k, p.stiffness_min, p.stiffness_max);
      s.damping = clamp(l, p.damping_min, p.damping_max);
      s.learns = true;
    }
  }
  const S sum = abs(s.momentum) + abs(s.torque) + abs(s.limb_position) + abs(s.limb_velocity) + s.information[0] +
                s.information[2] + abs(s.projection[0]) + abs(s.projection[1]) + s.power + abs(s.slow[2]) +
                abs(s.smooth[1]);
  if (!is_finite(sum)) {
    const S k = s.stiffness, b = s.damping;
    s = {};
    s.stiffness = k;
    s.damping = b;
  }
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
