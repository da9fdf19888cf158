// Whether an encoder that says the same to the bit stands still or is frozen: the joint is asked.
//
// A joint at rest and a frozen encoder read alike, and a command that holds a weight is the same for both. So after some time
// of equal readings a small wave of effort is added, which grows until a reading changes. The wave that moves the joint in
// the test at start-up, whatever friction it has, moves it here, too: where nothing changes under all of it, the encoder is
// frozen. A healthy joint answers to a wave that overcomes its friction, so that a wearer hardly ever feels more.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct StillWatchParams {
  std::uint32_t samples = 0;
  S effort{};
  std::uint32_t half_wave = 32;

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.samples, {"still_samples", unit::one, between(0, 1000000),
                      "equal readings in a row after which the joint is asked by a wave; "
                      "it grows for as many, and after as many more the encoder is frozen. 0: it is not asked"});
    visit(p.effort, {"still_effort", unit::effort, at_least(0), "largest amplitude of that wave"});
    visit(p.half_wave, {"still_half_wave", unit::one, between(8, 200), "duration of half a wave, in periods"});
  }
};

/// Coefficients computed once from StillWatchParams.
template <class S> struct StillWatchCoefficients {
  StillWatchParams<S> params{};  ///< as they are
  SinCos<S> turn{};              ///< change of the phase in a period
  S growth{};                    ///< growth of the amplitude in a period [N m]
  std::uint32_t valid = 0;       ///< 1: the parameters make sense
};

template <class S> StillWatchCoefficients<S> coefficients(const StillWatchParams<S>& p) noexcept {
  StillWatchCoefficients<S> c;
  c.params = p;
  c.valid = is_sound(p) && p.half_wave >= 8 && p.half_wave <= 200 ? 1 : 0;
  if (c.valid == 0 || p.samples == 0) return c;
  c.turn = sincos(S(3.14159265358979323846) / static_cast<S>(p.half_wave));
  c.growth = p.effort / static_cast<S>(p.samples);
  return c;
}

template <class S> struct StillWatchState {
  S sine{};           ///< sine of the wave's phase, now
  S cosine = S(1);    ///< cosine of the wave's phase, now
  S amplitude{};      ///< present amplitude of the wave; 0: no wave [N m]
};

/// The effort to add in this period [N m].
template <class S> S wave(const StillWatchCoefficients<S>& c, const StillWatchState<S>& s) noexcept {
  const S made = s.amplitude * s.sine;
  return is_finite(made) ? clamp(made, -c.params.effort, c.params.effort) : S(0);
}

/// One period after `equal` readings in a row that did not change.
template <class S>
SafetyFault step(const StillWatchCoefficients<S>& c, StillWatchState<S>& s, std::uint32_t equal) noexcept {
  const StillWatchParams<S>& p = c.params;
  if (p.samples == 0 || !(p.effort > S(0))) return SafetyFault::none;
  if (equal < p.samples) {
    s = {};
    return SafetyFault::none;
  }
  const S sine = s.sine * c.turn.cos + s.cosine * c.turn.sin;
  s.cosine = s.cosine * c.turn.cos - s.sine * c.turn.sin;
  s.sine = sine;
  s.amplitude = min(s.amplitude + c.growth, p.effort);
  return equal >= 3u * p.samples ? SafetyFault::frozen : SafetyFault::none;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
