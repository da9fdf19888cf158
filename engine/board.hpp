// The other end of a device behind a network: a virtual rig that sends readings and does what it is asked.
//
// It stands for Simulink, a ros2_control node or a board: it has its own clock and its own deadlines, knows nothing of
// the engine but its address, and its drive takes the power off by itself when it is asked for nothing.
#pragma once

#include <string>

namespace engine {

/// Runs until `ends` says so; an empty text, or what was wrong. `address` is where the engine listens; whatever the board
/// is asked for is written to `log_path`, packet after packet, unless that is empty.
std::string run_board(const std::string& settings_path, const std::string& address, const std::string& log_path,
                      const volatile int& ends);

}  // namespace engine
