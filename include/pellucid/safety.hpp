// The safety gate: the last step of every controller, between what was computed and what the motor gets.
//
// Whatever comes in, what goes out is a finite effort within the limit. A fault latches: the output ramps to 0 and
// stays there until reset. Comparisons are written !(x >= low && x <= high), which NaN cannot walk through.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct SafetyParams {
  S effort_limit{}, rate_limit{}, velocity_limit{}, position_min{}, position_max{}, stop_margin{}, max_age{};
  std::uint32_t max_repeats = 0;
  S period{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.effort_limit, {"effort_limit", unit::effort, above(0), "limit of |effort|"});
    visit(p.rate_limit, {"rate_limit", unit::effort_rate, above(0), "limit of |d effort / dt|"});
    visit(p.velocity_limit, {"velocity_limit", unit::velocity, above(0).or_infinite(),
                             "of |velocity|, by a law's estimate and by the encoder's change, smoothed; beyond both is a "
                           "fault; infinite: none"});
    visit(p.position_min, {"position_min", unit::coordinate, any_number().or_infinite(),
                           "lower stop; -infinite: none"});
    visit(p.position_max, {"position_max", unit::coordinate, any_number().or_infinite(),
                           "upper stop; infinite: none"});
    visit(p.stop_margin, {"stop_margin", unit::coordinate, at_least(0),
                          "distance to a stop over which the effort into it falls to 0"});
    visit(p.max_age, {"max_age", unit::time, above(0).or_infinite(),
                      "largest age of a sample, and largest gap between two; infinite: none"});
    visit(p.max_repeats, {"max_repeats", unit::one, at_least(0),
                          "largest number of repetitions of one sample before a fault"});
    visit(p.period, {"period", unit::time, above(0), "between two steps"});
  }
};

/// Rate at which the way of a period is smoothed [1/s]: counts, noise and late readings of an encoder are no speed.
constexpr double way_rate = 125.0;

/// Coefficients computed once from SafetyParams.
template <class S> struct SafetyCoefficients {
  SafetyParams<S> params{};  ///< as they are
  bool valid = false;        ///< whether they make sense
  S max_change{};            ///< largest change of the effort in a period [N m]
  S max_way{};               ///< way in a period at the velocity limit [rad]
  S smoothing{};             ///< share of a new way in the smooth one [1]
  S inverse_margin{};        ///< 1 / stop_margin [1/rad], infinite for a margin of 0
  SampleRules rules{};       ///< when a sample is too old
};

template <class S> SafetyCoefficients<S> coefficients(const SafetyParams<S>& p) noexcept {
  SafetyCoefficients<S> c;
  c.params = p;
  c.valid = is_sound(p) && p.position_min < p.position_max;
  c.max_change = p.rate_limit * p.period;
  c.max_way = p.velocity_limit * p.period;
  const S share = S(way_rate) * p.period;
  c.smoothing = share < S(1) ? share : S(1);
  c.inverse_margin = p.stop_margin > S(0) ? S(1) / p.stop_margin : S(std::numeric_limits<S>::infinity());
  const bool bounded = p.max_age > S(0) && p.max_age < S(2000);  // what 32 bits of microseconds hold
  c.rules.max_age = bounded ? static_cast<std::int32_t>(p.max_age * S(1e6)) : std::numeric_limits<std::int64_t>::max();
  c.rules.max_repeats = p.max_repeats;
  // A sample seen n times again is n periods old.
  const S most = p.max_age / p.period;
  if (c.valid && most < static_cast<S>(p.max_repeats)) {
    c.rules.max_repeats = static_cast<std::uint32_t>(most);
    if (static_cast<S>(c.rules.max_repeats + 1) * p.period <= p.max_age) ++c.rules.max_repeats;
    if (!(static_cast<S>(c.rules.max_repeats) * p.period <= p.max_age)) --c.rules.max_repeats;
  }
  return c;
}

/// Inputs of a gate in each period.
template <class S> struct SafetyInput {
  S command{};                 ///< effort wanted [N m]
  S position{};                ///< angle of the joint [rad]
  S velocity{};                ///< velocity of the joint [rad/s]
  std::int64_t time = 0;       ///< when position and velocity were measured, on any clock that only goes on [us]
  std::uint32_t sequence = 0;  ///< number of that sample; may wrap around
  bool valid = true;           ///< false: the sensor itself says that this is no measurement
};

/// State of a gate. Its fault can be read at any time.
template <class S> struct SafetyState {
  SafetyFault fault = SafetyFault::none;  ///< latched
  S output{};                             ///< the last one [N m]
  S position{};                           ///< the last one that was a number [rad]
  S way{};                                ///< its change in a period, smoothed [rad]
  SampleState sample{};                   ///< state of the position's samples
};

/// Opens a gate again. The output goes on from where it is, within the rate limit.
template <class S> void reset(SafetyState<S>& state) noexcept {
  state.fault = SafetyFault::none;
  state.sample = {};
}

/// Fault of this input relative to the last, its velocity excepted, if any. Stores the input.
template <class S>
SafetyFault examine(const SafetyCoefficients<S>& c, SafetyState<S>& state, const SafetyInput<S>& input) noexcept {
  if (!(input.valid && is_finite(input.command) && is_finite(input.position) && is_finite(input.velocity)))
    return SafetyFault::not_finite;
  return examine(c.rules, state.sample, input.time, input.sequence);
}

/// Takes note of a position. What is not a number changes nothing; the first one has no way yet.
template <class S> void follow(const SafetyCoefficients<S>& c, SafetyState<S>& state, const S& position, bool first) noexcept {
  if (!is_finite(position)) return;
  const S moved = first ? S(0) : position - state.position;
  state.way = state.way + c.smoothing * (moved - state.way);
  if (!is_finite(state.way)) state.way = S(0);
  state.position = position;
}

/// Whether a joint is too fast. A law's estimate overshoots where somebody throws the joint, so that the encoder itself
/// must say so, too.
template <class S> bool is_too_fast(const SafetyCoefficients<S>& c, const SafetyState<S>& state, const S& velocity) noexcept {
  return !(abs(velocity) <= c.params.velocity_limit) && !(abs(state.way) <= c.max_way);
}

/// Return the share of the effort limit available towards a stop at a distance: 1 far away, 0 at the stop and beyond.
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
  const bool first = !state.sample.started;
  if (state.fault == SafetyFault::none) state.fault = examine(c, state, input);
  follow(c, state, input.position, first);
  if (state.fault == SafetyFault::none && is_too_fast(c, state, input.velocity)) state.fault = SafetyFault::velocity;

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
