// The budget of a command: push, power and energy just within and just beyond their limits, in both signs.
#include "check.hpp"

#include <pellucid/energy_budget.hpp>

#include <cmath>
#include <initializer_list>
#include <limits>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
constexpr double never = std::numeric_limits<double>::infinity();

template <class S> p::EnergyBudgetParams<S> only(double push, double power, double store, double steady = 0) {
  return {S(push), S(power), S(store), S(steady)};
}

template <class S> void push() {
  const auto params = only<S>(4, never, never);
  const auto once = [&](S effort, S weight, S drag) {
    p::EnergyBudgetState<S> s;
    return p::step(params, s, S(0.25), effort, S(0), weight, drag);
  };
  for (const S way : {S(-1), S(1)}) {
    check(once(way * S(4), S(0), S(0)) == F::none && once(way * S(4.03125), S(0), S(0)) == F::push, "at the limit");
    check(once(way * S(4.5), S(0), S(0.5)) == F::none, "friction takes of it");
    check(once(way * S(4.53125), S(0), S(0.5)) == F::push, "so much and no more");
    check(once(way * S(6), way * S(2), S(0)) == F::none, "weight is carried");
    check(once(way * S(6.03125), way * S(2), S(0)) == F::push, "so much and no more");
    check(once(way * S(2.03125), way * S(-2), S(0)) == F::push, "an effort that goes the way the weight does");
    check(once(way * S(2), way * S(-2), S(0)) == F::none, "and one at the limit");
  }
  check(once(std::numeric_limits<S>::quiet_NaN(), S(0), S(0)) == F::push, "no number is beyond");
}

template <class S> void power() {
  const auto params = only<S>(never, 4, never);
  for (const S effort : {S(-2), S(2)}) {
    for (const S way : {S(-1), S(1)}) {
      p::EnergyBudgetState<S> s;
      check(p::step(params, s, S(0.25), effort, way * S(2), S(0), S(9)) == F::none, "at the limit");
      check(p::step(params, s, S(0.25), effort, way * S(2.03125), S(0), S(9)) == F::power, "given or taken");
      check(p::step(params, s, S(0.25), effort, way * S(2.03125), effort, S(9)) == F::power, "of the whole effort");
      // At 5 ms a quarter of a period's power counts: a reading that is off is nothing, what lasts is all.
      s = {};
      check(p::step(params, s, S(0.005), effort, way * S(7), S(0), S(9)) == F::none, "one period beyond");
      check(std::fabs(s.power - S(0.25) * effort * way * S(7)) < S(1e-5), "a quarter of it");
      for (int k = 0; k < 99; ++k) p::step(params, s, S(0.005), effort, S(0), S(0), S(9));
      F found = F::none;
      int periods = 0;
      while (found == F::none && periods < 99) found = p::step(params, s, S(0.005), effort, way * S(4), S(0), S(9)), ++periods;
      check(found == F::power && periods == 3, "twice the limit: 1 - 0.75^n beyond a half");
      check(p::step(params, s, S(0.005), std::numeric_limits<S>::quiet_NaN(), way, S(0), S(9)) != F::none, "no number is beyond");
      check(s.power == S(0), "and is not remembered");
    }
  }
}

template <class S> void energy() {
  // 2 N m at 2 rad/s, of which a drag of 0.5 N m takes 1 W and 1 W refills the store: 2 W, 0.5 J a period.
  for (const S way : {S(-1), S(1)}) {
    const auto params = only<S>(never, never, 2, 1);
    p::EnergyBudgetState<S> s;
    for (int k = 1; k <= 4; ++k) {
      check(p::step(params, s, S(0.25), way * S(2), way * S(2), S(0), S(0.5)) == F::none, "within the store");
      check(s.spent == S(0.5) * static_cast<S>(k), "spent");
    }
    check(p::step(params, s, S(0.25), way * S(2), way * S(2), S(0), S(0.5)) == F::energy && s.spent == S(2.5), "beyond");
    check(p::step(params, s, S(0.25), way * S(2), way * S(-2), S(0), S(0.5)) == F::none, "what is taken back refills it");
    check(s.spent == S(2.5) - S(0.25) * S(6), "by as much");
    for (int k = 0; k < 9; ++k) p::step(params, s, S(0.25), S(0), S(0), S(0), S(0.5));
    check(s.spent == S(0), "and so does time, up to nothing spent");
    p::step(params, s, S(0.25), way * S(5), way * S(2), way * S(3), S(0));
    check(s.spent == S(0.75), "lifting the weight is not spent");
    s = {};
    p::step(params, s, S(0.25), S(0), way * S(2), way * S(-3), S(0));
    check(s.spent == S(1.25), "what the weight does without the effort is");
  }
}

template <class S> void all() {
  push<S>();
  power<S>();
  energy<S>();
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
