// A joint is simulated, and a control law carries it: prints how far it falls without the law and with it [rad].
#include <cstdio>
#include <initializer_list>
#include <pellucid/joint_compensation.hpp>
#include <pellucid/plant.hpp>
#include <pellucid/sample.hpp>

namespace p = pellucid;

int main() {
  p::PlantParams<double> joint;
  joint.joint.inertia = 0.05;
  joint.joint.gravity_sine = 1.5;
  joint.loop.period = 1e-3;
  joint.substeps = 10;
  p::JointCompensationParams<double> law;
  law.body = joint.joint;
  law.body.friction.velocity_width = 0.06;
  law.gravity_share = 1.0;
  law.bandwidth = 200.0;
  law.gate = {5, 250, 8, -1, 2.5, 0.05, 0.005, 2, 1e-3};
  const auto plant = p::coefficients(joint);
  const auto carrier = p::coefficients(law);
  for (const bool carried : {false, true}) {
    p::PlantState<double> state;
    p::JointCompensationState<double> memory;
    state.position = 0.5;
    for (int k = 1; k <= 300; ++k) {
      const double effort =
          p::step(carrier, memory, p::position_only<double>(state.position, std::int64_t(k) * 1000, std::uint32_t(k)));
      p::step<p::Friction::stiction>(plant, state, p::PlantInput<double>{carried ? effort : 0.0, 0, 0, 0});
    }
    std::printf("%.6f\n", 0.5 - state.position);
  }
}
