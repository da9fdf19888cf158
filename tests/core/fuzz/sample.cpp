// The front of a deployed controller: which samples are believed, and with a law behind it what comes of them.
#include "../law_numbers.hpp"
#include "watch.hpp"

#include <pellucid/position_prediction.hpp>
#include <pellucid/sample.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  S numbers[p::position_prediction_parameter_count];
  change(bytes, position_prediction_numbers<S>, numbers);
  const auto c = p::coefficients(p::law_params(numbers));
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
    const p::LawInput<S>& in = stream.sample();
    // How late it is read comes from the fuzzer too: in time, too late, or before it was measured.
    const std::int64_t late = in.has_interaction ? 100 : 100 * static_cast<std::int8_t>(bytes.byte());
    const auto fault =
        p::examine(p::sample_rules(c.gate), front, p::Sample<S>{in.position, in.time, in.sequence, in.valid}, in.time + late);
    const bool sane = late >= 0 && !(1e-6 * static_cast<double>(late) >
                                     static_cast<double>(c.gate.params.max_age) * 1.000001 + 1e-6);
    p::LawInput<S> seen = in;
    if (fault != p::SafetyFault::none) seen.position = std::numeric_limits<S>::quiet_NaN();
    if (c.gate.valid) require(fault != p::SafetyFault::none || sane, "late or from the future is not believed");
    if (c.gate.valid && fault == p::SafetyFault::none) require(std::isfinite(in.position) && in.valid, "no number is none");
    const S out = p::step(c, state, seen);
    watch(seen, out, state.gate.fault, fault == p::SafetyFault::none);
  }
}
