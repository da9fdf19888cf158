// What a drive's own measurement makes of the effort that it gives: lag, gain, offset, noise and quantum.
//
//   read = round((gain lagged + offset + noise) / quantum) quantum,   lag lagged' = effort - lagged
//
// Random numbers are drawn by the caller, where their seed is kept.
#pragma once

#include "fields.hpp"
#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Parameters of a drive's reading; by default the reading equals the effort.
template <class S> struct DriveReadingParams {
  S gain{1}, offset{}, lag{}, quantum{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.gain, {"gain", unit::one, above(0), "reading per effort"});
    visit(p.offset, {"offset", unit::effort, any_number(), "added to it"});
    visit(p.lag, {"lag", unit::time, at_least(0), "time constant of the measurement; 0: none"});
    visit(p.quantum, {"quantum", unit::effort, at_least(0), "smallest step that it resolves; 0: none"});
  }
};

/// Coefficients computed once from DriveReadingParams and the period.
template <class S> struct DriveReadingCoefficients {
  DriveReadingParams<S> params{};  ///< as they are
  S kept{};                        ///< share of the last reading that a period leaves [1]
};

template <class S> struct DriveReadingState {
  S lagged{};  ///< effort behind the lag [N m]
};

template <class S>
DriveReadingCoefficients<S> coefficients(const DriveReadingParams<S>& params, const S& period) noexcept {
  return {params, params.lag > S(0) ? exp(-period / params.lag) : S(0)};
}

/// The reading at the end of a period in which the drive gave `effort` [N m]; `noise` [N m].
template <class S>
S step(const DriveReadingCoefficients<S>& c, DriveReadingState<S>& s, const S& effort, const S& noise) noexcept {
  const DriveReadingParams<S>& p = c.params;
  s.lagged = effort + c.kept * (s.lagged - effort);
  const S read = p.gain * s.lagged + p.offset + noise;
  return p.quantum > S(0) ? round(read / p.quantum) * p.quantum : read;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
