// A joint's own gravity and friction, with its numbers changed and its samples broken.
#include "../law_numbers.hpp"
#include "watch.hpp"

#include <pellucid/joint_compensation.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  S numbers[p::joint_compensation_parameter_count];
  change(bytes, joint_compensation_numbers<S>, numbers);
  const auto c = p::coefficients(p::joint_compensation_params(numbers));
  p::JointCompensationState<S> state;
  Stream<S> stream(c.gate.params.period);
  Watch<S> watch(c.gate.params, c.gate.valid);
  while (stream.next(bytes)) {
    if (stream.resets()) {
      p::reset(state);
      watch.reset();
    }
    const p::LawInput<S>& in = stream.sample();
    const S out = p::step(c, state, p::JointCompensationInput<S>{in.position, in.time, in.sequence, in.valid});
    watch(in, out, state.gate.fault);
  }
}
