// Whether the joint goes to and fro several times in a row, faster than anybody reaches: a wearer who shakes it, or a drive
// that adds an effort which its measurement does not show.
//
// Without a force sensor both are the same: whatever motion and command are, some torque of the wearer explains them. But
// people who reach rest between two movements, and what a blow, a spasm or a sudden stop leaves dies out. The position
// without its slow part, so that a reach under the shaking hides nothing of it,
//
//   x' = v - l x
//
// turns where it has come back by a share of the limit. The ways between its last turns, each within a time, and the way
// since then are compared: the smallest of the last `shaking_ways` has a limit, and a lower one if there are more. A way
// is no longer than the joint itself went that way: x also comes back to 0 after a single reach, while the joint rests.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Ways to and fro in a row that count as shaking: what a blow leaves makes three.
constexpr std::uint32_t shaking_ways = 4;
/// Ways in a row that count as shaking from a share of the limit on: of a wearer who holds against it.
constexpr std::uint32_t shaking_long_ways = 5;
constexpr double shaking_long_share = 0.55;
/// Way back after which the joint has turned, as a share of the limit.
constexpr double shaking_turn_share = 0.1;

template <class S> struct ShakingWatchParams {
  S limit = S(std::numeric_limits<S>::infinity()), time = S(0.33), slow = S(6);

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.limit, {"shaking_limit", unit::coordinate, above(0).or_infinite(),
                    "largest travel of an oscillation, from turn to turn; infinite: any"});
    visit(p.time, {"shaking_time", unit::time, above(0), "longest time of such a travel; a slower one is none"});
    visit(p.slow, {"shaking_slow", unit::rate, at_least(0),
                   "rate of the slow part of the position. Times the period below 1"});
  }
};

/// Coefficients computed once from ShakingWatchParams and the period.
template <class S> struct ShakingWatchCoefficients {
  S limit{};                ///< as it is [rad]
  S time{};                 ///< as it is [s]
  S turn{};                 ///< way back after which the joint has turned [rad]
  S period{};               ///< [s]
  S forgetting{};           ///< share of the position that a period takes for slow [1]
  std::uint32_t valid = 0;  ///< 1: the parameters make sense
};

template <class S> ShakingWatchCoefficients<S> coefficients(const ShakingWatchParams<S>& p, const S& period) noexcept {
  ShakingWatchCoefficients<S> c{p.limit, p.time, S(shaking_turn_share) * p.limit, period, p.slow * period, 0};
  c.valid = is_sound(p) && period > S(0) && c.forgetting < S(1) ? 1 : 0;
  return c;
}

template <class S> struct ShakingWatchState {
  S place{};                      ///< position without its slow part [rad]
  S turned{};                     ///< where it turned last [rad]
  S far{};                        ///< how far it has come since [rad]
  S moved{};                      ///< way of the joint itself since it turned [rad]
  S moved_far{};                  ///< the same, where it was farthest [rad]
  S age{};                        ///< time since it turned [s]
  S since{};                      ///< time since it was farthest [s]
  S travel[shaking_long_ways - 1]{};  ///< the ways before this one, the latest first [rad]
  S smallest{};                   ///< smallest of the last ways; of more over the share, if that is more [rad]
  S way = S(1);                   ///< direction since the last turn
};

/// How far the joint has come since its last turn, there and without its slow part: the smaller [rad].
template <class S> S length_of(const ShakingWatchState<S>& s) noexcept {
  return max(min(abs(s.far - s.turned), s.moved_far * s.way), S(0));
}

/// One period at a velocity.
template <class S>
SafetyFault step(const ShakingWatchCoefficients<S>& c, ShakingWatchState<S>& s, const S& velocity) noexcept {
  s.place = s.place + c.period * velocity - c.forgetting * s.place;
  s.moved = s.moved + c.period * velocity;
  s.age = min(s.age, c.time) + c.period;
  s.since = min(s.since, c.time) + c.period;
  if (!is_finite(s.place + s.turned + s.far + s.moved + s.moved_far + s.age + s.since) || !(abs(s.way) == S(1))) s = {};
  if ((s.place - s.far) * s.way > S(0)) {
    s.far = s.place;
    s.moved_far = s.moved;
    s.since = S(0);
  }
  if ((s.far - s.place) * s.way > c.turn) {
    for (std::uint32_t k = shaking_long_ways - 2; k > 0; --k) s.travel[k] = s.travel[k - 1];
    s.travel[0] = length_of(s);
    s.turned = s.far;
    s.far = s.place;
    s.moved_far = s.moved = s.moved - s.moved_far;
    s.way = -s.way;
    if (!(s.age <= c.time))
      for (S& past : s.travel) past = S(0);
    s.age = s.since;
    s.since = S(0);
  }
  S least = length_of(s);
  if (!(s.age <= c.time)) least = S(0);
  for (std::uint32_t k = 0; k < shaking_long_ways - 1; ++k) {
    S& past = s.travel[k];
    if (!(s.age <= c.time) || !is_finite(past)) past = S(0);
    least = min(least, past);
    if (k == shaking_ways - 2) s.smallest = least;
  }
  s.smallest = max(s.smallest, least / S(shaking_long_share));
  return s.smallest <= c.limit ? SafetyFault::none : SafetyFault::shaking;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
