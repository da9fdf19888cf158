// The watch of an optional sensor: its range in both signs, its silence, and that it changes while the joint moves.
#include "check.hpp"

#include <pellucid/sensor_watch.hpp>

#include <initializer_list>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;

template <class S> p::Sample<S> said(S value, bool valid = true) { return {value, 0, 0, valid}; }

template <class S> void all() {
  p::SensorWatchParams<S> params{1, 6, S(2)};
  check(p::SensorWatchParams<S>{}.quiet_samples == 50 && p::SensorWatchParams<S>{}.expected == 0, "not asked for");
  p::SensorWatchState<S> s;
  for (const S way : {S(-1), S(1)}) {
    check(p::step(params, s, said(way * S(2)), true, F::muscle, 2) == F::none, "at the end of its range");
    check(p::step(params, s, said(way * S(2.0009765625)), true, F::muscle, 2) == F::muscle, "beyond");
    check(p::step(params, s, said(way * S(3)), true, F::force_sensor, 2) == F::force_sensor, "by its name");
  }
  check(s.value == S(2), "what is beyond its range is not remembered");
  // Silent: lost with the third look of two periods each.
  s = {};
  for (int k = 1; k <= 4; ++k)
    check(p::step(params, s, said(S(1), false), false, F::muscle, 2) == (k < 3 ? F::none : F::lost), "silent");
  check(s.quiet == 8 && s.value == S(0), "counted in periods, and not remembered");
  check(p::step(params, s, said(S(0.5)), false, F::muscle, 2) == F::none && s.quiet == 0, "until it speaks");
  check(p::step(params, s, said(std::numeric_limits<S>::quiet_NaN()), false, F::muscle, 3) == F::none && s.quiet == 3,
        "no number is silence");
  // The same value while the joint moves, and while it rests.
  s = {};
  p::step(params, s, said(S(1)), true, F::muscle, 2);
  check(s.quiet == 0 && s.value == S(1), "a new value");
  for (int k = 1; k <= 4; ++k)
    check(p::step(params, s, said(S(1)), true, F::muscle, 2) == (k < 3 ? F::none : F::lost), "the same in motion");
  for (int k = 1; k <= 9; ++k) check(p::step(params, s, said(S(1)), false, F::muscle, 2) == F::none, "the same at rest");
  check(s.quiet == 0, "at rest it may say the same");
  for (int k = 1; k <= 9; ++k)
    check(p::step(params, s, said(static_cast<S>(k)), true, F::muscle, 2) == (k <= 2 ? F::none : F::muscle), "changes");
  params.expected = 0;
  for (int k = 1; k <= 9; ++k) check(p::step(params, s, said(S(99), false), true, F::muscle, 2) == F::none, "not asked");
  check(p::step(params, s, said(S(99)), true, F::muscle, 2) == F::none, "whatever it says");
}

}  // namespace

int main() {
  all<double>();
  all<float>();
  return failures();
}
