// The ten numbers by which a rigid body shows in effort: mass, first moments, and moments about its frame's origin.
//
// Effort is linear in them, so they are what is identified. About the origin, not about the centre of mass:
// I = I_c + m (c'c E - c c').
#pragma once

#include "fields.hpp"
#include "spatial.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct RigidBodyParams {
  S mass{}, moment_x{}, moment_y{}, moment_z{}, inertia_xx{}, inertia_xy{}, inertia_xz{}, inertia_yy{}, inertia_yz{},
      inertia_zz{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.mass, {"mass", unit::mass, any_number(), "m"});
    visit(p.moment_x, {"moment_x", unit::first_moment, any_number(), "m c_x, first moment along the link's x"});
    visit(p.moment_y, {"moment_y", unit::first_moment, any_number(), "m c_y"});
    visit(p.moment_z, {"moment_z", unit::first_moment, any_number(), "m c_z"});
    visit(p.inertia_xx, {"inertia_xx", unit::moment, any_number(), "I_xx, about the link's origin"});
    visit(p.inertia_xy, {"inertia_xy", unit::moment, any_number(), "I_xy, minus the integral of x y"});
    visit(p.inertia_xz, {"inertia_xz", unit::moment, any_number(), "I_xz"});
    visit(p.inertia_yy, {"inertia_yy", unit::moment, any_number(), "I_yy"});
    visit(p.inertia_yz, {"inertia_yz", unit::moment, any_number(), "I_yz"});
    visit(p.inertia_zz, {"inertia_zz", unit::moment, any_number(), "I_zz"});
  }
};

/// Number of parameters of a body.
constexpr std::size_t body_parameter_count = field_count<RigidBodyParams<double>>;

/// A symmetric matrix.
template <class S> struct Symmetric3 {
  S xx, xy, xz, yy, yz, zz;
};
template <class S> Vector3<S> operator*(const Symmetric3<S>& m, const Vector3<S>& a) noexcept {
  return {m.xx * a.x + m.xy * a.y + m.xz * a.z, m.xy * a.x + m.yy * a.y + m.yz * a.z,
          m.xz * a.x + m.yz * a.y + m.zz * a.z};
}

/// A body as its equations use it.
template <class S> struct RigidBody {
  S mass;                 ///< m [kg]
  Vector3<S> moment;      ///< m c [kg m]
  Symmetric3<S> inertia;  ///< I about the origin [kg m^2]
};
template <class S> RigidBody<S> coefficients(const RigidBodyParams<S>& p) noexcept {
  return {p.mass,
          {p.moment_x, p.moment_y, p.moment_z},
          {p.inertia_xx, p.inertia_xy, p.inertia_xz, p.inertia_yy, p.inertia_yz, p.inertia_zz}};
}

/// Two bodies of one frame, as one.
template <class S> RigidBody<S> operator+(const RigidBody<S>& a, const RigidBody<S>& b) noexcept {
  return {a.mass + b.mass,
          a.moment + b.moment,
          {a.inertia.xx + b.inertia.xx, a.inertia.xy + b.inertia.xy, a.inertia.xz + b.inertia.xz,
           a.inertia.yy + b.inertia.yy, a.inertia.yz + b.inertia.yz, a.inertia.zz + b.inertia.zz}};
}

/// The same body, written in the frame in which its own is placed.
template <class S> RigidBody<S> operator*(const Placement<S>& at, const RigidBody<S>& body) noexcept {
  const Matrix3<S>& r = at.rotation;
  const Vector3<S>& p = at.position;
  const Symmetric3<S>& i = body.inertia;
  const Vector3<S> h = r * body.moment;
  const Matrix3<S> ri = r * Matrix3<S>{i.xx, i.xy, i.xz, i.xy, i.yy, i.yz, i.xz, i.yz, i.zz};
  // R I R' + (2 p'h + m p'p) E - (p h' + h p' + m p p')
  const Vector3<S> k = h + p * body.mass;
  const Vector3<S> x{ri.xx, ri.xy, ri.xz}, y{ri.yx, ri.yy, ri.yz}, z{ri.zx, ri.zy, ri.zz};
  const Vector3<S> rx{r.xx, r.xy, r.xz}, ry{r.yx, r.yy, r.yz}, rz{r.zx, r.zy, r.zz};
  const S xx = h.x * p.x + p.x * k.x, yy = h.y * p.y + p.y * k.y, zz = h.z * p.z + p.z * k.z;
  return {body.mass,
          k,
          {dot(x, rx) + (yy + zz), dot(x, ry) - (h.x * p.y + p.x * k.y), dot(x, rz) - (h.x * p.z + p.x * k.z),
           dot(y, ry) + (xx + zz), dot(y, rz) - (h.y * p.z + p.y * k.z), dot(z, rz) + (xx + yy)}};
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
