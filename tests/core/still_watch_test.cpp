// The watch that asks a joint at rest whether its encoder still reads.
#include "check.hpp"

#include <pellucid/still_watch.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

template <class S> void all() {
  const auto c = p::coefficients(p::StillWatchParams<S>{100, S(2), 25});
  check(c.valid != 0, "valid");
  for (const std::uint32_t half_wave : {7u, 8u, 200u, 201u}) {
    const bool fits = half_wave >= 8 && half_wave <= 200;
    check((p::coefficients(p::StillWatchParams<S>{100, S(2), half_wave}).valid != 0) == fits, "half a wave");
  }
  p::StillWatchState<S> s;
  S largest = S(0);
  for (std::uint32_t equal = 0; equal < 300; ++equal) {
    check(p::step(c, s, equal) == F::none, "not before three times");
    const S made = p::wave(c, s);
    check(p::abs(made) <= S(2), "within its amplitude");
    if (equal < 100) check(made == S(0), "a joint that moved lately is not asked");
    if (equal == 112) check(made > S(0.1) && made < S(0.4), "it grows");
    if (equal >= 200) largest = made > largest ? made : largest;
  }
  check(largest > S(1.99), "to all of it");
  check(p::step(c, s, 300) == F::frozen, "and then the encoder is frozen");
  check(p::step(c, s, 0) == F::none && p::wave(c, s) == S(0), "one change ends it");
  const auto off = p::coefficients(p::StillWatchParams<S>{});
  check(off.valid != 0 && p::step(off, s, 1000000) == F::none && p::wave(off, s) == S(0), "off");
  const auto weak = p::coefficients(p::StillWatchParams<S>{100, S(0), 25});
  check(p::step(weak, s, 1000000) == F::none, "without an effort nothing is asked, and nothing found");
  check(p::coefficients(p::StillWatchParams<S>{100, S(2), 7}).valid == 0, "a wave that is too short");
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
