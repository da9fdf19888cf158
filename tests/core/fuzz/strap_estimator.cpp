// The strap learnt while it is worn: whatever comes in, stiffness and damping stay within their bounds.
#include "watch.hpp"

#include <pellucid/strap_estimator.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  const S sensible[] = {S(0.05), S(0.02), S(1.6), S(0.05), S(0.3), S(0.1), S(0.2), S(8), S(14), S(0.5), S(0), S(30),
           S(1),    S(5),    S(0.02), S(0.01), S(7),  S(21),  S(0.2), S(0.8), S(2e-3)};
  S n[sizeof sensible / sizeof *sensible];
  change(bytes, sensible, n);
  const auto c = p::coefficients(p::from_numbers<p::StrapEstimatorParams<S>>(n));
  p::StrapEstimatorState<S> state;
  Stream<S> stream(n[20]);
  while (stream.next(bytes)) {
    p::step(c, state, stream.sample());
    ++tally().cycles;
    tally().moving += state.learns;
    if (!c.valid) continue;
    require(state.stiffness >= n[16] && state.stiffness <= n[17], "stiffness within its bounds");
    require(state.damping >= n[18] && state.damping <= n[19], "damping within its bounds");
  }
}
