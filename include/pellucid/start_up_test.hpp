// Polarity and gain of drive and encoder, before a law may use its limits: one small wave of effort, up and down again.
//
// What is at rest can only take energy from a wave, whatever its springs, frictions and wearer: work that comes out
// negative has the wrong polarity. A body J alone takes 2 A^2 / (J w^2) by the middle of A sin(w t); with an arm and
// friction it is less or more by a factor, far more is a wrong gain. A joint whose weight rests on its friction may move
// in the other half alone. That half then decides: with the wrong polarity it cannot return more than the first half
// took. The test waits for rest, without effort, for as long as that takes. A wearer who trembles may do part of the work:
// a gain is wrong if up to five waves say so, one after the other, with a longer rest between them: what the last wave
// still moves is no answer to the next. The law takes over from a joint that has had time to come to rest again: one that
// the wave still moves would meet the law's first effort as a kick.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Waves of which each must show a wrong gain; one that is half as much again beyond counts twice.
constexpr std::uint32_t start_up_waves = 5;

template <class S> struct StartUpTestParams {
  S effort{};
  std::uint32_t samples = 30, rest = 100;
  S least{}, most = S(std::numeric_limits<S>::infinity());

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.effort, {"test_effort", unit::effort, at_least(0), "A of the wave; 0: no test at start-up"});
    visit(p.samples, {"test_samples", unit::one, between(8, 200), "duration of half a wave, in periods"});
    visit(p.rest, {"test_rest", unit::one, at_least(0), "periods of rest in a row before it, and of waiting after it"});
    visit(p.least, {"test_least", unit::energy, any_number(), "least work by its middle that is the right polarity"});
    visit(p.most, {"test_most", unit::energy, above(0).or_infinite(), "largest that is the right gain"});
  }
};

/// Coefficients computed once from StartUpTestParams; the sine is generated step by step, by rotation.
template <class S> struct StartUpTestCoefficients {
  StartUpTestParams<S> params{};  ///< as they are
  S turn_sine{};                  ///< sine of the phase that passes in a period
  S turn_cosine{};                ///< cosine of the phase that passes in a period
  std::uint32_t valid = 0;        ///< 1: the parameters make sense
};

template <class S> StartUpTestCoefficients<S> coefficients(const StartUpTestParams<S>& p) noexcept {
  StartUpTestCoefficients<S> c;
  c.params = p;
  c.valid = is_sound(p) && p.samples >= 8 && p.samples <= 200 ? 1 : 0;
  if (c.valid == 0) return c;
  const SinCos<S> turn = sincos(S(3.14159265358979323846) / static_cast<S>(p.samples));
  c.turn_sine = turn.sin;
  c.turn_cosine = turn.cos;
  return c;
}

template <class S> struct StartUpTestState {
  S drift{};                 ///< smoothed velocity before the wave [rad/s]
  std::uint32_t rested = 0;  ///< periods in a row
  std::uint32_t count = 0;   ///< periods of the wave so far
  S sine{};                  ///< sine of the wave's phase, now
  S cosine = S(1);           ///< cosine of the wave's phase, now
  S pushed{};                ///< the last effort [N m]
  S work{};                  ///< so far [J]
  S middle{};                ///< by the middle of the wave [J]
  std::uint32_t waves = 0;   ///< that showed a wrong gain so far, by their weight
};

/// Whether the joint hardly moved by the middle of the wave, so that the second half decides.
template <class S> bool hardly_moved(const StartUpTestParams<S>& p, const StartUpTestState<S>& s) noexcept {
  return abs(s.middle) < p.least;
}

/// Fault that the whole wave shows, if any.
template <class S> SafetyFault shown(const StartUpTestParams<S>& p, const StartUpTestState<S>& s) noexcept {
  const S work = hardly_moved(p, s) ? s.work - s.middle : s.middle;
  if (!(work >= p.least)) return SafetyFault::polarity;
  return work <= p.most ? SafetyFault::none : SafetyFault::gain;
}

/// Waves with a wrong gain, with the one that ends now.
template <class S> std::uint32_t wrong_waves(const StartUpTestParams<S>& p, const StartUpTestState<S>& s) noexcept {
  return s.waves + (s.middle > S(1.5) * p.most ? 2 : 1);
}

/// Takes note of a velocity and goes on one period: the effort of the wave [N m]. `done` becomes true after its last.
template <class S> S step(const StartUpTestCoefficients<S>& c, StartUpTestState<S>& s, const S& period, const S& velocity,
                          const S& rest, bool& done) noexcept {
  if (s.rested < c.params.rest * (s.waves > 0 ? 2u : 1u)) {
    s.drift = s.drift + S(0.0625) * (velocity - s.drift);
    s.rested = abs(s.drift) <= rest ? s.rested + 1 : 0;
    return S(0);
  }
  s.work = s.work + period * s.pushed * (velocity - s.drift);
  if (s.count == c.params.samples) s.middle = s.work;
  // What is wrong by the middle is not gone on with, but for a gain that another wave shall confirm: the second half brings
  // the joint to rest.
  const bool may_repeat = wrong_waves(c.params, s) < start_up_waves, again = may_repeat && s.middle > c.params.most;
  const bool wrong = !(s.middle >= c.params.least && s.middle <= c.params.most) && !hardly_moved(c.params, s) && !again;
  const bool over = s.count >= 2 * c.params.samples;
  const bool waits = over && s.count - 2 * c.params.samples < c.params.rest && shown(c.params, s) == SafetyFault::none;
  done = (over && !waits) || (s.count == c.params.samples && wrong);
  if (done && may_repeat && shown(c.params, s) == SafetyFault::gain) {
    const std::uint32_t waves = wrong_waves(c.params, s);
    s = {};
    s.waves = waves;
    done = false;
    return S(0);
  }
  ++s.count;
  const S sine = s.sine * c.turn_cosine + s.cosine * c.turn_sine;
  s.cosine = s.cosine * c.turn_cosine - s.sine * c.turn_sine;
  s.sine = sine;
  s.pushed = over || done ? S(0) : c.params.effort * sine;
  return s.pushed;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
