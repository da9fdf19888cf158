// A robot and the limb in it: every real scalar, nonsense that comes in, and cuffs that hold both together.
#include "check.hpp"

#include <pellucid/worn_tree_plant.hpp>

#include <cmath>

namespace p = pellucid;

constexpr std::size_t most = 3;

template <class S> S number(double x) { return S(static_cast<p::value_t<S>>(x)); }

/// Two hinges that lift, one behind the other.
template <class S> void bodies(p::TreeParams<S, most>& tree, double length) {
  tree.links = 2;
  for (std::size_t i = 0; i < 2; ++i) {
    p::LinkParams<S>& link = tree.link[i];
    link.parent = static_cast<std::uint32_t>(i);
    link.axis_y = S(-1), link.axis_z = S(0);
    link.z = number<S>(i == 0 ? 0.0 : -length);
    const double m = 2.0, c = -0.14;
    const double body[10] = {m, 0.0, 0.0, m * c, m * (c * c + 0.01), 0.0, 0.0, m * (c * c + 0.01), 0.0, 0.004};
    S numbers[10];
    for (int k = 0; k < 10; ++k) numbers[k] = number<S>(body[k]);
    link.body = p::from_numbers<p::RigidBodyParams<S>>(numbers);
  }
}

template <class S> p::WornTreePlantParams<S, most> worn() {
  p::WornTreePlantParams<S, most> params;
  params.robot.period = number<S>(1e-3);
  bodies(params.robot.tree, 0.31);
  bodies(params.limb.tree, 0.30);
  for (std::size_t k = 0; k < 2; ++k) {
    params.servo[k] = {S(20), S(2), S(5), number<S>(0.5), S(50)};
    params.robot.drives.joint[k].friction.coulomb_positive = number<S>(0.2);
    params.robot.drives.joint[k].friction.coulomb_negative = number<S>(0.2);
  }
  params.reflex_delay = 50;
  params.cuffs = 2;
  for (std::uint32_t i = 0; i < 2; ++i) {
    p::CuffParams<S>& cuff = params.cuff[i];
    cuff.robot_link = cuff.limb_link = i + 1;
    cuff.robot_z = number<S>(-0.2), cuff.limb_z = number<S>(-0.19);
    cuff.stiffness_x = cuff.stiffness_y = cuff.stiffness_z = S(1500);
    cuff.damping_x = cuff.damping_y = cuff.damping_z = S(25);
    cuff.turning_stiffness = S(5), cuff.turning_damping = number<S>(0.1);
  }
  return params;
}

template <class S> void held_together() {
  const auto c = p::coefficients(worn<S>());
  check(c.valid && c.worn, "a robot and a limb");
  p::WornTreePlantState<S, most> state;
  const S start[most] = {number<S>(0.4), number<S>(0.9), S(0)};
  p::balance(c, start, start, state);
  p::WornTreePlantInput<S, most> input;
  for (std::size_t k = 0; k < 2; ++k) input.wanted[k] = start[k];
  for (int i = 0; i < 3000; ++i) p::step(c, state, input);
  for (std::size_t k = 0; k < 2; ++k) {
    check(std::abs(static_cast<double>(state.robot.position[k] - state.limb.position[k])) < 0.15, "in its cuffs");
    check(std::abs(static_cast<double>(state.limb.velocity[k])) < 1e-2, "and at rest");
  }
  p::CuffAction<S, most> action;
  p::act(c, state, action);
  check(static_cast<double>(action.limb[0]) < -1.0, "the wearer carries a robot that is off");
}

void nonsense() {
  auto params = worn<double>();
  params.cuff[1].robot_link = 7;
  check(!p::coefficients(params).valid, "a cuff on no link");
  const auto c = p::coefficients(params);
  p::WornTreePlantState<double, most> state;
  p::WornTreePlantInput<double, most> input;
  const double start[most] = {0.4, 0.9, 0.0};
  p::balance(c, start, start, state);
  for (int i = 0; i < 10; ++i) p::step(c, state, input);
  check(std::isfinite(state.robot.position[0]), "is no cuff");
  input.effort[0] = std::nan(""), input.wanted[1] = std::nan("");
  for (int i = 0; i < 10; ++i) p::step(c, state, input);
  check(std::isnan(state.robot.position[0]), "what is no number stays none, and ends");
}

void bare() {
  auto params = worn<double>();
  params.limb.tree.links = 0;
  const auto c = p::coefficients(params);
  check(c.valid && !c.worn, "a robot alone");
  p::WornTreePlantState<double, most> state;
  const double start[most] = {0.4, 0.9, 0.0};
  p::balance(c, start, start, state);
  p::WornTreePlantInput<double, most> input;
  p::gravity(c.robot.tree, start, input.effort);
  for (int i = 0; i < 1000; ++i) p::step(c, state, input);
  for (std::size_t k = 0; k < 2; ++k) check(state.robot.position[k] == start[k], "carried by its drives, to the bit");
}

int main() {
  held_together<double>();
  held_together<float>();
  nonsense();
  bare();
  return failures();
}
