// What a session's engine does about the power of a robot: six states, and one table of the changes between them.
//
//   disarmed -> armed -> running -> stopping -> disarmed     an operator arms and disarms, or chooses another law
//                  \-> stopped, faulted -> disarmed          operator or supervisor stop; the operator's token resets
//
// The engine holds the state. A session in Python and its pages read names, words and changes from here.
#pragma once

#include "math.hpp"

#include <cstddef>
#include <cstdint>

namespace pellucid {
inline namespace PELLUCID_ABI {

enum class SessionState : std::uint8_t {
  disarmed,  ///< no law; the effort is 0 and the drive has no power
  armed,     ///< an operator permits power: the law is tested at start-up, or there is none in this condition
  running,   ///< a law is in force under its supervisor
  stopping,  ///< the effort ramps to 0, after which another law may begin or none
  stopped,   ///< stopped from outside, by an operator or after the session's silence, until the operator's token resets it
  faulted,   ///< stopped by the supervisor for a fault, until the operator's token resets it
};

constexpr std::size_t session_state_count = 6;

/// Meaning of a state for its reader.
struct SessionStateMeaning {
  const char* name;
  const char* words;  ///< for a page
  bool in_force;      ///< a law may move the robot as it is meant to
  bool needs_reset;   ///< nothing runs before an operator's reset
};
constexpr SessionStateMeaning session_states[session_state_count] = {
    {"disarmed", "power off", false, false},
    {"armed", "armed", false, false},
    {"running", "running", true, false},
    {"stopping", "the effort ramps down", false, false},
    {"stopped", "stopped", false, true},
    {"faulted", "stopped by the supervisor", false, true},
};

/// The changes that one cycle may make, by the state before and after it. A law begins from armed alone, so that
/// nothing that stopped runs again without a reset, and nothing that was disarmed without having been armed.
constexpr bool session_transitions[session_state_count][session_state_count] = {
    //              disarmed armed running stopping stopped faulted
    /* disarmed */ {true, true, false, false, false, false},
    /* armed */ {true, true, true, true, true, true},
    /* running */ {false, false, true, true, true, true},
    /* stopping */ {true, true, false, true, false, false},
    /* stopped */ {true, false, false, false, true, true},
    /* faulted */ {true, false, false, false, true, true},
};

constexpr const SessionStateMeaning& meaning_of(SessionState state) noexcept {
  return session_states[static_cast<std::size_t>(state)];
}
constexpr bool may_follow(SessionState before, SessionState after) noexcept {
  return session_transitions[static_cast<std::size_t>(before)][static_cast<std::size_t>(after)];
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
