// The torque loop inside an actuator. It has no gate: a bad sample may cost a period and may not stay.
#include "watch.hpp"

#include <pellucid/torque_loop.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  const S sensible[] = {S(2), S(20), S(0.01), S(25), S(30), S(170), S(2e-3)};
  S numbers[sizeof sensible / sizeof *sensible];
  change(bytes, sensible, numbers);
  const std::uint32_t delay = bytes.byte(), span = bytes.byte();
  const auto c = p::coefficients(p::TorqueLoopParams<S>{numbers[0], numbers[1], numbers[2], numbers[3], numbers[4],
                                                        numbers[5], delay, span, numbers[6]});
  p::TorqueLoopState<S> state;
  Stream<S> stream(numbers[6]);
  while (stream.next(bytes)) {
    if (stream.resets()) state = p::settled(S(0));
    const p::Samples<S>& in = stream.sample();
    const S out = p::step(c, state, in.muscle.value, p::measured_torque(c, in.position.value, S(1.2) + in.interaction.value));
    ++tally().cycles;
    tally().moving += out != S(0);
    if (!c.sound) continue;
    require(std::isfinite(out), "the command is a number");
    require(std::fabs(out) <= c.motor_limit, "within the motor's limit");
    for (const S torque : state.torques) require(std::isfinite(torque), "what is no number does not stay");
  }
}
