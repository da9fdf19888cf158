// The supervisor: a healthy run passes to the bit, every fault is answered, nothing but a token ends it.
#include "check.hpp"
#include "law_numbers.hpp"

#include <pellucid/laws.hpp>
#include <pellucid/supervisor.hpp>
#include <pellucid/watchdog.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
using M = p::Mode;

template <class S> p::SupervisorParams<S> rules() {
  p::SupervisorParams<S> r;
  r.encoder = {S(8), S(2000), S(-0.1), S(2.7), S(1e-4), S(0.5), 20};
  r.body.inertia = S(0.05);
  r.body.gravity_sine = S(2);
  r.body.gravity_cosine = S(0.3);
  r.body.offset = S(0.1);
  r.body.coulomb = S(0.25);
  r.body.load = S(0.13);
  r.body.viscous = S(0.05);
  r.drive.expected = 1;
  r.drive.tolerance = S(0.5);
  r.hold = {S(2.5), S(4)};
  r.reset_delay = S(0.1);
  r.healthy_samples = 50;
  return r;
}

/// A joint that swings as it is told, under a supervised law.
template <class S, template <class> class L = p::JointCompensation> struct Rig {
  p::Supervised<L<S>> law{};
  p::SupervisorOutput<S> out{};
  S place = S(1.2), speed = S(0.4), given_more = S(0);
  std::int64_t now = 1000000;
  std::uint32_t count = 100;
  std::uint32_t token = 0;
  p::Samples<S> in{};
  p::Feedback<S> back{};

  explicit Rig(const p::SupervisorParams<S>& r = rules<S>()) {
    check(p::configure(law, typical_params<typename L<S>::Params>(), r), "the example makes sense");
  }
  void read() {
    now += 1000;
    ++count;
    place = place + speed * S(1e-3);
    in = {};
    in.position = {place, now, count, true};
    back.drive = {law.state.output + given_more, now, count, true};
    back.token = token;
  }
  void step() { out = p::step(law, in, back, now); }
  void run(int n) {
    for (int k = 0; k < n; ++k) read(), step();
  }
};

template <class S> void healthy_runs_pass() {
  p::Laws::for_each([](auto of) {
    using L = typename decltype(of)::template law<S>;
    p::SupervisorParams<S> r = rules<S>();
    r.body = {};
    p::Supervised<L> watched;
    p::Controller<L> alone;
    check(p::configure(watched, typical_params<typename L::Params>(), r), L::name);
    p::configure(alone, typical_params<typename L::Params>());
    long different = 0, moving = 0;
    for (std::uint32_t k = 1; k < 20000; ++k) {
      const std::int64_t now = 1000 * static_cast<std::int64_t>(k);
      const S q = S(1.2) + S(0.5) * p::sin(S(0.004) * static_cast<S>(k % 1571));
      const p::Sample<S> felt{S(0.3) * p::cos(S(0.01) * static_cast<S>(k % 629)), now, k, k % 7 != 0};
      p::Samples<S> in{{q, now, k, true}, {felt.value, now, k, true}, felt, felt};
      const p::Feedback<S> back{{watched.state.output, now, k, true}, {}, 0};
      const S safe = p::step(watched, in, back, now).effort, bare = p::step(alone, in, now);
      different += p::bits_of(safe) != p::bits_of(bare);
      moving += bare != S(0);
    }
    check(different == 0 && moving > 10000, L::name);
    check(p::mode_of(watched.state) == M::running && p::faults_of(watched.state) == 0, "no fault in a healthy run");
  });
}

template <class S, class Wrong> void answers(F fault, M mode, int within, Wrong&& wrong) {
  Rig<S> rig;
  rig.run(300);
  check(rig.out.mode == M::running && rig.out.enable && rig.out.effort != S(0), "it runs");
  int k = 0;
  while (k < 300 && rig.out.fault == F::none) {
    rig.read();
    wrong(rig, k++);
    rig.step();
  }
  check(rig.out.fault == fault, p::safety_fault_names[static_cast<std::size_t>(fault)]);
  check(k <= within, "in time");
  check(rig.out.mode == mode || (mode == M::zero && rig.out.mode == M::latched), "and answers as it should");
  check(rig.out.enable == (mode == M::damped_stop), "power only to hold");
  check(p::logged(rig.law.state, 0).fault == fault, "written down");
}

template <class S> void faults() {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  using R = Rig<S>;
  answers<S>(F::jump, M::zero, 1, [](R& r, int) { r.in.position.value = r.place + S(1); });
  answers<S>(F::jump, M::zero, 1, [](R& r, int) { r.in.position.value = r.place + S(0.01); });
  answers<S>(F::not_finite, M::zero, 1, [&](R& r, int) { r.in.position.value = nan; });
  answers<S>(F::frozen, M::zero, 21, [](R& r, int k) {
    r.speed = S(0);
    if (k == 0) r.place = r.law.state.encoder.position + S(0.0004) * S(2), r.in.position.value = r.place;
    else r.in.position.value = r.place;
  });
  answers<S>(F::drive_stuck, M::zero, 4, [](R& r, int) { r.back.drive.value = S(5); });
  answers<S>(F::drive_sign, M::zero, 4, [](R& r, int k) { r.back.drive.value = -r.back.drive.value - S(0.2) * static_cast<S>(k); });
  // Within its tolerance, but always the way the joint goes.
  answers<S>(F::drive_effort, M::zero, 200, [](R& r, int k) {
    r.law.supervisor.params.drive.surplus = S(0.02);
    if (k == 0) p::seal(r.law);
    r.back.drive.value = r.back.drive.value + (r.speed > S(0) ? S(0.4) : S(-0.4));
  });
  answers<S>(F::drive_silent, M::zero, 4, [](R& r, int) { r.back.drive.valid = false; });
  // An effort that is right, of a body that the watch takes for one that weighs another way.
  answers<S>(F::push, M::damped_stop, 4, [](R& r, int k) {
    if (k != 0) return;
    r.law.supervisor.params.budget.push_limit = S(1);
    r.law.supervisor.body.params.gravity_sine = S(-2);
    p::seal(r.law);
  });
  answers<S>(F::stopped, M::damped_stop, 1, [](R& r, int) { p::stop(r.law); });
  answers<S>(F::integrity, M::zero, 1, [](R& r, int) { r.law.state.doing.word ^= 2u; });
  answers<S>(F::integrity, M::zero, 300, [](R& r, int k) { if (k == 0) r.law.controller.law.friction_share = S(0.81); });
  answers<S>(F::integrity, M::zero, 300, [](R& r, int k) { if (k == 0) r.law.supervisor.params.encoder.speed_limit = S(900); });
  // What the law remembers changes in its own period alone, and is looked at before each.
  answers<S>(F::integrity, M::zero, 1, [](R& r, int k) {
    if (k == 0) r.law.controller.state.gate.output = r.law.controller.state.gate.output + S(0.001);
  });
}

/// An effort that goes to and fro 15 times a second is found; the same one slowly, or as fast as dither, is not.
template <class S> void ringing() {
  for (const double frequency : {1.0, 15.0, 250.0}) {
    p::RingingWatchParams<S> r;
    r.limit = S(0.5);
    const auto c = p::coefficients(r, S(0.001));
    p::RingingWatchState<S> state;
    long found = 0, first = 0;
    for (int k = 0; k < 5000; ++k) {
      const S effort = S(2) * p::sin(static_cast<S>(std::fmod(6.283185307179586 * frequency * 0.001 * k, 6.283185307179586)));
      const bool rings = p::step(c, state, effort) == F::ringing;
      if (rings && found++ == 0) first = k;
    }
    check((found > 0) == (frequency == 15.0), "ringing is what lies between");
    check(first < 500, "and it is soon found");
    p::step(c, state, std::numeric_limits<S>::quiet_NaN());
    check(state.size == S(0), "no number is forgotten at once");
  }
}

/// A probe whose answer is right changes nothing but the effort, within every limit; one that is wrong takes the power.
template <class S> void probes() {
  for (const double gain : {1.0, -1.0, 3.0, 0.0}) {
    p::SupervisorParams<S> r = rules<S>();
    r.body = {};
    r.drive = {};
    r.encoder.resolution = S(4e-4);
    r.probe.effort = S(0.4);
    r.probe.inertia = S(0.05);
    r.probe.noise = S(1e-6);
    Rig<S> rig(r);
    Rig<S> plain([&] {
      p::SupervisorParams<S> off = r;
      off.probe = {};
      return off;
    }());
    double place = 0, speed = 0, time = 0, added = 0, most = 0, change = 0, last = 0;
    int found = 0;
    for (int k = 0; k < 16000 && rig.out.fault == F::none; ++k) {
      speed = 0.999 * (speed + 1e-3 * (k > 12000 ? gain : 1.0) * added / 0.05);
      place += 1e-3 * speed;
      time += 1e-3;
      const double way = 1.3 + 0.5 * std::sin(2.0 * time);
      rig.place = plain.place = S(0), rig.speed = plain.speed = S(0);
      rig.read(), plain.read();
      rig.in.position.value = static_cast<S>(way + place);
      plain.in.position.value = static_cast<S>(way + place);
      rig.step(), plain.step();
      const S own = rig.law.controller.state.gate.output;
      if (rig.out.fault == F::none) {
        check(own == plain.out.effort, "the law hears nothing of it");
        added = static_cast<double>(rig.out.effort - own);
        most = std::fmax(most, std::fabs(added));
        change = std::fmax(change, std::fabs(static_cast<double>(rig.out.effort) - last));
        last = static_cast<double>(rig.out.effort);
        if (k > 12000) ++found;
      }
      check(std::fabs(rig.out.effort) <= S(10), "within the limit");
    }
    check(most > 0.5 && most <= 0.4 * p::probe_crest + 1e-5, "the whole wave");
    check(change <= 0.501 + static_cast<double>(rig.law.supervisor.probe.steepest), "within the rate of law and waves");
    const F wanted = gain > 1 ? F::gain : gain == 0 ? F::unanswered : gain < 0 ? F::polarity : F::none;
    check(rig.out.fault == wanted, p::safety_fault_names[static_cast<std::size_t>(wanted)]);
    if (gain == 1) continue;
    check(found <= 600, "in time");
    check(rig.out.mode == M::zero && !rig.out.enable, "without power");
    rig.run(300);
    check(rig.out.effort == S(0), "and then without effort");
  }
  // At a stop, and at the limit, the law's own effort stays.
  p::SupervisorParams<S> r = rules<S>();
  r.probe.effort = S(4);
  r.probe.inertia = S(1);
  Rig<S> rig(r);
  const auto& c = rig.law.supervisor;
  const auto& gate = rig.law.controller.law.gate;
  p::SupervisorState<S> s;
  for (int k = 0; k < 240; ++k) {
    p::step(c.probe, s.probe, S(0), S(0), S(0));
    const S added = p::wave(c.probe, s.probe);
    for (const S effort : {S(-10), S(-9.9), S(-7.5), S(0), S(7.5), S(9.9), S(10)}) {
      s.output = s.drive.asked = effort;
      const S middle = p::with_probe(c, s, gate, effort, S(0.5) * (gate.params.position_min + gate.params.position_max));
      check(p::abs(middle) <= S(10) && p::abs(middle - effort) <= c.max_change + c.probe.steepest, "within limit and rate");
      check(p::abs(effort) > S(9) || added == S(0) || p::same_sign(middle - effort, added), "the way of the wave");
      check(p::abs(effort) != S(7.5) || added == S(0) || middle != effort, "beyond half of the limit, too");
      const S high = p::with_probe(c, s, gate, effort, gate.params.position_max);
      check(high <= p::max(effort, S(0)), "not into the upper stop");
      const S low = p::with_probe(c, s, gate, effort, gate.params.position_min);
      check(low >= p::min(effort, S(0)), "nor into the lower");
      const S phase = s.probe.phase[0].real;
      s.probe.phase[0].real = std::numeric_limits<S>::quiet_NaN();
      check(p::with_probe(c, s, gate, effort, S(1)) == effort, "no number is no wave");
      s.probe.phase[0].real = phase;
    }
  }
  // Once most of the way is gone, the law leaves room for the whole wave: the command differs from it by no less.
  r.probe.effort = S(1);
  r.probe.travel = S(1);
  Rig<S> unheard(r);
  const auto& far = unheard.law.supervisor;
  p::SupervisorState<S> goes;
  const S inside = S(0.5) * (gate.params.position_min + gate.params.position_max);
  S highest = S(0), lowest = S(10);
  for (int k = 0; k < 240; ++k) {
    p::step(far.probe, goes.probe, S(0), S(0), S(0));
    goes.probe.way[0] = S(0.9);
    const S asked = p::min(p::wave(far.probe, goes.probe, S(0.9)), S(p::probe_crest));
    goes.output = goes.drive.asked = S(10) - S(p::probe_crest) + asked;
    const S given = p::with_probe(far, goes, gate, S(10), inside);
    highest = p::max(highest, given), lowest = p::min(lowest, given);
    check_close(static_cast<double>(goes.wave[0]), static_cast<double>(asked), 1e-5, "whole, or as much as the room");
  }
  check(highest > S(9.7) && highest <= S(10) && lowest < S(6.2), "up to the limit, and as far below");
  check(p::abs(p::with_probe(far, goes, gate, S(1), std::numeric_limits<S>::quiet_NaN())) <= S(10), "at no place it is a number");
  // It never turns an effort round, nor makes one of none, at a stop as elsewhere.
  for (const S place : {gate.params.position_min, inside, gate.params.position_max})
    for (const S effort : {S(-10), S(-1), S(0), S(1), S(10)}) {
      goes.output = goes.drive.asked = effort;
      goes.probe.phase[0] = goes.probe.phase[1] = goes.probe.phase[2] = {};
      const S given = p::with_probe(far, goes, gate, effort, place);
      const bool is_outward = (place > inside && effort > S(0)) || (place < inside && effort < S(0));
      const S most = is_outward ? p::max(p::abs(effort) - S(p::probe_crest), S(0)) : p::min(p::abs(effort), S(10) - S(p::probe_crest));
      const S due = effort < S(0) ? -most : most;
      check_close(static_cast<double>(given), static_cast<double>(p::clamp(due, effort - far.max_change, effort + far.max_change)),
                  1e-5, "less of the same effort");
    }
  p::SupervisorParams<S> wrong = rules<S>();
  wrong.probe.effort = S(0.2);
  p::Supervised<p::JointCompensation<S>> law{};
  check(!p::configure(law, typical_params<p::JointCompensationParams<S>>(), wrong), "a probe needs an inertia");
}

/// Without a force sensor the law goes on if the robot is still carried, and without EMG always; nothing of them is heard.
template <class S> void degrades() {
  for (const std::uint32_t carried : {0u, 1u}) {
    for (const bool force : {true, false}) {
      p::SupervisorParams<S> r = rules<S>();
      r.degrades = carried;
      (force ? r.force : r.muscle).expected = 1;
      Rig<S, p::TransparentCompensation> rig(r);
      const auto periods = [&rig](int n, bool heard, S size = S(0.01)) {
        for (int k = 0; k < n; ++k) {
          rig.read();
          const S felt = size * p::sin(S(0.01) * static_cast<S>(rig.count % 629));
          rig.in.interaction = rig.in.muscle = {felt, rig.now, rig.count, heard};
          rig.step();
        }
        return rig.out;
      };
      periods(200, true);
      check(rig.out.mode == M::running, "it runs");
      periods(49, false);
      check(rig.out.mode == M::running, "a little silence is none");
      periods(3, false);
      const bool goes_on = carried != 0 || !force;
      check(rig.out.mode == (goes_on ? M::degraded : M::damped_stop), "it goes on with less, or stops");
      check(rig.out.fault == F::lost && rig.out.enable, "and says why");
      if (!goes_on) continue;
      check(rig.out.effort != S(0) && rig.out.challenge == 0, "with an effort, and nothing to reset");
      const auto now = rig;
      const S silent = periods(20, false).effort;
      rig = now;
      check(periods(20, true, S(3)).effort == silent && rig.out.mode == M::degraded, "what speaks again is not heard");
      rig.read();
      rig.in.position.value = std::numeric_limits<S>::quiet_NaN();
      rig.step();
      check(p::is_stopped(rig.out.mode), "the next fault stops it");
    }
  }
}

/// However fast it gets faster: the estimator of a law is not asked.
template <class S, template <class> class L> void overspeed() {
  for (const double gain : {100.0, 263.0, 472.0, 1000.0, 1900.0}) {
    p::SupervisorParams<S> r = rules<S>();
    r.body = {};
    r.encoder.range_min = S(-1e3), r.encoder.range_max = S(1e3);
    Rig<S, L> rig(r);
    rig.run(100);
    int late = 0;
    for (int k = 0; k < 400 && rig.out.fault == F::none; ++k) {
      rig.speed = rig.speed + static_cast<S>(gain * 1e-3);
      late += rig.speed > S(8.4);
      rig.run(1);
    }
    check(rig.out.fault == F::overspeed || rig.out.fault == F::velocity, "found");
    check(late <= 2, "within two cycles");
  }
}

template <class S> void resets() {
  Rig<S> rig;
  rig.speed = S(0.05);
  rig.run(300);
  p::stop(rig.law);
  rig.run(2);
  const std::uint32_t challenge = rig.out.challenge;
  check(rig.out.fault == F::stopped && challenge != 0, "stopped");
  p::configure(rig.law, typical_params<p::JointCompensationParams<S>>(), rules<S>());
  rig.run(300);
  check(rig.out.fault == F::stopped && rig.out.effort == S(0), "a start does not clear a fault");
  check(!rig.out.enable && rig.out.mode == M::latched, "nor does waiting");
  rig.token = challenge + 2;
  rig.run(300);
  check(rig.out.fault == F::stopped, "nor a wrong token");
  rig.token = challenge;
  rig.run(1);
  check(rig.out.fault == F::none && rig.out.effort == S(0), "the token does, from an effort of 0");
  check(rig.out.enable && rig.out.mode == M::running, "with power");
  rig.run(1);
  check(std::fabs(rig.out.effort) <= S(0.5001), "and then within the rate");
  p::stop(rig.law);
  rig.run(2);
  check(rig.out.challenge != challenge, "the next fault wants another token");
  rig.run(400);
  check(rig.out.fault == F::stopped, "so that an old one is no use");
  rig.token = rig.out.challenge;
  for (int k = 0; k < 200; ++k) {
    rig.read();
    if (k % 40 == 0) rig.in.position.valid = false;
    rig.step();
  }
  check(rig.out.fault == F::stopped, "nor is the right one before a healthy while");
  rig.token = 0;
  rig.run(60);
  p::SupervisorParams<S> late = rules<S>();
  late.reset_delay = S(2);
  Rig<S> patient(late);
  patient.speed = S(0.05);
  patient.run(50);
  p::stop(patient.law);
  patient.run(2);
  patient.token = patient.out.challenge;
  patient.run(1900);
  check(patient.out.fault == F::stopped, "nor a healthy while before the delay");
  patient.run(120);
  check(patient.out.fault == F::none, "but after it");
  check(p::faults_of(rig.law.state) == 3 && p::logged(rig.law.state, 2).fault == F::stopped, "the log outlives a reset");
}

/// A drive whose measurement reads more than the command, as at its commissioning, adds no energy; one that then reads as
/// much as the command has changed.
template <class S> void knows_the_drives_answer() {
  p::SupervisorParams<S> r = rules<S>();
  r.drive.surplus = S(0.02);
  for (const S answer : {S(1.25), S(1)}) {
    r.drive.answer = answer;
    Rig<S> rig(r);
    for (int k = 0; k < 3000 && rig.out.fault == F::none; ++k) {
      rig.speed = S(0.4) * p::sin(S(3e-3) * static_cast<S>(k));
      rig.read();
      rig.back.drive.value = S(1.25) * rig.law.state.output;
      rig.step();
    }
    check(rig.out.fault == (answer > S(1) ? F::none : F::drive_effort), "what it read at its commissioning");
  }
}

/// A joint that sank while its encoder was silent, and then rests, has no frozen encoder: the change over that
/// gap is no velocity.
template <class S> void resets_after_a_gap() {
  for (const bool repeats : {false, true}) {
    for (const int gap : {200, 1500}) {
      Rig<S> rig;
      rig.speed = S(0);
      rig.run(300);
      const p::Sample<S> last = rig.in.position;
      for (int k = 0; k < gap; ++k) {
        rig.read();
        if (repeats) rig.in.position = last;
        else rig.in.position.valid = false;
        rig.step();
      }
      check(rig.out.fault == (repeats ? F::stale : F::not_finite) && !rig.out.enable, "a silent encoder stops");
      rig.place = rig.place - S(0.3);
      rig.token = rig.out.challenge;
      rig.run(400);
      check(rig.out.mode == M::running, "at rest it can be reset");
    }
  }
}

/// Without power a wearer carries the robot, whose weight is then no fault that keeps an operator from a reset.
template <class S> void rests_on_the_wearer() {
  p::SupervisorParams<S> r = rules<S>();
  r.body.wearer_torque = S(0.5);
  r.hold = {};
  Rig<S> rig(r);
  rig.speed = S(0);
  rig.run(300);
  check(rig.out.mode == M::running, "it is carried");
  p::stop(rig.law);
  rig.run(1000);
  check(rig.out.mode == M::latched, "and let go");
  rig.token = rig.out.challenge;
  rig.run(400);
  check(rig.out.mode == M::running && p::faults_of(rig.law.state) == 1, "and taken up again");
}

/// A weight of 2 N m sinks slowly, and takes no energy from the hold, whatever pulls at it.
template <class S> void holds() {
  Rig<S> rig;
  rig.run(100);
  p::stop(rig.law);
  S v = S(0.4), q = rig.place, taken = S(0), fastest = S(0);
  for (int k = 0; k < 4000; ++k) {
    const S pull = k < 2000 ? S(-2) : S(6) * p::sin(S(0.05) * static_cast<S>(k));
    v = v + S(1e-3) * (pull + rig.out.effort) / S(0.05);
    q = q + S(1e-3) * v;
    if (q > S(2.6) || q < S(0)) q = q > S(1) ? S(2.6) : S(0), v = S(0);
    if (k > 20) taken = taken - S(1e-3) * rig.out.effort * v;  // the law's last effort has gone by then
    if (k > 300 && k < 600) fastest = p::max(fastest, p::abs(v));
    rig.speed = (q - rig.place) * S(1000);
    rig.run(1);
    check(taken >= S(-1e-3), "a hold gives no energy");
    if (rig.out.mode != M::damped_stop) break;
  }
  check(fastest < S(0.9) && fastest > S(0.3), "it sinks, slowly");
}

template <class S> void start_up(S gain, F wanted) {
  p::SupervisorParams<S> r = rules<S>();
  r.test = {S(1.5), 30, 100, S(0.001), S(0.012)};
  r.drive.expected = 0;
  Rig<S> rig(r);
  S v = S(0), impulse = S(0);
  for (int k = 0; k < 1200 && (k == 0 || rig.out.mode == M::start_up); ++k) {
    const S given = gain * rig.out.effort;
    impulse = impulse + S(1e-3) * std::fabs(rig.out.effort);
    v = v + S(1e-3) * (given - S(0.3) * p::clamp(S(20) * v, S(-1), S(1))) / S(0.05);
    rig.speed = v;
    rig.run(1);
    if (k == 0) check(rig.out.mode == M::start_up, "a test first");
  }
  check(rig.out.fault == wanted, p::safety_fault_names[static_cast<std::size_t>(wanted)]);
  check(impulse < S(0.3), "with little impulse");
}

void power_of_the_drive() {
  p::Watchdog w;
  check(p::step(w, 1, true, 5), "power while it beats");
  for (int k = 0; k < 5; ++k) check(p::step(w, 1, true, 5), "and a little longer");
  check(!p::step(w, 1, true, 5), "not for ever");
  check(p::step(w, 2, true, 5) && !p::step(w, 3, false, 5), "and never against enable");
}

/// Any bits at all in the whole state: what comes out is finite, within the limit, and ends in a stop or runs.
template <class S> void anything() {
  Random random(5);
  Rig<S> rig;
  for (int k = 0; k < 200000; ++k) {
    rig.read();
    if (k % 50 == 0) rig.in.position.value = random.anything<S>();
    if (k % 77 == 0) rig.back.drive.value = random.anything<S>();
    if (k % 501 == 0) rig.law.state.output = rig.law.state.body.momentum = random.anything<S>();
    if (k % 703 == 0) rig.law.state.doing.word = static_cast<std::uint32_t>(random.bits());
    if (k % 401 == 0) rig.law.state.hold.taken = rig.law.state.encoder.velocity = random.anything<S>();
    rig.token = k % 3 == 0 ? rig.out.challenge : 0;
    rig.step();
    check(rig.out.effort >= S(-10) && rig.out.effort <= S(10), "within the limit");
    check(rig.out.mode != M::latched || (rig.out.effort == S(0) && !rig.out.enable), "latched is nothing");
    if (rig.place > S(2) || rig.place < S(0.5)) rig.speed = -rig.speed;
  }
}

template <class S> void all() {
  healthy_runs_pass<S>();
  faults<S>();
  overspeed<S, p::JointCompensation>();
  overspeed<S, p::TransparentCompensation>();
  overspeed<S, p::DirectionalCompensation>();
  overspeed<S, p::PositionPrediction>();
  ringing<S>();
  probes<S>();
  degrades<S>();
  resets<S>();
  rests_on_the_wearer<S>();
  knows_the_drives_answer<S>();
  resets_after_a_gap<S>();
  holds<S>();
  start_up<S>(S(1), F::none);
  start_up<S>(S(-1), F::polarity);
  start_up<S>(S(0), F::polarity);
  start_up<S>(S(3), F::gain);
  anything<S>();
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  power_of_the_drive();
  return failures();
}
