// What each watch shows of a period that is made by hand, and beside which threshold: when it watches, and when it does not.
#include "check.hpp"

#include <pellucid/joint_compensation.hpp>
#include <pellucid/supervisor_watches.hpp>

#include <cstring>
#include <initializer_list>

namespace p = pellucid;

namespace {

using S = double;
using M = p::Mode;
constexpr S never = std::numeric_limits<S>::infinity();
constexpr S period = 0x1p-10;

/// A period of a supervisor whose every watch has a threshold of its own.
struct Made {
  p::SupervisorParams<S> params{};
  p::SafetyCoefficients<S> gate{};
  p::SupervisorCoefficients<S> c{};
  p::SupervisorState<S> s{};
  p::WatchedState<S> before{}, shown{};
  p::Samples<S> read{};
  p::Feedback<S> back{};
  std::int64_t now = 0;

  Made() {
    p::SafetyParams<S> law;
    law.effort_limit = 8, law.rate_limit = 100, law.period = period;
    law.max_age = 0.005, law.max_repeats = 3, law.velocity_limit = 8;
    law.position_min = -2, law.position_max = 2, law.stop_margin = 0.25;
    gate = p::coefficients(law);
    params.encoder = {6, 2000, -1, 4, 1e-4, 0.5, 20};
    params.body.inertia = 0.05;
    params.body.wearer_torque = 2, params.body.wearer_push = 4;
    params.body.force_tolerance = 3, params.body.force_burst = 5, params.body.force_excess = 7;
    params.force.expected = params.muscle.expected = params.joint_expected = params.drive.expected = 1;
    params.force.range = 25, params.muscle.range = 30;
    params.joint_tolerance = 0.25;
    params.drive.tolerance = 0.5, params.drive.relative = 0.25, params.drive.limit = 10, params.drive.surplus = 0.75;
    params.budget = {9, 40, 5, 0.5};
    params.ringing.limit = 2;
    params.shaking.limit = 0.375;
    params.test.samples = 32, params.test.most = 3, params.test.least = 1;
    params.probe.effort = 0.5, params.probe.inertia = 0.05, params.probe.noise = 1e-3, params.probe.travel = 1;
    params.unexplained.limit = 1.25;
    params.delay = {0.01, 0.5, 20, 1e-3, 0.5};
    make();
    p::go(s, M::running, p::SafetyFault::none);
    before.mode = static_cast<std::uint32_t>(M::running);
    before.heard = s.encoder.heard = 3;
    s.joint_started = true;
    read.position = read.interaction = read.muscle = {1, 0, 5, true};
    back.drive = back.joint = {1, 0, 5, true};
    before.drive_seen = 4;
  }
  void make() { c = p::coefficients(params, gate); }
};

struct Named {
  const char* name;
  p::ShownWatch<S> found{};
  int times = 0;
  template <class... Shown> void operator()(const Shown&... all) {
    ((std::strcmp(all.watch.name, name) == 0 ? void((found = all, ++times)) : void()), ...);
  }
};
p::ShownWatch<S> shown(const Made& m, const char* name) {
  Named named{name};
  p::walk_watches(p::WatchedPeriod<S>{m.c, m.gate, m.s, m.before, m.read, m.back, m.now}, m.shown, named);
  check(named.times == 1, name);
  return named.found;
}
void shows(const Made& m, const char* name, S value, S threshold) {
  const auto one = shown(m, name);
  check_close(one.value, value, 1e-12, name);
  check(one.threshold == threshold || std::fabs(one.threshold - threshold) < 1e-12 * std::fabs(threshold), name);
}
bool watches(const Made& m, const char* name) { return shown(m, name).threshold < never; }

/// A watch that asks for something does not watch without it.
template <class Without> void asks(const char* name, Without without) {
  Made m;
  check(watches(m, name), name);
  without(m);
  m.make();
  check(!watches(m, name), name);
}

void encoders() {
  Made m;
  check(m.c.valid == 1, "makes sense");
  const S blur = 2 * 1e-4 / period;
  m.s.encoder.velocity = -3, m.before.velocity = 1;
  shows(m, "raw_speed", -3, 6 + blur);
  shows(m, "raw_acceleration", -4 / period, 2000 + 2 * blur / period);
  asks("raw_acceleration", [](Made& x) { x.before.heard = 2; });
  asks("raw_acceleration", [](Made& x) { x.s.encoder.heard = 2; });
  // The time between two readings, unless it is the period or so long that nobody knows it.
  m.before.time = 5000;
  for (const std::uint32_t gap : {2000u, 1000000u, 1000001u, 0u, m.c.encoder.micros}) {
    m.s.encoder.time = m.before.time + gap;
    const bool known = gap == 2000u || gap == 1000000u;
    const S passed = known ? 1e-6 * gap : period;
    shows(m, "raw_acceleration", -4 / passed, 2000 + 4 * 1e-4 / passed / passed);
  }
  m.s.encoder.position = 3.5;
  shows(m, "range", 2, 2.5);
  asks("range", [](Made& x) { x.params.encoder.range_max = never; });
  asks("range", [](Made& x) { x.params.encoder.range_min = -never; });
  m.s.encoder.equal = 7;
  for (const S fast : {-0.501, 0.501}) {
    m.s.encoder.before = fast;
    shows(m, "encoder_freeze", 7, 20);
  }
  for (const S slow : {-0.5, 0.5}) {
    m.s.encoder.before = slow;
    shows(m, "encoder_freeze", 0, 20);
  }
  m.read.position.value = 1, m.back.joint.value = 0.25, m.s.joint_offset = 0.5;
  shows(m, "joint_difference", 0.25, 0.25);
  asks("joint_difference", [](Made& x) { x.s.joint_started = false; });
  asks("joint_difference", [](Made& x) { x.read.position.valid = false; });
  asks("joint_difference", [](Made& x) { x.back.joint.valid = false; });
  asks("joint_difference", [](Made& x) { x.params.joint_expected = 0; });
  asks("joint_silence", [](Made& x) { x.params.joint_expected = 0; });
}

void drives() {
  Made m;
  m.before.drive.asked = m.before.drive.asked_before = m.before.drive.due = 2;
  m.before.drive.outside = 3, m.before.drive.silent = 2;
  // 0.5 and a quarter of 2.
  for (const S way : {-1.0, 1.0}) {
    m.back.drive.value = 2 + way;
    shows(m, "drive_difference", way, 1);
    shows(m, "drive_outside", 0, 4);
    m.back.drive.value = 2 + way * 1.01;
    shows(m, "drive_outside", 4, 4);
  }
  shows(m, "drive_silence", 0, 4);
  Made twice = m;
  twice.params.drive.answer = 2, twice.back.drive.value = 6, twice.make();
  shows(twice, "drive_difference", 1, 1);
  m.back.drive.sequence = 4;  // seen before
  check(!watches(m, "drive_difference"), "seen before");
  shows(m, "drive_outside", 0, 4);
  shows(m, "drive_silence", 3, 4);
  asks("drive_difference", [](Made& x) { x.back.drive.valid = false; });
  for (const char* name : {"drive_difference", "drive_outside", "drive_surplus", "drive_silence"})
    asks(name, [](Made& x) { x.params.drive.expected = 0; });
  // Late by a tenth of what the rate varies, of which it explains all or too little.
  Made late;
  late.s.delay.count = 1e6;
  late.s.delay.aa = 1, late.s.delay.rr = 1, late.s.delay.er = 0.0625, late.s.delay.ee = 0.0625 * 0.0625;
  shows(late, "drive_delay", 0.0625, 0.01);
  late.s.delay.ee = 0.009;
  shows(late, "drive_delay", 0, never);
  late.s.delay.ee = 0.001;
  late.params.drive.expected = 0;
  late.make();
  check(!watches(late, "drive_delay"), "no drive that measures");
}

void people_and_sensors() {
  Made m;
  m.s.body.lasting = -1, m.s.body.open = 0.5, m.s.body.push = 3, m.s.body.level = 0.25;
  shows(m, "residual_lasting", -1, 2.5);
  shows(m, "residual_push", 3, 4.25);
  for (const char* name : {"residual_lasting", "residual_push"}) {
    asks(name, [](Made& x) { x.params.body.inertia = 0; });
    asks(name, [](Made& x) { x.before.mode = static_cast<std::uint32_t>(M::start_up); });
  }
  for (const char* name : {"force_contradiction", "force_burst", "force_excess", "unexplained_energy"}) {
    asks(name, [](Made& x) { x.params.body.inertia = 0; });
    asks(name, [](Made& x) { x.params.force.expected = 0; });
  }
  asks("unexplained_energy", [](Made& x) { x.before.mode = static_cast<std::uint32_t>(M::degraded); });
  for (const char* name : {"force_range", "force_silence"}) {
    asks(name, [](Made& x) { x.params.force.expected = 0; });
    asks(name, [](Made& x) { x.before.mode = static_cast<std::uint32_t>(M::zero); });
  }
  for (const char* name : {"muscle_range", "muscle_silence"}) {
    asks(name, [](Made& x) { x.params.muscle.expected = 0; });
    asks(name, [](Made& x) { x.before.mode = static_cast<std::uint32_t>(M::zero); });
  }
  m.read.interaction.value = -3, m.read.muscle.value = 4;
  shows(m, "force_range", -3, 25);
  shows(m, "muscle_range", 4, 30);
  m.read.interaction.valid = m.read.muscle.valid = false;
  shows(m, "force_range", 0, 25);
  shows(m, "muscle_range", 0, 30);
  asks("shaking", [](Made& x) { x.before.mode = static_cast<std::uint32_t>(M::start_up); });
}

void tests_and_probes() {
  Made m;
  m.before.mode = static_cast<std::uint32_t>(M::start_up);
  m.s.test.middle = 2;
  m.s.test.count = 33;
  check(shown(m, "test_work").threshold == 3 && shown(m, "test_return").threshold == 1, "the wave is over");
  m.s.test.count = 32;
  check(!watches(m, "test_work") && !watches(m, "test_return"), "a wave that is not over says nothing");
  m.s.test.count = 20;
  check(!watches(m, "test_work"), "nor one in its middle");
  m.s.test.count = 33;
  p::go(m.s, M::start_up, p::SafetyFault::none);
  check(!watches(m, "test_work"), "while it is tested");
  p::go(m.s, M::running, p::SafetyFault::none);
  m.before.mode = static_cast<std::uint32_t>(M::running);
  check(!watches(m, "test_work"), "nor long after");
  Made probed;
  for (std::uint32_t k = 0; k < p::probe_sum_count; ++k) probed.s.probe.sum[k] = 2 + k;
  shows(probed, "probe_reversed", 2, probed.params.probe.evidence);
  shows(probed, "probe_gain", 3, probed.params.probe.evidence);
  shows(probed, "probe_unanswered", 4, probed.params.probe.evidence);
  shows(probed, "probe_late", 1 + p::probe_sum_count, probed.params.probe.evidence);
  for (std::uint32_t k = 3; k < p::probe_sum_count; ++k) {
    for (S& sum : probed.s.probe.sum) sum = 99;
    for (std::uint32_t j = 3; j < p::probe_sum_count; ++j) probed.s.probe.sum[j] = j == k ? 7 : 1;
    shows(probed, "probe_late", 7, probed.params.probe.evidence);
  }
  for (const char* name : {"probe_reversed", "probe_gain", "probe_unanswered", "probe_late", "probe_travel"}) {
    asks(name, [](Made& x) { x.params.probe.effort = 0; });
    asks(name, [](Made& x) { x.before.mode = static_cast<std::uint32_t>(M::zero); });
  }
}

/// Ages, silences and intervals: what each counts, in seconds or periods, beside when it is too much.
void times_and_counts() {
  Made m;
  m.params.rate = {64, 0.25};
  m.params.still.samples = 50, m.params.still.effort = 2;
  m.make();
  m.now = 9000, m.read.position.time = 6500;
  shows(m, "sample_age", 2.5e-3, 0.005);
  m.s.encoder.equal = 41;
  shows(m, "encoder_still", 41, 150);
  for (const M mode : {M::start_up, M::zero}) {
    Made x = m;
    x.before.mode = static_cast<std::uint32_t>(mode);
    check(!watches(x, "encoder_still"), "no wave asks");
  }
  Made unasked = m;
  unasked.params.still.effort = 0;
  unasked.make();
  check(!watches(unasked, "encoder_still"), "without a wave nothing is asked");
  m.s.clock.last = 5000, m.s.clock.turned = 1000, m.s.rate.began = 2000, m.s.rate.count = 3;
  shows(m, "rate", 0.004 - 3 * period, 1e-6 * m.c.rate.most - 64 * period);
  check_close(shown(m, "rate").threshold, 0.25 * 64 * period, 2e-6, "a quarter of the time of all");
  m.params.rate.samples = 0;
  m.make();
  check(!watches(m, "rate"), "no rate");
  m.s.joint_silent = 2;
  shows(m, "joint_silence", 2, 5);
  for (const M mode : {M::running, M::degraded}) {
    Made x;
    x.before.mode = static_cast<std::uint32_t>(mode);
    x.s.force.quiet = 7, x.s.muscle.quiet = 8;
    for (const char* name : {"residual_lasting", "residual_push", "force_range", "force_silence", "muscle_range", "muscle_silence", "shaking", "probe_gain"})
      check(watches(x, name), "a law that carries is watched");
    shows(x, "force_silence", 7, x.params.force.quiet_samples);
    shows(x, "muscle_silence", 8, x.params.muscle.quiet_samples);
  }
}

/// Where an end of the range is open, the position itself is shown.
void open_ranges() {
  for (const bool upper : {false, true}) {
    Made m;
    (upper ? m.params.encoder.range_max : m.params.encoder.range_min) = upper ? never : -never;
    m.make();
    m.s.encoder.position = 3.5;
    shows(m, "range", 3.5, never);
  }
}

/// A drive's difference from what it can be asked for, and the energy beyond it, of a reading that counts.
void drive_accounts() {
  for (const S way : {-1.0, 1.0}) {
    Made m;
    m.params.drive.gain = 0, m.params.drive.offset = 0;
    m.make();
    m.before.drive.asked = m.before.drive.asked_before = way * 14;
    m.before.drive.due = way * 10;
    m.before.drive.surplus = m.before.drive.inert_surplus = 0.25;
    m.back.drive.value = way * 11;
    shows(m, "drive_difference", way, 3);
    m.s.encoder.velocity = way * 2;
    const S added = 2 * period;  // 1 N m beyond what it can be asked for, at 2 rad/s
    check(shown(m, "drive_surplus").value > 0.25, "what it adds counts");
    check_close(shown(m, "drive_surplus").value, (1 - m.c.params.drive.forget) * 0.25 + added, 1e-12, "by its energy");
    check(shown(m, "drive_surplus").threshold == 0.75, "beside its limit");
    for (const S none : {way * 13.1, way * 40}) {
      Made x = m;
      x.before.drive.silent = 2;
      x.back.drive.value = none;
      shows(x, "drive_surplus", 0.25, 0.75);
      shows(x, "drive_silence", 3, 4);
      check(!watches(x, "drive_difference"), "more than it can give is no reading");
    }
    Made old = m;
    old.back.drive.sequence = 4;
    shows(old, "drive_surplus", 0.25, 0.75);
    Made unexpected = m;
    unexpected.params.drive.expected = 0;
    unexpected.make();
    unexpected.back.drive.value = -way * 9;
    shows(unexpected, "drive_surplus", 0.25, never);
    shows(unexpected, "drive_outside", 0, never);
  }
}

/// What an elastic period of the force sensor allows, and the second half of a wave at which the first hardly moved.
void widened_limits() {
  Made m;
  m.s.body.contradiction = -2, m.s.body.open = 0.5, m.s.body.burst = 1, m.s.body.level = 0.25, m.s.body.excess = 6;
  shows(m, "force_contradiction", -2, 3.5);
  shows(m, "force_burst", 1, 5.25);
  shows(m, "force_excess", 6, 7);
  m.s.budget.spent = 4, m.s.budget.power = -5, m.s.ringing.size = 1.5, m.s.shaking.smallest = 0.25, m.s.unexplained.energy = 0.5;
  m.shown.pushed = 3;
  shows(m, "budget_spent", 4, m.params.budget.store);
  shows(m, "ringing", 1.5, m.c.ringing.limit);
  shows(m, "shaking", 0.25, m.c.shaking.limit);
  shows(m, "unexplained_energy", 0.5, 1.25);
  shows(m, "push", 3, m.params.budget.push_limit);
  shows(m, "power", -5, m.params.budget.power_limit);
  const p::Unit unit = shown(m, "power").watch.unit;
  check(unit.effort == 1 && unit.coordinate == 1 && unit.time == -1, "power is effort times speed");
  m.before.mode = static_cast<std::uint32_t>(M::start_up);
  m.s.test.count = 65;
  m.s.test.work = 2.75, m.s.test.middle = 0.5;  // less than the least work of 1
  shows(m, "test_work", 2.25, 3);
  shows(m, "test_return", 2.25, 1);
  m.s.test.middle = 1.5;
  shows(m, "test_work", 1.5, 3);
  Made late;
  for (std::uint32_t k = 3; k < p::probe_sum_count; ++k) {
    for (S& sum : late.s.probe.sum) sum = 4;
    late.s.probe.sum[k] = 7;
    shows(late, "probe_late", 7, late.params.probe.evidence);
  }
}

/// What the next period needs of this one: the effort of every second step, the state of each.
void notes_of_a_period() {
  for (const S way : {-1.0, 1.0})
    for (const M mode : {M::running, M::degraded, M::zero, M::start_up}) {
      Made m;
      m.before.mode = static_cast<std::uint32_t>(mode);
      m.before.drive.asked = way * 3, m.before.drive.asked_before = way * 2;
      m.before.velocity = 1, m.s.encoder.velocity = 4, m.s.encoder.time = 77, m.s.encoder.heard = 2, m.s.drive_seen = 9;
      m.s.body.weight = 1, m.s.body.drag = 0.25;
      m.s.drive.asked = way * 5;
      p::WatchedState<S> next;
      next.pushed = 90;
      const bool carries = mode == M::running || mode == M::degraded;
      for (const std::uint32_t steps : {2u, 3u}) {
        m.s.steps = steps;
        p::note_before(p::WatchedPeriod<S>{m.c, m.gate, m.s, m.before, m.read, m.back, m.now}, next);
        const S pushed = std::fabs(way * 2.5 - (carries ? 1 : 0)) - 0.25;
        check(next.pushed == (steps == 2 ? 90 : pushed), "the push of every second step");
        check(next.velocity == 4 && next.time == 77 && next.heard == 2 && next.drive_seen == 9 && next.drive.asked == way * 5, "its state");
        check(next.mode == static_cast<std::uint32_t>(p::mode_of(m.s)), "and mode");
      }
    }
}

}  // namespace

int main() {
  times_and_counts();
  open_ranges();
  drive_accounts();
  widened_limits();
  notes_of_a_period();
  encoders();
  drives();
  people_and_sensors();
  tests_and_probes();
  return failures();
}
