// A compliant transmission with backlash: a spring and a damper that act only where flanks touch, and only push.
//
// Everything is on the joint's side of the gear. In the gap nothing is transmitted; on leaving a flank the damper would
// hold the link back, which a flank cannot, so the torque is never against the stretch. It dissipates or stores, always.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct TransmissionParams {
  S stiffness{}, damping{}, backlash{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.stiffness, {"stiffness", unit::stiffness, above(0), "K, of the transmission"});
    visit(p.damping, {"damping", unit::viscous, at_least(0), "D, while flanks touch"});
    visit(p.backlash, {"backlash", unit::coordinate, any_number(), "b, the whole gap; <= 0: none"});
  }
};

/// Coefficients computed once from TransmissionParams.
template <class S> struct TransmissionCoefficients {
  S stiffness{};          ///< K [N m/rad]
  S inverse_stiffness{};  ///< 1 / K [rad/(N m)]
  S damping{};            ///< D [N m s/rad]
  S half_backlash{};      ///< b / 2, at least 0 [rad]
};

template <class S> TransmissionCoefficients<S> coefficients(const TransmissionParams<S>& params) noexcept {
  return {params.stiffness, S(1) / params.stiffness, params.damping, max(S(0.5) * params.backlash, S(0))};
}

/// Torque on the link, and against the motor, for a twist q_m - q and its rate: K e + D rate where it has the sign of
/// the stretch e beyond the gap, 0 elsewhere [N m]. NaN stays NaN.
template <class S> S torque(const TransmissionCoefficients<S>& c, const S& twist, const S& rate) noexcept {
  const S stretch = twist - clamp(twist, -c.half_backlash, c.half_backlash);
  const S push = c.stiffness * stretch + c.damping * rate;
  return select(stretch * push <= S(0), S(0), push);
}

/// The twist that transmits a torque at rest: torque / K + sign(torque) b / 2; 0, the middle of the gap, for none
/// [rad].
template <class S> S twist(const TransmissionCoefficients<S>& c, const S& torque) noexcept {
  return torque * c.inverse_stiffness + sign(torque) * c.half_backlash;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
