// The watch for shaking: ways from turn to turn, the smallest of four or five in a row, its limit and its time, in both signs.
#include "check.hpp"

#include <pellucid/shaking_watch.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

template <class S> void all() {
  const p::ShakingWatchParams<S> usual;
  check(usual.time == S(0.33) && usual.slow == S(6), "a third of a second, and a sixth");
  const auto valid = [](S limit, S time, S slow, S period = S(0.5)) {
    return p::coefficients(p::ShakingWatchParams<S>{limit, time, slow}, period).valid != 0;
  };
  check(valid(S(1), S(1), S(1.75)) && !valid(S(1), S(1), S(2)) && !valid(S(1), S(1), S(-1)), "a slow part slower than the period");
  check(!valid(S(-1), S(1), S(1)) && !valid(S(1), S(0), S(1)) && !valid(S(1), S(1), S(1), S(0)), "nor backwards");
  // A drift under it takes from the ways against it what it goes meanwhile, and no more.
  const auto slow = p::coefficients(p::ShakingWatchParams<S>{S(1), S(0.33), S(6)}, S(0.002));
  for (const S way : {S(-1), S(1)}) {
    p::ShakingWatchState<S> still, moving;
    for (int k = 0; k < 3000; ++k) {
      const S fast = k / 100 % 2 == 0 ? way : -way;
      p::step(slow, still, fast);
      p::step(slow, moving, S(0.5) * way + fast);
    }
    check(still.smallest > S(0.1) && moving.smallest >= S(0.098), "about a mean velocity");
    // After a reach the position without its slow part comes back, while the joint rests or goes on slowly.
    p::ShakingWatchState<S> reaching;
    for (int k = 0; k < 3000; ++k) {
      const bool reaches = k / 100 % 2 == 0;
      p::step(slow, reaching, reaches ? way * S(5) : S(0));
      check(reaching.smallest == S(0), "reaches with pauses are no shaking");
    }
  }
  const auto c = p::coefficients(p::ShakingWatchParams<S>{S(1), S(0.5), S(0)}, S(0.25));
  check(c.limit == S(1) && c.time == S(0.5) && c.turn == S(0.1) && c.period == S(0.25), "as given");
  for (const S way : {S(-1), S(1)}) {
    p::ShakingWatchState<S> one;
    for (int k = 0; k < 50; ++k) check(p::step(c, one, way * S(8)) == F::none && one.smallest == S(0), "one way is no shaking");
    p::ShakingWatchState<S> s;
    for (int k = 0; k < 4; ++k) {
      check(p::step(c, s, (k % 2 == 0 ? way : -way) * S(4)) == F::none, "at the limit");
      check(s.smallest == (k < 3 ? S(0) : S(1)), "the smallest of four");
    }
    check(p::step(c, s, way * S(4)) == F::shaking && s.smallest == S(1) / S(0.55), "not five times");
    p::ShakingWatchState<S> held;
    for (int k = 0; k < 20; ++k) {
      check(p::step(c, held, (k % 2 == 0 ? way : -way) * S(2)) == F::none, "half of it as often as it likes");
      check(held.smallest == (k < 3 ? S(0) : k < 4 ? S(0.5) : S(0.5) / S(0.55)), "five count more");
    }
    p::ShakingWatchState<S> faster;
    for (int k = 0; k < 3; ++k) check(p::step(c, faster, (k % 2 == 0 ? way : -way) * S(4.5)) == F::none, "three are no shaking");
    check(p::step(c, faster, way * S(-4.5)) == F::shaking && faster.smallest == S(1.125), "the fourth is");
    check(p::step(c, faster, S(0)) == F::shaking, "as long as it may go on");
    check(p::step(c, faster, S(0)) == F::none && faster.smallest == S(0), "and is forgotten");
    p::ShakingWatchState<S> dying;
    for (const int v : {20, -20, 20, -3}) check(p::step(c, dying, way * S(v)) == F::none, "what dies out");
    check(dying.smallest == S(0.75), "is measured by the smallest");
    // One way that takes too long: those before it do not count.
    p::ShakingWatchState<S> late;
    for (const int v : {1, -1, 1, 0, 0, -1, 1, -1, 1}) check(p::step(c, late, way * S(4.5) * S(v)) == F::none, "not in a row");
    check(p::step(c, late, way * S(-4.5)) == F::shaking, "four after it");
    // What trembles by less than a share of the limit does not turn the joint round.
    p::ShakingWatchState<S> trembling;
    for (int k = 0; k < 60; ++k) {
      check(p::step(c, trembling, way * (k % 2 == 0 ? S(0.36) : S(-0.36))) == F::none, "a tremor");
      check(trembling.way == S(1) || trembling.travel[0] == S(0), "is no turn");
    }
  }
  const S nan = std::numeric_limits<S>::quiet_NaN(), huge = std::numeric_limits<S>::infinity();
  for (const S wrong : {nan, huge, -huge}) {
    p::ShakingWatchState<S> s;
    for (int k = 0; k < 3; ++k) p::step(c, s, k % 2 == 0 ? S(6) : S(-6));
    check(p::step(c, s, wrong) == F::none && p::is_finite(s.place) && p::is_finite(s.smallest), "no number is not remembered");
    for (int k = 0; k < 3; ++k) check(p::step(c, s, k % 2 == 0 ? S(6) : S(-6)) == F::none, "and what follows is judged anew");
    check(p::step(c, s, S(-6)) == F::shaking, "as before");
    for (S p::ShakingWatchState<S>::*const lost :
         {&p::ShakingWatchState<S>::place, &p::ShakingWatchState<S>::turned, &p::ShakingWatchState<S>::far,
          &p::ShakingWatchState<S>::moved, &p::ShakingWatchState<S>::moved_far, &p::ShakingWatchState<S>::age, &p::ShakingWatchState<S>::way}) {
      p::ShakingWatchState<S> broken;
      for (int k = 0; k < 4; ++k) p::step(c, broken, k % 2 == 0 ? S(6) : S(-6));
      broken.*lost = wrong;
      check(p::step(c, broken, S(0)) == F::none && broken.smallest == S(0), "whichever memory lost, all begins anew");
      check(p::is_finite(broken.place + broken.far + broken.turned + broken.age + broken.since), "with numbers");
    }
    p::ShakingWatchState<S> broken;
    for (int k = 0; k < 4; ++k) p::step(c, broken, k % 2 == 0 ? S(6) : S(-6));
    broken.since = wrong;
    p::step(c, broken, S(0));
    check(p::is_finite(broken.since), "nor a time");
    broken.travel[1] = wrong;
    check(p::step(c, broken, S(0)) == F::none && broken.travel[1] == S(0), "nor a way");
  }
  const auto off = p::coefficients(p::ShakingWatchParams<S>{}, S(0.002));
  p::ShakingWatchState<S> s;
  for (int k = 0; k < 1000; ++k) check(p::step(off, s, k % 2 == 0 ? S(99) : S(-99)) == F::none, "without a limit: off");
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
