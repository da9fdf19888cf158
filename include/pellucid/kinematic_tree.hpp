// Rigid bodies joined in a tree by hinges, slides and welds: where they are, and what effort moves them.
//
// Each link has one joint, by which it hangs on an earlier link or on the base. The joint's frame lies in the parent's
// where six numbers say, and is the link's own frame where the coordinate is 0; from there the link turns about, or
// slides along, an axis fixed in both. Coordinates are those of the joints that move, in the order of their links.
//
// Inverse dynamics are Newton's and Euler's equations, outwards for motions and inwards for forces, each link's in its
// own frame (Luh, Walker and Paul, J. Dyn. Syst. Meas. Control 102(2), 1980): with w the angular velocity, d the
// acceleration of the origin less gravity, and W = [dw/dt] + [w][w],
//   f = m d + W (m c),   n = I dw/dt + w x I w + (m c) x d.
// No heap: N is how many links there may be, and what is not used is not touched.
#pragma once

#include "rigid_body.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

enum class JointKind : std::uint8_t {
  fixed,      ///< welded: no coordinate
  revolute,   ///< turns about its axis [rad]
  prismatic,  ///< slides along its axis [m]
};

/// A link and the joint by which it hangs.
template <class S> struct LinkParams {
  std::uint32_t parent = 0;  ///< 0: the base; else an earlier link, from 1
  std::uint32_t joint = 1;   ///< a JointKind
  S x{}, y{}, z{}, roll{}, pitch{}, yaw{}, axis_x{}, axis_y{}, axis_z{1}, rotor_inertia{};
  RigidBodyParams<S> body{};  ///< body of the link, in its own frame

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.parent, {"parent", unit::one, at_least(0), "link on which this one hangs, from 1; 0: the base"});
    visit(p.joint, {"joint", unit::one, between(0, 2), "0: welded, 1: turns about its axis, 2: slides along it"});
    visit(p.x, {"x", unit::length, any_number(), "position of the joint in the parent's frame"});
    visit(p.y, {"y", unit::length, any_number(), "position of the joint in the parent's frame"});
    visit(p.z, {"z", unit::length, any_number(), "position of the joint in the parent's frame"});
    visit(p.roll, {"roll", unit::angle, any_number(), "rotation of the joint's frame about the parent's x, first"});
    visit(p.pitch, {"pitch", unit::angle, any_number(), "about the parent's y, second"});
    visit(p.yaw, {"yaw", unit::angle, any_number(), "about the parent's z, third"});
    visit(p.axis_x, {"axis_x", unit::one, any_number(), "axis in the joint's frame, of any length but 0"});
    visit(p.axis_y, {"axis_y", unit::one, any_number(), "y component of the axis"});
    visit(p.axis_z, {"axis_z", unit::one, any_number(), "z component of the axis"});
    visit(p.rotor_inertia, {"rotor_inertia", unit::inertia, at_least(0), "J_r, of the rotor, at the joint"});
    pellucid::walk(p.body, visit);
  }
};

/// Number of parameters of a link.
constexpr std::size_t link_parameter_count = field_count<LinkParams<double>>;

/// At most N links.
template <class S, std::size_t N> struct TreeParams {
  std::uint32_t links = 0;                                                   ///< how many there are
  S gravity_x{}, gravity_y{}, gravity_z{static_cast<value_t<S>>(-9.80665)};  ///< in the base's frame [m/s^2]
  LinkParams<S> link[N]{};                                                   ///< each after the one on which it hangs
};

/// Coefficients computed once from LinkParams.
template <class S> struct LinkCoefficients {
  JointKind joint;                 ///< joint of the link on its parent
  bool on_base;                    ///< whether the parent is the base
  std::uint8_t parent;             ///< index of the parent, unless that is the base
  std::uint8_t coordinate;         ///< index of the joint's coordinate, if it moves
  Matrix3<S> fixed, sine, cosine;  ///< R = fixed + sine sin q + cosine cos q, of the link in its parent; a slide: fixed
  Vector3<S> position;             ///< position of the joint in the parent [m]
  Vector3<S> axis;                 ///< axis of length 1, in the link [1]
  Vector3<S> slide;                ///< the axis in the parent; a hinge: 0 [1]
  RigidBody<S> body;               ///< body of the link
  S rotor_inertia;                 ///< J_r [kg m^2]
};

/// Coefficients computed once from TreeParams.
template <class S, std::size_t N> struct TreeCoefficients {
  static_assert(N >= 1 && N <= 255, "a link's number is one byte");
  std::size_t links = 0;        ///< how many
  std::size_t coordinates = 0;  ///< joints that move
  bool valid = false;           ///< whether parents come first, kinds are kinds, and axes have a length
  Vector3<S> gravity{};         ///< in the base's frame [m/s^2]
  std::uint8_t link_of[N];      ///< the link that a coordinate moves
  LinkCoefficients<S> link[N];  ///< in order
};

namespace detail {
template <class S> bool coefficients(const LinkParams<S>& p, LinkCoefficients<S>& c) noexcept {
  const Matrix3<S> frame = rotation_of(p.roll, p.pitch, p.yaw);
  const Vector3<S> given{p.axis_x, p.axis_y, p.axis_z};
  const S square = dot(given, given);
  const mask_t<S> has_axis = both(square > S(0), is_finite(square));
  const S scale = S(1) / sqrt(select(has_axis, square, S(1)));
  const bool welded = p.joint == 0 || p.joint > 2;
  c.joint = welded ? JointKind::fixed : p.joint == 1 ? JointKind::revolute : JointKind::prismatic;
  c.axis = given * scale;
  c.position = {p.x, p.y, p.z};
  c.slide = zero_vector<S>();
  c.fixed = frame;
  c.sine = c.cosine = zero_matrix<S>();
  if (c.joint == JointKind::prismatic) c.slide = frame * c.axis;
  if (c.joint == JointKind::revolute) {
    const Matrix3<S> along = outer(c.axis, c.axis);
    c.fixed = frame * along;
    c.sine = frame * cross_matrix(c.axis);
    c.cosine = frame * combined(unit_matrix<S>(), along, S(-1), along, S(0));
  }
  c.body = pellucid::coefficients(p.body);
  c.rotor_inertia = p.rotor_inertia;
  return p.joint <= 2 && (welded || all(has_axis));
}
}  // namespace detail

/// Return the coefficients of a tree. If a parameter is invalid (a link beyond N, a parent that does not precede its
/// link, an unknown kind), a default replaces it and the tree is marked as not valid.
template <class S, std::size_t N> TreeCoefficients<S, N> coefficients(const TreeParams<S, N>& params) noexcept {
  TreeCoefficients<S, N> c;
  c.valid = params.links >= 1 && params.links <= N;
  c.links = params.links <= N ? params.links : N;
  c.gravity = {params.gravity_x, params.gravity_y, params.gravity_z};
  for (std::size_t i = 0; i < c.links; ++i) {
    const LinkParams<S>& p = params.link[i];
    LinkCoefficients<S>& link = c.link[i];
    const bool sound = detail::coefficients(p, link) && p.parent <= i;
    link.on_base = p.parent == 0 || p.parent > i;
    link.parent = static_cast<std::uint8_t>(link.on_base ? 0 : p.parent - 1);
    link.coordinate = static_cast<std::uint8_t>(c.coordinates);
    if (link.joint != JointKind::fixed) c.link_of[c.coordinates++] = static_cast<std::uint8_t>(i);
    c.valid = c.valid && sound;
  }
  return c;
}

/// Placement of each link in its parent, at one set of coordinates.
template <class S, std::size_t N> struct TreePose {
  Placement<S> in_parent[N];
};

/// q holds a number for each coordinate, as everywhere below.
template <class S, std::size_t N>
void place(const TreeCoefficients<S, N>& c, const S* q, TreePose<S, N>& pose) noexcept {
  for (std::size_t i = 0; i < c.links; ++i) {
    const LinkCoefficients<S>& link = c.link[i];
    Placement<S>& at = pose.in_parent[i];
    at = {link.fixed, link.position};
    if (link.joint == JointKind::revolute) {
      const SinCos<S> turn = sincos(q[link.coordinate]);
      at.rotation = combined(link.fixed, link.sine, turn.sin, link.cosine, turn.cos);
    } else if (link.joint == JointKind::prismatic) {
      at.position = link.position + link.slide * q[link.coordinate];
    }
  }
}

/// Every link's frame in the base's.
template <class S, std::size_t N>
void forward_kinematics(const TreeCoefficients<S, N>& c, const S* q, Placement<S>* in_base) noexcept {
  TreePose<S, N> pose;
  place(c, q, pose);
  for (std::size_t i = 0; i < c.links; ++i) {
    const LinkCoefficients<S>& link = c.link[i];
    in_base[i] = link.on_base ? pose.in_parent[i] : in_base[link.parent] * pose.in_parent[i];
  }
}

/// Motion of a link, in its own frame.
template <class S> struct LinkMotion {
  Vector3<S> velocity;      ///< w, angular [rad/s]
  Vector3<S> acceleration;  ///< dw/dt [rad/s^2]
  Vector3<S> proper;        ///< d, of the origin less gravity [m/s^2]
};

/// W a, with W = [dw/dt] + [w][w]: what a link's turning does to a point at rest in it.
template <class S> Matrix3<S> turning(const LinkMotion<S>& m) noexcept {
  const Vector3<S>& w = m.velocity;
  const Vector3<S>& e = m.acceleration;
  const S xx = w.x * w.x, yy = w.y * w.y, zz = w.z * w.z, xy = w.x * w.y, xz = w.x * w.z, yz = w.y * w.z;
  return {-(yy + zz), xy - e.z, xz + e.y, xy + e.z, -(xx + zz), yz - e.x, xz - e.y, yz + e.x, -(xx + yy)};
}

/// The motion of link i, its parent's known.
template <class S, std::size_t N> void move(const TreeCoefficients<S, N>& c, const TreePose<S, N>& pose, std::size_t i,
                                            const S* v, const S* a, LinkMotion<S>* motion,
                                            Matrix3<S>* turned) noexcept {
  const LinkCoefficients<S>& link = c.link[i];
  const Placement<S>& at = pose.in_parent[i];
  LinkMotion<S>& m = motion[i];
  if (link.on_base) {
    m = {zero_vector<S>(), zero_vector<S>(), transposed_times(at.rotation, -c.gravity)};
  } else {
    const LinkMotion<S>& parent = motion[link.parent];
    m = {transposed_times(at.rotation, parent.velocity), transposed_times(at.rotation, parent.acceleration),
         transposed_times(at.rotation, parent.proper + turned[link.parent] * at.position)};
  }
  if (link.joint == JointKind::revolute) {
    const Vector3<S> spin = link.axis * v[link.coordinate];
    m.acceleration = m.acceleration + link.axis * a[link.coordinate] + cross(m.velocity, spin);
    m.velocity = m.velocity + spin;
  } else if (link.joint == JointKind::prismatic) {
    const Vector3<S> speed = link.axis * v[link.coordinate];
    m.proper = m.proper + link.axis * a[link.coordinate] + cross(m.velocity, speed + speed);
  }
  turned[i] = turning(m);
}

/// A force on a link and its moment about the link's origin.
template <class S> struct LinkForce {
  Vector3<S> force;   ///< [N]
  Vector3<S> moment;  ///< [N m]
};
/// The same in the frame, and about the origin, where the link's frame is placed.
template <class S> LinkForce<S> operator*(const Placement<S>& at, const LinkForce<S>& f) noexcept {
  const Vector3<S> force = at.rotation * f.force;
  return {force, at.rotation * f.moment + cross(at.position, force)};
}
/// Its component along the coordinate of a joint.
template <class S> S along(const LinkCoefficients<S>& link, const LinkForce<S>& f) noexcept {
  return dot(link.axis, link.joint == JointKind::prismatic ? f.force : f.moment);
}

/// Effort of each coordinate that gives accelerations a at (q, v), without friction [N m; N].
template <class S, std::size_t N> void inverse_dynamics(const TreeCoefficients<S, N>& c, const TreePose<S, N>& pose,
                                                        const S* v, const S* a, S* effort) noexcept {
  LinkMotion<S> motion[N];
  Matrix3<S> turned[N];
  LinkForce<S> force[N];
  for (std::size_t i = 0; i < c.links; ++i) {
    move(c, pose, i, v, a, motion, turned);
    const RigidBody<S>& body = c.link[i].body;
    const LinkMotion<S>& m = motion[i];
    force[i] = {
        m.proper * body.mass + turned[i] * body.moment,
        body.inertia * m.acceleration + cross(m.velocity, body.inertia * m.velocity) + cross(body.moment, m.proper)};
  }
  for (std::size_t i = c.links; i-- > 0;) {
    const LinkCoefficients<S>& link = c.link[i];
    if (link.joint != JointKind::fixed)
      effort[link.coordinate] = along(link, force[i]) + link.rotor_inertia * a[link.coordinate];
    if (link.on_base) continue;
    const LinkForce<S> passed = pose.in_parent[i] * force[i];
    LinkForce<S>& parent = force[link.parent];
    parent = {parent.force + passed.force, parent.moment + passed.moment};
  }
}
template <class S, std::size_t N>
void inverse_dynamics(const TreeCoefficients<S, N>& c, const S* q, const S* v, const S* a, S* effort) noexcept {
  TreePose<S, N> pose;
  place(c, q, pose);
  inverse_dynamics(c, pose, v, a, effort);
}

/// Effort that holds every joint where it is.
template <class S, std::size_t N>
void gravity(const TreeCoefficients<S, N>& c, const TreePose<S, N>& pose, S* effort) noexcept {
  Vector3<S> proper[N];
  LinkForce<S> force[N];
  for (std::size_t i = 0; i < c.links; ++i) {
    const LinkCoefficients<S>& link = c.link[i];
    proper[i] = transposed_times(pose.in_parent[i].rotation, link.on_base ? -c.gravity : proper[link.parent]);
    force[i] = {proper[i] * link.body.mass, cross(link.body.moment, proper[i])};
  }
  for (std::size_t i = c.links; i-- > 0;) {
    const LinkCoefficients<S>& link = c.link[i];
    if (link.joint != JointKind::fixed) effort[link.coordinate] = along(link, force[i]);
    if (link.on_base) continue;
    const LinkForce<S> passed = pose.in_parent[i] * force[i];
    LinkForce<S>& parent = force[link.parent];
    parent = {parent.force + passed.force, parent.moment + passed.moment};
  }
}
template <class S, std::size_t N> void gravity(const TreeCoefficients<S, N>& c, const S* q, S* effort) noexcept {
  TreePose<S, N> pose;
  place(c, q, pose);
  gravity(c, pose, effort);
}

/// Energy of the bodies and rotors [J].
template <class S> struct TreeEnergy {
  S kinetic;    ///< energy of motion
  S potential;  ///< energy of height, 0 where all masses lie at the base's origin
};
template <class S, std::size_t N>
TreeEnergy<S> energy(const TreeCoefficients<S, N>& c, const S* q, const S* v) noexcept {
  TreePose<S, N> pose;
  place(c, q, pose);
  Placement<S> in_base[N];
  Vector3<S> turns[N], moves[N];
  TreeEnergy<S> sum{S(0), S(0)};
  for (std::size_t i = 0; i < c.links; ++i) {
    const LinkCoefficients<S>& link = c.link[i];
    const Placement<S>& at = pose.in_parent[i];
    const RigidBody<S>& body = link.body;
    if (link.on_base) {
      in_base[i] = at;
      turns[i] = moves[i] = zero_vector<S>();
    } else {
      in_base[i] = in_base[link.parent] * at;
      turns[i] = transposed_times(at.rotation, turns[link.parent]);
      moves[i] = transposed_times(at.rotation, moves[link.parent] + cross(turns[link.parent], at.position));
    }
    if (link.joint == JointKind::revolute) turns[i] = turns[i] + link.axis * v[link.coordinate];
    if (link.joint == JointKind::prismatic) moves[i] = moves[i] + link.axis * v[link.coordinate];
    S twice = body.mass * dot(moves[i], moves[i]) + dot(turns[i], body.inertia * turns[i]);
    if (link.joint != JointKind::fixed) twice = twice + link.rotor_inertia * v[link.coordinate] * v[link.coordinate];
    sum.kinetic = sum.kinetic + S(0.5) * twice + dot(moves[i], cross(turns[i], body.moment));
    sum.potential = sum.potential - dot(c.gravity, in_base[i].position * body.mass + in_base[i].rotation * body.moment);
  }
  return sum;
}

/// Velocity of a point of a link by each coordinate's velocity, in the base's axes.
template <class S> struct JacobianColumn {
  Vector3<S> linear;   ///< rows for the velocity of the point [m/rad; 1]
  Vector3<S> angular;  ///< rows for the angular velocity of the link [1; 0]
};
/// `point` is in the link's frame; a column for every coordinate, 0 for joints that do not carry the link. A link that
/// is none moves with nothing.
template <class S, std::size_t N> void jacobian(const TreeCoefficients<S, N>& c, const S* q, std::size_t link,
                                                const Vector3<S>& point, JacobianColumn<S>* columns) noexcept {
  Placement<S> in_base[N];
  forward_kinematics(c, q, in_base);
  for (std::size_t k = 0; k < c.coordinates; ++k) columns[k] = {zero_vector<S>(), zero_vector<S>()};
  if (link >= c.links) return;
  const Vector3<S> at = in_base[link].rotation * point + in_base[link].position;
  for (std::size_t i = link;; i = c.link[i].parent) {
    const LinkCoefficients<S>& joint = c.link[i];
    const Vector3<S> axis = in_base[i].rotation * joint.axis;
    if (joint.joint == JointKind::revolute) columns[joint.coordinate] = {cross(axis, at - in_base[i].position), axis};
    if (joint.joint == JointKind::prismatic) columns[joint.coordinate] = {axis, zero_vector<S>()};
    if (joint.on_base) return;
  }
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
