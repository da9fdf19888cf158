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

}  // namespace

int main() {
  order();
  repeats();
  whole<double>();
  whole<float>();
  check(p::safety_fault_count == static_cast<std::size_t>(F::rate) + 1, "every fault has a name");
  return failures();
}
