// The encoder's watch: every limit just within and just beyond it, in both directions, and what a reading is taken for.
#include "check.hpp"

#include <pellucid/encoder_watch.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

/// An encoder that is read once a period of 1/1024 s, so that velocities are exact numbers.
template <class S> struct Encoder {
  p::EncoderWatchCoefficients<S> c;
  p::EncoderWatchState<S> s{};
  S place = S(0);
  std::uint32_t count = 0;

  explicit Encoder(const p::EncoderWatchParams<S>& params, S from = S(0), S period = S(0x1p-10))
      : c(p::coefficients(params, period)), place(from) {
    check(c.valid, "the parameters make sense");
  }
  F read(S at, std::int64_t time = 0) {
    place = at;
    return p::step(c, s, {at, time, count++, true});
  }
  /// The reading after one period at a velocity.
  F move(S velocity) { return read(place + velocity * S(0x1p-10)); }
  /// Several such readings, of which none is a fault.
  void moves(S velocity, int readings) {
    for (int k = 0; k < readings; ++k) check(move(velocity) == F::none, "no fault on the way");
  }
};

template <class S> void parameters() {
  const auto valid = [](S low, S high, S period) {
    p::EncoderWatchParams<S> params;
    params.range_min = low;
    params.range_max = high;
    return p::coefficients(params, period).valid;
  };
  check(valid(S(1), S(1.5), S(0.75)), "a range above 0 and a period below 1 s");
  check(!valid(S(1.25), S(1), S(0.5)) && !valid(S(1), S(1), S(0.5)), "a range has a lower and an upper end");
  check(!valid(S(0), S(1), S(0)) && !valid(S(0), S(1), S(-1)), "a period is above 0");
  check(!valid(S(0), S(1), S(1)) && !valid(S(0), S(1), S(1.25)), "and below 1 s");
  p::EncoderWatchParams<S> unsound;
  unsound.resolution = S(-1);
  check(!p::coefficients(unsound, S(0.001)).valid && p::coefficients(unsound, S(0.001)).micros == 0, "unsound numbers");
  const p::EncoderWatchParams<S> any;
  check(p::coefficients(any, S(0.0009994)).micros == 999 && p::coefficients(any, S(0.0009996)).micros == 1000, "rounded");
  check(any.freeze_samples == 20 && any.range_min == -any.range_max, "what is not given has no limit");
  check(p::coefficients(any, S(0.25)).inverse_period == S(4), "inverse period");
}

template <class S> void speed() {
  p::EncoderWatchParams<S> params;
  params.speed_limit = S(8);
  for (const S way : {S(-1), S(1)}) {
    Encoder<S> first(params, S(0));
    check(first.read(way * S(100)) == F::none && first.s.velocity == S(0), "the first reading has no velocity");
    check(first.move(way * S(8)) == F::none && first.s.velocity == way * S(8), "at the limit");
    check(first.move(way * S(8.015625)) == F::overspeed, "beyond the limit");
    p::EncoderWatchParams<S> coarse = params;
    coarse.resolution = S(0x1p-16);  // 1/32 rad/s of velocity
    Encoder<S> blurred(coarse);
    blurred.read(S(0));
    check(blurred.move(way * S(8.03125)) == F::none, "two errors of a reading are allowed for");
    check(blurred.move(way * S(8.0390625)) == F::overspeed, "and not more");
  }
}

template <class S> void acceleration() {
  p::EncoderWatchParams<S> params;
  params.acceleration_limit = S(1024);  // 1 rad/s in a period
  for (const S way : {S(-1), S(1)}) {
    Encoder<S> rig(params);
    rig.read(S(0));
    rig.moves(way * S(4), 1);
    check(rig.move(way * S(-4)) == F::none, "three readings begin a motion");
    check(rig.move(way * S(-3)) == F::none && rig.move(way * S(-2)) == F::none, "at the limit");
    check(rig.move(way * S(-0.984375)) == F::jump, "beyond the limit");
    p::EncoderWatchParams<S> coarse = params;
    coarse.resolution = S(0x1p-16);  // a velocity's error of 1/32 rad/s, twice
    Encoder<S> blurred(coarse);
    blurred.read(S(0));
    blurred.moves(S(0), 3);
    check(blurred.move(way * S(1.0625)) == F::none, "four errors of a reading are allowed for");
    check(blurred.move(way * S(2.1328125)) == F::jump, "and not more");
  }
  Encoder<S> early(params);
  early.read(S(0));
  early.read(S(0));
  check(early.move(S(64)) == F::none && early.move(S(0)) == F::jump, "judged from the fourth reading on");
}

template <class S> void range() {
  p::EncoderWatchParams<S> params;
  params.range_min = S(-0.5);
  params.range_max = S(1.5);
  Encoder<S> rig(params);
  check(rig.read(S(-0.5)) == F::none && rig.read(S(1.5)) == F::none, "the ends belong to the range");
  check(rig.read(S(-0.515625)) == F::range && rig.read(S(1.515625)) == F::range, "beyond either end");
  check(rig.read(S(0)) == F::none, "within");
}

/// What a reading's own time makes of its velocity; a clock that stands still or leaps says nothing.
template <class S> void clocks() {
  p::EncoderWatchParams<S> params;
  params.acceleration_limit = S(1024);
  const auto velocity = [&](std::int64_t gap) {
    Encoder<S> rig(params, S(0), S(0.0009994));
    rig.read(S(0), 5000000000);
    rig.read(S(0.25), 5000000000 + gap);
    return static_cast<double>(rig.s.velocity);
  };
  const double steady = 0.25 / 0.0009994;
  check_close(velocity(0), steady, 1e-3, "no time passed: a period");
  check_close(velocity(999), steady, 1e-3, "a period, rounded");
  check_close(velocity(2000), 125.0, 1e-4, "two periods");
  check_close(velocity(750000), 1.0 / 3.0, 1e-6, "a long gap");
  check_close(velocity(1000000), 0.25, 1e-6, "a second");
  check_close(velocity(1000001), steady, 1e-3, "more than a second: a period");
  for (const S moved : {S(250), S(260), S(-250), S(-260)}) {
    Encoder<S> rig(params, S(0), S(0.001));
    for (int k = 0; k < 4; ++k) rig.read(S(0), 1000 * k);
    const bool within = std::fabs(moved) < S(256);
    check((rig.read(moved, 503000) == F::none) == within, "what a gap of half a second allows: 512 rad/s");
  }
}

template <class S> void frozen() {
  p::EncoderWatchParams<S> params;
  params.freeze_speed = S(0.5);
  params.freeze_samples = 3;
  // Two velocities before the reading stands still, whose mean counts.
  const auto freezes = [&](S before, S last, S range_max = S(1)) {
    p::EncoderWatchParams<S> changed = params;
    changed.range_max = range_max;
    changed.range_min = S(-1);
    Encoder<S> rig(changed);
    rig.read(S(0));
    rig.move(before);
    rig.move(before);
    rig.move(last);
    int found = 0;
    for (int k = 1; k <= 8; ++k) {
      const F fault = rig.move(S(0));
      if (fault == F::none) continue;
      check(fault == (range_max > S(0) ? F::frozen : F::range), "what is found");
      if (found == 0) found = k;
      check(k == 1 || k >= found, "and again as long as it lasts");
    }
    return found;
  };
  for (const S way : {S(-1), S(1)}) {
    check(freezes(way * S(0.5), way * S(0.5)) == 0, "at the speed it may have stopped");
    check(freezes(way * S(0.515625), way * S(0.515625)) == 3, "beyond it has frozen, after so many readings");
    check(freezes(way * S(0.875), way * S(0.25)) == 3, "the mean of two velocities, above");
    check(freezes(way * S(0.625), way * S(0.25)) == 0, "and below");
    check(freezes(way * S(0.25), way * S(0.875)) == 3, "in either order");
  }
  check(freezes(S(4), S(4), S(-0.5)) == 1, "a position out of range is said first");
  Encoder<S> rig(params);
  rig.read(S(0));
  rig.moves(S(4), 3);
  for (int k = 0; k < 5; ++k) {
    rig.moves(S(0), 2);
    rig.moves(S(4), 2);
  }
  check(rig.s.equal == 0, "what moves again is not frozen");
  rig.moves(S(0), 2);
  check(rig.move(S(0)) == F::frozen && rig.move(S(0)) == F::frozen, "three in a row, and more");
}

/// Stamps that jitter about regular samples: a steady motion stays steady. Samples that come when their stamps say so, too.
template <class S> void jitter() {
  const p::EncoderWatchParams<S> params;
  for (const bool regular : {true, false}) {
    Encoder<S> rig(params);
    S place = S(0);
    std::int64_t last = 1000000;
    for (int k = 0; k < 40; ++k) {
      const std::int64_t time = 1000000 + 977 * k + (k % 2 == 0 ? -200 : 200);
      if (k > 0) place = place + (regular ? S(4) * rig.c.period : S(4e-6) * static_cast<S>(time - last));
      last = time;
      rig.read(place, time);
      if (k > 3) check_close(static_cast<double>(rig.s.velocity), 4.0, 0.05, "a steady velocity");
    }
  }
}

/// Of a stamp within half a period of the regular one, the velocity by time or by period counts: what is nearer to the last.
template <class S> void either_velocity() {
  const p::EncoderWatchParams<S> params;
  const S moved = S(0.0078125), period = S(0.0010004);
  int ties = 0;
  for (const std::int64_t gap : {1, 250, 333, 499, 500, 501, 520, 777, 999, 1000, 1001, 1250, 1499, 1500, 1501, 2000, 2900, 3001})
    for (int k = 0; k <= 40; ++k) {
      Encoder<S> rig(params, S(0), period);
      rig.read(S(0), 7000000);
      const S by_time = moved * (S(1) / (S(1e-6) * static_cast<S>(gap))), by_period = moved * (S(1) / period);
      const S last = k == 0 ? S(0.5) * (by_time + by_period) : S(0.75) * static_cast<S>(k - 10);
      rig.s.velocity = last;
      rig.read(moved, 7000000 + gap);
      const bool near = gap > 500 && gap < 1500;
      const bool nearer = std::fabs(by_period - last) < std::fabs(by_time - last);
      ties += near && by_period - last == last - by_time;
      check(rig.s.velocity == (gap == 1000 || (near && nearer) ? by_period : by_time), "by time or by period");
    }
  check(ties > 0, "some are as near as the other");
  Encoder<S> first(params, S(0), period);
  first.read(moved, 1001);
  check(first.s.velocity == S(0), "the first reading has none");
}

/// A reading that is none, or was seen before, changes nothing.
template <class S> void nothing_new() {
  p::EncoderWatchParams<S> params;
  params.range_max = S(1);
  Encoder<S> rig(params);
  check(rig.read(S(0.5)) == F::none && rig.s.heard == 1 && rig.s.position == S(0.5), "number 0 is a reading, too");
  rig.read(S(0.5));
  const std::uint32_t last = rig.s.sequence;
  check(last == 1 && rig.s.heard == 2, "counted");
  check(p::step(rig.c, rig.s, {S(7), 0, last, true}) == F::none && rig.s.position == S(0.5), "seen again");
  check(p::step(rig.c, rig.s, {S(7), 0, 9, false}) == F::none && rig.s.position == S(0.5), "not valid");
  check(p::step(rig.c, rig.s, {std::numeric_limits<S>::quiet_NaN(), 0, 9, true}) == F::none && rig.s.heard == 2, "no number");
  check(p::step(rig.c, rig.s, {S(7), 0, 9, true}) == F::range && rig.s.heard == 3, "heard");
  rig.read(S(0));
  check(rig.s.heard == 3, "three at most");
}

template <class S> void all() {
  parameters<S>();
  speed<S>();
  acceleration<S>();
  range<S>();
  clocks<S>();
  frozen<S>();
  jitter<S>();
  either_velocity<S>();
  nothing_new<S>();
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
