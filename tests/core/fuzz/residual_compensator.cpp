// The residual compensator of a worn orthosis; it numbers its own periods, so that only its clock tells repeats.
#include "../law_numbers.hpp"
#include "watch.hpp"

#include <pellucid/residual_compensator.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  S numbers[p::residual_parameter_count];
  change(bytes, residual_numbers<S>, numbers);
  const auto c = p::coefficients(p::residual_params(numbers));
  p::ResidualState<S> state;
  Stream<S> stream(c.gate.params.period);
  Watch<S> watch(c.gate.params, c.gate.valid);
  std::uint32_t count = 0;
  while (stream.next(bytes)) {
    if (stream.resets()) {
      p::reset(state);
      watch.reset();
    }
    p::LawInput<S> in = stream.sample();
    in.sequence = ++count;
    in.valid = true;
    const bool heard = in.has_muscle && stream.sample().valid;
    const S out = p::step(c, state, p::ResidualInput<S>{in.position, in.interaction, in.muscle, heard, in.time});
    watch(in, out, state.gate.fault, std::isfinite(in.interaction));
  }
}
