// A cuff: what holds a link of a limb to a link of a robot where both would touch, a spring and a damper in space.
//
// Cuffs give, and the axes that they hold together never meet: with d the way from the robot's point to the limb's and
// R the turn of the limb's link against the robot's, all in the robot's link,
//   f = K d + D dd/dt  at the limb's point,   n = k (R - R')^ / 2 + b (w_limb - w_robot)
// on the robot, and the opposite on the limb at the same point. Its energy d'K d / 2 + k (3 - tr R) / 2 has no corner,
// n is bounded, and no angle is taken apart.
#pragma once

#include "kinematic_tree.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct CuffParams {
  std::uint32_t robot_link = 1;  ///< index from 1
  std::uint32_t limb_link = 1;   ///< index from 1
  S robot_x{}, robot_y{}, robot_z{}, limb_x{}, limb_y{}, limb_z{}, stiffness_x{}, stiffness_y{}, stiffness_z{},
      damping_x{}, damping_y{}, damping_z{}, turning_stiffness{}, turning_damping{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    constexpr Unit stiffness{0, 0, 0, "N/m"}, damping{0, 0, 0, "N*s/m"};
    constexpr Unit turning{0, 0, 0, "N*m/rad"}, turning_loss{0, 0, 0, "N*m*s/rad"};
    visit(p.robot_link, {"robot_link", unit::one, at_least(1), "link of the robot, from 1"});
    visit(p.limb_link, {"limb_link", unit::one, at_least(1), "link of the limb, from 1"});
    visit(p.robot_x, {"robot_x", unit::length, any_number(), "position of the cuff in the robot's link"});
    visit(p.robot_y, {"robot_y", unit::length, any_number(), "position of the cuff in the robot's link"});
    visit(p.robot_z, {"robot_z", unit::length, any_number(), "position of the cuff in the robot's link"});
    visit(p.limb_x, {"limb_x", unit::length, any_number(), "position of the skin in the cuff, in the limb's link"});
    visit(p.limb_y, {"limb_y", unit::length, any_number(), "position of the skin in the cuff, in the limb's link"});
    visit(p.limb_z, {"limb_z", unit::length, any_number(), "position of the skin in the cuff, in the limb's link"});
    visit(p.stiffness_x, {"stiffness_x", stiffness, at_least(0), "K_x, along the robot's link's x"});
    visit(p.stiffness_y, {"stiffness_y", stiffness, at_least(0), "K_y"});
    visit(p.stiffness_z, {"stiffness_z", stiffness, at_least(0), "K_z"});
    visit(p.damping_x, {"damping_x", damping, at_least(0), "D_x"});
    visit(p.damping_y, {"damping_y", damping, at_least(0), "D_y"});
    visit(p.damping_z, {"damping_z", damping, at_least(0), "D_z"});
    visit(p.turning_stiffness, {"turning_stiffness", turning, at_least(0), "k, against turning about any axis"});
    visit(p.turning_damping, {"turning_damping", turning_loss, at_least(0), "b"});
  }
};

/// Coefficients computed once from CuffParams.
template <class S> struct CuffCoefficients {
  std::size_t robot_link = 0;   ///< index from 0
  std::size_t limb_link = 0;    ///< index from 0
  Vector3<S> on_robot{};        ///< the cuff in the robot's link [m]
  Vector3<S> on_limb{};         ///< the skin in the limb's link [m]
  Vector3<S> stiffness{};       ///< diagonal of K [N/m]
  Vector3<S> damping{};         ///< diagonal of D [N s/m]
  S turning_stiffness{};        ///< k [N m/rad]
  S turning_damping{};          ///< b [N m s/rad]
};

template <class S> CuffCoefficients<S> coefficients(const CuffParams<S>& p) noexcept {
  return {p.robot_link > 0 ? p.robot_link - 1U : 0U,
          p.limb_link > 0 ? p.limb_link - 1U : 0U,
          {p.robot_x, p.robot_y, p.robot_z},
          {p.limb_x, p.limb_y, p.limb_z},
          {p.stiffness_x, p.stiffness_y, p.stiffness_z},
          {p.damping_x, p.damping_y, p.damping_z},
          p.turning_stiffness,
          p.turning_damping};
}

/// Motion of a link at a point, in the base's axes.
template <class S> struct PointMotion {
  Vector3<S> linear;   ///< velocity of the point [m/s]
  Vector3<S> angular;  ///< angular velocity of the link [rad/s]
};
/// `in_base` places every link; `at` is in the base's frame.
template <class S, std::size_t N>
PointMotion<S> point_motion(const TreeCoefficients<S, N>& c, const Placement<S>* in_base, const S* v, std::size_t link,
                            const Vector3<S>& at) noexcept {
  PointMotion<S> sum{zero_vector<S>(), zero_vector<S>()};
  if (link >= c.links) return sum;
  for (std::size_t i = link;; i = c.link[i].parent) {
    const LinkCoefficients<S>& joint = c.link[i];
    if (joint.joint != JointKind::fixed) {
      const Vector3<S> axis = in_base[i].rotation * joint.axis * v[joint.coordinate];
      if (joint.joint == JointKind::prismatic) {
        sum.linear = sum.linear + axis;
      } else {
        sum.angular = sum.angular + axis;
        sum.linear = sum.linear + cross(axis, at - in_base[i].position);
      }
    }
    if (joint.on_base) return sum;
  }
}
/// Adds to each coordinate's effort what a force at a point of a link, and a moment, all in the base's axes, are there.
template <class S, std::size_t N>
void add_force(const TreeCoefficients<S, N>& c, const Placement<S>* in_base, std::size_t link, const Vector3<S>& at,
               const Vector3<S>& force, const Vector3<S>& moment, S* effort) noexcept {
  if (link >= c.links) return;
  for (std::size_t i = link;; i = c.link[i].parent) {
    const LinkCoefficients<S>& joint = c.link[i];
    if (joint.joint != JointKind::fixed) {
      const Vector3<S> axis = in_base[i].rotation * joint.axis;
      const bool slides = joint.joint == JointKind::prismatic;
      const Vector3<S> about = moment + cross(at - in_base[i].position, force);
      effort[joint.coordinate] = effort[joint.coordinate] + dot(axis, slides ? force : about);
    }
    if (joint.on_base) return;
  }
}

/// Force and moment of a cuff on the robot, in the axes of the robot's link; the limb receives the opposite.
template <class S> struct CuffPull {
  Vector3<S> force;   ///< at the limb's point [N]
  Vector3<S> moment;  ///< [N m]
};

/// Adds what a cuff does to the efforts of both trees, and gives it.
template <class S, std::size_t N>
CuffPull<S> pull(const CuffCoefficients<S>& c, const TreeCoefficients<S, N>& robot, const Placement<S>* robot_at,
                 const S* robot_velocity, S* robot_effort, const TreeCoefficients<S, N>& limb,
                 const Placement<S>* limb_at, const S* limb_velocity, S* limb_effort) noexcept {
  if (c.robot_link >= robot.links || c.limb_link >= limb.links) return {zero_vector<S>(), zero_vector<S>()};
  const Placement<S>& frame = robot_at[c.robot_link];
  const Placement<S>& skin = limb_at[c.limb_link];
  const Vector3<S> at = skin.rotation * c.on_limb + skin.position;
  const Vector3<S> way = transposed_times(frame.rotation, at - frame.position) - c.on_robot;
  const PointMotion<S> of_robot = point_motion(robot, robot_at, robot_velocity, c.robot_link, at);
  const PointMotion<S> of_limb = point_motion(limb, limb_at, limb_velocity, c.limb_link, at);
  const Vector3<S> speed = transposed_times(frame.rotation, of_limb.linear - of_robot.linear);
  const Vector3<S> turning = transposed_times(frame.rotation, of_limb.angular - of_robot.angular);
  const Matrix3<S>& a = frame.rotation;
  const Matrix3<S>& b = skin.rotation;
  const auto element = [](const S& a1, const S& a2, const S& a3, const S& b1, const S& b2, const S& b3) {
    return a1 * b1 + a2 * b2 + a3 * b3;
  };
  // R = A'B: what of it is skew.
  const S zy = element(a.xz, a.yz, a.zz, b.xy, b.yy, b.zy), yz = element(a.xy, a.yy, a.zy, b.xz, b.yz, b.zz);
  const S xz = element(a.xx, a.yx, a.zx, b.xz, b.yz, b.zz), zx = element(a.xz, a.yz, a.zz, b.xx, b.yx, b.zx);
  const S yx = element(a.xy, a.yy, a.zy, b.xx, b.yx, b.zx), xy = element(a.xx, a.yx, a.zx, b.xy, b.yy, b.zy);
  const Vector3<S> turned = Vector3<S>{zy - yz, xz - zx, yx - xy} * S(0.5);
  const CuffPull<S> made{{c.stiffness.x * way.x + c.damping.x * speed.x, c.stiffness.y * way.y + c.damping.y * speed.y,
                          c.stiffness.z * way.z + c.damping.z * speed.z},
                         turned * c.turning_stiffness + turning * c.turning_damping};
  const Vector3<S> force = frame.rotation * made.force, moment = frame.rotation * made.moment;
  add_force(robot, robot_at, c.robot_link, at, force, moment, robot_effort);
  add_force(limb, limb_at, c.limb_link, at, -force, -moment, limb_effort);
  return made;
}

/// Elastic energy of a cuff [J].
template <class S>
S cuff_energy(const CuffCoefficients<S>& c, const Placement<S>& robot, const Placement<S>& limb) noexcept {
  const Vector3<S> at = limb.rotation * c.on_limb + limb.position;
  const Vector3<S> d = transposed_times(robot.rotation, at - robot.position) - c.on_robot;
  const Matrix3<S>& a = robot.rotation;
  const Matrix3<S>& b = limb.rotation;
  const S trace = a.xx * b.xx + a.yx * b.yx + a.zx * b.zx + a.xy * b.xy + a.yy * b.yy + a.zy * b.zy + a.xz * b.xz +
                  a.yz * b.yz + a.zz * b.zz;
  return S(0.5) * (c.stiffness.x * d.x * d.x + c.stiffness.y * d.y * d.y + c.stiffness.z * d.z * d.z +
                   c.turning_stiffness * (S(3) - trace));
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
