// Learns a periodic motion as it comes, and says where it will be: an adaptive oscillator with harmonics.
//
//   phi' = w + nu e cos(phi) / A,   w' = nu_w e cos(phi) / A,   a_k' = eta e sin(k phi + p_k), ...
//
// e is what the sum of the harmonics misses; A the first one's amplitude. Each harmonic has a sine and a cosine, so that
// no phase of its own is learnt. After L. Righetti, J. Buchli, A. J. Ijspeert, Physica D 216(2), 2006, and R. Ronsse et
// al., "Oscillator-based assistance of cyclical movements", Medical & Biological Engineering & Computing 49(10), 2011.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

constexpr std::size_t oscillator_harmonics = 3;

template <class S> struct AdaptiveOscillatorParams {
  S frequency = S(4), frequency_min = S(1), frequency_max = S(16), phase_rate = S(8), frequency_rate = S(8),
    amplitude_rate = S(2), least_amplitude = S(0.02);

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.frequency, {"frequency", unit::velocity, above(0), "initial w of the oscillator"});
    visit(p.frequency_min, {"frequency_min", unit::velocity, above(0), "lower bound of w"});
    visit(p.frequency_max, {"frequency_max", unit::velocity, above(0), "upper bound of w"});
    visit(p.phase_rate, {"phase_rate", unit::rate, at_least(0), "nu"});
    visit(p.frequency_rate, {"frequency_rate", unit::rate, at_least(0), "nu_w"});
    visit(p.amplitude_rate, {"amplitude_rate", unit::rate, at_least(0), "eta"});
    visit(p.least_amplitude, {"least_amplitude", unit::coordinate, above(0).or_infinite(),
                              "amplitude of the first harmonic below which phase and frequency are not learnt"});
  }
};

/// Coefficients computed once from AdaptiveOscillatorParams and the period.
template <class S> struct AdaptiveOscillatorCoefficients {
  AdaptiveOscillatorParams<S> params{};  ///< as they are
  S period{};                            ///< [s]
  bool valid = false;                    ///< whether they make sense
};

template <class S>
AdaptiveOscillatorCoefficients<S> coefficients(const AdaptiveOscillatorParams<S>& p, const S& period) noexcept {
  const bool valid =
      is_sound(p) && p.frequency >= p.frequency_min && p.frequency <= p.frequency_max && period > S(0);
  return {p, period, valid};
}

template <class S> struct AdaptiveOscillatorState {
  S phase{};                          ///< phi [rad]
  S frequency{};                      ///< w [rad/s], 0 until the first sample
  S offset{};                         ///< [rad]
  S sine[oscillator_harmonics]{};     ///< amplitudes [rad]
  S cosine[oscillator_harmonics]{};   ///< amplitudes [rad]
  S error{};                          ///< its mean size lately [rad]
};

/// A motion at one time.
template <class S> struct PredictedMotion {
  S position{};      ///< [rad]
  S velocity{};      ///< [rad/s]
  S acceleration{};  ///< [rad/s^2]
  S trust{};         ///< 1 where the motion is periodic, 0 where it is not
};

/// The motion `ahead` seconds from the last sample.
template <class S> PredictedMotion<S> predict(const AdaptiveOscillatorCoefficients<S>& c,
                                              const AdaptiveOscillatorState<S>& state, const S& ahead) noexcept {
  PredictedMotion<S> out;
  out.position = state.offset;
  S size = S(0);
  for (std::size_t k = 0; k < oscillator_harmonics; ++k) {
    const S order = S(static_cast<value_t<S>>(k + 1));
    const S rate = order * state.frequency;
    const SinCos<S> at = sincos(order * (state.phase + state.frequency * ahead));
    const S value = state.sine[k] * at.sin + state.cosine[k] * at.cos;
    out.position = out.position + value;
    out.velocity = out.velocity + rate * (state.sine[k] * at.cos - state.cosine[k] * at.sin);
    out.acceleration = out.acceleration - rate * rate * value;
    size = size + abs(state.sine[k]) + abs(state.cosine[k]);
  }
  out.trust = size > c.params.least_amplitude ? clamp(S(1) - S(4) * state.error / size, S(0), S(1)) : S(0);
  return out;
}

/// One sample. One that is not finite changes nothing.
template <class S> void step(const AdaptiveOscillatorCoefficients<S>& c, AdaptiveOscillatorState<S>& state,
                             const S& measured) noexcept {
  if (!is_finite(measured)) return;
  const AdaptiveOscillatorParams<S>& p = c.params;
  if (!(state.frequency > S(0))) {
    state = {};
    state.frequency = p.frequency;
    state.offset = measured;
  }
  const S h = c.period;
  const S error = measured - predict(c, state, S(0)).position;
  const S rate = h * p.amplitude_rate;
  const SinCos<S> first = sincos(state.phase);
  // The direction in which a small turn of the phase moves the first harmonic, of unit size.
  const S slope = state.sine[0] * first.cos - state.cosine[0] * first.sin;
  const S square = state.sine[0] * state.sine[0] + state.cosine[0] * state.cosine[0];
  const S pull = square > p.least_amplitude * p.least_amplitude ? error * slope / square : S(0);
  for (std::size_t k = 0; k < oscillator_harmonics; ++k) {
    const SinCos<S> at = sincos(S(static_cast<value_t<S>>(k + 1)) * state.phase);
    state.sine[k] = state.sine[k] + rate * error * at.sin;
    state.cosine[k] = state.cosine[k] + rate * error * at.cos;
  }
  state.offset = state.offset + S(0.5) * rate * error;
  state.error = state.error + S(0.5) * h * state.frequency * (abs(error) - state.error);
  state.frequency = clamp(state.frequency + h * p.frequency_rate * pull, p.frequency_min, p.frequency_max);
  state.phase = state.phase + h * (state.frequency + p.phase_rate * pull);
  if (state.phase > S(6.283185307179586)) state.phase = state.phase - S(6.283185307179586);
  if (!is_finite(state.phase + state.error) || !(abs(state.phase) < S(100))) state = {};
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
