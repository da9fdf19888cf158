// The watch of the residual and of force sensors beside it: each bound just within and just beyond, in both signs; what a
// wrong gain, sign or offset of the sensor leaves; numbers that are none.
#include "check.hpp"

#include <pellucid/tree_force_watch.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
using S = double;
constexpr S never = std::numeric_limits<S>::infinity();
using Params = p::TreeForceWatchParams<S>;
using State = p::TreeForceWatchState<S>;

Params params() { return {4, 2, 0.5, 3, 0.25}; }

void coefficients() {
  const auto c = p::coefficients(params(), S(32), S(0x1p-9));
  check(c.valid && c.following == 0.0625 && c.smoothing == 0x1p-7 && c.inverse_scale == 4, "shares of a period");
  check_close(c.averaging, 0.2 * 0x1p-7, 1e-15, "a fifth as fast");
  check(p::coefficients(Params{}, S(30), S(0.002)).inverse_scale == 0, "no scale, no loudness");
  const Params usual;
  check(usual.slow == 5 && usual.wearer_torque == never && usual.tolerance == never && usual.burst == never, "not checked");
  check(!p::coefficients(params(), S(512), S(0x1p-9)).valid, "an observer that is too fast");
  Params bad = params();
  bad.slow = 512;
  check(!p::coefficients(bad, S(32), S(0x1p-9)).valid, "a slow part that is not");
  bad.slow = 448;
  check(p::coefficients(bad, S(448), S(0x1p-9)).valid, "filters that are slower than the period");
  for (int k = 0; k < 5; ++k) {
    S numbers[5];
    p::to_numbers(params(), numbers);
    numbers[k] = -1;
    check(!p::coefficients(p::from_numbers<Params>(numbers), S(32), S(0x1p-9)).valid, "less than nothing");
  }
}

/// One period, by hand.
void one_period() {
  const auto c = p::coefficients(params(), S(32), S(0x1p-9));
  State s;
  check(s.loudness == -0.25 && s.felt == 0 && s.open == 0, "a start is quiet");
  s = {1, 0, 0.5, 0.25, 0.75, 0.5, 0.5, 0.125};
  p::step(c, s, S(2), S(3), true, S(1), S(0.5));
  check(s.felt == 1.125 && s.burst == 0.875, "as late as the residual");
  check(s.contradiction == 0.5 + (0.875 - 0.5) * 0x1p-7, "what lasts of it");
  check_close(s.open, 0.25 + (1 - 0.7 * 0.5 - 0.25) * 0x1p-7, 1e-15, "friction is known but for a share");
  check(s.lasting == 0.75 + 1.25 * 0x1p-7 && s.felt_slow == 0.5 + 0.625 * 0x1p-7, "slow parts");
  const S loud = (1.125 - s.felt_slow) - 1.5 * (2 - s.lasting);
  check(s.settled == 0.5 + 0.5 * 0x1p-7, "comes in");
  check_close(s.loudness, 0.125 + (4 * loud - 0.125) * 0.2 * 0x1p-7, 1e-15, "too loud by");
  State other{-1, 0, -0.5, 0.25, -0.75, -0.5, 0, 0.125};
  p::step(c, other, S(-2), S(-3), true, S(1), S(0.5));
  check(other.felt == -s.felt && other.contradiction == -s.contradiction && other.loudness == s.loudness, "either way");
  State fast;
  p::step(c, fast, S(0), S(0), false, S(1), S(9));
  check_close(fast.open, 0.3 * 0x1p-7, 1e-15, "no more of friction is known than there is at rest");
  State deaf{1, 9, 0.5, 0, 0, 0.5, 1, 1};
  p::step(c, deaf, S(2), S(3), false, S(1), S(1));
  check(deaf.felt == 0.9375 && deaf.burst == 0, "a sensor that was not heard contradicts nothing");
  check_close(deaf.loudness, 1 - 0.2 * 0x1p-7, 1e-15, "and is not loud");
  for (const S none : {std::numeric_limits<S>::quiet_NaN(), never}) {
    State lost{1, 1, 1, 1, 1, 1, 1, 1};
    p::step(c, lost, none, S(0), true, S(0), S(0));
    check(lost.felt == 0 && lost.lasting == 0 && lost.loudness == -0.25, "no number begins anew");
    lost.felt = 1;
    p::step(c, lost, S(0), none, true, S(0), S(0));
    check(lost.felt == 0 && lost.contradiction == 0, "of either");
  }
}

void bounds() {
  const auto c = p::coefficients(params(), S(32), S(0x1p-9));
  constexpr S more = 0x1p-20;
  for (const S way : {-1.0, 1.0}) {
    State s;
    s.lasting = s.contradiction = s.burst = way * 9;
    s.settled = 0.9 - more;
    check(p::shown(c, s, S(1)) == F::none, "not while the law begins");
    s = {};
    s.settled = 0.9;
    s.open = 0.25;
    s.lasting = way * 2.25;
    check(p::shown(c, s, S(1)) == F::none, "what a wearer gives");
    s.lasting = way * (2.25 + more);
    check(p::shown(c, s, S(1)) == F::unexplained, "and beyond");
    s.contradiction = s.burst = way * 9;
    check(p::shown(c, s, S(1)) == F::unexplained, "comes first");
    s = {};
    s.settled = 1;
    s.open = 0.25;
    s.contradiction = way * 0.75;
    check(p::shown(c, s, S(1)) == F::none, "within the tolerance");
    s.contradiction = way * (0.75 + more);
    check(p::shown(c, s, S(1)) == F::force_sensor, "and beyond");
    s = {};
    s.settled = 1;
    s.burst = way * 4;
    check(p::shown(c, s, S(1)) == F::none, "at once");
    s.burst = way * (4 + more);
    check(p::shown(c, s, S(1)) == F::force_sensor, "and beyond");
    s.burst = std::numeric_limits<S>::quiet_NaN();
    check(p::shown(c, s, S(1)) == F::force_sensor, "no number is beyond");
  }
}

/// A sensor that says gain times what a wearer gives and more, for seconds; the residual is right.
F lives(S gain, S more, S& loudness) {
  const auto c = p::coefficients(params(), S(30), S(0.002));
  State s;
  S residual = 0;
  F found = F::none;
  for (int k = 0; k < 3000 && found == F::none; ++k) {
    const S t = 0.002 * k, given = 0.6 * p::sin(8 * t) + 0.2 * p::sin(31 * t);
    residual = residual + c.following * (given - residual);
    p::step(c, s, residual, gain * given + more, true, S(0.3), S(0.3));
    found = p::shown(c, s, S(0.3));
  }
  loudness = s.loudness;
  return found;
}

void sensors() {
  S loudness = 0;
  check(lives(1, 0, loudness) == F::none && loudness < -0.1, "right");
  check(lives(1.05, 0.1, loudness) == F::none && loudness < -0.1, "right within its accuracy");
  check(lives(1, 0.8, loudness) == F::force_sensor, "an offset");
  check(lives(1, -0.8, loudness) == F::force_sensor, "either way");
  check(lives(1, 12, loudness) == F::force_sensor, "at its rail");
  (void)lives(3, 0, loudness);
  check(loudness > 0.1, "three times too much is too loud");
}

}  // namespace

int main() {
  coefficients();
  one_period();
  bounds();
  sensors();
  return failures();
}
