// From an EMG envelope to a muscle's activation, both in [0, 1].
//
// Identified form, after Lloyd and Besier: a second-order recursion on samples with poles -C1, -C2 in [0, 1),
//   u_t = alpha e_t - b1 u_{t-1} - b2 u_{t-2},   b1 = C1 + C2, b2 = C1 C2, alpha = 1 + b1 + b2,
// run as two lags, one after the other: the same transfer function, and each output lies between its input and what it
// was, so nothing overshoots in float either. Then the shape a = (e^{A u} - 1) / (e^A - 1), which is u at A = 0.
// Simulated form, after Thelen: a first-order lag that is quicker while activation rises.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Constants of the identified form.
template <class S> struct ActivationParams {
  S shape{}, time_constant_1{}, time_constant_2{};
  S period{};  ///< sampling period [s]; no part of the walk

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.shape, {"shape", unit::one, between(-3, 0), "A; 0 is a straight line"});
    visit(p.time_constant_1, {"time_constant_1", unit::time, at_least(0), "of the first lag; 0 is none"});
    visit(p.time_constant_2, {"time_constant_2", unit::time, at_least(0), "of the second lag; 0 is none"});
  }
};

/// Coefficients computed once from ActivationParams.
template <class S> struct ActivationCoefficients {
  S gain_1{};            ///< 1 + C1, what the first lag takes of its input [1]
  S gain_2{};            ///< 1 + C2, what the second lag takes [1]
  S shape{};             ///< A [1]
  S inverse_expm1{};     ///< 1 / (e^A - 1) [1]
  mask_t<S> straight{};  ///< whether A is so near 0 that a series in A is exact, and the quotient is not
};

/// State of the two lags.
template <class S> struct ActivationState {
  S lag_1{};  ///< [1]
  S lag_2{};  ///< u, the neural activation [1]
};

namespace detail {
/// Time constants below a 64th of a period are none: e^-64 is far below an ulp, and the derivative stays finite.
constexpr double shortest_lag = 0.015625;
constexpr double straight_shape = 1e-2;
constexpr double largest_shape = 16.0;
}  // namespace detail

/// 1 - e^(-period / time constant): what a lag takes of its input at every sample [1].
template <class S> S lag_gain(const S& time_constant, const S& period) noexcept {
  return -expm1(-(period / max(time_constant, period * S(detail::shortest_lag))));
}

template <class S> ActivationCoefficients<S> coefficients(const ActivationParams<S>& params) noexcept {
  ActivationCoefficients<S> c;
  c.gain_1 = lag_gain(params.time_constant_1, params.period);
  c.gain_2 = lag_gain(params.time_constant_2, params.period);
  c.shape = clamp(params.shape, S(-detail::largest_shape), S(detail::largest_shape));
  c.straight = abs(c.shape) < S(detail::straight_shape);
  c.inverse_expm1 = S(1) / expm1(select(c.straight, S(1), c.shape));
  return c;
}

/// The lags as if `excitation` had always been there.
template <class S> void settle(ActivationState<S>& state, const S& excitation) noexcept {
  state.lag_1 = state.lag_2 = clamp(excitation, S(0), S(1));
}

/// Neural activation u one sample on [1]. An excitation that is not finite gives NaN and does not stay.
template <class S>
S neural_activation(const ActivationCoefficients<S>& c, ActivationState<S>& state, const S& excitation) noexcept {
  const S e = clamp(excitation, S(0), S(1));
  const mask_t<S> keep = is_finite(excitation);
  const S first = state.lag_1 + c.gain_1 * (e - state.lag_1);
  const S second = state.lag_2 + c.gain_2 * (first - state.lag_2);
  state.lag_1 = select(keep, first, state.lag_1);
  state.lag_2 = select(keep, second, state.lag_2);
  return select(keep, second, excitation - excitation);  // NaN, of an infinity too
}

/// Activation a(u) [1], in [0, 1].
template <class S> S shaped(const ActivationCoefficients<S>& c, const S& neural) noexcept {
  const S u = clamp(neural, S(0), S(1));
  // Bernoulli's polynomials: the series of the quotient in A.
  const S q = u * (u - S(1));
  const S m = S(2) * u - S(1);
  const S series =
      c.shape * (S(1.0 / 12) * m + c.shape * (S(1.0 / 24) * q + c.shape * (S(1.0 / 720) * m * (S(3) * q - S(1)))));
  const S quotient = expm1(c.shape * u) * c.inverse_expm1;
  return clamp(select(c.straight, u + c.shape * q * (S(0.5) + series), quotient), S(0), S(1));
}

/// Activation one sample on [1].
template <class S> S step(const ActivationCoefficients<S>& c, ActivationState<S>& state, const S& excitation) noexcept {
  return shaped(c, neural_activation(c, state, excitation));
}

/// Return the delay of the lags for slow signals: the sum of pole / (1 - pole) periods [s].
template <class S> S lag_delay(const ActivationCoefficients<S>& c, const S& period) noexcept {
  return period * ((S(1) - c.gain_1) / c.gain_1 + (S(1) - c.gain_2) / c.gain_2);
}

/// Constants of the simulated form: da/dt = (u - a) / tau, where tau = t_act (1/2 + 3a/2) while the activation rises
/// and t_deact / (1/2 + 3a/2) while it falls.
template <class S> struct ActivationDynamicsParams {
  S activation_time{S(0.010)};    ///< t_act [s], > 0
  S deactivation_time{S(0.040)};  ///< t_deact [s], > 0
  S period{};                     ///< sampling period [s]
};

/// Activation one period on, the excitation held meanwhile [1]: exact for the tau that holds at its start.
template <class S> S step(const ActivationDynamicsParams<S>& c, S& activation, const S& excitation) noexcept {
  const S u = clamp(excitation, S(0), S(1));
  const S slope = S(0.5) + S(1.5) * activation;
  const S time_constant = select(u > activation, c.activation_time * slope, c.deactivation_time / slope);
  const S next = clamp(activation + (u - activation) * lag_gain(time_constant, c.period), S(0), S(1));
  activation = select(is_finite(next), next, activation);
  return next;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
