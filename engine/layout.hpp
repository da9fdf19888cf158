// The region of memory that the engine shares with its recorder and with the session: where each word lies.
//
//   header | status | command | recorder | events | records
//
// Every block has one writer. A record or event is complete when the count in the header has passed it; each carries its
// number twice, at both ends, so that a reader on any machine can tell a torn one. A command block carries a checksum
// over its words; one that does not match is left aside and the last one holds. All integers are little-endian; times
// are those of CLOCK_MONOTONIC [ns], except where a name ends in `_us`. src/pellucid/live/layout.py says the same to
// NumPy, and tests/unit/test_live_region.py compares both.
#pragma once

#include <pellucid/session_state.hpp>

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace engine {

constexpr char region_magic[8] = {'P', 'E', 'L', 'L', 'L', 'I', 'V', 'E'};
constexpr std::uint32_t region_version = 2;

constexpr std::size_t status_offset = 4096;
constexpr std::size_t command_offset = 8192;
constexpr std::size_t recorder_offset = 12288;
constexpr std::size_t event_offset = 16384;
constexpr std::uint32_t event_bytes = 4096;
constexpr std::uint32_t event_capacity = 256;
constexpr std::size_t record_offset = event_offset + std::size_t(event_bytes) * event_capacity;
constexpr std::uint32_t record_capacity = 65536;

/// Quantities of a record, in order: what a law may read, what the drive measures, and a second encoder.
constexpr std::size_t value_count = 6;

/// Task of the simulated wearer.
enum class TaskKind : std::uint32_t {
  hold,      ///< stay at the last target
  reach,     ///< move to a target
  track,     ///< follow a sine
  contract,  ///< pull with a share of the strength while holding
  relax,     ///< let go
};

/// A fault that is put into the inputs, for tests of the whole chain.
enum class Injection : std::uint32_t {
  none,
  not_a_number,  ///< all values are NaN
  frozen,        ///< all values stay as they are
  clock_ahead,   ///< the device's clock jumps ahead by half a second
  clock_back,    ///< the device's clock jumps back by half a second
  silent,        ///< nothing is heard
  starved,       ///< the engine does not run
};

namespace flag {
constexpr std::uint32_t late = 1;        ///< the cycle began later than the stated bound
constexpr std::uint32_t began = 2;       ///< the law began anew in this cycle
constexpr std::uint32_t stepped = 4;     ///< the law was stepped
constexpr std::uint32_t stop_asked = 8;  ///< the law was told to stop before it was stepped
constexpr std::uint32_t adjusted = 16;   ///< a number of the law was changed before it was stepped
constexpr std::uint32_t injected = 32;   ///< a fault was put into the inputs
constexpr std::uint32_t torn = 64;       ///< the command block could not be read; the last one held
}  // namespace flag

struct Header {
  char magic[8];
  std::uint32_t version;
  std::uint32_t value_count;
  std::uint32_t record_bytes, record_capacity;
  std::uint32_t event_bytes, event_capacity;
  std::int64_t epoch;   ///< deadline of cycle 0 [ns]
  std::int64_t period;  ///< [ns]
  std::atomic<std::uint64_t> records;  ///< records that are complete
  std::atomic<std::uint64_t> events;   ///< events that are complete
};
static_assert(sizeof(Header) == 64, "layout");

struct Record {
  std::uint64_t number;               ///< index from 1
  std::uint64_t cycle;                ///< deadlines since the epoch
  std::int64_t time, deadline;        ///< when the cycle began, and when it should have [ns]
  std::int64_t now_us;                ///< the time that the law was given [us since the epoch]
  double value[value_count];          ///< as given to the supervisor: position, torque, interaction, muscle, drive, joint
  std::int64_t stamp_us[value_count]; ///< when each was measured [us]
  std::uint32_t sequence[value_count];
  std::uint32_t valid;                ///< a bit for each
  std::uint32_t flags;
  std::uint32_t law;                  ///< index of the condition
  std::uint32_t token;                ///< as given to the supervisor
  double effort;                      ///< command to the drive [N m]
  std::uint8_t fault, mode, enable, state;
  std::uint32_t beat, challenge;
  std::uint32_t task;                 ///< number of the task
  double target;                      ///< present target of the task [rad]
  double limb_position, limb_velocity, muscle_torque, flexor, extensor;  ///< of a virtual wearer, or NaN
  double drive_torque;                ///< torque of a simulated drive, or NaN [N m]
  double velocity;                    ///< joint velocity estimated by the supervisor [rad/s]
  double adjusted_value;              ///< with flag::adjusted: the new number
  std::uint32_t adjusted_field;       ///< its place among the law's numbers
  std::uint32_t task_kind;
  std::uint32_t compute;              ///< how long the cycle took [ns]
  std::uint32_t reserved;
  double torque_estimate, torque_half_width;  ///< of the robot's torque on the person, from EMG, and its interval's half [N m]; NaN: none
  double spare[1];
  std::uint64_t number_again;
};
static_assert(sizeof(Record) == 320, "layout");

struct Event {
  std::uint64_t number;
  std::int64_t time;
  std::uint32_t length, reserved;
  char text[event_bytes - 32];  ///< JSON, UTF-8
  std::uint64_t number_again;
};
static_assert(sizeof(Event) == event_bytes, "layout");

constexpr std::size_t lateness_bins = 128;

using State = pellucid::SessionState;

struct Status {
  std::uint64_t process;
  std::int64_t heartbeat;
  std::uint64_t cycle, records, late, missed;
  std::int64_t worst_lateness, worst_compute;
  std::uint64_t command_sequence, torn_commands;
  std::uint32_t state, law, fault, mode, enable, challenge;  ///< state: of `pellucid::session_states`
  std::uint32_t fifo, locked;              ///< 1: permitted
  std::int32_t fifo_error, lock_error;     ///< errno where it was not
  std::uint32_t ended, reserved;           ///< 1: the engine has ended in order
  double effort_limit, rate_limit, velocity_limit, position_min, position_max;
  std::int64_t started;
  std::uint64_t device_silent;             ///< cycles in which the device said nothing new
  std::uint64_t lateness[lateness_bins];   ///< cycles by lateness
};

struct Command {
  std::uint64_t sequence;
  std::int64_t heartbeat;       ///< heartbeat of the session
  std::uint32_t law, run;       ///< condition, and whether its law shall run
  std::uint32_t stops, token;   ///< operator's stops so far; the challenge, sent back for a reset
  std::uint32_t end, adjusts;   ///< 1: the engine ends; numbers changed so far
  std::uint32_t adjusted_field, adjusted_law;
  double adjusted_value;
  std::uint32_t task, task_kind;
  double target, amplitude, duration, reaction;  ///< [rad], [rad], [s], [s]
  double frequency, share;                       ///< of a sine [Hz]; of a contraction [1]
  double load[5];                                ///< load that the wearer expects from the robot
  std::uint32_t injections, injection;           ///< faults put in so far, and the last one
  double injected_for;                           ///< [s]
  double torque_estimate, torque_half_width;     ///< as the session estimates them from EMG: only recorded [N m]
  double spare[8];
  std::uint64_t checksum;
};
static_assert(sizeof(Command) == 256, "layout");

/// State of the recorder.
struct RecorderStatus {
  std::uint64_t process;
  std::int64_t heartbeat;
  std::uint64_t records, events, sealed;
  std::uint32_t recording, error;
};

constexpr std::uint64_t checksum_start = 14695981039346656037u;

/// FNV-1a over the 64-bit words of a command block, the checksum itself left out.
inline std::uint64_t checksum(const std::uint64_t* words) noexcept {
  std::uint64_t sum = checksum_start;
  for (std::size_t i = 0; i + 1 < sizeof(Command) / 8; ++i) sum = (sum ^ words[i]) * 1099511628211u;
  return sum;
}

/// Bin of a lateness [ns]: four bins an octave from 1,024 ns on.
inline std::size_t lateness_bin(std::int64_t lateness) noexcept {
  if (lateness < 1024) return 0;
  const auto ns = static_cast<std::uint64_t>(lateness);
  std::size_t octave = 10;
  while (octave < 63 && (ns >> (octave + 1)) != 0) ++octave;
  const std::size_t bin = 1 + 4 * (octave - 10) + ((ns >> (octave - 2)) & 3u);
  return bin < lateness_bins ? bin : lateness_bins - 1;
}

}  // namespace engine
