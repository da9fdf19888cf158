// Drives of a tree and true stiction of several joints at once.
#include "check.hpp"

#include <pellucid/dual.hpp>
#include <pellucid/plant.hpp>
#include <pellucid/tree_plant.hpp>

namespace p = pellucid;

constexpr std::size_t most = 4;

template <class S> S number(double x) { return S(static_cast<p::value_t<S>>(x)); }

/// A shoulder of three axes and an elbow; the last motor turns with both of the last joints.
template <class S> p::TreePlantParams<S, most> arm(bool coupled, double width = 0) {
  p::TreePlantParams<S, most> params;
  params.period = number<S>(1e-3);
  params.substeps = 4;
  params.tree.links = 4;
  const double axes[4][3] = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}};
  for (std::size_t i = 0; i < 4; ++i) {
    p::LinkParams<S>& link = params.tree.link[i];
    link.parent = static_cast<std::uint32_t>(i);
    link.axis_x = number<S>(axes[i][0]), link.axis_y = number<S>(axes[i][1]), link.axis_z = number<S>(axes[i][2]);
    link.z = number<S>(i == 3 ? -0.3 : 0.0);
    link.rotor_inertia = number<S>(0.02);
    const double m = i < 2 ? 0.5 : 2.0, c = i < 2 ? 0.02 : 0.14;
    const double body[10] = {
        m,          0.02 * m, 0.01 * m, -c * m, m * (c * c + 0.003), 0.001 * m, 0.002 * m, m * (c * c + 0.003),
        0.0005 * m, 0.002 * m};
    S numbers[10];
    for (int k = 0; k < 10; ++k) numbers[k] = number<S>(body[k]);
    link.body = p::from_numbers<p::RigidBodyParams<S>>(numbers);
    p::TreeJointParams<S>& joint = params.drives.joint[i];
    joint.offset = number<S>(0.1);
    joint.friction.coulomb_positive = number<S>(0.6);
    joint.friction.coulomb_negative = number<S>(0.5);
    joint.friction.viscous_positive = joint.friction.viscous_negative = number<S>(0.3);
    joint.friction.stribeck = number<S>(0.2);
    joint.friction.stribeck_velocity = number<S>(0.1);
    joint.friction.load_motoring = number<S>(0.15);
    joint.friction.load_generating = number<S>(0.1);
    joint.friction.velocity_width = number<S>(width);
  }
  params.drives.coupled = coupled;
  for (std::size_t i = 0; i < 4; ++i) {
    params.drives.turns[i][i] = S(1);
    params.drives.motor[i].inertia = number<S>(i == 3 ? 0.01 : 0.0);
  }
  params.drives.turns[3][2] = S(1);
  p::FrictionParams<S>& wrist = params.drives.motor[3].friction;
  wrist.coulomb_positive = wrist.coulomb_negative = number<S>(0.4);
  wrist.viscous_positive = wrist.viscous_negative = number<S>(0.05);
  wrist.load_motoring = wrist.load_generating = number<S>(0.05);
  wrist.velocity_width = number<S>(width);
  return params;
}

template <class S> void inverse_of_inverse(double tolerance) {
  for (const bool coupled : {false, true}) {
    const auto c = p::coefficients(arm<S>(coupled, 0.05));
    check(c.valid, "an arm");
    Random random(2);
    for (int run = 0; run < 50; ++run) {
      S q[most], v[most], a[most], effort[most], back[most], none[most];
      for (std::size_t k = 0; k < most; ++k) {
        q[k] = number<S>(random.uniform(-2, 2)), v[k] = number<S>(random.uniform(-3, 3));
        a[k] = number<S>(random.uniform(-9, 9)), none[k] = S(0);
      }
      p::inverse_dynamics(c.tree, c.drives, q, v, a, effort);
      p::forward_dynamics(c.tree, c.drives, q, v, effort, none, back);
      for (std::size_t k = 0; k < most; ++k)
        check(p::all(p::abs(back[k] - a[k]) < number<S>(tolerance)), "forward of inverse");
    }
  }
}

/// How far one joint is from that of plant.hpp, at most, under an effort that swings so far.
double beside_one_joint(double amplitude, std::uint32_t substeps) {
  p::TreePlantParams<double, most> params;
  params.period = 1e-3, params.substeps = substeps;
  params.tree.links = 1;
  params.tree.gravity_z = -9.81;
  p::LinkParams<double>& link = params.tree.link[0];
  link.axis_x = 1, link.axis_y = 0, link.axis_z = 0;
  link.rotor_inertia = 0.05;
  link.body.mass = 1, link.body.moment_z = -0.2, link.body.inertia_xx = 0.1;
  params.drives.joint[0] = arm<double>(false).drives.joint[0];
  const auto tree = p::coefficients(params);
  p::PlantParams<double> plant;
  plant.joint.inertia = 0.15, plant.joint.gravity_sine = 0.2 * 9.81;
  plant.joint.offset = params.drives.joint[0].offset;
  plant.joint.friction = params.drives.joint[0].friction;
  plant.loop.kind = p::LoopKind::none, plant.loop.period = 1e-3, plant.loop.limit = 1e9;
  plant.substeps = substeps;
  const auto one = p::coefficients(plant);
  p::TreePlantState<double, most> state;
  p::PlantState<double> beside;
  double furthest = 0;
  int resting = 0, apart = 0;
  for (int k = 0; k < 6000; ++k) {
    p::TreePlantInput<double, most> input;
    input.effort[0] = amplitude * std::sin(2 * 3.14159 * 0.4 * k * 1e-3);
    p::step(tree, state, input);
    p::step<p::Friction::stiction>(one, beside, {input.effort[0], 0, 0, 0});
    furthest = std::fmax(furthest, std::fabs(state.position[0] - beside.position));
    resting += state.velocity[0] == 0;
    apart += (state.velocity[0] == 0) != (beside.velocity == 0);
  }
  check(resting > (amplitude < 2 ? 500 : 20) && resting < 5500, "it rests and moves");
  check(apart == 0, "it rests when the other rests");
  return furthest;
}

/// The same but where a joint turns back without a rest: there it feels the new friction at once, not a substep later.
void one_joint() {
  check(beside_one_joint(1.7, 4) < 1e-12, "the same");
  const double coarse = beside_one_joint(2.5, 4), fine = beside_one_joint(2.5, 64);
  check(coarse < 2e-3 && fine < coarse / 8, "closer with finer substeps");
}

/// Without motors nothing gains energy, and in the end all is still, to the bit, above where it would hang.
void comes_to_rest() {
  for (const bool coupled : {false, true}) {
    const auto c = p::coefficients(arm<double>(coupled));
    p::TreePlantState<double, most> state;
    const double q[4] = {0.5, -1.2, 0.8, 1.5}, v[4] = {1, -2, 0.5, 2};
    for (std::size_t k = 0; k < most; ++k) state.position[k] = q[k], state.velocity[k] = v[k];
    p::TreePlantInput<double, most> input;
    for (std::size_t k = 0; k < most; ++k) input.outside[k] = 0.1;  // what the offsets take
    auto sum = [&] {
      const auto e = p::energy(c.tree, state.position, state.velocity);
      const double motor =
          coupled ? 0.005 * (state.velocity[2] + state.velocity[3]) * (state.velocity[2] + state.velocity[3]) : 0;
      return e.kinetic + e.potential + motor;
    };
    double before = sum();
    for (int k = 0; k < 6000; ++k) {
      p::step(c, state, input);
      const double now = sum();
      check(now <= before + 2e-5, "no energy from nothing");
      before = now;
    }
    for (std::size_t k = 0; k < most; ++k) check(state.velocity[k] == 0, "still");
    const auto then = state;
    double weight[most], largest = 0;
    p::gravity(c.tree, state.position, weight);
    for (double w : weight) largest = std::fabs(w) > largest ? std::fabs(w) : largest;
    check(largest > 0.2, "friction holds a weight");
    for (int k = 0; k < 100; ++k) p::step(c, state, input);
    for (std::size_t k = 0; k < most; ++k) check(state.position[k] == then.position[k], "and stays, to the bit");
  }
}

/// Pushed by its motors below what they must overcome nothing moves; above, only what is pushed hard enough.
void breaks_away_alone() {
  auto params = arm<double>(false);
  params.tree.gravity_z = 0;
  for (auto& joint : params.drives.joint)
    joint.offset = 0, joint.friction.load_motoring = joint.friction.load_generating = 0;
  const auto c = p::coefficients(params);
  p::TreePlantState<double, most> state;
  p::TreePlantInput<double, most> input;
  const double below[4] = {0.79, -0.69, 0.79, -0.69};
  for (std::size_t k = 0; k < most; ++k) input.effort[k] = below[k];
  for (int k = 0; k < 200; ++k) p::step(c, state, input);
  for (std::size_t k = 0; k < most; ++k) check(state.position[k] == 0 && state.velocity[k] == 0, "nothing moves");
  input.effort[3] = 0.9;  // F_c + F_s is 0.8
  for (std::size_t k = 0; k < 3; ++k) input.effort[k] = 0;
  p::step(c, state, input);
  check(state.velocity[3] > 0 && state.velocity[0] == 0 && state.velocity[1] == 0 && state.velocity[2] == 0,
        "one slips");
  for (int k = 0; k < 300; ++k) p::step(c, state, input);
  check(state.velocity[3] > 0 && state.position[3] > 0.01, "and goes on");
}

/// Joints that give: an effort below the level strains them, and lets them back when it goes.
void gives() {
  auto params = arm<double>(false);
  params.tree.gravity_z = 0;
  params.substeps = 20;
  for (auto& joint : params.drives.joint) joint.offset = 0, joint.presliding.travel = 0.02;
  const auto c = p::coefficients(params);
  p::TreePlantState<double, most> state;
  p::TreePlantInput<double, most> input;
  const auto run = [&](double effort, int periods) {
    const double from = input.effort[1];
    for (int k = 0; k < periods; ++k) {
      input.effort[1] = from + (effort - from) * (k + 1) / periods;
      p::step(c, state, input);
    }
    return state.position[1];
  };
  const double strained = run(0.3, 2000), back = run(0.0, 2000), again = run(0.3, 2000);
  check(strained > 1e-4 && strained < 0.02, "it gives");
  check(back < 0.6 * strained, "it lets back");
  check_close(again, strained, 0.01 * strained, "a loop closes on itself");
  check(run(2.0, 500) > 0.05, "above the level it slips");
}

void lanes() {
  using L = p::Lanes<double, 4>;
  for (const bool coupled : {false, true}) {
    auto params = arm<double>(coupled);
    auto params_wide = arm<L>(coupled);
    params.elastic[1].motor_inertia = 0.02, params.elastic[1].transmission.stiffness = 100;
    params_wide.elastic[1].motor_inertia = L(0.02), params_wide.elastic[1].transmission.stiffness = L(100);
    const auto c = p::coefficients(params);
    const auto wide = p::coefficients(params_wide);
    p::TreePlantState<double, most> state[4];
    p::TreePlantState<L, most> states;
    for (int k = 0; k < 400; ++k) {
      p::TreePlantInput<L, most> inputs;
      for (std::size_t l = 0; l < 4; ++l) {
        p::TreePlantInput<double, most> input;
        for (std::size_t j = 0; j < most; ++j) {
          input.effort[j] = 1.5 * std::sin(0.01 * (k + 1) * double(j + 1) + double(l));
          inputs.effort[j].set(l, input.effort[j]);
        }
        p::step(c, state[l], input);
      }
      p::step(wide, states, inputs);
    }
    int resting = 0;
    for (std::size_t l = 0; l < 4; ++l)
      for (std::size_t j = 0; j < most; ++j) {
        check(state[l].position[j] == states.position[j][l] && state[l].velocity[j] == states.velocity[j][l], "bits");
        resting += state[l].velocity[j] == 0;
      }
    check(resting > 0, "some rest");
  }
}

/// Motors behind springs: energy stays but for the integrator's error, and stiff springs are none.
void elastic() {
  auto params = arm<double>(true);
  for (auto& joint : params.drives.joint) joint = {};
  for (auto& motor : params.drives.motor) motor = {};
  for (auto& spring : params.elastic) spring.motor_inertia = 0.05, spring.transmission.stiffness = 200;
  params.substeps = 20;
  const double q[4] = {0.5, -1.2, 0.8, 1.5}, none[4] = {};
  const auto worst = [&](std::uint32_t substeps) {
    params.substeps = substeps;
    const auto c = p::coefficients(params);
    auto state = p::balanced(c, q, none);
    double first = 0, furthest = 0;
    for (int k = 0; k < 1000; ++k) {
      const auto e = p::energy(c.tree, state.position, state.velocity);
      double sum = e.kinetic + e.potential, place[4];
      p::motor_motion(c.drives, 4, state.position, place);
      for (std::size_t i = 0; i < 4; ++i) {
        const double twist = state.motor[i].position - place[i], v = state.motor[i].velocity;
        sum += 0.5 * 200 * twist * twist + 0.5 * 0.05 * v * v;
      }
      if (k == 0) first = sum;
      furthest = std::fmax(furthest, std::fabs(sum - first));
      p::step(c, state, p::TreePlantInput<double, most>{});
    }
    return furthest;
  };
  const double coarse = worst(20), fine = worst(160);
  check(coarse < 0.01 && fine < coarse / 6, "energy stays, the closer the finer");

  // A motor behind a stiff spring is a rotor of its inertia, but that a joint's friction carries no motor's load.
  auto stiff = arm<double>(false);
  for (auto& joint : stiff.drives.joint) joint.friction.load_motoring = joint.friction.load_generating = 0;
  auto rigid = stiff;
  stiff.substeps = rigid.substeps = 100;
  for (std::size_t i = 0; i < 4; ++i) {
    stiff.elastic[i].motor_inertia = 0.05;
    stiff.elastic[i].transmission.stiffness = 2e5;
    stiff.elastic[i].transmission.damping = 20;
    rigid.tree.link[i].rotor_inertia += 0.05;
  }
  const auto a = p::coefficients(stiff), b = p::coefficients(rigid);
  auto one = p::balanced(a, q, none), other = p::balanced(b, q, none);
  p::TreePlantInput<double, most> input;
  for (int k = 0; k < 300; ++k) {
    for (std::size_t i = 0; i < 4; ++i) input.effort[i] = 4 * std::sin(0.03 * k * double(i + 1));
    p::step(a, one, input);
    p::step(b, other, input);
    for (std::size_t i = 0; i < 4; ++i) check_close(one.position[i], other.position[i], 1e-3, "as if it were rigid");
  }
  double moved = 0;
  for (std::size_t i = 0; i < 4; ++i) moved = std::fmax(moved, std::fabs(other.position[i] - q[i]));
  check(moved > 0.1, "and it moved");
}

void nonsense() {
  Random random(13);
  for (int run = 0; run < 300; ++run) {
    auto params = arm<double>(run % 2 == 0);
    params.drives.turns[random.bits() % 4][random.bits() % 4] = random.anything<double>();
    params.drives.joint[random.bits() % 4].friction.load_motoring = random.anything<double>();
    params.tree.link[random.bits() % 4].rotor_inertia = random.anything<double>();
    params.elastic[random.bits() % 4] = {random.anything<double>(), {}, {random.anything<double>(), 0, 0}};
    const auto c = p::coefficients(params);
    p::TreePlantState<double, most> state;
    p::TreePlantInput<double, most> input;
    for (std::size_t k = 0; k < most; ++k) {
      input.effort[k] = random.anything<double>();
      state.velocity[k] = random.anything<double>();
    }
    p::step(c, state, input);
  }
  auto params = arm<double>(true);
  params.drives.turns[3][3] = 0;
  check(!p::coefficients(params).valid, "motors that turn with one joint alone");
  params.drives.turns[2][3] = 1;  // joints 3 and 4 trade their motors: the largest pivot is below
  check(p::coefficients(params).valid, "that is a rotation");
}

int main() {
  inverse_of_inverse<double>(1e-8);
  inverse_of_inverse<float>(2e-1);
  inverse_of_inverse<p::Dual<double, 8>>(1e-8);
  inverse_of_inverse<p::Lanes<double, 8>>(1e-8);
  one_joint();
  comes_to_rest();
  breaks_away_alone();
  gives();
  lanes();
  elastic();
  nonsense();
  return failures() != 0;
}
