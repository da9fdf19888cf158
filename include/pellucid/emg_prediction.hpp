// How the wearer is about to speed up, from the torque that EMG says the muscles are building up.
//
//   a = (tau_m - b v - g sin q - slow part) / (J_limb + J_left)
//
// EMG leads the torque by the muscle's own delay, so this acceleration comes before any encoder can show it. What
// changes slower than a movement is taken for the error of EMG's gain and of the limb's weight, and left out.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct EmgPredictionParams {
  S limb_inertia{};        ///< J of limb and of what of the robot is left to it [kg m^2], > 0
  S limb_gravity{};        ///< g = m g l [N m]
  S limb_viscous{};        ///< b [N m s/rad], >= 0
  S slow{};                ///< rate below which a torque is an error [rad/s], >= 0
  S acceleration_limit{};  ///< of |a| [rad/s^2], >= 0
  S share{};               ///< how much of the feed-forward acceleration is this one, 0 to 1
};

/// What follows from EmgPredictionParams and the period once.
template <class S> struct EmgPredictionCoefficients {
  EmgPredictionParams<S> params{};  ///< as they are
  S inverse_inertia{};              ///< [1/(kg m^2)]
  S slow{};                         ///< share of a new sample in the slow part [1]
  bool valid = false;               ///< whether the parameters make sense
};

template <class S>
EmgPredictionCoefficients<S> coefficients(const EmgPredictionParams<S>& p, const S& period) noexcept {
  EmgPredictionCoefficients<S> c;
  c.params = p;
  c.inverse_inertia = S(1) / p.limb_inertia;
  c.slow = S(1) - exp(-p.slow * period);
  c.valid = p.limb_inertia > S(0) && is_finite(p.limb_gravity) && p.limb_viscous >= S(0) && p.slow >= S(0) &&
            p.acceleration_limit >= S(0) && is_finite(p.acceleration_limit) && p.share >= S(0) && p.share <= S(1);
  return c;
}

template <class S> struct EmgPredictionState {
  S slow{};              ///< slow part of the net torque [N m]
  bool started = false;  ///< false until the first sample
};

/// One period: the acceleration to feed forward, from the encoder's and from the muscles' [rad/s^2].
template <class S> S step(const EmgPredictionCoefficients<S>& c, EmgPredictionState<S>& state, const S& muscle,
                          bool heard, const S& position, const S& velocity, const S& acceleration) noexcept {
  if (!heard || !is_finite(muscle) || !(c.params.share > S(0))) {
    state.started = false;
    return acceleration;
  }
  const S net = muscle - c.params.limb_viscous * velocity - c.params.limb_gravity * sin(position);
  if (!state.started || !is_finite(state.slow)) state.slow = net;
  state.started = true;
  state.slow = state.slow + c.slow * (net - state.slow);
  const S limit = c.params.acceleration_limit;
  const S predicted = clamp((net - state.slow) * c.inverse_inertia, -limit, limit);
  return acceleration + c.params.share * (predicted - acceleration);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
