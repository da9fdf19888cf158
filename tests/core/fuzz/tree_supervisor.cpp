// A law of several joints under its supervisor, the numbers of both changed, its samples, drives, token and memory broken.
#include "tree_watch.hpp"

template <class S> p::TreeSupervisorParams<S, fuzzed_joints> rules(Bytes& bytes) {
  p::TreeSupervisorParams<S, fuzzed_joints> made;
  for (auto& joint : made.joint) {
    using P = p::JointWatchParams<S>;
    P usual;
    usual.encoder = {S(8), S(2000), S(-0.1), S(2.7), S(1e-4), S(0.5), 20};
    usual.drive.expected = 1;
    usual.drive.tolerance = S(0.5);
    usual.budget = {S(40), S(200), S(0.8), S(0)};
    usual.hold = {S(2.5), S(4)};
    usual.joint_tolerance = S(0.5);
    usual.motion = {S(5), S(9), S(2), S(6), S(1)};
    usual.force = {1, 50, S(20)};
    usual.muscle = {1, 50, S(40)};
    usual.delay = {S(0.01), S(1), S(60), S(0.5)};
    if (bytes.byte() % 4 == 0) usual.test = {S(1), 8, 4, S(-1), S(9)};
    usual.joint_expected = bytes.byte() % 4 == 0;
    S sensible[p::field_count<P>], numbers[p::field_count<P>];
    p::to_numbers(usual, sensible);
    change(bytes, sensible, numbers);
    joint = p::from_numbers<P>(numbers);
  }
  made.whole.speed = S(4);
  made.whole.reset_delay = S(0.01);
  made.whole.healthy_samples = 5;
  made.whole.degrades = bytes.byte() % 2;
  made.whole.trusts_motion = bytes.byte() % 2;
  made.whole.force_excess = S(1);
  made.whole.wrench_expected = bytes.byte() % 4 == 0;
  made.whole.wrench_force = made.whole.wrench_moment = S(100);
  return made;
}

template <class S> void run(Bytes& bytes) {
  p::TreeSupervised<FuzzedLaw<S>> law;
  const auto params = changed_tree<S>(bytes);
  const bool sound = p::configure(law, params, rules<S>(bytes));
  const auto gate = law.controller.law.gate;
  TreeStream<S> stream(params.joint[0].gate.period);
  S before[fuzzed_joints]{};
  p::TreeSupervisorOutput<S, fuzzed_joints> out;
  while (stream.next(bytes)) {
    const auto& in = stream.samples();
    p::TreeFeedback<S, fuzzed_joints> back;
    const std::uint8_t what = bytes.byte();
    for (std::size_t k = 0; k < fuzzed_joints; ++k) {
      back.drive[k] = in.position[k];
      back.drive[k].value = out.command.drive[k];
      back.joint[k] = in.position[k];
    }
    if (what == 1) back.drive[1].value = nonsense<S>(bytes);
    if (what == 2) back.drive[0].valid = false;
    if (what == 3) back.token = bytes.anything<std::uint32_t>();
    if (what == 4) law.state.doing.word ^= 1u << (bytes.byte() % 32);
    if (what == 5) law.state.output[bytes.byte() % fuzzed_joints] = nonsense<S>(bytes);
    if (what == 6) p::configure(law, params, rules<S>(bytes));
    if (what == 7) p::stop(law);
    if (what == 9) back.joint[2].value = nonsense<S>(bytes);
    if (what == 10) law.controller.law.gate.joints ^= std::size_t(1) << (bytes.byte() % 64);
    if (what == 11) law.state.joint[0].motion.loudness = law.state.joint[1].delay.rr = nonsense<S>(bytes);
    if (what == 8) law.state.joint[1].hold.taken = law.controller.state.observer.residual[0] = nonsense<S>(bytes);
    if (what > 200) back.token = law.state.challenge.word;
    const bool was_stopped = p::is_stopped(p::mode_of(law.state));
    for (std::size_t k = 0; k < fuzzed_joints; ++k)
      if (what == 5 || what == 6) before[k] = gate.joint[k].params.effort_limit;
    out = p::step(law, in, back, in.position[0].time);
    tally().faults += p::is_stopped(out.mode) && !was_stopped;
    if (sound) watch_efforts(gate, out.command.effort, before, false);
    for (std::size_t k = 0; k < fuzzed_joints; ++k) {
      require(std::isfinite(out.command.drive[k]), "what motors get is a number");
      if (out.mode > p::Mode::damped_stop) require(!out.enable[k], "no power where there is to be none");
      if (k < gate.joints && !out.enable[k]) require(out.mode != p::Mode::running && out.mode != p::Mode::start_up, "and power where all is well");
      if (out.mode == p::Mode::latched) require(out.command.effort[k] == S(0), "latched is nothing");
    }
    const bool healthy = out.mode == p::Mode::running || out.mode == p::Mode::start_up;
    require((out.fault.fault != p::SafetyFault::none) == !healthy, "what is not healthy has a reason");
  }
}
