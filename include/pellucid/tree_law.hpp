// What a law of several joints reads each period, and the front that its samples pass.
//
// The grammar is law.hpp's with a row for each joint: efforts are those of the coordinates of a tree, in their order, and
// what a wearer gives may be felt at a joint or, as a force and a moment, on a link. A joint whose encoder may not be
// believed stops all of them.
#pragma once

#include "kinematic_tree.hpp"
#include "law.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// A force and its moment about the sensor's point, in the axes of the link that bears it.
template <class S> struct WrenchSample {
  Vector3<S> force{};          ///< force of the wearer on the robot [N]
  Vector3<S> moment{};         ///< [N m]
  std::int64_t time = 0;       ///< when it was measured [us]
  std::uint32_t sequence = 0;  ///< its number; may wrap around
  bool valid = false;          ///< false: the sensor itself says that this is no measurement
};
template <class S> bool is_heard(const WrenchSample<S>& w) noexcept {
  return w.valid && is_finite(w.force.x + w.force.y + w.force.z) && is_finite(w.moment.x + w.moment.y + w.moment.z);
}

/// All that may have been measured in a period: positions are needed, of the rest a law uses what there is.
template <class S, std::size_t N> struct TreeSamples {
  Sample<S> position[N]{};     ///< sample of each joint's encoder
  Sample<S> interaction[N]{};  ///< the wearer's effort on each joint, from sensors there
  Sample<S> muscle[N]{};       ///< the wearer's effort at each joint, from EMG
  WrenchSample<S> wrench{};    ///< the wearer's on a link, at a wrist or a cuff
};

/// Commands to the drives.
template <class S, std::size_t N> struct TreeCommand {
  S effort[N]{};  ///< effort of each joint [N m; N]
  S drive[N]{};   ///< effort of each motor, gears taken out; the same unless motors turn with several joints
};

/// A fault and the joint that it is of.
struct TreeFault {
  SafetyFault fault = SafetyFault::none;
  std::uint32_t joint = 0;  ///< from 0; where the fault is of the whole, the number of joints
};

/// Project a force and moment at a point of a link onto the joints' coordinates, J' F; 0 for joints that do not carry
/// the link.
template <class S, std::size_t N>
void felt_at_joints(const TreeCoefficients<S, N>& c, const TreePose<S, N>& pose, std::size_t link,
                    const Vector3<S>& point, const Vector3<S>& force, const Vector3<S>& moment, S* effort) noexcept {
  for (std::size_t k = 0; k < c.coordinates; ++k) effort[k] = S(0);
  if (link >= c.links) return;
  LinkForce<S> passed{force, moment + cross(point, force)};
  for (std::size_t i = link;; i = c.link[i].parent) {
    const LinkCoefficients<S>& one = c.link[i];
    if (one.joint != JointKind::fixed) effort[one.coordinate] = along(one, passed);
    if (one.on_base) return;
    passed = pose.in_parent[i] * passed;
  }
}

/// Return the speed of a point of a link, |J v| [m/s]; 0 if there is no such link.
template <class S, std::size_t N> S point_speed(const TreeCoefficients<S, N>& c, const TreePose<S, N>& pose,
                                                std::size_t link, const Vector3<S>& point, const S* v) noexcept {
  if (link >= c.links) return S(0);
  // Inwards, the velocity that joints give the point, in the axes of the link at hand.
  Vector3<S> at = point, velocity = zero_vector<S>();
  for (std::size_t i = link;; i = c.link[i].parent) {
    const LinkCoefficients<S>& one = c.link[i];
    if (one.joint == JointKind::revolute) velocity = velocity + cross(one.axis, at) * v[one.coordinate];
    if (one.joint == JointKind::prismatic) velocity = velocity + one.axis * v[one.coordinate];
    if (one.on_base) return sqrt(dot(velocity, velocity));
    velocity = pose.in_parent[i].rotation * velocity;
    at = pose.in_parent[i].rotation * at + pose.in_parent[i].position;
  }
}

/// A law of several joints behind its front.
template <class L> struct TreeController {
  using Law = L;
  static constexpr std::size_t most = L::most;

  typename L::Coefficients law{};   ///< as configured
  typename L::State state{};        ///< state of the law
  SampleState position[most]{};     ///< state of the encoders
  SampleState interaction[most]{};  ///< state of the sensors at joints
  SampleState muscle[most]{};       ///< state of EMG
  SampleState wrench{};             ///< state of the sensor on a link
  TreeFault fault{};                ///< latched, the first
  std::uint32_t steps = 0;          ///< since it was configured
};

/// The first fault stays.
template <class L> void latch(TreeController<L>& c, TreeFault fault) noexcept {
  if (c.fault.fault == SafetyFault::none) c.fault = fault;
}

/// Starts with efforts of 0. False where the parameters make no sense; every step is then 0.
template <class L> bool configure(TreeController<L>& c, const typename L::Params& params) noexcept {
  c = {};
  c.law = coefficients(params);
  if (!c.law.gate.valid) c.fault = c.state.gate.fault = {SafetyFault::configuration, 0};
  return c.law.gate.valid;
}

/// Return the number of joints of a gate, limited to the capacity in case the number in memory is corrupted.
template <class G> constexpr std::size_t joints_of(const G& gate, std::size_t room) noexcept {
  return gate.joints <= room ? gate.joints : room;
}

namespace detail {
/// A sample as the law sees it: no number where it may not be believed.
template <class S> SafetyFault believe(const SampleRules& rules, SampleState& seen, Sample<S>& sample,
                                       std::int64_t now) noexcept {
  const SafetyFault found = examine(rules, seen, sample, now);
  if (found == SafetyFault::none) return found;
  sample.value = std::numeric_limits<S>::quiet_NaN();
  sample.valid = false;
  return found;
}
}  // namespace detail

/// Inputs of the law from all sensors at the time `now` [us]; a fault of an encoder is latched.
template <class L, class S, std::size_t N>
TreeSamples<S, N> believed(TreeController<L>& c, const TreeSamples<S, N>& read, std::int64_t now) noexcept {
  TreeSamples<S, N> samples = read;
  const std::size_t n = joints_of(c.law.gate, N);
  for (std::size_t k = 0; k < n; ++k) {
    const SampleRules& rules = c.law.gate.joint[k].rules;
    const SafetyFault found = detail::believe(rules, c.position[k], samples.position[k], now);
    if (found != SafetyFault::none) latch(c, {found, static_cast<std::uint32_t>(k)});
    (void)detail::believe(rules, c.interaction[k], samples.interaction[k], now);
    (void)detail::believe(rules, c.muscle[k], samples.muscle[k], now);
  }
  if (n > 0) {
    Sample<S> heard{S(0), read.wrench.time, read.wrench.sequence, is_heard(read.wrench)};
    samples.wrench.valid = detail::believe(c.law.gate.joint[0].rules, c.wrench, heard, now) == SafetyFault::none;
  }
  if (c.fault.fault == SafetyFault::none) return samples;
  for (std::size_t k = 0; k < n; ++k) {
    samples.position[k].value = std::numeric_limits<S>::quiet_NaN();
    samples.position[k].valid = false;
  }
  return samples;
}

/// One control period: what goes to the drives, whatever comes in.
template <class L, class S, std::size_t N>
TreeCommand<S, N> step(TreeController<L>& c, const TreeSamples<S, N>& read, std::int64_t now) noexcept {
  const TreeSamples<S, N> samples = believed(c, read, now);
  const TreeCommand<S, N> command = step(c.law, c.state, samples);
  latch(c, c.state.gate.fault);
  ++c.steps;
  return command;
}

/// Samples that are all read just now: a sensor that says nothing starts anew when it speaks again.
template <class L, class S, std::size_t N>
TreeSamples<S, N> stamped(TreeController<L>& c, TreeSamples<S, N> read, std::int64_t now,
                          std::uint32_t sequence) noexcept {
  for (std::size_t k = 0; k < N; ++k) {
    if (!is_heard(read.position[k])) c.position[k] = {};
    if (!is_heard(read.interaction[k])) c.interaction[k] = {};
    if (!is_heard(read.muscle[k])) c.muscle[k] = {};
    Sample<S>* const each[] = {&read.position[k], &read.interaction[k], &read.muscle[k]};
    for (Sample<S>* sample : each) {
      sample->time = now;
      sample->sequence = sequence;
    }
  }
  if (!is_heard(read.wrench)) c.wrench = {};
  read.wrench.time = now;
  read.wrench.sequence = sequence;
  return read;
}

/// Ramps efforts to 0 from the next step on.
template <class L> void stop(TreeController<L>& c) noexcept {
  latch(c, {SafetyFault::stopped, static_cast<std::uint32_t>(c.law.gate.joints)});
}

/// Forgets all samples, so that clocks may restart.
template <class L> void forget_samples(TreeController<L>& c) noexcept {
  for (std::size_t k = 0; k < TreeController<L>::most; ++k) c.position[k] = c.interaction[k] = c.muscle[k] = {};
  c.wrench = {};
}

/// Opens the gate again; efforts go on from where they are, within their rate limits.
template <class L> void reset(TreeController<L>& c) noexcept {
  reset(c.state);
  forget_samples(c);
  c.fault = {};
  if (!c.law.gate.valid) c.fault = c.state.gate.fault = {SafetyFault::configuration, 0};
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
