// From raw EMG to a torque: whatever the electrodes give, the torque is a number within its limit.
#include "watch.hpp"

#include <pellucid/emg_torque.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  const S sensible[] = {S(30), S(0.5), S(-100), S(80), S(10), S(0.001), S(1), S(-0.9), S(0.1)};
  S numbers[sizeof sensible / sizeof *sensible];
  change(bytes, sensible, numbers);
  p::EmgTorqueParams<S> params;
  params.envelope.count = 1;
  params.envelope.section[0] = {numbers[8], S(0), S(0), numbers[7], S(0)};
  params.muscles = bytes.byte() % 4 == 0 ? bytes.byte() : 2;
  params.powers = bytes.byte() % 4 == 0 ? bytes.byte() : 2;
  params.weight[0][0] = numbers[1];
  params.weight[1][0] = numbers[2];
  params.weight[2][0] = numbers[3];
  params.weight[2][1] = numbers[4];
  for (std::size_t m = 0; m < p::max_muscles; ++m) {
    params.floor[m] = numbers[5];
    params.ceiling[m] = numbers[6];
  }
  params.patience = bytes.byte();
  params.torque_limit = numbers[0];
  const auto c = p::coefficients(params);
  p::EmgTorqueState<S> state;
  Stream<S> stream(S(1e-3));
  while (stream.next(bytes)) {
    const p::Samples<S>& in = stream.sample();
    const S one = in.muscle.value, other = in.interaction.value;
    p::listen(c, state, {one, other, one, other});
    const S torque = p::emg_torque(c, state, in.position.value);
    ++tally().cycles;
    tally().moving += torque != S(0);
    require(std::isfinite(torque), "the torque is a number");
    require(c.valid ? std::fabs(torque) <= params.torque_limit : torque == S(0), "within its limit");
    require(c.valid || !p::is_heard(c, state), "nonsense is not heard");
  }
}
