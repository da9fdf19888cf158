// Velocity from an encoder as most drives make it: the difference over a few samples, divided by their time.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

constexpr std::uint32_t max_speed_span = 32;

template <class S> struct EncoderSpeedParams {
  std::uint32_t span = 1;

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.span, {"speed_span", unit::one, between(1, max_speed_span), "samples that the difference reaches back"});
  }
};

/// Coefficients computed once from EncoderSpeedParams and the period.
template <class S> struct EncoderSpeedCoefficients {
  std::uint32_t span = 1;  ///< samples
  S inverse_time{};        ///< 1 / duration of the span [1/s]
};

template <class S>
EncoderSpeedCoefficients<S> coefficients(const EncoderSpeedParams<S>& p, const S& period) noexcept {
  const std::uint32_t span = p.span < 1 ? 1 : p.span > max_speed_span ? max_speed_span : p.span;
  return {span, S(1) / (period * S(static_cast<value_t<S>>(span)))};
}

template <class S> struct EncoderSpeedState {
  S past[max_speed_span]{};  ///< the last positions, in a ring [rad]
  std::uint32_t next = 0;    ///< where the next one goes
  bool started = false;      ///< false until the first sample
};

/// One sample; the velocity of the middle of its span [rad/s]. A sample that is not finite starts again: 0.
template <class S>
S step(const EncoderSpeedCoefficients<S>& c, EncoderSpeedState<S>& state, const S& measured) noexcept {
  if (!is_finite(measured)) {
    state.started = false;
    return S(0);
  }
  if (!state.started) {
    for (S& position : state.past) position = measured;
    state.next = 0;
    state.started = true;
  }
  const S oldest = state.past[state.next];
  state.past[state.next] = measured;
  // The second bound is for a memory that has lost a bit.
  state.next = state.next + 1 < c.span && state.next + 1 < max_speed_span ? state.next + 1 : 0;
  return (measured - oldest) * c.inverse_time;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
