// Laws of several joints: momentum against M v and the energy's derivative, one joint against the law of one joint,
// efforts that go to 0 together, limits of the whole, a supervisor that stops all.
#include "check.hpp"

#include <pellucid/pellucid.hpp>

#include <cmath>

namespace p = pellucid;

namespace {

constexpr std::size_t links = 4;
template <class S> S number(double x) { return S(static_cast<p::value_t<S>>(x)); }

/// A chain with a slide, masses beside its axes; the last link is welded on.
template <class S> p::TreeParams<S, links> chain() {
  p::TreeParams<S, links> params;
  params.links = links;
  for (std::size_t i = 0; i < links; ++i) {
    p::LinkParams<S>& link = params.link[i];
    const double k = static_cast<double>(i);
    link.parent = static_cast<std::uint32_t>(i);
    link.joint = i == 2 ? 2 : i == 3 ? 0 : 1;
    link.x = number<S>(0.1 - 0.05 * k);
    link.y = number<S>(0.2 * k);
    link.z = number<S>(-0.15);
    link.roll = number<S>(0.4 * k);
    link.pitch = number<S>(0.3);
    link.yaw = number<S>(-0.2 * k);
    link.axis_x = number<S>(i == 0 ? 1 : 0.2);
    link.axis_y = number<S>(i == 1 ? 1 : 0.1);
    link.axis_z = number<S>(i == 2 ? 1 : 0.3);
    link.rotor_inertia = number<S>(0.02);
    link.body.mass = number<S>(2);
    link.body.moment_x = number<S>(0.1);
    link.body.moment_y = number<S>(-0.06);
    link.body.moment_z = number<S>(0.2);
    link.body.inertia_xx = number<S>(0.08);
    link.body.inertia_xy = number<S>(0.004);
    link.body.inertia_yy = number<S>(0.07);
    link.body.inertia_yz = number<S>(0.01);
    link.body.inertia_zz = number<S>(0.05);
  }
  return params;
}

template <class S> p::SafetyParams<S> limits() {
  p::SafetyParams<S> gate;
  const S any = std::numeric_limits<S>::infinity();
  gate.effort_limit = number<S>(60);
  gate.rate_limit = number<S>(5000);
  gate.velocity_limit = number<S>(20);
  gate.position_min = -any;
  gate.position_max = any;
  gate.max_age = number<S>(0.005);
  gate.max_repeats = 2;
  gate.period = number<S>(0.001);
  return gate;
}

template <class S> p::TreeCompensationParams<S, links> law_params() {
  p::TreeCompensationParams<S, links> params;
  params.tree = chain<S>();
  for (std::size_t k = 0; k < 3; ++k) {
    auto& friction = params.drives.joint[k].friction;
    friction.coulomb_positive = friction.coulomb_negative = number<S>(0.3);
    friction.viscous_positive = friction.viscous_negative = number<S>(0.1);
    friction.square_root = number<S>(0.05);
    friction.load_motoring = friction.load_generating = number<S>(0.05);
    friction.velocity_width = number<S>(0.05);
    params.joint[k].inertia_share = number<S>(0.4);
    params.joint[k].gate = limits<S>();
  }
  params.whole.end_link = 4;
  params.whole.end_x = number<S>(0.1);
  params.whole.sensor_link = 4;
  return params;
}

/// Joints that swing, each its own way.
template <class S> p::TreeSamples<S, links> swung(std::uint32_t i, double by = 0.4) {
  p::TreeSamples<S, links> in;
  for (std::size_t k = 0; k < 3; ++k)
    in.position[k] = {number<S>(by * std::sin(0.003 * i * (1.0 + 0.4 * static_cast<double>(k)))),
                      1000 + 1000 * static_cast<std::int64_t>(i), i, true};
  return in;
}

/// Momentum is M v; what carries it over is the kinetic energy's derivative by q, by duals.
void momentum() {
  using D = p::Dual<double, 8>;
  const auto c = p::coefficients(chain<double>());
  const auto d = p::coefficients(chain<D>());
  Random random(5);
  for (int run = 0; run < 50; ++run) {
    const double scale = run == 0 ? 0 : run < 5 ? 1e-9 : 1;
    double q[links] = {}, v[links] = {}, got[links], over[links];
    D dq[links], dv[links];
    for (std::size_t k = 0; k < 3; ++k) {
      q[k] = random.uniform(-3, 3);
      v[k] = scale * random.uniform(-4, 4);
      dq[k] = D(q[k]);
      dq[k].derivative.set(k, 1);
      dv[k] = D(v[k]);
    }
    p::TreePose<double, links> pose;
    p::place(c, q, pose);
    p::momentum(c, pose, v, got, over);
    p::SquareMatrix<double, links> m;
    p::mass_matrix(c, pose, m);
    const auto energy = p::energy(d, dq, dv);
    for (std::size_t k = 0; k < 3; ++k) {
      double wanted = 0;
      for (std::size_t l = 0; l < 3; ++l) wanted += m.at[k][l] * v[l];
      check(std::fabs(got[k] - wanted) <= 1e-12 * (scale + 1e-300), "p = M v");
      check(std::fabs(over[k] - energy.kinetic.derivative[k]) <= 1e-11 * (scale * scale + 1e-300), "C'v = dT/dq");
    }
    // The speed of a point, and what a force there is at joints, are the Jacobian's.
    const p::Vector3<double> point{0.1, -0.2, 0.3}, force{1, 2, -3}, moment{0.3, -0.1, 0.2};
    p::JacobianColumn<double> columns[links];
    p::jacobian(c, q, 3, point, columns);
    p::Placement<double> in_base[links];
    p::forward_kinematics(c, q, in_base);
    const auto f = in_base[3].rotation * force, t = in_base[3].rotation * moment;
    p::Vector3<double> velocity{0, 0, 0};
    double felt[links];
    p::felt_at_joints(c, pose, 3, point, force, moment, felt);
    for (std::size_t k = 0; k < 3; ++k) {
      velocity = velocity + columns[k].linear * v[k];
      const double wanted = p::dot(columns[k].linear, f) + p::dot(columns[k].angular, t);
      check(std::fabs(felt[k] - wanted) < 1e-12, "J'F");
    }
    const double speed = std::sqrt(p::dot(velocity, velocity));
    check(std::fabs(p::point_speed(c, pose, 3, point, v) - speed) <= 1e-13 * scale, "|J v|");
  }
}

/// A chain of one hinge is a joint, and its law the transparent one.
template <class S> void one_joint(double tolerance) {
  p::TransparentCompensationParams<S> of_joint;
  of_joint.body.inertia = number<S>(0.3);
  of_joint.body.gravity_sine = number<S>(4);
  of_joint.body.gravity_cosine = number<S>(-0.5);
  of_joint.body.offset = number<S>(0.1);
  auto& friction = of_joint.body.friction;
  friction.coulomb_positive = number<S>(0.4);
  friction.coulomb_negative = number<S>(0.3);
  friction.viscous_positive = friction.viscous_negative = number<S>(0.1);
  friction.load_motoring = friction.load_generating = number<S>(0.08);
  friction.velocity_width = number<S>(0.06);
  of_joint.friction_lead = number<S>(0.01);
  of_joint.energy_store = number<S>(0.5);
  of_joint.feedback.proportional = number<S>(1);
  of_joint.feedback.integral = number<S>(0.5);
  of_joint.feedback.limit = number<S>(3);
  of_joint.emg.share = number<S>(0.5);
  of_joint.emg.limb_gravity = number<S>(8);
  of_joint.emg.acceleration_limit = number<S>(25);
  of_joint.dither.torque = number<S>(0.3);
  of_joint.dither.frequency = number<S>(900);
  of_joint.gate = limits<S>();

  p::TreeCompensationParams<S, 1> of_tree;
  of_tree.tree.links = 1;
  of_tree.tree.gravity_x = number<S>(0);
  of_tree.tree.gravity_y = number<S>(-1);  // so that moments of mass are efforts
  of_tree.tree.gravity_z = number<S>(0);
  p::LinkParams<S>& link = of_tree.tree.link[0];
  link.rotor_inertia = number<S>(0.1);
  link.body.mass = number<S>(1);
  link.body.moment_y = number<S>(-4);
  link.body.moment_x = number<S>(-0.5);
  link.body.inertia_zz = number<S>(0.2);
  of_tree.drives.joint[0] = {of_joint.body.offset, friction, {}};
  of_tree.joint[0] = {of_joint.gravity_share, of_joint.friction_share, of_joint.inertia_share, of_joint.friction_lead,
                      of_joint.estimator,     of_joint.acceleration_limit, of_joint.energy_store, of_joint.feedback,
                      of_joint.emg,           of_joint.dither,         of_joint.gate};
  p::Controller<p::TransparentCompensation<S>> joint;
  p::TreeController<p::TreeCompensation<S, 1>> tree;
  check(p::configure(joint, of_joint), "the joint's law is sound");
  check(p::configure(tree, of_tree), "and the tree's");
  double worst = 0, largest = 0;
  for (std::uint32_t i = 0; i < 3000; ++i) {
    p::Samples<S> in;
    const std::int64_t now = 1000 + 1000 * static_cast<std::int64_t>(i);
    in.position = {number<S>(0.6 * std::sin(0.004 * i) + 0.1 * std::sin(0.013 * i)), now, i, i != 700};
    in.interaction = {number<S>(0.5 * std::sin(0.009 * i)), now, i, i > 500 && i < 2000};
    in.muscle = {number<S>(3 * std::sin(0.007 * i)), now, i, i > 1000};
    if (i == 700) in.position.valid = true;
    p::TreeSamples<S, 1> all;
    all.position[0] = in.position;
    all.interaction[0] = in.interaction;
    all.muscle[0] = in.muscle;
    const double a = static_cast<double>(p::step(joint, in, now));
    const double b = static_cast<double>(p::step(tree, all, now).effort[0]);
    worst = std::fmax(worst, std::fabs(a - b));
    largest = std::fmax(largest, std::fabs(a));
  }
  check(joint.fault == p::SafetyFault::none && tree.fault.fault == p::SafetyFault::none, "neither stopped");
  check(largest > 2, "and they did something");
  check(worst <= tolerance, "one joint of a tree is one joint");
}

/// Whatever is wrong with one joint, all efforts go to 0 together, and stay there.
template <class S> void together() {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  for (int what = 0; what < 6; ++what) {
    p::TreeController<p::TreeCompensation<S, links>> law;
    check(p::configure(law, law_params<S>()), "sound");
    p::TreeCommand<S, links> before;
    for (std::uint32_t i = 0; i < 600; ++i) {
      auto in = swung<S>(i);
      if (i == 400 && what == 0) in.position[1].value = nan;
      if (i == 400 && what == 1) in.position[2].valid = false;
      if (i == 400 && what == 2) in.position[0].time -= 900000;
      if (i >= 400 && what == 3) in.position[1].sequence = 399, in.position[1].time = 400000;
      if (i == 400 && what == 4) in.position[0].value = std::numeric_limits<S>::infinity();
      if (i == 400 && what == 5) p::stop(law);
      in.wrench.valid = true;
      in.wrench.time = in.position[2].time;
      in.wrench.sequence = i;
      in.wrench.force = {nan, nan, nan};  // a sensor that the law can do without
      const auto out = p::step(law, in, 1000 + 1000 * static_cast<std::int64_t>(i));
      for (std::size_t k = 0; k < 3; ++k) {
        check(std::isfinite(out.effort[k]) && std::fabs(out.effort[k]) <= S(60), "a number within the limit");
        if (i > 405) {
          check(std::fabs(out.effort[k]) <= std::fabs(before.effort[k]), "only ever closer to 0");
          const S one = out.effort[0] * before.effort[k], other = out.effort[k] * before.effort[0];
          check(std::fabs(one - other) <= S(1e-3) * std::fabs(one) + S(1e-4), "in proportion");
        }
      }
      if (i == 399) check(std::fabs(out.effort[0]) > S(0.1), "it carried something");
      before = out;
    }
    check(law.fault.fault != p::SafetyFault::none, "a fault");
    if (what < 5) check(law.fault.joint == (what == 0 || what == 3 ? 1u : what == 1 ? 2u : 0u), "of that joint");
    for (std::size_t k = 0; k < 3; ++k) check(before.effort[k] == S(0), "and it is off");
  }
}

/// Power and the speed of the end point are limits of all joints at once.
template <class S> void totals() {
  for (int what = 0; what < 2; ++what) {
    auto params = law_params<S>();
    if (what == 0) params.whole.power_limit = number<S>(0.5);
    else params.whole.speed_limit = number<S>(0.2);
    p::TreeController<p::TreeCompensation<S, links>> law;
    check(p::configure(law, params), "sound");
    for (std::uint32_t i = 0; i < 1000; ++i) {
      const auto out = p::step(law, swung<S>(i, 0.001 * i), 1000 + 1000 * static_cast<std::int64_t>(i));
      S power = 0;
      for (std::size_t k = 0; k < 3; ++k) power += out.effort[k] * law.state.joint[k].motion.velocity;
      if (what == 0 && law.fault.fault == p::SafetyFault::none) check(std::fabs(power) <= S(0.5001), "within the power");
      if (what == 1 && law.fault.fault == p::SafetyFault::none) check(law.state.end_speed <= S(0.2), "and the speed");
    }
    check(law.fault.fault == (what == 0 ? p::SafetyFault::power : p::SafetyFault::velocity), "then it stops");
    check(law.fault.joint == 3, "of the whole");
  }
}

/// Under a supervisor a healthy law passes to the bit; one joint's fault stops all, and a token starts them again.
template <class S> void supervised() {
  using L = p::TreeCompensation<S, links>;
  p::TreeSupervisorParams<S, links> rules;
  for (std::size_t k = 0; k < 3; ++k) {
    rules.joint[k].encoder.acceleration_limit = number<S>(5000);
    rules.joint[k].drive.expected = 1;
    rules.joint[k].drive.tolerance = number<S>(1);
    rules.joint[k].hold = {number<S>(5), number<S>(8)};
  }
  rules.whole.reset_delay = number<S>(0.02);
  rules.whole.healthy_samples = 10;
  const auto params = law_params<S>();
  for (int what = 0; what < 4; ++what) {
    p::TreeController<L> bare;
    p::TreeSupervised<L> law;
    p::configure(bare, params);
    check(p::configure(law, params, rules), "sound");
    p::TreeSupervisorOutput<S, links> out;
    bool once = false;
    for (std::uint32_t i = 0; i < 900; ++i) {
      const std::int64_t now = 1000 + 1000 * static_cast<std::int64_t>(i);
      auto in = swung<S>(i < 500 ? i : 500);
      for (std::size_t k = 0; k < 3; ++k) in.position[k].time = now, in.position[k].sequence = i;
      p::TreeFeedback<S, links> back;
      for (std::size_t k = 0; k < 3; ++k) back.drive[k] = {out.command.drive[k], now, i, true};
      if (i >= 400 && i < 450 && what == 1) in.position[1].value = in.position[1].value + S(0.3);
      if (i >= 400 && i < 450 && what == 2) back.drive[2].value = S(20);
      if (i == 400 && what == 3) p::stop(law);
      back.token = i == 700 ? out.challenge : 0;
      out = p::step(law, in, back, now);
      if (i < 400) {
        const auto plain = p::step(bare, in, now);
        for (std::size_t k = 0; k < 3; ++k) check(out.command.effort[k] == plain.effort[k], "to the bit");
        check(out.mode == p::Mode::running && out.enable[0] && out.enable[1] && out.enable[2], "all on");
      }
      for (std::size_t k = 0; k < 3; ++k) check(std::fabs(out.command.drive[k]) <= S(60), "within the limit, no NaN");
      if (i == 480 && what == 1) check(out.enable[0] && !out.enable[1] && out.enable[2], "the joint in doubt is off");
      if (i == 480 && what == 2) check(!out.enable[2] && out.enable[0], "so is a motor whose drive is");
      if (i == 480 && (what == 1 || what == 2)) check(out.mode == p::Mode::damped_stop, "the others are held");
      if (i == 480 && what == 3) check(out.enable[0] && out.enable[1] && out.enable[2], "all are held");
      once = once || p::is_stopped(out.mode);
    }
    check(once == (what != 0), "stopped where it had to be");
    if (what != 0) check(out.mode == p::Mode::running, "and went on after a token");
    const auto logged = p::logged(law.state, 0).fault;
    if (what == 1) check(logged.fault == p::SafetyFault::jump && logged.joint == 1, "a jump of the second");
    if (what == 2) check(logged.fault == p::SafetyFault::drive_stuck && logged.joint == 2, "a stuck third drive");
  }
}

/// Every bit of the law's numbers that is lost is found out within a second.
void memory() {
  using L = p::TreeCompensation<float, links>;
  p::TreeSupervised<L> law;
  const p::TreeSupervisorParams<float, links> rules;
  p::configure(law, law_params<float>(), rules);
  law.controller.law.drives.joint[2].friction.coulomb_positive += 0.1f;
  p::TreeSupervisorOutput<float, links> out;
  std::uint32_t i = 0;
  for (; i < 2000 && !p::is_stopped(out.mode == p::Mode::latched && i == 0 ? p::Mode::running : out.mode); ++i)
    out = p::step(law, swung<float>(i), {}, 1000 + 1000 * static_cast<std::int64_t>(i));
  check(i < 2000 && out.fault.fault == p::SafetyFault::integrity, "found out");
  check(!out.enable[0] && !out.enable[1] && !out.enable[2], "and all is off");
}

/// What nobody configured gives nothing.
void nothing() {
  p::TreeSupervised<p::TreeCompensation<float, links>> law;
  const auto out = p::step(law, swung<float>(1), {}, 1000);
  check(out.fault.fault == p::SafetyFault::not_started && out.command.effort[0] == 0.0f && !out.enable[0], "not started");
  auto params = law_params<float>();
  params.joint[1].gate.period = 0.002f;
  const p::TreeSupervisorParams<float, links> rules;
  check(!p::configure(law, params, rules), "two periods are none");
  const auto none = p::step(law, swung<float>(1), {}, 1000);
  check(none.fault.fault == p::SafetyFault::configuration && none.command.effort[0] == 0.0f, "nonsense is not run");
}

/// Commanded efforts pass the same gate: within limits and rates, and to 0 together where one is no number.
void commanded() {
  using C = p::CommandedTree<double, links>;
  p::TreeController<C> law;
  check(p::configure(law, law_params<double>()), "commanded");
  std::uint32_t i = 0;
  p::TreeCommand<double, links> out;
  const auto wait = [&](std::uint32_t periods) {
    for (const std::uint32_t end = i + periods; i < end; ++i) {
      p::TreeSamples<double, links> read;
      const std::int64_t now = 1000 + 1000 * static_cast<std::int64_t>(i);
      for (std::size_t k = 0; k < 3; ++k) read.position[k] = {0.1, now, i, true};
      out = p::step(law, read, now);
    }
  };
  wait(1);
  check(out.effort[0] == 0 && out.effort[1] == 0 && out.effort[2] == 0, "nothing before a command");
  law.state.command[0] = 1;
  law.state.command[1] = 1000;
  law.state.command[2] = -2;
  wait(1);
  check(out.effort[0] == 1 && out.effort[1] == 5 && out.effort[2] == -2, "no faster than the rate");
  wait(50);
  check(out.effort[0] == 1 && out.effort[1] == 60 && out.effort[2] == -2, "no more than the limit");
  check(law.state.weight[0] != 0 && law.fault.fault == p::SafetyFault::none, "the robot is known all the same");
  check(p::abs(law.state.observer.residual[1]) > 1, "and what the command does not explain is seen");
  law.state.command[2] = std::numeric_limits<double>::quiet_NaN();
  wait(1);
  check(law.fault.fault == p::SafetyFault::not_finite && law.fault.joint == 2 && out.effort[1] < 60, "no number");
  wait(50);
  check(out.effort[0] == 0 && out.effort[1] == 0 && out.effort[2] == 0, "all to 0");
  p::reset(law);
  check(law.state.command[1] == 0 && law.fault.fault == p::SafetyFault::none, "a reset forgets commands");
}

/// A number of joints that memory lost never goes beyond the room that there is.
void room_for_joints() {
  struct Gate {
    std::size_t joints;
  };
  for (std::size_t joints : {std::size_t(0), std::size_t(1), std::size_t(3), std::size_t(4), std::size_t(6), ~std::size_t(0)})
    for (std::size_t room = 1; room <= 5; ++room)
      check(p::joints_of(Gate{joints}, room) == (joints < room ? joints : room), "at most the room");
}

}  // namespace

int main() {
  room_for_joints();
  momentum();
  commanded();
  one_joint<double>(1e-12);
  one_joint<float>(2e-4);
  together<double>();
  together<float>();
  totals<double>();
  totals<float>();
  supervised<double>();
  supervised<float>();
  memory();
  nothing();
  return failures();
}
