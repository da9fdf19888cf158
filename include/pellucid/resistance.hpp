// The most that friction resists a motion by, from what each number of a Params is said to resist by.
//
//   r(v, y) = sum over (k, n) of (max over one-way terms of |c| + sum over the others of |c|) |v|^k |y|^n
//
// with c the coefficients that multiply the same powers of speed v and load y. Of numbers that act in one direction each
// only the larger counts, because a joint moves in one direction at a time. Every sum of friction, over the numbers of a
// law, a card or a body, is this one.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// x^k of x >= 0 and k >= 0; exact for k of 0 and 1, and the root itself for 0.5.
template <class S> S power(const S& x, float k) noexcept {
  S product(1);
  for (; k >= 1.0f; k -= 1.0f) product = product * x;
  if (k == 0.5f) return product * sqrt(x);
  return k > 0.0f ? (x > S(0) ? product * exp(static_cast<S>(k) * log(x)) : S(0)) : product;
}

/// Coefficients by the powers of speed and load that they multiply; at most N different powers.
template <class S, std::size_t N> struct ResistanceSums {
  Resists powers[N]{};    ///< one_way: whether some coefficient acts in one direction
  S larger[N]{};          ///< larger one of the coefficients that act in one direction
  S both[N]{};            ///< sum of those that act in both
  std::size_t count = 0;  ///< different powers

  /// Counts a coefficient; one without a role, or beyond N different powers, is left out.
  constexpr void add(const Resists& resists, const S& coefficient) noexcept {
    if (!resists.at_all) return;
    std::size_t i = 0;
    while (i < count && !(powers[i].speed == resists.speed && powers[i].load == resists.load)) ++i;
    if (i == N) return;
    if (i == count) powers[count++] = Resists{true, resists.speed, resists.load, false};
    const S size = coefficient < S(0) ? -coefficient : coefficient;
    if (resists.one_way) {
      powers[i].one_way = true;
      larger[i] = size > larger[i] ? size : larger[i];
    } else {
      both[i] = both[i] + size;
    }
  }
  constexpr void operator()(const S& number, const Field& f) noexcept { add(f.resists, number); }
  constexpr void operator()(const std::uint32_t&, const Field&) noexcept {}

  /// The coefficient of the powers i.
  constexpr S coefficient(std::size_t i) const noexcept { return both[i] + larger[i]; }

  /// r(v, y); powers with one-way terms are summed first.
  S at(const S& speed, const S& load) const noexcept {
    S total(0);
    for (int round = 0; round < 2; ++round)
      for (std::size_t i = 0; i < count; ++i)
        if (powers[i].one_way == (round == 0))
          total = total + coefficient(i) * power(speed, powers[i].speed) * power(load, powers[i].load);
    return total;
  }
};

/// The most that the friction of a Params resists by at a speed |v| under a load |y|.
template <class P, class S> S max_resistance(const P& params, const S& speed, const S& load) noexcept {
  ResistanceSums<S, field_count<P>> sums;
  P::walk(params, sums);
  return sums.at(speed, load);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
