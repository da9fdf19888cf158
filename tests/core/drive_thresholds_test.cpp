// The drive's watch: tolerance, counts, names of faults and the surplus, just within and just beyond, in both signs.
#include "check.hpp"

#include <pellucid/drive_watch.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

template <class S> p::DriveWatchParams<S> watch() {
  p::DriveWatchParams<S> params;
  params.expected = 1;
  params.cycles = 3;
  params.tolerance = S(0.5);
  params.relative = S(0.25);
  return params;
}

template <class S> p::DriveWatchState<S> asked(S now, S before) {
  p::DriveWatchState<S> s;
  p::ask(s, before);
  p::ask(s, now);
  check(s.asked == now && s.asked_before == before, "the last two commands");
  return s;
}

template <class S> void silence() {
  const p::DriveWatchParams<S> usual;
  check(usual.cycles == 4 && usual.relative == S(0.15) && usual.expected == 0, "usual numbers");
  auto params = watch<S>();
  p::DriveWatchState<S> s;
  for (int k = 1; k <= 4; ++k)
    check(p::step(params, s, S(0), S(0), S(1), false) == (k < 3 ? F::none : F::drive_silent), "silent");
  check(p::step(params, s, S(0), S(0), S(1), true) == F::none && s.silent == 0, "until it speaks");
  params.expected = 0;
  for (int k = 1; k <= 9; ++k) check(p::step(params, s, S(99), S(9), S(1), k % 2 == 0) == F::none, "not asked for");
}

template <class S> void tolerance() {
  const auto params = watch<S>();
  for (const S way : {S(-1), S(1)}) {
    for (const S side : {S(-1), S(1)}) {
      // 0.5 and a quarter of a command of 2: 1.
      auto s = asked(way * S(2), way * S(2));
      for (int k = 0; k < 9; ++k)
        check(p::step(params, s, way * S(2) + side, S(0), S(1), true) == F::none && s.outside == 0, "within");
      const S given = way * S(2) + side * S(1.0078125);
      for (int k = 1; k <= 2; ++k) check(p::step(params, s, given, S(0), S(1), true) == F::none, "a little while outside");
      check(p::step(params, s, given, S(0), S(1), true) == F::drive_stuck && s.outside == 0, "then it is a fault");
      // The change of the command is allowed for, either way.
      auto turned = asked(way * S(2), way * S(2) + side * S(0.5));
      check(p::step(params, turned, way * S(2) + side * S(1.5), S(0), S(1), true) == F::none && turned.outside == 0, "changes");
      check(p::step(params, turned, way * S(2) + side * S(1.5078125), S(0), S(1), true) == F::none && turned.outside == 1, "so much");
      // What interrupts it is not in a row.
      auto now = asked(way * S(2), way * S(2));
      for (int k = 0; k < 12; ++k)
        check(p::step(params, now, k % 3 == 2 ? way * S(2) : given, S(0), S(1), true) == F::none, "not in a row");
    }
    // Beyond what it can give at most, it is held to that.
    auto limited = params;
    limited.limit = S(1);
    auto s = asked(way * S(4), way * S(4));
    check(p::step(limited, s, way * S(1.75), S(0), S(1), true) == F::none && s.outside == 0, "within what it can give");
    p::step(limited, s, way * S(1.7578125), S(0), S(1), true);
    check(s.outside == 1, "and beyond");
  }
}

template <class S> void names() {
  const auto params = watch<S>();
  const auto named = [&](S command, S first, S last) {
    auto s = asked(command, command);
    p::step(params, s, first, S(0), S(1), true);
    p::step(params, s, S(0.5) * (first + last), S(0), S(1), true);
    return p::step(params, s, last, S(0), S(1), true);
  };
  for (const S way : {S(-1), S(1)}) {
    check(named(way * S(2), way * S(4), way * S(4.046875)) == F::drive_stuck, "the same within a tenth of the tolerance");
    check(named(way * S(2), way * S(4), way * S(4.0625)) == F::drive_effort, "another one is no stuck one");
    check(named(way * S(2), way * S(4), way * S(3.953125)) == F::drive_stuck, "the same, from the other side");
    check(named(way * S(2), way * S(4), way * S(3.9375)) == F::drive_effort, "another one, from the other side");
    check(named(way * S(2), way * S(-1), way * S(-2)) == F::drive_sign, "the other way");
    check(named(way * S(2), way * S(-1), way * S(-0.515625)) == F::drive_sign, "beyond the tolerance");
    check(named(way * S(2), way * S(-1), way * S(-0.5)) == F::drive_effort, "not within");
    check(named(way * S(2), way * S(6), way * S(5)) == F::drive_effort, "too much is no other way");
  }
  // Where the limit of 0.1 times the tolerance can be an exact number.
  auto exact = watch<S>();
  exact.tolerance = S(10);
  exact.cycles = 2;
  const auto outside = [&](S last) {
    auto s = asked(S(0), S(0));
    p::step(exact, s, S(20), S(0), S(1), true);
    return p::step(exact, s, last, S(0), S(1), true);
  };
  check(outside(S(21)) == F::drive_stuck && outside(S(21.0009765625)) == F::drive_effort, "a tenth of the tolerance");
}

/// What was asked for now or as late as the loop, whichever gives more energy, is what the drive may give.
template <class S> void late_loops() {
  auto params = watch<S>();
  params.tolerance = S(100);
  params.surplus = S(100);
  params.late = S(0.5);
  for (const S way : {S(-1), S(1)}) {
    auto falls = asked(way * S(1), way * S(1));
    falls.due = way * S(3);  // half of it is left: 2
    p::step(params, falls, way * S(2), way, S(1), true);
    check(falls.due == way * S(2) && falls.surplus == S(0), "what is still due of more");
    auto turns = asked(way * S(1), way * S(1));
    turns.due = way * S(3);
    p::step(params, turns, way * S(0), -way, S(1), true);
    check(turns.surplus == S(1), "back, what is asked for now gives more");
    auto grows = asked(way * S(3), way * S(3));
    grows.due = way * S(1);
    p::step(params, grows, way * S(3), way, S(1), true);
    check(grows.due == way * S(2) && grows.surplus == S(0), "what was asked for now is more");
  }
}

/// Energy beyond the command: (given - due) v less the accuracy of the measurement, forgotten in time.
template <class S> void surplus() {
  auto params = watch<S>();
  params.tolerance = S(100);
  params.surplus = S(1);
  params.gain = S(0.125);
  params.offset = S(0.25);
  for (const S way : {S(-1), S(1)}) {
    for (const S moved : {S(-0.5), S(0.5)}) {
      const S adds = way * S(2) + (moved > S(0) ? S(1.5) : S(-1.5));  // 1.5 N m the way the joint goes, 0.5 of it allowed
      auto s = asked(way * S(2), way * S(2));
      check(p::step(params, s, adds, moved, S(1), true) == F::none && s.surplus == S(0.5), "what is added beyond the accuracy");
      check(p::step(params, s, adds, moved, S(1), true) == F::none && s.surplus == S(1), "at the limit");
      check(p::step(params, s, adds, moved, S(1), true) == F::drive_effort && s.surplus == S(0), "beyond, and begins anew");
      p::step(params, s, adds, moved, S(1), true);
      p::step(params, s, adds, -moved, S(1), true);
      check(s.surplus == S(0), "what it takes back counts, and less than nothing is nothing");
      p::step(params, s, adds, moved, S(1), true);
      p::step(params, s, way * S(2), moved, S(1), true);
      check(s.surplus == S(0.25), "a right drive's way lowers it by the accuracy");
    }
    auto forgetful = params;
    forgetful.forget = S(0.25);
    auto s = asked(way * S(2), way * S(2));
    s.surplus = S(1);
    check(p::step(forgetful, s, S(0), S(0), S(1), true) == F::none && s.surplus == S(0.75), "forgotten");
    auto late = params;
    late.late = S(0.75);
    s = asked(way * S(2), way * S(2));
    p::step(late, s, S(0), S(0), S(1), true);
    check(s.due == way * S(0.5), "due later");
    p::step(late, s, S(0), S(0), S(1), true);
    check(s.due == way * S(0.875), "and later");
    auto limited = params;
    limited.limit = S(1);
    s = asked(way * S(2), way * S(2));
    p::step(limited, s, S(0), S(0), S(1), true);
    check(s.due == way, "never more than it can give");
  }
}

/// What a drive's inertia takes from a joint it may give back; what it gives while the joint speeds up is its own.
template <class S> void inertia() {
  auto params = watch<S>();
  params.tolerance = S(100);
  params.surplus = S(1.125);
  params.inertia = S(2);
  // From rest to 2 rad/s and back in 16 periods each: an inertia J takes J v^2 / 2 and gives it back.
  const auto swing = [&](S loop_leaves, S command, S gain) {
    auto s = asked(S(0), S(0));
    S before = S(0), largest = S(0);
    F found = F::none;
    for (int k = 1; k <= 64 && found == F::none; ++k) {
      const int at = k % 32;
      const S velocity = S(at <= 16 ? at : 32 - at) / S(8) * (k > 32 ? S(-1) : S(1));
      const S middle = S(0.5) * (velocity + before);
      const S effort = command * (velocity - before);
      p::ask(s, effort);
      found = p::step(params, s, gain * effort - loop_leaves * (velocity - before), middle, S(1), true);
      largest = p::max(largest, p::least_surplus(s));
      before = velocity;
    }
    check(found == F::none || found == F::drive_effort, "named");
    return found == F::none ? largest : S(9);
  };
  for (const S left : {S(0), S(0.5), S(1), S(1.5), S(2)}) check(swing(left, S(0), S(1)) <= S(1.0625), "a right drive: a quarter of 4 J, whatever its loop leaves");
  check(swing(S(4), S(0), S(1)) > S(1.125), "twice the inertia that is stated is a fault");
  check(swing(S(0), S(2), S(3)) > S(1.125), "and so is three times a command that helps along");
  params.inertia = S(0);
  check(swing(S(2), S(0), S(1)) > S(1.125), "without inertia nothing is given back");
  p::DriveWatchState<S> s = asked(S(0), S(0));
  p::step(params, s, S(1), S(0.5), S(1), true);
  check(s.surplus == S(0.5) && s.inert_surplus == s.surplus && s.kinetic == S(0), "and both accounts are one");
}

template <class S> void all() {
  inertia<S>();
  silence<S>();
  tolerance<S>();
  names<S>();
  late_loops<S>();
  surplus<S>();
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
