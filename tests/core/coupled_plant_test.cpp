// The coupled plant: rest is rest, energy only falls, the strap pulls as it should, and nothing that comes in breaks it.
#include "example.hpp"

namespace p = pellucid;

template <class S> p::CoupledPlantParams<S> example_coupled() {
  p::CoupledPlantParams<S> params;
  params.motor_inertia = S(0.1);
  params.motor_friction = {
      {S(0.6), S(0.5), S(0.4), S(0.5), S(0.3), S(0.1), S(0.08), S(0.15)}, S(0.5), S(0.2), S(9), S(2)};
  params.spring_stiffness = S(170);
  params.spring_damping = S(0.1);
  params.orthosis = {S(0.05), S(1.5), S(0.05), S(0), {S(0.02), S(0.02), S(0.01), S(0.01)}};
  params.strap = {S(20), S(0.5)};
  params.limb = {S(0.3), S(8), S(0.05), S(0.15), S(1), S(-0.09), S(0.03)};
  params.loop = {S(1), S(3), S(0.01), S(25), S(30), S(171), 1, 3, S(2e-3)};
  params.motor_encoder = {S(2e-5)};
  params.output_encoder = {S(1e-4)};
  return params;
}

void strap_pulls() {
  const auto tight = p::coefficients(p::StrapParams<double>{20, 0.5, 0, 6, 0.1});
  check_close(p::torque(tight, 0.1, -1.0), 1.5, 1e-12, "spring and damper");
  check_close(p::torque(tight, 0.001, -1.0), -0.48, 1e-12, "the damper alone, whatever the stretch");
  const auto slack = p::coefficients(p::StrapParams<double>{20, 0.5, 0.2, 6, 0.1});
  check(p::torque(slack, 0.09, 5.0) == 0 && p::torque(slack, -0.09, -5.0) == 0, "nothing in the gap");
  check_close(p::torque(slack, 0.2, 1.0), 2.5, 1e-12, "beyond it");
  check(p::torque(slack, 0.11, -5.0) == 0, "does not hold back");
  check(p::slip_rate(tight, 5.9) == 0 && p::slip_rate(tight, -5.9) == 0, "holds");
  check_close(p::slip_rate(tight, 8.0), 0.2, 1e-12, "slips");
  check_close(p::slip_rate(tight, -7.0), -0.1, 1e-12, "slips back");
  check(std::isnan(p::torque(tight, std::nan(""), 0.0)) && std::isnan(p::torque(slack, 0.2, std::nan(""))), "NaN");
}

void strap_is_not_a_spring() {
  p::StrapParams<double> params{20, 0, 0.1, 6, 0.1, 0.2, 10, 0.5, 0.1, -0.05, 0.3};
  const auto c = p::coefficients(params);
  check_close(p::lasting_torque(c, 0.2), 20 * 0.2 * 4 / 3, 1e-12, "hardens");
  check_close(p::lasting_torque(c, p::stretch_under(c, 7.0)), 7.0, 1e-12, "stretched by what it carries");
  check_close(p::lasting_torque(c, p::stretch_under(c, -7e6)), -7e6, 1e-4, "however much that is");
  check_close(p::torque(c, 0.25, 0.0, 0.05), p::lasting_torque(c, 0.2) + 1.5, 1e-12, "what relaxes is beside it");
  check(p::torque(c, 0.06, 0.0, 0.05) == 0 && p::torque(c, 0.0, 0.0, 0.05) == 0, "and does not push");
  check(p::alignment(c, 0.3).limb == 0.3, "straight where it was put on");
  const double slope = (p::alignment(c, 0.9 + 1e-6).limb - p::alignment(c, 0.9 - 1e-6).limb) / 2e-6;
  check_close(p::alignment(c, 0.9).lever, slope, 1e-9, "the lever is the slope");
  check_close(p::alignment(c, p::robot_at(c, 0.9)).limb, 0.9, 1e-12, "where the robot is");
  p::StrapState<double> state;
  for (int i = 0; i < 3; ++i) p::advance(c, state, {0, 0, 0.25}, 1e9);
  check_close(state.flow, 0.2, 1e-8, "relaxed, and stable");
}

void limb_ends() {
  const auto c = p::coefficients(example_coupled<double>().limb);
  check_close(p::passive_torque(c, -0.09), 1.0, 1e-12, "at the stop");
  check_close(p::passive_torque(c, -0.06), std::exp(-1.0), 1e-12, "inside");
  check(p::passive_torque(c, 1.0) < 1e-15 && p::passive_torque(c, -100.0) < 150, "nothing far inside, no explosion");
  check_close(p::acceleration(c, 0.05, 0.0, 0.0) * 0.3, p::passive_torque(c, 0.05), 1e-12, "hangs ahead of its line");
}

void torque_loop_is_late_and_limited() {
  p::TorqueLoopParams<double> params{1, 0, 0, 25, 30, 170, 2, 1, 2e-3};
  auto c = p::coefficients(params);
  auto state = p::settled(0.0);
  check(p::step(c, state, 4.0, 0.0) == 0 && p::step(c, state, 4.0, 0.0) == 0, "two periods late");
  check_close(p::step(c, state, 4.0, 0.0), 8.0, 1e-12, "feed-forward and proportional");
  for (int i = 0; i < 3; ++i) p::step(c, state, 100.0, 0.0);
  check_close(p::step(c, state, 100.0, 0.0), 30.0, 1e-12, "the motor's limit");
  params.kp = 0;
  params.kd = 0.01;
  params.delay = 0;
  c = p::coefficients(params);
  state = p::settled(3.0);
  check_close(p::step(c, state, 100.0, 3.0), 25.0, 1e-12, "what may be asked for");
  check_close(p::step(c, state, 0.0, 3.2), -1.0, 1e-9, "damping by the torque's rate");
  params.kd = 0;
  params.ki = 10;
  c = p::coefficients(params);
  state = p::settled(0.0);
  for (int i = 0; i < 100000; ++i) p::step(c, state, 20.0, 0.0);
  check(c.ki * state.integral <= 10.1, "the integral waits at the limit");
  check(p::step(c, state, -20.0, 0.0) < 0, "and does not wind up");
}

void does_not_creep() {
  auto params = example_coupled<double>();
  params.limb.inertia = 1e9;
  params.loop.kp = params.loop.ki = params.loop.kd = 0;
  params.strap = {};
  const auto c = p::coefficients(params);
  Random random(5);
  for (int i = 0; i < 100; ++i) {
    const double position = random.uniform(-1.5, 1.5);
    const double load = p::gravity(c.orthosis, position);
    const auto start = p::balanced(c, position, load);
    const double share = p::coulomb_share(c.motor_friction, start.motor_position);
    for (const double direction : {1.0, -1.0}) {
      const double level = p::breakaway(c.motor_friction, share, load, direction);
      auto state = start;
      state.loop = p::settled(load);
      for (int k = 0; k < 500; ++k) {
        p::step(c, state, {load + direction * 0.999 * random.uniform() * level, 0, 0});
        check(state.motor_position == start.motor_position, "the motor holds");
        check(state.orthosis_position == start.orthosis_position, "so does the orthosis");
      }
      for (int k = 0; k < 3; ++k) p::step(c, state, {load + direction * 1.01 * level, 0, 0});
      check((state.motor_position - start.motor_position) * direction > 0, "breaks away");
    }
  }
}

void loses_energy() {
  auto params = example_coupled<double>();
  params.loop = {};
  params.loop.stiffness = 171;
  params.loop.period = 2e-3;
  params.substeps = 200;
  params.strap.slack = 0.05;
  params.limb.passive_torque = 0;
  const auto c = p::coefficients(params);
  auto state = p::balanced(c, 0.9, 0.0);
  state.limb_velocity = 2;
  const auto energy = [&] {
    const double twist = state.motor_position - state.orthosis_position;
    const double strap = std::fmax(std::fabs(state.limb_position - state.orthosis_position) - 0.025, 0);
    const auto half = [](double m, double v) { return 0.5 * m * v * v; };
    return half(0.1, state.motor_velocity) + half(0.05, state.orthosis_velocity) + half(0.3, state.limb_velocity) +
           half(170, twist) + half(20, strap) - 1.5 * std::cos(state.orthosis_position) +
           0.05 * std::sin(state.orthosis_position) - 8 * std::cos(state.limb_position - 0.05);
  };
  const double first = energy();
  double before = first;
  for (int k = 0; k < 10000; ++k) {
    // A loop without gains gives what is asked for: nothing.
    p::step(c, state, {0, 0, 0});
    const double now = energy();
    check(now <= before + 2e-5, "energy only falls");
    before = now;
  }
  check(before < first - 1, "and does fall");
  check(state.motor_velocity == 0, "until the motor rests");
}

template <class S> void runs(const char* name) {
  const auto c = p::coefficients(example_coupled<S>());
  auto state = p::balanced(c, S(0.3), S(0));
  p::CoupledPlantOutput<S> out;
  for (std::size_t k = 0; k < 300; ++k)
    out = p::step(c, state, p::CoupledPlantInput<S>{S(reference_at(k)), S(3), S(0)});
  check(p::all(p::is_finite(out.position)) && p::all(p::abs(out.strap_torque) > S(1e-3)), name);
}

void lanes_have_the_bits_of_one() {
  using L = p::Lanes<double, 4>;
  auto many = example_coupled<L>();
  const double slack[4] = {0, 0.02, 0.1, 0}, hold[4] = {0.1, 100, 0, 0.5}, mobility[4] = {0.1, 0.1, 0, 0.05},
               hardening[4] = {0, 0.1, -1, 0.3}, relaxing[4] = {0, 0, 15, 8}, along[4] = {0, 0.1, 0, -0.05},
               travel[4] = {1e-3, 0, 0, 3e-3};
  for (std::size_t l = 0; l < 4; ++l) {
    many.motor_friction.presliding.travel.set(l, travel[l]);
    many.strap.slack.set(l, slack[l]);
    many.strap.hold.set(l, hold[l]);
    many.strap.slip_mobility.set(l, mobility[l]);
    many.strap.hardening.set(l, hardening[l]);
    many.strap.relaxing_stiffness.set(l, relaxing[l]);
    many.strap.relaxation_time.set(l, 0.5);
    many.strap.along.set(l, along[l]);
  }
  const auto c = p::coefficients(many);
  for (std::size_t l = 0; l < 4; ++l) {
    auto one = example_coupled<double>();
    one.motor_friction.presliding.travel = travel[l];
    one.strap.slack = slack[l];
    one.strap.hold = hold[l];
    one.strap.slip_mobility = mobility[l];
    one.strap.hardening = hardening[l];
    one.strap.relaxing_stiffness = relaxing[l];
    one.strap.relaxation_time = 0.5;
    one.strap.along = along[l];
    const auto c1 = p::coefficients(one);
    auto states = p::balanced(c, L(0.3), L(0));
    auto state = p::balanced(c1, 0.3, 0.0);
    for (std::size_t k = 0; k < 500; ++k) {
      const double tau = 5 * reference_at(k);
      const auto a = p::step(c, states, p::CoupledPlantInput<L>{L(tau), L(3), L(0)});
      const auto b = p::step(c1, state, p::CoupledPlantInput<double>{tau, 3, 0});
      check(a.position[l] == b.position && states.strap.slip[l] == state.strap.slip, "a lane is as one");
    }
  }
}

template <class T> void total() {
  Random random(9);
  const auto any = [&random] { return random.anything<T>(); };
  for (int i = 0; i < 3000; ++i) {
    T values[p::coupled_parameter_count];
    for (T& value : values) value = any();
    auto params = p::from_numbers<p::CoupledPlantParams<T>>(values);
    params.loop.period = any();
    params.loop.delay = static_cast<std::uint32_t>(random.bits());
    params.loop.torque_span = static_cast<std::uint32_t>(random.bits());
    params.substeps = static_cast<std::uint32_t>(random.bits() % 4);
    const auto c = p::coefficients(params);
    auto state = p::balanced(c, any(), any());
    for (int k = 0; k < 10; ++k) p::step(c, state, p::CoupledPlantInput<T>{any(), any(), any()});
  }
}

int main() {
  strap_pulls();
  strap_is_not_a_spring();
  limb_ends();
  torque_loop_is_late_and_limited();
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
