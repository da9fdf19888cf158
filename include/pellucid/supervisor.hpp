// Between sensors, law and drive: whether what they say can be true together, and what to do when it cannot.
//
// A law behind its front guards its interface; single faults can stay within every limit and still push a wearer. Here
// raw data are held to limits of their own, sensors to each other and to the robot's model, the drive to its command,
// the whole command to a budget of energy, memory to a checksum. In a healthy run the law's effort passes to the bit.
//
//   start_up -> running -> degraded       the law goes on without a sensor that it can do without
//        \         |         /
//         damped_stop  or  zero -> latched   until an operator's token, a healthy while and a delay
//
// A stop always wins: it outlives a start, takes back the token of a pending reset and restarts the delay. No single bit
// that memory loses forgets a fault or its log, or gives the power back.
//
// A damped stop needs encoder and drive; where either is in doubt the effort ramps to 0 and the power is taken off
// through `enable`, which a drive must obey, since one that is stuck heeds no command.
#pragma once

#include "body_residual.hpp"
#include "damped_stop.hpp"
#include "drive_delay_watch.hpp"
#include "drive_watch.hpp"
#include "encoder_watch.hpp"
#include "energy_budget.hpp"
#include "integrity.hpp"
#include "law.hpp"
#include "probe_watch.hpp"
#include "rate_watch.hpp"
#include "ringing_watch.hpp"
#include "sensor_watch.hpp"
#include "shaking_watch.hpp"
#include "start_up_test.hpp"
#include "still_watch.hpp"
#include "unexplained_energy_watch.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct SupervisorParams {
  EncoderWatchParams<S> encoder{};
  std::uint32_t joint_expected = 0;
  S joint_tolerance = S(std::numeric_limits<S>::infinity());
  BodyResidualParams<S> body{};
  SensorWatchParams<S> force{};   ///< watch of the interaction torque's sensor
  SensorWatchParams<S> muscle{};  ///< watch of EMG
  DriveWatchParams<S> drive{};
  EnergyBudgetParams<S> budget{};
  RingingWatchParams<S> ringing{};
  DampedStopParams<S> hold{};
  StartUpTestParams<S> test{};
  std::uint32_t degrades = 0;
  S moving = S(0.2), rest_speed = S(0.3), reset_delay = S(1);
  std::uint32_t healthy_samples = 500;
  ProbeWatchParams<S> probe{};  ///< small wave of effort that asks drive and encoder
  ShakingWatchParams<S> shaking{};
  UnexplainedEnergyParams<S> unexplained{};  ///< watch of what neither command nor force sensor explains
  DriveDelayWatchParams<S> delay{};  ///< watch of how late the drive answers
  RateWatchParams<S> rate{};         ///< watch of the task's rate
  StillWatchParams<S> still{};       ///< watch that asks a joint at rest

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pellucid::walk(p.encoder, visit);
    visit(p.joint_expected, {"joint_expected", unit::one, between(0, 1), "1: there is a second encoder, at the joint"});
    visit(p.joint_tolerance, {"joint_tolerance", unit::coordinate, above(0).or_infinite(),
                              "largest change of the difference between the two encoders since the start"});
    pellucid::walk(p.body, visit);
    auto of_force = prefixed(visit, "force_"), of_muscle = prefixed(visit, "muscle_");
    pellucid::walk(p.force, of_force);
    pellucid::walk(p.muscle, of_muscle);
    pellucid::walk(p.drive, visit);
    pellucid::walk(p.budget, visit);
    pellucid::walk(p.ringing, visit);
    pellucid::walk(p.hold, visit);
    pellucid::walk(p.test, visit);
    visit(p.degrades, {"degrades", unit::one, between(0, 1),
                       "1: without its force sensor the law still carries the robot"});
    visit(p.moving, {"moving_speed", unit::velocity, at_least(0), "faster, a force sensor's word must change"});
    visit(p.rest_speed, {"rest_speed", unit::velocity, above(0).or_infinite(),
                         "slower, a reset may be granted, or the test at start-up begin"});
    visit(p.reset_delay, {"reset_delay", unit::time, between(0, 60), "time from a fault to the earliest reset"});
    visit(p.healthy_samples, {"healthy_samples", unit::one, at_least(1),
                              "consecutive healthy samples before a reset is granted"});
    pellucid::walk(p.probe, visit);
    pellucid::walk(p.shaking, visit);
    pellucid::walk(p.unexplained, visit);
    pellucid::walk(p.delay, visit);
    pellucid::walk(p.rate, visit);
    pellucid::walk(p.still, visit);
  }
};

/// Mode of a supervised law.
enum class Mode : std::uint8_t {
  start_up,     ///< polarity and gain are tested with a small effort
  running,      ///< the law's effort passes
  degraded,     ///< it passes, without a sensor that is not believed
  damped_stop,  ///< the joint is held back, viscously
  zero,         ///< the effort ramps to 0, without power
  latched,      ///< it is 0
};
constexpr const char* mode_names[] = {"start_up", "running", "degraded", "damped_stop", "zero", "latched"};
constexpr bool is_stopped(Mode mode) noexcept { return mode >= Mode::damped_stop; }

/// Coefficients computed once from SupervisorParams and the law's gate.
template <class S> struct SupervisorCoefficients {
  SupervisorParams<S> params{};           ///< as they are
  EncoderWatchCoefficients<S> encoder{};  ///< watch of the raw encoder
  BodyResidualCoefficients<S> body{};     ///< the momentum observer's
  RingingWatchCoefficients<S> ringing{};  ///< watch of the command for ringing
  ShakingWatchCoefficients<S> shaking{};  ///< watch of the motion for shaking
  StartUpTestCoefficients<S> test{};      ///< test of polarity and gain at start-up
  ProbeWatchCoefficients<S> probe{};      ///< watch that probes
  UnexplainedEnergyCoefficients<S> unexplained{};  ///< watch of energy that nobody accounts for
  DriveDelayWatchCoefficients<S> delay{};  ///< watch of how late the drive answers
  RateWatchCoefficients<S> rate{};    ///< watch of the task's rate
  StillWatchCoefficients<S> still{};  ///< watch that asks a joint at rest
  S period{};                       ///< [s]
  S effort_limit{};                 ///< the gate's [N m]
  S max_change{};                   ///< largest change of the effort in a period [N m]
  std::uint32_t reset_periods = 0;  ///< periods of the delay before a reset
  std::uint32_t valid = 0;          ///< 1: the parameters make sense
};

template <class S>
SupervisorCoefficients<S> coefficients(const SupervisorParams<S>& p, const SafetyCoefficients<S>& gate) noexcept {
  SupervisorCoefficients<S> c;
  c.params = p;
  c.encoder = coefficients(p.encoder, gate.params.period);
  c.body = coefficients(p.body, S(2) * gate.params.period);
  c.body.lowest = gate.params.position_min;
  c.body.highest = gate.params.position_max;
  c.ringing = coefficients(p.ringing, S(4) * gate.params.period);
  c.shaking = coefficients(p.shaking, S(2) * gate.params.period);
  c.test = coefficients(p.test);
  c.probe = coefficients(p.probe, gate.params.period);
  c.unexplained = coefficients(p.unexplained, S(2) * gate.params.period);
  c.delay = coefficients(p.delay, gate.params.period);
  c.rate = coefficients(p.rate, gate.params.period);
  c.still = coefficients(p.still);
  c.period = gate.params.period;
  c.effort_limit = gate.params.effort_limit;
  c.max_change = gate.max_change;
  const bool valid = gate.valid && is_sound(p) && c.encoder.valid && c.body.valid && c.ringing.valid != 0 &&
                     c.test.valid != 0 && c.probe.valid != 0 && c.shaking.valid != 0 && c.unexplained.valid != 0 &&
                     c.delay.valid && c.rate.valid != 0 && c.still.valid != 0;
  c.valid = valid ? 1 : 0;
  c.reset_periods = valid && p.reset_delay < S(1e6) * c.period ? static_cast<std::uint32_t>(p.reset_delay / c.period)
                                                               : 1000000u;
  return c;
}

/// Feedback from drive, joint and operator, in addition to the sensors of the law.
template <class S> struct Feedback {
  Sample<S> drive{};        ///< the effort that the drive measures, at the joint [N m]
  Sample<S> joint{};        ///< a second encoder [rad]
  std::uint32_t token = 0;  ///< the challenge of a fault, sent back by an operator who asks for a reset
};

/// Command to the drive, and the state shown to an operator.
template <class S> struct SupervisorOutput {
  S effort{};                             ///< [N m]
  std::uint32_t beat = 0;                 ///< counts periods, for the drive's watchdog
  std::uint32_t challenge = 0;            ///< token that a reset needs; 0 without a fault
  SafetyFault fault = SafetyFault::none;  ///< the first, latched
  Mode mode = Mode::latched;              ///< present mode
  bool enable = false;                    ///< false: the drive must take its power off
};

/// One entry of the log.
struct LoggedFault {
  std::uint32_t step = 0;                 ///< period in which it was found
  SafetyFault fault = SafetyFault::none;  ///< what
  Mode mode = Mode::latched;              ///< mode after the fault
};
constexpr std::uint32_t log_length = 8;

/// The latest faults, and how many there ever were.
template <class Entry> struct FaultLog {
  std::uint32_t faults = 0;
  Entry entry[log_length]{};
};

constexpr SafetyFault code_of(const LoggedFault& entry) noexcept { return entry.fault; }

/// Progress of a reset.
struct ResetProgress {
  std::uint32_t stopped = 0;  ///< periods since the last fault or stop
  std::uint32_t healthy = 0;  ///< healthy ones in a row
  std::uint32_t held = 0;     ///< periods since what is done was entered
};

/// Stops that were asked for. `stop` alone counts them and `step` alone hears them, so that neither a reset nor a
/// start, nor a step that an interrupt breaks into, loses one.
struct StopRequests {
  std::uint32_t asked = 0, heard = 0;
};
/// Whether a stop was asked for that was not heard yet. Takes note of it.
inline bool hear_stop(StopRequests& r) noexcept {
  const std::uint32_t asked = r.asked;
  const bool is_new = asked != r.heard;
  r.heard = asked;
  return is_new;
}

constexpr std::uint32_t supervisor_alive = 0x5afe0001u;

template <class S> struct SupervisorState {
  TwinWord alive{};          ///< word that says that it was configured
  TwinWord doing{};          ///< mode, and the fault above it
  TwinWord challenge{};      ///< challenge of the last fault, which an operator answers
  S output{};                ///< the last effort [N m]
  EncoderWatchState<S> encoder{};         ///< watch of the raw angle
  BodyResidualState<S> body{};            ///< momentum observer
  SensorWatchState<S> force{}, muscle{};  ///< watches of the sensors that the law hears
  DriveWatchState<S> drive{};             ///< watch of the drive: command beside measurement
  EnergyBudgetState<S> budget{};          ///< budget for the energy of the whole command
  RingingWatchState<S> ringing{};         ///< watch of the law's effort for ringing
  S wave[2]{};                            ///< waves in the last command and in the one before [N m]
  ShakingWatchState<S> shaking{};         ///< watch of the motion for shaking
  DampedStopState<S> hold{};              ///< viscous hold
  StartUpTestState<S> test{};             ///< wave of effort at start-up
  ProbeWatchState<S> probe{};             ///< watch that probes
  UnexplainedEnergyState<S> unexplained{};  ///< energy that nobody accounts for
  DriveDelayWatchState<S> delay{};        ///< watch of how late the drive answers
  RateWatchState rate{};                  ///< watch of the task's rate
  StillWatchState<S> still{};             ///< watch that asks a joint at rest
  ClockState clock{};                     ///< turns of a clock of 32 bits
  std::uint32_t drive_seen = ~std::uint32_t(0), joint_seen = ~std::uint32_t(0);  ///< sequence numbers
  SafetyFault residual = SafetyFault::none;  ///< present fault from model and motion
  S other_velocity{};           ///< velocity of the period before [rad/s]
  S joint_offset{};             ///< offset of the second encoder [rad]
  bool joint_started = false;   ///< false until it was read
  std::uint32_t joint_silent = 0;         ///< periods without it
  S joint_position{};           ///< its last reading [rad]
  S drive_velocity{};           ///< velocity of a drive before its spring, smoothed [rad/s]
  ChecksumState law_sum{}, own_sum{};     ///< checksums of the law's numbers and of the supervisor's
  std::uint32_t memory_sum{};             ///< checksum of what the law remembered after its last period
  std::uint32_t steps = 0;      ///< since it was configured
  Thrice<ResetProgress> waited{};         ///< since the last fault or stop
  Thrice<FaultLog<LoggedFault>> log{};    ///< log of faults
};

template <class L> using scalar_of = decltype(L::Params::gate.period);

/// A law behind its front, under its supervisor. It may be moved in memory only before `seal`.
template <class L> struct Supervised {
  using Law = L;
  using S = scalar_of<L>;
  Controller<L> controller{};
  SupervisorCoefficients<S> supervisor{};
  SupervisorState<S> state{};
  StopRequests stops{};
};

template <class S> Mode mode_of(const SupervisorState<S>& s) noexcept { return static_cast<Mode>(s.doing.word & 0xffu); }
template <class S> SafetyFault fault_of(const SupervisorState<S>& s) noexcept {
  return static_cast<SafetyFault>((s.doing.word >> 8) & 0xffu);
}
template <class S> void go(SupervisorState<S>& s, Mode mode, SafetyFault fault) noexcept {
  put(s.doing, static_cast<std::uint32_t>(mode) | static_cast<std::uint32_t>(fault) << 8);
}

/// A fault of a log; 0 is the last. None where there were not so many.
template <class Entry> Entry logged(const Thrice<FaultLog<Entry>>& kept, std::uint32_t ago) noexcept {
  const FaultLog<Entry> log = voted(kept);
  return ago < log.faults && ago < log_length ? log.entry[(log.faults - 1 - ago) % log_length] : Entry{};
}
template <class S> LoggedFault logged(const SupervisorState<S>& s, std::uint32_t ago) noexcept {
  return logged(s.log, ago);
}

/// Return the number of faults recorded in all.
template <class State> std::uint32_t faults_of(const State& s) noexcept { return voted(s.log).faults; }

/// Writes a fault down.
template <class Entry> void write_down(Thrice<FaultLog<Entry>>& kept, const Entry& entry) noexcept {
  FaultLog<Entry> log = voted(kept);
  log.entry[log.faults % log_length] = entry;
  ++log.faults;
  put(kept, log);
}

/// A reset needs another token, and its delay begins anew; what is done was entered `held` periods ago.
template <class State> void restart_reset(State& s, std::uint32_t held) noexcept {
  const std::uint32_t before = s.challenge.word;
  const std::uint32_t next = checksum_of(checksum_of(before ^ s.steps, faults_of(s)), 0x9e3779b9u) | 1u;
  put(s.challenge, next != before ? next : next ^ 2u);
  put(s.waited, ResetProgress{0, 0, held});
}

/// Takes the checksum of what the law remembers: between its periods nobody may change it.
template <class L> void seal_memory(Supervised<L>& s) noexcept { s.state.memory_sum = quick_sum(s.controller.state); }

/// Takes the checksums where everything now lies.
template <class L> void seal(Supervised<L>& s) noexcept {
  seal_memory(s);
  s.state.law_sum = {checksum(s.controller.law), checksum_start, 0};
  s.state.own_sum = {checksum(s.supervisor), checksum_start, 0};
}

/// Return the first mode of a supervised law: the start-up test, if it has one.
template <class S> Mode first_mode(const SupervisorCoefficients<S>& c) noexcept {
  return c.params.test.effort > S(0) ? Mode::start_up : Mode::running;
}

/// State that persists over a start: the log, and the state of resets.
template <class S> void keep(SupervisorState<S>& s, const SupervisorState<S>& before) noexcept {
  s.challenge = before.challenge;
  s.steps = before.steps;
  s.log = before.log;
  s.clock = before.clock;
}

/// Other numbers of the law, from the next period on; what it remembers stays.
template <class L> void adjust(Supervised<L>& s, const typename L::Params& params) noexcept {
  s.controller.law = coefficients(params);
  s.state.law_sum = {checksum(s.controller.law), checksum_start, 0};
}

/// Return the mode that a fault requires: a damped stop if encoder and drive are not suspected and a load must be held.
template <class S> Mode response(const SupervisorCoefficients<S>& c, SafetyFault fault) noexcept {
  const bool sound = fault == SafetyFault::velocity || fault == SafetyFault::stopped ||
                     fault == SafetyFault::overspeed || fault == SafetyFault::force_sensor ||
                     fault == SafetyFault::muscle || fault == SafetyFault::lost || fault == SafetyFault::push ||
                     fault == SafetyFault::power || fault == SafetyFault::energy;
  return sound && c.params.hold.damping > S(0) ? Mode::damped_stop : Mode::zero;
}

/// Writes a fault down and does what it asks for; what is stopped already is only ever stopped harder.
template <class S>
void enter(const SupervisorCoefficients<S>& c, SupervisorState<S>& s, SafetyFault fault, Mode wanted) noexcept {
  const Mode now = mode_of(s);
  const Mode next = is_stopped(now) && now >= wanted ? now : wanted;
  if (next == now && is_stopped(now)) return;
  write_down(s.log, LoggedFault{s.steps, fault, next});
  go(s, next, is_stopped(now) || (now == Mode::degraded && next == now) ? fault_of(s) : fault);
  if (!is_stopped(next)) return;
  restart_reset(s, 0);
  s.hold = {};
  const S asked = s.drive.asked;
  s.drive = {};
  s.drive.asked = s.drive.asked_before = asked;
  (void)c;
}

/// Another fault of what is stopped already: the way to a reset begins anew. It is written down once, so that one that
/// lasts does not push the others out of the log.
template <class State, class Entry> void stay_shut(State& s, const Entry& entry) noexcept {
  const std::uint32_t held = voted(s.waited).held;
  const FaultLog<Entry> log = voted(s.log);
  bool told = false;
  for (const Entry& one : log.entry) told = told || (code_of(one) == code_of(entry) && s.steps - one.step <= held);
  if (!told) write_down(s.log, entry);
  restart_reset(s, held);
}
template <class S> void stay_shut(SupervisorState<S>& s, SafetyFault fault) noexcept {
  stay_shut(s, LoggedFault{s.steps, fault, mode_of(s)});
}

/// Memory lost a bit: what runs stops, and what is stopped already stays so.
template <class S> void lose_trust(const SupervisorCoefficients<S>& c, SupervisorState<S>& s) noexcept {
  const bool was_shut = mode_of(s) >= Mode::zero;
  if (was_shut) stay_shut(s, SafetyFault::integrity);
  else enter(c, s, SafetyFault::integrity, Mode::zero);
}
template <class L> void lose_trust(Supervised<L>& s) noexcept { lose_trust(s.supervisor, s.state); }

/// Starts with an effort of 0; a fault that is latched stays so, and a stop that was asked for is heard. False where
/// the parameters make no sense.
template <class L> bool configure(Supervised<L>& s, const typename L::Params& params,
                                  const SupervisorParams<scalar_of<L>>& supervisor) noexcept {
  using S = scalar_of<L>;
  const SupervisorState<S> before = s.state;
  const bool was = says(before.alive, supervisor_alive);
  const bool known = is_whole(before.doing) && mode_of(before) <= Mode::latched;
  const bool shut = known && is_stopped(mode_of(before)) && fault_of(before) != SafetyFault::configuration;
  configure(s.controller, params);
  s.supervisor = coefficients(supervisor, s.controller.law.gate);
  const SupervisorState<S> fresh;
  s.state = fresh;
  put(s.state.alive, supervisor_alive);
  if (was) keep(s.state, before);
  const bool valid = s.supervisor.valid != 0;
  if (was && shut) {
    go(s.state, Mode::latched, fault_of(before));
  } else if (was && !(known && is_whole(before.alive))) {
    go(s.state, Mode::running, SafetyFault::none);  // so that the fault is written down
    enter(s.supervisor, s.state, SafetyFault::integrity, Mode::latched);
  } else if (!valid) {
    go(s.state, Mode::latched, SafetyFault::configuration);
  } else {
    go(s.state, first_mode(s.supervisor), SafetyFault::none);
  }
  if (valid && hear_stop(s.stops)) {
    if (is_stopped(mode_of(s.state))) stay_shut(s.state, SafetyFault::stopped);
    else enter(s.supervisor, s.state, SafetyFault::stopped, Mode::latched);
  }
  seal(s);
  return valid;
}

/// Whether a sample is a measurement that was not seen before. Also takes note of it.
template <class S> bool is_new(std::uint32_t& seen, const Sample<S>& sample) noexcept {
  const bool fresh = is_heard(sample) && sample.sequence != seen;
  seen = sample.sequence;
  return fresh;
}

/// Fault of the joint's encoder relative to the motor's, if any.
template <class C, class State, class S>
SafetyFault compare(const C& c, State& s, const Sample<S>& position, const Sample<S>& joint) noexcept {
  if (c.params.joint_expected == 0) return SafetyFault::none;
  if (!is_new(s.joint_seen, joint)) return ++s.joint_silent > c.params.drive.cycles ? SafetyFault::disagreement : SafetyFault::none;
  s.joint_silent = 0;
  if (!is_heard(position)) return SafetyFault::none;
  const S apart = position.value - joint.value;
  if (!s.joint_started) {
    s.joint_offset = apart;
    s.joint_started = true;
  }
  return abs(apart - s.joint_offset) <= c.params.joint_tolerance ? SafetyFault::none : SafetyFault::disagreement;
}

/// Whether the drive turns by itself, before a spring: its inertia is left to whoever moves the joint, and the second
/// encoder is its own.
template <class S> bool is_before_spring(const SupervisorParams<S>& p) noexcept {
  return p.joint_expected != 0 && p.drive.inertia > S(0);
}

/// Estimate the velocity of a drive in front of its spring from the second encoder. Call it before `compare`.
template <class S>
void follow_drive(const SupervisorCoefficients<S>& c, SupervisorState<S>& s, const Sample<S>& joint) noexcept {
  if (!is_before_spring(c.params) || !is_heard(joint) || joint.sequence == s.joint_seen) return;
  const S passed = c.period * static_cast<S>(s.joint_silent + 1);
  const S velocity = s.joint_started ? (joint.value - s.joint_position) / passed : S(0);
  s.drive_velocity = s.drive_velocity + S(0.5) * (velocity - s.drive_velocity);
  s.joint_position = joint.value;
}

/// Velocity with which the drive turns, as the joint goes [rad/s].
template <class S> S velocity_of_drive(const SupervisorCoefficients<S>& c, const SupervisorState<S>& s) noexcept {
  return is_before_spring(c.params) ? s.drive_velocity : s.encoder.velocity;
}

constexpr SafetyFault first_of(SafetyFault a, SafetyFault b) noexcept { return a != SafetyFault::none ? a : b; }

/// Fault of encoder, motion, drive or command in this period, optional sensors excepted.
template <class S>
SafetyFault observe(const SupervisorCoefficients<S>& c, SupervisorState<S>& s, const Samples<S>& samples,
                    const Feedback<S>& back) noexcept {
  const SupervisorParams<S>& p = c.params;
  SafetyFault found = step(c.encoder, s.encoder, samples.position);
  follow_drive(c, s, back.joint);
  found = first_of(found, compare(c, s, samples.position, back.joint));
  if (p.drive.expected != 0) {
    const S given = given_of(p.drive, back.drive.value);
    const bool heard = is_new(s.drive_seen, back.drive) && can_give(p.drive, given);
    if (heard) found = first_of(found, step(c.delay, s.delay, s.drive.asked, given));
    found = first_of(found, step(p.drive, s.drive, given, velocity_of_drive(c, s), c.period, heard));
  }
  const Mode now = mode_of(s);
  const bool carries = now == Mode::running || now == Mode::degraded;
  if (carries) {
    const S asked = S(0.5) * (clamp(s.drive.asked, -p.drive.limit, p.drive.limit) +
                              clamp(s.drive.asked_before, -p.drive.limit, p.drive.limit));
    found = first_of(found, step(c.probe, s.probe, s.encoder.velocity, asked, p.drive.late));
    found = first_of(found, step(c.still, s.still, s.encoder.equal));
  }
  // Momentum and energy every second period, of both together; ringing every fourth: they are slow.
  const S other = s.other_velocity;
  s.other_velocity = s.encoder.velocity;
  if ((s.steps & 1u) == 0) return found;
  const S velocity = S(0.5) * (s.encoder.velocity + other);
  const S effort = S(0.5) * (s.drive.asked + s.drive.asked_before);
  // Before and after a law carries the robot the wearer does, or whatever holds it.
  if (c.body.checks && s.encoder.heard > 2) {
    const bool sensed = p.force.expected != 0 && is_heard(samples.interaction);
    step(c.body, s.body, s.encoder.position, velocity, effort, samples.interaction.value, sensed);
    // What the force sensor contradicts has its turn later.
    s.residual = shown(c.body, s.body);
    if (s.residual == SafetyFault::unexplained && carries) found = first_of(found, s.residual);
    if (sensed && now == Mode::running)
      found = first_of(found, step(c.unexplained, s.unexplained, c.body, s.body, velocity, effort, samples.interaction.value));
    else
      s.unexplained = {};
  }
  const S weight = carries ? s.body.weight : S(0), waves = S(0.5) * (s.wave[0] + s.wave[1]);
  // The wave that asks a joint at rest is not the law's push, however large a frozen encoder lets it become.
  const S given = carries && s.still.amplitude > S(0) ? effort - waves : effort;
  found = first_of(found, step(p.budget, s.budget, S(2) * c.period, given, velocity, weight, s.body.drag));
  if (carries) found = first_of(found, step(c.shaking, s.shaking, velocity));
  // The wave at start-up is no loop that rings, however slow a heavy machine makes it, nor is the one that asks a joint at rest.
  if ((s.steps & 2u) == 0 || now == Mode::start_up || s.still.amplitude > S(0)) return found;
  // The probe's waves are no loop either, and fall into its band where every fourth period samples them.
  return first_of(found, step(c.ringing, s.ringing, effort - waves));
}

/// The law's optional sensors, every second period: without one that is silent or beyond its range it goes on if it
/// can. A force sensor that contradicts model, command and motion may be right and the drive wrong: then nothing goes
/// on.
template <class S> void judge_sensors(const SupervisorCoefficients<S>& c, SupervisorState<S>& s,
                                      const Samples<S>& samples) noexcept {
  const bool moves = abs(s.encoder.velocity) > c.params.moving;
  const SafetyFault force = step(c.params.force, s.force, samples.interaction, moves, SafetyFault::force_sensor, 2);
  const SafetyFault muscle = step(c.params.muscle, s.muscle, samples.muscle, false, SafetyFault::muscle, 2);
  if (mode_of(s) != Mode::running) return;
  if (c.params.force.expected != 0 && s.residual == SafetyFault::force_sensor)
    return enter(c, s, SafetyFault::force_sensor, response(c, SafetyFault::force_sensor));
  const SafetyFault found = first_of(force, muscle);
  if (found == SafetyFault::none) return;
  enter(c, s, found, force == SafetyFault::none || c.params.degrades != 0 ? Mode::degraded : response(c, found));
}

/// Back to where it began, after a fault; the log stays. Not where memory is no longer what was sealed.
template <class L> void start_again(Supervised<L>& s) noexcept {
  using S = scalar_of<L>;
  const SupervisorState<S> before = s.state;
  if (!is_sealed(before.law_sum, s.controller.law) || !is_sealed(before.own_sum, s.supervisor)) return lose_trust(s);
  reset(s.controller);
  s.controller.state.gate.output = S(0);
  const SupervisorState<S> fresh;
  s.state = fresh;
  s.state.alive = before.alive;
  keep(s.state, before);
  go(s.state, first_mode(s.supervisor), SafetyFault::none);
  s.state.law_sum.sealed = before.law_sum.sealed;
  s.state.own_sum.sealed = before.own_sum.sealed;
  seal_memory(s);
}

/// The last effort [N m]. It is kept twice: where a memory lost a bit of one, the smaller counts, and 0 for no number.
template <class S> S least_of(const SupervisorState<S>& s) noexcept {
  const S least = abs(s.drive.asked) < abs(s.output) ? s.drive.asked : s.output;
  return is_finite(least) ? least : S(0);
}

/// A law's effort with the waves on it that ask drive and encoder, within the limits of effort, rate and stops [N m]:
/// the law's own, to the bit, where there is no wave and the drive was heard.
template <class S>
S with_probe(const SupervisorCoefficients<S>& c, SupervisorState<S>& s, const SafetyCoefficients<S>& gate, S effort,
             S position) noexcept {
  const S used = used_way(c.probe, s.probe), room = room_of(c.probe, used);
  const S own = bounded(c.probe, s.probe, effort), added = wave(c.probe, s.probe, used) + wave(c.still, s.still);
  if (added == S(0) && room == S(0) && own == effort) return effort;
  const S highest = max(c.effort_limit * stop_taper(gate, gate.params.position_max - position), effort);
  const S lowest = min(-c.effort_limit * stop_taper(gate, position - gate.params.position_min), effort);
  const S allowed = room > S(0) ? clamp(own, min(lowest + room, S(0)), max(highest - room, S(0))) : own;
  // The law's own limit of the rate would take the fast waves away from a strong, heavy robot.
  const S last = least_of(s), change = c.max_change + min(abs(added - s.wave[1]), c.probe.steepest);
  const S total = clamp(clamp(allowed + added, lowest, highest), last - change, last + change);
  if (!(abs(total) <= c.effort_limit)) return own;
  s.wave[0] = total - allowed;
  return total;
}

/// One more period of a stop: whether an operator's token ends it now.
template <class State>
bool may_reset(State& s, bool good, std::uint32_t token, std::uint32_t healthy, std::uint32_t delay) noexcept {
  ResetProgress waited = voted(s.waited);
  waited.healthy = !good ? 0 : waited.healthy < 0xffffffffu ? waited.healthy + 1 : waited.healthy;
  if (waited.stopped < 0xffffffffu) ++waited.stopped;
  if (waited.held < 0xffffffffu) ++waited.held;
  put(s.waited, waited);
  const bool asked = token != 0 && is_whole(s.challenge) && token == s.challenge.word;
  return asked && waited.healthy >= healthy && waited.stopped >= delay;
}

/// The effort while stopped [N m], and whether an operator's token may end it.
template <class L> void stay_stopped(Supervised<L>& s, SafetyFault found, bool heard, std::uint32_t token) noexcept {
  using S = scalar_of<L>;
  const SupervisorCoefficients<S>& c = s.supervisor;
  SupervisorState<S>& state = s.state;
  const S velocity = state.encoder.velocity;
  S wanted = S(0);
  if (mode_of(state) == Mode::damped_stop) wanted = step(c.params.hold, state.hold, c.period, velocity);
  const S limit = c.effort_limit;
  const S last = least_of(state);
  state.output = clamp(clamp(wanted, last - c.max_change, last + c.max_change), -limit, limit);
  if (!is_finite(state.output) || mode_of(state) == Mode::latched) state.output = S(0);
  if (mode_of(state) == Mode::zero && state.output == S(0)) go(state, Mode::latched, fault_of(state));

  const bool good = found == SafetyFault::none && heard && abs(velocity) <= c.params.rest_speed + speed_at_rest(c.encoder);
  if (may_reset(state, good, token, c.params.healthy_samples, c.reset_periods)) start_again(s);
}

/// Samples that are all read just now: a sensor that says nothing starts anew when it speaks again.
template <class L, class S> Samples<S> stamped(Supervised<L>& s, const Samples<S>& read, std::int64_t now) noexcept {
  Samples<S> made = stamped(s.controller, read, now);
  for (const SensorUse& use : L::sensors) made[use.quantity].sequence = s.state.steps;
  return made;
}

/// Stops the law from the next step on in any mode; before a start, from the start on.
template <class L> void stop(Supervised<L>& s) noexcept { ++s.stops.asked; }

/// Samples with their times on a clock that only goes on, after the step's own time.
template <class S> Samples<S> on_clock(const ClockState& clock, const Samples<S>& read) noexcept {
  Samples<S> made = read;
  made.position.time = sampled_at(clock, read.position.time);
  made.torque.time = sampled_at(clock, read.torque.time);
  made.interaction.time = sampled_at(clock, read.interaction.time);
  made.muscle.time = sampled_at(clock, read.muscle.time);
  return made;
}

/// One control period of a law under its supervisor, whatever comes in. `clock` [us] may have 32 bits and turn over.
template <class L, class S> SupervisorOutput<S> step(Supervised<L>& s, const Samples<S>& raw, const Feedback<S>& back,
                                                     std::int64_t clock) noexcept {
  const SupervisorCoefficients<S>& c = s.supervisor;
  SupervisorState<S>& state = s.state;
  const std::int64_t now = unwrapped(state.clock, clock);
  const Samples<S> read = on_clock(state.clock, raw);
  ++state.steps;
  if (!says(state.alive, supervisor_alive))
    return {S(0), state.steps, 0, SafetyFault::not_started, Mode::latched, false};
  if (!is_whole(state.alive) || !is_whole(state.doing) || mode_of(state) > Mode::latched) {
    put(state.alive, supervisor_alive);
    go(state, Mode::running, SafetyFault::none);  // so that the fault is written down
    enter(c, state, SafetyFault::integrity, Mode::zero);
  }
  if (c.valid == 0) {
    // What is not stopped was configured well.
    if (!is_stopped(mode_of(state))) enter(c, state, SafetyFault::integrity, Mode::latched);
    state.output = S(0);
    return {S(0), state.steps, 0, fault_of(state), Mode::latched, false};
  }
  // By turns, in the periods that do not look at momentum and energy.
  const bool kept = (state.steps & 1u) != 0 || ((state.steps & 2u) != 0 ? step(state.law_sum, s.controller.law)
                                                                       : step(state.own_sum, c));
  if (!kept) lose_trust(s);
  if (hear_stop(s.stops)) {
    if (is_stopped(mode_of(state))) stay_shut(state, SafetyFault::stopped);
    else latch(s.controller, SafetyFault::stopped);
  }

  const Mode before = mode_of(state);
  if (is_stopped(before)) s.controller.fault = SafetyFault::none;  // what was wrong is written down; what is wrong now?
  Samples<S> samples = believed(s.controller, read, now);
  SafetyFault found = observe(c, state, samples, back);
  found = first_of(found, step(c.rate, state.rate, now));
  const bool heard = is_heard(samples.position);
  if (!is_stopped(before)) {
    found = first_of(s.controller.fault, found);
    if (found != SafetyFault::none) enter(c, state, found, response(c, found));
    if (before != Mode::start_up && (state.steps & 1u) == 0) judge_sensors(c, state, samples);
  } else {
    const bool runs_away = voted(state.waited).held > 20 && found == SafetyFault::overspeed;
    const SafetyFault doubt = first_of(s.controller.fault, found);
    // What a hold needs is in doubt now, or it does not hold.
    if (before == Mode::damped_stop && (runs_away || (doubt != SafetyFault::none && response(c, doubt) == Mode::zero)))
      enter(c, state, doubt, Mode::zero);
    // The change of the position while nothing was heard is no velocity.
    if (!heard) state.encoder = {};
    if (s.controller.fault != SafetyFault::none)
      for (SampleState& seen : s.controller.seen) seen = {};
    found = doubt;
  }

  Mode mode = mode_of(state);
  state.wave[1] = state.wave[0];
  state.wave[0] = S(0);
  if (mode == Mode::start_up) {
    bool done = false;
    const S wave = step(c.test, state.test, c.period, state.encoder.velocity, c.params.rest_speed, done);
    const S wanted = clamp(wave, -c.effort_limit, c.effort_limit);
    const S last = least_of(state);
    state.output = clamp(wanted, last - c.max_change, last + c.max_change);
    state.test.pushed = state.output;
    if (done) {
      const SafetyFault said = shown(c.params.test, state.test);
      s.controller.state.gate.output = state.output;
      seal_memory(s);
      state.body = {};
      state.budget = {};
      state.ringing = {};
      if (said != SafetyFault::none) enter(c, state, said, Mode::zero);
      else go(state, Mode::running, SafetyFault::none);
    }
  } else if (!is_stopped(mode) && quick_sum(s.controller.state) != state.memory_sum) {
    enter(c, state, SafetyFault::integrity, Mode::zero);
  } else if (!is_stopped(mode)) {
    if (mode == Mode::degraded) {
      // Which of the two is not asked: neither is needed.
      samples.interaction.valid = samples.muscle.valid = false;
      samples.interaction.value = samples.muscle.value = std::numeric_limits<S>::quiet_NaN();
    }
    const S effort = step(s.controller.law, s.controller.state, samples);
    seal_memory(s);
    latch(s.controller, s.controller.state.gate.fault);
    ++s.controller.steps;
    if (s.controller.fault == SafetyFault::none)
      state.output = with_probe(c, state, s.controller.law.gate, effort, state.encoder.position);
    else enter(c, state, s.controller.fault, response(c, s.controller.fault));
  }
  mode = mode_of(state);
  if (is_stopped(mode)) stay_stopped(s, found, heard, back.token);
  ask(state.drive, state.output);
  mode = mode_of(state);
  const bool enable = mode <= Mode::damped_stop;
  return {state.output, state.steps, is_stopped(mode) ? state.challenge.word : 0, fault_of(state), mode, enable};
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
