// The watch for shaking: speeds of either direction, their smaller one, its mean and its limit, in both signs.
#include "check.hpp"

#include <pellucid/shaking_watch.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

template <class S> void all() {
  const p::ShakingWatchParams<S> usual;
  check(usual.recent == S(12) && usual.memory == S(0.7) && usual.slow == S(6), "a twelfth of a second, a second and a half, and a sixth");
  const auto valid = [](S recent, S memory, S slow = S(0)) {
    return p::coefficients(p::ShakingWatchParams<S>{S(1), recent, memory, slow}, S(0.5)).valid != 0;
  };
  check(valid(S(1), S(1), S(1.75)) && !valid(S(1), S(1), S(2)) && !valid(S(1), S(1), S(-1)), "nor the slow part");
  // A drift under it hides nothing: to and fro about any mean velocity is the same.
  const auto slow = p::coefficients(p::ShakingWatchParams<S>{S(1), S(12), S(0.7), S(6)}, S(0.002));
  p::ShakingWatchState<S> still, moving;
  for (int k = 0; k < 3000; ++k) {
    const S fast = k / 100 % 2 == 0 ? S(1) : S(-1);
    p::step(slow, still, fast);
    p::step(slow, moving, S(3) + fast);
  }
  check_close(moving.mean, still.mean, S(0.02), "about any mean velocity");
  check(still.mean > S(0.05), "and it is shaking");
  check(valid(S(1.75), S(1.75)), "filters that are slower than the period");
  check(!valid(S(2), S(1)) && !valid(S(1), S(2)) && !valid(S(2.5), S(1)) && !valid(S(1), S(2.5)), "and not as fast");
  check(!valid(S(-1), S(1)) && !valid(S(1), S(-1)), "nor backwards");
  const auto c = p::coefficients(p::ShakingWatchParams<S>{S(0.375), S(1), S(0.5), S(0)}, S(0.5));
  check(c.following == S(0.5) && c.forgetting == S(0.25) && c.limit == S(0.375), "as given");
  for (const S way : {S(-1), S(1)}) {
    p::ShakingWatchState<S> s;
    check(p::step(c, s, way * S(8)) == F::none && s.mean == S(0), "one way is no shaking, however fast");
    check((way > S(0) ? s.forward : s.backward) == S(4) && (way > S(0) ? s.backward : s.forward) == S(0), "its direction");
    // 4 decays to 2 while the other way rises to 1.5: a quarter of the smaller one is the limit.
    check(p::step(c, s, way * S(-3)) == F::none && s.mean == S(0.375), "at the limit");
    p::ShakingWatchState<S> faster;
    p::step(c, faster, way * S(8));
    check(p::step(c, faster, way * S(-3.25)) == F::shaking && faster.mean == S(0.40625), "just beyond it");
    check(p::step(c, s, S(0)) == F::shaking && s.mean == S(0.46875), "the mean goes on while both are late");
    for (int k = 0; k < 200; ++k) p::step(c, s, S(0));
    check(p::step(c, s, S(0)) == F::none && s.mean < S(1e-6), "and is forgotten");
  }
  const S nan = std::numeric_limits<S>::quiet_NaN(), huge = std::numeric_limits<S>::infinity();
  for (const S wrong : {nan, huge, -huge}) {
    p::ShakingWatchState<S> s;
    p::step(c, s, S(8));
    p::step(c, s, wrong);
    check(p::is_finite(s.forward) && p::is_finite(s.backward) && p::is_finite(s.mean), "no number is not remembered");
    check(p::step(c, s, S(8)) == F::none, "and what follows is judged anew");
  }
  for (const S wrong : {nan, huge, -huge})
    for (S p::ShakingWatchState<S>::*const lost : {&p::ShakingWatchState<S>::forward, &p::ShakingWatchState<S>::backward,
                                                   &p::ShakingWatchState<S>::mean, &p::ShakingWatchState<S>::slow}) {
      p::ShakingWatchState<S> broken;
      broken.*lost = wrong;
      p::step(c, broken, S(0));
      check(broken.forward == S(0) && broken.backward == S(0) && broken.mean == S(0) && broken.slow == S(0), "whichever memory lost, all begins anew");
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
