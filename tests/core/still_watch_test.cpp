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

/// The wave by its formula: it begins at the reading at which it is due, grows for as many periods, and stays as large.
template <class S> void wave_by_formula() {
  for (const std::uint32_t half_wave : {8u, 25u, 32u}) {
    p::StillWatchParams<S> params{40, S(2)};
    if (half_wave != 32) params.half_wave = half_wave;  // 32 periods, where nothing else is stated
    const auto c = p::coefficients(params);
    p::StillWatchState<S> s;
    for (std::uint32_t equal = 0; equal < 400; ++equal) {
      const F found = p::step(c, s, equal);
      check(found == (equal >= 120 ? F::frozen : F::none), "frozen after three times");
      const double n = equal < 40 ? 0 : equal - 39, size = 2 * (n < 40 ? n / 40 : 1);
      check_close(static_cast<double>(p::wave(c, s)), size * std::sin(3.141592653589793 * n / half_wave), 2e-4, "by its formula");
    }
  }
}

/// Memory that lost its amplitude asks no joint for more than is stated.
template <class S> void amplitudes_that_are_lost() {
  const auto c = p::coefficients(p::StillWatchParams<S>{40, S(2), 25});
  for (const S way : {S(-1), S(1)}) {
    check(p::wave(c, p::StillWatchState<S>{way, S(0), S(2)}) == way * S(2), "all of it");
    check(p::wave(c, p::StillWatchState<S>{way, S(0), S(1.9921875)}) == way * S(1.9921875), "as large as it is");
    for (const S more : {S(2.0078125), S(2.5), S(3.5), S(100)})
      check(p::wave(c, p::StillWatchState<S>{way, S(0), more}) == way * S(2), "and not more");
    for (const S none : {std::numeric_limits<S>::infinity(), std::numeric_limits<S>::quiet_NaN()})
      check(p::wave(c, p::StillWatchState<S>{way, S(0), none}) == S(0), "nor what is no number");
  }
}

/// Numbers without sense are not valid, and neither they nor those of no wave ask a joint.
template <class S> void senseless() {
  const S nan = std::numeric_limits<S>::quiet_NaN(), infinite = std::numeric_limits<S>::infinity();
  for (const S effort : {S(-1), nan, infinite}) {
    const auto c = p::coefficients(p::StillWatchParams<S>{40, effort, 25});
    check(c.valid == 0 && c.growth == S(0), "an effort that is none");
  }
  check(p::coefficients(p::StillWatchParams<S>{40, S(2), 7}).growth == S(0), "nothing grows where it makes no sense");
  const auto off = p::coefficients(p::StillWatchParams<S>{0, S(2), 25});
  p::StillWatchState<S> s;
  check(off.valid != 0 && off.growth == S(0), "a rest of no periods is no rest");
  for (std::uint32_t equal = 0; equal < 9; ++equal)
    check(p::step(off, s, equal) == F::none && p::wave(off, s) == S(0) && s.amplitude == S(0), "and asks nobody");
}

}  // namespace

int main() {
  wave_by_formula<double>();
  wave_by_formula<float>();
  amplitudes_that_are_lost<double>();
  amplitudes_that_are_lost<float>();
  senseless<double>();
  senseless<float>();
  all<double>();
  all<float>();
  return failures();
}
