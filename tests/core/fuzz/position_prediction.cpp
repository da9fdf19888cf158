// Closed-loop position control, with its numbers changed and its samples broken.
#include "../law_numbers.hpp"
#include "watch.hpp"

#include <pellucid/position_prediction.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  S numbers[p::position_prediction_parameter_count];
  change(bytes, position_prediction_numbers<S>, numbers);
  const auto c = p::coefficients(p::law_params(numbers));
  p::PositionPredictionState<S> state;
  watch_law<S>(bytes, c, state);
}
