// A law under its supervisor, with the numbers of both changed, its samples, drive, token and memory broken.
#include "watch.hpp"

#include <pellucid/joint_compensation.hpp>
#include <pellucid/supervisor.hpp>
#include <pellucid/watchdog.hpp>

namespace p = pellucid;

/// Sensible numbers of a supervisor, some of them changed.
template <class S> p::SupervisorParams<S> rules(Bytes& bytes) {
  using P = p::SupervisorParams<S>;
  P usual;
  usual.encoder = {S(8), S(2000), S(-0.1), S(2.7), S(1e-4), S(0.5), 20};
  usual.body.inertia = S(0.05);
  usual.body.wearer_torque = S(3);
  usual.drive.expected = 1;
  usual.drive.tolerance = S(0.5);
  usual.budget = {S(40), S(2), S(0.8)};
  usual.hold = {S(2.5), S(4)};
  usual.reset_delay = S(0.01);
  usual.healthy_samples = 5;
  S sensible[p::field_count<P>], numbers[p::field_count<P>];
  p::to_numbers(usual, sensible);
  change(bytes, sensible, numbers);
  return p::from_numbers<P>(numbers);
}

template <class S> void run(Bytes& bytes) {
  using L = p::JointCompensation<S>;
  p::Supervised<L> law;
  const auto params = changed<typename L::Params>(bytes);
  const bool sound = p::configure(law, params, rules<S>(bytes));
  const auto gate = law.controller.law.gate.params;
  p::Watchdog drive;
  S before{};
  p::Mode mode = p::mode_of(law.state);
  Stream<S> stream(gate.period);
  while (stream.next(bytes)) {
    p::Samples<S> in = stream.sample();
    p::Feedback<S> back;
    back.drive = in.position;
    back.drive.value = law.state.output;
    const std::uint8_t what = bytes.byte();
    if (what == 1) back.drive.value = nonsense<S>(bytes);
    if (what == 2) back.drive.valid = false;
    if (what == 3) back.joint = in.interaction;
    if (what == 4) back.token = bytes.anything<std::uint32_t>();
    if (what == 5) law.state.doing.word ^= 1u << (bytes.byte() % 32);
    if (what == 6) law.state.body.momentum = law.state.hold.taken = nonsense<S>(bytes);
    if (what == 7) p::configure(law, params, rules<S>(bytes));
    if (what == 8) p::stop(law);
    if (what > 200) back.token = law.state.challenge.word;
    const bool was_stopped = p::is_stopped(mode);
    const auto out = p::step(law, in, back, in.position.time);
    const bool power = p::step(drive, out.beat, out.enable, 3);
    ++tally().cycles;
    tally().moving += out.effort != S(0);
    tally().faults += p::is_stopped(out.mode) && !was_stopped;
    require(std::isfinite(out.effort), "the command is a number");
    if (sound) require(std::fabs(out.effort) <= gate.effort_limit, "within the limit");
    const S most = gate.rate_limit * gate.period;
    const S slack = S(4) * std::numeric_limits<S>::epsilon() * (gate.effort_limit + std::fabs(most));
    // At a stop, and where power is off, less is always allowed.
    if (sound && std::fabs(out.effort) > std::fabs(before))
      require(std::fabs(out.effort - before) <= most + slack, "no faster than the rate");
    require(out.enable == (out.mode <= p::Mode::damped_stop), "no power where there is to be none");
    require(power == out.enable, "and the drive's watchdog agrees");
    if (out.mode == p::Mode::latched) require(out.effort == S(0), "latched is nothing");
    require((out.fault != p::SafetyFault::none) == (out.mode >= p::Mode::degraded), "what is not healthy has a reason");
    mode = p::mode_of(law.state);
    before = out.effort;
  }
}
