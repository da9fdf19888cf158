// How the wearer is about to speed up, from the torque that EMG says the muscles are building up.
//
//   a = (tau_m - b v - g sin q - slow part) / (J_limb + J_left)
//
// EMG leads the torque by the muscle's own delay, so this acceleration comes before any encoder can show it. What
// changes slower than a movement is taken for the error of EMG's gain and of the limb's weight, and left out.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct EmgPredictionParams {
  S limb_inertia = S(1), limb_gravity{}, limb_viscous{}, slow = S(0.5), acceleration_limit{}, share{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.limb_inertia, {"limb_inertia", unit::inertia, above(0).or_infinite(),
                           "J of limb and of what of the robot is left to it"});
    visit(p.limb_gravity, {"limb_gravity", unit::effort, any_number(), "m g l of the limb"});
    visit(p.limb_viscous, {"limb_viscous", unit::viscous, at_least(0).or_infinite(), "b of the wearer's joint"});
    visit(p.slow, {"emg_slow", unit::velocity, at_least(0).or_infinite(),
                   "rate below which an EMG torque is an error"});
    visit(p.acceleration_limit, {"emg_limit", unit::acceleration, at_least(0), "limit of |a| predicted from EMG"});
    visit(p.share, {"emg_share", unit::one, pellucid::share(), "share of the fed forward acceleration from EMG"});
  }
};
/// Coefficients computed once from EmgPredictionParams and the period.
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
  c.valid = is_sound(p);
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
