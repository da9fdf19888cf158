// The front of a deployed controller: which samples are believed, and with a law behind it what comes of them.
#include "watch.hpp"

#include <pellucid/position_prediction.hpp>
#include <pellucid/sample.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  const auto c = p::coefficients(changed<p::PositionPredictionParams<S>>(bytes));
  p::PositionPredictionState<S> state;
  p::SampleState front;
  Stream<S> stream(c.gate.params.period);
  Watch<S> watch(c.gate.params, c.gate.valid);
  while (stream.next(bytes)) {
    if (stream.resets()) {
      p::reset(state);
      front = {};
      watch.reset();
    }
    const p::Samples<S>& in = stream.sample();
    // How late it is read comes from the fuzzer too: in time, too late, or before it was measured.
    const std::int64_t late = in.interaction.valid ? 100 : 100 * static_cast<std::int8_t>(bytes.byte());
    const auto fault = p::examine(c.gate.rules, front, in.position, in.position.time + late);
    const bool sane = late >= 0 && !(1e-6 * static_cast<double>(late) >
                                     static_cast<double>(c.gate.params.max_age) * 1.000001 + 1e-6);
    p::Samples<S> seen = in;
    if (fault != p::SafetyFault::none) seen.position.value = std::numeric_limits<S>::quiet_NaN();
    if (c.gate.valid) require(fault != p::SafetyFault::none || sane, "late or from the future is not believed");
    if (c.gate.valid && fault == p::SafetyFault::none) require(p::is_heard(in.position), "no number is none");
    const S out = p::step(c, state, seen);
    watch(seen, out, state.gate.fault, fault == p::SafetyFault::none);
  }
}
