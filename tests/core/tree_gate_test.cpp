// The gate of several joints and the front before it: each limit just within and just beyond it, joint by joint and of
// the whole, in both signs; efforts that fade together; samples that may not be believed.
#include "check.hpp"

#include <pellucid/tree_gate.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
using S = double;
constexpr std::size_t joints = 3;
const S nan = std::numeric_limits<S>::quiet_NaN(), never = std::numeric_limits<S>::infinity();

/// Limits of 8, 16 and 24 N m and 2, 2 and 4 N m a period.
p::SafetyParams<S> limits(std::size_t k) {
  return {8.0 * static_cast<S>(k + 1), k == 2 ? 1024.0 : 512.0, 4, -1, 2, 0.5, 0.25, 3, 0x1p-8};
}

p::TreeGateCoefficients<S, joints> gate(S power = never, S speed = never, std::size_t count = joints) {
  const p::SafetyParams<S> params[] = {limits(0), limits(1), limits(2), limits(2)};
  return p::tree_gate<S, joints>(params, count, power, speed);
}

void parameters() {
  check(gate().valid && gate().joints == 3 && gate(1, 2).power_limit == 1 && gate(1, 2).speed_limit == 2, "sound");
  check(!gate(0).valid && !gate(1, 0).valid && !gate(-1).valid && !gate(1, -1).valid && !gate(nan).valid, "limits above 0");
  check(!gate(1, 1, 0).valid && gate(1, 1, 1).valid && gate(1, 1, 3).valid, "some joints");
  check(!gate(1, 1, 4).valid && gate(1, 1, 4).joints == 3, "and no more than there is room for");
  const p::SafetyParams<S> many[] = {limits(0), limits(1), limits(2), limits(2), limits(2)};
  check(p::tree_gate<S, 4>(many, 5, 1.0, 1.0).joints == 4, "wherever there is more room");
  for (std::size_t k = 0; k < joints; ++k) {
    p::SafetyParams<S> params[] = {limits(0), limits(1), limits(2)};
    params[k].period = 0x1p-7;
    check(!p::tree_gate<S, joints>(params, joints, 1.0, 1.0).valid, "one period");
    params[k] = limits(k);
    params[k].effort_limit = -1;
    check(!p::tree_gate<S, joints>(params, joints, 1.0, 1.0).valid, "each of them sound");
  }
}

/// Efforts go to 0 by the same share, as fast as the slowest may.
void fades() {
  const auto c = gate();
  for (const S way : {-1.0, 1.0}) {
    S out[] = {way * 4, way * -8, way * 4};
    p::fade(c, out);
    check(out[0] == way * 3 && out[1] == way * -6 && out[2] == way * 3, "the second may change by 2");
    S last[] = {way * 2, way * -2, way * 4};
    p::fade(c, last);
    check(last[0] == 0 && last[1] == 0 && last[2] == 0, "together to nothing");
    S slow[] = {way * 4, 0, way * 16};
    p::fade(c, slow);
    check(slow[0] == way * 3 && slow[2] == way * 12, "the third may change by 4");
    S first[] = {way * 4, way * 3, 0};
    p::fade(c, first);
    check(first[0] == way * 2 && first[1] == way * 1.5, "the first may change by 2, whatever the second may");
    S once[] = {way * 2.5, 0, 0};
    p::fade(c, once);
    check_close(once[0], way * 0.5, 1e-15, "a change and a little more");
    S two[] = {way * 4, way * 8, way * 32};
    p::fade(c, two);
    check(two[0] == way * 3.5 && two[1] == way * 7 && two[2] == way * 28, "the slowest of several");
  }
}

struct Rig {
  p::TreeGateCoefficients<S, joints> c;
  p::TreeGateState<S, joints> s{};
  p::Sample<S> place[joints];
  S velocity[joints] = {0, 0, 0};
  S end_speed = 0;
  std::uint32_t count = 0;

  explicit Rig(S power = never, S speed = never) : c(gate(power, speed)) {
    for (auto& one : place) one.value = 0.5;
  }
  F step(S first, S second, S third) {
    const S wanted[] = {first, second, third};
    ++count;
    for (auto& one : place) one.time = 1000 * std::int64_t(count), one.sequence = count, one.valid = true;
    return again(wanted);
  }
  F again(const S* wanted) {
    p::step(c, s, wanted, velocity, place, end_speed);
    return s.fault.fault;
  }
};

void efforts() {
  for (const S way : {-1.0, 1.0}) {
    Rig rig;
    check(rig.step(way, way * -9, way * 9) == F::none && rig.s.fault.joint == 0, "no fault, of no joint");
    check(rig.s.output[0] == way && rig.s.output[1] == way * -2 && rig.s.output[2] == way * 4, "rates");
    for (int k = 0; k < 30; ++k) rig.step(way * 99, way * -99, way * 99);
    check(rig.s.output[0] == way * 8 && rig.s.output[1] == way * -16 && rig.s.output[2] == way * 24, "limits");
    rig.step(0, 0, 0);
    check(rig.s.output[0] == way * 6 && rig.s.output[1] == way * -14 && rig.s.output[2] == way * 20, "and back");
    // Into stops, in all three.
    for (std::size_t k = 0; k < joints; ++k) {
      Rig one;
      one.place[k].value = way > 0 ? 1.75 : -0.75;
      for (int i = 0; i < 30; ++i) one.step(way * 99, way * 99, way * 99);
      for (std::size_t j = 0; j < joints; ++j)
        check(one.s.output[j] == way * 8 * static_cast<S>(j + 1) * (j == k ? 0.5 : 1), "half a margin from a stop");
      one.place[k].value = way > 0 ? 1.875 : -0.875;
      one.velocity[(k + 1) % joints] = 9;
      one.step(0, 0, 0);
      check(one.s.fault.fault == F::velocity && one.s.fault.joint == (k + 1) % joints, "another joint's fault");
      check(one.s.output[k] == way * 2 * static_cast<S>(k + 1), "and while they fade");
    }
  }
}

void joint_faults() {
  for (std::size_t k = 0; k < joints; ++k)
    for (const S way : {-1.0, 1.0}) {
      Rig rig;
      rig.velocity[k] = way * 4;
      check(rig.step(1, 1, 1) == F::none, "at the limit");
      rig.velocity[k] = way * (4 + 0x1p-8);
      check(rig.step(1, 1, 1) == F::velocity && rig.s.fault.joint == k, "beyond");
      rig.velocity[k] = 0;
      check(rig.step(9, 9, 9) == F::velocity && rig.s.output[0] == 0, "and stays");
      Rig both;
      both.step(1, 1, 1);
      both.velocity[k] = way * 9;
      both.place[k].value = nan;
      check(both.step(1, 1, 1) == F::not_finite && both.s.fault.joint == k, "a sample that is none is said first");
      p::reset(rig.s);
      check(rig.step(1, 1, 1) == F::none && rig.s.output[0] == 1 && rig.s.sample[k].started, "until it is opened");
      rig.place[k].value = nan;
      check(rig.step(1, 1, 1) == F::not_finite && rig.s.fault.joint == k && rig.s.position[k] == 0.5, "the last place");
    }
  // Two at once: the first is named; repeats are counted by each joint.
  Rig both;
  both.velocity[1] = both.velocity[2] = 9;
  both.step(0, 0, 0);
  check(both.s.fault.joint == 1, "the first");
  Rig seen;
  seen.step(0, 0, 0);
  const S wanted[] = {0, 0, 0};
  for (int k = 0; k < 3; ++k) check(seen.again(wanted) == F::none, "seen again, as often as allowed");
  check(seen.again(wanted) == F::stale && seen.s.fault.joint == 0, "and no more");
  Rig none;
  none.c.valid = false;
  none.s.output[0] = none.s.output[2] = 5;
  check(none.step(1, 1, 1) == F::configuration && none.s.output[0] == 0 && none.s.output[2] == 0, "without sense nothing");
}

/// Power is the sum over joints, of what would be given; speed is the end point's.
void totals() {
  for (const S way : {-1.0, 1.0})
    for (const S turn : {-1.0, 1.0}) {
      Rig rig(8);
      rig.velocity[0] = turn * 1, rig.velocity[1] = turn * 2, rig.velocity[2] = turn * 3;
      check(rig.step(way, way * 0.5, way * 2) == F::none, "at the limit, given or taken");
      check(rig.step(way, way * 0.5, way * (2 + 0x1p-8)) == F::power && rig.s.fault.joint == joints, "beyond");
      check(std::fabs(rig.s.output[0]) <= 0.5 && std::fabs(rig.s.output[2]) <= 1.0, "then they fade");
      Rig sum(8);
      sum.velocity[0] = turn * 4, sum.velocity[1] = turn * -4;
      check(sum.step(way * 2, way * 2, 0) == F::none && sum.step(way * 4, way * 4, 0) == F::none, "what one gives another takes");
      check(sum.s.output[0] == way * 4, "passes");
    }
  Rig speed(never, 2);
  speed.end_speed = 2;
  check(speed.step(1, 1, 1) == F::none, "at the limit");
  speed.end_speed = 2 + 0x1p-8;
  check(speed.step(1, 1, 1) == F::velocity && speed.s.fault.joint == joints, "beyond");
  Rig no(never, 2);
  no.end_speed = nan;
  check(no.step(1, 1, 1) == F::velocity, "no number is beyond");
  Rig first(8, 2);
  first.velocity[2] = 9;
  first.end_speed = 9;
  first.step(1, 1, 1);
  check(first.s.fault.joint == 2, "a joint's fault is said first");
}

void before_stops() {
  auto c = p::coefficients(limits(0));
  check(p::before_stop(c, 0.5, 99.0) == 8 && p::before_stop(c, 0.5, -99.0) == -8, "within the limit");
  check(p::before_stop(c, 1.75, 99.0) == 4 && p::before_stop(c, -0.75, -99.0) == -4, "half a margin away");
  check(p::before_stop(c, 0.5, nan) == 0 && p::before_stop(c, 0.5, never) == 8, "a number");
  c.params.position_max = nan;
  check(p::before_stop(c, 0.5, 9.0) == 0 && p::before_stop(c, 0.5, -9.0) >= -8, "within the limit, whatever the stops");
}

// --- the front -------------------------------------------------------------------------------------------------------

/// A law that passes what it reads.
struct Passing {
  using Scalar = S;
  struct Params {
    p::SafetyParams<S> gate[joints];
  };
  struct Coefficients {
    p::TreeGateCoefficients<S, joints> gate;
  };
  struct State {
    p::TreeGateState<S, joints> gate;
  };
  static constexpr std::size_t most = joints;
};
Passing::Coefficients coefficients(const Passing::Params& params) { return {p::tree_gate<S, joints>(params.gate, joints, never, never)}; }
void reset(Passing::State& s) { p::reset(s.gate); }

void fronts() {
  Passing::Params params{{limits(0), limits(1), limits(2)}};
  p::TreeController<Passing> c;
  check(p::configure(c, params) && c.fault.fault == F::none, "sound");
  const auto at = [](std::uint32_t k) {
    p::TreeSamples<S, joints> in;
    for (std::size_t j = 0; j < joints; ++j)
      in.position[j] = in.interaction[j] = in.muscle[j] = {1, 1000 * std::int64_t(k), k, true};
    in.wrench.time = 1000 * std::int64_t(k), in.wrench.sequence = k, in.wrench.valid = true;
    return in;
  };
  const auto all_heard = [](const p::TreeSamples<S, joints>& seen) {
    bool heard = p::is_heard(seen.wrench);
    for (std::size_t j = 0; j < joints; ++j)
      heard = heard && p::is_heard(seen.position[j]) && p::is_heard(seen.interaction[j]) && p::is_heard(seen.muscle[j]);
    return heard;
  };
  check(all_heard(p::believed(c, at(1), 1000)) && all_heard(p::believed(c, at(2), 2000)), "all is heard");
  check(c.fault.joint == 0, "no fault of no joint");
  check(c.position[1].sequence == 2 && c.interaction[2].sequence == 2 && c.muscle[0].sequence == 2 && c.wrench.sequence == 2, "seen");
  // A sensor that a law can do without is left out alone; an encoder stops all.
  for (std::size_t j = 0; j < joints; ++j) {
    auto one = c;
    auto in = at(3);
    in.interaction[j].time = in.muscle[j].time = 1, in.wrench.time = 1;
    const auto seen = p::believed(one, in, 3000);
    check(!p::is_heard(seen.interaction[j]) && !p::is_heard(seen.muscle[j]) && !p::is_heard(seen.wrench), "too old");
    check(seen.interaction[j].value != seen.interaction[j].value && !seen.muscle[j].valid, "no number");
    check(one.fault.fault == F::none && p::is_heard(seen.position[j]), "and no fault");
    in = at(3);
    in.position[j].value = nan;
    const auto none = p::believed(one, in, 3000);
    check(one.fault.fault == F::not_finite && one.fault.joint == j, "an encoder");
    for (std::size_t k = 0; k < joints; ++k) check(!p::is_heard(none.position[k]) && !none.position[k].valid, "all of them");
    check(p::is_heard(none.interaction[j]), "but nothing else");
    auto late = p::believed(one, at(4), 4000);
    check(!p::is_heard(late.position[0]) && one.fault.fault == F::not_finite, "until a reset");
    p::latch(one, {F::stopped, 9});
    check(one.fault.fault == F::not_finite, "the first fault stays");
    p::reset(one);
    check(one.fault.fault == F::none && !one.position[j].started && !one.wrench.started, "opened");
    late = p::believed(one, at(1), 1000);
    check(p::is_heard(late.position[0]), "clocks may begin anew");
    p::stop(one);
    check(one.fault.fault == F::stopped && one.fault.joint == joints, "asked to stop");
  }
  for (const S wrong : {nan, never}) {
    for (int i = 0; i < 6; ++i) {
      p::WrenchSample<S> w;
      w.valid = true;
      check(p::is_heard(w), "a wrench");
      S* const parts[] = {&w.force.x, &w.force.y, &w.force.z, &w.moment.x, &w.moment.y, &w.moment.z};
      *parts[i] = wrong;
      check(!p::is_heard(w), "of which every part is a number");
    }
    p::WrenchSample<S> silent;
    check(!p::is_heard(silent), "and that is valid");
  }
  // Opposite infinite parts are no number either.
  p::WrenchSample<S> opposite;
  opposite.valid = true;
  opposite.force.x = never, opposite.force.y = -never;
  check(!p::is_heard(opposite), "nor their difference");
  Passing::Params bad = params;
  bad.gate[1].period = 1;
  p::TreeController<Passing> shut;
  check(!p::configure(shut, bad) && shut.fault.fault == F::configuration && shut.state.gate.fault.fault == F::configuration, "no sense");
  p::reset(shut);
  check(shut.fault.fault == F::configuration && shut.state.gate.fault.fault == F::configuration, "nor after a reset");
  // Samples that are all read now: what says nothing begins anew when it speaks.
  p::TreeController<Passing> now;
  p::configure(now, params);
  p::believed(now, at(5), 5000);
  auto in = at(6);
  in.position[1].valid = in.interaction[0].valid = in.muscle[2].valid = in.wrench.valid = false;
  const auto made = p::stamped(now, in, 77, 8);
  check(!now.position[1].started && now.position[0].started, "an encoder");
  check(!now.interaction[0].started && now.interaction[1].started, "a sensor at a joint");
  check(!now.muscle[2].started && now.muscle[1].started && !now.wrench.started, "EMG, and a wrench");
  for (std::size_t j = 0; j < joints; ++j)
    check(made.position[j].time == 77 && made.interaction[j].sequence == 8 && made.muscle[j].time == 77, "stamped");
  check(made.wrench.time == 77 && made.wrench.sequence == 8, "all of them");
}

/// Efforts that a wrench has at joints, and the speed of a point, on two hinges and a slide that are easily computed.
/// A link that is welded on lies between the hinges.
void statics() {
  constexpr std::size_t room = 7;
  p::TreeParams<S, room> params;
  params.links = 4;
  for (std::uint32_t i = 0; i < 4; ++i) {
    params.link[i].parent = i;
    params.link[i].joint = i == 1 ? 0 : i == 3 ? 2 : 1;
    params.link[i].axis_z = i == 3 ? 0 : 1;
    params.link[i].axis_x = i == 3 ? 1 : 0;
    params.link[i].x = i == 0 ? 0 : i == 3 ? 1 : 0.5;
    params.link[i].body.mass = 1;
  }
  const auto c = p::coefficients(params);
  check(c.coordinates == joints, "three coordinates");
  const S q[room] = {0, 0, 0}, v[room] = {1, 2, 3};
  p::TreePose<S, room> pose;
  p::place(c, q, pose);
  S effort[room];
  // The point is at (0, 0.5, 0) of the slide, which lies 2 m from the first hinge.
  p::felt_at_joints(c, pose, 3, {0.0, 0.5, 0.0}, {4.0, 8.0, 0.0}, {0.0, 0.0, 1.0}, effort);
  check_close(effort[0], 2 * 8 - 0.5 * 4 + 1, 1e-12, "first hinge");
  check_close(effort[1], 1 * 8 - 0.5 * 4 + 1, 1e-12, "second hinge");
  check_close(effort[2], 4.0, 1e-12, "slide");
  p::felt_at_joints(c, pose, 0, {0.0, 0.5, 0.0}, {4.0, 8.0, 0.0}, {0.0, 0.0, 1.0}, effort);
  check_close(effort[0], -0.5 * 4 + 1, 1e-12, "on the first link");
  check(effort[1] == 0 && effort[2] == 0, "joints that do not carry it");
  for (std::size_t none = 4; none < room; ++none) {
    auto bare = c;
    bare.link[none].joint = p::JointKind::revolute;
    bare.link[none].axis = {0, 0, 1};
    bare.link[none].on_base = true;
    p::felt_at_joints(bare, pose, none, {0.0, 0.5, 0.0}, {4.0, 8.0, 0.0}, {0.0, 0.0, 1.0}, effort);
    check(effort[0] == 0 && effort[1] == 0 && effort[2] == 0, "on no link");
    check(p::point_speed(bare, pose, none, {0.0, 0.5, 0.0}, v) == 0, "nor is it a point");
  }
  // x: -0.5 (1 + 2) + 3; y: 2 + 2.
  check_close(p::point_speed(c, pose, 3, {0.0, 0.5, 0.0}, v), std::sqrt(1.5 * 1.5 + 16.0), 1e-12, "speed");
  check_close(p::point_speed(c, pose, 2, {0.0, 0.5, 0.0}, v), std::sqrt(1.5 * 1.5 + 1.0), 1e-12, "of another link");
}

}  // namespace

int main() {
  parameters();
  fades();
  efforts();
  joint_faults();
  totals();
  before_stops();
  fronts();
  statics();
  return failures();
}
