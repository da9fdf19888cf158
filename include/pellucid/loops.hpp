// The machine's own controllers, as its manufacturer or its lab wrote them: P, PI, PD, cascade, PI on velocity.
//
// All are one law, u = g e + k_i integral(e) + k_d (r' - v), with a limit, and an integral that waits while it would
// push further into the limit. The velocity is what a real controller computes, a difference of measured positions.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Kinds of loops: e is the error that the integral sums, g its gain.
enum class LoopKind : std::uint8_t {
  none,         ///< open loop: u = r, the reference is the command
  p,            ///< e = r - q, g = k_p
  pi,           ///< e = r - q, g = k_p, integral
  pd,           ///< e = r - q, g = k_p, and k_d (r' - v)
  cascade,      ///< e = k_p (r - q) - v, g = k_v, integral
  velocity_pi,  ///< r is a velocity, e = r - v, g = k_p, integral
};

/// The longest difference that a velocity is computed from [samples].
constexpr std::uint32_t max_velocity_span = 8;

/// A loop as it is set up. [u] is the unit of the command: V, A, N m or whatever the drive takes.
template <class S> struct LoopParams {
  LoopKind kind = LoopKind::none;   ///< the law
  S kp{};                           ///< k_p [u/rad]; cascade [1/s]; velocity_pi [u s/rad]
  S ki{};                           ///< k_i [u/(rad s)]; cascade and velocity_pi [u/rad]
  S kd{};                           ///< k_d [u s/rad], of pd
  S kv{};                           ///< k_v [u s/rad], of cascade
  S limit{};                        ///< limit of |u| [u]; <= 0: none
  std::uint32_t velocity_span = 0;  ///< samples that a velocity spans, up to 8; 0: the true velocity
  S period{};                       ///< control period [s], > 0
};

/// Coefficients computed once from LoopParams.
template <class S> struct LoopCoefficients {
  LoopKind kind = LoopKind::none;    ///< the law
  S position_gain{};                 ///< gain of the position error in e: 1, k_p (cascade) or 0 [1 or 1/s]
  S gain{};                          ///< g [u per unit of e]
  S ki{};                            ///< k_i, 0 where the law has no integral
  S kd{};                            ///< k_d, 0 where the law has none [u s/rad]
  S limit{};                         ///< limit of |u| [u], infinite where there is none
  S period{};                        ///< [s]
  S inverse_velocity_time{};         ///< 1 / (velocity_span period) [1/s], 0 for the true velocity
  S inverse_reference_time{};        ///< 1 / (reference_span period) [1/s]
  std::uint32_t velocity_span = 0;   ///< [samples]
  std::uint32_t reference_span = 1;  ///< span of r': the velocity's span, at least 1 [samples]
};

template <class S> LoopCoefficients<S> coefficients(const LoopParams<S>& params) noexcept {
  using T = value_t<S>;
  const bool cascade = params.kind == LoopKind::cascade;
  const bool has_integral = cascade || params.kind == LoopKind::pi || params.kind == LoopKind::velocity_pi;
  LoopCoefficients<S> c;
  c.kind = params.kind;
  c.position_gain = cascade ? params.kp : S(params.kind == LoopKind::velocity_pi ? 0 : 1);
  c.gain = cascade ? params.kv : params.kp;
  c.ki = has_integral ? params.ki : S(0);
  c.kd = params.kind == LoopKind::pd ? params.kd : S(0);
  c.limit = select(params.limit > S(0), params.limit, S(std::numeric_limits<T>::infinity()));
  c.period = params.period;
  c.velocity_span = params.velocity_span < max_velocity_span ? params.velocity_span : max_velocity_span;
  c.reference_span = c.velocity_span > 0 ? c.velocity_span : 1;
  c.inverse_reference_time = S(1) / (S(static_cast<T>(c.reference_span)) * params.period);
  c.inverse_velocity_time = c.velocity_span > 0 ? c.inverse_reference_time : S(0);
  return c;
}

/// State of a loop.
template <class S> struct LoopState {
  S integral{};                       ///< integral of e [unit of e times s]
  S positions[max_velocity_span]{};   ///< the last measured positions, a ring [rad]
  S references[max_velocity_span]{};  ///< the last references, a ring [rad]
  std::uint32_t next = 0;             ///< where the ring is written next
  bool started = false;               ///< false until the first sample, which fills both rings
};

/// Inputs of a loop in each period.
template <class S> struct LoopInput {
  S reference{};      ///< r [rad]; velocity_pi [rad/s]; none [u]
  S position{};       ///< q, as measured [rad]
  S true_velocity{};  ///< velocity of the plant [rad/s]; used where velocity_span is 0
};

/// One control period: the limited command u.
template <class S> S step(const LoopCoefficients<S>& c, LoopState<S>& state, const LoopInput<S>& input) noexcept {
  if (c.kind == LoopKind::none) return clamp(input.reference, -c.limit, c.limit);
  if (!state.started) {
    for (std::uint32_t i = 0; i < max_velocity_span; ++i) {
      state.positions[i] = input.position;
      state.references[i] = input.reference;
    }
    state.started = true;
  }
  // v_k = (q_k - q_{k-span}) / (span period), and the same for the reference.
  constexpr std::uint32_t wrap = max_velocity_span - 1;
  const S past_position = state.positions[(state.next - c.velocity_span) & wrap];
  const S past_reference = state.references[(state.next - c.reference_span) & wrap];
  const S velocity =
      c.velocity_span == 0 ? input.true_velocity : (input.position - past_position) * c.inverse_velocity_time;
  const S reference_rate = (input.reference - past_reference) * c.inverse_reference_time;
  state.positions[state.next] = input.position;
  state.references[state.next] = input.reference;
  state.next = (state.next + 1) & wrap;

  S error = c.position_gain * (input.reference - input.position);
  if (c.kind == LoopKind::cascade) error = error - velocity;
  if (c.kind == LoopKind::velocity_pi) error = input.reference - velocity;
  S proportional = c.gain * error;
  if (c.kind == LoopKind::pd) proportional = proportional + c.kd * (reference_rate - velocity);
  const S integral = state.integral + error * c.period;
  const S wanted = proportional + c.ki * integral;
  const mask_t<S> waits = both(abs(wanted) > c.limit, same_sign(c.ki * error, wanted));
  state.integral = select(waits, state.integral, integral);
  return clamp(proportional + c.ki * state.integral, -c.limit, c.limit);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
