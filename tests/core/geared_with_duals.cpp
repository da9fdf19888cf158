// Must not compile: stiction resets the velocities, and with them the derivatives.
#include <pellucid/pellucid.hpp>

using Dual = pellucid::Dual<double, 8>;

Dual run() {
  const auto c = pellucid::coefficients(pellucid::GearedPlantParams<Dual>{});
  pellucid::GearedPlantState<Dual> state;
  return pellucid::step(c, state, pellucid::PlantInput<Dual>{}).link_position;
}
