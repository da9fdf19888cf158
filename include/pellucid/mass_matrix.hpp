// The mass matrix of a tree by composite bodies, and accelerations from it.
//
// Column k is what joint k alone feels and passes on when it accelerates by 1 all that it carries, which is then one
// body (Walker and Orin, J. Dyn. Syst. Meas. Control 104(3), 1982). Accelerations come from its factors,
// with the rows of joints that are held taken out; n of a wearable arm is small.
#pragma once

#include "kinematic_tree.hpp"
#include "symmetric_solve.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// M(q), rotors included [kg m^2; kg m; kg].
template <class S, std::size_t N>
void mass_matrix(const TreeCoefficients<S, N>& c, const TreePose<S, N>& pose, SquareMatrix<S, N>& m) noexcept {
  RigidBody<S> carried[N];
  for (std::size_t i = 0; i < c.links; ++i) carried[i] = c.link[i].body;
  for (std::size_t i = c.links; i-- > 0;)
    if (!c.link[i].on_base) carried[c.link[i].parent] = carried[c.link[i].parent] + pose.in_parent[i] * carried[i];
  for (std::size_t k = 0; k < c.coordinates; ++k)
    for (std::size_t l = 0; l < c.coordinates; ++l) m.at[k][l] = S(0);
  for (std::size_t k = 0; k < c.coordinates; ++k) {
    std::size_t i = c.link_of[k];
    const RigidBody<S>& body = carried[i];
    const Vector3<S>& axis = c.link[i].axis;
    LinkForce<S> force = c.link[i].joint == JointKind::revolute
                             ? LinkForce<S>{cross(axis, body.moment), body.inertia * axis}
                             : LinkForce<S>{axis * body.mass, cross(body.moment, axis)};
    m.at[k][k] = along(c.link[i], force) + c.link[i].rotor_inertia;
    while (!c.link[i].on_base) {
      force = pose.in_parent[i] * force;
      i = c.link[i].parent;
      if (c.link[i].joint == JointKind::fixed) continue;
      const std::size_t l = c.link[i].coordinate;
      m.at[k][l] = m.at[l][k] = along(c.link[i], force);
    }
  }
}
template <class S, std::size_t N>
void mass_matrix(const TreeCoefficients<S, N>& c, const S* q, SquareMatrix<S, N>& m) noexcept {
  TreePose<S, N> pose;
  place(c, q, pose);
  mass_matrix(c, pose, m);
}

/// Takes the rows and columns of what is held out of a symmetric matrix: 1 on the diagonal, else 0.
template <class S, std::size_t N> void hold(SquareMatrix<S, N>& m, std::size_t n, const mask_t<S>* held) noexcept {
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      const S kept = select(either(held[i], held[j]), S(0), m.at[i][j]);
      m.at[i][j] = m.at[j][i] = i == j ? select(held[i], S(1), m.at[i][i]) : kept;
    }
}

/// Accelerations that efforts give at (q, v), without friction; 0 where a joint is `held` (null: none is).
template <class S, std::size_t N> void forward_dynamics(const TreeCoefficients<S, N>& c, const S* q, const S* v,
                                                        const S* effort, const mask_t<S>* held, S* a) noexcept {
  TreePose<S, N> pose;
  place(c, q, pose);
  S none[N];
  for (S& number : none) number = S(0);
  inverse_dynamics(c, pose, v, none, a);
  SquareMatrix<S, N> m;
  mass_matrix(c, pose, m);
  for (std::size_t k = 0; k < c.coordinates; ++k) a[k] = effort[k] - a[k];
  if (held != nullptr) {
    hold(m, c.coordinates, held);
    for (std::size_t k = 0; k < c.coordinates; ++k) a[k] = select(held[k], S(0), a[k]);
  }
  factorise(m, c.coordinates);
  solve(m, c.coordinates, a);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
