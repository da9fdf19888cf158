// The energy and the time that the worst single fault of each group costs a wearer, under the supervisor: of encoder,
// drive, force sensor, EMG, clock and memory, on one joint and on two. Bounds are what was measured here and a quarter
// more, rounded up: they hold these robots, whose drives measure their effort, and say nothing of others.
#include "check.hpp"

#include <pellucid/supervisor.hpp>
#include <pellucid/transparent_compensation.hpp>
#include <pellucid/tree_supervisor.hpp>

#include <algorithm>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
using S = double;
constexpr S period = 1e-3, limit = 10, speed_limit = 8, inertia = 0.1;
constexpr int onset = 1200, horizon = 1000, phases = 6, substeps = 2;
const S nan = std::numeric_limits<S>::quiet_NaN();

/// One fault: what it does to samples, drive and memory from its onset on.
enum class Kind { none, lost, jump, frozen, flipped, doubled, repeated, reversed, tripled, stuck, dead, loud, silent, back, halted, gap, number, word };
struct Fault {
  const char* group;
  Kind kind;
};
constexpr Fault faults[] = {
    {"encoder", Kind::lost},      {"encoder", Kind::jump},     {"encoder", Kind::frozen},  {"encoder", Kind::flipped},
    {"encoder", Kind::doubled},  {"encoder", Kind::repeated}, {"drive", Kind::reversed},  {"drive", Kind::tripled},
    {"drive", Kind::stuck},      {"drive", Kind::dead},       {"drive", Kind::silent},    {"force", Kind::flipped},
    {"force", Kind::loud},       {"force", Kind::stuck},      {"force", Kind::silent},    {"force", Kind::frozen},
    {"emg", Kind::flipped},      {"emg", Kind::loud},         {"emg", Kind::stuck},       {"emg", Kind::silent},
    {"clock", Kind::back},       {"clock", Kind::halted},     {"clock", Kind::gap},       {"memory", Kind::number},
    {"memory", Kind::word},
};

/// What a sensor says instead of a value; `kept` is what it said at the onset, `size` a large value of it.
p::Sample<S> told(p::Sample<S> said, Kind kind, S kept, S size) {
  if (kind == Kind::lost) said.value = nan;
  if (kind == Kind::jump) said.value += size;
  if (kind == Kind::frozen) said.value = kept;
  if (kind == Kind::flipped) said.value = -said.value;
  if (kind == Kind::doubled) said.value = 2 * said.value - kept;
  if (kind == Kind::loud) said.value *= 10;
  if (kind == Kind::stuck) said.value = size;
  if (kind == Kind::silent) said.valid = false;
  return said;
}

/// What a drive gives of a command.
S gives(S command, Kind kind, S kept) {
  return kind == Kind::reversed ? -command
         : kind == Kind::tripled ? std::fmax(-limit, std::fmin(limit, 3 * command))
         : kind == Kind::stuck   ? kept
         : kind == Kind::dead    ? 0
                                 : command;
}

/// What the drives did from the onset on.
struct Outcome {
  S energy[horizon + 1] = {};  ///< positive work of the drive by each period [J]
  int safe = horizon;          ///< periods until the power is off, or the joint is held
  F fault = F::none;           ///< what was found
};

S friction(S v, S weight) { return std::tanh(v / 0.02) * (0.25 + 0.1 * std::fabs(weight)) + 0.05 * v; }
S hand(int k, int phase) { return 0.9 + 0.5 * std::sin(0.006 * k + 6.283185307179586 * phase / phases); }
S weight_at(S q) { return 2 * std::sin(q) + 0.3 * std::cos(q) + 0.1; }

p::TransparentCompensationParams<S> law() {
  p::TransparentCompensationParams<S> params;
  params.body.inertia = inertia;
  params.body.gravity_sine = 2;
  params.body.gravity_cosine = 0.3;
  params.body.offset = 0.1;
  auto& f = params.body.friction;
  f.coulomb_positive = f.coulomb_negative = 0.25;
  f.viscous_positive = f.viscous_negative = 0.05;
  f.load_motoring = f.load_generating = 0.1;
  f.velocity_width = 0.06;
  params.energy_store = 0.2;
  params.feedback.proportional = 0.5;
  params.feedback.lowpass = 60;
  params.feedback.drift = 0.02;
  params.feedback.limit = 3;
  params.emg.limb_inertia = 0.1;
  params.emg.acceleration_limit = 25;
  params.emg.share = 0.5;
  params.gate = {limit, 500, speed_limit, -0.5, 2.5, 0.1, 0.005, 2, period};
  return params;
}

/// The thresholds that follow from these limits by the rules of pellucid.controllers.supervised.
template <class Joint> void limits_of(Joint& r) {
  r.encoder = {speed_limit, limit / (0.1 * inertia), -0.65, 2.65, 4e-4, 0.5, 20};
  r.drive.expected = 1;
  r.drive.tolerance = 0.05 * limit;
  r.drive.surplus = 0.005 * limit;
  r.drive.gain = 0.05;
  r.drive.offset = 0.01 * limit;
  r.drive.forget = 1e-4;
  r.budget.push_limit = limit;
  r.budget.power_limit = 0.5 * limit * speed_limit;
  r.budget.store = inertia * (0.575 * speed_limit) * (0.575 * speed_limit);
  r.budget.steady = 0.01 * limit * speed_limit;
  r.ringing.limit = 0.115 * limit;
  r.hold = {0.05 * inertia / period, 4};
}

p::SupervisorParams<S> rules() {
  p::SupervisorParams<S> r;
  limits_of(r);
  r.body.inertia = inertia;
  r.body.gravity_sine = 2;
  r.body.gravity_cosine = 0.3;
  r.body.offset = 0.1;
  r.body.coulomb = 0.25;
  r.body.load = 0.1;
  r.body.viscous = 0.05;
  r.body.wearer_torque = std::fmax(0.15 * limit, inertia * speed_limit / 0.5);
  r.body.wearer_push = std::fmax(0.8 * limit, inertia * speed_limit / 0.1);
  r.body.force_tolerance = 0.066 * limit;
  r.body.force_burst = 0.66 * limit;
  r.body.force_excess = 0.022 * limit;
  r.force = {1, 50, 25};
  r.muscle = {1, 50, 40};
  r.degrades = 1;
  return r;
}

Outcome one_joint(const Fault& fault, int phase) {
  p::Supervised<p::TransparentCompensation<S>> robot;
  check(p::configure(robot, law(), rules()), "the example makes sense");
  p::SupervisorOutput<S> out;
  out.enable = true;
  Outcome found;
  S q = hand(0, phase), v = 0, given = 0, felt = 0, kept[4] = {};
  p::Samples<S> before;
  for (int k = 0; k < onset + horizon; ++k) {
    const bool on = k >= onset;
    const auto number = static_cast<std::uint32_t>(k + 1);
    const std::int64_t now = 1000 * std::int64_t(number);
    p::Samples<S> in{{q, now, number, true}, {given, now, number, true}, {felt, now, number, true}, {0.3 * felt, now, number, true}};
    p::Feedback<S> back;
    back.drive = {given, now, number, true};
    if (k == onset) kept[0] = q, kept[1] = given, kept[2] = felt, kept[3] = 0.3 * felt;
    if (on) {
      const char group = fault.group[0];
      if (group == 'e' && fault.group[1] == 'n') in.position = told(in.position, fault.kind, kept[0], 0.5);
      if (group == 'f') in.interaction = told(in.interaction, fault.kind, kept[2], 8);
      if (group == 'e' && fault.group[1] == 'm') in.muscle = told(in.muscle, fault.kind, kept[3], 30);
      if (fault.kind == Kind::repeated) in.position = before.position;
      if (group == 'd' && fault.kind == Kind::silent) back.drive.valid = false;
      if (fault.kind == Kind::back) in.position.time -= 500000, in.interaction.time -= 500000;
      if (fault.kind == Kind::halted) in.position.time = 1000 * std::int64_t(onset);
      if (fault.kind == Kind::gap && k < onset + 20) in.position = before.position;
      if (k == onset && fault.kind == Kind::number) robot.controller.law.body.gravity_sine = -8;
      if (k == onset && fault.kind == Kind::word) robot.state.doing.word ^= 3u;
    }
    out = p::step(robot, in, back, now);
    if (!(on && (fault.kind == Kind::repeated || fault.kind == Kind::gap))) before = in;
    const S wanted = out.enable ? out.effort : 0;
    given = fault.group[0] == 'd' && on && out.enable ? gives(wanted, fault.kind, kept[1]) : wanted;
    if (on) {
      found.energy[k - onset + 1] = found.energy[k - onset] + period * std::fmax(given * v, 0.0);
      if (found.fault == F::none) found.fault = out.fault;
      if (found.safe == horizon && p::is_stopped(out.mode)) found.safe = k - onset;
    }
    if (!on) check(out.mode == p::Mode::running, "a healthy robot runs");
    for (int i = 0; i < substeps; ++i) {
      felt = 20 * (hand(k, phase) - q) - 2 * v;
      const S push = given + felt - weight_at(q) - friction(v, weight_at(q));
      v += period / substeps * push / inertia;
      q += period / substeps * v;
    }
  }
  return found;
}

// --- two joints ------------------------------------------------------------------------------------------------------

constexpr std::size_t joints = 2;
using Tree = p::TreeCompensation<S, joints>;

Tree::Params tree_law() {
  Tree::Params params;
  params.tree.links = 2;
  params.tree.gravity_x = 0;
  params.tree.gravity_y = -9.81;
  params.tree.gravity_z = 0;
  for (std::uint32_t i = 0; i < joints; ++i) {
    auto& link = params.tree.link[i];
    link.parent = i;
    link.joint = 1;
    link.axis_z = 1;
    link.y = i == 0 ? 0 : -0.3;
    link.rotor_inertia = inertia;
    link.body.mass = 0.8;
    link.body.moment_y = -0.1;
    link.body.inertia_xx = link.body.inertia_zz = 0.02;
    link.body.inertia_yy = 0.01;
    auto& f = params.drives.joint[i].friction;
    f.coulomb_positive = f.coulomb_negative = 0.25;
    f.viscous_positive = f.viscous_negative = 0.05;
    f.velocity_width = 0.06;
    auto& one = params.joint[i];
    one.inertia_share = 0.3;
    one.energy_store = 0.2;
    one.feedback.proportional = 0.5;
    one.feedback.lowpass = 60;
    one.feedback.drift = 0.02;
    one.feedback.limit = 3;
    one.emg.limb_inertia = 0.1;
    one.emg.acceleration_limit = 25;
    one.emg.share = 0.5;
    one.gate = {limit, 500, speed_limit, -0.5, 2.5, 0.1, 0.005, 2, period};
  }
  params.whole.end_link = 2;
  params.whole.end_y = -0.3;
  params.whole.power_limit = limit * speed_limit;
  params.whole.speed_limit = 1.5 * speed_limit;
  return params;
}

Outcome two_joints(const Fault& fault, int phase, std::size_t joint) {
  p::TreeSupervised<Tree> robot;
  p::TreeSupervisorParams<S, joints> r;
  for (auto& one : r.joint) {
    limits_of(one);
    one.outside_limit = 0.8 * limit;
    // As tree_laws.with_force_sensor has it, of friction at rest and the limit of effort.
    one.motion = {5, std::fmax(0.15 * limit, inertia * speed_limit / 0.5), 0.5 * 0.25 + 0.02 * limit, 0.15 * limit, 0.25};
    one.force = {1, 50, 25};
    one.muscle = {1, 50, 40};
    one.delay = {0.011, 0.1 * limit, 60, 0.2};
  }
  r.whole.force_excess = 0;
  r.whole.degrades = 1;
  r.whole.power = limit * speed_limit;
  r.whole.speed = 1.5 * speed_limit;
  check(p::configure(robot, tree_law(), r), "the example makes sense");
  const auto plant = p::coefficients(tree_law().tree);
  p::TreeSupervisorOutput<S, joints> out;
  Outcome found;
  S q[joints], v[joints] = {0, 0}, given[joints] = {0, 0}, felt[joints] = {0, 0}, kept[joints][4] = {};
  for (std::size_t j = 0; j < joints; ++j) q[j] = hand(0, phase + 3 * static_cast<int>(j));
  p::TreeSamples<S, joints> before;
  for (int k = 0; k < onset + horizon; ++k) {
    const bool on = k >= onset;
    const auto number = static_cast<std::uint32_t>(k + 1);
    const std::int64_t now = 1000 * std::int64_t(number);
    p::TreeSamples<S, joints> in;
    p::TreeFeedback<S, joints> back;
    for (std::size_t j = 0; j < joints; ++j) {
      in.position[j] = {q[j], now, number, true};
      in.interaction[j] = {felt[j], now, number, true};
      in.muscle[j] = {0.3 * felt[j], now, number, true};
      back.drive[j] = {given[j], now, number, true};
      if (k == onset) kept[j][0] = q[j], kept[j][1] = given[j], kept[j][2] = felt[j], kept[j][3] = 0.3 * felt[j];
    }
    if (on) {
      const char group = fault.group[0];
      if (group == 'e' && fault.group[1] == 'n') in.position[joint] = told(in.position[joint], fault.kind, kept[joint][0], 0.5);
      if (group == 'f') in.interaction[joint] = told(in.interaction[joint], fault.kind, kept[joint][2], 8);
      if (group == 'e' && fault.group[1] == 'm') in.muscle[joint] = told(in.muscle[joint], fault.kind, kept[joint][3], 30);
      if (fault.kind == Kind::repeated) in.position[joint] = before.position[joint];
      if (group == 'd' && fault.kind == Kind::silent) back.drive[joint].valid = false;
      if (fault.kind == Kind::back) in.position[joint].time -= 500000;
      if (fault.kind == Kind::halted) in.position[joint].time = 1000 * std::int64_t(onset);
      if (fault.kind == Kind::gap && k < onset + 20) in.position[joint] = before.position[joint];
      if (k == onset && fault.kind == Kind::number) robot.controller.law.tree.gravity.y = 40;
      if (k == onset && fault.kind == Kind::word) robot.state.doing.word ^= 3u;
    }
    out = p::step(robot, in, back, now);
    if (!(on && (fault.kind == Kind::repeated || fault.kind == Kind::gap))) before = in;
    S gained = 0;
    for (std::size_t j = 0; j < joints; ++j) {
      const S wanted = out.enable[j] ? out.command.drive[j] : 0;
      given[j] = fault.group[0] == 'd' && on && j == joint && out.enable[j] ? gives(wanted, fault.kind, kept[j][1]) : wanted;
      gained += period * std::fmax(given[j] * v[j], 0.0);
    }
    if (on) {
      found.energy[k - onset + 1] = found.energy[k - onset] + gained;
      if (found.fault == F::none) found.fault = out.fault.fault;
      if (found.safe == horizon && p::is_stopped(out.mode)) found.safe = k - onset;
    }
    if (!on) check(out.mode == p::Mode::running, "a healthy robot runs");
    for (int i = 0; i < substeps; ++i) {
      p::TreePose<S, joints> pose;
      p::place(plant, q, pose);
      p::SquareMatrix<S, joints> mass;
      p::mass_matrix(plant, pose, mass);
      const S none[joints] = {0, 0};
      S bias[joints], push[joints];
      p::inverse_dynamics(plant, pose, v, none, bias);
      for (std::size_t j = 0; j < joints; ++j) {
        felt[j] = 20 * (hand(k, phase + 3 * static_cast<int>(j)) - q[j]) - 2 * v[j];
        push[j] = given[j] + felt[j] - bias[j] - friction(v[j], 0);
      }
      p::factorise(mass, joints);
      p::solve(mass, joints, push);
      for (std::size_t j = 0; j < joints; ++j) v[j] += period / substeps * push[j], q[j] += period / substeps * v[j];
    }
  }
  return found;
}

/// The most that a group may cost: energy beyond the healthy run's until it is safe [J], periods until what is found is
/// safe, and how many of its runs nobody finds in a second.
struct Bound {
  const char* group;
  S energy;
  int periods, unfound;
};

template <class Run> void judge(const Bound* bounds, const char* robot, Run&& run) {
  Outcome healthy[phases];
  for (int phase = 0; phase < phases; ++phase) {
    healthy[phase] = run(Fault{"none", Kind::none}, phase);
    check(healthy[phase].fault == F::none && healthy[phase].safe == horizon, "no fault, no stop");
  }
  for (const Bound* bound = bounds; bound < bounds + 6; ++bound) {
    S energy = 0;
    int latest = 0, unfound = 0, runs = 0;
    for (const Fault& fault : faults) {
      if (std::strcmp(fault.group, bound->group) != 0) continue;
      for (int phase = 0; phase < phases; ++phase, ++runs) {
        const Outcome found = run(fault, phase);
        energy = std::fmax(energy, found.energy[found.safe] - healthy[phase].energy[found.safe]);
        if (found.safe < horizon) latest = std::max(latest, found.safe);
        unfound += found.fault == F::none;
      }
    }
    std::printf("%s, %s: %.4f J, safe after %d ms, %d of %d not found\n", robot, bound->group, energy, latest, unfound, runs);
    check(energy <= bound->energy, "energy");
    check(latest <= bound->periods, "time");
    check(unfound <= bound->unfound, "found");
  }
}

constexpr Bound of_one[] = {{"encoder", 0.01, 270, 0}, {"drive", 0.17, 330, 0},  {"force", 0.26, 410, 0},
                            {"emg", 0.1, 0, 18},       {"clock", 0.001, 3, 0},   {"memory", 1.21, 195, 0}};
constexpr Bound of_two[] = {{"encoder", 0.007, 135, 0}, {"drive", 0.14, 605, 0}, {"force", 0.4, 875, 0},
                            {"emg", 0.44, 1000, 18},    {"clock", 0.001, 3, 0},  {"memory", 0.001, 3, 0}};

}  // namespace

int main() {
  judge(of_one, "one joint", one_joint);
  for (std::size_t joint = 0; joint < joints; ++joint)
    judge(of_two, joint == 0 ? "first of two" : "second of two",
          [joint](const Fault& fault, int phase) { return two_joints(fault, phase, joint); });
  return failures();
}
