// Everything, instantiated with every scalar it is for.
#include "example.hpp"

namespace p = pellucid;

template <class S, p::Friction mode> void plant(const char* name) {
  const auto c = p::coefficients(example_plant<S>());
  p::PlantState<S> state;
  p::PlantOutput<S> out;
  for (std::size_t k = 0; k < 200; ++k)
    out = p::step<mode>(c, state, p::PlantInput<S>{S(reference_at(k)), S(0), S(0), S(0)});
  check(p::all(p::is_finite(out.position)) && p::all(p::abs(out.position) > S(1e-3)), name);
}

template <class S> void rest() {
  const auto joint = p::coefficients(example_joint<S>());
  const S effort = p::inverse_dynamics(joint, S(0.1), S(0.2), S(0.3));
  check(p::all(p::abs(p::forward_dynamics(joint, S(0.1), S(0.2), effort) - S(0.3)) < S(1e-4)), "joint");
  p::BiquadCoefficients<S> filter;
  filter.count = 1;
  p::BiquadState<S> memory;
  check(p::all(p::step(filter, memory, S(2)) == S(2)), "biquad");
  check(p::all(p::exp(p::log(S(2))) * p::sqrt(S(4)) < S(4.001)), "functions");
}

int main() {
  using p::Friction;
  plant<double, Friction::smooth>("double");
  plant<double, Friction::stiction>("double, stiction");
  plant<float, Friction::smooth>("float");
  plant<float, Friction::stiction>("float, stiction");
  plant<p::Dual<double, 8>, Friction::smooth>("Dual<double>");
  plant<p::Dual<float, 4>, Friction::smooth>("Dual<float>");
  plant<p::Lanes<double, 2>, Friction::smooth>("2 lanes of double");
  plant<p::Lanes<double, 8>, Friction::stiction>("8 lanes of double, stiction");
  plant<p::Lanes<float, 4>, Friction::smooth>("4 lanes of float");
  plant<p::Lanes<float, 16>, Friction::stiction>("16 lanes of float, stiction");
  rest<double>();
  rest<float>();
  rest<p::Dual<double, 8>>();
  rest<p::Lanes<double, 8>>();
  rest<p::Lanes<float, 8>>();
  return failures();
}
