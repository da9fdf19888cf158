// A law of the list, named LAW, with its numbers changed and its samples broken; once by itself, once behind its front.
#include "watch.hpp"

#include <pellucid/laws.hpp>

namespace p = pellucid;

template <class S> void run(Bytes& bytes) {
  using L = p::LAW<S>;
  p::Controller<L> controller;
  p::configure(controller, changed<typename L::Params>(bytes));
  const bool front = bytes.byte() % 2 == 0;
  const auto& gate = controller.law.gate;
  Stream<S> stream(gate.params.period);
  Watch<S> watch(gate.params, gate.valid);
  while (stream.next(bytes)) {
    if (stream.resets()) {
      p::reset(controller);
      watch.reset();
    }
    // Behind the front a law is watched by what reaches it.
    p::Controller<L> other = controller;
    const p::Samples<S>& read = stream.sample();
    const p::Samples<S> in = front ? p::believed(other, read, read.position.time) : read;
    bool heard = true;
    for (const p::SensorUse& use : L::sensors)
      if (use.required && use.quantity != p::Quantity::position) heard = heard && p::is_heard(p::Samples<S>(in)[use.quantity]);
    const S out = front ? p::step(controller, read, read.position.time) : p::step(controller.law, controller.state, in);
    if (!front) controller.fault = controller.state.gate.fault;
    watch(in, out, front ? controller.fault : controller.state.gate.fault, heard);
  }
}
