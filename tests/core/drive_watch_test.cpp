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

}  // namespace

int main() {
  lone_readings<double>();
  lone_readings<float>();
  drive_readings<double>();
  drive_readings<float>();
  return failures();
}
