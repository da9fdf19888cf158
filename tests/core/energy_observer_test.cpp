// The energy observer: what a store lets pass, what fills and empties it, in both directions.
#include "check.hpp"

#include <pellucid/energy_observer.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

template <class S> void all() {
  const S size = S(2);
  for (const S way : {S(-1), S(1)}) {
    p::EnergyObserverState<S> s;
    // 2 N m at 2 rad/s, of which friction of 0.5 N m takes 1 W: 0.75 J a period of 0.25 s.
    for (int k = 1; k <= 3; ++k) {
      check(p::step(size, s, S(0.25), way * S(2), way * S(2), S(0.5)) == way * S(2), "passes from the store");
      check(s.spent == S(0.75) * static_cast<S>(k), "which empties");
    }
    check(p::step(size, s, S(0.25), way * S(2), way * S(2), S(0.5)) == S(0), "an empty store gives nothing");
    check(s.spent == S(2), "and friction fills it");
    check(p::step(size, s, S(0.25), way * S(2), way * S(2), S(0.5)) == S(0) && s.spent == S(1.75), "exactly empty is empty");
    check(p::step(size, s, S(0.25), way * S(2), way * S(2), S(-0.5)) == way * S(2) && s.spent == S(2.5), "friction's size counts");
    check(p::step(size, s, S(0.25), way * S(2), way * S(-2), S(0)) == way * S(2) && s.spent == S(1.5), "against the motion all passes");
    check(p::step(size, s, S(0.25), way * S(2), S(0), S(0)) == way * S(2), "at rest, too");
    check(p::step(size, s, S(0.25), S(0), way * S(8), S(4)) == S(0) && s.spent == S(0), "full is full");
    s.spent = S(2.5);
    check(p::step(size, s, S(0.25), way * S(2), S(0), S(0)) == way * S(2), "at rest from an empty store, too");
    s.spent = S(0);
    p::step(size, s, S(0.25), way * std::numeric_limits<S>::infinity(), way, S(0));
    check(s.spent == size, "what is no number empties it");
  }
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
