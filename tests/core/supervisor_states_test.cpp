// The supervisor of one joint, piece by piece: what it makes of its numbers, when each watch speaks, which state
// follows which, what a hold and a reset need. Each bound just within and just beyond it, in both signs.
#include "check.hpp"
#include "law_numbers.hpp"

#include <pellucid/joint_compensation.hpp>
#include <pellucid/supervisor.hpp>
#include <pellucid/transparent_compensation.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
using M = p::Mode;
using S = double;
using Law = p::JointCompensation<S>;
using Params = p::SupervisorParams<S>;
using State = p::SupervisorState<S>;
constexpr S period = 0x1p-10, more = 0x1p-8, never = std::numeric_limits<S>::infinity();
constexpr M modes[] = {M::start_up, M::running, M::degraded, M::damped_stop, M::zero, M::latched};
const S nan = std::numeric_limits<S>::quiet_NaN();

/// A law with limits of 10 N m and 0.5 N m a period; periods are 1/1024 s, so that velocities are exact numbers.
template <class L = Law> typename L::Params law_params() {
  auto params = typical_params<typename L::Params>();
  params.gate.period = period;
  params.gate.rate_limit = 512;
  params.gate.position_min = -never;
  params.gate.position_max = never;
  params.gate.velocity_limit = never;
  return params;
}

p::SafetyCoefficients<S> gate() { return p::coefficients(law_params().gate); }

// --- numbers ---------------------------------------------------------------------------------------------------------

void parameters() {
  const Params usual;
  check(usual.moving == 0.2 && usual.rest_speed == 0.3 && usual.reset_delay == 1 && usual.healthy_samples == 500, "usual");
  check(usual.joint_tolerance == never && usual.joint_expected == 0 && usual.degrades == 0, "nothing that is not asked for");
  Params r;
  r.body.inertia = 0.05;
  const auto c = p::coefficients(r, gate());
  check(c.valid == 1 && c.period == period && c.effort_limit == 10 && c.max_change == 0.5, "the gate's");
  check(c.encoder.period == period && c.body.period == 2 * period, "momentum every second period");
  check(c.ringing.smoothing == 100 * 4 * period && c.reset_periods == 1024, "ringing every fourth");
  auto shut = gate();
  shut.valid = false;
  check(p::coefficients(r, shut).valid == 0 && p::coefficients(r, shut).reset_periods == 1000000, "no gate");
  const auto refused = [&r](auto change, const char* what, int line = __builtin_LINE()) {
    Params bad = r;
    change(bad);
    check(p::coefficients(bad, gate()).valid == 0, what, line);
  };
  refused([](Params& bad) { bad.reset_delay = 61; }, "unsound");
  refused([](Params& bad) { bad.encoder.range_min = 1, bad.encoder.range_max = 0; }, "an encoder without a range");
  refused([](Params& bad) { bad.body.bandwidth = 600; }, "an observer that is too fast");
  refused([](Params& bad) { bad.ringing.fastest = 300; }, "a band that is too fast");
  refused([](Params& bad) { bad.test.samples = 7; }, "half a wave that is too short");
  refused([](Params& bad) { bad.delay.smoothing = 1100; }, "a delay's mean that is too fast");
  check(c.delay.smoothing == 60 * period, "a delay in every period");
  check(c.shaking.period == 2 * period && c.shaking.forgetting == r.shaking.slow * 2 * period, "shaking every second");
  check(c.unexplained.period == 2 * period, "and energy");
  refused([](Params& bad) { bad.shaking.slow = 600; }, "a slow part that is too fast");
  refused([](Params& bad) { bad.unexplained.memory = 600; }, "energy that is forgotten at once");
  refused([](Params& bad) { bad.rate.samples = 2100000; }, "a mean interval over more than half an hour");
  refused([](Params& bad) { bad.still.half_wave = 7; }, "a wave at rest that is too short");
  // A delay beyond a million periods is a million.
  auto fast = law_params().gate;
  fast.period = 0x1p-17;
  const auto periods = [&](S delay) {
    Params one;
    one.reset_delay = delay;
    return p::coefficients(one, p::coefficients(fast)).reset_periods;
  };
  check(periods(7.5) == 983040 && periods(3.75) == 491520 && periods(0) == 0, "delays in periods");
  check(periods(7.75) == 1000000 && periods(8) == 1000000 && periods(60) == 1000000, "a million at most");
}

void answers() {
  Params r;
  r.hold = {2, 4};
  const auto c = p::coefficients(r, gate());
  r.hold = {};
  const auto none = p::coefficients(r, gate());
  for (std::size_t i = 0; i < p::safety_fault_count; ++i) {
    const F fault = static_cast<F>(i);
    bool held = false;
    for (const F one : {F::velocity, F::stopped, F::overspeed, F::force_sensor, F::muscle, F::lost, F::push, F::power, F::energy})
      held = held || one == fault;
    check(p::response(c, fault) == (held ? M::damped_stop : M::zero), p::safety_fault_names[i]);
    check(p::response(none, fault) == M::zero, "nothing to hold with");
  }
  for (const M mode : modes) check(p::is_stopped(mode) == (mode == M::damped_stop || mode == M::zero || mode == M::latched), "stopped");
  check(p::first_mode(c) == M::running, "no test");
  r.test.effort = 1;
  check(p::first_mode(p::coefficients(r, gate())) == M::start_up, "a test first");
}

// --- states ----------------------------------------------------------------------------------------------------------

/// Every mode with every wish: what is stopped is only ever stopped harder, and the first fault stays.
void transitions() {
  const auto c = p::coefficients(Params{}, gate());
  for (const M now : modes)
    for (const M wanted : {M::degraded, M::damped_stop, M::zero, M::latched}) {
      State s;
      p::go(s, now, now == M::running || now == M::start_up ? F::none : F::lost);
      s.steps = 77;
      p::put(s.waited, p::ResetProgress{5, 5, 5});
      s.hold.effort = s.hold.taken = 3;
      s.drive = {4, 2, 1, 1, 1, 1, 1};
      p::enter(c, s, F::jump, wanted);
      const bool was = p::is_stopped(now), same = was && wanted <= now;
      const M next = same ? now : wanted;
      check(p::mode_of(s) == next, "the harder one");
      check(p::faults_of(s) == (same ? 0u : 1u), "written down where anything changed");
      const bool first = !was && !(now == M::degraded && wanted == M::degraded);
      check(p::fault_of(s) == (same || !first ? (now == M::running || now == M::start_up ? F::none : F::lost) : F::jump), "the first fault");
      if (same || !p::is_stopped(next)) {
        check(p::voted(s.waited).stopped == 5 && p::voted(s.waited).healthy == 5 && s.challenge.word == 0 && s.drive.due == 1, "nothing else");
        continue;
      }
      check(p::logged(s, 0).fault == F::jump && p::logged(s, 0).mode == next && p::logged(s, 0).step == 77, "log");
      check(p::voted(s.waited).stopped == 0 && p::voted(s.waited).healthy == 0 && s.hold.effort == 0 && s.hold.taken == 0, "begins anew");
      check(s.drive.asked == 4 && s.drive.asked_before == 4 && s.drive.due == 0 && s.drive.outside == 0, "the drive's watch, too");
      check(s.challenge.word % 2 == 1 && p::is_whole(s.challenge), "a challenge that is not 0");
      const std::uint32_t challenge = s.challenge.word;
      State other = s;
      p::go(s, M::running, F::none);
      ++s.steps;
      p::enter(c, s, F::jump, M::zero);
      p::go(other, M::running, F::none);
      other.steps += 2;
      p::enter(c, other, F::jump, M::zero);
      check(s.challenge.word != challenge && other.challenge.word != challenge && s.challenge.word != other.challenge.word,
            "another one for every fault");
    }
  State s;
  for (std::uint32_t k = 1; k <= 20; ++k) {
    p::go(s, M::running, F::none);
    s.steps = k;
    p::enter(c, s, F::jump, M::zero);
    for (std::uint32_t ago = 0; ago < 12; ++ago)
      check(p::logged(s, ago).step == (ago < k && ago < 8 ? k - ago : 0), "the last eight");
  }
}

/// A law under a supervisor on a joint that goes at a constant velocity.
template <class L = Law> struct Rig {
  p::Supervised<L> law{};
  p::SupervisorOutput<S> out{};
  p::Samples<S> in{};
  p::Feedback<S> back{};
  S place = 1.2, speed = 0;
  std::int64_t now = 1000000;
  std::uint32_t count = 100;

  explicit Rig(const Params& r = {}) { check(p::configure(law, law_params<L>(), r), "the example makes sense"); }
  State& state() { return law.state; }
  M mode() const { return p::mode_of(law.state); }
  F fault() const { return p::fault_of(law.state); }
  void read() {
    now += 977;
    ++count;
    place += speed * period;
    in.position = {place, now, count, true};
    back.drive = {law.state.output, now, count, true};
  }
  p::SupervisorOutput<S> step() { return out = p::step(law, in, back, now); }
  void run(int n) {
    for (int k = 0; k < n; ++k) read(), step();
  }
};

Params held() {
  Params r;
  r.hold = {2, 4};
  r.reset_delay = 16 * period;
  r.healthy_samples = 8;
  return r;
}

void configured() {
  Rig<> rig(held());
  check(rig.mode() == M::running && rig.state().steps == 0, "runs at once");
  rig.run(100);
  check(p::configure(rig.law, law_params(), held()) && rig.mode() == M::running && rig.state().steps == 100, "again");
  rig.run(5);
  p::stop(rig.law);
  rig.run(1);
  const std::uint32_t challenge = rig.out.challenge;
  check(rig.out.fault == F::stopped && rig.mode() == M::damped_stop && challenge != 0, "stopped");
  check(p::configure(rig.law, law_params(), held()) && rig.mode() == M::latched && rig.fault() == F::stopped, "stays");
  check(rig.state().challenge.word == challenge && rig.state().steps == 106 && p::faults_of(rig.state()) == 1, "kept");
  check(p::logged(rig.law.state, 0).fault == F::stopped, "with its log");
  // Numbers that make no sense are a fault that ends with better ones.
  Rig<> other(held());
  Params bad = held();
  bad.reset_delay = -1;
  check(!p::configure(other.law, law_params(), bad) && other.mode() == M::latched && other.fault() == F::configuration, "bad");
  other.run(1);
  check(other.out.effort == 0 && !other.out.enable && other.out.fault == F::configuration && other.out.mode == M::latched, "nothing");
  check(other.out.challenge == 0, "and no reset");
  check(p::configure(other.law, law_params(), held()) && other.mode() == M::running, "better");
  Rig<> lost(held());
  lost.run(20);
  lost.law.supervisor.valid = 0;
  lost.run(1);
  check(lost.out.effort == 0 && lost.out.fault == F::integrity && lost.out.mode == M::latched && !lost.out.enable, "at once");
  check(lost.out.challenge == 0 && p::logged(lost.law.state, 0).fault == F::integrity, "and written down");
  check(p::configure(lost.law, law_params(), held()) && lost.mode() == M::latched && lost.fault() == F::integrity, "a start keeps it");
  // A broken mode is a fault; what was never configured has no past.
  for (const std::uint32_t bits : {4u, 3u}) {
    Rig<> broken(held());
    broken.run(10);
    broken.state().doing.word ^= bits;
    p::configure(broken.law, law_params(), held());
    check(broken.mode() == M::latched && broken.fault() == F::integrity, "a broken mode");
  }
  Rig<> past(held());
  p::stop(past.law);
  past.run(1);
  for (std::uint32_t bit = 0; bit < 64; ++bit) {
    Rig<> one = past;
    (bit < 32 ? one.state().alive.word : one.state().alive.twin) ^= 1u << bit % 32;
    p::configure(one.law, law_params(), held());
    check(one.mode() == M::latched && one.fault() == F::stopped && p::faults_of(one.state()) == 1, "a lost bit forgets nothing");
    Rig<> runs(held());
    runs.run(5);
    (bit < 32 ? runs.state().alive.word : runs.state().alive.twin) ^= 1u << bit % 32;
    p::configure(runs.law, law_params(), held());
    check(runs.mode() == M::latched && runs.fault() == F::integrity && p::faults_of(runs.state()) == 1, "and is a fault");
  }
  // A mode that was lost beside numbers that make no sense is a fault that better ones do not end.
  Rig<> both = past;
  both.state().doing.word ^= 1u;
  check(!p::configure(both.law, law_params(), bad) && both.fault() == F::integrity, "both");
  check(p::configure(both.law, law_params(), held()) && both.mode() == M::latched && both.fault() == F::integrity, "stays");
  past.state().alive = {};
  p::put(past.state().alive, 5);
  past.state().steps = 9;
  p::configure(past.law, law_params(), held());
  check(past.state().steps == 0, "nor where it is another's");
}

/// A mode that there is not is a fault at a start, too; memory that was never configured has no past.
void starts_of_broken_memory() {
  for (const std::uint32_t word : {6u, 7u, 255u, 6u | 9u << 8}) {
    Rig<> broken(held());
    broken.run(10);
    p::put(broken.state().doing, word);
    p::configure(broken.law, law_params(), held());
    check(broken.mode() == M::latched && broken.fault() == F::integrity, "no such mode");
  }
  for (const bool whole : {false, true})
    for (const M mode : modes) {
      p::Supervised<Law> never_configured{};
      p::go(never_configured.state, mode, F::jump);
      if (!whole) never_configured.state.doing.twin ^= 4u;
      p::configure(never_configured, law_params(), held());
      check(p::mode_of(never_configured.state) == M::running && p::faults_of(never_configured.state) == 0, "runs");
    }
}

/// A word of memory that is lost is a fault, whichever it is; both twins of the first one are: nothing was configured.
void memory() {
  p::Supervised<Law> fresh;
  const auto out = p::step(fresh, p::Samples<S>{}, p::Feedback<S>{}, 0);
  check(out.fault == F::not_started && out.mode == M::latched && !out.enable && out.effort == 0 && out.beat == 1, "not started");
  Rig<> another(held());
  another.run(20);
  p::put(another.state().alive, 5);
  another.run(1);
  check(another.out.fault == F::not_started && another.out.mode == M::latched, "another's memory");
  Rig<> latched;
  latched.run(20);
  p::stop(latched.law);
  latched.run(60);
  check(latched.mode() == M::latched && latched.out.fault == F::stopped && p::faults_of(latched.state()) == 1, "latched");
  for (int what = 0; what < 5; ++what) {
    Rig<> rig(held());
    rig.run(20);
    if (what == 0) rig.state().alive.word ^= 1u;
    if (what == 1) rig.state().alive.twin ^= 1u;
    if (what == 2) rig.state().doing.word ^= 1u;
    if (what == 3) rig.state().doing.twin ^= 256u;
    if (what == 4) p::put(rig.state().doing, 6u);
    rig.run(1);
    check(rig.out.fault == F::integrity && !rig.out.enable && p::is_whole(rig.state().alive), "lost");
    check(p::logged(rig.law.state, 0).fault == F::integrity && p::faults_of(rig.state()) == 1, "written down");
  }
  // Checksums of law and supervisor by turns, every second period: each is gone through in a known time.
  Rig<> turns(held());
  for (std::uint32_t k = 1; k <= 12; ++k) {
    const std::uint32_t law = turns.state().law_sum.next, own = turns.state().own_sum.next;
    turns.run(1);
    check((turns.state().law_sum.next != law) == (k % 4 == 2), "the law's by turns");
    check((turns.state().own_sum.next != own) == (k % 4 == 0), "and the supervisor's");
  }
  const int law_words = sizeof(Rig<>{}.law.controller.law) / 4, own_words = sizeof(Rig<>{}.law.supervisor) / 4;
  for (const bool law : {true, false}) {
    Rig<> rig(held());
    rig.run(4);
    if (law) rig.law.controller.law.friction_share = 0.81;
    else rig.law.supervisor.params.encoder.speed_limit = 900;
    int k = 0;
    for (; k < 2000 && rig.out.fault == F::none; ++k) rig.run(1);
    const int once = 4 * (((law ? law_words : own_words) + 7) / 8);
    check(rig.out.fault == F::integrity && rig.mode() != M::damped_stop && k <= 2 * once, "found in time");
  }
  Rig<> adjusted(held());
  adjusted.run(7);
  auto params = law_params();
  params.friction_share = 0.5;
  p::adjust(adjusted.law, params);
  adjusted.run(2000);
  check(adjusted.out.fault == F::none && adjusted.law.controller.law.friction_share == 0.5, "other numbers by the way");
}

// --- watches ---------------------------------------------------------------------------------------------------------

void new_samples() {
  std::uint32_t seen = 5;
  check(!p::is_new(seen, p::Sample<S>{1, 0, 5, true}) && p::is_new(seen, p::Sample<S>{1, 0, 6, true}), "seen once");
  check(!p::is_new(seen, p::Sample<S>{1, 0, 7, false}) && seen == 7, "taken note of");
  check(!p::is_new(seen, p::Sample<S>{nan, 0, 8, true}) && !p::is_new(seen, p::Sample<S>{1, 0, 8, true}), "no number");
}

void two_encoders() {
  Params r;
  r.joint_expected = 1;
  r.joint_tolerance = 0.25;
  r.drive.cycles = 3;
  const auto c = p::coefficients(r, gate());
  const auto at = [](S x, std::uint32_t k, bool valid = true) { return p::Sample<S>{x, 0, k, valid}; };
  for (const S way : {-1.0, 1.0}) {
    State s;
    check(p::compare(c, s, at(1, 1), at(0.5, 1)) == F::none && s.joint_offset == 0.5, "offset of the start");
    check(p::compare(c, s, at(1, 2), at(0.5 + way * 0.25, 2)) == F::none, "at the limit");
    check(p::compare(c, s, at(1, 3), at(0.5 + way * (0.25 + more), 3)) == F::disagreement, "beyond");
    check(p::compare(c, s, at(1 + way, 4), at(0.5 + way, 4)) == F::none && s.joint_offset == 0.5, "together");
    check(p::compare(c, s, at(nan, 5), at(9, 5)) == F::none, "nothing to compare with");
    for (int k = 1; k <= 5; ++k)
      check(p::compare(c, s, at(1, 6), at(9, 6, false)) == (k <= 3 ? F::none : F::disagreement), "silent");
    check(p::compare(c, s, at(1, 7), at(0.5, 7)) == F::none && s.joint_silent == 0, "until it speaks");
  }
  State s;
  auto off = c;
  off.params.joint_expected = 0;
  for (std::uint32_t k = 0; k < 9; ++k) check(p::compare(off, s, at(1, k), at(k, k)) == F::none, "none is there");
  check(!s.joint_started && p::first_of(F::none, F::jump) == F::jump && p::first_of(F::push, F::jump) == F::push, "first");
}

/// What is seen in a period whose number is `steps`, in a mode, of a motor that went at one velocity and then another.
struct Seen {
  p::SupervisorCoefficients<S> c;
  State s{};
  S place = 0;
  std::uint32_t count = 0;
  p::Samples<S> in{};
  p::Feedback<S> back{};

  explicit Seen(const Params& r) : c(p::coefficients(r, gate())) { check(c.valid == 1, "makes sense"); }
  F at(S velocity, std::uint32_t steps, M mode = M::running) {
    place += velocity * period;
    in.position = {place, 0, ++count, true};
    s.steps = steps;
    p::go(s, mode, F::none);
    return p::observe(c, s, in, back);
  }
  void starts(S velocity) {
    for (int k = 0; k < 4; ++k) at(velocity, 0);
  }
};

/// Power, push and ringing are of the mean effort and the mean velocity of two periods, in every second period.
void slow_watches() {
  Params r;
  r.budget.power_limit = 4;
  const S share = p::power_rate * 2 * period;
  for (const S way : {-1.0, 1.0})
    for (const M mode : modes) {
      // What the smooth power must be for two periods of 2 N m at 2 rad/s to end at the limit: the limit itself.
      Seen seen(r);
      seen.starts(1);
      seen.s.drive.asked = way * 3, seen.s.drive.asked_before = way;
      seen.s.budget.power = way * 4;
      check(seen.at(3, 1, mode) == F::none && seen.s.budget.power == way * 4, "at the limit");
      seen.at(1, 2, mode);
      seen.s.drive.asked = way * (3 + more);
      check(seen.at(3, 2, mode) == F::none && seen.s.budget.power == way * 4, "not looked at");
      seen.at(1, 2, mode);
      check(seen.at(3, 3, mode) == F::power, "beyond");
      check(std::fabs(seen.s.budget.power - way * (4 + share * more)) < 1e-12, "by the mean effort at the mean velocity");
      check(seen.s.other_velocity == 3, "velocity of the period before");
    }
  r = {};
  r.budget.push_limit = 2;
  r.body.inertia = 1;
  r.body.gravity_cosine = 3;
  for (const M mode : modes) {
    const bool carries = mode == M::running || mode == M::degraded;
    Seen seen(r);
    seen.starts(0);
    seen.s.drive.asked = seen.s.drive.asked_before = 5;
    check(seen.at(0, 1, mode) == (carries ? F::none : F::push), "the weight that is carried");
    seen.s.drive.asked = seen.s.drive.asked_before = 5 + more;
    check(seen.at(0, 1, mode) == F::push, "beyond");
    seen.s.wave[0] = seen.s.wave[1] = more;
    check(seen.at(0, 1, mode) == F::push, "with the probe's waves");
    seen.s.still.amplitude = 1;
    check(seen.at(0, 1, mode) == (carries ? F::none : F::push), "without the wave that asks a joint at rest");
    seen.s.still = {};
    seen.s.drive.asked = seen.s.drive.asked_before = 2;
    check(seen.at(0, 1, mode) == F::none, "within");
  }
  r = {};
  r.body.inertia = 1;
  r.body.coulomb = 0.5;
  r.budget.push_limit = 2;
  Seen drag(r);
  drag.starts(0);
  drag.s.drive.asked = drag.s.drive.asked_before = 2.5;
  check(drag.at(0, 1) == F::none, "friction takes its part");
  drag.s.drive.asked = drag.s.drive.asked_before = 2.5 + more;
  check(drag.at(0, 1) == F::push, "and no more");
  // The store: two periods' energy at a time.
  r = {};
  r.budget.store = 1;
  Seen spends(r);
  spends.starts(2);
  spends.s.drive.asked = spends.s.drive.asked_before = 3;
  check(spends.at(2, 1) == F::none && spends.s.budget.spent == 2 * period * 6, "energy of two periods");
  r = {};
  r.ringing.limit = 0.015625;
  for (const M mode : modes)
    for (std::uint32_t steps = 0; steps < 4; ++steps) {
      Seen seen(r);
      seen.starts(0);
      seen.s.ringing.size = 9;
      check((seen.at(0, steps, mode) == F::ringing) == (steps == 3 && mode != M::start_up), "every fourth period, but in the test");
    }
  r = {};
  Seen rings(r);
  rings.starts(0);
  rings.s.drive.asked = 3, rings.s.drive.asked_before = 1;
  rings.at(0, 3);
  check(rings.s.ringing.smooth == 100 * 4 * period * 2, "of the mean effort");
  rings.s.ringing = {}, rings.s.drive.asked = 3, rings.s.drive.asked_before = 1, rings.s.wave[0] = 1, rings.s.wave[1] = 0.5;
  rings.at(0, 3);
  check(rings.s.ringing.smooth == 100 * 4 * period * 1.25, "without the probe's waves");
}

/// Model and motion: of running laws, once there are velocities; a force sensor counts where it is expected and speaks.
void momentum() {
  Params r;
  r.body.inertia = 1;
  r.body.wearer_torque = 4;
  r.force.expected = 1;
  for (const S way : {-1.0, 1.0})
    for (const M mode : modes) {
      const bool carries = mode == M::running || mode == M::degraded;
      Seen seen(r);
      seen.starts(0);
      seen.s.body.started = true;
      seen.s.body.lasting = way * 9;
      check(seen.at(0, 2, mode) == F::none && seen.s.body.lasting == way * 9, "every second period");
      check(seen.at(0, 1, mode) == (carries ? F::unexplained : F::none), "what nobody gives, while the law carries");
      check(seen.s.residual == F::unexplained, "and taken note of");
    }
  Params tells = r;
  tells.body.force_tolerance = 1;
  Seen contradicted(tells);
  contradicted.starts(0);
  contradicted.s.body.started = true;
  contradicted.s.body.contradiction = 9;
  contradicted.in.interaction = {0, 0, 1, true};
  check(contradicted.at(0, 1) == F::none && contradicted.s.residual == F::force_sensor, "a sensor's turn comes later");
  for (const M mode : {M::running, M::degraded, M::start_up}) {
    Params counts = r;
    counts.force.expected = 1;
    counts.body.wearer_torque = counts.body.wearer_push = never;
    Seen gains(counts);
    gains.in.interaction = {2, 0, 1, true};
    gains.starts(1);
    gains.s.body.started = true;
    gains.s.unexplained.energy = 0.5;
    gains.at(1, 1, mode);
    check((gains.s.unexplained.energy != 0) == (mode == M::running), "energy that nobody accounts for, while all is well");
  }
  Seen fresh(r);
  fresh.at(1, 0);
  check(fresh.at(1, 1) == F::none && !fresh.s.body.started, "two readings are no motion");
  fresh.at(1, 1);
  check(!fresh.s.body.started || fresh.s.encoder.heard == 3, "three are");
  Seen moves(r);
  moves.starts(1);
  moves.s.drive.asked = 3, moves.s.drive.asked_before = 1;
  moves.s.body = {};
  moves.in.interaction = {2, 0, 1, false};
  moves.at(3, 1);
  check_close(moves.s.body.momentum, 2 + 2 * period * 2, 1e-12, "of mean velocity and mean effort");
  check(moves.s.body.felt == 0, "a sensor that is silent");
  for (const bool expected : {true, false}) {
    Params one = r;
    one.force.expected = expected ? 1 : 0;
    Seen felt(one);
    felt.in.interaction = {2, 0, 1, true};
    felt.starts(0);
    felt.at(0, 1);
    check((felt.s.body.felt != 0) == expected, "a sensor that is asked");
  }
  r.body.inertia = 0;
  Seen without(r);
  without.starts(0);
  without.s.body.lasting = 99;
  check(without.at(0, 1) == F::none && without.s.residual == F::none, "no model, nothing to say");
}

void drive_and_order() {
  Params r;
  r.drive.expected = 1;
  r.drive.cycles = 2;
  r.drive.tolerance = 1;
  r.joint_expected = 1;
  r.joint_tolerance = 0.25;
  r.encoder.speed_limit = 8;
  Seen seen(r);
  seen.back.joint = {0, 0, 0, true};
  const auto next = [&](S given, S joint, S velocity) {
    seen.back.drive = {given, 0, seen.count, true};
    seen.back.joint = {joint, 0, seen.count, true};
    return seen.at(velocity, 0);
  };
  for (int k = 0; k < 4; ++k) check(next(0, seen.place, 0) == F::none, "all well");
  next(3, seen.place, 0);
  check(next(3, seen.place, 0) == F::drive_stuck, "the drive alone");
  next(3, seen.place, 0);
  check(next(3, seen.place + 1, 0) == F::disagreement, "the encoders before the drive");
  next(3, seen.place, 0);
  check(next(3, seen.place + 1, 16) == F::overspeed, "the encoder before all");
  r.drive.surplus = 0.5;
  r.drive.tolerance = never;
  Seen adds(r);
  adds.c.params.joint_expected = 0;
  adds.starts(0);
  adds.back.drive = {64, 0, 99, true};
  check(adds.at(8, 0) == F::none && adds.s.drive.surplus == 0.5, "energy of the joint's own way in a period");
  check(adds.at(8, 0) == F::none && adds.s.drive.silent == 1, "a measurement that was seen before is none");
  // A drive before its spring: its own encoder says how it turns, smoothed, over as many periods as it was silent.
  r.drive.inertia = 1;
  r.joint_expected = 1;
  r.joint_tolerance = never;
  r.drive.surplus = never;
  Seen turns(r);
  turns.starts(0);
  const auto says = [&](S joint, std::uint32_t sequence) {
    turns.back.joint = {joint, 0, sequence, true};
    turns.back.drive = {1, 0, sequence, true};
    turns.at(0, 0);
    return p::velocity_of_drive(turns.c, turns.s);
  };
  check(says(5, 1) == 0, "one reading is no motion");
  check_close(says(5 + 4 * period, 2), 2.0, 1e-9, "half of the new velocity");
  check_close(says(5 + 8 * period, 3), 3.0, 1e-9, "and half of what is left");
  check_close(turns.s.drive.kinetic, 4.5, 1e-9, "energy of its inertia");
  turns.back.joint.valid = false;
  turns.at(0, 0);
  check_close(says(5 + 12 * period, 4), 2.5, 1e-9, "over two periods, of which it was silent in one");
  turns.c.params.drive.inertia = 0;
  check(p::velocity_of_drive(turns.c, turns.s) == 0, "a drive at the joint turns as the joint does");
  const S followed = turns.s.drive_velocity;
  says(9, 5);
  check(turns.s.drive_velocity == followed, "and is not followed by itself");
  Params blind = r;
  blind.drive.inertia = 1;
  check(p::is_before_spring(blind), "a drive with an encoder of its own");
  blind.joint_expected = 0;
  check(!p::is_before_spring(blind), "nobody sees how it turns");
  r.drive.inertia = 0;
  r.drive.expected = 0;
  Seen off(r);
  off.c.params.joint_expected = 0;
  off.starts(0);
  for (int k = 0; k < 9; ++k) check(off.at(0, 0) == F::none, "no drive that measures");
}

/// A drive that answers late is found by its delay, from answers that are new.
void late_drives() {
  Params r;
  r.drive.expected = 1;
  r.drive.tolerance = r.drive.surplus = never;
  r.delay = {0.008, 1, 60, 0.5, 0.5};
  for (const std::uint32_t late : {4u, 16u})
    for (const bool fresh : {true, false}) {
      Seen seen(r);
      seen.starts(0);
      S asked[32]{};
      bool found = false;
      for (std::uint32_t i = 0; i < 4000; ++i) {
        const S t = period * i;
        asked[i % 32] = 3 * p::sin(3 * t) + p::sin(7 * t);
        seen.s.drive.asked = seen.s.drive.asked_before = asked[i % 32];
        seen.back.drive = {asked[(i + 32 - late) % 32], 0, fresh ? i : 7, true};
        const F now = seen.at(0, 2 * (i / 2) + 1);
        found = found || now == F::drive_effort;
      }
      check(found == (fresh && late == 16), "16 ms late");
      check(fresh || seen.s.delay.count == 1, "no answer, no delay");
    }
}

/// Optional sensors: lost or beyond their range the law goes on where it can; a contradiction stops it.
void sensors() {
  for (const bool force : {true, false})
    for (const std::uint32_t carried : {0u, 1u})
      for (const M mode : modes) {
        Params r = held();
        (force ? r.force : r.muscle) = {1, 6, 2};
        r.degrades = carried;
        auto c = p::coefficients(r, gate());
        State s;
        p::go(s, mode, F::none);
        p::Samples<S> in;
        for (const S way : {-1.0, 1.0}) {
          in.interaction = in.muscle = {way * 2, 0, 1, true};
          p::judge_sensors(c, s, in);
          check(p::mode_of(s) == mode && p::faults_of(s) == 0, "within its range");
        }
        in.interaction = in.muscle = {2 + more, 0, 1, true};
        p::judge_sensors(c, s, in);
        const M wanted = !force || carried != 0 ? M::degraded : M::damped_stop;
        check(p::mode_of(s) == (mode == M::running ? wanted : mode), "beyond its range");
        check(p::fault_of(s) == (mode == M::running ? (force ? F::force_sensor : F::muscle) : F::none), "by its name");
        State silent;
        p::go(silent, mode, F::none);
        for (int k = 1; k <= 4; ++k) {
          p::judge_sensors(c, silent, {});
          check((p::fault_of(silent) == F::lost) == (k >= 3 && mode == M::running), "silent for six periods");
        }
      }
  // The same value: a fault of the force sensor while the joint moves, never of EMG.
  for (const S speed : {-1.0, -0.375, -0.25, 0.0, 0.25, 0.375, 1.0})
    for (const bool force : {true, false}) {
      Params r;
      r.moving = 0.25;
      (force ? r.force : r.muscle).expected = 1;
      auto c = p::coefficients(r, gate());
      State s;
      p::go(s, M::running, F::none);
      s.encoder.velocity = speed;
      p::Samples<S> in;
      in.interaction = in.muscle = {1, 0, 1, true};
      for (int k = 0; k < 30; ++k) p::judge_sensors(c, s, in);
      check((p::fault_of(s) == F::lost) == (force && std::fabs(speed) > 0.25), "frozen in motion");
    }
  // What model and motion contradict.
  for (const std::uint32_t expected : {0u, 1u}) {
    Params r = held();
    r.degrades = 1;
    r.force.expected = expected;
    auto c = p::coefficients(r, gate());
    for (const M mode : modes) {
      State s;
      p::go(s, mode, F::none);
      s.residual = F::force_sensor;
      p::Samples<S> in;
      in.interaction = {1, 0, 1, true};
      p::judge_sensors(c, s, in);
      const bool stops = mode == M::running && expected != 0;
      check(p::mode_of(s) == (stops ? M::damped_stop : mode), "contradicted");
      check(p::fault_of(s) == (stops ? F::force_sensor : F::none), "and named");
      State other;
      p::go(other, mode, F::none);
      other.residual = F::unexplained;
      p::judge_sensors(c, other, in);
      check(p::mode_of(other) == mode, "only by that");
    }
  }
}

// --- stops and resets ------------------------------------------------------------------------------------------------

void last_effort() {
  State s;
  for (const S way : {-1.0, 1.0}) {
    s.output = way * 2, s.drive.asked = way * 3;
    check(p::least_of(s) == way * 2, "the smaller counts");
    s.output = way * 3, s.drive.asked = way * -2;
    check(p::least_of(s) == way * -2, "of either");
    s.output = way * 2, s.drive.asked = way * -2;
    check(p::least_of(s) == way * 2, "of equal ones the output");
    s.output = nan;
    check(p::least_of(s) == 0, "no number is none");
    s.output = way * never, s.drive.asked = nan;
    check(p::least_of(s) == 0, "none at all");
  }
}

/// A joint that was stopped in a mode, with an effort, at a velocity.
struct Stopped {
  Rig<> rig;
  Stopped(const Params& r, M mode, S effort, S velocity) : rig(r) {
    p::go(rig.state(), M::running, F::none);
    p::enter(rig.law.supervisor, rig.state(), F::stopped, mode);
    rig.state().output = rig.state().drive.asked = effort;
    rig.state().encoder.velocity = velocity;
  }
  S stay(F found = F::none, bool heard = true, std::uint32_t token = 0) {
    p::stay_stopped(rig.law, found, heard, token);
    p::ask(rig.state().drive, rig.state().output);
    return rig.state().output;
  }
};

void efforts() {
  for (const S way : {-1.0, 1.0}) {
    Stopped zero(held(), M::zero, way * 0.75, way);
    check(zero.stay() == way * 0.25 && zero.rig.mode() == M::zero, "down by the rate");
    check(zero.stay() == 0 && zero.rig.mode() == M::latched && zero.rig.fault() == F::stopped, "then latched");
    Stopped latched(held(), M::latched, way * 5, way);
    check(latched.stay() == 0, "latched is nothing at once");
    Stopped holds(held(), M::damped_stop, way * 2, way * 4);
    check(holds.stay() == way * 1.5 && holds.rig.mode() == M::damped_stop, "towards the hold by the rate");
    for (int k = 0; k < 30; ++k) holds.stay();
    check(holds.rig.state().output == way * -4, "to its limit, against the motion");
    for (int k = 0; k < 30; ++k) {
      holds.rig.state().encoder.velocity = 0;
      holds.stay();
    }
    check(std::fabs(holds.rig.state().output) < 1e-6 && holds.rig.mode() == M::damped_stop, "at rest nothing, and still held");
    Params strong = held();
    strong.hold = {8, 40};
    Stopped limited(strong, M::damped_stop, 0, way * 4);
    for (int k = 0; k < 60; ++k) limited.stay();
    check(limited.rig.state().output == way * -10, "within the law's limit");
    Stopped wide(held(), M::zero, way * 30, way);
    check(wide.stay() == way * 10, "even where memory lost it");
    Stopped lost(held(), M::damped_stop, nan, way);
    check(std::fabs(lost.stay()) <= 0.5, "no number is nothing");
  }
}

void resets() {
  // With 8 healthy periods and 16 since the fault.
  const auto period_of_reset = [](const Params& r, S velocity, int healthy_from, F found, bool heard, bool right) {
    Stopped one(r, M::damped_stop, 0, velocity);
    const std::uint32_t challenge = one.rig.state().challenge.word;
    for (int k = 1; k <= 80; ++k) {
      const bool well = k >= healthy_from;
      one.stay(well ? F::none : found, well || heard, right ? challenge : challenge ^ 2u);
      if (one.rig.mode() == M::running) return k;
    }
    return 0;
  };
  const Params r = held();
  check(period_of_reset(r, 0, 1, F::none, true, true) == 16, "after the delay");
  check(period_of_reset(r, 0, 21, F::jump, true, true) == 28, "after a healthy while");
  check(period_of_reset(r, 0, 21, F::none, false, true) == 28, "in which the encoder speaks");
  check(period_of_reset(r, 0, 1, F::none, true, false) == 0, "not with another token");
  for (const S way : {-1.0, 1.0}) {
    check(period_of_reset(r, way * 0.3, 1, F::none, true, true) == 16, "at rest");
    check(period_of_reset(r, way * (0.3 + more), 1, F::none, true, true) == 0, "not in motion");
    Params coarse = r;
    coarse.encoder.resolution = 0.0625 * period;  // by two readings that are off, 0.125 rad/s
    check(period_of_reset(coarse, way * (0.3 + 0.125), 1, F::none, true, true) == 16, "at rest, by a coarse encoder");
    check(period_of_reset(coarse, way * (0.3 + 0.125 + more), 1, F::none, true, true) == 0, "beyond its error");
  }
  Params half = r;
  half.healthy_samples = 16;
  half.reset_delay = 0;
  check(period_of_reset(half, 0, 1, F::none, true, true) == 16, "all the healthy periods");
  // A token of 0 is none, and so is one beside a broken challenge.
  Stopped none(r, M::latched, 0, 0);
  p::put(none.rig.state().challenge, 0);
  for (int k = 0; k < 50; ++k) none.stay();
  check(none.rig.mode() == M::latched, "0 is no token");
  Stopped broken(r, M::latched, 0, 0);
  broken.rig.state().challenge.twin ^= 1u;
  for (int k = 0; k < 50; ++k) broken.stay(F::none, true, broken.rig.state().challenge.word);
  check(broken.rig.mode() == M::latched, "a broken challenge is none");
  Stopped senseless(r, M::latched, 0, 0);
  senseless.rig.law.supervisor.valid = 0;
  for (int k = 0; k < 50; ++k) senseless.stay(F::none, true, senseless.rig.state().challenge.word);
  check(senseless.rig.mode() == M::latched, "without sense no reset");
  // What is begun again, and what is kept.
  Stopped again(r, M::latched, 0, 0);
  again.rig.state().steps = 7;
  again.rig.law.controller.state.gate.output = 3;
  again.rig.law.controller.state.gate.fault = again.rig.law.controller.fault = F::stale;
  again.rig.state().body.lasting = again.rig.state().budget.spent = 9;
  const std::uint32_t challenge = again.rig.state().challenge.word;
  for (int k = 0; k < 16; ++k) again.stay(F::none, true, challenge);
  const State& s = again.rig.state();
  check(again.rig.mode() == M::running && again.rig.fault() == F::none && s.output == 0, "runs, from no effort");
  check(s.steps == 7 && p::faults_of(s) == 1 && s.challenge.word == challenge && p::is_whole(s.alive), "kept");
  check(s.body.lasting == 0 && s.budget.spent == 0 && p::voted(s.waited).healthy == 0 && p::voted(s.waited).stopped == 0, "begun again");
  check(again.rig.law.controller.state.gate.output == 0 && again.rig.law.controller.fault == F::none, "the law, too");
  Params tested = r;
  tested.test.effort = 1;
  Stopped test(tested, M::latched, 0, 0);
  for (int k = 0; k < 16; ++k) test.stay(F::none, true, test.rig.state().challenge.word);
  check(test.rig.mode() == M::start_up, "with its test");
}

/// A stop in any order with starts, faults and resets wins: it takes back the token and restarts the delay.
void stops() {
  const auto challenged = [](Rig<>& rig) {
    rig.run(20);
    p::stop(rig.law);
    rig.run(1);
    return rig.back.token = rig.out.challenge;
  };
  for (const bool in_vain : {false, true}) {
    Rig<> rig(held());
    const std::uint32_t token = challenged(rig);
    rig.run(14);
    if (in_vain) p::stop(rig.law);
    rig.run(1);
    check(rig.mode() == (in_vain ? M::damped_stop : M::running), "a pending reset");
    if (!in_vain) continue;
    check(rig.out.challenge != token && rig.out.fault == F::stopped && p::faults_of(rig.state()) == 1, "another token");
    rig.run(60);
    check(p::is_stopped(rig.mode()), "the old one is no use");
    p::stop(rig.law);
    rig.run(1);
    rig.back.token = rig.out.challenge;
    for (int k = 1; k < 15; ++k) rig.run(1), check(p::is_stopped(rig.mode()), "the delay begins anew");
    rig.run(1);
    check(rig.mode() == M::running, "and ends");
  }
  // In the period of the reset, and right after it.
  Rig<> late(held());
  challenged(late);
  late.run(15);
  check(late.mode() == M::running, "reset");
  p::stop(late.law);
  late.run(1);
  check(late.mode() == M::damped_stop && late.out.fault == F::stopped, "and stopped");
  // After another fault: it is written down once, and the first one stays.
  Rig<> faulty(held());
  faulty.run(20);
  faulty.in.position.value = nan;
  faulty.step();
  const F first = faulty.fault();
  faulty.back.token = faulty.out.challenge;
  for (int k = 0; k < 50; ++k) p::stop(faulty.law), faulty.run(1);
  check(faulty.fault() == first && p::faults_of(faulty.state()) == 2 && p::logged(faulty.law.state, 0).fault == F::stopped, "once");
  check(p::logged(faulty.law.state, 1).fault == first, "after the first");
  // Before a start, between two, and where the numbers of a start make no sense.
  for (const bool senseless : {false, true}) {
    p::Supervised<Law> early;
    p::stop(early);
    Params bad = held();
    bad.reset_delay = -1;
    if (senseless) check(!p::configure(early, law_params(), bad) && p::fault_of(early.state) == F::configuration, "no sense");
    check(p::configure(early, law_params(), held()) && p::mode_of(early.state) == M::latched, "before a start");
    check(p::fault_of(early.state) == F::stopped && p::logged(early.state, 0).fault == F::stopped, "written down");
  }
  Rig<> again(held());
  again.run(20);
  p::stop(again.law);
  p::configure(again.law, law_params(), held());
  check(again.mode() == M::latched && again.fault() == F::stopped, "between a period and a start");
  again.run(1);
  const std::uint32_t held_token = again.out.challenge;
  p::stop(again.law);
  p::configure(again.law, law_params(), held());
  again.back.token = held_token;
  again.run(60);
  check(again.mode() == M::latched && again.out.challenge != held_token, "a start between two takes the token back, too");
}

/// Numbers that memory lost are not sealed again by a reset.
void no_reset_over_lost_memory() {
  Rig<> rig(held());
  rig.run(20);
  p::stop(rig.law);
  rig.run(1);
  rig.back.token = rig.out.challenge;
  rig.run(14);
  rig.law.controller.law.body.inertia = 7;
  rig.run(1);
  check(p::is_stopped(rig.mode()) && p::logged(rig.law.state, 0).fault == F::integrity, "refused, and written down");
  rig.back.token = rig.out.challenge;
  rig.run(500);
  check(p::is_stopped(rig.mode()) && p::faults_of(rig.state()) <= 3, "for good, without a flood of entries");
}

/// What is without power already stays so where memory is lost: that is written down, and takes back the token.
void lost_while_stopped() {
  for (const M mode : {M::damped_stop, M::zero, M::latched}) {
    Stopped one(held(), mode, 0, 0);
    const std::uint32_t challenge = one.rig.state().challenge.word;
    p::lose_trust(one.rig.law);
    check(one.rig.mode() == (mode == M::latched ? M::latched : M::zero), "no power");
    check(p::logged(one.rig.law.state, 0).fault == F::integrity && one.rig.fault() == F::stopped, "written down after the first");
    check(one.rig.state().challenge.word != challenge, "another token");
  }
  // The same fault of an earlier stop does not hide it; that of this stop is written down once.
  Stopped again(held(), M::latched, 0, 0);
  p::write_down(again.rig.state().log, p::LoggedFault{5, F::integrity, M::zero});
  again.rig.state().steps = 1000;
  const std::uint32_t before = p::faults_of(again.rig.state());
  for (int k = 0; k < 2; ++k) {
    p::lose_trust(again.rig.law);
    check(p::faults_of(again.rig.state()) == before + 1, "once, however long ago the last one was");
  }
}

/// A fault that was written down since this stop began is not written down again; one from before it is.
void log_of_a_stop() {
  for (const std::uint32_t held : {0u, 1u, 7u, 40u})
    for (std::uint32_t ago = 0; ago <= 3 * held + 2; ++ago)
      for (const F kind : {F::jump, F::stale}) {
        State s;
        p::go(s, M::zero, F::jump);
        s.steps = 1000;
        p::put(s.waited, p::ResetProgress{3, 3, held});
        p::write_down(s.log, p::LoggedFault{1000 - ago, kind, M::zero});
        p::stay_shut(s, F::jump);
        const bool told = kind == F::jump && ago <= held;
        check(p::faults_of(s) == (told ? 1u : 2u), "once in a stop");
        const p::ResetProgress waited = p::voted(s.waited);
        check(waited.healthy == 0 && waited.stopped == 0 && waited.held == held, "the way to a reset begins anew, what is held goes on");
      }
  // Another token, also where the numbers that it is made of give the same again.
  for (std::uint32_t mixed = 1; mixed < 400; ++mixed) {
    State s;
    const std::uint32_t same = p::checksum_of(p::checksum_of(mixed, 0), 0x9e3779b9u) | 1u;
    p::put(s.challenge, same);
    s.steps = same ^ mixed;
    p::restart_reset(s, 0);
    check(s.challenge.word != same && s.challenge.word != 0 && p::is_whole(s.challenge), "another one");
  }
}

/// A law's effort with a wave on it: within its stops unless its own is beyond them, within its rate, and its own again
/// where memory lost the last one.
void efforts_with_waves() {
  Params r;
  r.probe.effort = 0.5, r.probe.inertia = 0.05, r.probe.noise = 1e-3, r.probe.energy = 4;
  const auto c = p::coefficients(r, gate());
  auto stops = law_params().gate;
  stops.position_min = -2, stops.position_max = 2, stops.stop_margin = 1;
  const auto limits = p::coefficients(stops);
  for (const S way : {-1.0, 1.0}) {
    const auto made = [&](S effort, S position, S last, S wave, S added = 0) {
      State s;
      s.output = s.drive.asked = way * last;
      s.probe.phase[0] = {wave / 0.5, 0}, s.probe.phase[1] = {0, 0}, s.probe.phase[2] = {0, 0};
      s.probe.phase[0].real *= way;
      s.probe.added = added;
      return way * p::with_probe(c, s, limits, way * effort, way * position);
    };
    check(made(3, 0, 3, 0.25) == 3.25 && made(3, 0, 3, -0.25) == 2.75, "with the wave on it");
    check(made(3, 0, 3, 0) == 3 && made(3, 0, 1, 0) == 3, "its own, to the bit, without one");
    check(made(3, 0, 2.25, 0.25) == 3 && made(3, 0, 4.25, 0.25) == 3.5, "within the rate of the law and that of the wave");
    check(made(3, 0, 0, 20) == 3, "no wave beyond its size");
    check(made(4, 1.5, 4, 0.25) == 4.25 && made(4.875, 1.5, 4.875, 0.25) == 5, "half of the limit before a stop");
    check(made(7, 1.5, 7, 0.25) == 7 && made(7, 1.5, 7, -0.25) == 6.75, "unless its own is beyond it");
    check(made(9.75, 0, 9.75, 0.5) == 10 && made(10, 0, 10, 0.25) == 10, "the limit");
    check(made(9.75, 0, 12, 0.5) == 9.75 && made(5, 0, 30, 0.5) == 5, "its own where memory lost the last one");
    // Half of what may be added is left of 3 J of 4 J: half of the law's effort.
    check(made(4, 0, 2, 0, 3) == 2 && made(4, 0, 2, 0.25, 3) == 2.25, "a drive that is not heard gets less");
    check(made(4, 0, 4, 0, 3) == 3.5, "within the rate");
  }
}

/// What says nothing changes nothing: a joint's encoder that is not heard, a drive beyond what it can give, a silent
/// force sensor; and a wave that asks a joint at rest is no loop that rings.
void what_says_nothing() {
  Params r;
  r.drive.expected = r.joint_expected = 1;
  r.drive.inertia = 1, r.drive.surplus = never, r.drive.tolerance = 1, r.drive.limit = 8;
  r.joint_tolerance = never;
  Seen turns(r);
  turns.starts(0);
  turns.back.joint = {5, 0, 1, true};
  turns.at(0, 0);
  turns.back.joint = {5 + 4 * period, 0, 2, true};
  turns.at(0, 0);
  const S followed = turns.s.drive_velocity;
  check(followed == 2, "half of the new velocity");
  for (const bool valid : {true, false}) {
    turns.back.joint = {9, 0, valid ? 2u : 3u, valid};
    turns.at(0, 0);
    check(turns.s.drive_velocity == followed, "neither seen before nor not valid");
  }
  for (const S given : {8.0, 10.0, 10.5, -10.5, 40.0, -40.0}) {
    Seen drive(r);
    drive.starts(0);
    drive.s.drive.asked = drive.s.drive.asked_before = 0;
    drive.back.drive = {given, 0, 77, true};
    drive.s.drive.silent = drive.s.drive.outside = 0;
    drive.at(0, 0);
    const bool can = std::fabs(given) <= 8 + 1 + 0.15 * 8;
    check((drive.s.drive.silent == 1) != can && (drive.s.drive.outside == 1) == can, "more than it can give is no reading");
  }
  Params felt;
  felt.body.inertia = 1;
  felt.force.expected = 1;
  for (const bool valid : {true, false}) {
    Seen gains(felt);
    gains.in.interaction = {2, 0, 1, valid};
    gains.starts(1);
    gains.s.body.started = true;
    gains.s.unexplained.energy = 0.5;
    gains.at(1, 1);
    check((gains.s.unexplained.energy != 0) == valid, "energy is counted by a sensor that is heard");
  }
  Params rings;
  rings.ringing.limit = 0.015625;
  for (const S amplitude : {0.0, 0.5}) {
    Seen asked(rings);
    asked.starts(0);
    asked.s.ringing.size = 9;
    asked.s.still.amplitude = amplitude;
    check((asked.at(0, 3) == F::ringing) == (amplitude == 0), "a wave that asks rings by itself");
  }
  // What a law remembers does not matter while it is stopped: a hold goes on.
  Rig<> holds(held());
  holds.run(20);
  p::stop(holds.law);
  holds.run(2);
  holds.law.controller.state.gate.position += 1;
  holds.run(3);
  check(holds.mode() == M::damped_stop && p::faults_of(holds.state()) == 1, "a hold goes on");
}

/// What the probe hears of a command is what the drive can give of it, in both of the last two periods.
void what_a_drive_can_give() {
  Params r;
  r.probe.effort = 0.5, r.probe.inertia = 0.05, r.probe.noise = 1e-3;
  r.drive.late = 0;
  for (const S limit : {1.0, never})
    for (const S now : {-3.0, -0.5, 0.0, 0.75, 3.0})
      for (const S last : {-5.0, -0.25, 0.5, 5.0}) {
        r.drive.limit = limit;
        Seen seen(r);
        seen.starts(0);
        seen.s.drive.asked = now, seen.s.drive.asked_before = last;
        seen.at(0, 2);
        const auto given = [limit](S asked) { return asked > limit ? limit : asked < -limit ? -limit : asked; };
        check(seen.s.probe.due == 0.5 * (given(now) + given(last)), "the mean of both");
      }
}

/// While a joint is held: whatever puts encoder or drive in doubt ends the hold, and so does a joint that gets faster.
void doubts_in_a_hold() {
  Params r = held();
  r.encoder.speed_limit = 2;
  for (const S way : {-1.0, 1.0}) {
    const auto ends = [&](S velocity, int after) {
      Rig<> rig(r);
      rig.run(10);
      p::stop(rig.law);
      rig.run(1);
      check(rig.mode() == M::damped_stop && p::voted(rig.state().waited).stopped == 1, "held");
      rig.run(after - 1);
      check(rig.mode() == M::damped_stop && p::voted(rig.state().waited).stopped == static_cast<std::uint32_t>(after), "and held");
      rig.speed = way * velocity;
      rig.run(1);
      return rig.mode() != M::damped_stop;
    };
    check(!ends(1, 40), "slow enough");
    check(!ends(3, 20) && ends(3, 21) && !ends(3, 10), "a joint that runs away, once the hold had its time");
  }
  // A stop that is asked for in every period takes no check away from a hold.
  Rig<> insists(r);
  insists.run(10);
  for (int k = 0; k < 40; ++k) p::stop(insists.law), insists.run(1);
  check(insists.mode() == M::damped_stop && p::voted(insists.state().waited).stopped == 1, "held");
  insists.speed = 3;
  p::stop(insists.law);
  insists.run(1);
  check(insists.mode() != M::damped_stop, "a joint that runs away meanwhile");
  const auto entered = [&](auto&& wrong, const Params& rules) {
    Rig<> rig(rules);
    rig.run(10);
    p::stop(rig.law);
    rig.run(5);
    rig.read();
    wrong(rig);
    rig.step();
    return rig.mode();
  };
  check(entered([](Rig<>& rig) { rig.in.position.value = nan; }, r) != M::damped_stop, "no encoder");
  check(entered([](Rig<>&) {}, r) == M::damped_stop, "all well");
  Params jumps = r;
  jumps.encoder.speed_limit = never;
  jumps.encoder.acceleration_limit = 100;
  check(entered([](Rig<>& rig) { rig.in.position.value += 1; }, jumps) != M::damped_stop, "a jump");
  Params pushes = r;
  pushes.budget.push_limit = 1;
  check(entered([](Rig<>& rig) { rig.state().drive.asked = rig.state().drive.asked_before = 3; }, pushes) == M::damped_stop,
        "what a hold can bear");
  // What was wrong at the stop is written down; clocks may begin anew.
  Rig<> clock(r);
  clock.run(10);
  p::stop(clock.law);
  clock.run(5);
  clock.now -= 900000;
  clock.count = 3;
  clock.run(1);
  check(clock.mode() != M::damped_stop && clock.law.controller.fault == F::out_of_order, "a clock that went back");
  clock.run(1);
  check(clock.law.controller.fault == F::none, "and goes on from there");
}

// --- the test at start-up and the law --------------------------------------------------------------------------------

void start_up() {
  Params r;
  r.test = {2, 16, 5, 0.0, never};
  r.rest_speed = 0.25;
  Rig<> rig(r);
  check(rig.mode() == M::start_up, "a test first");
  rig.run(5);
  check(rig.out.effort == 0 && rig.out.enable, "rest, with power");
  S most = 0, least = 0, before = 0;
  int k = 0;
  for (; k < 99 && rig.mode() == M::start_up; ++k) {
    rig.speed = 0.5 * rig.out.effort;
    rig.run(1);
    check(std::fabs(rig.out.effort - before) <= 0.5 && rig.state().test.pushed == rig.out.effort, "within the rate");
    before = rig.out.effort;
    most = std::fmax(most, rig.out.effort), least = std::fmin(least, rig.out.effort);
  }
  check(k == 33 + 5 && rig.mode() == M::running && rig.fault() == F::none, "then it runs");
  check(most > 1.9 && least < -1.9, "up and down");
  check(rig.state().body.lasting == 0 && rig.state().budget.spent == 0 && rig.state().ringing.size == 0, "from the beginning");
  check(rig.law.controller.state.gate.output == rig.out.effort, "and from the wave's end");
  const auto tested = [](S effort, S answer, S low, S high) {
    Params one;
    one.test = {effort, 64, 2, low, high};
    Rig<> joint(one);
    S largest = 0;
    for (int i = 0; i < 800 && joint.mode() == M::start_up; ++i) {
      const S last = joint.out.effort;
      joint.speed = answer * last;
      joint.run(1);
      check(std::fabs(joint.out.effort - last) <= 0.5, "within the rate");
      largest = std::fmax(largest, std::fabs(joint.out.effort));
    }
    check(largest <= 10, "within the law's limit");
    return largest > 9.99 ? F::none : joint.fault();
  };
  check(tested(30, 0.001, 0, never) == F::none, "an effort beyond the limit is cut off");
  check(tested(2, -0.1, 0.001, never) == F::polarity, "the other way");
  check(tested(2, 0.1, 0.0001, 0.001) == F::gain, "too much");
  // What a sensor contradicts is no matter of the test.
  Params quiet = r;
  quiet.force.expected = 1;
  Rig<> silent(quiet);
  silent.run(20);
  check(silent.mode() == M::start_up && silent.state().force.quiet == 0, "sensors are judged once it runs");
}

/// A law that is degraded hears neither sensor.
void degraded() {
  Params r;
  r.degrades = 1;
  r.force = {1, 50, 2};
  using T = p::TransparentCompensation<S>;
  Rig<T> rig(r), other(r);
  for (int k = 0; k < 300; ++k)
    for (Rig<T>* one : {&rig, &other}) {
      one->read();
      const S said = k < 100 ? 0.001 * k : k < 102 ? 3 : one == &rig ? 1 : -1;
      one->in.interaction = one->in.muscle = {said, one->now, one->count, true};
      one->step();
      if (k == 100 || k == 101) continue;  // sensors are judged in every second period
      check(one->mode() == (k < 100 ? M::running : M::degraded) && one->out.enable, "goes on with less");
      check(one->out.fault == (k < 100 ? F::none : F::force_sensor) && one->out.challenge == 0, "and says why");
    }
  check(rig.out.effort == other.out.effort && rig.out.effort != 0, "whatever is said again");
}

/// What the front of the law finds stops it in the same period, and what its gate finds, too.
void fronts() {
  Rig<> rig(held());
  rig.run(20);
  const S before = rig.out.effort;
  check(before != 0 && rig.out.challenge == 0 && rig.out.beat == 20, "it runs");
  rig.read();
  rig.in.position.time -= 900000;
  rig.step();
  check(rig.out.fault == F::stale && !rig.out.enable && rig.out.challenge != 0, "a clock");
  check(std::fabs(rig.out.effort) <= std::fabs(before) && std::fabs(rig.out.effort - before) <= 0.5, "ramps");
  check(rig.state().drive.asked == rig.out.effort, "asked for");
  Rig<> fast(held());
  fast.law.controller.law.gate.params.velocity_limit = 0.5;
  fast.law.controller.law.gate.max_way = 0.5 * period;
  p::seal(fast.law);
  fast.speed = 4;
  for (int k = 0; k < 60; ++k) {
    fast.run(1);
    check((fast.law.controller.state.gate.fault == F::none) == (fast.out.fault == F::none), "in the same period");
  }
  check(fast.out.fault == F::velocity && fast.out.mode == M::damped_stop && fast.out.enable, "the gate's limit");
  check(fast.law.controller.steps > 0 && fast.state().steps == 60, "steps");
}

}  // namespace

int main() {
  parameters();
  answers();
  transitions();
  configured();
  memory();
  new_samples();
  two_encoders();
  slow_watches();
  momentum();
  drive_and_order();
  late_drives();
  sensors();
  last_effort();
  efforts();
  resets();
  stops();
  no_reset_over_lost_memory();
  lost_while_stopped();
  log_of_a_stop();
  starts_of_broken_memory();
  efforts_with_waves();
  what_says_nothing();
  what_a_drive_can_give();
  doubts_in_a_hold();
  start_up();
  degraded();
  fronts();
  return failures();
}
