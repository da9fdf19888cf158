// Torque of several muscles at one joint, from their EMG envelopes, sample by sample and causal.
//
//   envelope -> delay -> two lags -> shape -> muscle on a rigid tendon -> sum of moment arm times force
//
// Musculotendon lengths, their rates and moment arms come in with every sample: geometry belongs to the joint.
#pragma once

#include "activation.hpp"
#include "fractional_delay.hpp"
#include "muscle.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// One muscle from its envelope on.
template <class S> struct EmgMuscleParams {
  S delay{};                         ///< electromechanical [s]
  ActivationParams<S> activation{};  ///< lags and shape
  MuscleParams<S> muscle{};          ///< force

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pellucid::walk(p.activation, visit);
    visit(p.delay, {"delay", unit::time, at_least(0), "electromechanical"});
    pellucid::walk(p.muscle, visit);
  }
};

/// Number of parameters of a muscle; identification estimates the first of them.
constexpr std::size_t muscle_parameter_count = field_count<EmgMuscleParams<double>>;
constexpr std::size_t muscle_free_count = 11;

/// EmgMuscleParams of its numbers, at a period.
template <class S> EmgMuscleParams<S> emg_muscle_params(const S* numbers, const S& period) noexcept {
  EmgMuscleParams<S> params = from_numbers<EmgMuscleParams<S>>(numbers);
  params.activation.period = period;
  return params;
}

template <class S, std::size_t most> struct HillTorqueParams {
  EmgMuscleParams<S> muscle[most]{};  ///< in the order of every input; their periods are one and the same
  std::size_t count = 0;              ///< how many are used; more than `most` count as `most`
};

/// Coefficients computed once from EmgMuscleParams.
template <class S> struct EmgMuscleCoefficients {
  DelayCoefficients<S> delay{};            ///< electromechanical
  ActivationCoefficients<S> activation{};  ///< lags and shape
  MuscleCoefficients<S> muscle{};          ///< force
};

/// `longest` is the most samples a delay may have.
template <class S>
EmgMuscleCoefficients<S> coefficients(const EmgMuscleParams<S>& params, std::size_t longest) noexcept {
  return {delay_coefficients(params.delay / params.activation.period, longest), coefficients(params.activation),
          coefficients(params.muscle)};
}

/// Coefficients computed once from HillTorqueParams.
template <class S, std::size_t most> struct HillTorqueCoefficients {
  EmgMuscleCoefficients<S> muscle[most]{};  ///< in the order of every input
  std::size_t count = 0;                    ///< at most `most`
};

template <std::size_t capacity, class S, std::size_t most>
HillTorqueCoefficients<S, most> coefficients(const HillTorqueParams<S, most>& params) noexcept {
  HillTorqueCoefficients<S, most> c;
  c.count = params.count < most ? params.count : most;
  for (std::size_t i = 0; i < c.count; ++i) c.muscle[i] = coefficients(params.muscle[i], capacity - 3);
  return c;
}

/// State of a muscle. Zeros except for `settled` are a valid initial state.
template <class S, std::size_t capacity> struct EmgMuscleState {
  DelayState<S, capacity> delay{};  ///< envelopes
  ActivationState<S> lags{};        ///< state of the activation
  S activation{};                   ///< at the last sample [1]
  Fibre<S> fibre{};                 ///< at the last sample
  S force{};                        ///< in the tendon at the last sample [N]
  bool settled = false;             ///< whether the lags have begun
};

/// Force in one muscle's tendon [N], from its envelope [1], musculotendon length [m] and its rate [m/s].
template <class S, std::size_t capacity>
S step(const EmgMuscleCoefficients<S>& c, EmgMuscleState<S, capacity>& state, const S& excitation, const S& length,
       const S& velocity) noexcept {
  const S e = step(c.delay, state.delay, excitation);
  if (!state.settled && is_finite(e)) {
    settle(state.lags, e);
    state.settled = true;
  }
  state.activation = step(c.activation, state.lags, e);
  state.fibre = fibre(c.muscle, length, velocity);
  state.force = tendon_force(c.muscle, state.activation, state.fibre);
  return state.force;
}

/// State of the estimator.
template <class S, std::size_t most, std::size_t capacity> struct HillTorqueState {
  EmgMuscleState<S, capacity> muscle[most]{};  ///< in the order of every input
};

/// Inputs of the estimator with each sample.
template <class S, std::size_t most> struct HillTorqueInput {
  S excitation[most]{};  ///< envelopes, relative to maximal effort [1]
  S length[most]{};      ///< musculotendon [m]
  S velocity[most]{};    ///< its rate [m/s]
  S moment_arm[most]{};  ///< about the joint, positive where the muscle pulls along +q [m]
};

/// Torque of all muscles [N m]. A sample that is not finite makes it so, and does not stay.
template <class S, std::size_t most, std::size_t capacity> S step(const HillTorqueCoefficients<S, most>& c,
                                                                  HillTorqueState<S, most, capacity>& state,
                                                                  const HillTorqueInput<S, most>& input) noexcept {
  S torque(0);
  for (std::size_t i = 0; i < c.count; ++i)
    torque = torque + input.moment_arm[i] * step(c.muscle[i], state.muscle[i], input.excitation[i], input.length[i],
                                                 input.velocity[i]);
  return torque;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
