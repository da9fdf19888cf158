// Whether a loop rings: an effort that goes to and fro faster than a person moves, lastingly.
//
// A loop whose gain has grown beyond what its delays bear swings by itself, within every limit of effort, speed and
// energy over time, and shakes whoever wears it. What it does between the motions of people and the dither of motors is
// averaged by its size.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct RingingWatchParams {
  S limit = S(std::numeric_limits<S>::infinity()), slowest = S(20), fastest = S(100), memory = S(3);

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.limit, {"ringing_limit", unit::effort, above(0).or_infinite(),
                    "mean size of what an effort does in the band; infinite: any"});
    visit(p.slowest, {"ringing_slowest", unit::rate, above(0),
                      "lower end of the band; people move more slowly. Times the period below 1"});
    visit(p.fastest, {"ringing_fastest", unit::rate, above(0),
                      "upper end of the band; dither is faster. Times the period below 1"});
    visit(p.memory, {"ringing_memory", unit::rate, above(0), "rate of the mean. Times the period below 1"});
  }
};

/// Coefficients computed once from RingingWatchParams and the period.
template <class S> struct RingingWatchCoefficients {
  S limit{};                ///< as it is [N m]
  S smoothing{};            ///< share of a new effort in the smooth one [1]
  S slowing{};              ///< share of the smooth one in the slow one [1]
  S forgetting{};           ///< share of a new size in the mean [1]
  std::uint32_t valid = 0;  ///< 1: the parameters make sense
};

template <class S> RingingWatchCoefficients<S> coefficients(const RingingWatchParams<S>& p, const S& period) noexcept {
  RingingWatchCoefficients<S> c{p.limit, p.fastest * period, p.slowest * period, p.memory * period, 0};
  c.valid = is_sound(p) && c.smoothing < S(1) && c.slowing < S(1) && c.forgetting < S(1) ? 1 : 0;
  return c;
}

template <class S> struct RingingWatchState {
  S smooth{};  ///< the effort without dither [N m]
  S slow{};    ///< slow part of the effort: what people do [N m]
  S size{};    ///< mean size of what lies between both [N m]
};

/// One period of an effort.
template <class S>
SafetyFault step(const RingingWatchCoefficients<S>& c, RingingWatchState<S>& s, const S& effort) noexcept {
  s.smooth = s.smooth + c.smoothing * (effort - s.smooth);
  s.slow = s.slow + c.slowing * (s.smooth - s.slow);
  s.size = s.size + c.forgetting * (abs(s.smooth - s.slow) - s.size);
  if (!is_finite(s.size)) s = {};
  return s.size <= c.limit ? SafetyFault::none : SafetyFault::ringing;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
