// The plant: rest is rest, a frictionless joint keeps its energy, a run split in two is the same run, float is near.
#include "example.hpp"

namespace p = pellucid;

void does_not_creep() {
  Random random(8);
  for (int i = 0; i < 300; ++i) {
    auto params = example_plant<double>();
    params.joint = random_joint<double>(random);
    params.loop = {p::LoopKind::none, 0, 0, 0, 0, 0, 0, 1e-3};
    const auto c = p::coefficients(params);
    p::PlantState<double> state;
    const double q0 = state.position = random.uniform(-2, 2);
    const double held = params.joint.offset + p::gravity(c.joint, q0) - p::ripple(c.drive, q0);
    for (const double direction : {1.0, -1.0}) {
      const double level = p::breakaway(c.joint, p::gravity(c.joint, q0), direction);
      for (int k = 0; k < 2000; ++k) {
        const double share = k % 2 ? 0.999 : random.uniform(0, 0.999);
        const auto out = p::step<p::Friction::stiction>(
            c, state, p::PlantInput<double>{(held + direction * share * level) / 1.2, 0, 0, 0});
        check(out.position == q0 && out.velocity == 0 && out.acceleration == 0, "held to the bit");
      }
      const auto out = p::step<p::Friction::stiction>(
          c, state, p::PlantInput<double>{(held + direction * (1.001 * level + 1e-6)) / 1.2, 0, 0, 0});
      check(out.acceleration * direction > 0, "breaks away");
      state.position = q0;
      state.velocity = 0;
    }
  }
}

void comes_to_rest() {
  auto params = example_plant<double>();
  params.joint.gravity_sine = params.joint.gravity_cosine = params.joint.offset = 0;
  params.drive = {};
  params.loop = {p::LoopKind::none, 0, 0, 0, 0, 0, 0, 1e-3};
  const auto c = p::coefficients(params);
  p::PlantState<double> state;
  state.velocity = 3;
  for (int k = 0; k < 1000; ++k) p::step<p::Friction::stiction>(c, state, p::PlantInput<double>{});
  check(state.velocity == 0 && state.position > 0, "a coasting joint stops, and stays");
  const double rest = state.position;
  for (int k = 0; k < 1000; ++k) p::step<p::Friction::stiction>(c, state, p::PlantInput<double>{});
  check(state.position == rest, "where it stopped");
}

void keeps_energy() {
  // A pendulum without friction, in both modes: semi-implicit Euler's energy error stays of the order of its step.
  p::PlantParams<double> params;
  params.joint.inertia = 0.05;
  params.joint.gravity_sine = 1.5;
  params.loop.period = 1e-3;
  params.substeps = 10;
  const auto c = p::coefficients(params);
  p::PlantState<double> smooth, stiction;
  smooth.position = stiction.position = 1;
  const auto energy = [](const p::PlantState<double>& s) {
    return 0.025 * s.velocity * s.velocity - 1.5 * std::cos(s.position);
  };
  for (int k = 0; k < 20000; ++k) {
    p::step<p::Friction::smooth>(c, smooth, p::PlantInput<double>{});
    p::step<p::Friction::stiction>(c, stiction, p::PlantInput<double>{});
    check_close(energy(smooth), energy({1, 0, {}}), 1e-3, "energy");
    check(smooth.position == stiction.position && smooth.velocity == stiction.velocity,
          "no friction, no difference between modes");
  }
}

void resumes() {
  const auto c = p::coefficients(example_plant<double>());
  p::PlantState<double> whole, split;
  for (std::size_t k = 0; k < 400; ++k) {
    const p::PlantInput<double> input{reference_at(k), 0.1, -0.2, 1e-5};
    const auto a = p::step<p::Friction::smooth>(c, whole, input);
    const p::PlantState<double> saved = split;
    p::PlantState<double> copy = saved;
    const auto b = p::step<p::Friction::smooth>(p::coefficients(example_plant<double>()), copy, input);
    split = copy;
    check(a.position == b.position && a.command == b.command, "a run goes on from a saved state");
  }
}

void float_is_near() {
  const auto c = p::coefficients(example_plant<double>());
  const auto f = p::coefficients(example_plant<float>());
  p::PlantState<double> exact;
  p::PlantState<float> single;
  double worst_position = 0, worst_velocity = 0;
  for (std::size_t k = 0; k < 20000; ++k) {
    const auto a = p::step<p::Friction::smooth>(c, exact, p::PlantInput<double>{reference_at(k), 0, 0, 0});
    const auto b =
        p::step<p::Friction::smooth>(f, single, p::PlantInput<float>{static_cast<float>(reference_at(k)), 0, 0, 0});
    worst_position = std::fmax(worst_position, std::fabs(a.position - static_cast<double>(b.position)));
    worst_velocity = std::fmax(worst_velocity, std::fabs(a.velocity - static_cast<double>(b.velocity)));
  }
  std::printf("float against double over 20 s: %.2g rad, %.2g rad/s (encoder step 1e-4 rad)\n", worst_position,
              worst_velocity);
  check(worst_position < 5e-4 && worst_velocity < 2e-2, "float is near double");
}

template <class T> void total() {
  Random random(9);
  for (int i = 0; i < 3000; ++i) {
    p::PlantParams<T> params;
    T values[p::parameter_count];
    for (T& value : values) value = random.anything<T>();
    const auto any = [&random] { return random.anything<T>(); };
    params.joint = p::from_numbers<p::JointParams<T>>(values);
    params.drive = {any(), any(), any(), any(), any()};
    params.loop = {static_cast<p::LoopKind>(random.bits() % 6), any(), any(), any(), any(), any(),
                   static_cast<std::uint32_t>(random.bits()),   any()};
    params.encoder = {any()};
    params.substeps = static_cast<std::uint32_t>(random.bits() % 4);
    const auto c = p::coefficients(params);
    p::PlantState<T> state;
    for (int k = 0; k < 10; ++k) {
      p::step<p::Friction::smooth>(c, state, p::PlantInput<T>{any(), any(), any(), any()});
      p::step<p::Friction::stiction>(c, state, p::PlantInput<T>{any(), any(), any(), any()});
    }
  }
}

int main() {
  does_not_creep();
  comes_to_rest();
  keeps_energy();
  resumes();
  float_is_near();
  total<double>();
  total<float>();
  return failures();
}
