// Compensation of a robot of several joints: weight, friction and inertia in shares of each joint's own.
//
//   u = s_G g(q) + offset + s_F friction(v, load) + s_J (M a + C v) + feedback of what the wearer gives + tremble
//
// The variants are numbers. With gravity and friction alone it is full compensation as it is published; with a share of
// inertia, an energy store and friction that changes its sign smoothly it is the transparent law of one joint, joint by
// joint, with what joints do to each other in the load. A force sensor may be at joints or, as a wrench, on a link,
// from where J' takes it to joints. EMG leads the acceleration of joints whose limb is a pendulum about them. What drives
// passes each joint's energy observer, and all of it the gate. An observer of momentum tells what else acts.
#pragma once

#include "dither.hpp"
#include "emg_prediction.hpp"
#include "energy_observer.hpp"
#include "momentum_observer.hpp"
#include "motion_estimator.hpp"
#include "torque_feedback.hpp"
#include "tree_gate.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Parameters of the law at one joint.
template <class S> struct JointShareParams {
  S gravity_share = S(1), friction_share = S(0.8), inertia_share{}, friction_lead{};
  MotionEstimatorParams<S> estimator{};  ///< estimate of the motion
  S acceleration_limit = S(25), energy_store = S(std::numeric_limits<S>::infinity());
  TorqueFeedbackParams<S> feedback{};  ///< on a force sensor
  EmgPredictionParams<S> emg{};        ///< prediction of the acceleration from EMG; its share 0: none
  DitherParams<S> dither{};            ///< against sticking; its torque 0: none
  SafetyParams<S> gate{};              ///< the last step; its period is the law's

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.gravity_share, {"gravity_share", unit::one, share(), "s_G, of gravity that is compensated"});
    visit(p.friction_share, {"friction_share", unit::one, share(), "s_F, of friction that is compensated"});
    visit(p.inertia_share, {"inertia_share", unit::one, share(), "s_J, of inertia times acceleration and of C v"});
    visit(p.friction_lead, {"friction_lead", unit::time, at_least(0), "prediction time of the velocity for friction"});
    pellucid::walk(p.estimator, visit);
    visit(p.acceleration_limit, {"acceleration_limit", unit::acceleration, at_least(0),
                                 "limit of the fed forward acceleration"});
    visit(p.energy_store, {"energy_store", unit::energy, at_least(0).or_infinite(),
                           "capacity of the energy observer; infinite: no limit"});
    pellucid::walk(p.feedback, visit);
    pellucid::walk(p.emg, visit);
    pellucid::walk(p.dither, visit);
    pellucid::walk(p.gate, visit);
  }
};

/// Parameters of the law for the whole robot.
template <class S> struct WholeTreeParams {
  S observer_bandwidth = S(30), power_limit = S(std::numeric_limits<S>::infinity()), speed_limit = power_limit;
  std::uint32_t end_link = 0, sensor_link = 0;
  S end_x{}, end_y{}, end_z{}, sensor_x{}, sensor_y{}, sensor_z{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.observer_bandwidth, {"observer_bandwidth", unit::rate, at_least(0),
                                 "w of the momentum's observer, times the period below 1; 0: none"});
    visit(p.power_limit, {"power_limit", Unit{0, 0, 0, "W"}, above(0).or_infinite(),
                          "of the sum of efforts times velocities; infinite: none"});
    visit(p.speed_limit, {"speed_limit", Unit{0, 0, 0, "m/s"}, above(0).or_infinite(),
                          "of the end point; infinite: none"});
    visit(p.end_link, {"end_link", unit::one, at_least(0), "link with the end point, from 1; 0: none"});
    visit(p.end_x, {"end_x", unit::length, any_number(), "position of the end point in its link"});
    visit(p.end_y, {"end_y", unit::length, any_number(), "position of the end point in its link"});
    visit(p.end_z, {"end_z", unit::length, any_number(), "position of the end point in its link"});
    visit(p.sensor_link, {"sensor_link", unit::one, at_least(0), "link with the force sensor, from 1; 0: none"});
    visit(p.sensor_x, {"sensor_x", unit::length, any_number(), "position of the force sensor in its link"});
    visit(p.sensor_y, {"sensor_y", unit::length, any_number(), "position of the force sensor in its link"});
    visit(p.sensor_z, {"sensor_z", unit::length, any_number(), "position of the force sensor in its link"});
  }
};

template <class S, std::size_t N> struct TreeCompensationParams {
  TreeParams<S, N> tree{};          ///< identified
  TreeDrivesParams<S, N> drives{};  ///< identified; the velocity_width of each joint's friction > 0
  JointShareParams<S> joint[N]{};   ///< parameters of each joint
  WholeTreeParams<S> whole{};       ///< and with all
};

/// Coefficients computed once from JointShareParams.
template <class S> struct JointShareCoefficients {
  JointShareParams<S> params{};                ///< as they are
  MotionEstimatorCoefficients<S> estimator{};  ///< estimate of the motion
  TorqueFeedbackCoefficients<S> feedback{};    ///< on a force sensor
  EmgPredictionCoefficients<S> emg{};          ///< prediction of the acceleration from EMG
  DitherCoefficients<S> dither{};              ///< against sticking
};

/// Coefficients computed once from TreeCompensationParams.
template <class S, std::size_t N> struct TreeCompensationCoefficients {
  TreeCoefficients<S, N> tree{};            ///< compensated body
  TreeDrivesCoefficients<S, N> drives{};    ///< losses of the drives
  JointShareCoefficients<S> joint[N]{};     ///< shares of each joint
  WholeTreeParams<S> whole{};               ///< as they are
  TreeGateCoefficients<S, N> gate{};        ///< shut where the parameters make no sense
  bool any_inertia = false;                 ///< whether any joint's inertia is compensated
};

template <class S, std::size_t N>
TreeCompensationCoefficients<S, N> coefficients(const TreeCompensationParams<S, N>& p) noexcept {
  TreeCompensationCoefficients<S, N> c;
  c.tree = coefficients(p.tree);
  const std::size_t n = c.tree.coordinates;
  c.drives = coefficients(p.drives, n);
  c.whole = p.whole;
  SafetyParams<S> limits[N];
  bool valid = c.tree.valid && c.drives.valid && is_sound(p.whole) && p.whole.end_link <= p.tree.links &&
               p.whole.sensor_link <= p.tree.links && is_finite(p.tree.gravity_x + p.tree.gravity_y + p.tree.gravity_z);
  for (std::size_t i = 0; i < c.tree.links; ++i) valid = valid && is_sound(p.tree.link[i]);
  for (std::size_t k = 0; k < n; ++k) {
    const JointShareParams<S>& one = p.joint[k];
    const S period = one.gate.period;
    limits[k] = one.gate;
    c.joint[k] = {one, coefficients(one.estimator, period), coefficients(one.feedback, period),
                  coefficients(one.emg, period), coefficients(one.dither, period)};
    c.any_inertia = c.any_inertia || one.inertia_share > S(0);
    valid = valid && is_sound(one) && is_sound(p.drives.joint[k]) && c.joint[k].estimator.valid &&
            c.joint[k].feedback.valid && c.joint[k].emg.valid && c.joint[k].dither.valid &&
            p.drives.joint[k].friction.velocity_width > S(smallest_velocity);
    if (p.drives.coupled)
      valid = valid && is_sound(p.drives.motor[k]) && p.drives.motor[k].friction.velocity_width > S(smallest_velocity);
  }
  c.gate = tree_gate<S, N>(limits, n, p.whole.power_limit, p.whole.speed_limit);
  c.gate.valid = c.gate.valid && valid && p.whole.observer_bandwidth * limits[0].period < S(1);
  return c;
}

/// Whether every count and index of a law lies within its arrays, and each link's parent before it, whatever a memory
/// lost.
template <class S, std::size_t N> bool is_within_bounds(const TreeCompensationCoefficients<S, N>& c) noexcept {
  if (c.tree.links > N || c.tree.coordinates > c.tree.links || c.gate.joints != c.tree.coordinates) return false;
  if (c.whole.end_link > c.tree.links || c.whole.sensor_link > c.tree.links) return false;
  for (std::size_t i = 0; i < c.tree.links; ++i) {
    const LinkCoefficients<S>& link = c.tree.link[i];
    if (!link.on_base && link.parent >= i) return false;
    if (link.joint != JointKind::fixed && link.coordinate >= c.tree.coordinates) return false;
  }
  return true;
}

template <class S> struct JointShareState {
  MotionEstimatorState<S> motion{};   ///< motion, estimated from the encoders
  TorqueFeedbackState<S> feedback{};  ///< on a force sensor
  EmgPredictionState<S> emg{};        ///< prediction of the acceleration from EMG
  DitherState<S> dither{};            ///< against sticking
  EnergyObserverState<S> energy{};    ///< observer of the energy that drives the wearer
};

template <class S, std::size_t N> struct TreeCompensationState {
  JointShareState<S> joint[N]{};            ///< state of each joint
  MomentumObserverState<S, N> observer{};   ///< observer of what else acts on the joints
  S weight[N]{};                            ///< g, now [N m; N]
  S lost[N]{};                              ///< friction at the velocity of now, under the weight [N m; N]
  S end_speed{};                            ///< speed of the end point [m/s]
  S felt[N]{};                              ///< what force sensors say of the wearer's effort on each joint [N m; N]
  bool sensed[N]{};                         ///< whether any force sensor was heard for it
  TreeGateState<S, N> gate{};               ///< the last step
};

namespace detail {
/// Friction of motors that turn with several joints, at joints, while they pass efforts on; shares of each motor's.
template <class S, std::size_t N>
void add_motor_friction(const TreeCompensationCoefficients<S, N>& c, const S* v, const S* effort, bool shares,
                        S* friction_at_joints) noexcept {
  const std::size_t n = c.tree.coordinates;
  S speed[N]{}, passed[N]{}, felt[N]{};
  motor_motion(c.drives, n, v, speed);
  motor_effort(c.drives, n, effort, passed);
  for (std::size_t i = 0; i < n; ++i) {
    const S share = shares ? c.joint[i].params.friction_share : S(1);
    passed[i] = share * friction(c.drives.motor[i].friction, speed[i], passed[i]);
  }
  joint_effort(c.drives, n, passed, felt);
  for (std::size_t k = 0; k < n; ++k) friction_at_joints[k] = friction_at_joints[k] + felt[k];
}

/// The effort of each joint that the law wants, at a motion that is known.
template <class S, std::size_t N>
void compensate(const TreeCompensationCoefficients<S, N>& c, TreeCompensationState<S, N>& s,
                const TreeSamples<S, N>& samples, const S* q, const S* v, S* wanted) noexcept {
  const std::size_t n = c.tree.coordinates;
  TreePose<S, N> pose;
  place(c.tree, q, pose);
  gravity(c.tree, pose, s.weight);
  s.end_speed = c.whole.end_link > 0 ? point_speed(c.tree, pose, c.whole.end_link - 1,
                                                   {c.whole.end_x, c.whole.end_y, c.whole.end_z}, v)
                                     : S(0);
  S a[N]{}, moved[N]{}, felt[N]{}, drive[N]{};
  for (std::size_t k = 0; k < n; ++k) {
    JointShareState<S>& one = s.joint[k];
    const Sample<S>& muscle = samples.muscle[k];
    const S led = step(c.joint[k].emg, one.emg, muscle.value, muscle.valid, q[k], v[k], one.motion.acceleration);
    const S most = c.joint[k].params.acceleration_limit;
    a[k] = clamp(led, -most, most);
    moved[k] = S(0);
  }
  if (c.any_inertia) {
    inverse_dynamics(c.tree, pose, v, a, moved);
    for (std::size_t k = 0; k < n; ++k) moved[k] = moved[k] - s.weight[k];
    if (c.drives.coupled) {
      S turned[N]{}, back[N]{};
      motor_motion(c.drives, n, a, turned);
      for (std::size_t i = 0; i < n; ++i) turned[i] = c.drives.motor[i].inertia * turned[i];
      joint_effort(c.drives, n, turned, back);
      for (std::size_t k = 0; k < n; ++k) moved[k] = moved[k] + back[k];
    }
  }
  const bool on_link = c.whole.sensor_link > 0 && is_heard(samples.wrench);
  if (on_link)
    felt_at_joints(c.tree, pose, c.whole.sensor_link - 1, {c.whole.sensor_x, c.whole.sensor_y, c.whole.sensor_z},
                   samples.wrench.force, samples.wrench.moment, felt);
  for (std::size_t k = 0; k < n; ++k) {
    const JointShareParams<S>& p = c.joint[k].params;
    const TreeJointCoefficients<S>& body = c.drives.joint[k];
    const Resistance<S> now = resistance(body.friction, v[k]);
    s.lost[k] = friction(body.friction, now, s.weight[k]);
    const S load = s.weight[k] + p.inertia_share * moved[k];
    const S lost = p.friction_lead > S(0) ? friction(body.friction, v[k] + p.friction_lead * a[k], load)
                                          : friction(body.friction, now, load);
    const bool at_joint = is_heard(samples.interaction[k]);
    s.felt[k] = (on_link ? felt[k] : S(0)) + (at_joint ? samples.interaction[k].value : S(0));
    s.sensed[k] = on_link || at_joint;
    const S fed_back = step(c.joint[k].feedback, s.joint[k].feedback, s.felt[k], s.sensed[k]);
    drive[k] = p.friction_share * lost + p.inertia_share * moved[k] + fed_back;
    wanted[k] = p.gravity_share * s.weight[k] + body.offset;
  }
  if (c.drives.coupled) {
    S all[N]{};
    for (std::size_t k = 0; k < n; ++k) all[k] = wanted[k] + drive[k];
    add_motor_friction(c, v, all, true, drive);
  }
  for (std::size_t k = 0; k < n; ++k) {
    const JointShareParams<S>& p = c.joint[k].params;
    JointShareState<S>& one = s.joint[k];
    wanted[k] = wanted[k] + step(p.energy_store, one.energy, p.gate.period, drive[k], v[k], s.lost[k]) +
                step(c.joint[k].dither, one.dither);
  }
  if (!(c.whole.observer_bandwidth > S(0))) return;
  S p[N]{}, transported[N]{}, taken[N]{};
  momentum(c.tree, c.drives, pose, v, p, transported);
  for (std::size_t k = 0; k < n; ++k) taken[k] = s.lost[k] + c.drives.joint[k].offset;
  if (c.drives.coupled) add_motor_friction(c, v, s.gate.output, false, taken);
  for (std::size_t k = 0; k < n; ++k) taken[k] = s.gate.output[k] - taken[k];
  step(c.whole.observer_bandwidth, c.gate.joint[0].params.period, n, s.observer, taken, s.weight, p, transported);
}

/// Estimates the motion of all joints, and what the law wants at it; false where any joint's motion is not known.
template <class S, std::size_t N>
bool follow(const TreeCompensationCoefficients<S, N>& c, TreeCompensationState<S, N>& s,
            const TreeSamples<S, N>& samples, S* wanted, S* v) noexcept {
  S q[N]{};
  bool known = c.gate.valid;
  for (std::size_t k = 0; k < c.gate.joints; ++k) {
    wanted[k] = q[k] = v[k] = S(0);
    if (!c.gate.valid) continue;
    MotionEstimatorState<S>& m = s.joint[k].motion;
    step(c.joint[k].estimator, m, samples.position[k].value);
    if (!(m.started && is_finite(m.position + m.velocity + m.acceleration))) {
      m = {};
      known = false;
      continue;
    }
    q[k] = m.position;
    v[k] = m.velocity;
  }
  if (known) compensate(c, s, samples, q, v, wanted);
  else s.observer = {};
  return known;
}

/// Efforts after the gate.
template <class S, std::size_t N>
TreeCommand<S, N> pass_gate(const TreeCompensationCoefficients<S, N>& c, TreeCompensationState<S, N>& s,
                            const TreeSamples<S, N>& samples, const S* wanted, const S* v) noexcept {
  step(c.gate, s.gate, wanted, v, samples.position, s.end_speed);
  TreeCommand<S, N> command;
  for (std::size_t k = 0; k < c.gate.joints; ++k) command.effort[k] = s.gate.output[k];
  motor_effort(c.drives, c.gate.joints, command.effort, command.drive);
  return command;
}
}  // namespace detail

/// One control period: what goes to the drives. A fault of any joint latches the gate, and efforts go to 0 together.
template <class S, std::size_t N>
TreeCommand<S, N> step(const TreeCompensationCoefficients<S, N>& c, TreeCompensationState<S, N>& s,
                       const TreeSamples<S, N>& samples) noexcept {
  S wanted[N]{}, v[N]{};
  detail::follow(c, s, samples, wanted, v);
  return detail::pass_gate(c, s, samples, wanted, v);
}

template <class S, std::size_t N> void reset(TreeCompensationState<S, N>& state) noexcept {
  const TreeGateState<S, N> gate = state.gate;
  state = {};
  state.gate = gate;
  reset(state.gate);
}

template <class S, std::size_t N> struct TreeCompensation {
  using Scalar = S;
  using Params = TreeCompensationParams<S, N>;
  using Coefficients = TreeCompensationCoefficients<S, N>;
  using State = TreeCompensationState<S, N>;
  static constexpr std::size_t most = N;
  static constexpr const char* name = "tree";
  static constexpr const char* type = "TreeCompensation";
  static constexpr const char* title = "compensation of all joints of a robot";
};

}  // namespace PELLUCID_ABI
}  // namespace pellucid
