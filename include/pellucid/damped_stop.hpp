// A stop for a robot that carries weight: it sinks slowly instead of falling.
//
//   u = -b v, within a limit
//
// It only ever acts against the last raw difference of the encoder, and lets go when what it took out of the joint is
// used up: it cannot give energy, whatever the delays.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct DampedStopParams {
  S damping{}, limit{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.damping, {"hold_damping", unit::viscous, at_least(0), "b; 0: no damped stop, effort 0 at once"});
    visit(p.limit, {"hold_limit", unit::effort, at_least(0), "limit of its effort"});
  }
};

template <class S> struct DampedStopState {
  S velocity{};  ///< smoothed over two samples [rad/s]
  S effort{};    ///< effort of the last period [N m]
  S taken{};     ///< energy taken out so far [J]
};

/// One period: the effort [N m], at a raw velocity.
template <class S> S step(const DampedStopParams<S>& p, DampedStopState<S>& s, const S& period, const S& velocity) noexcept {
  s.taken = s.taken - period * s.effort * velocity;
  s.velocity = S(0.5) * (s.velocity + velocity);
  const S wanted = clamp(-p.damping * s.velocity, -p.limit, p.limit);
  s.effort = same_sign(wanted, velocity) || !(s.taken >= S(0)) || !is_finite(wanted) ? S(0) : wanted;
  if (!is_finite(s.taken)) s = {};
  return s.effort;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
