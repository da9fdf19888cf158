// The gate by itself, with any command and any velocity.
#include "watch.hpp"

#include <pellucid/safety.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  const S sensible[] = {S(10), S(500), S(20), S(0), S(2.6), S(0.2), S(0.01), S(3), S(1e-3)};
  S numbers[sizeof sensible / sizeof *sensible];
  change(bytes, sensible, numbers);
  const auto c = p::coefficients(p::from_numbers<p::SafetyParams<S>>(numbers));
  p::SafetyState<S> state;
  Stream<S> stream(c.params.period);
  Watch<S> watch(c.params, c.valid);
  S before = 0, way = 0;  // the last position that was a number, and how far it went in a period, smoothed
  while (stream.next(bytes)) {
    if (stream.resets()) {
      p::reset(state);
      watch.reset();
    }
    // The two torques of a law's input stand for command and velocity.
    const p::Samples<S>& in = stream.sample();
    const S command = S(4) * in.interaction.value, velocity = in.muscle.valid ? in.muscle.value : S(0);
    const S most = c.params.velocity_limit * c.params.period;
    if (c.valid && std::isfinite(in.position.value)) {
      const S share = std::fmin(S(125) * c.params.period, S(1)), moved = state.sample.started ? in.position.value - before : S(0);
      way = way + share * (moved - way);
      if (!std::isfinite(way)) way = 0;
      before = in.position.value;
    }
    const bool slow = std::fabs(velocity) <= c.params.velocity_limit || std::fabs(way) <= most * S(1.00001);
    const bool sane = std::isfinite(command) && slow && std::isfinite(velocity);
    const S out =
        p::step(c, state, p::SafetyInput<S>{command, in.position.value, velocity, in.position.time, in.position.sequence, in.position.valid});
    watch(in, out, state.fault, sane);
  }
}
