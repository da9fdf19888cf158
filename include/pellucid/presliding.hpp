// Friction below slip: contacts give like springs before they slide, and remember where they were turned back.
//
// A Maxwell-slip model, Iwan's parallel elements of spring and slider (J. Applied Mechanics 33(4), 1966), as Lampaert,
// Swevers and Al-Bender brought it to drives (IEEE Trans. Automatic Control 47(4), 2002). Element i of N follows the
// motion until it is i / N of `travel` from rest, and is dragged from there on:
//   z_i <- clamp(z_i + N dq / travel, -i, i),   s = sum w_i z_i,   friction = level(v, load) s + F_v v.
// s takes the place of the sign of velocity; everything else of friction.hpp and gear_friction.hpp stays as it is. All
// springs are equal, w = 2 / N^2, but for the last, which is half as stiff: from rest s is then chords of the parabola
// 1 - (1 - x / travel)^2, within 1 / (4 N^2). It has one number, its slope falls evenly to none, and while the joint
// slips s is -1 or 1 to the bit.
//
// Of the two usual models this is the one that keeps its place: LuGre (Canudas de Wit et al., 1995) drifts under an
// effort that swings below the level, and forgets a turning point as soon as the motion turns again. Here a loop closes
// on itself, and after a period of such an effort the joint is where it was. LuGre is what the tests hold it against.
//
// Passive for a level that does not change: level travel / (2 N) sum w_i z_i^2 is stored, and level s' dq is at least
// what that grows by in every step, s' being that at its end. Not passive for a level that rises while the contact
// is bent (a load that grows, a speed that falls): a spring that stiffens under strain gives back more than it took.
//
// To add it to a plant: keep a PreslidingState; s = direction(c, state) at the start of a substep; friction in the
// direction s; the joint does not rest where c.gives; after q <- q + dq step(c, state, dq). Springs make the substep h
// finer: h sqrt(k / J) below 2 is stable, below 0.5 good, with k = (2 - 1 / N) level / travel of one body J. Below
// travel / N nothing but the joint's own viscous friction damps.
#pragma once

#include "friction.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// N, springs and sliders side by side; a power of two.
constexpr std::size_t presliding_elements = 8;

template <class S> struct PreslidingParams {
  S travel{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.travel, {"presliding_travel", unit::coordinate, at_least(0),
                     "x_s, way from rest over which friction builds up to its level; below 1e-9: it slips at once"});
  }
};

/// Travels below count as 0 [rad].
constexpr double smallest_travel = 1e-9;

/// Coefficients computed once from PreslidingParams.
template <class S> struct PreslidingCoefficients {
  S elements_per_travel{};  ///< N / travel [1/rad], 0 where it slips at once
  mask_t<S> gives{};        ///< whether it gives before it slips
  bool any_gives = false;   ///< in some lane
};

template <class S> PreslidingCoefficients<S> coefficients(const PreslidingParams<S>& params) noexcept {
  PreslidingCoefficients<S> c;
  c.gives = both(params.travel > S(smallest_travel), is_finite(params.travel));
  c.elements_per_travel =
      select(c.gives, S(static_cast<value_t<S>>(presliding_elements)) / select(c.gives, params.travel, S(1)), S(0));
  c.any_gives = any(c.gives);
  return c;
}

/// Starts without strain.
template <class S> struct PreslidingState {
  S strain[presliding_elements]{};  ///< z_i, -i to i
};

/// s, -1 to 1: what takes the place of the sign of velocity [1].
template <class S> S direction(const PreslidingState<S>& state) noexcept {
  constexpr value_t<S> n = static_cast<value_t<S>>(presliding_elements);
  S sum = state.strain[presliding_elements - 1] * value_t<S>(0.5);
  for (std::size_t i = 0; i + 1 < presliding_elements; ++i) sum = sum + state.strain[i];
  return sum * (2 / (n * n));  // a power of two: nothing is rounded
}

/// After a motion dq; one that is NaN is none, and an infinite one slips. Gives s.
template <class S> S step(const PreslidingCoefficients<S>& c, PreslidingState<S>& state, const S& motion) noexcept {
  const S way = c.elements_per_travel * select(motion == motion, motion, S(0));
  for (std::size_t i = 0; i < presliding_elements; ++i) {
    const S end = S(static_cast<value_t<S>>(i + 1));
    state.strain[i] = min(max(state.strain[i] + way, -end), end);
  }
  return direction(state);
}

/// The resistance at velocity v while contacts are bent as s says: level(v) s + F_v v, the level that of the sign of s
/// and F_v that of the sign of v.
template <class S, class R>
Resistance<S> bent_resistance(const FrictionCoefficients<S>& c, const R& velocity, const S& direction) noexcept {
  const S dry = level(c, velocity, direction) * direction + viscous(c, S(velocity)) * velocity;
  return {direction, c.any_root ? dry + c.square_root * signed_root(velocity, S(abs(velocity))) : dry};
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
