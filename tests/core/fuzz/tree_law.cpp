// A law of several joints, with its numbers changed and its samples broken; once by itself, once behind its front.
#include "tree_watch.hpp"

template <class S> void run(Bytes& bytes) {
  p::TreeController<FuzzedLaw<S>> law;
  const auto params = changed_tree<S>(bytes);
  p::configure(law, params);
  const bool front = bytes.byte() % 2 == 0;
  TreeStream<S> stream(params.joint[0].gate.period);
  S before[fuzzed_joints]{};
  while (stream.next(bytes)) {
    if (stream.resets()) p::reset(law);
    const auto& in = stream.samples();
    const bool was = law.state.gate.fault.fault != p::SafetyFault::none;
    const auto out = front ? p::step(law, in, in.position[0].time) : p::step(law.law, law.state, in);
    const bool shut = law.state.gate.fault.fault != p::SafetyFault::none;
    for (std::size_t k = 0; k < fuzzed_joints; ++k) {
      if (!std::isfinite(in.position[k].value) && law.law.gate.joints == fuzzed_joints)
        require(shut, "an encoder that says no number shuts the gate in its own cycle");
      require(std::isfinite(out.drive[k]), "what motors get is a number");
    }
    tally().faults += shut && !was;
    watch_efforts(law.law.gate, out.effort, before, shut);
  }
}
