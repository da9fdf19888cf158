// The supervisor of several joints, piece by piece: each watch of each joint and of the whole just within and just beyond
// its limit, in both signs; which state follows which; which motors keep their power; what a hold and a reset need.
#include "check.hpp"

#include <pellucid/tree_supervisor.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
using M = p::Mode;
using S = double;
constexpr std::size_t joints = 3;
using Law = p::TreeCompensation<S, joints>;
using Rules = p::TreeSupervisorParams<S, joints>;
using Supervised = p::TreeSupervised<Law>;
using Feedback = p::TreeFeedback<S, joints>;
using Samples = p::TreeSamples<S, joints>;
constexpr S period = 0x1p-10, more = 0x1p-8, never = std::numeric_limits<S>::infinity();
constexpr M modes[] = {M::running, M::degraded, M::damped_stop, M::zero, M::latched};
const S nan = std::numeric_limits<S>::quiet_NaN();

/// Three hinges about the same axis, 1 m apart, without weight or friction; the end point is 1 m beyond the third.
Law::Params law_params() {
  Law::Params params;
  params.tree.links = 3;
  params.tree.gravity_x = params.tree.gravity_y = params.tree.gravity_z = 0;
  for (std::uint32_t i = 0; i < joints; ++i) {
    auto& link = params.tree.link[i];
    link.parent = i;
    link.joint = 1;
    link.axis_z = 1;
    link.x = i == 0 ? 0 : 1;
    link.rotor_inertia = 0.01;
    link.body.mass = 1;
    link.body.inertia_xx = link.body.inertia_yy = link.body.inertia_zz = 0.1;
    params.drives.joint[i].friction.velocity_width = 0.05;
    auto& gate = params.joint[i].gate;
    gate = {10, 512, never, -never, never, 0.5, 0.005, 2, period};
  }
  params.whole.end_link = 3;
  params.whole.end_x = 1;
  return params;
}

Rules rules() {
  Rules r;
  for (auto& one : r.joint) one.hold = {2, 4};
  r.whole.reset_delay = 16 * period;
  r.whole.healthy_samples = 8;
  return r;
}

/// The rules with a change make no sense.
template <class Change> void refused(Change change, const char* what, int line = __builtin_LINE()) {
  Rules bad = rules();
  change(bad);
  check(p::coefficients(bad, p::coefficients(law_params())).valid == 0, what, line);
}

// --- numbers ---------------------------------------------------------------------------------------------------------

void parameters() {
  const Rules usual;
  check(usual.whole.reset_delay == 1 && usual.whole.healthy_samples == 500 && usual.joint[0].rest_speed == 0.3, "usual");
  check(usual.whole.power == never && usual.whole.speed == never && usual.joint[2].outside_limit == never, "no limits");
  auto params = law_params();
  params.drives.joint[1].friction.coulomb_positive = 0.25;
  params.drives.joint[1].friction.coulomb_negative = 0.5;
  params.drives.joint[1].friction.stribeck = 0.125;
  params.drives.joint[1].friction.stribeck_velocity = 0.1;
  params.drives.joint[1].friction.load_motoring = 0.0625;
  params.drives.joint[1].friction.load_generating = 0.03125;
  params.drives.joint[2].friction.coulomb_positive = 0.75;
  params.drives.joint[2].friction.coulomb_negative = 0.5;
  params.drives.joint[2].friction.load_generating = 0.25;
  const auto law = p::coefficients(params);
  const auto c = p::coefficients(rules(), law);
  check(c.valid == 1 && c.period == period && c.reset_periods == 16, "sound");
  check(c.joint[1].level == 0.625 && c.joint[1].load == 0.0625 && c.joint[0].level == 0, "friction of the worse direction");
  check(c.joint[2].level == 0.75 && c.joint[2].load == 0.25, "whichever it is");
  check(c.joint[1].encoder.period == period && c.joint[1].ringing.smoothing == 100 * 4 * period, "ringing every fourth");
  for (std::size_t k = 0; k < joints; ++k) {
    Rules restless = rules();
    restless.joint[k].rest_speed = -1;
    check(p::coefficients(restless, law).valid == 0 && p::coefficients(restless, law).reset_periods == 1000000, "unsound");
    refused([k](Rules& bad) { bad.joint[k].encoder.range_min = 1, bad.joint[k].encoder.range_max = 0; }, "an encoder without a range");
    refused([k](Rules& bad) { bad.joint[k].ringing.fastest = 300; }, "a band that is too fast");
  }
  refused([](Rules& bad) { bad.whole.reset_delay = -1; }, "unsound as a whole");
  auto shut = law;
  shut.gate.valid = false;
  check(p::coefficients(rules(), shut).valid == 0, "no gate");
  auto fast = law;
  for (auto& one : fast.gate.joint) one.params.period = 0x1p-17;
  const auto periods = [&](S delay) {
    Rules one = rules();
    one.whole.reset_delay = delay;
    return p::coefficients(one, fast).reset_periods;
  };
  check(periods(7.5) == 983040 && periods(3.75) == 491520 && periods(0) == 0, "delays in periods");
  check(periods(7.75) == 1000000 && periods(8) == 1000000 && periods(60) == 1000000, "a million at most");
}

bool holdable(F fault) {
  for (const F one : {F::velocity, F::stopped, F::overspeed, F::push, F::power, F::energy, F::force_sensor, F::muscle, F::lost})
    if (one == fault) return true;
  return false;
}

/// Joints that can be held are held, unless what is in doubt is of the whole or of the only one that could be.
void answers() {
  const auto law = p::coefficients(law_params());
  for (std::size_t i = 0; i < p::safety_fault_count; ++i) {
    const F fault = static_cast<F>(i);
    check(p::can_hold(fault) == holdable(fault), p::safety_fault_names[i]);
    for (std::uint32_t joint = 0; joint <= joints + 1; ++joint)
      for (int held = 0; held < 8; ++held) {
        Rules r = rules();
        bool any = false;
        for (std::uint32_t k = 0; k < joints; ++k) {
          const bool can = (held >> k & 1) != 0;
          if (!can) r.joint[k].hold = {};
          any = any || (can && (k != joint || holdable(fault)));
        }
        const bool whole = joint >= joints && !holdable(fault);
        const M wanted = any && !whole ? M::damped_stop : M::zero;
        check(p::response(p::coefficients(r, law), {fault, joint}, joints) == wanted, "response");
      }
  }
}

// --- states ----------------------------------------------------------------------------------------------------------

using State = p::TreeSupervisorState<S, joints>;

void transitions() {
  for (const M now : modes)
    for (const M wanted : {M::damped_stop, M::zero, M::latched}) {
      State s;
      const bool was = p::is_stopped(now);
      p::go(s, now, was ? p::TreeFault{F::lost, 2} : p::TreeFault{});
      s.steps = 77;
      p::put(s.waited, p::ResetProgress{5, 5, 5});
      for (auto& one : s.joint) one.hold = {1, 1, 1}, one.drive = {4, 2, 1, 1, 1, 1, 1};
      p::enter(s, {F::jump, 1}, wanted);
      const bool same = was && wanted <= now;
      check(p::mode_of(s) == (same ? now : wanted) && p::faults_of(s) == (same ? 0u : 1u), "the harder one");
      check(p::fault_of(s).fault == (was ? F::lost : F::jump) && p::fault_of(s).joint == (was ? 2u : 1u), "the first fault");
      if (same) {
        check(p::voted(s.waited).stopped == 5 && p::voted(s.waited).healthy == 5 && s.challenge.word == 0 && s.joint[1].drive.due == 1, "nothing else");
        continue;
      }
      check(p::logged(s, 0).fault.fault == F::jump && p::logged(s, 0).fault.joint == 1 && p::logged(s, 0).step == 77, "log");
      check(p::logged(s, 0).mode == wanted && p::voted(s.waited).stopped == 0 && p::voted(s.waited).healthy == 0, "begins anew");
      for (const auto& one : s.joint) {
        check(one.hold.effort == 0 && one.hold.taken == 0 && one.drive.due == 0 && one.drive.outside == 0, "watches, too");
        check(one.drive.asked == 4 && one.drive.asked_before == 4, "but what was asked for");
      }
      check(s.challenge.word % 2 == 1 && p::is_whole(s.challenge), "a challenge that is not 0");
      const std::uint32_t challenge = s.challenge.word;
      State other = s;
      p::go(s, M::running, {}), p::go(other, M::running, {});
      ++s.steps, other.steps += 2;
      p::enter(s, {F::jump, 1}, M::zero), p::enter(other, {F::jump, 1}, M::zero);
      check(s.challenge.word != challenge && other.challenge.word != s.challenge.word, "another one for every fault");
    }
  State s;
  for (std::uint32_t k = 1; k <= 20; ++k) {
    p::go(s, M::running, {});
    s.steps = k;
    p::enter(s, {F::jump, 0}, M::zero);
    for (std::uint32_t ago = 0; ago < 12; ++ago) check(p::logged(s, ago).step == (ago < k && ago < 8 ? k - ago : 0), "the last eight");
  }
  for (std::size_t i = 0; i < p::safety_fault_count; ++i)
    for (std::uint32_t joint = 0; joint <= joints + 1; ++joint) {
      State one;
      const F fault = static_cast<F>(i);
      p::doubt(one, {fault, joint}, joints);
      for (std::uint32_t k = 0; k < joints; ++k)
        check(one.joint[k].doubted.word == (k == joint && fault != F::none && !holdable(fault) ? 1u : 0u), "doubt");
      State two;
      p::doubt(two, {fault, joint}, 2);
      check(two.joint[2].doubted.word == 0, "of joints that there are");
    }
}

struct Rig {
  Supervised law{};
  p::TreeSupervisorOutput<S, joints> out{};
  Samples in{};
  Feedback back{};
  S place[joints] = {0, 0, 0}, speed[joints] = {0, 0, 0};
  std::int64_t now = 1000000;
  std::uint32_t count = 100;

  explicit Rig(const Rules& r = rules(), const Law::Params& params = law_params()) {
    check(p::configure(law, params, r), "the example makes sense");
  }
  State& state() { return law.state; }
  M mode() const { return p::mode_of(law.state); }
  F fault() const { return p::fault_of(law.state).fault; }
  void read() {
    now += 977;
    ++count;
    for (std::size_t k = 0; k < joints; ++k) {
      place[k] += speed[k] * period;
      in.position[k] = {place[k], now, count, true};
      back.drive[k] = {out.command.drive[k], now, count, true};
    }
  }
  void step() { out = p::step(law, in, back, now); }
  void run(int n) {
    for (int k = 0; k < n; ++k) read(), step();
  }
  /// What is seen in a period of a number.
  p::TreeFault seen(std::uint32_t steps) {
    state().steps = steps;
    read();
    return p::observe(law, in, back);
  }
  void settles() {
    for (int k = 0; k < 4; ++k) seen(0);
  }
};

void configured() {
  Rig rig;
  check(rig.mode() == M::running, "runs at once");
  rig.run(100);
  p::configure(rig.law, law_params(), rules());
  check(rig.mode() == M::running && rig.state().steps == 100, "again");
  p::stop(rig.law);
  rig.run(1);
  const std::uint32_t challenge = rig.out.challenge;
  check(rig.out.fault.fault == F::stopped && rig.out.fault.joint == joints && challenge != 0, "stopped");
  p::configure(rig.law, law_params(), rules());
  check(rig.mode() == M::latched && rig.fault() == F::stopped && p::fault_of(rig.law.state).joint == joints, "stays");
  check(rig.state().challenge.word == challenge && rig.state().steps == 101 && p::faults_of(rig.state()) == 1, "kept");
  check(p::logged(rig.law.state, 0).fault.fault == F::stopped, "with its log");
  Rig other;
  Rules bad = rules();
  bad.whole.reset_delay = -1;
  check(!p::configure(other.law, law_params(), bad) && other.mode() == M::latched && other.fault() == F::configuration, "bad");
  check(p::fault_of(other.law.state).joint == joints, "of the whole");
  other.run(1);
  check(other.out.fault.fault == F::configuration && !other.out.enable[0] && other.out.mode == M::latched, "nothing");
  check(p::configure(other.law, law_params(), rules()) && other.mode() == M::running, "better");
  for (const std::uint32_t bits : {4u, 3u}) {
    Rig broken;
    broken.run(10);
    broken.state().doing.word ^= bits;
    p::configure(broken.law, law_params(), rules());
    check(broken.mode() == M::latched && broken.fault() == F::integrity, "a broken mode");
    check(p::fault_of(broken.law.state).joint == joints, "of the whole");
  }
  Rig lost;
  lost.run(20);
  lost.law.supervisor.valid = 0;
  lost.run(1);
  check(lost.out.command.effort[0] == 0 && lost.out.fault.fault == F::integrity && !lost.out.enable[0], "at once");
  check(lost.out.mode == M::latched && lost.out.challenge == 0, "and latched");
  Rig past;
  p::stop(past.law);
  past.run(1);
  past.state().alive.twin ^= 1u;
  p::configure(past.law, law_params(), rules());
  check(past.mode() == M::latched && past.fault() == F::stopped && p::faults_of(past.state()) == 1, "a lost bit forgets nothing");
  p::put(past.state().alive, 5);
  p::configure(past.law, law_params(), rules());
  check(past.state().steps == 0, "nor where it is another's");
}

void memory() {
  Supervised fresh;
  const auto out = p::step(fresh, Samples{}, Feedback{}, 0);
  check(out.fault.fault == F::not_started && out.mode == M::latched && !out.enable[0] && out.beat == 1, "not started");
  Rig another;
  another.run(20);
  p::put(another.state().alive, 5);
  another.run(1);
  check(another.out.fault.fault == F::not_started && another.out.mode == M::latched, "another's memory");
  for (int what = 0; what < 5; ++what) {
    Rig rig;
    rig.run(20);
    if (what == 0) rig.state().alive.word ^= 1u;
    if (what == 1) rig.state().alive.twin ^= 1u;
    if (what == 2) rig.state().doing.word ^= 1u;
    if (what == 3) rig.state().doing.twin ^= 256u;
    if (what == 4) p::put(rig.state().doing, 6u);
    rig.run(1);
    check(rig.out.fault.fault == F::integrity && rig.out.fault.joint == joints && !rig.out.enable[1], "lost");
    check(p::is_whole(rig.state().alive) && p::faults_of(rig.state()) == 1, "written down");
  }
  // By turns: the law's numbers in every fourth period, the supervisor's in another.
  Rig turns;
  for (std::uint32_t k = 1; k <= 12; ++k) {
    const std::uint32_t law = turns.state().law_sum.next, own = turns.state().own_sum.next;
    turns.run(1);
    check((turns.state().law_sum.next != law) == (k % 4 == 2) && (turns.state().own_sum.next != own) == (k % 4 == 0), "turns");
  }
  for (const bool law : {true, false}) {
    Rig rig;
    rig.run(4);
    if (law) rig.law.controller.law.joint[2].params.friction_share = 0.81;
    else rig.law.supervisor.joint[2].params.rest_speed = 900;
    int k = 0;
    for (; k < 9000 && rig.out.fault.fault == F::none; ++k) rig.run(1);
    const int words = static_cast<int>((law ? sizeof rig.law.controller.law : sizeof rig.law.supervisor) / 4);
    check(rig.out.fault.fault == F::integrity && !rig.out.enable[0] && k <= 8 * ((words + 7) / 8), "found in time");
  }
  // What the law remembers between its periods, whichever word of it, is found before the law uses it.
  Rig remembers;
  remembers.run(20);
  constexpr std::size_t words = sizeof remembers.law.controller.state / 4;
  for (std::size_t at = 0; at < words; ++at) {
    Rig rig(remembers);
    auto* word = reinterpret_cast<unsigned char*>(&rig.law.controller.state) + 4 * at;
    word[at % 4] = static_cast<unsigned char>(word[at % 4] ^ (1u << at % 8));
    rig.run(1);
    check(rig.out.fault.fault == F::integrity && rig.out.fault.joint == joints && rig.out.mode >= M::zero, "remembered");
    for (const bool on : rig.out.enable) check(!on, "no power");
  }
  remembers.run(9000);
  check(remembers.mode() == M::running && p::faults_of(remembers.state()) == 0, "no alarm of its own");
  // Who may change it does, and hides nothing that was lost before.
  Rig changed;
  changed.run(20);
  p::change_memory(changed.law, [](auto& state) { state.weight[0] += 1; });
  changed.run(1);
  check(changed.mode() == M::running, "changed on purpose");
  changed.law.controller.state.gate.position[0] += 1;
  p::change_memory(changed.law, [](auto& state) { state.weight[0] += 1; });
  changed.run(1);
  check(changed.out.fault.fault == F::integrity, "lost before it was changed");
}

// --- watches ---------------------------------------------------------------------------------------------------------

/// Raw power is the sum of the last efforts times raw velocities, in every period.
void power() {
  Rules r = rules();
  r.whole.power = 8;
  for (const S way : {-1.0, 1.0})
    for (const S turn : {-1.0, 1.0}) {
      Rig rig(r);
      rig.speed[0] = turn, rig.speed[1] = turn * 2, rig.speed[2] = turn * 3;
      rig.settles();
      for (const std::uint32_t steps : {0u, 1u, 2u, 3u}) {
        rig.state().output[0] = way, rig.state().output[1] = way * 0.5, rig.state().output[2] = way * 2;
        check(rig.seen(steps).fault == F::none, "at the limit, given or taken");
        rig.state().output[2] = way * (2 + more);
        const auto found = rig.seen(steps);
        check(found.fault == F::power && found.joint == joints, "beyond");
        rig.state().output[0] = way * 4, rig.state().output[1] = way * -2;
        rig.state().output[2] = 0;
        check(rig.seen(steps).fault == F::none, "what one gives another takes");
      }
      rig.state().output[0] = nan;
      check(rig.seen(0).fault == F::power, "no number is beyond");
    }
}

/// A bit that is lost of what says whether a joint is in doubt, or its drive without power, stops all, and that one counts.
void bits_of_a_doubt() {
  for (std::size_t k = 0; k < joints; ++k)
    for (const bool released : {false, true})
      for (const bool twin : {false, true})
        for (const std::uint32_t bit : {1u, 0x40000000u}) {
          Rig rig;
          rig.run(4);
          p::TwinWord& lost = released ? rig.state().joint[k].released : rig.state().joint[k].doubted;
          (twin ? lost.twin : lost.word) ^= bit;
          rig.run(1);
          check(rig.fault() == F::integrity && p::fault_of(rig.law.state).joint == k, "found at once");
          check(p::is_whole(lost) && lost.word == 1u, "the safer of both");
          for (std::size_t j = 0; j < joints; ++j) {
            check(p::is_whole(rig.state().joint[j].doubted) && p::is_whole(rig.state().joint[j].released), "whole");
            check((rig.state().joint[j].doubted.word != 0) == (j == k && !released), "only what was lost is in doubt");
          }
          check(!rig.out.enable[k], "no power");
          const std::uint32_t faults = p::faults_of(rig.state());
          (twin ? lost.twin : lost.word) ^= bit;
          rig.run(1);
          check(p::faults_of(rig.state()) == faults && p::is_whole(lost), "mended in a stop, too");
        }
}

/// Encoders and drives, joint by joint, in every period; a joint in doubt is noted, and the first fault is named.
void encoders_and_drives() {
  for (std::size_t k = 0; k < joints; ++k)
    for (const S way : {-1.0, 1.0}) {
      Rules r = rules();
      r.joint[k].encoder.speed_limit = 4;
      Rig rig(r);
      rig.settles();
      rig.speed[k] = way * 4;
      check(rig.seen(0).fault == F::none, "at the limit");
      rig.speed[k] = way * (4 + more);
      auto found = rig.seen(0);
      check(found.fault == F::overspeed && found.joint == k && rig.state().joint[k].doubted.word == 0, "too fast");
      rig.speed[k] = 0;
      rig.in.position[k].value = 0;
      r = rules();
      r.joint[k].encoder.range_min = -0.5, r.joint[k].encoder.range_max = 0.5;
      Rig out(r);
      out.settles();
      out.place[k] = way;
      found = out.seen(0);
      check(found.fault == F::range && found.joint == k && out.state().joint[k].doubted.word == 1, "out of range is in doubt");
      check(out.state().joint[(k + 1) % joints].doubted.word == 0, "that joint alone");
      // A drive that measures, and one that does not.
      r = rules();
      r.joint[k].drive.expected = 1;
      r.joint[k].drive.tolerance = 0.5;
      r.joint[k].drive.cycles = 2;
      Rig drive(r);
      drive.settles();
      for (std::size_t j = 0; j < joints; ++j) {
        Rig one = drive;
        p::TreeFault said;
        for (int i = 0; i < 3 && said.fault == F::none; ++i) {
          one.state().steps = 0;
          one.read();
          one.back.drive[j].value = way * 3;
          said = p::observe(one.law, one.in, one.back);
        }
        check(said.fault == (j == k ? F::drive_stuck : F::none) && (j != k || said.joint == k), "a drive");
        check(one.state().joint[j].doubted.word == (j == k ? 1u : 0u), "in doubt");
        one = drive;
        for (int i = 0; i < 2; ++i) {
          one.read();
          one.back.drive[j].valid = false;
          said = p::observe(one.law, one.in, one.back);
        }
        check(said.fault == (j == k ? F::drive_silent : F::none), "a silent one");
      }
    }
  // Two at once: both are in doubt.
  Rules r = rules();
  for (auto& one : r.joint) one.encoder.range_min = -0.5, one.encoder.range_max = 0.5;
  Rig both(r);
  both.settles();
  both.place[1] = both.place[2] = 1;
  check(both.seen(0).joint == 1 && both.state().joint[1].doubted.word == 1 && both.state().joint[2].doubted.word == 1, "both");
}

/// A drive's surplus is of its motor's own way: motors that turn with several joints go by T v.
void coupled_motors() {
  auto params = law_params();
  params.drives.coupled = true;
  for (auto& motor : params.drives.motor) motor.friction.velocity_width = 0.05;
  for (std::size_t i = 0; i < joints; ++i) params.drives.turns[i][i] = 1;
  params.drives.turns[1][1] = 2;
  params.drives.turns[2][1] = 1;
  Rules r = rules();
  for (auto& one : r.joint) one.drive.expected = 1, one.drive.surplus = 100;
  Rig rig(r, params);
  rig.speed[1] = 8;
  rig.settles();
  rig.read();
  for (auto& one : rig.back.drive) one.value = 64;
  for (auto& one : rig.state().joint) one.drive.surplus = 0;
  p::observe(rig.law, rig.in, rig.back);
  check_close(rig.state().joint[0].drive.surplus, 0.0, 1e-12, "a motor that does not turn");
  check_close(rig.state().joint[1].drive.surplus, 64 * 2 * 8 * period, 1e-12, "geared");
  check_close(rig.state().joint[2].drive.surplus, 64 * 8 * period, 1e-12, "turned by another joint");
  // Power of a motor that turns with a joint in doubt is off, and of no other.
  rig.run(4);
  check(rig.out.enable[0] && rig.out.enable[1] && rig.out.enable[2], "all on");
  for (std::size_t doubted = 0; doubted < joints; ++doubted) {
    Rig one = rig;
    one.read();
    one.in.position[doubted].value = nan;
    one.step();
    check(one.mode() == M::damped_stop, "held");
    for (std::size_t i = 0; i < joints; ++i) {
      const bool turns = params.drives.turns[i][doubted] != 0;
      check(one.out.enable[i] == !turns && (!turns || one.out.command.drive[i] == 0), "power");
    }
  }
}

/// Push, power, energy, ringing and what nobody gives, joint by joint, where and when they are looked at.
void slow_watches() {
  for (std::size_t k = 0; k < joints; ++k)
    for (const S way : {-1.0, 1.0}) {
      Rules r = rules();
      r.joint[k].budget.push_limit = 2;
      auto params = law_params();
      params.drives.joint[k].offset = 0.25;
      Rig push(r, params);
      push.settles();
      push.law.controller.state.weight[k] = 3;
      push.state().output[k] = 3.25 + way * 2;
      for (const std::uint32_t steps : {1u, 3u}) check(push.seen(steps).fault == F::none, "at the limit");
      push.state().output[k] = 3.25 + way * (2 + more);
      check(push.seen(0).fault == F::none && push.seen(2).fault == F::none, "not looked at");
      const auto found = push.seen(1);
      check(found.fault == F::push && found.joint == k && push.state().joint[k].doubted.word == 0, "beyond");
      r = rules();
      r.joint[k].budget.store = 1;
      Rig energy(r);
      energy.speed[k] = way * 2;
      energy.settles();
      energy.state().output[k] = way * 3;
      check(energy.seen(1).fault == F::none && energy.state().joint[k].budget.spent == 2 * period * 6, "of two periods");
      energy.state().joint[k].budget.spent = 1;
      check(energy.seen(1).fault == F::energy, "beyond the store");
      r = rules();
      r.joint[k].ringing.limit = 0.015625;
      for (std::uint32_t steps = 0; steps < 4; ++steps) {
        Rig rings(r);
        rings.settles();
        rings.state().joint[k].ringing.size = 9;
        check((rings.seen(steps).fault == F::ringing) == (steps == 3), "every fourth period");
        p::go(rings.state(), M::start_up, {});
        check(rings.seen(steps).fault == F::none, "not while the start-up test moves the joint");
      }
      r = rules();
      r.joint[k].outside_limit = 2;
      params = law_params();
      params.drives.joint[k].friction.coulomb_positive = 0.5;
      params.drives.joint[k].friction.coulomb_negative = 0.25;
      params.drives.joint[k].friction.load_motoring = 0.25;
      Rig outside(r, params);
      outside.settles();
      for (const S weight : {-1.0, 1.0}) {
        outside.law.controller.state.weight[k] = outside.state().output[k] = weight;
        outside.law.controller.state.observer.residual[k] = way * 2.75;
        check(outside.seen(1).fault == F::none, "at the limit beyond friction");
        outside.law.controller.state.observer.residual[k] = way * (2.75 + more);
        check(outside.seen(0).fault == F::none && outside.seen(1).fault == F::unexplained, "beyond");
        check(outside.state().joint[k].doubted.word == 1, "its drive is in doubt");
      }
      // The budget's friction: what is known at rest under the load, or what is there at this velocity.
      r = rules();
      r.joint[k].budget.push_limit = 2;
      Rig drag(r, params);
      drag.settles();
      drag.state().output[k] = way * 2.5;
      check(drag.seen(1).fault == F::none, "at rest");
      drag.state().output[k] = way * (2.5 + more);
      check(drag.seen(1).fault == F::push, "and beyond");
      params.drives.joint[k].friction.viscous_positive = params.drives.joint[k].friction.viscous_negative = 0.5;
      params.drives.joint[k].friction.coulomb_negative = 0.5;
      Rig fast(r, params);
      fast.speed[k] = way * 2;
      fast.settles();
      fast.state().output[k] = way * 3.5;
      check(fast.seen(1).fault == F::none, "in motion");
      fast.state().output[k] = way * (3.5 + more);
      check(fast.seen(1).fault == F::push, "and beyond");
    }
}

/// A second encoder beside the motor's: by how much they may differ, and that it must speak.
void second_encoders() {
  for (std::size_t k = 0; k < joints; ++k)
    for (const S way : {-1.0, 1.0}) {
      Rules r = rules();
      r.joint[k].joint_expected = 1;
      r.joint[k].joint_tolerance = 0.5;
      Rig rig(r);
      const auto reads = [&](S apart, bool valid = true) {
        rig.read();
        rig.state().steps = 0;
        rig.back.joint[k] = {rig.place[k] + apart, rig.now, rig.count, valid};
        return p::observe(rig.law, rig.in, rig.back);
      };
      check(reads(0.25).fault == F::none, "wherever it begins");
      check(reads(0.25 + way * 0.5).fault == F::none, "at the tolerance");
      const auto found = reads(0.25 + way * (0.5 + more));
      check(found.fault == F::disagreement && found.joint == k && rig.state().joint[k].doubted.word == 1, "beyond");
      check(reads(0.25).fault == F::none && rig.state().joint[k].joint_silent == 0, "together again");
      for (std::uint32_t i = 0; i < 4; ++i) check(reads(0, false).fault == F::none, "silent for a while");
      check(reads(0, false).fault == F::disagreement, "and for longer");
      p::TreeFault other;
      Rig none;
      for (int i = 0; i < 9; ++i) other = none.seen(0);
      check(other.fault == F::none, "one that there is not is not asked for");
    }
}

/// A drive that answers late is found by its delay, in odd periods alone.
void late_drives() {
  for (std::size_t k = 0; k < joints; ++k) {
    Rules r = rules();
    for (auto& one : r.joint) one.drive.expected = 1;
    r.joint[k].delay = {0.008, 1, 60, 0.5};
    for (const std::uint32_t parity : {0u, 1u}) {
      Rig rig(r);
      bool late = false;
      S asked[32]{};
      for (std::uint32_t i = 0; i < 4000; ++i) {
        rig.state().steps = 2 * i + parity;
        rig.read();
        const S t = 2 * period * i;
        asked[i % 32] = 3 * p::sin(3 * t) + p::sin(7 * t);
        for (std::size_t j = 0; j < joints; ++j) {
          rig.state().joint[j].drive.asked = asked[i % 32];
          rig.state().joint[j].drive.asked_before = asked[i % 32];
          rig.back.drive[j].value = asked[(i + 24) % 32];
        }
        const auto found = p::observe(rig.law, rig.in, rig.back);
        late = late || found.fault == F::drive_effort;
        check(found.fault == F::none || found.joint == k, "of that joint");
      }
      check(late == (parity == 1), "16 ms late");
      const S seen = rig.state().joint[k].delay.count;
      rig.state().steps = 1;
      p::observe(rig.law, rig.in, rig.back);
      check(rig.state().joint[k].delay.count == seen, "an answer that was seen before says nothing");
    }
  }
}

/// A law with feedback of force sensors whose residual and feeling are set by hand, judged once.
struct Judged {
  Rig rig;
  Judged(const Rules& r, const Law::Params& params = law_params()) : rig(r, params) {
    rig.settles();
    rig.state().steps = 2;
    for (auto& one : rig.state().joint) one.motion.settled = 1;
  }
  M mode() { return p::mode_of(rig.state()); }
  p::TreeFault fault() { return p::fault_of(rig.state()); }
  void judge(int n = 1) {
    for (int i = 0; i < n; ++i) p::judge_sensors(rig.law, rig.in);
  }
};

void contradictions() {
  // Of two joints whose sensors lie the first is named.
  {
    Rules r = rules();
    r.joint[0].motion.tolerance = r.joint[2].motion.tolerance = 1;
    Judged two(r);
    auto& law = two.rig.law.controller.state;
    law.sensed[0] = law.sensed[2] = true;
    law.felt[0] = law.felt[2] = 1.0078125;
    two.judge(5000);
    check(two.fault().fault == F::force_sensor && two.fault().joint == 0, "the first of two");
  }
  for (std::size_t k = 0; k < joints; ++k)
    for (const S way : {-1.0, 1.0})
      for (int who = 0; who < 4; ++who) {
        Rules r = rules();
        r.whole.degrades = who & 1, r.whole.trusts_motion = static_cast<std::uint32_t>(who >> 1);
        r.joint[k].motion.tolerance = 1;
        Judged one(r);
        auto& law = one.rig.law.controller.state;
        law.sensed[k] = true;
        law.felt[k] = way * 1.0078125;
        one.judge(200);
        check(one.mode() == M::running, "not yet");
        one.judge(4000);
        check(one.mode() == (who == 3 ? M::degraded : M::damped_stop), "left out only where the motion is trusted");
        check(one.fault().fault == F::force_sensor && one.fault().joint == k, "by its name");
        check(one.rig.state().joint[k].doubted.word == 0, "its drive is not in doubt");
        law.felt[k] = way * 0.99;
        Judged within(r);
        within.rig.law.controller.state.sensed[k] = true;
        within.rig.law.controller.state.felt[k] = way * 0.99;
        within.judge(9000);
        check(within.mode() == M::running, "within");
        // What nobody gives is no sensor's fault, and stops a degraded law as well.
        r.joint[k].motion.wearer_torque = 2;
        Judged lasts(r);
        lasts.rig.law.controller.state.observer.residual[k] = way * 2.03125;
        if (who == 3) p::go(lasts.rig.state(), M::degraded, {F::lost, 0});
        lasts.judge(6000);
        check(lasts.fault().fault == F::unexplained && lasts.fault().joint == k, "what lasts");
        check(lasts.rig.state().joint[k].doubted.word == 1 && lasts.mode() == M::damped_stop, "in doubt");
      }
  // Loudness is summed over joints.
  Rules r = rules();
  r.whole.force_excess = 0.5;
  r.whole.degrades = r.whole.trusts_motion = 1;
  Judged loud(r);
  for (auto& one : loud.rig.state().joint) one.motion.loudness = 0.1666;
  loud.judge();
  check(loud.mode() == M::running, "together within");
  for (auto& one : loud.rig.state().joint) one.motion.loudness = 0.18;
  loud.judge();
  check(loud.mode() == M::degraded && loud.fault().fault == F::force_sensor && loud.fault().joint == joints, "and beyond");
  // Friction leaves open what it may be: at rest all of it.
  auto params = law_params();
  for (auto& one : params.drives.joint) one.friction.coulomb_positive = one.friction.coulomb_negative = 1;
  r = rules();
  r.joint[1].motion.tolerance = r.joint[1].motion.burst = 1;
  for (const S speed : {0.0, 4.0, -4.0}) {
    Judged open(r, params);
    open.rig.state().joint[1].encoder.velocity = speed;
    open.rig.law.controller.state.sensed[1] = true;
    open.rig.law.controller.state.felt[1] = 1.75;
    open.judge(9000);
    check((open.mode() == M::running) == (speed == 0), "less in motion");
  }
}

/// Sensors by themselves: range, silence, and a word that does not change in motion.
void sensors_alone() {
  for (std::size_t k = 0; k < joints; ++k)
    for (const S way : {-1.0, 1.0})
      for (const std::uint32_t degrades : {0u, 1u})
        for (const bool muscle : {false, true}) {
          Rules r = rules();
          r.whole.degrades = degrades;
          (muscle ? r.joint[k].muscle : r.joint[k].force) = {1, 6, 4};
          const auto read = [&](Judged& one, S value, bool valid) {
            (muscle ? one.rig.in.muscle : one.rig.in.interaction)[k] = {value, one.rig.now, 1, valid};
          };
          const M stopped = degrades != 0 ? M::degraded : M::damped_stop;
          Judged one(r);
          read(one, way * 4, true);
          one.judge(9);
          check(one.mode() == M::running, "within its range, at rest");
          read(one, way * (4 + more), true);
          one.judge();
          check(one.mode() == stopped && one.fault().fault == (muscle ? F::muscle : F::force_sensor), "beyond");
          check(one.fault().joint == k, "of that joint");
          Judged silent(r);
          read(silent, 0, false);
          silent.judge(2);
          check(silent.mode() == M::running, "not yet");
          silent.judge();
          check(silent.mode() == stopped && silent.fault().fault == F::lost && silent.fault().joint == k, "silent");
          Judged same(r);
          same.rig.state().joint[k].encoder.velocity = way * 0.25;
          read(same, 1, true);
          same.judge(4);
          check((same.mode() == M::running) == muscle, "the same in motion: a force sensor's");
          Judged rests(r);
          rests.rig.state().joint[k].encoder.velocity = way * 0.1875;
          rests.rig.state().joint[(k + 1) % joints].encoder.velocity = 9;
          read(rests, 1, true);
          rests.judge(9);
          check(rests.mode() == M::running, "the same at rest, another joint moves");
        }
  // The sensor on a link.
  for (int axis = 0; axis < 6; ++axis)
    for (const S way : {-1.0, 1.0}) {
      Rules r = rules();
      r.whole.degrades = r.whole.wrench_expected = 1;
      r.whole.wrench_quiet = 6;
      r.whole.wrench_force = 8;
      r.whole.wrench_moment = 2;
      const auto at = [axis](p::WrenchSample<S>& w, S value) {
        S* const each[] = {&w.force.x, &w.force.y, &w.force.z, &w.moment.x, &w.moment.y, &w.moment.z};
        *each[axis] = value;
      };
      const S range = axis < 3 ? 8 : 2;
      Judged one(r);
      one.rig.in.wrench.valid = true;
      at(one.rig.in.wrench, way * range);
      one.judge();
      check(one.mode() == M::running, "within its range");
      at(one.rig.in.wrench, way * (range + more));
      one.judge();
      check(one.mode() == M::degraded && one.fault().fault == F::force_sensor && one.fault().joint == joints, "beyond");
      Judged still(r);
      still.rig.in.wrench.valid = true;
      still.judge(9);
      check(still.mode() == M::running, "the same at rest");
      still.rig.state().joint[2].encoder.velocity = way;
      still.judge(2);
      at(still.rig.in.wrench, way);
      still.judge(1);
      check(still.mode() == M::running && still.rig.state().wrench_quiet == 0, "any of six that changes is a word");
      still.judge(3);
      check(still.mode() == M::degraded && still.fault().fault == F::lost, "the same in motion");
      Judged silent(r);
      silent.judge(2);
      check(silent.mode() == M::running, "not yet");
      silent.judge();
      check(silent.mode() == M::degraded && silent.fault().fault == F::lost && silent.fault().joint == joints, "silent");
      r.whole.wrench_expected = 0;
      Judged none(r);
      none.judge(99);
      check(none.mode() == M::running, "not asked for");
    }
}

/// Without its sensors the law goes on, with its efforts as they are without any.
void degraded() {
  auto params = law_params();
  for (auto& one : params.joint) one.feedback.proportional = 2, one.feedback.limit = 5;
  Rules r = rules();
  r.whole.degrades = 1;
  for (auto& one : r.joint) one.force = {1, 6, 4};
  Rig rig(r, params);
  const auto runs = [&](int n, S felt) {
    for (int i = 0; i < n; ++i) {
      rig.read();
      for (std::size_t k = 0; k < joints; ++k) rig.in.interaction[k] = {felt, rig.now, rig.count, true};
      rig.step();
    }
  };
  runs(40, 1);
  check(rig.out.mode == M::running && rig.out.command.effort[1] > 0.5, "it feels");
  runs(2, 5);
  check(rig.out.mode == M::degraded && rig.out.fault.fault == F::force_sensor && rig.out.challenge == 0, "no more");
  check(rig.out.enable[0] && rig.out.enable[1] && rig.out.enable[2], "with power");
  runs(60, 1);
  check(rig.out.mode == M::degraded && std::fabs(rig.out.command.effort[1]) < 0.05, "and goes on without");
  check(!rig.law.controller.state.sensed[1] && p::faults_of(rig.state()) == 1, "nothing more is found of it");
}

/// The wave of one joint after the other: polarity and gain, by work.
void start_up() {
  const auto tests = [](Rules& r, std::initializer_list<std::size_t> which) {
    for (const std::size_t k : which) r.joint[k].test = {0.5, 16, 32, 0.0001, 0.001};
  };
  // What each joint does: a body of its own that answers the drive's effort, times a factor.
  const auto lives = [&](std::initializer_list<std::size_t> which, std::size_t odd, S factor, Rig& rig, int n) {
    S speed[joints]{};
    std::uint32_t waves = 0;
    (void)which;
    for (int i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < joints; ++k) {
        const S given = rig.out.command.drive[k] * (k == odd ? factor : 1);
        speed[k] = rig.out.enable[k] ? 0.98 * speed[k] + period * given / 0.03 : 0.98 * speed[k];
        rig.speed[k] = speed[k];
      }
      rig.run(1);
      if (rig.out.mode == M::start_up) {
        std::uint32_t moved = 0;
        for (std::size_t k = 0; k < joints; ++k) moved += rig.out.command.effort[k] != 0;
        check(moved <= 1, "one joint at a time");
        waves += moved;
      }
    }
    return waves;
  };
  for (std::size_t odd = 0; odd < joints; ++odd) {
    Rules r = rules();
    tests(r, {0, 2});
    Rig right(r);
    check(right.mode() == M::start_up && right.fault() == F::none, "begins with its test");
    const std::uint32_t waves = lives({0, 2}, odd, 1, right, 400);
    check(right.mode() == M::running && right.fault() == F::none, "and runs");
    check(waves >= 2 * 28 && waves <= 2 * 40, "two waves");
    for (const S factor : {-1.0, 3.0}) {
      Rig wrong(r);
      lives({0, 2}, odd, factor, wrong, 1200);
      if (odd == 1) {
        check(wrong.mode() == M::running, "a joint without a test is not tested");
        continue;
      }
      check(wrong.fault() == (factor < 0 ? F::polarity : F::gain), "what is wrong");
      check(p::fault_of(wrong.law.state).joint == odd && wrong.mode() == M::latched && !wrong.out.enable[1], "and off");
    }
  }
  Rules r = rules();
  tests(r, {1});
  Rig moving(r);
  moving.speed[1] = 0.5;
  moving.run(300);
  check(moving.mode() == M::start_up && moving.out.command.effort[1] == 0, "waits for rest");
  moving.speed[1] = 0;
  p::stop(moving.law);
  moving.run(3);
  check(p::is_stopped(moving.mode()), "a stop is a stop");
  const std::uint32_t challenge = moving.out.challenge;
  for (int i = 0; i < 90 && moving.mode() != M::start_up; ++i) {
    moving.back.token = challenge;
    moving.run(1);
  }
  check(moving.mode() == M::start_up && moving.state().tested == 1, "and a reset is followed by the test");
  refused([](Rules& bad) { bad.joint[2].test.samples = 4; }, "a wave that is none");
  refused([](Rules& bad) { bad.joint[2].motion.slow = -1; }, "a watch that is none");
  refused([](Rules& bad) { bad.joint[2].delay.forget = -1; }, "nor this one");
  for (std::size_t k = 0; k < joints; ++k) {
    refused([k](Rules& bad) { bad.joint[k].motion.slow = 600; }, "means that are faster than their periods");
    refused([k](Rules& bad) { bad.joint[k].delay.smoothing = 600; }, "of the drive's delay, too");
    // The first joint from another on that has a test, of as many as there are.
    Rules some = rules();
    some.joint[k].test = {0.5, 16, 32, 0.0001, 0.001};
    const auto c = p::coefficients(some, p::coefficients(law_params()));
    for (std::size_t from = 0; from <= joints; ++from)
      for (std::size_t many = from; many <= joints; ++many)
        check(p::next_tested(c, many, from) == (k >= from && k < many ? k : many), "the next one");
  }
}

/// The change of a position while its encoder was silent, of whichever joints, is no velocity that then freezes.
void resets_after_a_gap() {
  Rules r = rules();
  for (auto& one : r.joint) one.encoder.freeze_speed = 0.5;
  for (const bool repeats : {false, true}) {
    for (const std::size_t silent : {std::size_t{1}, joints}) {
      Rig rig(r);
      rig.run(100);
      const Samples last = rig.in;
      for (int i = 0; i < 200; ++i) {
        rig.read();
        for (std::size_t k = 0; k < joints; ++k) {
          if (silent != joints && k != silent) continue;
          if (repeats) rig.in.position[k] = last.position[k];
          else rig.in.position[k].valid = false;
        }
        rig.step();
      }
      check(p::is_stopped(rig.mode()), "a silent encoder stops");
      for (std::size_t k = 0; k < joints; ++k)
        if (silent == joints || k == silent) rig.place[k] -= 0.3;
      rig.run(40);
      rig.back.token = rig.out.challenge;
      rig.run(40);
      check(rig.mode() == M::running, "at rest it can be reset");
    }
  }
}

/// Each drive is held to what it read at its commissioning.
void knows_the_drives_answers() {
  Rules r = rules();
  for (auto& one : r.joint) one.drive.expected = 1, one.drive.tolerance = 0.5, one.drive.answer = 1.5;
  for (const S reads : {1.5, 1.0}) {
    Rig rig(r);
    rig.run(10);
    for (auto& one : rig.state().joint) one.drive.asked = one.drive.asked_before = one.drive.due = 4;
    rig.read();
    for (auto& drive : rig.back.drive) drive.value = reads * 4;
    p::observe(rig.law, rig.in, rig.back);
    for (const auto& one : rig.state().joint) check((one.drive.outside == 0) == (reads == 1.5), "as it then read");
  }
}

/// A wave at start-up stays within its joint's limits of effort and rate, whatever is left of other efforts.
void waves_within_limits() {
  Rules r = rules();
  for (auto& one : r.joint) one.rest_speed = never;
  r.joint[1].test = {40, 16, 4, 0, never};
  Rig rig(r);
  rig.state().output[0] = 3;
  S last = 0, most = 0, least = 0;
  for (int k = 0; k < 30 && rig.mode() == M::start_up; ++k) {
    rig.run(1);
    const S now = rig.state().output[1];
    check(std::fabs(now - last) <= 0.5, "within the rate, up and down");
    most = std::fmax(most, now), least = std::fmin(least, now), last = now;
    check(rig.state().joint[1].test.pushed == now, "of what was given");
    check(rig.state().joint[0].test.pushed == 0 && rig.state().joint[2].test.pushed == 0, "no other joint is tested");
    if (k == 0) check(rig.state().output[0] == 2.5, "what is left of others fades");
  }
  check(most > 3, "a wave");
  auto fast = law_params();
  for (auto& one : fast.joint) one.gate.rate_limit = 1e6;
  Rig limited(r, fast);
  most = least = 0;
  for (int k = 0; k < 40 && limited.mode() == M::start_up; ++k) {
    limited.run(1);
    most = std::fmax(most, limited.state().output[1]), least = std::fmin(least, limited.state().output[1]);
  }
  check(most == 10 && least == -10, "at most the limit, both ways");
  // A turn that memory lost begins with the first joint.
  for (const std::uint32_t lost : {3u, 4u, 5u, 6u, 0xffffffffu}) {
    Rules all = rules();
    for (auto& one : all.joint) one.test = {0.5, 16, 4, 0, never}, one.rest_speed = never;
    Rig turns(all);
    turns.state().tested = lost;
    turns.run(12);
    check(turns.mode() == M::start_up && turns.state().joint[0].test.count > 0, "the first");
  }
}

/// Memory that is lost while it is stopped is written down once, and takes the token back.
void lost_while_stopped() {
  for (const M mode : {M::damped_stop, M::zero, M::latched}) {
    Rig rig;
    rig.run(5);
    p::enter(rig.state(), {F::stopped, 0}, mode);
    const std::uint32_t challenge = rig.state().challenge.word, faults = p::faults_of(rig.state());
    p::lose_trust(rig.law);
    check(rig.mode() == (mode == M::latched ? M::latched : M::zero) && rig.fault() == F::stopped, "no power; the first fault stays");
    check(p::faults_of(rig.state()) == faults + 1 && p::logged(rig.law.state, 0).fault.fault == F::integrity, "written down");
    check(rig.state().challenge.word != challenge, "another token");
  }
  // What counts is lost in a hold, or all numbers are: it holds no more, and only the first is news.
  Rig bounds;
  bounds.run(20);
  p::stop(bounds.law);
  bounds.run(2);
  check(bounds.mode() == M::damped_stop, "held");
  bounds.law.controller.law.gate.joints = 77;
  bounds.run(1);
  check(bounds.mode() == M::latched && p::logged(bounds.law.state, 0).fault.fault == F::integrity, "it holds no more");
  Rig numbers;
  numbers.run(20);
  p::stop(numbers.law);
  numbers.run(2);
  numbers.law.supervisor.valid = 0;
  const std::uint32_t faults = p::faults_of(numbers.state());
  numbers.run(1);
  check(p::faults_of(numbers.state()) == faults && numbers.out.mode == M::latched && numbers.out.challenge == 0, "nothing is left to say");
  for (const S effort : numbers.out.command.effort) check(effort == 0, "and nothing is given");
  // What a law remembers does not matter while it is stopped.
  Rig holds;
  holds.run(20);
  p::stop(holds.law);
  holds.run(2);
  holds.law.controller.state.weight[0] += 1;
  holds.run(3);
  check(holds.mode() == M::damped_stop && p::faults_of(holds.state()) == 1, "a hold goes on");
}

/// A mode that there is not is a fault at a start, too; memory that was never configured has no past; a stop is heard
/// once the numbers make sense.
void starts_of_broken_memory() {
  for (const std::uint32_t word : {6u, 7u, 255u}) {
    Rig broken;
    broken.run(10);
    p::put(broken.state().doing, word);
    p::configure(broken.law, law_params(), rules());
    check(broken.mode() == M::latched && broken.fault() == F::integrity, "no such mode");
  }
  for (const bool twin : {false, true}) {
    Rig runs;
    runs.run(5);
    (twin ? runs.state().alive.twin : runs.state().alive.word) ^= 16u;
    p::configure(runs.law, law_params(), rules());
    check(runs.mode() == M::latched && runs.fault() == F::integrity && p::faults_of(runs.state()) == 1, "a lost bit is a fault");
  }
  for (const bool whole : {false, true})
    for (const M mode : modes) {
      Supervised fresh{};
      p::go(fresh.state, mode, {F::jump, 0});
      if (!whole) fresh.state.doing.twin ^= 4u;
      p::configure(fresh, law_params(), rules());
      check(p::mode_of(fresh.state) == M::running && p::faults_of(fresh.state) == 0, "runs");
    }
  Supervised early{};
  p::stop(early);
  Rules bad = rules();
  bad.whole.reset_delay = -1;
  check(!p::configure(early, law_params(), bad) && p::fault_of(early.state).fault == F::configuration, "no sense");
  check(p::configure(early, law_params(), rules()) && p::fault_of(early.state).fault == F::stopped, "the stop was not forgotten");
}

/// A word that lost a bit of what says whether a joint is in doubt, or released, is the safe answer.
void safe_answers() {
  for (std::uint32_t bit = 0; bit < 32; ++bit)
    for (const bool twin : {false, true}) {
      p::JointWatchState<S> one;
      check(!p::is_doubted(one) && !p::is_released(one), "neither");
      (twin ? one.doubted.twin : one.doubted.word) ^= 1u << bit;
      check(p::is_doubted(one) && !p::is_released(one), "in doubt");
      p::JointWatchState<S> other;
      (twin ? other.released.twin : other.released.word) ^= 1u << bit;
      check(p::is_released(other) && !p::is_doubted(other), "released");
    }
}

/// Sensors at their bounds: a speed at which a joint does not move yet, how loud all sensors together may be, a link's
/// sensor while any joint moves, and one that is not heard.
void bounds_of_sensors() {
  for (std::size_t k = 0; k < joints; ++k)
    for (const S speed : {0.25, 0.25 + more}) {
      Rules r = rules();
      r.whole.degrades = 1, r.whole.moving = 0.25;
      r.joint[k].force = {1, 6, 4};
      Judged one(r);
      one.rig.in.interaction[k] = {1, one.rig.now, 1, true};
      one.rig.state().joint[k].encoder.velocity = speed;
      one.judge(9);
      check((one.mode() == M::running) == (speed == 0.25), "at the speed it rests");
      Rules link = rules();
      link.whole.degrades = link.whole.wrench_expected = 1, link.whole.moving = 0.25, link.whole.wrench_quiet = 6;
      link.whole.wrench_force = link.whole.wrench_moment = 8;
      Judged any(link);
      any.rig.in.wrench.valid = true;
      any.rig.state().joint[k].encoder.velocity = speed;
      any.judge(9);
      check((any.mode() == M::running) == (speed == 0.25), "any joint that moves");
      Judged silent(link);
      silent.rig.in.wrench.valid = false;
      silent.rig.in.wrench.force.x = 99;
      silent.judge(2);
      check(silent.mode() == M::running, "what is not heard is beyond no range");
      silent.judge(9);
      check(silent.fault().fault == F::lost, "but silent");
    }
  // Friction under a load counts by the load's size, whichever way it pulls.
  for (const S weight : {-4.0, 4.0})
    for (const S residual : {2.5, 3.5, -2.5, -3.5}) {
      Rules motion = rules();
      motion.joint[1].motion.burst = 1;
      Judged loaded(motion);
      loaded.rig.law.supervisor.joint[1].load = 0.5;
      auto& law = loaded.rig.law.controller.state;
      law.weight[1] = weight, law.observer.residual[1] = residual, law.sensed[1] = true, law.felt[1] = 0;
      loaded.judge();
      check((loaded.fault().fault == F::force_sensor) == (std::fabs(residual) > 3), "beyond the burst and friction under the load");
    }
  // What nobody gives stops a law that goes on without its sensors, too, and nothing that is stopped already.
  for (const M mode : modes) {
    Rules motion = rules();
    motion.joint[1].motion.wearer_torque = 1;
    Judged pushed(motion);
    p::go(pushed.rig.state(), mode, {mode == M::running ? F::none : F::lost, 0});
    for (auto& one : pushed.rig.state().joint) one.motion.settled = 1;
    pushed.rig.state().joint[1].motion.lasting = 9;
    pushed.judge();
    const bool stops = mode == M::running || mode == M::degraded;
    check(p::faults_of(pushed.rig.state()) == (stops ? 1u : 0u) && (pushed.fault().fault == F::unexplained) == stops, "unexplained");
  }
  // Sensors are judged in every second period, so that their counts are of periods.
  Rules r = rules();
  r.whole.degrades = 1;
  r.joint[0].force = {1, 40, 4};
  Rig rig(r);
  int periods = 0;
  for (; periods < 200 && rig.out.mode != M::degraded; ++periods) rig.run(1);
  check(periods >= 38 && periods <= 42, "silent for as many periods as stated");
}

/// A lost bit in what counts or indexes takes the power off before it is used; sanitizers watch.
void counts() {
  const auto lost = [](auto&& change, const char* what) {
    Rig rig;
    rig.run(20);
    for (S& one : rig.state().output) one = 2;
    change(rig.law.controller.law);
    rig.run(1);
    check(rig.out.fault.fault == F::integrity && rig.out.mode == M::latched, what);
    for (std::size_t k = 0; k < joints; ++k)
      check(rig.out.command.drive[k] == 0 && rig.out.command.effort[k] == 0 && !rig.out.enable[k], what);
    check(p::faults_of(rig.state()) == 1 && rig.out.challenge != 0, "written down");
    rig.run(50);
    check(rig.out.mode == M::latched && p::faults_of(rig.state()) == 1, "and stays");
  };
  for (std::size_t bit = 0; bit < 64; ++bit) {
    lost([bit](auto& law) { law.gate.joints ^= std::size_t(1) << bit; }, "joints");
    lost([bit](auto& law) { law.tree.links ^= std::size_t(1) << bit; }, "links");
    lost([bit](auto& law) { law.tree.coordinates ^= std::size_t(1) << bit; }, "coordinates");
  }
  for (std::uint32_t bit = 2; bit < 32; ++bit) {
    lost([bit](auto& law) { law.whole.end_link = 1u << bit; }, "end");
    lost([bit](auto& law) { law.whole.sensor_link = 1u << bit; }, "sensor");
  }
  for (std::uint8_t bit = 2; bit < 8; ++bit) {
    lost([bit](auto& law) { law.tree.link[2].parent = static_cast<std::uint8_t>(1u << bit); }, "parent");
    lost([bit](auto& law) { law.tree.link[1].coordinate = static_cast<std::uint8_t>(1u << bit); }, "coordinate");
  }
  lost([](auto& law) { law.tree.link[0].on_base = false; }, "a link that is its own parent");
  // What is asked before a step, too.
  for (const std::size_t many : {std::size_t(joints + 1), ~std::size_t(0)}) {
    Rig rig;
    rig.run(20);
    rig.law.controller.law.gate.joints = many;
    rig.read();
    const Samples samples = p::believed(rig.law.controller, rig.in, rig.now);
    check(samples.position[joints - 1].valid, "no more than there is room for");
    check(p::observe(rig.law, rig.in, rig.back).fault == F::none, "nor here");
    p::stamped(rig.law, rig.in, rig.now);
    p::configure(rig.law, law_params(), rules());
    check(rig.mode() == M::running, "and configured anew");
  }
}

/// The end point's raw speed, every second period; without a limit or an end point it is not asked.
void end_point() {
  Rules r = rules();
  for (const S way : {-1.0, 1.0}) {
    r.whole.speed = 3;
    Rig rig(r);
    rig.speed[0] = way * 0.5, rig.speed[1] = way * 0.5, rig.speed[2] = way * 0.5;
    for (int k = 0; k < 4; ++k) {
      for (S& one : rig.place) one = 0;
      rig.seen(0);
    }
    const auto at = [&](S third, std::uint32_t steps) {
      for (S& one : rig.place) one = 0;
      rig.speed[0] = rig.speed[1] = rig.speed[2] = 0;
      for (S& one : rig.place) one = -way * 0.5 * period;
      rig.place[2] = -way * third * period;
      rig.seen(0);
      rig.speed[0] = way * 0.5, rig.speed[1] = way * 0.5, rig.speed[2] = way * third;
      return rig.seen(steps);
    };
    // 1.5 + 1 + third, where all places are 0.
    check(at(0.499, 1).fault == F::none && at(0.5, 1).fault == F::none, "within");
    check(at(0.501, 1).fault == F::overspeed && at(0.501, 1).joint == joints, "beyond");
    check(at(0.501, 0).fault == F::none, "every second period");
    check(at(0.499, 1).fault == F::none && at(-9, 1).fault == F::overspeed, "either way");
    r.whole.speed = never;
    Rig any(r);
    any.speed[0] = way * 1e6;
    any.settles();
    check(any.seen(1).fault == F::none, "no limit");
    auto params = law_params();
    params.whole.end_link = 0;
    r.whole.speed = 1;
    Rig none(r, params);
    none.speed[0] = way * 9;
    none.settles();
    check(none.seen(1).fault == F::none, "no end point");
    params.whole.end_link = 1;
    params.whole.end_x = 0.5;
    Rig first(r, params);
    first.speed[0] = way * 1.999, first.speed[1] = 99;
    first.settles();
    check(first.seen(1).fault == F::none, "of the first link");
    first.speed[0] = way * 2.001;
    check(first.seen(1).fault == F::overspeed, "and beyond");
  }
}

// --- stops and resets ------------------------------------------------------------------------------------------------

/// Joints that were stopped in a mode, with efforts and velocities.
struct Stopped {
  Rig rig;
  Stopped(M mode, S effort, S velocity, const Rules& r = rules()) : rig(r) {
    p::enter(rig.state(), {F::stopped, joints}, mode);
    for (std::size_t k = 0; k < joints; ++k) {
      rig.state().output[k] = effort * static_cast<S>(k + 1);
      rig.state().joint[k].encoder.velocity = velocity;
    }
  }
  void stay(bool good = true, std::uint32_t token = 0) { p::stay_stopped(rig.law, good, token); }
};

void efforts() {
  for (const S way : {-1.0, 1.0}) {
    Stopped zero(M::zero, way * 0.25, way);
    zero.stay();
    const S share = 0.5 / 0.75;
    for (std::size_t k = 0; k < joints; ++k)
      check_close(zero.rig.state().output[k], way * 0.25 * static_cast<S>(k + 1) * (1 - share), 1e-12, "together");
    check(zero.rig.mode() == M::zero, "on their way");
    zero.stay();
    check(zero.rig.state().output[0] == 0 && zero.rig.mode() == M::latched && zero.rig.fault() == F::stopped, "latched");
    Stopped latched(M::latched, way * 2, way);
    latched.stay();
    for (std::size_t k = 0; k < joints; ++k) check(latched.rig.state().output[k] == 0, "nothing at once");
    // The last joint alone still has an effort: it is not yet latched.
    Stopped last(M::zero, 0, 0);
    last.rig.state().output[2] = way * 0.75;
    last.stay();
    check(last.rig.mode() == M::zero && last.rig.state().output[2] == way * 0.25, "until the last");
    Stopped first(M::zero, 0, 0);
    first.rig.state().output[0] = way * 0.75;
    first.stay();
    check(first.rig.mode() == M::zero, "or the first");
    Stopped holds(M::damped_stop, way * 2, way * 4);
    p::put(holds.rig.state().joint[1].doubted, 1u);
    holds.stay();
    check(holds.rig.state().output[0] == way * 1.5 && holds.rig.state().output[2] == way * 5.5, "towards the hold");
    check(std::fabs(holds.rig.state().output[1]) < 4, "a joint in doubt fades");
    for (int k = 0; k < 40; ++k) holds.stay();
    check(holds.rig.state().output[0] == way * -4 && holds.rig.state().output[2] == way * -4, "to the limit of the hold");
    check(std::fabs(holds.rig.state().output[1]) < 0.05 && holds.rig.mode() == M::damped_stop, "and one in doubt fades");
    Rules strong = rules();
    for (auto& one : strong.joint) one.hold = {8, 40};
    Stopped limited(M::damped_stop, 0, way * 4, strong);
    for (int k = 0; k < 60; ++k) limited.stay();
    for (std::size_t k = 0; k < joints; ++k) check(limited.rig.state().output[k] == way * -10, "within the law's limit");
    Stopped wide(M::zero, way * 30, way);
    wide.stay();
    for (std::size_t k = 0; k < joints; ++k) check(std::fabs(wide.rig.state().output[k]) <= 10, "even where memory lost it");
    Stopped lost(M::damped_stop, nan, way);
    lost.stay();
    for (std::size_t k = 0; k < joints; ++k) check(std::fabs(lost.rig.state().output[k]) <= 0.5, "no number is nothing");
  }
}

void resets() {
  const auto period_of_reset = [](S velocity, std::size_t joint, int good_from, bool right, Rules r = rules()) {
    Stopped one(M::latched, 0, 0, r);
    one.rig.state().joint[joint].encoder.velocity = velocity;
    const std::uint32_t challenge = one.rig.state().challenge.word;
    for (int k = 1; k <= 80; ++k) {
      one.stay(k >= good_from, right ? challenge : challenge ^ 2u);
      if (one.rig.mode() == M::running) return k;
    }
    return 0;
  };
  check(period_of_reset(0, 0, 1, true) == 16 && period_of_reset(0, 0, 21, true) == 28, "delay and healthy while");
  check(period_of_reset(0, 0, 1, false) == 0, "not with another token");
  for (std::size_t k = 0; k < joints; ++k)
    for (const S way : {-1.0, 1.0}) {
      check(period_of_reset(way * 0.3, k, 1, true) == 16, "at rest");
      check(period_of_reset(way * (0.3 + more), k, 1, true) == 0, "not while any joint moves");
    }
  Rules half = rules();
  half.whole.healthy_samples = 16;
  half.whole.reset_delay = 0;
  check(period_of_reset(0, 0, 1, true, half) == 16, "all the healthy periods");
  Stopped none(M::latched, 0, 0);
  p::put(none.rig.state().challenge, 0);
  for (int k = 0; k < 50; ++k) none.stay();
  check(none.rig.mode() == M::latched, "0 is no token");
  Stopped broken(M::latched, 0, 0);
  broken.rig.state().challenge.twin ^= 1u;
  for (int k = 0; k < 50; ++k) broken.stay(true, broken.rig.state().challenge.word);
  check(broken.rig.mode() == M::latched, "a broken challenge is none");
  Stopped senseless(M::latched, 0, 0);
  senseless.rig.law.supervisor.valid = 0;
  for (int k = 0; k < 50; ++k) senseless.stay(true, senseless.rig.state().challenge.word);
  check(senseless.rig.mode() == M::latched, "without sense no reset");
  for (const bool law : {true, false}) {
    Stopped lost(M::latched, 0, 0);
    if (law) lost.rig.law.controller.law.joint[2].params.friction_share = 0.81;
    else lost.rig.law.supervisor.joint[2].params.budget.store = 900;
    for (int k = 0; k < 50; ++k) lost.stay(true, lost.rig.state().challenge.word);
    check(lost.rig.mode() == M::latched && p::logged(lost.rig.state(), 0).fault.fault == F::integrity, "nor over lost memory");
  }
  Stopped again(M::latched, 0, 0);
  again.rig.state().steps = 7;
  again.rig.law.controller.fault = {F::stale, 1};
  for (auto& one : again.rig.law.controller.state.gate.output) one = 3;
  for (auto& one : again.rig.state().joint) p::put(one.doubted, 1u), one.budget.spent = 9;
  const std::uint32_t challenge = again.rig.state().challenge.word;
  for (int k = 0; k < 16; ++k) again.stay(true, challenge);
  const State& s = again.rig.state();
  check(p::voted(s.waited).stopped == 0 && p::voted(s.waited).healthy == 0 && s.steps == 7 && p::faults_of(s) == 1, "begun again, and kept");
  check(again.rig.law.controller.fault.fault == F::none && again.rig.fault() == F::none, "without a fault");
  for (std::size_t k = 0; k < joints; ++k)
    check(s.joint[k].doubted.word == 0 && s.joint[k].budget.spent == 0 && again.rig.law.controller.state.gate.output[k] == 0, "joints");
}

/// A stop in any order with starts, faults and resets wins: it takes back the token and restarts the delay.
void stops() {
  for (const bool again : {false, true}) {
    Rig rig;
    rig.run(20);
    p::stop(rig.law);
    rig.run(1);
    const std::uint32_t token = rig.back.token = rig.out.challenge;
    rig.run(14);
    if (again) p::stop(rig.law);
    rig.run(1);
    check(rig.mode() == (again ? M::damped_stop : M::running), "a pending reset");
    if (!again) continue;
    check(rig.out.challenge != token && p::faults_of(rig.state()) == 1, "another token");
    rig.run(60);
    check(p::is_stopped(rig.mode()), "the old one is no use");
    rig.back.token = rig.out.challenge;
    rig.run(1);
    check(rig.mode() == M::running, "the new one is");
  }
  Supervised early;
  p::stop(early);
  p::configure(early, law_params(), rules());
  check(p::mode_of(early.state) == M::latched && p::fault_of(early.state).fault == F::stopped, "before a start");
  Rig between;
  between.run(20);
  p::stop(between.law);
  p::configure(between.law, law_params(), rules());
  check(between.mode() == M::latched && between.fault() == F::stopped, "between a period and a start");
}

/// While joints are held: what is in doubt of the whole, or a joint that runs away, ends the hold of all.
void doubts_in_a_hold() {
  Rules r = rules();
  for (auto& one : r.joint) one.encoder.speed_limit = 2;
  for (std::size_t joint = 0; joint < joints; ++joint)
    for (const S way : {-1.0, 1.0}) {
      const auto ends = [&](S velocity, int after) {
        Rig rig(r);
        rig.run(10);
        p::stop(rig.law);
        rig.run(after);
        check(rig.mode() == M::damped_stop && p::voted(rig.state().waited).stopped == static_cast<std::uint32_t>(after), "held");
        check(rig.out.enable[0] && rig.out.enable[1] && rig.out.enable[2] && rig.out.challenge != 0, "with power");
        rig.speed[joint] = way * velocity;
        rig.run(1);
        return rig.mode() != M::damped_stop;
      };
      check(!ends(1, 40), "slow enough");
      check(!ends(3, 20) && ends(3, 21) && !ends(3, 10), "a joint that runs away, once the hold had its time");
    }
  Rig memory(r);
  memory.run(10);
  p::stop(memory.law);
  memory.run(5);
  memory.law.controller.law.joint[0].params.friction_share = 0.5;
  memory.run(9000);
  check(memory.mode() == M::latched && !memory.out.enable[0], "memory");
  // A joint whose encoder is lost on the way is in doubt; the others are held on.
  Rig lost(r);
  lost.run(10);
  p::stop(lost.law);
  lost.run(5);
  lost.read();
  lost.in.position[1].value = nan;
  lost.step();
  check(lost.mode() == M::damped_stop && lost.out.enable[0] && !lost.out.enable[1] && lost.out.enable[2], "lost on the way");
  check(lost.out.fault.fault == F::stopped && p::voted(lost.state().waited).healthy == 0, "the first fault stays, and it is not well");
  lost.run(1);
  check(lost.law.controller.fault.fault == F::none && p::voted(lost.state().waited).healthy == 1, "and goes on from there");
  Rig two(r);
  two.run(10);
  two.read();
  two.in.position[0].value = two.in.position[2].value = nan;
  two.step();
  check(!two.out.enable[0] && two.out.enable[1] && !two.out.enable[2], "two at once");
  Rig repeated(r);
  repeated.run(10);
  p::stop(repeated.law);
  repeated.run(5);
  bool stale = false;
  for (int k = 0; k < 4; ++k) {
    repeated.step();
    stale = stale || repeated.law.controller.fault.fault == F::stale;
  }
  check(stale, "the same sample again and again is no healthy one");
  Rig clock(r);
  clock.run(10);
  p::stop(clock.law);
  clock.run(5);
  clock.now -= 900000;
  clock.count = 3;
  clock.run(2);
  check(clock.law.controller.fault.fault == F::none, "clocks may begin anew");
}

/// What the front or the gate finds stops all in the same period.
void fronts() {
  Rig rig;
  rig.run(20);
  check(rig.out.challenge == 0 && rig.out.beat == 20 && rig.out.mode == M::running && rig.law.controller.steps == 20, "runs");
  rig.read();
  rig.in.position[2].time -= 900000;
  rig.step();
  check(rig.out.fault.fault == F::stale && rig.out.fault.joint == 2 && rig.out.mode == M::damped_stop, "a clock");
  check(!rig.out.enable[2] && rig.out.enable[0] && rig.out.challenge != 0, "of that joint");
  auto params = law_params();
  for (auto& one : params.joint) one.gate.velocity_limit = 0.5;
  Rig fast(rules(), params);
  fast.speed[1] = 4;
  for (int k = 0; k < 60; ++k) {
    fast.run(1);
    check((fast.law.controller.state.gate.fault.fault == F::none) == (fast.out.fault.fault == F::none), "at once");
  }
  check(fast.out.fault.fault == F::velocity && fast.out.fault.joint == 1 && fast.out.enable[1], "the gate's limit");
  // Of a hold, no joint is left: all fade.
  Rules none = rules();
  for (auto& one : none.joint) one.hold = {};
  Rig off(none);
  off.run(20);
  p::stop(off.law);
  off.run(9);
  check(off.mode() == M::latched && !off.out.enable[0] && off.out.command.effort[0] == 0, "nothing to hold with");
  check(off.out.fault.fault == F::stopped && p::faults_of(off.state()) == 1, "latched by its own fault");
  // An effort that ramps to 0 goes to the drives, of which one in doubt gets none of a hold.
  Rig ramps;
  ramps.run(4);
  for (S& one : ramps.state().output) one = 5;
  ramps.state().doing.twin ^= 1u;
  ramps.run(1);
  check(ramps.mode() == M::zero && ramps.out.command.effort[1] == 4.5 && ramps.out.command.drive[1] == 4.5, "ramps");
  Rig doubted;
  doubted.run(4);
  for (S& one : doubted.state().output) one = 5;
  doubted.read();
  doubted.in.position[1].value = nan;
  doubted.step();
  check(doubted.mode() == M::damped_stop && doubted.out.command.effort[1] > 1, "a joint in doubt fades");
  check(doubted.out.command.drive[1] == 0 && doubted.out.command.drive[0] > 1, "and its drive gets nothing");
}

}  // namespace

int main() {
  parameters();
  answers();
  transitions();
  configured();
  memory();
  power();
  bits_of_a_doubt();
  resets_after_a_gap();
  knows_the_drives_answers();
  waves_within_limits();
  lost_while_stopped();
  starts_of_broken_memory();
  safe_answers();
  bounds_of_sensors();
  encoders_and_drives();
  coupled_motors();
  slow_watches();
  second_encoders();
  late_drives();
  contradictions();
  sensors_alone();
  degraded();
  start_up();
  counts();
  end_point();
  efforts();
  resets();
  stops();
  doubts_in_a_hold();
  fronts();
  return failures();
}
