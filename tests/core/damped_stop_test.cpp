// The damped stop: viscous, bounded, never with the motion, and never with more energy than it took.
#include "check.hpp"

#include <pellucid/damped_stop.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

template <class S> void all() {
  const p::DampedStopParams<S> params{S(2), S(4)};
  for (const S way : {S(-1), S(1)}) {
    p::DampedStopState<S> s;
    check(p::step(params, s, S(0.25), way * S(2)) == way * S(-2), "against half the first velocity");
    check(s.velocity == way && s.taken == S(0), "smoothed; nothing was taken yet");
    check(p::step(params, s, S(0.25), way * S(2)) == way * S(-3), "then against more of it");
    check(s.taken == S(1), "what the last effort took");
    check(p::step(params, s, S(0.25), way * S(8)) == way * S(-4), "within its limit");
    check(p::step(params, s, S(0.25), way * S(-1)) == S(0), "never with the motion");
    const S before = s.taken;
    check(p::step(params, s, S(0.25), way * S(2)) != S(0) && s.taken == before, "no effort, no energy");

    // It gives back what it took and not more: with nothing left there is no effort.
    p::DampedStopState<S> given{way * S(4), way * S(-4), S(-0.5)};
    check(p::step(params, given, S(0.25), way * S(0.25)) == S(0), "an empty account gives nothing");
    p::DampedStopState<S> even{way * S(4), S(0), S(0)};
    check(p::step(params, even, S(0.25), way * S(4)) == way * S(-4), "an even one does");
    p::DampedStopState<S> spent{S(0), way * S(2), S(0.25)};
    check(p::step(params, spent, S(0.25), way) == S(0) && spent.taken == S(-0.25), "what an effort gives is counted");

    p::DampedStopState<S> bad;
    check(p::step(params, bad, S(0.25), std::numeric_limits<S>::infinity()) != std::numeric_limits<S>::infinity(), "a number");
    const p::DampedStopParams<S> free{S(2), std::numeric_limits<S>::infinity()};
    p::DampedStopState<S> wild;
    check(p::step(free, wild, S(0.25), way * std::numeric_limits<S>::infinity()) == S(0), "an endless effort is none");
    const p::DampedStopParams<S> steep{std::numeric_limits<S>::max(), std::numeric_limits<S>::infinity()};
    p::DampedStopState<S> endless;
    check(p::step(steep, endless, S(0.25), way * S(8)) == S(0), "nor is one that overflows");
    p::DampedStopState<S> lost{way, way, std::numeric_limits<S>::quiet_NaN()};
    check(p::step(params, lost, S(0.25), way) == S(0) && lost.taken == S(0), "an account without a number begins anew");
  }
  p::DampedStopState<S> still;
  check(p::step(params, still, S(0.25), S(0)) == S(0) && still.velocity == S(0), "at rest nothing");
  p::DampedStopState<S> nan;
  check(p::step(params, nan, S(0.25), std::numeric_limits<S>::quiet_NaN()) == S(0), "no velocity, no effort");
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
