// What the efforts of a tree are linear in: Y with effort = Y theta, ten columns a link.
//
// Of link i, a force's and a moment's columns are, with d, w and W as in kinematic_tree.hpp,
//   m: d, 0     m c: W, -[d]     I: 0, L(dw/dt) + [w] L(w),   I a = L(a) (I_xx, I_xy, I_xz, I_yy, I_yz, I_zz)'.
// The row of joint j is their power while joint j alone moves at 1: link i then turns at s, its origin moves at u, and
//   m: u d     m c: W'u + d x s     I: s'L(dw/dt) + (s x w)'L(w).
// Moving the six numbers (s, u) outwards costs less than moving 60 inwards.
#pragma once

#include "kinematic_tree.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// s'L(a): what s'I a is linear in, added to six columns.
template <class S> void add_moments(const Vector3<S>& s, const Vector3<S>& a, S* column) noexcept {
  column[0] = column[0] + s.x * a.x;
  column[1] = column[1] + (s.x * a.y + s.y * a.x);
  column[2] = column[2] + (s.x * a.z + s.z * a.x);
  column[3] = column[3] + s.y * a.y;
  column[4] = column[4] + (s.y * a.z + s.z * a.y);
  column[5] = column[5] + s.z * a.z;
}

/// Calls put(coordinate, link, columns) with the ten numbers of every pair of a joint that moves and a link that it
/// carries, link after link; all other numbers of Y are 0. The rotor's column is its joint's acceleration.
template <class S, std::size_t N, class Put>
void torque_regressor(const TreeCoefficients<S, N>& c, const S* q, const S* v, const S* a, Put put) noexcept {
  TreePose<S, N> pose;
  place(c, q, pose);
  LinkMotion<S> motion[N];
  Matrix3<S> turned[N];
  Vector3<S> turns[N][N], moves[N][N];  // of a link, by each coordinate that carries it
  for (std::size_t i = 0; i < c.links; ++i) {
    move(c, pose, i, v, a, motion, turned);
    const LinkCoefficients<S>& link = c.link[i];
    const Placement<S>& at = pose.in_parent[i];
    const LinkMotion<S>& m = motion[i];
    for (std::size_t j = i;; j = c.link[j].parent) {
      const LinkCoefficients<S>& joint = c.link[j];
      if (joint.joint != JointKind::fixed) {
        const std::size_t k = joint.coordinate;
        Vector3<S>& s = turns[i][k];
        Vector3<S>& u = moves[i][k];
        if (j == i) {
          const bool slides = joint.joint == JointKind::prismatic;
          s = slides ? zero_vector<S>() : link.axis;
          u = slides ? link.axis : zero_vector<S>();
        } else {
          const Vector3<S>& outer_turn = turns[link.parent][k];
          s = transposed_times(at.rotation, outer_turn);
          u = transposed_times(at.rotation, moves[link.parent][k] + cross(outer_turn, at.position));
        }
        const Vector3<S> first = transposed_times(turned[i], u) + cross(m.proper, s);
        S column[body_parameter_count] = {
            dot(u, m.proper), first.x, first.y, first.z, S(0), S(0), S(0), S(0), S(0), S(0)};
        add_moments(s, m.acceleration, column + 4);
        add_moments(cross(s, m.velocity), m.velocity, column + 4);
        put(k, i, column);
      }
      if (joint.on_base) break;
    }
  }
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
