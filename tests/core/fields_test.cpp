// Every Params that is walked: numbers go in and come out in one order, names differ, and defaults lie where they may.
#include "law_numbers.hpp"
#include "check.hpp"

#include <pellucid/pellucid.hpp>

namespace p = pellucid;

template <class P> void walks() {
  constexpr std::size_t n = p::field_count<P>;
  double in[n], out[n];
  char names[n][64] = {};
  for (std::size_t i = 0; i < n; ++i) in[i] = static_cast<double>(i + 1);
  P params = p::from_numbers<P>(in);
  p::to_numbers(params, out);
  for (std::size_t i = 0; i < n; ++i) check(in[i] == out[i], "what goes in comes out");
  std::size_t i = 0;
  p::walk(params, [&](auto&, const p::Field& f) {
    std::strcat(std::strcat(std::strcat(names[i], f.before), f.name), f.after);
    check(f.sentence[0] != 0 && f.bounds.lower <= f.bounds.upper, names[i]);
    for (std::size_t j = 0; j < i; ++j) check(std::strcmp(names[i], names[j]) != 0, names[i]);
    ++i;
  });
  check(i == n, "all of them");
}

int main() {
  walks<p::JointParams<double>>();
  walks<p::GearedJointParams<double>>();
  walks<p::CoupledPlantParams<double>>();
  walks<p::ReachingParams<double>>();
  walks<p::PosturalParams<double>>();
  walks<p::OptimalReachingParams<double>>();
  walks<p::EmgMuscleParams<double>>();
  walks<p::StrapEstimatorParams<double>>();
  p::Laws::for_each([](auto of) {
    using L = typename decltype(of)::template law<double>;
    using F = typename decltype(of)::template law<float>;
    walks<typename L::Params>();
    check(p::coefficients(typical_params<typename L::Params>()).gate.valid, L::name);
    check(p::coefficients(typical_params<typename F::Params>()).gate.valid, F::name);
    check(L::sensors[0].quantity == p::Quantity::position && L::sensors[0].required, "the position first");
  });
  check(p::field_count<p::JointParams<double>> >= 13, "a joint is thirteen numbers at least");
  const p::Bounds open = p::above(0), shut = p::between(0, 1);
  check(!p::detail::lies_within(open, 0.0) && p::detail::lies_within(open, 1e-300), "an end that is outside");
  check(p::detail::lies_within(shut, 1.0f) && !p::detail::lies_within(shut, std::nanf("")), "NaN lies nowhere");
  check(!p::detail::lies_within(open, std::numeric_limits<double>::infinity()), "infinity is a number only where it is said");
  check(p::detail::lies_within(open.or_infinite(), std::numeric_limits<float>::infinity()), "and there it is");
  return failures();
}
