// A sample's time and number: order, gaps, age and repeats, just within and just beyond the rules.
#include "check.hpp"

#include <pellucid/sample.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

void order() {
  const p::SampleRules rules{1000, 2};
  for (const std::uint32_t from : {0u, 7u, 0xfffffff0u, 0xffffffffu}) {
    for (const std::int64_t at : {std::int64_t(-5), std::int64_t(5000000000)}) {
      p::SampleState s;
      check(p::examine(rules, s, at, from) == F::none && s.started, "the first");
      check(p::examine(rules, s, at + 1000, from + 1) == F::none && s.time == at + 1000, "a gap at the limit");
      p::SampleState late = s;
      check(p::examine(rules, late, at + 2001, from + 2) == F::stale && late.time == at + 1000, "a gap beyond");
      p::SampleState back = s;
      check(p::examine(rules, back, at + 999, from + 2) == F::out_of_order, "a time that goes back");
      back = s;
      check(p::examine(rules, back, at + 1001, from) == F::out_of_order, "a number that goes back");
      back = s;
      check(p::examine(rules, back, at + 1001, from + 0x80000000u) == F::none, "half the numbers lost are a way on");
      back = s;
      check(p::examine(rules, back, at + 1001, from + 0x80000001u) == F::out_of_order, "more are a way back");
      const p::SampleRules any{std::numeric_limits<std::int64_t>::max(), 2};
      back = s;
      back.time = -5;
      check(p::examine(any, back, std::numeric_limits<std::int64_t>::max() - 5, from + 2) == F::none, "half of all times");
      s = {};
      check(p::examine(rules, s, at - 77777, from - 9) == F::none, "the first may be anything");
    }
  }
}

void repeats() {
  const p::SampleRules rules{1000, 2};
  for (const bool number : {true, false}) {
    p::SampleState s;
    p::examine(rules, s, 500, 5);
    for (std::uint32_t k = 1; k <= 4; ++k) {
      const F found = p::examine(rules, s, number ? 500 : 500 + k * 100, number ? 5 : 5);
      check(found == (k <= 2 ? F::none : F::stale) && s.repeats == k, "the same number, twice allowed");
    }
    check(p::examine(rules, s, 1000, 6) == F::none && s.repeats == 0, "a new one begins anew");
    for (std::uint32_t k = 1; k <= 4; ++k)
      check(p::examine(rules, s, 1000, 6 + k) == (k <= 2 ? F::none : F::stale) && s.sequence == 6 + k, "the same time");
  }
}

template <class S> void whole() {
  const p::SampleRules rules{1000, 2};
  const auto one = [&](std::int64_t time, std::int64_t now, bool valid = true, S value = S(1)) {
    p::SampleState s;
    const F found = p::examine(rules, s, p::Sample<S>{value, time, 3, valid}, now);
    check(s.started == (found == F::none), "only a good one is taken note of");
    return found;
  };
  check(one(5000, 5000) == F::none && one(5000, 6000) == F::none, "an age at the limit");
  check(one(5000, 6001) == F::stale, "beyond");
  check(one(5001, 5000) == F::out_of_order, "of the future");
  check(one(5000, 5000, false) == F::not_finite, "not valid");
  check(one(5000, 5000, true, std::numeric_limits<S>::quiet_NaN()) == F::not_finite, "no number");
  check(one(-5000, -4500) == F::none, "a clock may begin below 0");
  const p::SampleRules any{std::numeric_limits<std::int64_t>::max(), 2};
  p::SampleState s;
  const p::Sample<S> old{S(1), -5, 3, true};
  check(p::examine(any, s, old, std::numeric_limits<std::int64_t>::max() - 5) == F::none, "however old, without a limit");
}

/// A clock of 32 bits has turned where it went back by more than half of its range; one of 64 bits never does.
void clocks() {
  const std::int64_t half = std::int64_t(1) << 31, whole = std::int64_t(1) << 32;
  const std::int64_t far = std::numeric_limits<std::int64_t>::max();
  const std::int64_t times[] = {-far - 1, -whole, -2 * half - 1, -half - 1, -half, -half + 1, -1, 0, 1, half / 2, half - 1, half,
                                half + 1, 3 * (half / 2), whole - 1, whole, whole + 1, 2 * whole, far};
  for (const std::int64_t before : times)
    for (const std::int64_t after : times) {
      const bool are_short = before >= -half && before < whole && after >= -half && after < whole;
      const bool turned = are_short && before - after > half;
      check(p::has_turned(before, after) == turned, "a turn");
      p::ClockState s;
      check(p::unwrapped(s, before) == before && s.last == before, "the first time is as it is");
      if (after < far - whole)
        check(p::unwrapped(s, after) == after + (turned ? whole : 0), "the next goes on");
      p::ClockState sampled;
      p::unwrapped(sampled, after);
      if (before > -far + whole) check(p::sampled_at(sampled, before) == before - (turned ? whole : 0), "a sample from before a turn");
    }
  // Around three times, in steps of a quarter: time only goes on, and each sample keeps its age.
  p::ClockState s;
  for (std::int64_t k = 0; k < 12; ++k) {
    const std::int64_t now = p::unwrapped(s, (k * (half / 2)) % whole);
    check(now == k * (half / 2), "as of a clock that never turns");
    if (k > 0) check(p::sampled_at(s, ((k - 1) * (half / 2)) % whole) == (k - 1) * (half / 2), "and its samples");
  }
}

}  // namespace

int main() {
  clocks();
  order();
  repeats();
  whole<double>();
  whole<float>();
  check(p::safety_fault_count == static_cast<std::size_t>(F::rate) + 1, "every fault has a name");
  return failures();
}
