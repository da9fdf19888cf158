// Between sensors, a law of several joints and its drives: the watches of one joint for each, and of the whole.
//
// What supervisor.hpp is to a law of one joint. A fault of one joint stops all of them together: joints whose encoder and
// drive are above suspicion are held back viscously, so that the arm sinks instead of falling; the joint in doubt loses
// its effort and its power, and so does every motor that turns with it. What is in doubt of the whole, memory above all,
// takes the power from all.
//
// A force sensor that lies, or EMG, is left out where the law can do without it and encoders and drives are above
// suspicion by instruments of their own; else what contradicts the motion stops it. Before the law runs, a small wave of
// effort at one joint after the other may test polarity and gain.
#pragma once

#include "drive_delay_watch.hpp"
#include "supervisor.hpp"
#include "tree_compensation.hpp"
#include "tree_force_watch.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Checks of one joint, and its damped stop.
template <class S> struct JointWatchParams {
  EncoderWatchParams<S> encoder{};
  DriveWatchParams<S> drive{};  ///< watch of the joint's motor
  EnergyBudgetParams<S> budget{};
  RingingWatchParams<S> ringing{};
  DampedStopParams<S> hold{};
  S outside_limit = S(std::numeric_limits<S>::infinity()), rest_speed = S(0.3);
  std::uint32_t joint_expected = 0;
  S joint_tolerance = S(std::numeric_limits<S>::infinity());
  TreeForceWatchParams<S> motion{};  ///< watch of the residual, and of force sensors beside it
  SensorWatchParams<S> force{};      ///< watch of a force sensor at the joint
  SensorWatchParams<S> muscle{};     ///< watch of EMG
  StartUpTestParams<S> test{};
  DriveDelayWatchParams<S> delay{};  ///< watch of how late the joint's motor answers

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pellucid::walk(p.encoder, visit);
    pellucid::walk(p.drive, visit);
    pellucid::walk(p.budget, visit);
    pellucid::walk(p.ringing, visit);
    pellucid::walk(p.hold, visit);
    visit(p.outside_limit, {"outside_limit", unit::effort, above(0).or_infinite(),
                            "the most that a wearer gives there beyond friction; infinite: not checked"});
    visit(p.rest_speed, {"rest_speed", unit::velocity, above(0).or_infinite(),
                         "slower, a reset may be granted, or the test at start-up begin"});
    visit(p.joint_expected, {"joint_expected", unit::one, between(0, 1), "1: there is a second encoder, at the joint"});
    visit(p.joint_tolerance, {"joint_tolerance", unit::coordinate, above(0).or_infinite(),
                              "largest change of the difference between the two encoders since the start"});
    pellucid::walk(p.motion, visit);
    auto of_force = prefixed(visit, "force_"), of_muscle = prefixed(visit, "muscle_");
    pellucid::walk(p.force, of_force);
    pellucid::walk(p.muscle, of_muscle);
    pellucid::walk(p.test, visit);
    pellucid::walk(p.delay, visit);
  }
};

/// Checks of the whole robot.
template <class S> struct WholeWatchParams {
  S power = S(std::numeric_limits<S>::infinity()), speed = power, reset_delay = S(1);
  std::uint32_t healthy_samples = 500, degrades = 0, trusts_motion = 0, wrench_expected = 0, wrench_quiet = 50;
  S force_excess = power, moving = S(0.2), wrench_force = power, wrench_moment = power;

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.power, {"raw_power_limit", Unit{0, 0, 0, "W"}, above(0).or_infinite(),
                    "of the sum of efforts times raw velocities; infinite: none"});
    visit(p.speed, {"raw_end_speed_limit", Unit{0, 0, 0, "m/s"}, above(0).or_infinite(),
                    "of the law's end point, by raw velocities; infinite: none"});
    visit(p.reset_delay, {"reset_delay", unit::time, between(0, 60), "time from a fault to the earliest reset"});
    visit(p.healthy_samples, {"healthy_samples", unit::one, at_least(1),
                              "consecutive healthy samples before a reset is granted"});
    visit(p.degrades, {"degrades", unit::one, between(0, 1),
                       "1: without force sensors and EMG the law still carries the robot"});
    visit(p.trusts_motion, {"trusts_motion", unit::one, between(0, 1),
                            "1: encoders and drives are checked by instruments of their own, so that a contradiction "
                            "is the force sensor's"});
    visit(p.force_excess, {"force_excess", unit::one, any_number().or_infinite(),
                           "limit of the summed excess of force sensors over joints; infinite: not checked"});
    visit(p.moving, {"moving_speed", unit::velocity, at_least(0), "faster, a force sensor's word must change"});
    visit(p.wrench_expected, {"wrench_expected", unit::one, between(0, 1),
                              "1: the law makes use of the sensor on a link, and it must speak"});
    visit(p.wrench_quiet, {"wrench_quiet_samples", unit::one, at_least(1),
                           "periods in a row without a word of it, or without a change while a joint moves, that are a "
                           "fault"});
    visit(p.wrench_force, {"wrench_force_range", unit::force, above(0).or_infinite(), "range of each measured force"});
    visit(p.wrench_moment, {"wrench_moment_range", Unit{0, 0, 0, "N*m"}, above(0).or_infinite(),
                            "of each moment that it can say"});
  }
};

template <class S, std::size_t N> struct TreeSupervisorParams {
  JointWatchParams<S> joint[N]{};  ///< watches of each joint
  WholeWatchParams<S> whole{};     ///< watches of the whole robot
};

/// Coefficients computed once from JointWatchParams, the joint's gate and its friction.
template <class S> struct JointWatchCoefficients {
  JointWatchParams<S> params{};           ///< as they are
  EncoderWatchCoefficients<S> encoder{};  ///< watch of the raw angle
  RingingWatchCoefficients<S> ringing{};  ///< watch of the command for ringing
  TreeForceWatchCoefficients<S> motion{};  ///< watch of the residual, and of force sensors beside it
  StartUpTestCoefficients<S> test{};      ///< test of polarity and gain at start-up
  DriveDelayWatchCoefficients<S> delay{};  ///< watch of how late the joint's motor answers
  S level{};                              ///< friction at rest without a load [N m; N]
  S load{};                               ///< more of it, per load [1]
};

template <class S, std::size_t N> struct TreeSupervisorCoefficients {
  JointWatchCoefficients<S> joint[N]{};  ///< watches of each joint
  WholeWatchParams<S> whole{};           ///< as they are
  S period{};                            ///< [s]
  std::uint32_t reset_periods = 0;       ///< periods of the delay before a reset
  std::uint32_t valid = 0;               ///< 1: the parameters make sense
};

template <class S, std::size_t N>
TreeSupervisorCoefficients<S, N> coefficients(const TreeSupervisorParams<S, N>& p,
                                              const TreeCompensationCoefficients<S, N>& law) noexcept {
  TreeSupervisorCoefficients<S, N> c;
  c.whole = p.whole;
  c.period = law.gate.joint[0].params.period;
  bool valid = law.gate.valid && is_sound(p.whole);
  for (std::size_t k = 0; k < joints_of(law.gate, N); ++k) {
    JointWatchCoefficients<S>& one = c.joint[k];
    const FrictionCoefficients<S>& f = law.drives.joint[k].friction;
    one.params = p.joint[k];
    one.encoder = coefficients(p.joint[k].encoder, c.period);
    one.ringing = coefficients(p.joint[k].ringing, S(4) * c.period);
    one.motion = coefficients(p.joint[k].motion, law.whole.observer_bandwidth, S(2) * c.period);
    one.test = coefficients(p.joint[k].test);
    one.delay = coefficients(p.joint[k].delay, S(2) * c.period);
    one.level = max(f.coulomb_positive, f.coulomb_negative) + f.stribeck;
    one.load = max(f.load_motoring, f.load_generating);
    valid = valid && is_sound(p.joint[k]) && one.encoder.valid && one.ringing.valid != 0 &&
            one.motion.valid && one.test.valid != 0 && one.delay.valid;
  }
  c.valid = valid ? 1 : 0;
  c.reset_periods = valid && p.whole.reset_delay < S(1e6) * c.period
                        ? static_cast<std::uint32_t>(p.whole.reset_delay / c.period)
                        : 1000000u;
  return c;
}

/// Feedback from drives and operator, in addition to the sensors of the law.
template <class S, std::size_t N> struct TreeFeedback {
  Sample<S> drive[N]{};     ///< the effort that each motor's drive measures [N m; N]
  Sample<S> joint[N]{};     ///< a second encoder of each joint [rad; m]
  std::uint32_t token = 0;  ///< the challenge of a fault, sent back by an operator who asks for a reset
};

/// Commands to the drives, and the state shown to an operator.
template <class S, std::size_t N> struct TreeSupervisorOutput {
  TreeCommand<S, N> command{};
  bool enable[N]{};                ///< power of each motor; false: its drive must take its power off
  std::uint32_t beat = 0;          ///< counts periods, for the drives' watchdogs
  std::uint32_t challenge = 0;     ///< token that a reset needs; 0 without a fault
  TreeFault fault{};               ///< the first, latched
  Mode mode = Mode::latched;       ///< present mode
};

/// One entry of the log.
struct LoggedTreeFault {
  std::uint32_t step = 0;     ///< period in which it was found
  TreeFault fault{};          ///< what, and where
  Mode mode = Mode::latched;  ///< mode after the fault
};
constexpr SafetyFault code_of(const LoggedTreeFault& entry) noexcept { return entry.fault.fault; }

template <class S> struct JointWatchState {
  EncoderWatchState<S> encoder{};  ///< watch of the raw angle
  DriveWatchState<S> drive{};      ///< watch of the drive: command beside measurement
  EnergyBudgetState<S> budget{};   ///< budget for the energy of the command
  RingingWatchState<S> ringing{};  ///< watch of the command for ringing
  DampedStopState<S> hold{};       ///< viscous hold
  TreeForceWatchState<S> motion{};  ///< watch of the residual, and of force sensors beside it
  SensorWatchState<S> force{}, muscle{};  ///< watches of the sensors that the law hears
  StartUpTestState<S> test{};      ///< wave of effort at start-up
  DriveDelayWatchState<S> delay{};  ///< watch of how late the joint's motor answers
  std::uint32_t drive_seen = ~std::uint32_t(0), joint_seen = ~std::uint32_t(0);  ///< sequence numbers
  S joint_offset{};                ///< offset of the second encoder [rad]
  bool joint_started = false;      ///< false until it was read
  std::uint32_t joint_silent = 0;  ///< periods without it
  TwinWord doubted{};              ///< 1: what a hold needs of it is in doubt
  TwinWord released{};             ///< 1: the joint's motor turns a joint in doubt, and has no power until a reset
};
/// Whether a hold may not use a joint; of a word that lost a bit, the safe answer.
template <class S> bool is_doubted(const JointWatchState<S>& s) noexcept {
  return s.doubted.word != 0 || !is_whole(s.doubted);
}
template <class S> bool is_released(const JointWatchState<S>& s) noexcept {
  return s.released.word != 0 || !is_whole(s.released);
}

template <class S, std::size_t N> struct TreeSupervisorState {
  TwinWord alive{};                  ///< word that says that it was configured
  TwinWord doing{};                  ///< mode, the fault and its joint above it
  TwinWord challenge{};              ///< challenge of the last fault, which an operator answers
  S output[N]{};                     ///< the last efforts [N m; N]
  JointWatchState<S> joint[N]{};     ///< watches of each joint
  WrenchSample<S> wrench{};          ///< last word of the sensor on a link
  std::uint32_t wrench_quiet = 0;    ///< periods in a row without another
  std::uint32_t tested = 0;          ///< joint whose turn it is in the test at start-up
  ChecksumState law_sum{}, own_sum{};  ///< checksums of the law's numbers and of the supervisor's
  std::uint32_t memory_sum = 0;        ///< sum of what the law remembers, as its last period left it
  std::uint32_t steps = 0;           ///< since it was configured
  Thrice<ResetProgress> waited{};    ///< since the last fault or stop
  Thrice<FaultLog<LoggedTreeFault>> log{};  ///< log of faults
};

/// A law of several joints behind its front, under its supervisor. It may be moved in memory only before `seal`.
template <class L> struct TreeSupervised {
  using Law = L;
  using S = typename L::Scalar;
  TreeController<L> controller{};
  TreeSupervisorCoefficients<S, L::most> supervisor{};
  TreeSupervisorState<S, L::most> state{};
  StopRequests stops{};
};

template <class S, std::size_t N> Mode mode_of(const TreeSupervisorState<S, N>& s) noexcept {
  return static_cast<Mode>(s.doing.word & 0xffu);
}
template <class S, std::size_t N> TreeFault fault_of(const TreeSupervisorState<S, N>& s) noexcept {
  return {static_cast<SafetyFault>((s.doing.word >> 8) & 0xffu), (s.doing.word >> 16) & 0xffu};
}
template <class S, std::size_t N> void go(TreeSupervisorState<S, N>& s, Mode mode, TreeFault fault) noexcept {
  put(s.doing, static_cast<std::uint32_t>(mode) | static_cast<std::uint32_t>(fault.fault) << 8 |
                   (fault.joint & 0xffu) << 16);
}

/// A fault of the log; 0 is the last. None where there were not so many.
template <class S, std::size_t N>
LoggedTreeFault logged(const TreeSupervisorState<S, N>& s, std::uint32_t ago) noexcept {
  return logged(s.log, ago);
}

/// Takes the checksum of what the law remembers: between its periods nobody may change it.
template <class L> void seal_memory(TreeSupervised<L>& s) noexcept {
  s.state.memory_sum = quick_sum(s.controller.state);
}

/// Changes what the law remembers from outside, between its periods. What was lost before is still found.
template <class L, class F> void change_memory(TreeSupervised<L>& s, F change) noexcept {
  const bool kept = quick_sum(s.controller.state) == s.state.memory_sum;
  change(s.controller.state);
  if (kept) seal_memory(s);
}

/// Takes the checksums where everything now lies.
template <class L> void seal(TreeSupervised<L>& s) noexcept {
  seal_memory(s);
  s.state.law_sum = {checksum(s.controller.law), checksum_start, 0};
  s.state.own_sum = {checksum(s.supervisor), checksum_start, 0};
}

/// The first joint from `from` on that has a test at start-up, or the number of joints.
template <class S, std::size_t N>
std::uint32_t next_tested(const TreeSupervisorCoefficients<S, N>& c, std::size_t joints, std::size_t from) noexcept {
  while (from < joints && !(c.joint[from].params.test.effort > S(0))) ++from;
  return static_cast<std::uint32_t>(from);
}

/// Set the first mode of a supervised law: the start-up test, if any joint has one.
template <class L> void begin(TreeSupervised<L>& s) noexcept {
  const std::size_t n = joints_of(s.controller.law.gate, L::most);
  s.state.tested = next_tested(s.supervisor, n, 0);
  go(s.state, s.state.tested < n ? Mode::start_up : Mode::running, {});
}

/// Whether a fault leaves encoder and drive of its joint above suspicion, so that the joint can be held.
constexpr bool can_hold(SafetyFault fault) noexcept {
  return fault == SafetyFault::velocity || fault == SafetyFault::stopped || fault == SafetyFault::overspeed ||
         fault == SafetyFault::push || fault == SafetyFault::power || fault == SafetyFault::energy ||
         fault == SafetyFault::force_sensor || fault == SafetyFault::muscle || fault == SafetyFault::lost;
}

/// Return the mode that a fault requires: joints that can be held are held, unless the fault concerns the whole robot.
template <class S, std::size_t N>
Mode response(const TreeSupervisorCoefficients<S, N>& c, TreeFault fault, std::size_t joints) noexcept {
  const bool whole = fault.joint >= joints && !can_hold(fault.fault);
  bool holds = false;
  for (std::size_t k = 0; k < joints; ++k)
    holds = holds || (c.joint[k].params.hold.damping > S(0) && (k != fault.joint || can_hold(fault.fault)));
  return holds && !whole ? Mode::damped_stop : Mode::zero;
}

/// Writes a fault down and does what it asks for; what is stopped already is only ever stopped harder.
template <class S, std::size_t N>
void enter(TreeSupervisorState<S, N>& s, TreeFault fault, Mode wanted) noexcept {
  const Mode now = mode_of(s);
  const bool again = is_stopped(now);
  const Mode next = again && now >= wanted ? now : wanted;
  if (again && next == now) return;
  write_down(s.log, LoggedTreeFault{s.steps, fault, next});
  go(s, next, again ? fault_of(s) : fault);
  if (!is_stopped(next)) return;
  restart_reset(s, 0);
  for (JointWatchState<S>& one : s.joint) {
    one.hold = {};
    const S asked = one.drive.asked;
    one.drive = {};
    one.delay = {};
    one.drive.asked = one.drive.asked_before = asked;
  }
}

template <class S, std::size_t N> void stay_shut(TreeSupervisorState<S, N>& s, TreeFault fault) noexcept {
  stay_shut(s, LoggedTreeFault{s.steps, fault, mode_of(s)});
}

/// Memory lost a bit: what runs stops, and what is stopped already stays so.
template <class L> void lose_trust(TreeSupervised<L>& s) noexcept {
  const TreeFault fault{SafetyFault::integrity, static_cast<std::uint32_t>(joints_of(s.controller.law.gate, L::most))};
  const bool was_shut = mode_of(s.state) >= Mode::zero;
  if (was_shut) stay_shut(s.state, fault);
  else enter(s.state, fault, Mode::zero);
}

/// Starts with efforts of 0; a fault that is latched stays so, and a stop that was asked for is heard. False where the
/// parameters make no sense.
template <class L> bool configure(TreeSupervised<L>& s, const typename L::Params& params,
                                  const TreeSupervisorParams<typename L::Scalar, L::most>& supervisor) noexcept {
  const bool was = says(s.state.alive, supervisor_alive), whole = is_whole(s.state.alive);
  const bool known = is_whole(s.state.doing) && mode_of(s.state) <= Mode::latched;
  const TreeFault before = fault_of(s.state);
  const bool shut = known && is_stopped(mode_of(s.state)) && before.fault != SafetyFault::configuration;
  const TwinWord challenge = s.state.challenge;
  const std::uint32_t steps = s.state.steps;
  const Thrice<FaultLog<LoggedTreeFault>> log = s.state.log;
  configure(s.controller, params);
  s.supervisor = coefficients(supervisor, s.controller.law);
  const TreeSupervisorState<typename L::Scalar, L::most> fresh;
  s.state = fresh;
  put(s.state.alive, supervisor_alive);
  if (was) {
    s.state.challenge = challenge;
    s.state.steps = steps;
    s.state.log = log;
  }
  const std::uint32_t all = static_cast<std::uint32_t>(joints_of(s.controller.law.gate, L::most));
  const bool valid = s.supervisor.valid != 0;
  if (was && shut) {
    go(s.state, Mode::latched, before);
  } else if (was && !(known && whole)) {
    go(s.state, Mode::running, {});  // so that the fault is written down
    enter(s.state, {SafetyFault::integrity, all}, Mode::latched);
  } else if (!valid) {
    go(s.state, Mode::latched, {SafetyFault::configuration, all});
  } else {
    begin(s);
  }
  if (valid && hear_stop(s.stops)) {
    if (is_stopped(mode_of(s.state))) stay_shut(s.state, {SafetyFault::stopped, all});
    else enter(s.state, {SafetyFault::stopped, all}, Mode::latched);
  }
  seal(s);
  return valid;
}

/// Takes note of a fault of a joint that could be of its encoder or drive.
template <class S, std::size_t N> void doubt(TreeSupervisorState<S, N>& s, TreeFault fault, std::size_t joints) noexcept {
  if (fault.fault != SafetyFault::none && fault.joint < joints && !can_hold(fault.fault)) put(s.joint[fault.joint].doubted, 1u);
}

/// Return the first fault of encoders, drives and commands in this period, and mark every suspected joint.
template <class L, class S, std::size_t N>
TreeFault observe(TreeSupervised<L>& s, const TreeSamples<S, N>& samples, const TreeFeedback<S, N>& back) noexcept {
  const TreeSupervisorCoefficients<S, N>& c = s.supervisor;
  const auto& law = s.controller.law;
  TreeSupervisorState<S, N>& state = s.state;
  const std::size_t n = joints_of(law.gate, N);
  TreeFault first;
  const auto say = [&](SafetyFault fault, std::size_t joint) {
    if (fault == SafetyFault::none) return;
    const TreeFault found{fault, static_cast<std::uint32_t>(joint)};
    if (first.fault == SafetyFault::none) first = found;
    doubt(state, found, n);
  };
  S velocity[N]{}, turned[N]{}, power = S(0);
  for (std::size_t k = 0; k < n; ++k) {
    say(step(c.joint[k].encoder, state.joint[k].encoder, samples.position[k]), k);
    say(compare(c.joint[k], state.joint[k], samples.position[k], back.joint[k]), k);
    velocity[k] = state.joint[k].encoder.velocity;
    power = power + state.output[k] * velocity[k];
  }
  motor_motion(law.drives, n, velocity, turned);
  for (std::size_t k = 0; k < n; ++k) {
    const DriveWatchParams<S>& drive = c.joint[k].params.drive;
    if (drive.expected == 0) continue;
    const bool heard = is_new(state.joint[k].drive_seen, back.drive[k]);
    const S given = given_of(drive, back.drive[k].value);
    if (heard && (state.steps & 1u) != 0)
      say(step(c.joint[k].delay, state.joint[k].delay, state.joint[k].drive.asked, given), k);
    say(step(drive, state.joint[k].drive, given, turned[k], c.period, heard), k);
  }
  if (!(abs(power) <= c.whole.power)) say(SafetyFault::power, n);
  if ((state.steps & 1u) == 0) return first;
  // Energy, people and the end point every second period, ringing every fourth: they are slow.
  for (std::size_t k = 0; k < n; ++k) {
    const S weight = s.controller.state.weight[k];
    const S level = c.joint[k].level + c.joint[k].load * abs(weight);
    say(step(c.joint[k].params.budget, state.joint[k].budget, S(2) * c.period, state.output[k], velocity[k],
             weight + law.drives.joint[k].offset, max(level, abs(friction(law.drives.joint[k].friction, velocity[k], weight)))),
        k);
    if (!(abs(s.controller.state.observer.residual[k]) <= c.joint[k].params.outside_limit + level))
      say(SafetyFault::unexplained, k);
    // The wave at start-up is no loop that rings, however slow a heavy machine makes it.
    if ((state.steps & 2u) != 0 && mode_of(state) != Mode::start_up) say(step(c.joint[k].ringing, state.joint[k].ringing, state.output[k]), k);
  }
  const auto& whole = law.whole;
  if (whole.end_link > 0 && c.whole.speed < S(std::numeric_limits<S>::max())) {
    S at[N];
    TreePose<S, N> pose;
    for (std::size_t k = 0; k < n; ++k) at[k] = state.joint[k].encoder.position;
    place(law.tree, at, pose);
    const S speed =
        point_speed(law.tree, pose, whole.end_link - 1, {whole.end_x, whole.end_y, whole.end_z}, velocity);
    if (!(speed <= c.whole.speed)) say(SafetyFault::overspeed, n);
  }
  return first;
}

/// Return the fault of the sensor on a link by itself, checked every second period: new samples arrive, lie within the
/// range, and change while any joint moves.
template <class S, std::size_t N>
SafetyFault judge_wrench(const WholeWatchParams<S>& p, TreeSupervisorState<S, N>& s, const WrenchSample<S>& read,
                         bool moves) noexcept {
  if (p.wrench_expected == 0) return SafetyFault::none;
  const bool heard = is_heard(read);
  const Vector3<S>& f = read.force;
  const Vector3<S>& m = read.moment;
  if (heard && !(max(max(abs(f.x), abs(f.y)), abs(f.z)) <= p.wrench_force &&
                 max(max(abs(m.x), abs(m.y)), abs(m.z)) <= p.wrench_moment))
    return SafetyFault::force_sensor;
  const WrenchSample<S>& last = s.wrench;
  const bool same = f.x == last.force.x && f.y == last.force.y && f.z == last.force.z && m.x == last.moment.x &&
                    m.y == last.moment.y && m.z == last.moment.z;
  const bool quiet = !heard || (moves && same);
  if (heard) s.wrench = read;
  s.wrench_quiet = quiet ? (s.wrench_quiet < 0xffff0000u ? s.wrench_quiet + 2 : s.wrench_quiet) : 0;
  return s.wrench_quiet >= p.wrench_quiet ? SafetyFault::lost : SafetyFault::none;
}

/// Residuals, force sensors and EMG, every second period. Without a sensor that is silent or beyond its range the law
/// goes on if it can. A force sensor that contradicts model, command and motion may be right and the drive or the
/// encoder wrong: then it goes on only if instruments of their own vouch for these.
template <class L, class S, std::size_t N>
void judge_sensors(TreeSupervised<L>& s, const TreeSamples<S, N>& samples) noexcept {
  const TreeSupervisorCoefficients<S, N>& c = s.supervisor;
  TreeSupervisorState<S, N>& state = s.state;
  const auto& law = s.controller.law;
  const auto& known = s.controller.state;
  const std::size_t n = joints_of(law.gate, N);
  TreeFault silent, contradicted, unexplained;
  const auto note = [](TreeFault& first, SafetyFault fault, std::size_t joint) {
    if (fault != SafetyFault::none && first.fault == SafetyFault::none)
      first = {fault, static_cast<std::uint32_t>(joint)};
  };
  bool any_moves = false;
  S loudness = S(0);
  for (std::size_t k = 0; k < n; ++k) {
    const JointWatchCoefficients<S>& p = c.joint[k];
    JointWatchState<S>& one = state.joint[k];
    const S velocity = one.encoder.velocity;
    const bool moves = abs(velocity) > c.whole.moving;
    any_moves = any_moves || moves;
    note(silent, step(p.params.force, one.force, samples.interaction[k], moves, SafetyFault::force_sensor, 2), k);
    note(silent, step(p.params.muscle, one.muscle, samples.muscle[k], false, SafetyFault::muscle, 2), k);
    const S level = p.level + p.load * abs(known.weight[k]);
    const S slides = abs(friction(law.drives.joint[k].friction, velocity, known.weight[k]));
    step(p.motion, one.motion, known.observer.residual[k], known.felt[k], known.sensed[k], level, slides);
    const SafetyFault said = shown(p.motion, one.motion, level);
    note(said == SafetyFault::unexplained ? unexplained : contradicted, said, k);
    loudness = loudness + one.motion.loudness;
  }
  if (!(loudness <= c.whole.force_excess)) note(contradicted, SafetyFault::force_sensor, n);
  note(silent, judge_wrench(c.whole, state, samples.wrench, any_moves), n);
  const Mode now = mode_of(state);
  if (now != Mode::running && now != Mode::degraded) return;
  if (unexplained.fault != SafetyFault::none) {
    doubt(state, unexplained, n);
    return enter(state, unexplained, response(c, unexplained, n));
  }
  if (now == Mode::degraded) return;
  const bool lies = contradicted.fault != SafetyFault::none;
  const TreeFault found = silent.fault != SafetyFault::none ? silent : contradicted;
  if (found.fault == SafetyFault::none) return;
  const bool goes_on = c.whole.degrades != 0 && (!lies || c.whole.trusts_motion != 0);
  enter(state, found, goes_on ? Mode::degraded : response(c, found, n));
}

/// Back to where it began, after a fault; the log stays. Not where memory is no longer what was sealed.
template <class L> void start_again(TreeSupervised<L>& s) noexcept {
  using S = typename L::Scalar;
  if (!is_sealed(s.state.law_sum, s.controller.law) || !is_sealed(s.state.own_sum, s.supervisor)) return lose_trust(s);
  reset(s.controller);
  for (S& output : s.controller.state.gate.output) output = S(0);
  auto& state = s.state;
  for (std::size_t k = 0; k < L::most; ++k) {
    state.joint[k] = {};
    state.output[k] = S(0);
  }
  state.wrench = {};
  state.wrench_quiet = 0;
  put(state.waited, ResetProgress{});
  begin(s);
  seal_memory(s);
}

/// Efforts while stopped, and whether an operator's token may end it.
template <class L>
void stay_stopped(TreeSupervised<L>& s, bool good, std::uint32_t token) noexcept {
  using S = typename L::Scalar;
  const auto& c = s.supervisor;
  auto& state = s.state;
  const auto& gate = s.controller.law.gate;
  const std::size_t n = joints_of(gate, L::most);
  S faded[L::most];
  for (std::size_t k = 0; k < n; ++k) {
    if (!is_finite(state.output[k])) state.output[k] = S(0);
    faded[k] = state.output[k];
  }
  fade(gate, faded);
  bool rests = true, moves = false;
  const bool holds = mode_of(state) == Mode::damped_stop;
  for (std::size_t k = 0; k < n; ++k) {
    JointWatchState<S>& one = state.joint[k];
    const S limit = gate.joint[k].params.effort_limit, change = gate.joint[k].max_change;
    S next = faded[k];
    if (holds && !is_doubted(one)) {
      const S wanted = step(c.joint[k].params.hold, one.hold, c.period, one.encoder.velocity);
      next = clamp(wanted, state.output[k] - change, state.output[k] + change);
    }
    next = clamp(next, -limit, limit);
    state.output[k] = mode_of(state) == Mode::latched || !is_finite(next) ? S(0) : next;
    rests = rests && abs(one.encoder.velocity) <= c.joint[k].params.rest_speed + speed_at_rest(c.joint[k].encoder);
    moves = moves || state.output[k] != S(0);
  }
  if (mode_of(state) == Mode::zero && !moves) go(state, Mode::latched, fault_of(state));
  if (may_reset(state, good && rests, token, c.whole.healthy_samples, c.reset_periods)) start_again(s);
}

/// Samples that are all read just now: a sensor that says nothing starts anew when it speaks again.
template <class L, class S, std::size_t N>
TreeSamples<S, N> stamped(TreeSupervised<L>& s, const TreeSamples<S, N>& read, std::int64_t now) noexcept {
  return stamped(s.controller, read, now, s.state.steps);
}

/// Stops the law from the next step on in any mode; before a start, from the start on.
template <class L> void stop(TreeSupervised<L>& s) noexcept { ++s.stops.asked; }

/// Inputs of a law without its force sensors and EMG.
template <class S, std::size_t N> void leave_out_sensors(TreeSamples<S, N>& samples, std::size_t joints) noexcept {
  for (std::size_t k = 0; k < joints; ++k) {
    samples.interaction[k].valid = samples.muscle[k].valid = false;
    samples.interaction[k].value = samples.muscle[k].value = std::numeric_limits<S>::quiet_NaN();
  }
  samples.wrench.valid = false;
}

/// One period of the test at start-up: the wave of the joint whose turn it is, and no effort of the others.
template <class L> void test_joints(TreeSupervised<L>& s) noexcept {
  using S = typename L::Scalar;
  const auto& c = s.supervisor;
  auto& state = s.state;
  const auto& gate = s.controller.law.gate;
  const std::size_t n = joints_of(gate, L::most);
  const std::size_t turn = state.tested < n ? state.tested : 0;
  bool done = false;
  for (std::size_t k = 0; k < n; ++k) {
    JointWatchState<S>& one = state.joint[k];
    const S limit = gate.joint[k].params.effort_limit, change = gate.joint[k].max_change;
    const S last = is_finite(state.output[k]) ? state.output[k] : S(0);
    S wanted = S(0);
    if (k == turn) {
      wanted = step(c.joint[k].test, one.test, c.period, one.encoder.velocity, c.joint[k].params.rest_speed, done);
      wanted = clamp(wanted, -limit, limit);
    }
    const S next = clamp(wanted, last - change, last + change);
    state.output[k] = is_finite(next) ? next : S(0);
    if (k == turn) one.test.pushed = state.output[k];
  }
  if (!done) return;
  const TreeFault said{shown(c.joint[turn].params.test, state.joint[turn].test), static_cast<std::uint32_t>(turn)};
  if (said.fault != SafetyFault::none) {
    doubt(state, said, n);
    return enter(state, said, Mode::zero);
  }
  state.tested = next_tested(c, n, turn + 1);
  if (state.tested < n) return;
  for (std::size_t k = 0; k < n; ++k) {
    state.joint[k].budget = {};
    state.joint[k].ringing = {};
    s.controller.state.gate.output[k] = state.output[k];
  }
  seal_memory(s);
  go(state, Mode::running, {});
}

/// One control period of a law of several joints under its supervisor, whatever comes in.
template <class L, class S, std::size_t N>
TreeSupervisorOutput<S, N> step(TreeSupervised<L>& s, const TreeSamples<S, N>& read, const TreeFeedback<S, N>& back,
                                std::int64_t now) noexcept {
  const TreeSupervisorCoefficients<S, N>& c = s.supervisor;
  TreeSupervisorState<S, N>& state = s.state;
  const auto& law = s.controller.law;
  const std::size_t n = joints_of(law.gate, N);
  const std::uint32_t all = static_cast<std::uint32_t>(n);
  TreeSupervisorOutput<S, N> out;
  out.beat = ++state.steps;
  if (!says(state.alive, supervisor_alive)) {
    out.fault = {SafetyFault::not_started, all};
    return out;
  }
  if (!is_whole(state.alive) || !is_whole(state.doing) || mode_of(state) > Mode::latched) {
    put(state.alive, supervisor_alive);
    go(state, Mode::running, {});  // so that the fault is written down
    enter(state, {SafetyFault::integrity, all}, Mode::zero);
  }
  // A checksum finds a lost bit later; what counts and indexes must be right before it is used. Without numbers that make
  // sense a start does not run, so that what runs has lost a bit.
  if (c.valid == 0 || !is_within_bounds(law)) {
    if (c.valid != 0 || !is_stopped(mode_of(state))) enter(state, {SafetyFault::integrity, all}, Mode::latched);
    for (S& output : state.output) output = S(0);
    out.fault = fault_of(state);
    out.challenge = c.valid != 0 ? state.challenge.word : 0;
    return out;
  }
  const bool kept = (state.steps & 1u) != 0 || ((state.steps & 2u) != 0 ? step(state.law_sum, s.controller.law)
                                                                       : step(state.own_sum, c));
  if (!kept) lose_trust(s);
  for (std::size_t k = 0; k < n; ++k) {
    JointWatchState<S>& one = state.joint[k];
    if (is_whole(one.doubted) && is_whole(one.released)) continue;
    if (!is_stopped(mode_of(state))) enter(state, {SafetyFault::integrity, static_cast<std::uint32_t>(k)}, Mode::zero);
    if (!is_whole(one.doubted)) put(one.doubted, 1u);
    if (!is_whole(one.released)) put(one.released, 1u);
  }
  if (hear_stop(s.stops)) {
    if (is_stopped(mode_of(state))) stay_shut(state, {SafetyFault::stopped, all});
    else latch(s.controller, {SafetyFault::stopped, all});
  }

  const bool was_stopped = is_stopped(mode_of(state));
  if (was_stopped) s.controller.fault = {};  // what was wrong is written down; what is wrong now?
  TreeSamples<S, N> samples = believed(s.controller, read, now);
  const TreeFault front = s.controller.fault;
  const TreeFault seen = observe(s, was_stopped ? read : samples, back);
  const TreeFault found = front.fault != SafetyFault::none ? front : seen;
  doubt(state, front, n);
  for (std::size_t k = 0; k < n; ++k)
    if (!is_heard(read.position[k])) doubt(state, {SafetyFault::not_finite, static_cast<std::uint32_t>(k)}, n);
  if (!was_stopped) {
    if (found.fault != SafetyFault::none) enter(state, found, response(c, found, n));
    if ((state.steps & 1u) == 0) judge_sensors(s, samples);
  } else {
    const bool runs_away = voted(state.waited).held > 20 && found.fault == SafetyFault::overspeed;
    if (mode_of(state) == Mode::damped_stop && runs_away) enter(state, found, Mode::zero);
    // The change of a position while nothing was heard is no velocity.
    for (std::size_t k = 0; k < n; ++k) {
      SampleState fresh;
      if (examine(law.gate.joint[k].rules, fresh, read.position[k], now) != SafetyFault::none) state.joint[k].encoder = {};
    }
    if (front.fault != SafetyFault::none) forget_samples(s.controller);
  }
  if (mode_of(state) == Mode::start_up) {
    test_joints(s);
  } else if (!is_stopped(mode_of(state)) && quick_sum(s.controller.state) != state.memory_sum) {
    enter(state, {SafetyFault::integrity, all}, Mode::zero);
  } else if (!is_stopped(mode_of(state))) {
    if (mode_of(state) == Mode::degraded) leave_out_sensors(samples, n);
    const TreeCommand<S, N> command = step(law, s.controller.state, samples);
    seal_memory(s);
    latch(s.controller, s.controller.state.gate.fault);
    ++s.controller.steps;
    if (s.controller.fault.fault == SafetyFault::none) {
      for (std::size_t k = 0; k < n; ++k) state.output[k] = command.effort[k];
    } else {
      doubt(state, s.controller.fault, n);
      enter(state, s.controller.fault, response(c, s.controller.fault, n));
    }
  }
  if (is_stopped(mode_of(state))) stay_stopped(s, found.fault == SafetyFault::none, back.token);
  const Mode mode = mode_of(state);
  for (std::size_t k = 0; k < n; ++k) out.command.effort[k] = state.output[k];
  motor_effort(law.drives, n, out.command.effort, out.command.drive);
  for (std::size_t i = 0; i < n; ++i) {
    ask(state.joint[i].drive, out.command.drive[i]);
    for (std::size_t k = 0; k < n; ++k) {
      const bool turns = law.drives.coupled ? law.drives.turns[i][k] != S(0) : i == k;
      if (turns && is_doubted(state.joint[k])) put(state.joint[i].released, 1u);
    }
    out.enable[i] = mode <= Mode::damped_stop && !is_released(state.joint[i]);
    if (!out.enable[i] && mode <= Mode::damped_stop) out.command.drive[i] = S(0);
  }
  out.mode = mode;
  out.fault = fault_of(state);
  out.challenge = is_stopped(mode) ? state.challenge.word : 0;
  return out;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
