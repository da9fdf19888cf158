// The wave of the start-up test: its shape, its work, when it ends, and its bounds, at rest and with a drift.
#include "check.hpp"

#include <pellucid/start_up_test.hpp>

#include <initializer_list>
#include <utility>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
constexpr double pi = 3.14159265358979323846;

template <class S> p::StartUpTestParams<S> wave(double least = -1e9, double most = 1e9) {
  return {S(2), 16, 5, S(least), S(most)};
}

template <class S> void parameters() {
  const auto valid = [](std::uint32_t samples) {
    p::StartUpTestParams<S> params = wave<S>();
    params.samples = samples;
    return p::coefficients(params).valid != 0;
  };
  check(valid(8) && valid(200) && !valid(7) && !valid(201) && !valid(4) && !valid(300), "length of half a wave");
  p::StartUpTestParams<S> unsound = wave<S>();
  unsound.effort = S(-1);
  check(p::coefficients(unsound).valid == 0, "an effort is a size");
  check(p::coefficients(unsound).turn_sine == S(0), "without sense there is no wave");
  const p::StartUpTestParams<S> usual;
  check(usual.samples == 30 && usual.rest == 100 && usual.effort == S(0), "usual numbers, and no test");
  const auto c = p::coefficients(wave<S>());
  check_close(double(c.turn_sine), std::sin(pi / 16), 1e-6, "sine of a period's phase");
  check_close(double(c.turn_cosine), std::cos(pi / 16), 1e-6, "cosine of it");
}

/// The whole wave on a joint whose velocity is a multiple of the effort.
template <class S> void shape() {
  for (const S answer : {S(0.5), S(-0.5)}) {
    const auto c = p::coefficients(wave<S>());
    p::StartUpTestState<S> s;
    bool done = false;
    for (int k = 1; k <= 5; ++k) {
      check(p::step(c, s, S(0.001), S(0), S(0.25), done) == S(0) && !done, "rest comes first");
      check(s.rested == static_cast<std::uint32_t>(k), "counted");
    }
    double work = 0, pushed = 0;
    for (int k = 1; k <= 32; ++k) {
      const double velocity = double(answer) * pushed;
      work += 0.001 * pushed * velocity;
      const S effort = p::step(c, s, S(0.001), S(velocity), S(0.25), done);
      pushed = double(effort);
      check_close(pushed, 2 * std::sin(pi * k / 16), 1e-5, "a sine");
      check_close(double(s.work), work, 1e-7, "its work");
      if (k == 17) check(s.middle == s.work, "work by the middle");
      check(!done, "not before its end");
    }
    check(std::fabs(s.middle) > S(0.01) && std::fabs(s.middle - S(0.5) * s.work) < S(1e-3), "half of it by the middle");
    for (int k = 0; k < 5; ++k)
      check(p::step(c, s, S(0.001), S(9), S(0.25), done) == S(0) && !done, "then it waits, without effort");
    const S worked = s.work;
    check(p::step(c, s, S(0.001), S(9), S(0.25), done) == S(0) && done && s.work == worked, "then it ends");
  }
}

/// The smoothed velocity must be small for so many periods in a row; what drifts slowly is allowed for.
template <class S> void rest() {
  for (const S way : {S(-1), S(1)}) {
    const auto c = p::coefficients(wave<S>());
    p::StartUpTestState<S> s;
    bool done = false;
    p::step(c, s, S(0.001), way * S(4), S(0.25), done);
    check(s.drift == way * S(0.25) && s.rested == 1, "a sixteenth of a velocity, at the bound");
    p::step(c, s, S(0.001), way * S(0.5), S(0.25), done);
    check(s.drift == way * S(0.265625) && s.rested == 0, "beyond the bound it does not rest");
    for (int k = 0; k < 400; ++k) {
      p::step(c, s, S(0.001), way * S(1), S(0.25), done);
      check(s.rested == 0, "however long");
    }
    p::StartUpTestState<S> drifts;
    drifts.drift = way * S(0.125);
    for (int k = 0; k < 5; ++k) p::step(c, drifts, S(0.001), way * S(0.125), S(0.25), done);
    for (int k = 0; k < 16; ++k) p::step(c, drifts, S(0.001), way * S(0.125), S(0.25), done);
    check(drifts.work == S(0), "a drift is no answer");
  }
}

/// Whether the wave is broken off at its middle.
template <class S> void ends_early() {
  const auto periods = [](double least, double most, double answer, int trembles = 0) {
    const auto c = p::coefficients(wave<S>(least, most));
    p::StartUpTestState<S> s;
    s.rested = 5;
    bool done = false;
    S pushed = S(0);
    int k = 0;
    while (!done && k < 999) {
      pushed = p::step(c, s, S(0.001), S(k < trembles ? 3 * answer : answer) * pushed, S(0.25), done);
      ++k;
    }
    check(pushed == S(0), "no effort at its end");
    if (trembles > 0) check(p::shown(c.params, s) == F::none, "what one wave shows, another contradicts");
    return k;
  };
  // Half a wave of 2 sin: 0.001 x answer x 4 x 16 / 2 = 0.032 answer [J].
  check(periods(0.01, 0.1, 1) == 33 + 5, "right work goes on to the end, and waits");
  check(periods(0.01, 0.03, 1) == 4 * (33 + 10) + 17, "too much ends in the middle, of the last wave");
  check(periods(0.01, 0.02, 1) == 2 * (33 + 10) + 17, "far too much counts twice: three waves");
  check(periods(0.01, 0.04, 1, 33) == 33 + 10 + 33 + 5, "a wave of a wearer who trembles");
  check(periods(0.01, 0.1, -1) == 17, "and so does the wrong way, at once");
  check(periods(0.05, 0.1, 1) == 33, "a joint that hardly moved has its second half");
  check(periods(0.05, 0.1, -1) == 33, "whichever way");
}

template <class S> void bounds() {
  const p::StartUpTestParams<S> params = wave<S>(0.25, 2);
  const auto says = [&](S middle, S work) {
    p::StartUpTestState<S> s;
    s.middle = middle;
    s.work = work;
    return p::shown(params, s);
  };
  check(says(S(0.25), S(-9)) == F::none && says(S(2), S(-9)) == F::none, "at the bounds the first half decides");
  check(says(S(2.015625), S(2.25)) == F::gain, "too much");
  check(says(S(-0.25), S(9)) == F::polarity, "the wrong way");
  check(says(S(0.234375), S(0.484375)) == F::none, "hardly moved: the second half decides, at its bound");
  check(says(S(0.234375), S(0.46875)) == F::polarity, "below it");
  check(says(S(-0.234375), S(0.015625)) == F::none, "hardly moved the other way");
  check(says(S(-0.234375), S(1.765625)) == F::none && says(S(-0.234375), S(1.78125)) == F::gain, "and too much there");
  check(says(std::numeric_limits<S>::quiet_NaN(), S(1)) == F::polarity, "no number has no polarity");
  p::StartUpTestState<S> less;
  less.rested = 5;
  less.count = 16;
  less.work = S(-0.75);
  bool ends = false;
  p::step(p::coefficients(wave<S>(-1, 2)), less, S(0.001), S(0), S(0.25), ends);
  check(!ends, "a bound below nothing is a bound, too");
  // Middle decides when to end at its own bounds, too.
  for (const auto& one : {std::pair<double, bool>{0.25, false}, {2.0, false}, {2.015625, true}, {-0.25, true}, {-0.234375, false}}) {
    const auto c = p::coefficients(params);
    p::StartUpTestState<S> s;
    s.rested = 10;
    s.count = 16;
    s.work = S(one.first);
    s.waves = p::start_up_waves - 1;
    bool done = false;
    p::step(c, s, S(0.001), S(0), S(0.25), done);
    check(done == one.second, "whether it ends in the middle");
    done = false;
    p::step(c, s, S(0.001), S(0), S(0.25), done);
    check(!done, "after the middle it goes on");
  }
}

template <class S> void all() {
  parameters<S>();
  shape<S>();
  rest<S>();
  ends_early<S>();
  bounds<S>();
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
