// Open-loop compensation by direction, with its numbers changed and its samples broken.
#include "../law_numbers.hpp"
#include "watch.hpp"

#include <pellucid/directional_compensation.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  S numbers[p::directional_parameter_count];
  change(bytes, directional_numbers<S>, numbers);
  const auto c = p::coefficients(p::law_params(numbers));
  p::DirectionalCompensationState<S> state;
  watch_law<S>(bytes, c, state);
}
