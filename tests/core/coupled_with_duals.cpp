// Must not compile: stiction resets the velocities, and with them the derivatives.
#include <pellucid/pellucid.hpp>

using Dual = pellucid::Dual<double, 8>;

Dual run() {
  const auto c = pellucid::coefficients(pellucid::CoupledPlantParams<Dual>{});
  pellucid::CoupledPlantState<Dual> state;
  return pellucid::step(c, state, pellucid::CoupledPlantInput<Dual>{}).position;
}
