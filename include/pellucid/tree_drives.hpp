// Drives of a tree: from efforts of motors to those that its bodies feel, with friction on the way.
//
// Motors turn with joints at v_m = T v, T constant: the unit matrix unless a motor moves several joints, as the sixth
// of a wrist turns with the sum of the fifth and sixth. Power is the same on both sides, so efforts go the other way:
//   u = l + friction(T v, l)                 at each motor, l the load that passes on
//   T'l = y + friction(v, y) + offset        at each joint, y = M a + h what the bodies and rotors need.
// Both frictions are friction.hpp's, each with its own load; a motor's is for what motors that move several joints lose
// there. Given the directions the chain has a closed form both ways, without iteration, as one joint has.
#pragma once

#include "friction.hpp"
#include "mass_matrix.hpp"
#include "presliding.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Losses at one joint.
template <class S> struct TreeJointParams {
  S offset{};
  FrictionParams<S> friction{};      ///< friction of the joint and whatever turns with it alone
  PreslidingParams<S> presliding{};  ///< presliding of that friction

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.offset, {"offset", unit::effort, any_number(), "effort that is always there"});
    pellucid::walk(p.friction, visit);
    pellucid::walk(p.presliding, visit);
  }
};

/// A motor that turns with several joints.
template <class S> struct TreeMotorParams {
  S inertia{};
  FrictionParams<S> friction{};  ///< at the motor

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.inertia, {"motor_inertia", unit::inertia, at_least(0), "J_m, in addition to the rotors of joints"});
    pellucid::walk(p.friction, visit);
  }
};

/// As many joints and motors as the tree has coordinates.
template <class S, std::size_t N> struct TreeDrivesParams {
  TreeJointParams<S> joint[N]{};
  bool coupled = false;  ///< whether motors turn with several joints; if not, those below are not read
  S turns[N][N]{};       ///< T: of motor i by joint k
  TreeMotorParams<S> motor[N]{};
};

/// Coefficients computed once from TreeJointParams.
template <class S> struct TreeJointCoefficients {
  S offset{};                            ///< [N m]
  FrictionCoefficients<S> friction{};    ///< at the joint
  PreslidingCoefficients<S> presliding;  ///< presliding of that friction
};
/// Coefficients computed once from TreeMotorParams.
template <class S> struct TreeMotorCoefficients {
  S inertia{};                         ///< J_m [kg m^2]
  FrictionCoefficients<S> friction{};  ///< at the motor
};

/// Coefficients computed once from TreeDrivesParams.
template <class S, std::size_t N> struct TreeDrivesCoefficients {
  TreeJointCoefficients<S> joint[N];  ///< coefficients of each coordinate
  TreeMotorCoefficients<S> motor[N];  ///< coefficients of each motor, where motors are coupled
  bool coupled = false;               ///< whether motors turn with several joints
  bool valid = true;                  ///< whether T can be inverted, in every lane
  S turns[N][N];                      ///< T
  S returns[N][N];                    ///< its inverse
};

namespace detail {
/// The inverse of the first n rows and columns, by Gauss and Jordan with the largest pivot; false where there is none.
template <class S, std::size_t N> bool invert(const S (&matrix)[N][N], std::size_t n, S (&inverse)[N][N]) noexcept {
  S rest[N][N];
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < n; ++k) rest[i][k] = matrix[i][k], inverse[i][k] = S(i == k ? 1 : 0);
  bool regular = true;
  for (std::size_t j = 0; j < n; ++j) {
    // Rows below are added with the sign that makes the pivot large: a choice that lanes can make apart.
    for (std::size_t i = j + 1; i < n; ++i) {
      const mask_t<S> larger = abs(rest[i][j]) > abs(rest[j][j]);
      for (std::size_t k = 0; k < n; ++k) {
        const S up = rest[i][k], down = rest[j][k], up2 = inverse[i][k], down2 = inverse[j][k];
        rest[j][k] = select(larger, up, down), rest[i][k] = select(larger, down, up);
        inverse[j][k] = select(larger, up2, down2), inverse[i][k] = select(larger, down2, up2);
      }
    }
    const mask_t<S> has_pivot = both(abs(rest[j][j]) > S(static_cast<value_t<S>>(1e-6)), is_finite(rest[j][j]));
    regular = regular && all(has_pivot);
    const S scale = S(1) / select(has_pivot, rest[j][j], S(1));
    for (std::size_t k = 0; k < n; ++k) rest[j][k] = rest[j][k] * scale, inverse[j][k] = inverse[j][k] * scale;
    for (std::size_t i = 0; i < n; ++i) {
      if (i == j) continue;
      const S factor = rest[i][j];
      for (std::size_t k = 0; k < n; ++k) {
        rest[i][k] = rest[i][k] - factor * rest[j][k];
        inverse[i][k] = inverse[i][k] - factor * inverse[j][k];
      }
    }
  }
  return regular;
}
}  // namespace detail

/// Drives of the first n joints.
template <class S, std::size_t N>
TreeDrivesCoefficients<S, N> coefficients(const TreeDrivesParams<S, N>& params, std::size_t n) noexcept {
  TreeDrivesCoefficients<S, N> c;
  n = n < N ? n : N;
  for (std::size_t k = 0; k < n; ++k) {
    const TreeJointParams<S>& joint = params.joint[k];
    c.joint[k] = {joint.offset, coefficients(joint.friction), coefficients(joint.presliding)};
  }
  c.coupled = params.coupled;
  if (!c.coupled) return c;
  for (std::size_t k = 0; k < n; ++k) {
    c.motor[k] = {params.motor[k].inertia, coefficients(params.motor[k].friction)};
    for (std::size_t l = 0; l < n; ++l) c.turns[k][l] = params.turns[k][l];
  }
  c.valid = detail::invert(c.turns, n, c.returns);
  return c;
}

/// T v: how fast motors turn.
template <class S, std::size_t N>
void motor_motion(const TreeDrivesCoefficients<S, N>& c, std::size_t n, const S* v, S* of_motors) noexcept {
  for (std::size_t i = 0; i < n; ++i) {
    of_motors[i] = c.coupled ? S(0) : v[i];
    for (std::size_t k = 0; c.coupled && k < n; ++k) of_motors[i] = of_motors[i] + c.turns[i][k] * v[k];
  }
}
/// T'u: what efforts of motors are at joints.
template <class S, std::size_t N>
void joint_effort(const TreeDrivesCoefficients<S, N>& c, std::size_t n, const S* of_motors, S* effort) noexcept {
  for (std::size_t k = 0; k < n; ++k) {
    effort[k] = c.coupled ? S(0) : of_motors[k];
    for (std::size_t i = 0; c.coupled && i < n; ++i) effort[k] = effort[k] + c.turns[i][k] * of_motors[i];
  }
}
/// Efforts of motors that produce given efforts at the joints.
template <class S, std::size_t N>
void motor_effort(const TreeDrivesCoefficients<S, N>& c, std::size_t n, const S* effort, S* of_motors) noexcept {
  for (std::size_t i = 0; i < n; ++i) {
    of_motors[i] = c.coupled ? S(0) : effort[i];
    for (std::size_t k = 0; c.coupled && k < n; ++k) of_motors[i] = of_motors[i] + c.returns[k][i] * effort[k];
  }
}

/// M + T'J_m T.
template <class S, std::size_t N>
void add_motors(const TreeDrivesCoefficients<S, N>& c, std::size_t n, SquareMatrix<S, N>& m) noexcept {
  for (std::size_t i = 0; c.coupled && i < n; ++i)
    for (std::size_t k = 0; k < n; ++k)
      for (std::size_t l = 0; l < n; ++l) m.at[k][l] = m.at[k][l] + c.turns[i][k] * c.motor[i].inertia * c.turns[i][l];
}

/// Load of each joint: the effort that bodies, rotors and motors' inertias need, without friction.
template <class S, std::size_t N> void load(const TreeCoefficients<S, N>& tree, const TreeDrivesCoefficients<S, N>& c,
                                            const S* q, const S* v, const S* a, S* y) noexcept {
  const std::size_t n = tree.coordinates;
  inverse_dynamics(tree, q, v, a, y);
  if (!c.coupled) return;
  S turned[N], felt[N];
  motor_motion(c, n, a, turned);
  for (std::size_t i = 0; i < n; ++i) turned[i] = c.motor[i].inertia * turned[i];
  joint_effort(c, n, turned, felt);
  for (std::size_t k = 0; k < n; ++k) y[k] = y[k] + felt[k];
}

/// Efforts of motors that move the tree so, friction with it [N m; N].
template <class S, std::size_t N> void inverse_dynamics(const TreeCoefficients<S, N>& tree,
                                                        const TreeDrivesCoefficients<S, N>& c, const S* q, const S* v,
                                                        const S* a, S* of_motors) noexcept {
  const std::size_t n = tree.coordinates;
  S y[N];
  load(tree, c, q, v, a, y);
  for (std::size_t k = 0; k < n; ++k) y[k] = y[k] + friction(c.joint[k].friction, v[k], y[k]) + c.joint[k].offset;
  motor_effort(c, n, y, of_motors);
  if (!c.coupled) return;
  S speed[N];
  motor_motion(c, n, v, speed);
  for (std::size_t i = 0; i < n; ++i)
    of_motors[i] = of_motors[i] + friction(c.motor[i].friction, speed[i], of_motors[i]);
}

/// Accelerations that efforts of motors, and `outside` ones on joints, give while nothing sticks: the inverse of that.
template <class S, std::size_t N> void forward_dynamics(const TreeCoefficients<S, N>& tree,
                                                        const TreeDrivesCoefficients<S, N>& c, const S* q, const S* v,
                                                        const S* of_motors, const S* outside, S* a) noexcept {
  const std::size_t n = tree.coordinates;
  S passed[N], y[N];
  for (std::size_t i = 0; i < n; ++i) passed[i] = of_motors[i];
  if (c.coupled) {
    S speed[N];
    motor_motion(c, n, v, speed);
    for (std::size_t i = 0; i < n; ++i) {
      const Resistance<S> at = resistance(c.motor[i].friction, speed[i]);
      passed[i] = transmitted_load(c.motor[i].friction, at, of_motors[i] - at.effort);
    }
  }
  joint_effort(c, n, passed, y);
  for (std::size_t k = 0; k < n; ++k) {
    const Resistance<S> at = resistance(c.joint[k].friction, v[k]);
    y[k] = transmitted_load(c.joint[k].friction, at, y[k] + outside[k] - c.joint[k].offset - at.effort);
  }
  TreePose<S, N> pose;
  place(tree, q, pose);
  S none[N];
  for (S& number : none) number = S(0);
  inverse_dynamics(tree, pose, v, none, a);
  SquareMatrix<S, N> m;
  mass_matrix(tree, pose, m);
  add_motors(c, n, m);
  for (std::size_t k = 0; k < n; ++k) a[k] = y[k] - a[k];
  factorise(m, n);
  solve(m, n, a);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
