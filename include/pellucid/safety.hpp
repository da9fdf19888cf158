// The safety gate: the last step of every controller, between what was computed and what the motor gets.
//
// Whatever comes in, what goes out is a finite effort within the limit. A fault latches: the output ramps to 0 and
// stays there until reset. Comparisons are written !(x >= low && x <= high), which NaN cannot walk through.
// Times are whole microseconds: seconds in float would stop telling milliseconds apart after a few hours.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct SafetyParams {
  S effort_limit{};               ///< of |effort| [N m], > 0
  S rate_limit{};                 ///< of |d effort / dt| [N m/s], > 0
  S velocity_limit{};             ///< of |velocity|; beyond is a fault [rad/s], > 0, infinite: none
  S position_min{};               ///< lower stop [rad], -infinite: none
  S position_max{};               ///< upper stop [rad], infinite: none
  S stop_margin{};                ///< distance to a stop over which the effort into it falls to 0 [rad], >= 0
  S max_age{};                    ///< of a sample, and of a gap between two; older is a fault [s], > 0, infinite: none
  std::uint32_t max_repeats = 0;  ///< how often one sample may be seen again before that is a fault
  S period{};                     ///< between two steps [s], > 0
};

/// Why a gate is shut.
enum class SafetyFault : std::uint8_t {
  none,           ///< it is open
  configuration,  ///< its parameters make no sense
  not_finite,     ///< the command, the position, the velocity or the time was NaN or infinite
  stale,          ///< the sample was too old, seen too often, or came after too long a gap
  out_of_order,   ///< the sequence number or the time went backwards
  velocity,       ///< faster than velocity_limit
};
constexpr const char* safety_fault_names[] = {"none",  "configuration", "not_finite",
                                              "stale", "out_of_order",  "velocity"};

/// What follows from SafetyParams once.
template <class S> struct SafetyCoefficients {
  SafetyParams<S> params{};  ///< as they are
  bool valid = false;        ///< whether they make sense
  S max_change{};            ///< of the effort in a period [N m]
  S inverse_margin{};        ///< 1 / stop_margin [1/rad], infinite for a margin of 0
  std::int64_t max_gap = 0;  ///< max_age [us]
};

template <class S> SafetyCoefficients<S> coefficients(const SafetyParams<S>& p) noexcept {
  SafetyCoefficients<S> c;
  c.params = p;
  c.valid = p.effort_limit > S(0) && is_finite(p.effort_limit) && p.rate_limit > S(0) && is_finite(p.rate_limit) &&
            p.velocity_limit > S(0) && p.position_min < p.position_max && p.stop_margin >= S(0) &&
            is_finite(p.stop_margin) && p.max_age > S(0) && p.period > S(0) && is_finite(p.period);
  c.max_change = p.rate_limit * p.period;
  c.inverse_margin = p.stop_margin > S(0) ? S(1) / p.stop_margin : S(std::numeric_limits<S>::infinity());
  const bool bounded = p.max_age > S(0) && p.max_age < S(2000);  // what 32 bits of microseconds hold
  c.max_gap = bounded ? static_cast<std::int32_t>(p.max_age * S(1e6)) : std::numeric_limits<std::int64_t>::max();
  return c;
}

/// What a gate is given each period.
template <class S> struct SafetyInput {
  S command{};                 ///< effort wanted [N m]
  S position{};                ///< of the joint [rad]
  S velocity{};                ///< of the joint [rad/s]
  std::int64_t time = 0;       ///< when position and velocity were measured, on any clock that only goes on [us]
  std::uint32_t sequence = 0;  ///< number of that sample; may wrap around
  bool valid = true;           ///< false: the sensor itself says that this is no measurement
};

/// What a gate remembers. Its fault can be read at any time.
template <class S> struct SafetyState {
  SafetyFault fault = SafetyFault::none;  ///< latched
  S output{};                             ///< the last one [N m]
  S position{};                           ///< the last one that was a number [rad]
  std::int64_t time = 0;                  ///< of the last new sample [us]
  std::uint32_t sequence = 0;             ///< of the last new sample
  std::uint32_t repeats = 0;              ///< of it so far
  bool started = false;                   ///< false until the first sample
};

/// Opens a gate again. The output goes on from where it is, within the rate limit.
template <class S> void reset(SafetyState<S>& state) noexcept {
  state.fault = SafetyFault::none;
  state.repeats = 0;
  state.started = false;
}

/// What is wrong with this sample after the last, if anything. Also takes note of it.
template <class S>
SafetyFault examine(const SafetyCoefficients<S>& c, SafetyState<S>& state, const SafetyInput<S>& input) noexcept {
  if (!(input.valid && is_finite(input.command) && is_finite(input.position) && is_finite(input.velocity)))
    return SafetyFault::not_finite;
  const std::uint32_t ahead = input.sequence - state.sequence;
  // Unsigned differences cannot overflow; an honest clock is never ahead by more than half its range.
  const std::uint64_t gap = static_cast<std::uint64_t>(input.time) - static_cast<std::uint64_t>(state.time);
  if (state.started) {
    if (ahead > 0x7fffffffu || gap > 0x7fffffffffffffffu) return SafetyFault::out_of_order;
    if (ahead == 0 || gap == 0) {
      if (state.repeats < 0xffffffffu) ++state.repeats;
      const S age = static_cast<S>(state.repeats) * c.params.period;
      if (state.repeats > c.params.max_repeats || !(age <= c.params.max_age)) return SafetyFault::stale;
    } else {
      if (gap > static_cast<std::uint64_t>(c.max_gap)) return SafetyFault::stale;
      state.repeats = 0;
    }
  }
  state.started = true;
  state.sequence = input.sequence;
  if (state.repeats == 0) state.time = input.time;
  if (!(abs(input.velocity) <= c.params.velocity_limit)) return SafetyFault::velocity;
  return SafetyFault::none;
}

/// How much of the effort limit may still push towards a stop at this distance: 1 far away, 0 at the stop and beyond.
template <class S> S stop_taper(const SafetyCoefficients<S>& c, S distance) noexcept {
  if (!(distance > S(0))) return S(0);
  const S share = distance * c.inverse_margin;
  return share < S(1) ? share : S(1);
}

/// One control period: the effort that may go to the motor [N m].
/// |output| <= effort_limit; it changes by at most rate_limit period, except where a stop asks for less.
template <class S> S step(const SafetyCoefficients<S>& c, SafetyState<S>& state, const SafetyInput<S>& input) noexcept {
  if (!c.valid) {
    state.fault = SafetyFault::configuration;
    state.output = S(0);
    return state.output;
  }
  if (state.fault == SafetyFault::none) state.fault = examine(c, state, input);
  if (is_finite(input.position)) state.position = input.position;

  const S limit = c.params.effort_limit;
  const S wanted = state.fault == SafetyFault::none ? clamp(input.command, -limit, limit) : S(0);
  const S ramped = clamp(wanted, state.output - c.max_change, state.output + c.max_change);
  const S highest = limit * stop_taper(c, c.params.position_max - state.position);
  const S lowest = -limit * stop_taper(c, state.position - c.params.position_min);
  const S output = clamp(ramped, lowest, highest);
  state.output = !(output >= -limit && output <= limit) ? S(0) : output;
  return state.output;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
