// What each watch of a supervised law shows in a period, beside the threshold at which it trips: the catalogue from
// which a record of an incident says how far each watch was from its threshold.
//
// A watch is one line of `walk_watches`: value, threshold, and a Watch with its name, its unit, how the two are
// compared, the fault that it finds and what it shows. An infinite threshold says that it does not watch now.
// Everything is computed after the supervisor's step, from what that step left and from what the step before it left;
// nothing of the supervisor is written.
#pragma once

#include "supervisor.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Comparison of a monitor's value with its threshold.
enum class WatchBound : std::uint8_t {
  size,   ///< it trips where the value is larger in size
  above,  ///< it trips where the value is larger
  below,  ///< it trips where the value is smaller
};
constexpr const char* watch_bound_names[] = {"size", "above", "below"};

/// One watch.
struct Watch {
  const char* name;      ///< in the file of an incident
  Unit unit;             ///< unit of value and threshold, SI
  WatchBound bound;      ///< how they are compared
  SafetyFault fault;     ///< fault that it detects
  const char* sentence;  ///< description of its value
};

/// Values of the period before that the checks of a period need.
template <class S> struct WatchedState {
  DriveWatchState<S> drive{};    ///< the supervisor's, when the period began
  S velocity{};                  ///< raw velocity [rad/s]
  S pushed{};                    ///< effort beyond weight and friction, when it was last compared [N m]
  std::uint32_t time = 0;        ///< time of the last reading of the encoder, its low half [us]
  std::uint32_t heard = 0;       ///< readings of the encoder since the start, up to 3
  std::uint32_t drive_seen = 0;  ///< sequence number of the drive's measurement
  std::uint32_t mode = 0;        ///< the supervisor's
};

/// One period of a supervised law, after its step.
template <class S> struct WatchedPeriod {
  const SupervisorCoefficients<S>& c;    ///< the supervisor's numbers
  const SafetyCoefficients<S>& gate;     ///< those of the law's gate
  const SupervisorState<S>& s;           ///< state after the step
  const WatchedState<S>& before;         ///< values of the period before
  const Samples<S>& read;                ///< readings
  const Feedback<S>& back;               ///< measurements of drive and joint
  std::int64_t now = 0;                  ///< time of the step [us]
};

/// A difference of times, as far as 32 bits hold it [us].
constexpr std::int32_t age_of(std::int64_t now, std::int64_t time) noexcept {
  const std::uint64_t later = static_cast<std::uint64_t>(now) - static_cast<std::uint64_t>(time);
  const std::uint64_t earlier = static_cast<std::uint64_t>(0) - later;
  if (later <= 0x7fffffffu) return static_cast<std::int32_t>(later);
  return earlier <= 0x7fffffffu ? -static_cast<std::int32_t>(earlier) : later <= 0x7fffffffffffffffu ? 0x7fffffff : -0x7fffffff;
}

/// Values of this period that the next one needs. `note_before` is called after `walk_watches`.
template <class S> void note_before(const WatchedPeriod<S>& w, WatchedState<S>& next) noexcept {
  const Mode before = static_cast<Mode>(w.before.mode);
  if ((w.s.steps & 1u) != 0) {
    const S effort = S(0.5) * (w.before.drive.asked + w.before.drive.asked_before);
    const bool carries = before == Mode::running || before == Mode::degraded;
    const S pushed = effort - (carries ? w.s.body.weight : S(0));
    next.pushed = (pushed < S(0) ? -pushed : pushed) - w.s.body.drag;
  }
  next.drive = w.s.drive;
  next.velocity = w.s.encoder.velocity;
  next.time = w.s.encoder.time;
  next.heard = w.s.encoder.heard;
  next.drive_seen = w.s.drive_seen;
  next.mode = static_cast<std::uint32_t>(mode_of(w.s));
}

/// Result of one check in a period.
template <class S> struct ShownWatch {
  S value{};      ///< checked value
  S threshold{};  ///< where it trips; infinite: it does not watch now
  Watch watch;    ///< the watch
};

/// Returns visit(ShownWatch...) of all watches. `shown` is what `note_before` gave for this period.
template <class S, class V>
auto walk_watches(const WatchedPeriod<S>& w, const WatchedState<S>& shown, V&& visit) noexcept {
  using Show = ShownWatch<S>;
  using W = WatchBound;
  using F = SafetyFault;
  constexpr S never = S(std::numeric_limits<S>::infinity());
  const auto where = [](bool watches, S threshold) { return watches ? threshold : S(std::numeric_limits<S>::infinity()); };
  const auto size = [](S x) { return x < S(0) ? -x : x; };
  const auto count = [](std::uint32_t x) { return static_cast<S>(x); };
  const SupervisorParams<S>& p = w.c.params;
  const SupervisorState<S>& s = w.s;
  const Mode before = static_cast<Mode>(w.before.mode);
  const bool carries = before == Mode::running || before == Mode::degraded;
  const bool hears_sensors = carries;

  const std::uint32_t gap = s.encoder.time - w.before.time;
  const bool steady = gap == w.c.encoder.micros || gap == 0 || gap > 1000000u;
  const S passed = steady ? w.c.period : S(1e-6) * static_cast<S>(static_cast<std::int32_t>(gap));
  const S blur = S(2) * p.encoder.resolution / passed;
  const bool ranges = is_finite(p.encoder.range_min) && is_finite(p.encoder.range_max);
  const S middle = ranges ? S(0.5) * (p.encoder.range_min + p.encoder.range_max) : S(0);
  const bool was_fast = size(s.encoder.before) > p.encoder.freeze_speed;

  const bool has_joint = p.joint_expected != 0 && s.joint_started && is_heard(w.read.position) && is_heard(w.back.joint);
  const S apart = has_joint ? w.read.position.value - w.back.joint.value - s.joint_offset : S(0);

  const S given = given_of(p.drive, w.back.drive.value);
  const bool drive_speaks = is_heard(w.back.drive) && w.back.drive.sequence != w.before.drive_seen && can_give(p.drive, given);
  const bool drive_watches = p.drive.expected != 0;
  DriveWatchState<S> drive = w.before.drive;
  if (drive_watches && drive_speaks) account(p.drive, drive, given, velocity_of_drive(w.c, s), w.c.period);
  const S asked = clamp(w.before.drive.asked, -p.drive.limit, p.drive.limit);
  const S strays = drive_speaks ? given - asked : S(0);
  const S allowed = may_stray(p.drive, drive);
  const SeenLateness<S> lateness = seen_lateness(w.c.delay, s.delay);
  const bool is_outside = drive_watches && !(size(strays) <= allowed);

  const bool tested = before == Mode::start_up && mode_of(s) != Mode::start_up && s.test.count > p.test.samples;
  const S wave = hardly_moved(p.test, s.test) ? s.test.work - s.test.middle : s.test.middle;
  const bool force = p.force.expected != 0;

  const bool probes = p.probe.effort > S(0) && carries;
  S latest = S(0);
  for (std::uint32_t k = 3; k < probe_sum_count; ++k) latest = s.probe.sum[k] > latest ? s.probe.sum[k] : latest;

  return visit(
      Show{S(1e-6) * static_cast<S>(age_of(w.now, w.read.position.time)), w.gate.params.max_age,
           {"sample_age", unit::time, W::above, F::stale, "age of the position's sample"}},
      Show{s.encoder.velocity, p.encoder.speed_limit + blur,
           {"raw_speed", unit::velocity, W::size, F::overspeed, "raw difference of the encoder over its time"}},
      Show{(s.encoder.velocity - w.before.velocity) / passed,
           where(w.before.heard > 2 && s.encoder.heard > 2, p.encoder.acceleration_limit + S(2) * blur / passed),
           {"raw_acceleration", unit::acceleration, W::size, F::jump, "change of the encoder's raw speed"}},
      Show{s.encoder.position - middle, where(ranges, S(0.5) * (p.encoder.range_max - p.encoder.range_min)),
           {"range", unit::coordinate, W::size, F::range, "distance of the position from the middle of its range"}},
      Show{was_fast ? count(s.encoder.equal) : S(0), count(p.encoder.freeze_samples),
           {"encoder_freeze", unit::one, W::above, F::frozen, "equal readings in a row after a fast motion"}},
      Show{count(s.encoder.equal), where(carries && w.c.still.growth > S(0), S(3) * count(p.still.samples)),
           {"encoder_still", unit::one, W::above, F::frozen, "equal readings in a row, although a wave asked the joint"}},
      Show{S(1e-6) * static_cast<S>(age_of(later_by(s.clock.last, s.clock.turned), s.rate.began)) - count(s.rate.count) * w.c.period,
           where(p.rate.samples != 0, S(1e-6) * count(w.c.rate.most) - count(w.c.rate.samples) * w.c.period),
           {"rate", unit::time, W::size, F::rate, "mean excess of the steps' intervals over the period"}},
      Show{apart, where(has_joint, p.joint_tolerance),
           {"joint_difference", unit::coordinate, W::size, F::disagreement, "difference of the two encoders since the start"}},
      Show{count(s.joint_silent), where(p.joint_expected != 0, count(p.drive.cycles) + S(1)),
           {"joint_silence", unit::one, W::above, F::disagreement, "periods without the second encoder"}},
      Show{s.body.lasting, where(w.c.body.checks && carries, p.body.wearer_torque + s.body.open),
           {"residual_lasting", unit::effort, W::size, F::unexplained, "lasting effort that model and command do not explain"}},
      Show{s.body.push, where(w.c.body.checks && carries, p.body.wearer_push + s.body.level),
           {"residual_push", unit::effort, W::size, F::unexplained, "effort at once that model and command do not explain"}},
      Show{s.body.contradiction, where(w.c.body.checks && force, p.body.force_tolerance + s.body.open),
           {"force_contradiction", unit::effort, W::size, F::force_sensor, "lasting difference of force sensor and model"}},
      Show{s.body.burst, where(w.c.body.checks && force, p.body.force_burst + s.body.level),
           {"force_burst", unit::effort, W::size, F::force_sensor, "difference of force sensor and model at once"}},
      Show{s.body.excess, where(w.c.body.checks && force, p.body.force_excess),
           {"force_excess", unit::effort, W::above, F::force_sensor, "excess of the force sensor's reading"}},
      Show{is_heard(w.read.interaction) ? w.read.interaction.value : S(0), where(force && hears_sensors, p.force.range),
           {"force_range", unit::effort, W::size, F::force_sensor, "reading of the force sensor"}},
      Show{count(s.force.quiet), where(force && hears_sensors, count(p.force.quiet_samples)),
           {"force_silence", unit::one, W::above, F::lost, "periods without a word of the force sensor"}},
      Show{is_heard(w.read.muscle) ? w.read.muscle.value : S(0), where(p.muscle.expected != 0 && hears_sensors, p.muscle.range),
           {"muscle_range", unit::effort, W::size, F::muscle, "muscle torque from EMG"}},
      Show{count(s.muscle.quiet), where(p.muscle.expected != 0 && hears_sensors, count(p.muscle.quiet_samples)),
           {"muscle_silence", unit::one, W::above, F::lost, "periods without a word of EMG"}},
      Show{strays, where(drive_watches && drive_speaks, allowed),
           {"drive_difference", unit::effort, W::size, F::drive_effort, "measured minus commanded effort"}},
      Show{count(is_outside ? drive.outside + 1 : 0), where(drive_watches, count(p.drive.cycles)),
           {"drive_outside", unit::one, W::above, F::drive_effort, "periods in a row in which the drive gave something else"}},
      Show{least_surplus(drive), where(drive_watches, p.drive.surplus),
           {"drive_surplus", unit::energy, W::above, F::drive_effort, "energy that the drive gave beyond what it was asked for"}},
      Show{lateness.is_shown ? lateness.late / lateness.varied : S(0), where(drive_watches && lateness.is_shown, p.delay.limit),
           {"drive_delay", unit::time, W::above, F::drive_effort, "delay of the drive's response"}},
      Show{count(drive_speaks ? 0 : drive.silent + 1), where(drive_watches, count(p.drive.cycles)),
           {"drive_silence", unit::one, W::above, F::drive_silent, "periods without the drive's measurement"}},
      Show{shown.pushed, p.budget.push_limit,
           {"push", unit::effort, W::above, F::push, "command beyond weight and friction"}},
      Show{s.budget.power, p.budget.power_limit,
           {"power", Unit{1, 1, -1}, W::size, F::power, "power of the command, smoothed"}},
      Show{s.budget.spent, p.budget.store,
           {"budget_spent", unit::energy, W::above, F::energy, "energy taken from the budget"}},
      Show{s.ringing.size, w.c.ringing.limit,
           {"ringing", unit::effort, W::above, F::ringing, "mean size of the command between people's motions and dither"}},
      Show{s.shaking.smallest, where(carries, w.c.shaking.limit),
           {"shaking", unit::coordinate, W::above, F::shaking, "smallest of the last four ways to and fro"}},
      Show{wave, tested ? p.test.most : never,
           {"test_work", unit::energy, W::above, F::gain, "work of the wave at start-up"}},
      Show{wave, tested ? p.test.least : never,
           {"test_return", unit::energy, W::below, F::polarity, "work of the wave at start-up"}},
      Show{s.unexplained.energy, where(w.c.body.checks && force && before == Mode::running, p.unexplained.limit),
           {"unexplained_energy", unit::energy, W::above, F::unexplained_energy, "energy that nobody accounts for"}},
      Show{s.probe.sum[0], where(probes, p.probe.evidence),
           {"probe_reversed", unit::one, W::above, F::polarity, "evidence that drive or encoder is reversed"}},
      Show{s.probe.sum[1], where(probes, p.probe.evidence),
           {"probe_gain", unit::one, W::above, F::gain, "evidence that the drive gives twice its effort or more"}},
      Show{s.probe.sum[2], where(probes, p.probe.evidence),
           {"probe_unanswered", unit::one, W::above, F::unanswered, "evidence that nothing answers the probe"}},
      Show{latest, where(probes, p.probe.evidence),
           {"probe_late", unit::one, W::above, F::late_answer, "evidence that the answer to the probe is late"}},
      Show{way_of(s.probe), where(probes, allowed_way(w.c.probe, s.probe)),
           {"probe_travel", unit::coordinate, W::above, F::unanswered, "way since drive and encoder were heard"}});
}

namespace detail {
struct CountWatches {
  template <class... Shown>
  constexpr std::integral_constant<std::size_t, sizeof...(Shown)> operator()(const Shown&...) const noexcept {
    return {};
  }
};
}  // namespace detail

/// Number of monitors.
constexpr std::size_t watch_count = decltype(walk_watches(
    std::declval<const WatchedPeriod<float>&>(), std::declval<const WatchedState<float>&>(), detail::CountWatches{}))::value;

}  // namespace PELLUCID_ABI
}  // namespace pellucid
