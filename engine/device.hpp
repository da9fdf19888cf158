// A robot as the engine sees it: open, read all, write, close, and its clock. Virtual rigs and real ones are devices.
//
// To connect a device of your own, write one class and a line in `make_device` (device.cpp). Everything is SI. A value
// that was not measured has `valid` false; nothing is made up in its place. Times are those of the device's own clock,
// brought to the engine's by `HostClock` (host_clock.hpp) where it has one.
#pragma once

#include "laws.hpp"
#include "layout.hpp"
#include "settings.hpp"

#include <memory>

namespace engine {

/// Everything that a device measured, and what a virtual wearer does beside it.
struct Reading {
  pellucid::Samples<double> samples{};             ///< inputs of laws; times in microseconds since the epoch
  pellucid::Sample<double> drive{}, joint{};       ///< effort that the drive measures; second encoder
  double limb_position, limb_velocity, muscle_torque, flexor, extensor, drive_torque, target;  ///< NaN: unknown
  bool is_new = false;                             ///< whether anything arrived since the last cycle
};

/// Command to the drive.
struct Asked {
  double effort = 0;        ///< [N m]
  std::uint32_t beat = 0;   ///< counts the engine's cycles, for the drive's watchdog
  bool enable = false;      ///< false: the drive must take its power off
};

/// Task of a simulated wearer.
struct Task {
  std::uint32_t number = 0;
  TaskKind kind = TaskKind::hold;
  double target = 0, amplitude = 0, duration = 1, reaction = 0, frequency = 0, share = 0;
  double load[5] = {};
};

class Device {
 public:
  Device() = default;
  Device(const Device&) = delete;
  virtual ~Device() = default;
  /// Opens whatever it needs; an empty text, or what is wrong. May allocate; nothing else may.
  virtual std::string open() = 0;
  /// All that is known at the start of cycle `cycle`; `now_us` is the time since the epoch. Never waits.
  virtual void read(std::uint64_t cycle, std::int64_t now_us, Reading& reading) noexcept = 0;
  /// The drive is asked for this from now on. Never waits.
  virtual void write(const Asked& asked) noexcept = 0;
  /// Takes the power off and lets go of everything.
  virtual void close() noexcept = 0;
  /// A condition is chosen while no law runs: whether the robot is worn.
  virtual void wear(bool) noexcept {}
  /// Another task for a virtual wearer; `time` is that of its start [s since the epoch].
  virtual void give(const Task&, double) noexcept {}
};

/// The device of the settings; the text says what is wrong where there is none.
std::unique_ptr<Device> make_device(const Settings& settings, std::string& wrong);

}  // namespace engine
