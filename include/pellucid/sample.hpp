// One sensor's reading as it reaches a controller, with what it takes to tell whether it may still be believed.
//
// Times are whole microseconds: seconds in float would stop telling milliseconds apart after a few hours.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct Sample {
  S value{};                   ///< in the sensor's SI unit
  std::int64_t time = 0;       ///< when it was measured, on any clock that only goes on [us]
  std::uint32_t sequence = 0;  ///< its number; may wrap around
  bool valid = false;          ///< false: the sensor itself says that this is no measurement
};

/// Whether it is a measurement.
template <class S> bool is_heard(const Sample<S>& sample) noexcept { return sample.valid && is_finite(sample.value); }

/// Why a gate is shut, or a supervisor has stopped.
enum class SafetyFault : std::uint8_t {
  none,           ///< it is open
  configuration,  ///< the parameters make no sense
  not_finite,     ///< a command, a position, a velocity or a time was NaN or infinite
  stale,          ///< a sample was too old, seen too often, or came after too long a gap
  out_of_order,   ///< a sequence number or a time went backwards, or a sample came from the future
  velocity,       ///< faster than velocity_limit
  stopped,        ///< somebody asked for it
  not_started,    ///< nothing was configured
  overspeed,      ///< raw differences of the encoder are faster than raw_speed_limit
  jump,           ///< the encoder went where no acceleration within raw_acceleration_limit leads
  range,          ///< the position is outside range_min to range_max
  frozen,         ///< the encoder's value stopped dead in the middle of a motion
  disagreement,   ///< motor and joint encoder have drifted apart
  force_sensor,   ///< the force sensor contradicts what model and motion say of the wearer
  muscle,         ///< EMG says more than the wearer's muscles can
  lost,           ///< a sensor that the law makes use of is silent
  drive_silent,   ///< the drive's own measurement is
  drive_effort,   ///< the drive gives another effort than it is asked for
  drive_sign,     ///< it gives it the other way
  drive_stuck,    ///< it gives the same whatever it is asked for
  unexplained,    ///< model and command do not explain the motion, nor can a wearer
  power,          ///< the command's power is beyond its limit
  energy,         ///< the command gives more energy than weight and friction take
  polarity,       ///< the start-up test moved the joint the wrong way, or not; or the probe did
  gain,           ///< the start-up test moved it too far, or the probe
  integrity,      ///< numbers in memory are not those that were configured
  push,           ///< beyond weight and friction the command is larger than the limit of effort
  ringing,        ///< the command goes to and fro, faster than a person moves
  unanswered,     ///< drive and encoder do not answer the probe
  late_answer,    ///< they answer it too late
  shaking,        ///< the joint goes to and fro for seconds, faster than a person reaches
  unexplained_energy,  ///< the joint gains energy that neither command nor force sensor explains
  rate,           ///< the control task does not run at its rate
};
constexpr const char* safety_fault_names[] = {
    "none",         "configuration", "not_finite",   "stale",        "out_of_order", "velocity",    "stopped",
    "not_started",  "overspeed",     "jump",         "range",        "frozen",       "disagreement", "force_sensor",
    "muscle",       "lost",          "drive_silent", "drive_effort", "drive_sign",   "drive_stuck", "unexplained",
    "power",        "energy",        "polarity",     "gain",         "integrity",   "push",
    "ringing",      "unanswered",    "late_answer",  "shaking",
    "unexplained_energy", "rate"};
constexpr std::size_t safety_fault_count = sizeof safety_fault_names / sizeof *safety_fault_names;

/// State of a clock of 32 bits, which turns over every 71.6 minutes.
struct ClockState {
  std::int64_t last = 0;    ///< its last time; from 0 no time of 32 bits is a turn [us]
  std::int64_t turned = 0;  ///< time of its turns so far [us]
};
constexpr std::int64_t clock_turn = std::int64_t(1) << 32;

/// Whether a clock of 32 bits, with a sign or without, can have said a time.
constexpr bool is_short(std::int64_t time) noexcept { return time >= -(clock_turn / 2) && time < clock_turn; }
/// Whether such a clock turned over between two times.
constexpr bool has_turned(std::int64_t before, std::int64_t after) noexcept {
  return is_short(before) && is_short(after) && before - after > clock_turn / 2;
}
constexpr std::int64_t later_by(std::int64_t time, std::int64_t passed) noexcept {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(time) + static_cast<std::uint64_t>(passed));
}
/// The time of a step on a clock that only goes on [us]: that of a clock of 64 bits as it is. Takes note of it.
inline std::int64_t unwrapped(ClockState& s, std::int64_t now) noexcept {
  if (has_turned(s.last, now)) s.turned = later_by(s.turned, clock_turn);
  s.last = now;
  return later_by(now, s.turned);
}
/// The time of a sample that was taken before that step, on the same clock [us].
inline std::int64_t sampled_at(const ClockState& s, std::int64_t time) noexcept {
  return later_by(time, has_turned(time, s.last) ? later_by(s.turned, -clock_turn) : s.turned);
}

/// Limits on the age of a sample.
struct SampleRules {
  std::int64_t max_age = 0;       ///< between measurement and use, and between two samples [us]
  std::uint32_t max_repeats = 0;  ///< how often one sample may be seen again
};

/// State of one sensor.
struct SampleState {
  std::int64_t time = 0;       ///< time of the last new sample [us]
  std::uint32_t sequence = 0;  ///< sequence number of the last new sample
  std::uint32_t repeats = 0;   ///< how often the last sample was seen again
  bool started = false;        ///< false until the first sample
};

/// Fault of a sample's time and number relative to the last sample, if any. Stores both.
inline SafetyFault examine(const SampleRules& rules, SampleState& state, std::int64_t time,
                           std::uint32_t sequence) noexcept {
  // Unsigned differences cannot overflow; more than half their range is a step back.
  const std::uint64_t gap = static_cast<std::uint64_t>(time) - static_cast<std::uint64_t>(state.time);
  const std::uint32_t ahead = sequence - state.sequence;
  if (state.started) {
    if (ahead > 0x7fffffffu || gap > 0x7fffffffffffffffu) return SafetyFault::out_of_order;
    if (ahead == 0 || gap == 0) {
      if (state.repeats < 0xffffffffu) ++state.repeats;
      state.sequence = sequence;
      return state.repeats > rules.max_repeats ? SafetyFault::stale : SafetyFault::none;
    }
    if (gap > static_cast<std::uint64_t>(rules.max_age)) return SafetyFault::stale;
  }
  state = {time, sequence, 0, true};
  return SafetyFault::none;
}

/// The same of a whole sample, seen at the time `now` [us] of its own clock.
template <class S>
SafetyFault examine(const SampleRules& rules, SampleState& state, const Sample<S>& sample, std::int64_t now) noexcept {
  if (!is_heard(sample)) return SafetyFault::not_finite;
  const std::uint64_t age = static_cast<std::uint64_t>(now) - static_cast<std::uint64_t>(sample.time);
  if (age > 0x7fffffffffffffffu) return SafetyFault::out_of_order;
  if (age > static_cast<std::uint64_t>(rules.max_age)) return SafetyFault::stale;
  return examine(rules, state, sample.time, sample.sequence);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
