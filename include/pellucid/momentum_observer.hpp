// What people and obstacles do to every joint of a tree, from its encoders and its own efforts alone.
//
//   r = w (p - integral of (u - friction + C'v - g + r)),   p = M v
//
// follows the outside effort of each joint with a lag of 1 / w and needs no acceleration and no inverse of M (A. De Luca
// and R. Mattone, ICRA 2005). Neither M nor C is formed: C'v is the derivative of the kinetic energy by q, which a joint
// shows as its subtree's momentum against the velocity that arrives there, turned. At rest friction may be anything up
// to its level, and so may r.
#pragma once

#include "tree_drives.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// p = M v and C'v of the bodies and their rotors, in one way out and one way back.
template <class S, std::size_t N> void momentum(const TreeCoefficients<S, N>& c, const TreePose<S, N>& pose, const S* v,
                                                S* p, S* transported) noexcept {
  Vector3<S> turns[N], moves[N], arriving_turns[N], arriving_moves[N];
  LinkForce<S> carried[N];  // momentum, and its moment about the link's origin
  for (std::size_t i = 0; i < c.links; ++i) {
    const LinkCoefficients<S>& link = c.link[i];
    const Placement<S>& at = pose.in_parent[i];
    const RigidBody<S>& body = link.body;
    if (link.on_base) {
      turns[i] = moves[i] = zero_vector<S>();
    } else {
      turns[i] = transposed_times(at.rotation, turns[link.parent]);
      moves[i] = transposed_times(at.rotation, moves[link.parent] + cross(turns[link.parent], at.position));
    }
    arriving_turns[i] = turns[i];
    arriving_moves[i] = moves[i];
    if (link.joint == JointKind::revolute) turns[i] = turns[i] + link.axis * v[link.coordinate];
    if (link.joint == JointKind::prismatic) moves[i] = moves[i] + link.axis * v[link.coordinate];
    carried[i] = {moves[i] * body.mass + cross(turns[i], body.moment),
                  body.inertia * turns[i] + cross(body.moment, moves[i])};
  }
  for (std::size_t i = c.links; i-- > 0;) {
    const LinkCoefficients<S>& link = c.link[i];
    const LinkForce<S>& h = carried[i];
    if (link.joint != JointKind::fixed) {
      p[link.coordinate] = along(link, h) + link.rotor_inertia * v[link.coordinate];
      const S pushed = dot(h.force, cross(link.joint == JointKind::revolute ? arriving_moves[i] : arriving_turns[i],
                                          link.axis));
      const S turned = link.joint == JointKind::revolute ? dot(h.moment, cross(arriving_turns[i], link.axis)) : S(0);
      transported[link.coordinate] = pushed + turned;
    }
    if (link.on_base) continue;
    const LinkForce<S> passed = pose.in_parent[i] * h;
    LinkForce<S>& parent = carried[link.parent];
    parent = {parent.force + passed.force, parent.moment + passed.moment};
  }
}

/// The same with motors that turn with several joints: p grows by T'J T v, and nothing else, because T is constant.
template <class S, std::size_t N>
void momentum(const TreeCoefficients<S, N>& c, const TreeDrivesCoefficients<S, N>& drives, const TreePose<S, N>& pose,
              const S* v, S* p, S* transported) noexcept {
  momentum(c, pose, v, p, transported);
  if (!drives.coupled) return;
  S turned[N], felt[N];
  motor_motion(drives, c.coordinates, v, turned);
  for (std::size_t i = 0; i < c.coordinates; ++i) turned[i] = drives.motor[i].inertia * turned[i];
  joint_effort(drives, c.coordinates, turned, felt);
  for (std::size_t k = 0; k < c.coordinates; ++k) p[k] = p[k] + felt[k];
}

template <class S, std::size_t N> struct MomentumObserverState {
  S explained[N]{};      ///< momentum that model, effort and r account for [N m s; N s]
  S residual[N]{};       ///< r [N m; N]
  bool started = false;  ///< false until the first period
};

/// One period: `net` is what efforts leave after friction and offsets, `weight` is g, p and C'v are momentum's [N m;
/// N].
template <class S, std::size_t N>
void step(const S& bandwidth, const S& period, std::size_t n, MomentumObserverState<S, N>& s, const S* net,
          const S* weight, const S* p, const S* transported) noexcept {
  bool whole = true;
  for (std::size_t k = 0; k < n; ++k) {
    if (!s.started) {
      s.explained[k] = p[k];
      s.residual[k] = S(0);
    } else {
      s.explained[k] = s.explained[k] + period * (net[k] + transported[k] - weight[k] + s.residual[k]);
      s.residual[k] = bandwidth * (p[k] - s.explained[k]);
    }
    whole = whole && is_finite(s.explained[k] + s.residual[k]);
  }
  s.started = true;
  if (!whole) s = {};
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
