// A controller as it runs on a microcontroller: float, C entry points. Its object may need none but a few symbols.
#include <pellucid/pellucid.hpp>

namespace p = pellucid;

namespace {
p::JointCoefficients<float> joint;
p::LoopCoefficients<float> loop;
p::LoopState<float> loop_state;
p::BiquadCoefficients<float> filter;
p::BiquadState<float> filter_state;
p::SafetyCoefficients<float> gate;
p::SafetyState<float> gate_state;
p::PlantCoefficients<float> plant;
p::PlantState<float> plant_state;
p::HillTorqueCoefficients<float, 4> hill;
p::HillTorqueState<float, 4, 256> hill_state;
}  // namespace

extern "C" {

void pellucid_configure(const p::PlantParams<float>* params, const p::SafetyParams<float>* limits) {
  plant = p::coefficients(*params);
  joint = plant.joint;
  loop = plant.loop;
  gate = p::coefficients(*limits);
  filter.count = 2;
}

float pellucid_step(float reference, float position, float acceleration, std::int64_t time, std::uint32_t sequence) {
  const float velocity = p::step(filter, filter_state, position);
  const float feedback = p::step(loop, loop_state, p::LoopInput<float>{reference, position, velocity});
  const float effort =
      p::inverse_dynamics(joint, position, velocity, acceleration) + feedback +
      p::log(p::abs(position)) * p::exp(-p::abs(velocity)) * p::sqrt(p::abs(reference)) * p::round(position);
  return p::step(gate, gate_state, p::SafetyInput<float>{effort, position, velocity, time, sequence, true});
}

float pellucid_simulate(float reference) {
  return p::step<p::Friction::stiction>(plant, plant_state, p::PlantInput<float>{reference, 0, 0, 0}).position +
         p::step<p::Friction::smooth>(plant, plant_state, p::PlantInput<float>{reference, 0, 0, 0}).effort;
}

void pellucid_configure_torque(const p::HillTorqueParams<float, 4>* params) { hill = p::coefficients<256>(*params); }

float pellucid_torque(const p::HillTorqueInput<float, 4>* input) { return p::step(hill, hill_state, *input); }

}  // extern "C"
