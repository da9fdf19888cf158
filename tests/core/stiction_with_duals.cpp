// Must not compile: stiction resets the velocity, and with it the derivative.
#include <pellucid/pellucid.hpp>

using Dual = pellucid::Dual<double, 8>;

Dual run() {
  const auto c = pellucid::coefficients(pellucid::PlantParams<Dual>{});
  pellucid::PlantState<Dual> state;
  return pellucid::step<pellucid::Friction::stiction>(c, state, pellucid::PlantInput<Dual>{}).position;
}
