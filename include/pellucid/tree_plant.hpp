// A tree under efforts of its motors, with true stiction: what happens in one control period.
//
// Efforts are held; the tree moves in substeps of semi-implicit Euler, v <- v + h a(q, v), q <- q + h v. Whether a
// joint slips in a substep, and which way, is judged by the velocity after it, of all joints together (Moreau's time
// stepping): friction has its full level against it, and less only where that stops the joint, to the bit. So several
// joints stick at once, one begins to slip because another stopped, and a joint that turns back rests in between if it
// can. Load friction is in it exactly: a joint's effort under friction of either direction follows from what arrives
// there, and anything between the two holds it.
#pragma once

#include "rest.hpp"
#include "series_elastic.hpp"
#include "tree_drives.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S, std::size_t N> struct TreePlantParams {
  TreeParams<S, N> tree{};              ///< bodies
  TreeDrivesParams<S, N> drives{};      ///< drives and friction of the joints
  SeriesElasticParams<S> elastic[N]{};  ///< between each motor's effort and the drives
  S period{};                           ///< period of control [s]
  std::uint32_t substeps = 4;           ///< integration steps per control period, >= 1
};

/// Coefficients computed once from TreePlantParams.
template <class S, std::size_t N> struct TreePlantCoefficients {
  TreeCoefficients<S, N> tree;              ///< bodies
  TreeDrivesCoefficients<S, N> drives;      ///< drives and friction of the joints
  SeriesElasticCoefficients<S> elastic[N];  ///< between each motor's effort and the drives
  bool any_elastic = false;                 ///< whether any motor is behind a spring
  S substep{};                              ///< h [s]
  std::uint32_t substeps = 4;               ///< per control period
  bool valid = false;                       ///< whether tree and drives are
};

template <class S, std::size_t N>
TreePlantCoefficients<S, N> coefficients(const TreePlantParams<S, N>& params) noexcept {
  TreePlantCoefficients<S, N> c;
  c.tree = coefficients(params.tree);
  c.drives = coefficients(params.drives, c.tree.coordinates);
  for (std::size_t i = 0; i < c.tree.coordinates; ++i) {
    c.elastic[i] = coefficients(params.elastic[i]);
    c.any_elastic = c.any_elastic || c.elastic[i].any_gives;
  }
  c.substeps = params.substeps > 0 ? params.substeps : 1;
  c.substep = params.period / S(static_cast<value_t<S>>(c.substeps));
  c.valid = c.tree.valid && c.drives.valid;
  return c;
}

template <class S, std::size_t N> struct TreePlantState {
  S position[N]{};                   ///< q [rad; m]
  S velocity[N]{};                   ///< v [rad/s; m/s]
  S held[2 * N]{};                   ///< friction of joints, then of motors, in the last substep [N m; N]
  PreslidingState<S> strain[N]{};    ///< strain of joints that give before they slip
  SeriesElasticState<S> motor[N]{};  ///< motors behind springs
};

/// Joints at q that move at v, and motors whose springs carry what weighs on them.
template <class S, std::size_t N>
TreePlantState<S, N> balanced(const TreePlantCoefficients<S, N>& c, const S* q, const S* v) noexcept {
  const std::size_t n = c.tree.coordinates;
  TreePlantState<S, N> state;
  for (std::size_t k = 0; k < n; ++k) state.position[k] = q[k], state.velocity[k] = v[k];
  if (!c.any_elastic) return state;
  S weight[N], carried[N], place[N], speed[N];
  gravity(c.tree, q, weight);
  motor_effort(c.drives, n, weight, carried);
  motor_motion(c.drives, n, q, place);
  motor_motion(c.drives, n, v, speed);
  for (std::size_t i = 0; i < n; ++i) state.motor[i] = balanced(c.elastic[i], place[i], speed[i], carried[i]);
  return state;
}

/// Inputs of a tree in each period.
template <class S, std::size_t N> struct TreePlantInput {
  S effort[N]{};   ///< effort of each motor [N m; N]
  S outside[N]{};  ///< on each joint: people, payloads [N m; N]
};

namespace detail {
/// Return the friction, with its sign, of a drive that receives the effort `arriving` at velocity v while it slips in a
/// direction of 1 or -1: the effort passed on less the effort received.
template <class S>
S slipping_friction(const FrictionCoefficients<S>& c, const S& v, const S& direction, const S& arriving) noexcept {
  const Resistance<S> at = bent_resistance(c, v, direction);
  return transmitted_load(c, at, arriving - at.effort) - arriving;
}
}  // namespace detail

/// One substep under efforts of motors.
template <class S, std::size_t N> void substep(const TreePlantCoefficients<S, N>& c, TreePlantState<S, N>& state,
                                               const TreePlantInput<S, N>& input) noexcept {
  static_assert(ScalarTraits<S>::is_real, "stiction resets the velocity, which would drop its derivative");
  const TreeDrivesCoefficients<S, N>& drives = c.drives;
  const std::size_t n = c.tree.coordinates, forces = drives.coupled ? 2 * n : n;
  if (n == 0) return;
  const S* v = state.velocity;
  TreePose<S, N> pose;
  place(c.tree, state.position, pose);
  S none[N], need[N], given[N], speed[N], bent[N];
  for (S& number : none) number = S(0);
  inverse_dynamics(c.tree, pose, v, none, need);
  SquareMatrix<S, N> m;
  mass_matrix(c.tree, pose, m);
  add_motors(drives, n, m);
  factorise(m, n);
  joint_effort(drives, n, input.effort, given);
  motor_motion(drives, n, v, speed);
  for (std::size_t k = 0; k < n; ++k) {
    given[k] = given[k] + (input.outside[k] - drives.joint[k].offset);
    if (drives.joint[k].presliding.any_gives) bent[k] = direction(state.strain[k]);
  }

  // Velocities after the substep without friction, and what each force adds to them.
  S next[N], per_force[2 * N][N], unresisted[2 * N], force[2 * N];
  for (std::size_t k = 0; k < n; ++k) next[k] = given[k] - need[k];
  solve(m, n, next);
  for (std::size_t k = 0; k < n; ++k) next[k] = v[k] + c.substep * next[k];
  const auto at_force = [&](std::size_t i, const S* of_joints) {
    if (i < n) return of_joints[i];
    S sum = S(0);
    for (std::size_t k = 0; k < n; ++k) sum = sum + drives.turns[i - n][k] * of_joints[k];
    return sum;
  };
  SquareMatrix<S, 2 * N> a;
  for (std::size_t i = 0; i < forces; ++i) {
    for (std::size_t k = 0; k < n; ++k) per_force[i][k] = i < n ? S(i == k ? 1 : 0) : drives.turns[i - n][k];
    solve(m, n, per_force[i]);
    for (std::size_t k = 0; k < n; ++k) per_force[i][k] = c.substep * per_force[i][k];
    unresisted[i] = at_force(i, next);
    force[i] = state.held[i];
  }
  for (std::size_t i = 0; i < forces; ++i)
    for (std::size_t k = 0; k < forces; ++k) a.at[i][k] = at_force(i, per_force[k]);

  const auto box = [&](std::size_t i, const S* p, S& low, S& high) {
    S arriving = i < n ? given[i] : input.effort[i - n];
    for (std::size_t k = n; i < n && k < forces; ++k) arriving = arriving + drives.turns[k - n][i] * p[k];
    const FrictionCoefficients<S>& friction = i < n ? drives.joint[i].friction : drives.motor[i - n].friction;
    const S& velocity = i < n ? v[i] : speed[i - n];
    low = detail::slipping_friction(friction, velocity, S(1), arriving);
    high = detail::slipping_friction(friction, velocity, S(-1), arriving);
    if (i < n && drives.joint[i].presliding.any_gives) {
      const S given_way = detail::slipping_friction(friction, velocity, bent[i], arriving);
      low = select(drives.joint[i].presliding.gives, given_way, low);
      high = select(drives.joint[i].presliding.gives, given_way, high);
    }
  };
  mask_t<S> rests[2 * N];
  find_rest(a, forces, unresisted, box, force, rests);

  for (std::size_t k = 0; k < n; ++k) {
    for (std::size_t i = 0; i < forces; ++i) next[k] = next[k] + per_force[i][k] * force[i];
    state.velocity[k] = select(rests[k], S(0), next[k]);
    const S moved = c.substep * state.velocity[k];
    state.position[k] = state.position[k] + moved;
    if (drives.joint[k].presliding.any_gives) step(drives.joint[k].presliding, state.strain[k], moved);
  }
  for (std::size_t i = 0; i < forces; ++i) state.held[i] = force[i];
}

/// One control period. Total: whatever comes in, NaN included, it ends.
template <class S, std::size_t N> void step(const TreePlantCoefficients<S, N>& c, TreePlantState<S, N>& state,
                                            const TreePlantInput<S, N>& input) noexcept {
  const std::size_t n = c.tree.coordinates;
  for (std::uint32_t i = 0; i < c.substeps; ++i) {
    if (!c.any_elastic) {
      substep(c, state, input);
      continue;
    }
    TreePlantInput<S, N> passed = input;
    S place[N], speed[N];
    motor_motion(c.drives, n, state.position, place);
    motor_motion(c.drives, n, state.velocity, speed);
    for (std::size_t k = 0; k < n; ++k)
      passed.effort[k] = step(c.elastic[k], state.motor[k], c.substep, input.effort[k], place[k], speed[k]);
    substep(c, state, passed);
  }
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
