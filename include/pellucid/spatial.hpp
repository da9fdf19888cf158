// Vectors, rotations and placements in space, for every scalar.
//
// A placement of frame B in frame A is a rotation R and a position p: a point r of B lies at R r + p in A. Bodies are
// told from one another by the frame in which their vectors are written; nothing here is six-dimensional, because a
// motion's and a force's halves are used apart.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Three numbers of one frame. Not zeroed: trees keep arrays of them of which most is never used.
template <class S> struct Vector3 {
  S x, y, z;
};
/// Nine numbers, row by row.
template <class S> struct Matrix3 {
  S xx, xy, xz, yx, yy, yz, zx, zy, zz;
};
/// Place of a frame in another.
template <class S> struct Placement {
  Matrix3<S> rotation;
  Vector3<S> position;
};

template <class S> Vector3<S> operator+(const Vector3<S>& a, const Vector3<S>& b) noexcept {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class S> Vector3<S> operator-(const Vector3<S>& a, const Vector3<S>& b) noexcept {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class S> Vector3<S> operator-(const Vector3<S>& a) noexcept { return {-a.x, -a.y, -a.z}; }
template <class S> Vector3<S> operator*(const Vector3<S>& a, const S& b) noexcept {
  return {a.x * b, a.y * b, a.z * b};
}
template <class S> S dot(const Vector3<S>& a, const Vector3<S>& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class S> Vector3<S> cross(const Vector3<S>& a, const Vector3<S>& b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class S> Vector3<S> zero_vector() noexcept { return {S(0), S(0), S(0)}; }

template <class S> Vector3<S> operator*(const Matrix3<S>& m, const Vector3<S>& a) noexcept {
  return {m.xx * a.x + m.xy * a.y + m.xz * a.z, m.yx * a.x + m.yy * a.y + m.yz * a.z,
          m.zx * a.x + m.zy * a.y + m.zz * a.z};
}
/// m' a: a rotation's way back.
template <class S> Vector3<S> transposed_times(const Matrix3<S>& m, const Vector3<S>& a) noexcept {
  return {m.xx * a.x + m.yx * a.y + m.zx * a.z, m.xy * a.x + m.yy * a.y + m.zy * a.z,
          m.xz * a.x + m.yz * a.y + m.zz * a.z};
}
template <class S> Matrix3<S> operator*(const Matrix3<S>& a, const Matrix3<S>& b) noexcept {
  return {a.xx * b.xx + a.xy * b.yx + a.xz * b.zx, a.xx * b.xy + a.xy * b.yy + a.xz * b.zy,
          a.xx * b.xz + a.xy * b.yz + a.xz * b.zz, a.yx * b.xx + a.yy * b.yx + a.yz * b.zx,
          a.yx * b.xy + a.yy * b.yy + a.yz * b.zy, a.yx * b.xz + a.yy * b.yz + a.yz * b.zz,
          a.zx * b.xx + a.zy * b.yx + a.zz * b.zx, a.zx * b.xy + a.zy * b.yy + a.zz * b.zy,
          a.zx * b.xz + a.zy * b.yz + a.zz * b.zz};
}
/// a + b s + c t
template <class S>
Matrix3<S> combined(const Matrix3<S>& a, const Matrix3<S>& b, const S& s, const Matrix3<S>& c, const S& t) noexcept {
  return {a.xx + b.xx * s + c.xx * t, a.xy + b.xy * s + c.xy * t, a.xz + b.xz * s + c.xz * t,
          a.yx + b.yx * s + c.yx * t, a.yy + b.yy * s + c.yy * t, a.yz + b.yz * s + c.yz * t,
          a.zx + b.zx * s + c.zx * t, a.zy + b.zy * s + c.zy * t, a.zz + b.zz * s + c.zz * t};
}
template <class S> Matrix3<S> unit_matrix() noexcept { return {S(1), S(0), S(0), S(0), S(1), S(0), S(0), S(0), S(1)}; }
template <class S> Matrix3<S> zero_matrix() noexcept { return {S(0), S(0), S(0), S(0), S(0), S(0), S(0), S(0), S(0)}; }
/// [a]: the matrix whose product with b is a x b.
template <class S> Matrix3<S> cross_matrix(const Vector3<S>& a) noexcept {
  return {S(0), -a.z, a.y, a.z, S(0), -a.x, -a.y, a.x, S(0)};
}
/// a b'
template <class S> Matrix3<S> outer(const Vector3<S>& a, const Vector3<S>& b) noexcept {
  return {a.x * b.x, a.x * b.y, a.x * b.z, a.y * b.x, a.y * b.y, a.y * b.z, a.z * b.x, a.z * b.y, a.z * b.z};
}

/// Turned about x, then y, then z of the frame that stays: R = R_z(yaw) R_y(pitch) R_x(roll).
template <class S> Matrix3<S> rotation_of(const S& roll, const S& pitch, const S& yaw) noexcept {
  const SinCos<S> r = sincos(roll), p = sincos(pitch), y = sincos(yaw);
  return {y.cos * p.cos,
          y.cos * p.sin * r.sin - y.sin * r.cos,
          y.cos * p.sin * r.cos + y.sin * r.sin,
          y.sin * p.cos,
          y.sin * p.sin * r.sin + y.cos * r.cos,
          y.sin * p.sin * r.cos - y.cos * r.sin,
          -p.sin,
          p.cos * r.sin,
          p.cos * r.cos};
}

/// Frame C in A, of B in A and C in B.
template <class S> Placement<S> operator*(const Placement<S>& a, const Placement<S>& b) noexcept {
  return {a.rotation * b.rotation, a.rotation * b.position + a.position};
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
