// The geared plant: rest is rest, energy only falls, every scalar runs it, and nothing that comes in can break it.
#include "example.hpp"

namespace p = pellucid;

template <class S> p::GearedPlantParams<S> example_geared() {
  p::GearedPlantParams<S> params;
  params.joint.link = {S(0.15), S(4), S(-0.5), S(0), {S(0.05), S(0.05), S(0.02), S(0.02)}};
  params.joint.motor_inertia = S(0.08);
  params.joint.transmission = {S(600), S(1), S(0.01)};
  params.joint.motor_friction = {
      {S(0.6), S(0.5), S(0.4), S(0.5), S(0.3), S(0.1), S(0.08), S(0.15)}, S(0.5), S(0.2), S(9), S(2)};
  params.drive = {S(1.2), S(0.05), S(0.02), S(14), S(0.3)};
  params.loop = {p::LoopKind::cascade, S(12), S(0.8), S(0), S(3), S(8), 2, S(1e-3)};
  params.encoder = {S(1e-4)};
  params.substeps = 5;
  return params;
}

void transmits() {
  const auto c = p::coefficients(p::TransmissionParams<double>{600, 2, 0.01});
  check(p::torque(c, 0.005, 3.0) == 0 && p::torque(c, -0.004, -3.0) == 0, "nothing in the gap");
  check_close(p::torque(c, 0.015, 1.0), 8.0, 1e-12, "spring and damper");
  check_close(p::torque(c, -0.015, 1.0), -4.0, 1e-12, "the other flank");
  check(p::torque(c, 0.015, -100.0) == 0 && p::torque(c, -0.015, 100.0) == 0, "never pulls");
  for (const double torque : {-7.0, 0.0, 3.0})
    check_close(p::torque(c, p::twist(c, torque), 0.0), torque, 1e-12, "twist");
  check(std::isnan(p::torque(c, std::nan(""), 0.0)), "NaN stays NaN");
}

void does_not_creep() {
  auto params = example_geared<double>();
  params.loop = {p::LoopKind::none, 0, 0, 0, 0, 0, 0, 1e-3};
  params.drive = {1, 0, 0, 0, 0};
  const auto c = p::coefficients(params);
  Random random(5);
  for (int i = 0; i < 100; ++i) {
    const auto start = p::balanced(c, random.uniform(-2, 2), 0.0);
    const double load = p::torque(c.transmission, start.motor_position - start.link_position, 0.0);
    const double share = p::coulomb_share(c.motor_friction, start.motor_position);
    for (const double direction : {1.0, -1.0}) {
      const double level = p::breakaway(c.motor_friction, share, load, direction);
      auto state = start;
      for (int k = 0; k < 1000; ++k) {
        p::step(c, state, p::PlantInput<double>{load + direction * 0.999 * random.uniform() * level, 0, 0.049, 0});
        check(state.motor_position == start.motor_position && state.link_position == start.link_position, "held");
        check(state.motor_velocity == 0 && state.link_velocity == 0, "at rest");
      }
      p::step(c, state, p::PlantInput<double>{load + direction * (1.001 * level), 0, 0, 0});
      check(state.motor_velocity * direction > 0, "breaks away");
    }
  }
}

void loses_energy() {
  auto params = example_geared<double>();
  params.loop = {p::LoopKind::none, 0, 0, 0, 0, 0, 0, 1e-3};
  params.drive = {};
  params.substeps = 200;
  const auto c = p::coefficients(params);
  auto state = p::balanced(c, 1.0, 2.0);
  const auto energy = [&] {
    const double twist = state.motor_position - state.link_position;
    const double stretch = std::fmax(std::fabs(twist) - 0.005, 0);
    return 0.04 * state.motor_velocity * state.motor_velocity + 0.075 * state.link_velocity * state.link_velocity +
           300 * stretch * stretch - 4 * std::cos(state.link_position) - 0.5 * std::sin(state.link_position);
  };
  const double first = energy();
  double before = first;
  for (int k = 0; k < 5000; ++k) {
    p::step(c, state, p::PlantInput<double>{});
    const double now = energy();
    check(now <= before + 1e-5, "energy only falls");
    before = now;
  }
  check(before < first - 0.1, "and does fall");
  check(state.motor_velocity == 0 && state.link_velocity == 0, "until both rest");
}

template <class S> void runs(const char* name) {
  const auto c = p::coefficients(example_geared<S>());
  auto state = p::balanced(c, S(0.1), S(0));
  p::GearedPlantOutput<S> out;
  for (std::size_t k = 0; k < 300; ++k) out = p::step(c, state, p::PlantInput<S>{S(reference_at(k)), S(0), S(0), S(0)});
  check(p::all(p::is_finite(out.link_position)) && p::all(p::abs(out.link_position) > S(1e-3)), name);
}

void lanes_have_the_bits_of_one() {
  using L = p::Lanes<double, 4>;
  auto many = example_geared<L>();
  const double coulomb[4] = {0, 0.3, 0.6, 2}, swing[4] = {0, 0.1, 0.3, 0}, decline[4] = {2, 0, 1, 0},
               travel[4] = {0, 3e-3, 1e-3, 0};
  for (std::size_t l = 0; l < 4; ++l) {
    many.joint.motor_friction.friction.coulomb_positive.set(l, coulomb[l]);
    many.joint.motor_friction.swing.set(l, swing[l]);
    many.joint.motor_friction.viscous_decline.set(l, decline[l]);
    many.joint.motor_friction.presliding.travel.set(l, travel[l]);
  }
  const auto c = p::coefficients(many);
  for (std::size_t l = 0; l < 4; ++l) {
    auto one = example_geared<double>();
    one.joint.motor_friction.friction.coulomb_positive = coulomb[l];
    one.joint.motor_friction.swing = swing[l];
    one.joint.motor_friction.viscous_decline = decline[l];
    one.joint.motor_friction.presliding.travel = travel[l];
    const auto c1 = p::coefficients(one);
    auto states = p::balanced(c, L(0.1), L(0));
    auto state = p::balanced(c1, 0.1, 0.0);
    for (std::size_t k = 0; k < 500; ++k) {
      const auto a = p::step(c, states, p::PlantInput<L>{L(reference_at(k)), L(0), L(0), L(0)});
      const auto b = p::step(c1, state, p::PlantInput<double>{reference_at(k), 0, 0, 0});
      check(a.link_position[l] == b.link_position && a.command[l] == b.command, "a lane is as one");
    }
  }
}

template <class T> void total() {
  Random random(9);
  const auto any = [&random] { return random.anything<T>(); };
  for (int i = 0; i < 3000; ++i) {
    p::GearedPlantParams<T> params;
    T values[p::geared_parameter_count];
    for (T& value : values) value = any();
    params.joint = p::from_numbers<p::GearedJointParams<T>>(values);
    params.drive = {any(), any(), any(), any(), any()};
    params.loop = {static_cast<p::LoopKind>(random.bits() % 6), any(), any(), any(), any(), any(),
                   static_cast<std::uint32_t>(random.bits()),   any()};
    params.encoder = {any()};
    params.substeps = static_cast<std::uint32_t>(random.bits() % 4);
    const auto c = p::coefficients(params);
    auto state = p::balanced(c, any(), any());
    for (int k = 0; k < 10; ++k) p::step(c, state, p::PlantInput<T>{any(), any(), any(), any()});
  }
}

int main() {
  transmits();
  does_not_creep();
  loses_energy();
  runs<double>("double");
  runs<float>("float");
  runs<p::Lanes<double, 2>>("2 lanes of double");
  runs<p::Lanes<double, 8>>("8 lanes of double");
  runs<p::Lanes<float, 16>>("16 lanes of float");
  lanes_have_the_bits_of_one();
  total<double>();
  total<float>();
  return failures();
}
