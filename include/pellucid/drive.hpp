// From a command to an effort at the joint: gain, back-EMF, and the ripple that an identified model does not know.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// A drive. [u] is the unit of its command: V, A or N m.
template <class S> struct DriveParams {
  S gain{1};               ///< k, effort per command [N m/u]
  S back_emf{};            ///< k_e, effort lost per velocity [N m s/rad], >= 0
  S ripple_amplitude{};    ///< A, of torque ripple and cogging [N m]
  S ripple_wave_number{};  ///< n, ripples per angle times 2 pi [1/rad], 1/m if prismatic
  S ripple_phase{};        ///< phi [rad]
};

/// Coefficients computed once from DriveParams.
template <class S> struct DriveCoefficients {
  DriveParams<S> params{};  ///< as they are
  bool any_ripple = false;  ///< whether there is ripple, in some lane
};

template <class S> DriveCoefficients<S> coefficients(const DriveParams<S>& params) noexcept {
  return {params, !is_identically_zero(params.ripple_amplitude)};
}

/// Effort that the current gives, as a current sensor sees it: k u - k_e v [N m].
template <class S> S drive_effort(const DriveCoefficients<S>& c, const S& command, const S& velocity) noexcept {
  return c.params.gain * command - c.params.back_emf * velocity;
}

/// Effort on the joint that no current shows: A sin(n q + phi) [N m].
template <class S> S ripple(const DriveCoefficients<S>& c, const S& position) noexcept {
  if (!c.any_ripple) return S(0);
  return c.params.ripple_amplitude * sin(c.params.ripple_wave_number * position + c.params.ripple_phase);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
