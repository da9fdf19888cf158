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
  m.s.body.lasting = -1, m.s.body.open = 0.5, m.s.body.residual = 3, m.s.body.level = 0.25;
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

}  // namespace

int main() {
  encoders();
  drives();
  people_and_sensors();
  tests_and_probes();
  return failures();
}
