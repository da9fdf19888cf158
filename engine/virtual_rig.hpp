// What virtual rigs have in common: a wearer, a drive with its watchdog, EMG levels, and a body that time does not wait for.
//
// Where cycles were missed, the body has moved on under the last command, and the drive's own watchdog has taken the
// power off after ten periods.
#pragma once

#include "wearer.hpp"

#include <pellucid/drive_reading.hpp>
#include <pellucid/watchdog.hpp>

#include <algorithm>
#include <initializer_list>
#include <utility>

namespace engine {

constexpr std::uint32_t watchdog_patience = 10;  // periods that a drive goes on without a beat
constexpr std::uint32_t power_off_periods = 3;   // until a drive that is to have no power has none

class VirtualRig : public Device {
 public:
  explicit VirtualRig(const Settings& settings) : settings_(settings), draws_(settings.seed) {}

  void read(std::uint64_t cycle, std::int64_t now_us, Reading& reading) noexcept final {
    const std::uint64_t first = ticks_ == 0 ? cycle : last_;
    const std::uint64_t due = cycle > first ? cycle - first : 0;
    const std::uint64_t moved = std::min(due, max_catch_up);
    const std::int64_t micros = settings_.period_ns / 1000;
    const double now = 1e-6 * static_cast<double>(now_us);
    for (std::uint64_t i = moved; i > 0; --i) advance(now - period_ * static_cast<double>(i - 1));
    last_ = cycle;
    ++ticks_;
    // What it did not catch up with is lost: the samples are then as old as they say, for one cycle.
    const std::int64_t time = static_cast<std::int64_t>(cycle) * micros - static_cast<std::int64_t>(due - moved) * micros;
    sense(time, static_cast<std::uint32_t>(ticks_), reading);
    reading.muscle_torque = muscles_.torque;
    reading.flexor = muscles_.flexor;
    reading.extensor = muscles_.extensor;
    reading.target = wearer_.target(now);
    reading.is_new = true;
  }

  void write(const Asked& asked) noexcept final { asked_ = asked; }
  void close() noexcept final { asked_ = {}; }
  void give(const Task& task, double start) noexcept final { wearer_.give(task, start); }

 protected:
  /// One period under the last command.
  virtual void advance(double now) noexcept = 0;
  /// Present state of robot and limb; `time` and `sequence` are those of every sample.
  virtual void sense(std::int64_t time, std::uint32_t sequence, Reading& reading) noexcept = 0;

  /// Which of these lists of numbers has another length than expected; an empty text where none has.
  std::string wrong_count(const char* rig, std::initializer_list<std::pair<const char*, std::size_t>> expected) const {
    for (const auto& [name, count] : expected) {
      const std::size_t found = settings_.of(name).size();
      if (found != count)
        return std::string(rig) + ": found " + std::to_string(found) + " numbers of \"" + name + "\", expected " + std::to_string(count);
    }
    return "";
  }
  /// The wearer at an angle, the reading of the drive and the smoothing of EMG; returns the wearer's numbers.
  pellucid::ReachingParams<double> configure_wearer(double start) {
    const auto person = pellucid::from_numbers<pellucid::ReachingParams<double>>(settings_.of("person").data());
    period_ = person.period;
    smoothing_ = 1 - std::exp(-period_ * emg_smoothing_rad_s);
    wearer_.configure(person, start);
    const auto numbers = pellucid::from_numbers<pellucid::DriveReadingParams<double>>(settings_.of("reading").data());
    reading_ = pellucid::coefficients(numbers, period_);
    return person;
  }
  /// Whether the drive has power in this period, by its own watchdog.
  bool step_power() noexcept {
    off_ = pellucid::step(watchdog_, asked_.beat, asked_.enable, watchdog_patience) ? 0 : off_ + 1;
    return off_ < power_off_periods;
  }
  /// The wearer's muscles in this period, and the EMG levels that a device would make of them.
  void step_muscles(double now, double position, double velocity) noexcept {
    muscles_ = wearer_.step(now, position, velocity, draws_);
    const auto& who = wearer_.person().params;
    const double excitation[2] = {muscles_.flexor, muscles_.extensor}, most[2] = {who.flexion_max, who.extension_max};
    for (int i = 0; i < 2; ++i) {
      const double rectified = std::fabs(excitation[i] * draws_.normal()) * rectified_mean;
      level_[i] += smoothing_ * ((rectified - who.cocontraction) * most[i] - level_[i]);
    }
  }
  /// The drive's measurement of its own torque.
  double read_drive(double torque, double noise) noexcept {
    return pellucid::step(reading_, reading_state_, torque, noise * draws_.normal());
  }

  Settings settings_;
  Draws draws_;
  Wearer wearer_;
  pellucid::ReachingOutput<double> muscles_{};
  Asked asked_{};
  double period_ = 1e-3, level_[2] = {0, 0};
  std::uint64_t ticks_ = 0;

 private:
  static constexpr std::uint64_t max_catch_up = 100;                // periods
  static constexpr double rectified_mean = 1.2533141373155001;      // sqrt(pi / 2): rectified noise has a mean of 1
  static constexpr double emg_smoothing_rad_s = 25.0;               // 4 Hz

  pellucid::DriveReadingCoefficients<double> reading_{};
  pellucid::DriveReadingState<double> reading_state_{};
  pellucid::Watchdog watchdog_{};
  double smoothing_ = 0;
  std::uint64_t last_ = 0;
  std::uint32_t off_ = power_off_periods;
};

}  // namespace engine
