// What an encoder makes of a position. Random numbers are drawn by the caller, where their seed is kept.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct EncoderParams {
  S quantum{};  ///< the smallest step it resolves [rad]; <= 0: none
};

/// Coefficients computed once from EncoderParams.
template <class S> struct EncoderCoefficients {
  S quantum{};                 ///< [rad], 1 where there is none
  mask_t<S> quantises{};       ///< whether there is a quantum
  bool any_quantises = false;  ///< in some lane
};

template <class S> EncoderCoefficients<S> coefficients(const EncoderParams<S>& params) noexcept {
  EncoderCoefficients<S> c;
  c.quantises = params.quantum > S(0);
  c.quantum = select(c.quantises, params.quantum, S(1));
  c.any_quantises = any(c.quantises);
  return c;
}

/// round(q / quantum) quantum + noise [rad]. The staircase is differentiated as its mean slope, 1.
template <class S> S step(const EncoderCoefficients<S>& c, const S& position, const S& noise) noexcept {
  if (!c.any_quantises) return position + noise;
  const S staircase = round(position / c.quantum) * c.quantum;
  return with_value(position, value_of(select(c.quantises, staircase, position))) + noise;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
