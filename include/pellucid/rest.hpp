// Which of several joints stick: friction forces that stop what they can and resist what they cannot.
//
// A force p_i lies between low_i and high_i and acts on a velocity r_i = u_i + sum A_ik p_k, A symmetric and u the
// velocity unresisted. It is low where r_i > 0, high where r_i < 0, and between them only where r_i = 0: there the joint
// rests. That is where p'A p / 2 + u'p is least in the box, so with a positive definite A there is one answer. Each
// round goes through the joints one after another (Gauss and Seidel), then stops at once all that are between (Newton),
// cut off at the box's walls if that comes nearer, else up to the first wall. Rounds are counted: whatever comes in, it
// ends, and no force is ever more than friction can give.
#pragma once

#include "symmetric_solve.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Rounds at most. Drawn problems (tests/core/rest_test.cpp) take 1.3 on average and 4 at most with up to four joints,
/// 2.4 and 6 with up to twelve.
constexpr std::size_t rest_rounds = 24;

/// `box(i, p, low, high)` gives the bounds of p_i, which may hang on forces before it; p starts where one believes it.
/// `rests` becomes true where r_i is stopped.
template <class S, std::size_t N, class Box> void find_rest(const SquareMatrix<S, N>& a, std::size_t n,
                                                            const S* unresisted, Box box, S* p,
                                                            mask_t<S>* rests) noexcept {
  S r[N], low[N], high[N], step[N];
  mask_t<S> done = S(0) > S(0), between[N];
  const auto add = [&](std::size_t i) {
    S sum = unresisted[i];
    for (std::size_t k = 0; k < n; ++k) sum = sum + a.at[i][k] * p[k];
    return sum;
  };
  const auto bound = [&](std::size_t i) {
    box(i, p, low[i], high[i]);
    return min(max(p[i], low[i]), high[i]);  // low where p is NaN
  };
  for (std::size_t i = 0; i < n; ++i) {
    p[i] = bound(i);
    rests[i] = S(0) > S(0);
  }
  for (std::size_t round = 0; round < rest_rounds && !all(done); ++round) {
    for (std::size_t i = 0; i < n; ++i) {
      const S now = bound(i);
      const S wanted = now - add(i) / a.at[i][i];
      p[i] = select(done, p[i], min(max(wanted, low[i]), high[i]));
      between[i] = both(p[i] > low[i], p[i] < high[i]);
    }
    SquareMatrix<S, N> stopped;
    for (std::size_t i = 0; i < n; ++i) r[i] = add(i);
    for (std::size_t i = 0; i < n; ++i) {
      between[i] = both(between[i], a.at[i][i] > S(0));
      step[i] = select(between[i], -r[i], S(0));
      for (std::size_t k = 0; k < i; ++k) stopped.at[i][k] = select(both(between[i], between[k]), a.at[i][k], S(0));
      stopped.at[i][i] = select(between[i], a.at[i][i], S(1));
    }
    factorise_where_definite(stopped, n);
    solve(stopped, n, step);
    // The step cut off at the box's walls, if that comes nearer by step'(r + A step / 2); else up to the first wall.
    S aim[N], change = S(0), share = S(1);
    mask_t<S> whole = S(1) > S(0);
    for (std::size_t i = 0; i < n; ++i) {
      const S there = p[i] + step[i];
      whole = both(whole, either(!between[i], both(there > low[i], there < high[i])));
      aim[i] = min(max(there, low[i]), high[i]);
      const S way = aim[i] - p[i];
      share = select(both(between[i], abs(way) < share * abs(step[i])), way / step[i], share);
    }
    for (std::size_t i = 0; i < n; ++i) {
      S half = S(0);
      for (std::size_t k = 0; k < n; ++k) half = half + a.at[i][k] * (aim[k] - p[k]);
      change = change + (aim[i] - p[i]) * (r[i] + S(0.5) * half);
    }
    const mask_t<S> nearer = change <= S(0);
    for (std::size_t i = 0; i < n; ++i) {
      const S cut = min(max(p[i] + share * step[i], low[i]), high[i]);
      p[i] = select(done, p[i], select(nearer, aim[i], cut));
    }
    // Done where nothing at a bound would leave it.
    mask_t<S> settled = whole;
    for (std::size_t i = 0; i < n; ++i) {
      const S left = add(i);
      const mask_t<S> pushed = either(both(p[i] <= low[i], left >= S(0)), both(p[i] >= high[i], left <= S(0)));
      settled = both(settled, either(between[i], pushed));
      rests[i] = either(both(done, rests[i]), both(!done, both(both(p[i] > low[i], p[i] < high[i]), between[i])));
    }
    done = either(done, settled);
  }
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
