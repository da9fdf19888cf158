// A signal some time ago, between samples, from samples that are already there.
//
// Cubic Hermite pieces with central slopes; at the newest sample, whose successor is not known yet, the slope is that of
// the last step. The result and its derivative by the delay are continuous for every delay from 0 on.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Four samples around the instant, the newest first: `whole - 1`, `whole`, `whole + 1`, `whole + 2` samples old.
template <class S> struct DelayCoefficients {
  S weight[4]{};        ///< weight of each sample; they sum to 1 [1]
  S slope[4]{};         ///< d weight / d delay, the delay in samples [1]
  std::size_t whole{};  ///< the delay's whole samples
};

/// Weights for a delay in samples, brought into [0, longest]; NaN counts as 0. S is one number or a Dual.
template <class S> DelayCoefficients<S> delay_coefficients(const S& samples, std::size_t longest) noexcept {
  const S d = min(max(samples, S(0)), S(static_cast<value_t<S>>(longest)));
  DelayCoefficients<S> c;
  c.whole = static_cast<std::size_t>(value_of(d));
  const S s = d - S(static_cast<value_t<S>>(c.whole));
  const S r = S(1) - s;
  // Hermite's polynomials from the newer sample (s = 0) to the older one (s = 1), and their derivatives.
  const S near_value = (S(1) + S(2) * s) * r * r, far_value = s * s * (S(3) - S(2) * s);
  const S near_slope = s * r * r, far_slope = -(s * s * r);
  const S near_value_d = S(-6) * s * r, far_value_d = S(6) * s * r;
  const S near_slope_d = r * (r - S(2) * s), far_slope_d = s * (S(3) * s - S(2));
  const S half = S(0.5);
  const bool newest = c.whole == 0;
  c.weight[0] = newest ? S(0) : -(half * near_slope);
  c.weight[1] = near_value - half * far_slope - (newest ? near_slope : S(0));
  c.weight[2] = far_value + (newest ? near_slope : half * near_slope);
  c.weight[3] = half * far_slope;
  c.slope[0] = newest ? S(0) : -(half * near_slope_d);
  c.slope[1] = near_value_d - half * far_slope_d - (newest ? near_slope_d : S(0));
  c.slope[2] = far_value_d + (newest ? near_slope_d : half * near_slope_d);
  c.slope[3] = half * far_slope_d;
  return c;
}

/// The last `capacity` samples.
template <class S, std::size_t capacity> struct DelayState {
  S sample[capacity]{};  ///< a ring
  std::size_t next{};    ///< where the next one goes
  bool any = false;      ///< false before the first sample, which then counts as all that were before it
};

/// One sample in, the delayed one out. A sample that is not finite passes through; the last one takes its place.
template <class S, std::size_t capacity>
S step(const DelayCoefficients<S>& c, DelayState<S, capacity>& state, const S& x) noexcept {
  static_assert(capacity >= 4, "four samples make one between");
  const bool keep = is_finite(x);
  if (!state.any) {
    if (!keep) return x;
    for (S& sample : state.sample) sample = x;
    state.any = true;
  }
  const std::size_t last = state.next == 0 ? capacity - 1 : state.next - 1;
  state.sample[state.next] = keep ? x : state.sample[last];
  const std::size_t now = state.next;
  state.next = now + 1 < capacity ? now + 1 : 0;
  const std::size_t whole = c.whole < capacity - 3 ? c.whole : capacity - 3;
  const auto old = [&state, now](std::size_t age) {
    return state.sample[now >= age ? now - age : now + capacity - age];
  };
  const S y = c.weight[0] * old(whole == 0 ? 0 : whole - 1) + c.weight[1] * old(whole) + c.weight[2] * old(whole + 1) +
              c.weight[3] * old(whole + 2);
  return keep ? y : x;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
