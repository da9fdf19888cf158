// The watch of a drive that answers late: delays just within and beyond, errors of its measurement that are no delay,
// commands that say too little.
#include "check.hpp"

#include <pellucid/drive_delay_watch.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
using S = double;
using Params = p::DriveDelayWatchParams<S>;
constexpr S period = 0.002;

Params params() { return {0.01, 1, 60, 0.5}; }

struct Answer {
  int late = 0;  // [periods]
  S gain = 1, offset = 0, noise = 0, size = 4;
};

/// A command of slow sines, and how late its answer is found to be wrong; negative: never.
int found(const Answer& answer, const Params& rules = params()) {
  const auto c = p::coefficients(rules, period);
  p::DriveDelayWatchState<S> s;
  std::uint32_t random = 1;
  const auto asked = [&](int k) {
    const S t = period * (k < 0 ? 0 : k);
    return answer.size * (1 + 0.8 * p::sin(2 * t) + 0.3 * p::sin(5.1 * t + 1));
  };
  for (int k = 0; k < 5000; ++k) {
    random = random * 1664525u + 1013904223u;
    const S noise = answer.noise * (static_cast<S>(random >> 8) * 0x1p-23 - 1);
    const S given = answer.gain * asked(k - answer.late) + answer.offset + noise;
    if (p::step(c, s, asked(k), given) != F::none) return k;
  }
  return -1;
}

void delays() {
  check(found({}) < 0, "at once");
  for (const int late : {1, 2, 4}) check(found({late}) < 0, "within the limit");
  for (const int late : {6, 8, 10}) {
    const int when = found({late});
    check(when > 0 && when < 1500, "beyond");
  }
  for (const S gain : {0.95, 1.05})
    for (const S offset : {-0.3, 0.3}) {
      check(found({1, gain, offset, 0.1}) < 0, "errors of a measurement are no delay");
      check(found({10, gain, offset, 0.1}) > 0, "nor do they hide one");
    }
  check(found({10, 1, 0, 0, 0.3}) < 0, "a command that hardly changes says nothing");
  Params none = params();
  none.limit = std::numeric_limits<S>::infinity();
  check(found({100}, none) < 0, "any delay");
}

/// How much of what is wrong lateness explains, beside what the command itself explains: just enough, and just too little.
void shares() {
  Params rules{0.01, 0.5, 60, 1e-7, 0.5};
  const auto judged = [&](const Params& r, S er, S ee) {
    const auto c = p::coefficients(r, period);
    p::DriveDelayWatchState<S> s;
    s.count = 1e10;  // so that a period changes nothing
    s.aa = 2, s.ar = 0.5, s.rr = 1.125, s.ea = 0.1, s.er = er, s.ee = ee;
    return p::step(c, s, S(0), S(0));
  };
  // The rate's own variance is 2 / 2; er of 0.05 is 0.05 / 2 of lateness, and explains half of 0.0025 / 2 + 0.0025 / 2.
  check(judged(rules, 0.05, 0.00624) == F::drive_effort, "lateness explains more than half");
  check(judged(rules, 0.05, 0.00626) == F::none, "less than half");
  rules.share = 0;
  check(judged(rules, 0.05, 9) == F::drive_effort, "however little");
  check(judged(rules, 0.0351, 9) == F::drive_effort && judged(rules, 0.0349, 9) == F::none, "but not so late");
  check(judged(rules, -0.05, 9) == F::none, "nor early");
  // A rate that varies by 1 where the command itself varies by 2, beside what the command explains of it.
  for (const S needed : {0.99, 1.01}) {
    rules.rate = p::sqrt(needed);
    check((judged(rules, 0.05, 9) == F::drive_effort) == (needed < 1), "the rate varies just enough, or too little");
  }
  // Two fifths of the memory must be filled.
  for (const S filled : {0.399, 0.401}) {
    const auto c = p::coefficients(Params{0.01, 0.5, 60, 1e-7}, period);
    p::DriveDelayWatchState<S> s;
    s.count = filled / c.forget - 1;
    s.aa = 2, s.rr = 1, s.er = 0.05, s.ee = 9;
    check((p::step(c, s, S(0), S(0)) == F::drive_effort) == (filled > 0.4), "two fifths of the memory");
  }
  // The first answer is what later ones are compared with, and each weighs the same until the memory is full.
  {
    const auto c = p::coefficients(params(), period);
    p::DriveDelayWatchState<S> s;
    p::step(c, s, S(3), S(1));
    check(s.mean_error == 2 && s.mean == 3 && s.ee == 0 && s.aa == 0 && s.count == 1, "the first answer");
    for (int k = 0; k < 3000; ++k) p::step(c, s, S(3), S(1));
    check_close(s.count, 1000.0, 1e-9, "the memory is full");
    check(s.ee == 0, "an offset is no error");
  }
  // A drive that is late and wrong in another way, which the share tells apart.
  for (const S other : {0.0, 1.0}) {
    const auto c = p::coefficients(Params{0.01, 1, 60, 0.5, 0.5}, period);
    p::DriveDelayWatchState<S> s;
    bool late = false;
    for (int k = 0; k < 5000; ++k) {
      const S t = period * k, asked = 4 + 3 * p::sin(2 * t), then = 4 + 3 * p::sin(2 * (t - 8 * period));
      late = late || p::step(c, s, asked, then + other * p::sin(11 * t)) != F::none;
    }
    check(late == (other < 0.5), "more is wrong than that it is late");
  }
}

void numbers() {
  const auto c = p::coefficients(params(), period);
  check(c.valid && c.smoothing == 0.12 && c.forget == 0.001 && c.needed == 1, "shares of a period");
  check_close(c.inverse_period, 500.0, 1e-9, "and its inverse");
  const Params usual;
  check(usual.limit == std::numeric_limits<S>::infinity() && usual.smoothing == 60 && usual.forget == 0.5 && usual.share == 0, "not checked");
  check(!p::coefficients(params(), S(0)).valid && !p::coefficients(params(), S(0.02)).valid, "a period that is none");
  for (int k = 0; k < 4; ++k) {
    S all[5];
    p::to_numbers(params(), all);
    all[k] = 0;
    check(!p::coefficients(p::from_numbers<Params>(all), period).valid, "nothing is no limit");
  }
  Params fast = params();
  fast.forget = 600;
  check(!p::coefficients(fast, period).valid, "a memory of less than a period");
  for (const S rate : {499.0, 500.0}) {
    fast = params();
    fast.forget = rate;
    check(p::coefficients(fast, period).valid == (rate < 500), "nor one of a whole period");
    fast = params();
    fast.smoothing = rate;
    check(p::coefficients(fast, period).valid == (rate < 500), "nor is anything smooth with one");
  }
  check(!p::coefficients(params(), -period).valid, "a period backwards");
  p::DriveDelayWatchState<S> s;
  s.asked = 3, s.rr = s.aa = 9;
  check(p::step(c, s, std::numeric_limits<S>::quiet_NaN(), S(1)) == F::none && s.rr == 0 && s.asked == 0, "no number");
  s.rr = 9;
  check(p::step(c, s, S(1), std::numeric_limits<S>::infinity()) == F::none && s.rr == 0, "begins anew");
}

/// A delay is judged from a share of the memory on, where the command's rate varied, and where it explains enough.
void shown() {
  auto c = p::coefficients(params(), period);
  c.forget = p::delay_memory / 8, c.needed = 0.5, c.params.share = 0.25;
  p::DriveDelayWatchState<S> s;
  s.aa = 1, s.rr = 1, s.er = 1, s.ee = 4, s.count = 8;
  check(p::seen_lateness(c, s).is_shown, "all of it just enough");
  const auto without = [&](S p::DriveDelayWatchState<S>::*number, S value) {
    auto other = s;
    other.*number = value;
    return !p::seen_lateness(c, other).is_shown;
  };
  check(without(&p::DriveDelayWatchState<S>::count, 7.99), "not before");
  check(without(&p::DriveDelayWatchState<S>::rr, 0.5) && !without(&p::DriveDelayWatchState<S>::rr, 0.51), "a steady rate");
  check(without(&p::DriveDelayWatchState<S>::ee, 4.01), "another error");
}

}  // namespace

int main() {
  shown();
  numbers();
  delays();
  shares();
  return failures();
}
