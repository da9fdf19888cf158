// Trees of bodies: every scalar, the laws that bind their functions together, and whatever numbers come in.
#include "check.hpp"

#include <pellucid/dual.hpp>
#include <pellucid/mass_matrix.hpp>
#include <pellucid/torque_regressor.hpp>

namespace p = pellucid;

constexpr std::size_t most = 7;

template <class S> S number(double x) { return S(static_cast<p::value_t<S>>(x)); }

/// Six links in two branches: hinges, a slide and a weld, each with the body of four points of mass.
template <class S> p::TreeParams<S, most> example() {
  Random random(7);
  p::TreeParams<S, most> tree;
  tree.links = 6;
  const std::uint32_t parent[] = {0, 1, 2, 2, 4, 5}, joint[] = {1, 2, 1, 0, 1, 1};
  for (std::size_t i = 0; i < tree.links; ++i) {
    const auto any = [&] { return random.uniform(-1, 1); };
    p::LinkParams<S>& link = tree.link[i];
    link.parent = parent[i];
    link.joint = joint[i];
    link.x = number<S>(0.3 * any());
    link.y = number<S>(0.3 * any());
    link.z = number<S>(0.3 * any());
    link.roll = number<S>(3 * any());
    link.pitch = number<S>(3 * any());
    link.yaw = number<S>(3 * any());
    link.axis_x = number<S>(any());
    link.axis_y = number<S>(any());
    link.axis_z = number<S>(any());
    link.rotor_inertia = number<S>(random.uniform(0, 0.2));
    double sum[10] = {};
    for (int point = 0; point < 4; ++point) {
      const double m = random.uniform(0.2, 1), x = 0.3 * any(), y = 0.3 * any(), z = 0.3 * any();
      const double add[10] = {m,
                              m * x,
                              m * y,
                              m * z,
                              m * (y * y + z * z),
                              -m * x * y,
                              -m * x * z,
                              m * (x * x + z * z),
                              -m * y * z,
                              m * (x * x + y * y)};
      for (int k = 0; k < 10; ++k) sum[k] += add[k];
    }
    S body[10];
    for (int k = 0; k < 10; ++k) body[k] = number<S>(sum[k]);
    link.body = p::from_numbers<p::RigidBodyParams<S>>(body);
  }
  return tree;
}

template <class S> struct Motion {
  S q[most], v[most], a[most];
};
template <class S> Motion<S> motion(std::uint64_t seed, double scale = 1) {
  Random random(seed);
  Motion<S> m;
  for (std::size_t k = 0; k < most; ++k) {
    m.q[k] = number<S>(scale * random.uniform(-3, 3));
    m.v[k] = number<S>(scale * random.uniform(-4, 4));
    m.a[k] = number<S>(scale * random.uniform(-20, 20));
  }
  return m;
}

template <class S> void laws(double tolerance, const char* name) {
  const auto tree = p::coefficients(example<S>());
  check(tree.valid && tree.links == 6 && tree.coordinates == 5, name);
  const S near = number<S>(tolerance);
  for (const double scale : {0.0, 1e-8, 1.0}) {
    const Motion<S> m = motion<S>(3, scale);
    S effort[most], back[most], rows[most];
    p::inverse_dynamics(tree, m.q, m.v, m.a, effort);
    p::forward_dynamics(tree, m.q, m.v, effort, static_cast<const p::mask_t<S>*>(nullptr), back);
    for (std::size_t k = 0; k < 5; ++k) check(p::all(p::abs(back[k] - m.a[k]) < near * S(100)), "forward of inverse");
    for (S& row : rows) row = S(0);
    p::torque_regressor(tree, m.q, m.v, m.a, [&](std::size_t k, std::size_t link, const S* column) {
      S body[10];
      p::to_numbers(example<S>().link[link].body, body);
      for (std::size_t i = 0; i < 10; ++i) rows[k] = rows[k] + column[i] * body[i];
    });
    for (std::size_t k = 0; k < 5; ++k) {
      const S rotor = tree.link[tree.link_of[k]].rotor_inertia * m.a[k];
      check(p::all(p::abs(rows[k] + rotor - effort[k]) < near), "Y theta");
    }
    // Columns of M are efforts of unit accelerations.
    p::SquareMatrix<S, most> matrix;
    p::mass_matrix(tree, m.q, matrix);
    S still[most], weight[most];
    for (S& x : still) x = S(0);
    p::gravity(tree, m.q, weight);
    for (std::size_t l = 0; l < 5; ++l) {
      S unit[most], column[most];
      for (std::size_t k = 0; k < most; ++k) unit[k] = S(k == l ? 1 : 0);
      p::inverse_dynamics(tree, m.q, still, unit, column);
      for (std::size_t k = 0; k < 5; ++k) {
        check(p::all(p::abs(column[k] - weight[k] - matrix.at[k][l]) < near), "columns of M");
        check(p::all(matrix.at[k][l] == matrix.at[l][k]), "M is symmetric");
      }
    }
    S twice = S(0);
    for (std::size_t k = 0; k < 5; ++k)
      for (std::size_t l = 0; l < 5; ++l) twice = twice + m.v[k] * matrix.at[k][l] * m.v[l];
    check(p::all(p::abs(p::energy(tree, m.q, m.v).kinetic - S(0.5) * twice) < near), "kinetic energy");
  }
}

/// Derivatives of duals against differences, by position and by a mass.
void derivatives() {
  using D = p::Dual<double, 8>;
  const auto plain = p::coefficients(example<double>());
  const auto m = motion<double>(11);
  const auto wide = p::coefficients(example<D>());
  D q[most], v[most], a[most], effort[most];
  for (std::size_t k = 0; k < most; ++k) {
    q[k] = k < 5 ? D::parameter(m.q[k], k) : D(m.q[k]);
    v[k] = D(m.v[k]);
    a[k] = D(m.a[k]);
  }
  p::inverse_dynamics(wide, q, v, a, effort);
  for (std::size_t l = 0; l < 5; ++l) {
    constexpr double h = 1e-6;
    Motion<double> up = m, down = m;
    up.q[l] += h;
    down.q[l] -= h;
    double above[most], below[most];
    p::inverse_dynamics(plain, up.q, up.v, up.a, above);
    p::inverse_dynamics(plain, down.q, down.v, down.a, below);
    for (std::size_t k = 0; k < 5; ++k)
      check_close(effort[k].derivative[l], (above[k] - below[k]) / (2 * h), 1e-6, "d effort / d position");
  }
  double weight[most], height[5];
  p::gravity(plain, m.q, weight);
  const D potential = p::energy(wide, q, v).potential;
  for (std::size_t k = 0; k < 5; ++k) height[k] = potential.derivative[k];
  for (std::size_t k = 0; k < 5; ++k) check_close(height[k], weight[k], 1e-12, "gravity is the slope of the energy");
}

/// The Jacobian of a point is the slope of where it is.
void jacobians() {
  using D = p::Dual<double, 8>;
  const auto tree = p::coefficients(example<double>());
  const auto wide = p::coefficients(example<D>());
  const auto m = motion<double>(5);
  const p::Vector3<double> point{0.1, -0.2, 0.3};
  for (std::size_t link = 0; link < 6; ++link) {
    p::JacobianColumn<double> columns[most];
    p::jacobian(tree, m.q, link, point, columns);
    D q[most];
    for (std::size_t k = 0; k < most; ++k) q[k] = k < 5 ? D::parameter(m.q[k], k) : D(m.q[k]);
    p::Placement<D> in_base[most];
    p::forward_kinematics(wide, q, in_base);
    const p::Vector3<D> at = in_base[link].rotation * p::Vector3<D>{D(0.1), D(-0.2), D(0.3)} + in_base[link].position;
    const p::Matrix3<D>& r = in_base[link].rotation;
    for (std::size_t k = 0; k < 5; ++k) {
      check_close(columns[k].linear.x, at.x.derivative[k], 1e-12, "linear x");
      check_close(columns[k].linear.y, at.y.derivative[k], 1e-12, "linear y");
      check_close(columns[k].linear.z, at.z.derivative[k], 1e-12, "linear z");
      // dR R' = [angular]
      const double z =
          r.yx.derivative[k] * r.xx.value + r.yy.derivative[k] * r.xy.value + r.yz.derivative[k] * r.xz.value;
      check_close(columns[k].angular.z, z, 1e-12, "angular z");
    }
  }
}

/// Every lane has the bits of the scalar run.
void lanes() {
  using L = p::Lanes<double, 8>;
  const auto tree = p::coefficients(example<double>());
  const auto wide = p::coefficients(example<L>());
  Motion<L> m;
  for (std::size_t l = 0; l < 8; ++l) {
    const auto one = motion<double>(20 + l);
    for (std::size_t k = 0; k < most; ++k) m.q[k].set(l, one.q[k]), m.v[k].set(l, one.v[k]), m.a[k].set(l, one.a[k]);
  }
  L effort[most], back[most];
  p::inverse_dynamics(wide, m.q, m.v, m.a, effort);
  p::forward_dynamics(wide, m.q, m.v, effort, static_cast<const p::mask_t<L>*>(nullptr), back);
  for (std::size_t l = 0; l < 8; ++l) {
    const auto one = motion<double>(20 + l);
    double alone[most], accelerations[most];
    p::inverse_dynamics(tree, one.q, one.v, one.a, alone);
    p::forward_dynamics(tree, one.q, one.v, alone, static_cast<const bool*>(nullptr), accelerations);
    for (std::size_t k = 0; k < 5; ++k)
      check(alone[k] == effort[k][l] && accelerations[k] == back[k][l], "bits of a lane");
  }
}

/// A held joint stays, and the others move as if it were welded.
void held() {
  auto params = example<double>();
  const auto m = motion<double>(9);
  double v[most], effort[most], a[most];
  for (std::size_t k = 0; k < most; ++k) v[k] = m.v[k], effort[k] = m.a[k];
  v[1] = 0;
  const bool rests[most] = {false, true};
  const auto tree = p::coefficients(params);
  p::forward_dynamics(tree, m.q, v, effort, rests, a);
  check(a[1] == 0, "a held joint does not accelerate");
  p::LinkParams<double>& slide = params.link[1];
  const auto at = p::rotation_of(slide.roll, slide.pitch, slide.yaw) * tree.link[1].axis;
  slide.x += at.x * m.q[1], slide.y += at.y * m.q[1], slide.z += at.z * m.q[1];
  slide.joint = 0;
  const auto welded = p::coefficients(params);
  double q4[most], v4[most], effort4[most], a4[most];
  for (std::size_t k = 0, l = 0; k < 5; ++k)
    if (k != 1) q4[l] = m.q[k], v4[l] = v[k], effort4[l] = effort[k], ++l;
  p::forward_dynamics(welded, q4, v4, effort4, static_cast<const bool*>(nullptr), a4);
  for (std::size_t k = 0, l = 0; k < 5; ++k)
    if (k != 1) check_close(a[k], a4[l++], 1e-9, "the others");
}

/// Any bits at all: it ends, and what makes no sense is said.
void nonsense() {
  Random random(13);
  for (int run = 0; run < 300; ++run) {
    auto params = example<double>();
    Motion<double> m = motion<double>(1);
    for (std::size_t k = 0; k < most; ++k) {
      m.q[k] = random.anything<double>(), m.v[k] = random.anything<double>(), m.a[k] = random.anything<double>();
      params.link[k].parent = random.anything<std::uint32_t>() % 9;
      params.link[k].joint = random.anything<std::uint32_t>() % 4;
      if (run % 2 == 0) params.link[k].axis_x = random.anything<double>();
    }
    params.links = random.anything<std::uint32_t>() % 12;
    const auto tree = p::coefficients(params);
    double effort[most], back[most];
    p::inverse_dynamics(tree, m.q, m.v, m.a, effort);
    p::forward_dynamics(tree, m.q, m.v, effort, static_cast<const bool*>(nullptr), back);
    p::JacobianColumn<double> columns[most];
    p::jacobian(tree, m.q, random.anything<std::uint32_t>() % 9, {0, 0, 0}, columns);
    if (params.links > most || params.links == 0) check(!tree.valid, "as many links as there may be");
  }
  auto params = example<double>();
  params.link[2].axis_x = params.link[2].axis_y = params.link[2].axis_z = 0;
  check(!p::coefficients(params).valid, "an axis has a length");
  params = example<double>();
  params.link[2].parent = 3;
  check(!p::coefficients(params).valid, "a link does not hang on itself");
  check(p::coefficients(example<double>()).valid, "the example does");
}

int main() {
  laws<double>(1e-11, "double");
  laws<float>(2e-3, "float");
  laws<p::Dual<double, 8>>(1e-11, "Dual<double>");
  laws<p::Lanes<double, 8>>(1e-11, "8 lanes of double");
  laws<p::Lanes<float, 4>>(2e-3, "4 lanes of float");
  derivatives();
  jacobians();
  lanes();
  held();
  nonsense();
  return failures();
}
