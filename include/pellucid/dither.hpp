// A quick, small torque that keeps a drive from sticking, so that its encoder sees a wearer who begins to push.
//
// While the rotor shakes faster than anybody moves, dry friction averages to a viscous one up to the shaking's speed.
// Link and strap are too slow to follow. After G. Zames, N. A. Shneydor, "Dither in nonlinear systems", IEEE
// Transactions on Automatic Control 21(5), 1976.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct DitherParams {
  S torque{}, frequency{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.torque, {"dither", unit::effort, at_least(0), "amplitude of the motor's dither"});
    visit(p.frequency, {"dither_frequency", unit::velocity, any_number(),
                        "frequency of the dither; times the period 0 to below pi"});
  }
};
/// Coefficients computed once from DitherParams and the period.
template <class S> struct DitherCoefficients {
  DitherParams<S> params{};  ///< as they are
  S turn{};                  ///< change of the phase in a period [rad]
  bool valid = false;        ///< whether the parameters make sense
};

template <class S> DitherCoefficients<S> coefficients(const DitherParams<S>& p, const S& period) noexcept {
  const S turn = p.frequency * period;
  return {p, turn, is_sound(p) && turn >= S(0) && turn < S(3.141592653589793)};
}

template <class S> struct DitherState {
  S phase{};  ///< [rad]
};

/// One period: the torque to add [N m].
template <class S> S step(const DitherCoefficients<S>& c, DitherState<S>& state) noexcept {
  if (!(c.params.torque > S(0))) return S(0);
  state.phase = state.phase + c.turn;
  if (!(state.phase < S(6.283185307179586))) state.phase = state.phase - S(6.283185307179586);
  if (!(abs(state.phase) < S(10))) state.phase = S(0);
  return c.params.torque * sin(state.phase);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
