// A robot of many joints and the limb that wears it: two trees, held together by cuffs.
//
//   robot:  M a + h = drives' torque - friction + sum J' f_cuff,      motors behind their springs, as in tree_plant.hpp
//   limb:   M a + h = muscles' torque - sum J' f_cuff
// Both move in the same substeps of semi-implicit Euler, which must resolve cuffs and springs: h sqrt(K / m) below
// about 1. A drive's torque follows its command with a lag, and has the ripple of drive.hpp at the motor. Without a
// limb it is the robot alone.
#pragma once

#include "cuff.hpp"
#include "drive.hpp"
#include "posture_servo.hpp"
#include "tree_plant.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Cuffs at most.
constexpr std::size_t most_cuffs = 4;

template <class S, std::size_t N> struct WornTreePlantParams {
  TreePlantParams<S, N> robot{};     ///< its period and substeps are both trees'
  DriveParams<S> drive[N]{};         ///< drive of each motor: gain and ripple
  S lag{};                           ///< time constant of a drive's torque [s]; 0: none
  TreePlantParams<S, N> limb{};      ///< no links: nobody wears it
  PostureServoParams<S> servo[N]{};  ///< posture of each joint of the limb
  std::uint32_t reflex_delay = 0;    ///< [periods]
  std::uint32_t cuffs = 0;           ///< how many
  CuffParams<S> cuff[most_cuffs]{};
};

/// Coefficients computed once from WornTreePlantParams.
template <class S, std::size_t N> struct WornTreePlantCoefficients {
  TreePlantCoefficients<S, N> robot;       ///< robot over one substep
  TreePlantCoefficients<S, N> limb;        ///< limb over one substep
  DriveCoefficients<S> drive[N];           ///< drive of each motor
  PostureServoParams<S> servo[N];          ///< posture of each joint of the limb
  CuffCoefficients<S> cuff[most_cuffs];    ///< in order
  S follows{};                             ///< share of the way to its command that a drive's torque goes in a substep
  S substep{};                             ///< h [s]
  std::size_t cuffs = 0;                   ///< how many
  std::uint32_t substeps = 1;              ///< per control period
  std::uint32_t reflex_delay = 0;          ///< [periods]
  bool worn = false;                       ///< whether there is a limb
  bool valid = false;                      ///< whether both trees are, and cuffs are on them
};

template <class S, std::size_t N>
WornTreePlantCoefficients<S, N> coefficients(const WornTreePlantParams<S, N>& params) noexcept {
  WornTreePlantCoefficients<S, N> c;
  c.substeps = params.robot.substeps > 0 ? params.robot.substeps : 1;
  c.substep = params.robot.period / S(static_cast<value_t<S>>(c.substeps));
  TreePlantParams<S, N> one = params.robot;
  one.period = c.substep, one.substeps = 1;
  c.robot = coefficients(one);
  c.worn = params.limb.tree.links > 0;
  c.valid = c.robot.valid;
  if (c.worn) {
    one = params.limb;
    one.period = c.substep, one.substeps = 1;
    c.limb = coefficients(one);
    c.valid = c.valid && c.limb.valid && params.cuffs <= most_cuffs;
    c.cuffs = params.cuffs < most_cuffs ? params.cuffs : most_cuffs;
  }
  for (std::size_t i = 0; i < c.cuffs; ++i) {
    c.cuff[i] = coefficients(params.cuff[i]);
    c.valid = c.valid && c.cuff[i].robot_link < c.robot.tree.links && c.cuff[i].limb_link < c.limb.tree.links;
  }
  for (std::size_t k = 0; k < N; ++k) c.drive[k] = coefficients(params.drive[k]), c.servo[k] = params.servo[k];
  c.follows = c.substep / (max(params.lag, S(0)) + c.substep);
  c.reflex_delay = params.reflex_delay;
  return c;
}

template <class S, std::size_t N> struct WornTreePlantState {
  TreePlantState<S, N> robot{};
  TreePlantState<S, N> limb{};
  S torque[N]{};                      ///< torque of each drive, without ripple [N m]
  PostureServoState<S> reflexes[N]{};  ///< reflexes of each joint of the limb
  std::uint32_t periods = 0;          ///< so far
};

/// Both at rest, motors carrying the robot's weight and drives giving it.
template <class S, std::size_t N> void balance(const WornTreePlantCoefficients<S, N>& c, const S* robot, const S* limb,
                                               WornTreePlantState<S, N>& state) noexcept {
  state = WornTreePlantState<S, N>{};
  S none[N], weight[N];
  for (S& number : none) number = S(0);
  state.robot = balanced(c.robot, robot, none);
  gravity(c.robot.tree, robot, weight);
  motor_effort(c.robot.drives, c.robot.tree.coordinates, weight, state.torque);
  if (c.worn) state.limb = balanced(c.limb, limb, none);
}

/// Inputs of both in each period.
template <class S, std::size_t N> struct WornTreePlantInput {
  S effort[N]{};           ///< asked of each drive [N m; N]
  S wanted[N]{};           ///< where each joint of the limb is meant to be [rad]
  S wanted_velocity[N]{};  ///< [rad/s]
  S learnt[N]{};           ///< torque that the person has learnt to give [N m]
};

/// Torques and forces of cuffs.
template <class S, std::size_t N> struct CuffAction {
  S robot[N];                   ///< effort on each coordinate of the robot [N m; N]
  S limb[N];                    ///< on each of the limb
  CuffPull<S> pull[most_cuffs];  ///< on the robot
};

template <class S, std::size_t N>
void act(const WornTreePlantCoefficients<S, N>& c, const WornTreePlantState<S, N>& state,
         CuffAction<S, N>& action) noexcept {
  for (std::size_t k = 0; k < c.robot.tree.coordinates; ++k) action.robot[k] = S(0);
  for (std::size_t k = 0; c.worn && k < c.limb.tree.coordinates; ++k) action.limb[k] = S(0);
  if (c.cuffs == 0) return;
  Placement<S> robot[N], limb[N];
  forward_kinematics(c.robot.tree, state.robot.position, robot);
  forward_kinematics(c.limb.tree, state.limb.position, limb);
  for (std::size_t i = 0; i < c.cuffs; ++i)
    action.pull[i] = pull(c.cuff[i], c.robot.tree, robot, state.robot.velocity, action.robot, c.limb.tree, limb,
                          state.limb.velocity, action.limb);
}

/// Energy of both trees and of what cuffs store, without the springs of the transmission [J].
template <class S, std::size_t N>
S worn_energy(const WornTreePlantCoefficients<S, N>& c, const WornTreePlantState<S, N>& state) noexcept {
  TreeEnergy<S> of = energy(c.robot.tree, state.robot.position, state.robot.velocity);
  S sum = of.kinetic + of.potential;
  if (!c.worn) return sum;
  of = energy(c.limb.tree, state.limb.position, state.limb.velocity);
  sum = sum + of.kinetic + of.potential;
  Placement<S> robot[N], limb[N];
  forward_kinematics(c.robot.tree, state.robot.position, robot);
  forward_kinematics(c.limb.tree, state.limb.position, limb);
  for (std::size_t i = 0; i < c.cuffs; ++i)
    sum = sum + cuff_energy(c.cuff[i], robot[c.cuff[i].robot_link], limb[c.cuff[i].limb_link]);
  return sum;
}

/// One control period. Total: whatever comes in, NaN included, it ends.
template <class S, std::size_t N> void step(const WornTreePlantCoefficients<S, N>& c, WornTreePlantState<S, N>& state,
                                            const WornTreePlantInput<S, N>& input) noexcept {
  const std::size_t n = c.robot.tree.coordinates, m = c.worn ? c.limb.tree.coordinates : 0;
  S steady[N];  // learnt and late
  for (std::size_t k = 0; k < m; ++k) {
    const S error = input.wanted[k] - state.limb.position[k];
    const S rate = input.wanted_velocity[k] - state.limb.velocity[k];
    // A person begins where it is meant to be: nothing late before the first period.
    if (state.periods == 0)
      for (std::uint32_t i = 0; i < reflex_periods; ++i)
        state.reflexes[k].error[i] = error, state.reflexes[k].rate[i] = rate;
    steady[k] = input.learnt[k] + reflex(c.servo[k], state.reflexes[k], state.periods, c.reflex_delay, error, rate);
  }
  ++state.periods;
  TreePlantInput<S, N> robot, limb;
  CuffAction<S, N> action;
  for (std::uint32_t i = 0; i < c.substeps; ++i) {
    act(c, state, action);
    S place[N];
    motor_motion(c.robot.drives, n, state.robot.position, place);
    for (std::size_t k = 0; k < n; ++k) {
      const S asked = c.drive[k].params.gain * input.effort[k];
      const S way = c.follows * (asked - state.torque[k]);
      state.torque[k] = select(c.follows < S(1), state.torque[k] + way, asked);
      const S at = c.robot.elastic[k].any_gives ? state.robot.motor[k].position : place[k];
      robot.effort[k] = state.torque[k] + ripple(c.drive[k], at);
      robot.outside[k] = action.robot[k];
    }
    step(c.robot, state.robot, robot);
    if (!c.worn) continue;
    const S passed = c.substep * S(static_cast<value_t<S>>(i));
    for (std::size_t k = 0; k < m; ++k) {
      const S error = input.wanted[k] + passed * input.wanted_velocity[k] - state.limb.position[k];
      const S rate = input.wanted_velocity[k] - state.limb.velocity[k];
      limb.effort[k] = muscle_torque(c.servo[k], steady[k], error, rate);
      limb.outside[k] = action.limb[k];
    }
    step(c.limb, state.limb, limb);
  }
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
