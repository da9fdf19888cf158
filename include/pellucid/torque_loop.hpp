// The torque loop inside a series-elastic actuator: the spring's deflection, read by two encoders, is its torque sensor.
//
//   u = tau_d + k_p (tau_d - tau) + k_i integral(tau_d - tau) - k_d d tau/dt,   tau = K (q_m - q_e)
//
// with limits on what is asked for and on what the motor gives, an integral that waits while it would push further into
// the motor's limit, and a command that reaches the motor whole periods late. A sample that is no number does not stay: a
// desired torque counts as none, a measured one as the last, a command as 0. A gain that is none shows in every command.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// The longest delay of the command, and the longest difference of the torque [samples].
constexpr std::uint32_t max_torque_span = 8;

template <class S> struct TorqueLoopParams {
  S kp{}, ki{}, kd{}, torque_limit{}, motor_limit{}, stiffness{};
  std::uint32_t delay = 0;        ///< samples from reading to motor, up to 7
  std::uint32_t torque_span = 1;  ///< samples that d tau/dt spans, 1 to 7
  S period{};                     ///< [s], > 0

  template <class P, class V> static constexpr void gains(P& p, V& visit) noexcept {
    visit(p.kp, {"torque_kp", unit::one, any_number(), "k_p"});
    visit(p.ki, {"torque_ki", unit::rate, any_number(), "k_i"});
    visit(p.kd, {"torque_kd", unit::time, any_number(), "k_d"});
    visit(p.torque_limit, {"torque_limit", unit::effort, any_number(), "limit of |tau_d|; <= 0: none"});
    visit(p.motor_limit, {"motor_limit", unit::effort, any_number(), "limit of |u|; <= 0: none"});
    visit(p.stiffness, {"calibrated_stiffness", unit::stiffness, any_number(), "K as the controller knows it"});
  }
};

/// Coefficients computed once from TorqueLoopParams.
template <class S> struct TorqueLoopCoefficients {
  S kp{};                         ///< [1]
  S ki{};                         ///< [1/s]
  S rate_gain{};                  ///< k_d / (torque_span period) [1]
  S torque_limit{};               ///< limit of |tau_d| [N m], infinite where there is none
  S motor_limit{};                ///< limit of |u| [N m], infinite where there is none
  S stiffness{};                  ///< K as calibrated [N m/rad]
  S period{};                     ///< [s]
  mask_t<S> sound{};              ///< whether the gains are numbers
  std::uint32_t delay = 0;        ///< [samples]
  std::uint32_t torque_span = 1;  ///< [samples]
};

template <class S> TorqueLoopCoefficients<S> coefficients(const TorqueLoopParams<S>& params) noexcept {
  using T = value_t<S>;
  constexpr std::uint32_t longest = max_torque_span - 1;
  const S infinity = S(std::numeric_limits<T>::infinity());
  TorqueLoopCoefficients<S> c;
  c.delay = params.delay < longest ? params.delay : longest;
  c.torque_span = params.torque_span < 1 ? 1 : params.torque_span < longest ? params.torque_span : longest;
  c.kp = params.kp;
  c.ki = params.ki;
  c.rate_gain = params.kd / (S(static_cast<T>(c.torque_span)) * params.period);
  c.torque_limit = select(params.torque_limit > S(0), params.torque_limit, infinity);
  c.motor_limit = select(params.motor_limit > S(0), params.motor_limit, infinity);
  c.stiffness = params.stiffness;
  c.period = params.period;
  c.sound = both(is_finite(c.kp + c.ki), is_finite(c.rate_gain + c.period + c.stiffness));
  return c;
}

/// State of the loop.
template <class S> struct TorqueLoopState {
  S integral{};                   ///< integral of the torque's error [N m s]
  S torques[max_torque_span]{};   ///< the last measured torques, a ring [N m]
  S commands[max_torque_span]{};  ///< the last commands, a ring [N m]
  std::uint32_t next = 0;         ///< where the rings are written next
};

/// A state as if a torque had been asked for, and held, for long.
template <class S> TorqueLoopState<S> settled(const S& torque) noexcept {
  TorqueLoopState<S> state;
  for (std::uint32_t i = 0; i < max_torque_span; ++i) {
    state.torques[i] = torque;
    state.commands[i] = torque;
  }
  return state;
}

/// Spring torque from the encoders: K (q_m - q_e) [N m].
template <class S>
S measured_torque(const TorqueLoopCoefficients<S>& c, const S& motor_position, const S& position) noexcept {
  return c.stiffness * (motor_position - position);
}

/// One control period: the torque the motor gives during it [N m].
template <class S>
S step(const TorqueLoopCoefficients<S>& c, TorqueLoopState<S>& state, const S& desired, const S& measured) noexcept {
  constexpr std::uint32_t wrap = max_torque_span - 1;
  const auto lost = [&c](const S& x) { return both(c.sound, !is_finite(x)); };
  const S wanted = clamp(select(lost(desired), S(0), desired), -c.torque_limit, c.torque_limit);
  const S torque = select(lost(measured), state.torques[(state.next - 1) & wrap], measured);
  const S error = wanted - torque;
  const S rate = torque - state.torques[(state.next - c.torque_span) & wrap];
  const S proportional = wanted + c.kp * error - c.rate_gain * rate;
  const S integral = state.integral + error * c.period;
  const S whole = proportional + c.ki * integral;
  const mask_t<S> waits = both(abs(whole) > c.motor_limit, same_sign(c.ki * error, whole));
  state.integral = select(waits, state.integral, select(lost(integral), S(0), integral));
  state.torques[state.next] = torque;
  const S command = clamp(proportional + c.ki * state.integral, -c.motor_limit, c.motor_limit);
  state.commands[state.next] = select(lost(command), S(0), command);
  const S given = state.commands[(state.next - c.delay) & wrap];
  state.next = (state.next + 1) & wrap;
  return given;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
