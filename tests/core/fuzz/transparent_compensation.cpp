// Compensation of one coherent body, led by a force sensor, EMG and the oscillator, all at once.
#include "../law_numbers.hpp"
#include "watch.hpp"

#include <pellucid/transparent_compensation.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  S numbers[p::transparent_parameter_count];
  change(bytes, transparent_numbers<S>, numbers);
  const auto c = p::coefficients(p::law_params(numbers));
  p::TransparentCompensationState<S> state;
  watch_law<S>(bytes, c, state);
}
