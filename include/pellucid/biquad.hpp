// A cascade of second-order sections in direct form II transposed, the form that stays accurate in float.
//
//   y = b0 x + s1,   s1 <- b1 x - a1 y + s2,   s2 <- b2 x - a2 y      in every section, a0 = 1
//
// A section is {b0, b1, b2, a1, a2}: SciPy's row without its a0 = 1, and the signs of SciPy (CMSIS-DSP stores -a1, -a2).
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// One section, H(z) = (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2).
template <class S> struct BiquadSection {
  S b0{1};  ///< [1]
  S b1{};   ///< [1]
  S b2{};   ///< [1]
  S a1{};   ///< [1]
  S a2{};   ///< [1]
};

/// Up to `max_sections` sections. A filter's parameters are its coefficients: nothing follows from them.
template <class S, std::size_t max_sections = 8> struct BiquadCoefficients {
  BiquadSection<S> section[max_sections]{};  ///< in the order the signal passes them
  std::size_t count = 0;                     ///< how many are used; more than max_sections count as max_sections
};

/// State of a cascade.
template <class S, std::size_t max_sections = 8> struct BiquadState {
  S s1[max_sections]{};  ///< one per section, in the signal's unit
  S s2[max_sections]{};  ///< one per section, in the signal's unit
};

/// One sample through one section, whose memory is s1 and s2.
template <class S> S pass(const BiquadSection<S>& k, S& s1, S& s2, S x) noexcept {
  const S y = k.b0 * x + s1;
  s1 = (k.b1 * x - k.a1 * y) + s2;
  s2 = k.b2 * x - k.a2 * y;
  return y;
}

/// One sample. A sample that is not finite, or makes the output so, passes through and the state starts again at 0:
/// the next filter, or the gate, sees it, and it does not stay.
template <class S, std::size_t max_sections>
S step(const BiquadCoefficients<S, max_sections>& c, BiquadState<S, max_sections>& state, S x) noexcept {
  const std::size_t count = c.count < max_sections ? c.count : max_sections;
  S y = x;
  for (std::size_t i = 0; i < count; ++i) y = pass(c.section[i], state.s1[i], state.s2[i], y);
  const mask_t<S> keep = is_finite(y);
  for (std::size_t i = 0; i < count; ++i) {
    state.s1[i] = select(both(keep, is_finite(state.s1[i])), state.s1[i], S(0));
    state.s2[i] = select(both(keep, is_finite(state.s2[i])), state.s2[i], S(0));
  }
  return y;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
