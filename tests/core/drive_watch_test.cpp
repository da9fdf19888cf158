// The drive's watch: a measurement of the stated accuracy is no fault, a drive that adds energy is one.
#include "check.hpp"

#include <pellucid/drive_reading.hpp>
#include <pellucid/drive_watch.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

/// Why a drive of 10 N m is stopped, and when [s], after at most so many seconds of a joint that swings under an effort
/// of weight and friction. The drive adds `added` [N m] the way the joint goes.
template <class S> struct DriveRun {
  F fault = F::none;
  double seconds = 0;

  DriveRun(const p::DriveWatchParams<S>& watch, const p::DriveReadingParams<S>& params, S noise, double longest,
           S added = S(0)) {
    const auto reading = p::coefficients(params, S(1e-3));
    p::DriveReadingState<S> read;
    p::DriveWatchState<S> state;
    Random random(11);
    for (int k = 0; seconds < longest; ++k) {
      seconds = 1e-3 * k;
      const S slow = S(2) * p::sin(static_cast<S>(std::fmod(2.9 * seconds, 6.283185307179586)));
      const S velocity = slow + S(0.7) * p::sin(static_cast<S>(std::fmod(7.3 * seconds, 6.283185307179586)));
      const S place = S(0.69) * p::cos(static_cast<S>(std::fmod(2.9 * seconds, 6.283185307179586)));
      const S way = p::clamp(velocity / S(0.05), S(-1), S(1));
      const S given = p::step(reading, read, state.asked + added * way, noise * static_cast<S>(random.uniform(-1, 1)));
      fault = p::step(watch, state, given, velocity, S(1e-3), true);
      if (fault != F::none) return;
      p::ask(state, S(3) * p::sin(S(1) - place) + S(0.8) * way);
    }
  }
};

/// A measurement of the stated accuracy is never a drive that adds energy; one that adds more than that is found.
template <class S> void drive_readings() {
  p::DriveWatchParams<S> exact;
  exact.expected = 1;
  exact.tolerance = S(0.5);
  exact.surplus = S(0.05);
  p::DriveWatchParams<S> watch = exact;
  watch.gain = S(0.05);
  watch.offset = S(0.1);
  watch.forget = S(1e-4);
  for (const S gain : {S(0.95), S(1.05)}) {
    for (const S offset : {S(-0.1), S(0.1)}) {
      for (const S lag : {S(0.3e-3), S(2e-3)}) {
        const DriveRun<S> run(watch, {gain, offset, lag, S(0.02)}, S(0.17), 300);
        check(run.fault == F::none, "a measurement as accurate as stated is no fault");
      }
    }
  }
  const DriveRun<S> without(exact, {S(1.005), S(0), S(0), S(0)}, S(0), 60);
  check(without.fault == F::drive_effort, "without an allowance half a percent is one");
  const DriveRun<S> inexact(watch, {S(1.1), S(0), S(0), S(0)}, S(0), 10);
  check(inexact.fault == F::drive_effort, "twice the stated error of the gain is one");
  for (const S gain : {S(0.95), S(1), S(1.05)}) {
    const DriveRun<S> adds(watch, {gain, S(0), S(0.3e-3), S(0.02)}, S(0.17), 3, S(0.49));
    check(adds.fault == F::drive_effort, "and so is a drive that adds within its tolerance");
  }
  p::DriveWatchState<S> state;
  state.surplus = S(0.04);
  for (int k = 0; k < 10000; ++k) p::step(watch, state, S(0), S(0), S(1), true);
  check_close(state.surplus, S(0.04) * static_cast<S>(std::exp(-1.0)), S(1e-4), "what was added is forgotten in time");
  state.surplus = std::numeric_limits<S>::infinity();
  check(p::step(watch, state, S(0), S(0), S(1), true) == F::drive_effort, "but not what no drive can add");
}

/// Why a drive is stopped that follows a dithered command one period late, on a joint that vibrates as its reading says.
/// It adds `added` [N m] the way a slow motion goes.
template <class S> F dithered(S added, double longest) {
  p::DriveWatchParams<S> watch;
  watch.expected = 1;
  watch.tolerance = S(0.5);
  watch.surplus = S(0.05);
  watch.late = S(0.8);
  watch.gain = S(0.05);
  watch.offset = S(0.1);
  watch.forget = S(1e-4);
  p::DriveWatchState<S> state;
  S given = S(1), late = S(1);
  for (int k = 0; 1e-3 * k < longest; ++k) {
    const S velocity = S(0.5) * (given - S(1)) + added;
    const F fault = p::step(watch, state, given + added, velocity, S(1e-3), true);
    if (fault != F::none) return fault;
    given = given + S(0.45) * (late - given);
    late = state.asked;
    p::ask(state, S(1) + S(0.8) * p::sin(static_cast<S>(k % 44) * S(2 * 3.14159265 * 6 / 44)));
  }
  return F::none;
}

/// A command that changes as fast as the drive is late adds no energy.
template <class S> void dithered_commands() {
  check(dithered<S>(S(0), 60) == F::none, "late alone is no fault");
  check(dithered<S>(S(0.4), 3) == F::drive_effort, "what it adds beside is one");
}

/// One reading alone that is outside stops nobody; two in a row count as before, and what no drive can give is no reading.
template <class S> void lone_readings() {
  p::DriveWatchParams<S> watch;
  watch.expected = 1;
  watch.tolerance = S(0.5);
  watch.surplus = S(0.05);
  watch.limit = S(13);
  const auto surplus_after = [&](int spikes) {
    p::DriveWatchState<S> state;
    for (int k = 0; k < 20; ++k) {
      const S given = k >= 10 && k < 10 + spikes ? S(12) : S(0);
      if (p::step(watch, state, given, S(5), S(1e-3), true) != F::none) return S(1);
    }
    return state.surplus;
  };
  check(surplus_after(1) == S(0), "a reading alone adds nothing");
  check(surplus_after(2) == S(1), "two in a row add what both would");
  for (const S given : {S(0.5), S(0.625), S(-0.625)}) {
    p::DriveWatchState<S> one;
    check(p::step(watch, one, given, S(0.5), S(0x1p-10), true) == F::none, "no fault");
    check((one.surplus == S(0)) == (given != S(0.5)), "just within the tolerance its energy counts at once, just beyond not");
  }
  p::DriveWatchState<S> often;
  F found = F::none;
  for (int k = 0; k < 40 && found == F::none; ++k) found = p::step(watch, often, k % 2 == 0 ? S(12) : S(0), S(5), S(1e-3), true);
  check(found == F::drive_effort, "but every second one is no chance");
  check(p::can_give(watch, S(13)) && !p::can_give(watch, S(20)) && !p::can_give(watch, S(-20)), "what it can give");
}

/// A drive's watch in which only the surplus counts, on a joint that goes 1 rad in a period.
template <class S> struct Account {
  p::DriveWatchParams<S> params{};
  p::DriveWatchState<S> state{};
  Account() {
    params.expected = 1;
    params.cycles = 1000;
    params.tolerance = S(0.5);
    params.surplus = S(1e6);
  }
  /// Surplus after a reading of an effort that was not asked for.
  S read(S given, S velocity = S(1)) {
    check(p::step(params, state, given, velocity, S(1), true) == F::none, "no fault");
    return state.surplus;
  }
};

/// A reading that is outside alone waits until the next one agrees; energy that it would take is no credit.
template <class S> void waiting_readings() {
  Account<S> lone;
  check(lone.read(S(4)) == S(0) && lone.read(S(0)) == S(0) && lone.read(S(0)) == S(0), "what nobody confirms is dropped");
  Account<S> two;
  check(two.read(S(4)) == S(0) && two.read(S(4)) == S(8) && two.read(S(4)) == S(12), "what the next confirms counts once");
  Account<S> other;
  other.state.surplus = other.state.inert_surplus = S(8);
  check(other.read(S(-4)) == S(8) && other.read(S(2)) == S(10), "a first reading that takes energy lowers nothing");
  Account<S> long_outside;
  for (int k = 1; k <= 400; ++k)
    check(long_outside.read(S(4)) == (k == 1 ? S(0) : S(4 * k)), "a drive that stays outside is counted in every period");
}

/// A second reading may be alone after a hundred others; sooner it counts at once.
template <class S> void gaps_between_lone_readings() {
  for (const int others : {0, 1, 49, 50, 98, 99, 100, 101, 150, 199, 200, 1000}) {
    Account<S> spiky;
    check(spiky.read(S(4)) == S(0), "the first is alone");
    for (int k = 0; k < others; ++k) spiky.read(S(0));
    const bool is_alone = others >= 100;
    const S counted = others == 0 ? S(8) : S(4);
    check(spiky.read(S(4)) == (is_alone ? S(0) : counted), "the second by its distance");
    for (int k = 0; k < 99; ++k) spiky.read(S(0));
    const S before = spiky.state.surplus;
    check((spiky.read(S(4)) == before) == !is_alone, "and the third by the last that was alone");
  }
}

/// What counts as outside: either side of the command, by the tolerance, by its change, and by what is still due.
template <class S> void outside_of_a_command() {
  for (const S way : {S(-1), S(1)}) {
    for (const S side : {S(-1), S(1)}) {
      const auto is_outside = [&](S given, S due, S late, S before) {
        Account<S> one;
        one.params.relative = S(0);
        one.params.late = late;
        p::ask(one.state, before);
        p::ask(one.state, way * S(4));
        one.state.due = due;
        one.read(given, S(0));
        check((one.state.outside == 1) == (one.state.agreed == 0), "a first reading outside is alone");
        return one.state.outside == 1;
      };
      const S asked = way * S(4);
      check(!is_outside(asked + side * S(0.5), asked, S(0), asked) && is_outside(asked + side * S(0.5078125), asked, S(0), asked), "the tolerance");
      // Half of a difference of 3 is still due: 1.5.
      const S due = asked + side * S(3);
      check(!is_outside(asked + side * S(2), due, S(0.5), asked) && is_outside(asked + side * S(2.0078125), due, S(0.5), asked), "what is due");
      check(!is_outside(asked - side * S(2), due, S(0.5), asked), "either way");
      const S before = asked + side * S(2);
      check(!is_outside(asked + side * S(2.5), asked, S(0), before) && is_outside(asked + side * S(2.5078125), asked, S(0), before), "its change");
      check(!is_outside(asked + side * S(2.5), due, S(0.5), before), "the larger of both");
    }
  }
}

/// The largest effort that a reading may say, exactly; the inertia's account forgets and gives back.
template <class S> void ends_of_readings() {
  p::DriveWatchParams<S> watch;
  watch.limit = S(8);
  watch.tolerance = S(0.5);
  watch.relative = S(0.25);
  for (const S way : {S(-1), S(1)})
    check(p::can_give(watch, way * S(10.5)) && !p::can_give(watch, way * S(10.5078125)), "limit and both tolerances");
  Account<S> inert;
  inert.params.inertia = S(2);
  inert.params.forget = S(0.25);
  inert.params.tolerance = S(100);
  check(inert.read(S(3), S(1)) == S(3) && inert.state.inert_surplus == S(4), "with what it took");
  check(inert.read(S(0), S(1)) == S(2.25) && inert.state.inert_surplus == S(3), "both are forgotten alike");
  check(inert.read(S(0), S(0)) == S(1.6875) && inert.state.inert_surplus == S(1.25), "less what it gave back");
}

}  // namespace

int main() {
  waiting_readings<double>();
  waiting_readings<float>();
  gaps_between_lone_readings<double>();
  gaps_between_lone_readings<float>();
  outside_of_a_command<double>();
  outside_of_a_command<float>();
  ends_of_readings<double>();
  ends_of_readings<float>();
  dithered_commands<double>();
  dithered_commands<float>();
  lone_readings<double>();
  lone_readings<float>();
  drive_readings<double>();
  drive_readings<float>();
  return failures();
}
