// Numbers and samples of a robot of three joints from bytes, and what every command of its law is held to.
#pragma once

#include "watch.hpp"

#include <pellucid/tree_supervisor.hpp>

namespace p = pellucid;

constexpr std::size_t fuzzed_joints = 3;
template <class S> using FuzzedLaw = p::TreeCompensation<S, fuzzed_joints>;

/// A chain of hinges, some of its numbers changed.
template <class S> typename FuzzedLaw<S>::Params changed_tree(Bytes& bytes) {
  typename FuzzedLaw<S>::Params params;
  const std::uint8_t what = bytes.byte();
  params.tree.links = what == 1 ? 9 : what == 2 ? 2 : fuzzed_joints;
  params.drives.coupled = what % 4 == 3;
  const S any = nonsense<S>(bytes);
  for (std::size_t k = 0; k < fuzzed_joints; ++k) {
    p::LinkParams<S>& link = params.tree.link[k];
    link.parent = static_cast<std::uint32_t>(k);
    link.z = S(-0.3);
    link.axis_y = S(k == 1 ? 1 : 0);
    link.rotor_inertia = S(0.02);
    link.body.mass = S(1.5);
    link.body.moment_z = S(-0.2);
    link.body.inertia_xx = link.body.inertia_yy = S(0.04);
    params.joint[k] = changed<p::JointShareParams<S>>(bytes);
    if (what % 2 == 0) params.joint[k].gate = typical_params<p::JointShareParams<S>>().gate;
    auto& friction = params.drives.joint[k].friction;
    friction = typical_params<p::FrictionParams<S>>();
    params.drives.turns[k][k] = S(1);
    params.drives.motor[k].friction = friction;
  }
  params.drives.turns[1][0] = S(0.5);
  params.whole.end_link = params.whole.sensor_link = 3;
  params.whole.end_z = S(-0.3);
  if (what == 4) params.whole.power_limit = S(3);
  if (what == 6) params.whole.speed_limit = S(0.5);
  if (what == 8) params.tree.link[1].body.mass = any;
  if (what == 9) params.drives.turns[0][1] = any;
  if (what == 10) params.whole.observer_bandwidth = any;
  return params;
}

/// One stream for each joint, and a wrench of what is left.
template <class S> class TreeStream {
 public:
  explicit TreeStream(S period) : streams_{Stream<S>(period), Stream<S>(period), Stream<S>(period)} {}
  bool next(Bytes& bytes) {
    bool any = false;
    for (std::size_t k = 0; k < fuzzed_joints; ++k) any = streams_[k].next(bytes) || any;
    if (!any) return false;
    resets_ = false;
    for (std::size_t k = 0; k < fuzzed_joints; ++k) {
      const p::Samples<S>& one = streams_[k].sample();
      in_.position[k] = one.position;
      in_.interaction[k] = one.interaction;
      in_.muscle[k] = one.muscle;
      resets_ = resets_ || streams_[k].resets();
    }
    in_.wrench.force = {in_.interaction[0].value, in_.muscle[1].value, S(1)};
    in_.wrench.time = in_.position[0].time;
    in_.wrench.sequence = in_.position[0].sequence;
    in_.wrench.valid = in_.interaction[2].valid;
    return true;
  }
  const p::TreeSamples<S, fuzzed_joints>& samples() const { return in_; }
  bool resets() const { return resets_; }

 private:
  Stream<S> streams_[fuzzed_joints];
  p::TreeSamples<S, fuzzed_joints> in_{};
  bool resets_ = false;
};

/// A number within its joint's limit, no faster than its rate away from 0.
template <class S> void watch_efforts(const p::TreeGateCoefficients<S, fuzzed_joints>& gate, const S* out, S* before,
                                      bool shut) {
  ++tally().cycles;
  tally().moving += out[0] != S(0);
  for (std::size_t k = 0; k < gate.joints; ++k) {
    require(std::isfinite(out[k]), "every command is a number");
    if (!gate.valid) require(out[k] == S(0), "nonsense is not run");
    const S limit = gate.joint[k].params.effort_limit, most = gate.joint[k].max_change;
    const S slack = S(4) * std::numeric_limits<S>::epsilon() * (std::fabs(limit) + std::fabs(most));
    if (gate.valid) require(std::fabs(out[k]) <= limit, "within the limit");
    if (gate.valid && std::fabs(out[k]) > std::fabs(before[k]))
      require(std::fabs(out[k] - before[k]) <= most + slack, "no faster than the rate");
    if (shut) require(std::fabs(out[k]) <= std::fabs(before[k]), "once shut only closer to 0");
    before[k] = out[k];
  }
}
