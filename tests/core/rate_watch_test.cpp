// The watch of the task's rate, and clocks of 32 bits.
#include "check.hpp"

#include <pellucid/rate_watch.hpp>

#include <cstdint>
#include <initializer_list>
#include <limits>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

/// Periods until a task of a millisecond's period is found that calls every `interval` [us], and what is found.
template <class S> std::int64_t found_after(std::int64_t interval, std::int64_t jitter, std::int64_t most) {
  const auto c = p::coefficients(p::RateWatchParams<S>{250, S(0.2)}, S(0.001));
  p::RateWatchState s;
  for (std::int64_t k = 0; k < most; ++k) {
    const std::int64_t now = 1000000 + k * interval + (k % 2 == 0 ? jitter : -jitter);
    if (p::step(c, s, now) != F::none) return k * interval;
  }
  return -1;
}

template <class S> void rates() {
  check(found_after<S>(1000, 0, 100000) < 0 && found_after<S>(1000, 400, 100000) < 0, "a task at its rate, with jitter or not");
  check(found_after<S>(1150, 200, 100000) < 0 && found_after<S>(850, 200, 100000) < 0, "and one that is a little off");
  for (const std::int64_t wrong : {250, 500, 750, 1300, 2000, 4000}) {
    const std::int64_t after = found_after<S>(wrong, 0, 100000);
    check(after > 0 && after <= 310000, "every rate that is off by a fifth or more, within a third of a second");
  }
  // Called twice a period, with the same time in both.
  const auto c = p::coefficients(p::RateWatchParams<S>{250, S(0.2)}, S(0.001));
  p::RateWatchState s;
  F found = F::none;
  for (std::int64_t k = 0; k < 300 && found == F::none; ++k) found = p::step(c, s, (k / 2) * 1000);
  check(found == F::rate, "called twice a period");
  p::RateWatchState back;
  check(p::step(c, back, 5000000) == F::none && p::step(c, back, 1000) == F::none && back.began == 1000, "a clock that goes back begins anew");
  p::RateWatchState late;
  check(p::step(c, late, 0) == F::none && p::step(c, late, 300001) == F::none, "as long as a fifth more");
  check(p::step(c, late, 300001 + 300002) == F::rate, "and no longer");
  const auto off = p::coefficients(p::RateWatchParams<S>{}, S(0.001));
  check(off.valid != 0 && p::step(off, late, 99000000) == F::none, "without a number of periods: off");
  check(p::coefficients(p::RateWatchParams<S>{1000000, S(0.2)}, S(0.01)).valid == 0, "no longer than 32 bits of time");
}

/// The mean of exactly as many periods as stated, held to both ends of the tolerance, which it may touch.
template <class S> void means() {
  const auto c = p::coefficients(p::RateWatchParams<S>{64, S(0.25)}, S(0.001));
  const auto found_at = [&](std::int64_t interval) {
    p::RateWatchState s;
    for (int k = 0; k <= 1000; ++k)
      if (p::step(c, s, k * interval) != F::none) return k;
    return 0;
  };
  check(found_at(500) == 64 && found_at(749) == 64, "a quick task after as many periods as the mean has");
  check(found_at(750) == 0 && found_at(1250) == 0, "a quarter less or more is within the tolerance");
  check(found_at(1251) == 64 && found_at(1252) == 64, "what is beyond it is not");
  check(found_at(2000) == 41, "a slow task as soon as it is beyond the time of all");
  p::RateWatchState s;
  for (int k = 0; k <= 64; ++k) check(p::step(c, s, k * 1000) == F::none && s.count == (k < 64 ? unsigned(k) : 0u), "begins anew");
  const auto usual = p::coefficients(p::RateWatchParams<S>{200}, S(0.001));
  const auto said = [&](std::int64_t interval) {
    p::RateWatchState each;
    for (int k = 0; k < 1000; ++k)
      if (p::step(usual, each, k * interval) != F::none) return true;
    return false;
  };
  check(!said(850) && !said(1150) && said(750) && said(1250), "the usual tolerance is a fifth");
  p::RateWatchState late;
  p::step(c, late, 0);
  check(p::step(c, late, std::numeric_limits<std::int64_t>::max()) == F::rate, "as late as a clock can be");
}

/// Numbers of which none or no whole time can be made are not valid, and nothing is watched.
template <class S> void senseless() {
  const auto valid = [](std::uint32_t samples, S tolerance, S period) {
    const auto c = p::coefficients(p::RateWatchParams<S>{samples, tolerance}, period);
    check(c.valid != 0 || (c.samples == 0 && c.least == 0 && c.most == 0), "what is not valid watches nothing");
    return c.valid != 0;
  };
  const S nan = std::numeric_limits<S>::quiet_NaN();
  check(valid(100, S(0.25), S(0.001)) && valid(0, S(0.25), S(0.001)), "valid");
  check(!valid(100, S(-0.5), S(0.001)) && !valid(100, S(1.5), S(0.001)) && !valid(100, nan, S(0.001)), "a tolerance is a share");
  check(!valid(100, S(0.25), S(-0.001)) && !valid(100, S(0.25), nan), "a period is positive");
  check(valid(1599, S(0.25), S(1)) && !valid(1600, S(0.25), S(1)), "with the tolerance it is less than 2000 s");
  check(valid(1999, S(0), S(1)) && !valid(2000, S(0), S(1)), "without one, too");
}

void clocks() {
  const std::int64_t turn = std::int64_t(1) << 32;
  for (const std::int64_t low : {std::int64_t(0), -turn / 2}) {
    p::ClockState s;
    const std::int64_t top = low + turn - 1;
    check(p::unwrapped(s, top - 500) == top - 500, "as it is");
    const std::int64_t after = p::unwrapped(s, low + 499);
    check(after == top + 500 && p::sampled_at(s, low + 399) == top + 400, "it goes on after a turn");
    check(p::sampled_at(s, top - 100) == top - 100, "and a sample from before it is older");
    p::unwrapped(s, top - 500);
    check(p::unwrapped(s, low + 499) == after + turn, "and after the next");
  }
  p::ClockState s;
  p::unwrapped(s, 5000000);
  check(p::unwrapped(s, 4000000) == 4000000, "a second back is no turn");
  check(p::sampled_at(s, 4000500) == 4000500, "nor is a sample from the future");
  p::ClockState wide;
  p::unwrapped(wide, std::int64_t(1) << 40);
  check(p::unwrapped(wide, 7) == 7, "a clock of 64 bits does not turn");
}

}  // namespace

int main() {
  rates<double>();
  rates<float>();
  means<double>();
  means<float>();
  senseless<double>();
  senseless<float>();
  clocks();
  return failures();
}
