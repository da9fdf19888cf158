// The watch for ringing: its band, its mean and its limit, and numbers by which it is what it is.
#include "check.hpp"

#include <pellucid/ringing_watch.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

template <class S> void all() {
  const p::RingingWatchParams<S> usual;
  check(usual.slowest == S(20) && usual.fastest == S(100) && usual.memory == S(3), "the band between people and dither");
  const auto valid = [](S slowest, S fastest, S memory) {
    return p::coefficients(p::RingingWatchParams<S>{S(1), slowest, fastest, memory}, S(0.5)).valid != 0;
  };
  check(valid(S(1.75), S(1.75), S(1.75)), "filters that are slower than the period");
  check(!valid(S(2), S(1), S(1)) && !valid(S(1), S(2), S(1)) && !valid(S(1), S(1), S(2)), "and not as fast");
  check(!valid(S(2.5), S(1), S(1)) && !valid(S(1), S(2.5), S(1)) && !valid(S(1), S(1), S(2.5)), "nor faster");
  check(!valid(S(-1), S(1), S(1)), "nor backwards");
  const auto c = p::coefficients(p::RingingWatchParams<S>{S(0.0625), S(0.5), S(1), S(0.25)}, S(0.5));
  check(c.smoothing == S(0.5) && c.slowing == S(0.25) && c.forgetting == S(0.125) && c.limit == S(0.0625), "as given");
  for (const S way : {S(-1), S(1)}) {
    p::RingingWatchState<S> s;
    check(p::step(c, s, way * S(4)) == F::ringing, "beyond the limit");
    check(s.smooth == way * S(2) && s.slow == way * S(0.5) && s.size == S(0.1875), "smooth, slow and size");
    // 0.1875 is beyond a limit of 0.0625: the size is what counts.
    p::RingingWatchState<S> again;
    auto strict = c;
    strict.limit = S(0.1875);
    check(p::step(strict, again, way * S(4)) == F::none, "at the limit");
    strict.limit = S(0.18701171875);
    again = {};
    check(p::step(strict, again, way * S(4)) == F::ringing, "beyond");
    p::step(c, s, way * S(-4));
    check(s.smooth == way * S(-1) && s.slow == way * S(0.125), "followed");
    check(s.size == S(0.1875) + S(0.125) * (S(1.125) - S(0.1875)), "the mean forgets");
    p::step(c, s, std::numeric_limits<S>::infinity());
    check(s.size == S(0) && s.smooth == S(0), "what is no number is forgotten at once");
  }
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
