// A person's forearm strapped to a robot under a supervised law: one period of the whole loop.
#pragma once

#include "laws.hpp"

#include <pellucid/drive_reading.hpp>
#include <pellucid/optimal_reaching.hpp>
#include <pellucid/postural_reaching.hpp>
#include <pellucid/reaching.hpp>
#include <pellucid/watchdog.hpp>
#include <pellucid/worn_geared_plant.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <type_traits>
#include <utility>

namespace bindings {

/// Nothing that is wrong: what a period of a healthy arm passes through.
struct Healthy {
  template <class Arm> void samples(Arm&, pellucid::Samples<double>&, pellucid::Feedback<double>&, std::int64_t&) {}
  bool hangs() const { return false; }
  double given(double asked) { return asked; }
  double measured(double given) const { return given; }
  double pushes(double) const { return 0; }
};

/// Somebody's effort in place of a law's: a joint's compensation without a body, whose constant offset it is each period.
struct LawCommand {
  std::function<double(double, double, double)> ask;  ///< of the time [s], encoder [rad] and sensor [N m]; NaN stops
  pellucid::JointCompensationParams<double> params{};  ///< the law's numbers but for the offset
  bool of_spring = false;                              ///< the sensor is the spring, not the force sensor

  template <class Law> void tell(Law& law, const pellucid::Samples<double>& read, std::int64_t now) {
    if constexpr (std::is_same_v<typename Law::Law, pellucid::JointCompensation<double>>) {
      const double none = std::nan("");
      const pellucid::Sample<double>& sensor = of_spring ? read.torque : read.interaction;
      const double effort = ask(1e-6 * static_cast<double>(now), read.position.valid ? read.position.value : none,
                                sensor.valid ? sensor.value : none);
      if (!std::isfinite(effort)) return pellucid::stop(law);
      params.body.offset = effort;
      pellucid::adjust(law, params);
    }
  }
};

/// One control period of a supervised law on a robot that somebody wears, at `now` [us]; `out` stays where there is no law.
/// The samples and the feedback pass through `fault` first; the drive measures an effort of `drive` [N m], a second
/// encoder an angle of `joint` [rad]. A `command` gives the law's effort. Compiled once for all models of a person (worn_laws.hpp).
template <class Fault>
void step_worn_law(AnySupervised<double>& law, const pellucid::Samples<double>& samples, double drive, double joint,
                   std::int64_t now, Fault& fault, pellucid::SupervisorOutput<double>& out, LawCommand* command = nullptr);

/// The drive's watchdog.
struct DriveWatch {
  static constexpr std::uint32_t patience = 10;    // periods that it waits
  static constexpr std::uint32_t off_periods = 3;  // until a drive that is to have no power has none
};

/// The arm of a person of a model, what is strapped to it, what drives that, and what is measured.
template <class Params> struct WornArm {
  using Model = Params;
  static constexpr std::size_t columns = 9;
  using Coefficients = decltype(pellucid::coefficients(std::declval<const Params&>()));
  using State = decltype(pellucid::holding(std::declval<const Coefficients&>(), 0.0, pellucid::ExpectedLoad<double>{}));

  Coefficients person;
  State reach;
  pellucid::WornGearedPlantCoefficients<double> plant;
  pellucid::WornGearedPlantState<double> state;
  AnySupervised<double> law;
  pellucid::SupervisorOutput<double> out{};
  LawCommand* command = nullptr;
  pellucid::Watchdog watchdog{};
  pellucid::DriveReadingCoefficients<double> reading{};
  pellucid::DriveReadingState<double> reading_state{};
  double limb_torque = 0, drive_torque = 0, drive_measured = 0, gain = 1, limit = 0, smoothing = 0, emg_gain[2] = {1, 1}, level[2] = {0, 0},
         sensor[64] = {};
  std::uint64_t ticks = 0;
  std::uint32_t sensor_delay = 0, off = 0;

  /// One period; what the drive gives is `drive_torque`. The row has what `WornElbow.move` returns. `reading_noise` is
  /// that of the drive's own measurement [N m].
  /// Everything inlined: a quarter of a study's time goes into calls between functions of a line or two.
  template <class Fault> [[gnu::flatten]] void period(const double* noise, const double* sensor_error, bool emg, double* row,
                                                      Fault& fault, double reading_noise = 0) {
    namespace p = pellucid;
    const p::StrapPull<double> strap = p::interaction(plant, state);
    const double torque_now = strap.robot;
    limb_torque = -strap.limb;
    sensor[ticks % 64] = torque_now;
    const double late = sensor[(ticks - std::min<std::uint64_t>(sensor_delay, ticks)) % 64];
    const double encoder = p::step(plant.robot.encoder, state.motor_position, noise[2]);
    p::Samples<double> samples;
    samples.position = {encoder, 0, 0, true};
    samples.torque = {drive_torque, 0, 0, true};
    samples.interaction = {sensor_error != nullptr ? late + *sensor_error : 0.0, 0, 0, sensor_error != nullptr};
    samples.muscle = {emg_gain[0] * level[0] - emg_gain[1] * level[1], 0, 0, emg};
    const std::int64_t now = std::llround(1e6 * person.params.period * static_cast<double>(ticks));
    if (!fault.hangs()) step_worn_law(law, samples, drive_measured, state.link_position, now, fault, out, command);
    const double current = p::clamp(out.effort / gain, -limit, limit);
    const bool power = p::step(watchdog, out.beat, out.enable, DriveWatch::patience);
    off = power ? 0 : off + 1;
    const double asked = gain * current;
    drive_torque = off >= DriveWatch::off_periods ? 0.0 : fault.given(asked);
    drive_measured = fault.measured(p::step(reading, reading_state, drive_torque, reading_noise));
    const p::ReachingOutput<double> muscles =
        p::step(person, reach, state.limb_position, state.limb_velocity, noise[0], noise[1]);
    listen(muscles, noise + 3);
    row[0] = state.limb_position;
    row[1] = state.limb_velocity;
    row[3] = encoder;
    row[4] = torque_now;
    row[5] = drive_torque;
    row[6] = muscles.flexor;
    row[7] = muscles.extensor;
    row[8] = state.link_velocity;
    p::step(plant, state, drive_torque == asked ? current : drive_torque / gain,
            muscles.torque + fault.pushes(muscles.torque));
    row[2] = state.limb_acceleration;
    ++ticks;
  }

  /// The torque that rectified, smoothed EMG shows of either muscle group, its resting level taken off [N m].
  void listen(const pellucid::ReachingOutput<double>& muscles, const double* noise) {
    const auto& who = person.params;
    const double excitation[2] = {muscles.flexor, muscles.extensor}, most[2] = {who.flexion_max, who.extension_max};
    for (int i = 0; i < 2; ++i) {
      const double rectified = std::fabs(excitation[i] * noise[i]) * 1.2533141373155001;
      level[i] += smoothing * ((rectified - who.cocontraction) * most[i] - level[i]);
    }
  }
};

/// Models of a person, a line each; `WornElbow` takes one by the name that its Params says.
using AnyWornArm = std::variant<
    WornArm<pellucid::ReachingParams<double>>,
    WornArm<pellucid::PosturalParams<double>>,
    WornArm<pellucid::OptimalReachingParams<double>>>;

}  // namespace bindings
