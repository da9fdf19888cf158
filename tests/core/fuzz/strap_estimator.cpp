// The strap learnt while it is worn: whatever comes in, stiffness and damping stay within their bounds.
#include "watch.hpp"

#include <pellucid/strap_estimator.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  const S sensible[] = {S(0.05), S(0.02), S(1.6), S(0.05), S(0.3), S(0.1), S(0.2), S(8), S(14), S(0.5), S(0), S(30),
           S(1),    S(5),    S(0.02), S(0.01), S(7),  S(21),  S(0.2), S(0.8), S(2e-3)};
  S n[sizeof sensible / sizeof *sensible];
  change(bytes, sensible, n);
  const p::CoupledBodies<S> bodies{n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8], n[9], n[10]};
  const auto c = p::coefficients(p::StrapEstimatorParams<S>{bodies, n[11], n[12], n[13], n[14], n[15], n[16], n[17],
                                                            n[18], n[19], n[20]});
  p::StrapEstimatorState<S> state;
  Stream<S> stream(n[20]);
  while (stream.next(bytes)) {
    const p::LawInput<S>& in = stream.sample();
    p::step(c, state, p::ResidualInput<S>{in.position, in.interaction, in.muscle, in.has_muscle, in.time});
    ++tally().cycles;
    tally().moving += state.learns;
    if (!c.valid) continue;
    require(state.stiffness >= n[16] && state.stiffness <= n[17], "stiffness within its bounds");
    require(state.damping >= n[18] && state.damping <= n[19], "damping within its bounds");
  }
}
