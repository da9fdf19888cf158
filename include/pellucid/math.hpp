// The core's elementary functions: branch-free, total, the same bits on every machine and in every lane.
//
// std::exp and its like differ between C libraries and do not vectorise, so the core has its own. Every function
// is a template over real scalars: double, float and Lanes of them (lanes.hpp); Dual (dual.hpp) adds the chain rule.
// Only the sine and cosine of one double branch, for speed, and give the same bits as without branches.
// Polynomials are minimax, found with the Remez exchange in 50-digit arithmetic. The errors stated here, in units in
// the last place (ulp), are measured by tests/core/math_test.cpp against long double over the whole range.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

// Translation units built for different instruction sets name this differently, so that their code never mixes.
#ifndef PELLUCID_ABI
#define PELLUCID_ABI v1
#endif

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Traits of a scalar type S. Lanes and Dual specialise it.
template <class S> struct ScalarTraits {
  static_assert(std::is_same<S, double>::value || std::is_same<S, float>::value,
                "S must be double, float, Lanes or Dual");
  using Value = S;                                                                ///< the floating-point type inside
  using Real = S;                                                                 ///< S without its derivatives
  using Mask = bool;                                                              ///< result of a comparison
  using Bits = std::conditional_t<sizeof(S) == 8, std::uint64_t, std::uint32_t>;  ///< its bit pattern
  static constexpr bool is_real = true;                                           ///< false for Dual
};
template <class S> using value_t = typename ScalarTraits<S>::Value;
template <class S> using real_t = typename ScalarTraits<S>::Real;
template <class S> using mask_t = typename ScalarTraits<S>::Mask;
template <class S> using bits_t = typename ScalarTraits<S>::Bits;
template <class S> using if_floating = std::enable_if_t<std::is_floating_point<S>::value, int>;
template <class S> using if_real = std::enable_if_t<ScalarTraits<S>::is_real, int>;

// ---- what double and float need so that code for lanes reads the same for one number ----

/// mask ? a : b
template <class S, if_floating<S> = 0> constexpr S select(bool mask, S a, S b) noexcept { return mask ? a : b; }
constexpr bool any(bool mask) noexcept { return mask; }
constexpr bool all(bool mask) noexcept { return mask; }
constexpr bool both(bool a, bool b) noexcept { return a && b; }
constexpr bool either(bool a, bool b) noexcept { return a || b; }
/// x without its derivatives.
template <class S, if_real<S> = 0> constexpr S value_of(S x) noexcept { return x; }
/// `value` with the derivatives of x: for a staircase that is differentiated as its mean slope.
template <class S, if_real<S> = 0> constexpr S with_value(S, S value) noexcept { return value; }
/// True where x is 0 whatever the parameters are: 0 in every lane and in every derivative.
template <class S, if_floating<S> = 0> constexpr bool is_identically_zero(S x) noexcept { return x == S(0); }

template <class S, if_floating<S> = 0> bits_t<S> bits_of(S x) noexcept {
  bits_t<S> bits;
  __builtin_memcpy(&bits, &x, sizeof bits);
  return bits;
}
template <class S, if_floating<S> = 0> S from_bits(bits_t<S> bits) noexcept {
  S x;
  __builtin_memcpy(&x, &bits, sizeof x);
  return x;
}
template <class S, if_floating<S> = 0> S abs(S x) noexcept {
  return from_bits<S>(bits_of(x) & static_cast<bits_t<S>>(~bits_t<S>(0) >> 1));
}
/// |x| with the sign of s.
template <class S, if_floating<S> = 0> S copysign(S x, S s) noexcept {
  constexpr bits_t<S> magnitude = static_cast<bits_t<S>>(~bits_t<S>(0) >> 1);
  return from_bits<S>(static_cast<bits_t<S>>((bits_of(x) & magnitude) | (bits_of(s) & ~magnitude)));
}
inline double sqrt(double x) noexcept { return __builtin_sqrt(x); }
inline float sqrt(float x) noexcept { return __builtin_sqrtf(x); }

// ---- comparisons made into numbers ----

/// The smaller of a and b; b where either is NaN.
template <class S> S min(S a, S b) noexcept { return select(a < b, a, b); }
/// The larger of a and b; b where either is NaN.
template <class S> S max(S a, S b) noexcept { return select(a > b, a, b); }
/// x brought into [low, high]; NaN stays NaN.
template <class S> S clamp(S x, S low, S high) noexcept { return select(x < low, low, select(x > high, high, x)); }
/// -1, 0 or 1, with sign(0) = 0; 0 for NaN.
template <class S> S sign(S x) noexcept { return select(x > S(0), S(1), select(x < S(0), S(-1), S(0))); }
/// True where a and b are both positive or both negative (a b > 0, without underflow).
template <class S> mask_t<S> same_sign(S a, S b) noexcept {
  return either(both(a > S(0), b > S(0)), both(a < S(0), b < S(0)));
}
template <class S> mask_t<S> is_finite(S x) noexcept { return abs(x) <= S(std::numeric_limits<value_t<S>>::max()); }

namespace detail {

template <class T> struct Format;  // of an IEEE 754 number
template <> struct Format<double> {
  static constexpr int mantissa = 52;
  static constexpr std::uint64_t bias = 1023;
  static constexpr double integer = 4503599627370496.0;      // 2^52: from here on, every number is an integer
  static constexpr double rounder = 6755399441055744.0;      // 1.5 * 2^52: adding it rounds to an integer
  static constexpr std::uint64_t one = 0x3ff0000000000000u;  // 1
  static constexpr std::uint64_t sqrt_half = 0x3fe6a09e667f3bcdu;
  static constexpr double exp_min = -746.0, exp_max = 710.0;  // exp is 0, infinite beyond
  static constexpr double tanh_max = 20.0;                    // tanh is 1 beyond
  static constexpr double expm1_max = 709.0;                  // up to here one power of two scales e^x
  static constexpr double quarter_turns = 268435456.0;        // 2^28: what the reduction of sin and cos carries
  static constexpr double ln2[2] = {0.6931471803691238, 1.9082149292705877e-10};
  static constexpr double half_pi[5] = {1.5707963109016418, 1.5893254712295857e-08, 6.123233932053594e-17,
                                        6.368317055225283e-25, 1.082856673921914e-32};  // 25 bits each
  static constexpr double exp[10] = {0.16666666666666677,   0.04166666666666658,    0.008333333333322158,
                                     0.0013888888888942644, 0.00019841269884944283, 2.4801587198275015e-05,
                                     2.755724529230863e-06, 2.7557386992718014e-07, 2.5108687156538372e-08,
                                     2.087892944912792e-09};
  static constexpr double sin[6] = {-0.16666666666666632,  0.008333333333322413,    -0.00019841269829807808,
                                    2.755731369191808e-06, -2.5050758115276912e-08, 1.5896795653837948e-10};
  static constexpr double cos[6] = {0.0416666666666666,      -0.0013888888888874125, 2.4801587289482194e-05,
                                    -2.7557314352335047e-07, 2.087572327348275e-09,  -1.1359647814765908e-11};
  static constexpr double log[7] = {0.6666666666666734,  0.39999999999413965, 0.2857142874256181, 0.2222219855384012,
                                    0.18183565403617577, 0.15314021227342856, 0.14796259956538046};
};
template <> struct Format<float> {
  static constexpr int mantissa = 23;
  static constexpr std::uint32_t bias = 127;
  static constexpr float integer = 8388608.0f;
  static constexpr float rounder = 12582912.0f;
  static constexpr std::uint32_t one = 0x3f800000u;
  static constexpr std::uint32_t sqrt_half = 0x3f3504f3u;
  static constexpr float exp_min = -104.0f, exp_max = 89.0f;
  static constexpr float tanh_max = 10.0f;
  static constexpr float expm1_max = 88.0f;
  static constexpr float quarter_turns = 8192.0f;
  static constexpr float ln2[2] = {0.693115234375f, 3.1946184945309415e-05f};
  static constexpr float half_pi[5] = {1.5703125f, 0.0004837512969970703f, 7.549533620476723e-08f,
                                       2.5632829192545614e-12f, 6.123233995736766e-17f};  // 11 bits each
  static constexpr float exp[5] = {0.16666666f, 0.04166648f, 0.008333419f, 0.0013933253f, 0.00019824122f};
  static constexpr float sin[3] = {-0.16666655f, 0.008332178f, -0.00019517235f};
  static constexpr float cos[3] = {0.041666646f, -0.0013887367f, 2.443838e-05f};
  static constexpr float log[3] = {0.66666776f, 0.39977533f, 0.29871997f};
};

/// c[0] + c[1] x + ... + c[n-1] x^(n-1), by Estrin's pairs: half the depth of Horner's rule.
template <class S, class T> S polynomial(S x, const T (&c)[3]) noexcept {
  return (S(c[0]) + S(c[1]) * x) + S(c[2]) * (x * x);
}
template <class S, class T> S polynomial(S x, const T (&c)[5]) noexcept {
  const S x2 = x * x;
  return (S(c[0]) + S(c[1]) * x) + x2 * ((S(c[2]) + S(c[3]) * x) + S(c[4]) * x2);
}
template <class S, class T> S polynomial(S x, const T (&c)[6]) noexcept {
  const S x2 = x * x;
  return (S(c[0]) + S(c[1]) * x) + x2 * ((S(c[2]) + S(c[3]) * x) + x2 * (S(c[4]) + S(c[5]) * x));
}
template <class S, class T> S polynomial(S x, const T (&c)[7]) noexcept {
  const S x2 = x * x;
  return ((S(c[0]) + S(c[1]) * x) + x2 * (S(c[2]) + S(c[3]) * x)) +
         (x2 * x2) * ((S(c[4]) + S(c[5]) * x) + S(c[6]) * x2);
}
template <class S, class T> S polynomial(S x, const T (&c)[10]) noexcept {
  const S x2 = x * x;
  const S x4 = x2 * x2;
  return ((S(c[0]) + S(c[1]) * x) + x2 * (S(c[2]) + S(c[3]) * x)) +
         x4 * (((S(c[4]) + S(c[5]) * x) + x2 * (S(c[6]) + S(c[7]) * x)) + x4 * (S(c[8]) + S(c[9]) * x));
}

/// 2^n for an integer n given as n + rounder.
template <class S> S power_of_two(S n_plus_rounder) noexcept {
  using F = Format<value_t<S>>;
  return from_bits<S>((bits_of(n_plus_rounder) + bits_t<S>(F::bias)) << F::mantissa);
}

/// x = n ln 2 + r with |r| <= ln 2 / 2, and e^r - 1.
template <class S> struct ExpReduction {
  S n;      ///< a whole number
  S expm1;  ///< e^r - 1
};
template <class S> ExpReduction<S> reduce_exp(S x) noexcept {
  using F = Format<value_t<S>>;
  const S n = (x * S(1.4426950408889634) + S(F::rounder)) - S(F::rounder);
  const S r = (x - n * S(F::ln2[0])) - n * S(F::ln2[1]);
  const S r2 = r * r;
  return {n, r + (S(0.5) * r2 + (r2 * r) * polynomial(r, F::exp))};
}

}  // namespace detail

/// The nearest whole number, ties to even; NaN and infinities stay.
template <class S, if_real<S> = 0> S round(S x) noexcept {
  using F = detail::Format<value_t<S>>;
  const S magnitude = abs(x);
  const S rounded = (magnitude + S(F::integer)) - S(F::integer);
  return select(magnitude < S(F::integer), copysign(rounded, x), x);
}

/// e^x. Error below 1.1 ulp (double and float). exp(-inf) = 0, exp(inf) = inf, NaN stays NaN.
template <class S, if_real<S> = 0> S exp(S x) noexcept {
  using F = detail::Format<value_t<S>>;
  const auto reduced = detail::reduce_exp(clamp(x, S(F::exp_min), S(F::exp_max)));
  // 2^n in two factors, since n reaches below the smallest and above the largest exponent.
  const S half = reduced.n * S(0.5) + S(F::rounder);
  const S rest = (reduced.n - (half - S(F::rounder))) + S(F::rounder);
  return ((S(1) + reduced.expm1) * detail::power_of_two(half)) * detail::power_of_two(rest);
}

/// e^x - 1, without the cancellation near 0. Error below 2 ulp (double and float). -1 at -inf, infinite from 709 (88 in
/// float) on, NaN stays NaN.
template <class S, if_real<S> = 0> S expm1(S x) noexcept {
  using F = detail::Format<value_t<S>>;
  const auto reduced = detail::reduce_exp(clamp(x, S(-F::expm1_max), S(F::expm1_max)));
  const S scale = detail::power_of_two(reduced.n + S(F::rounder));
  const S result = scale * reduced.expm1 + (scale - S(1));
  return select(x > S(F::expm1_max), S(std::numeric_limits<value_t<S>>::infinity()), result);
}

/// tanh x = (e^2x - 1) / (e^2x + 1). Error below 2.6 ulp (double and float). NaN stays NaN.
template <class S, if_real<S> = 0> S tanh(S x) noexcept {
  using F = detail::Format<value_t<S>>;
  const S magnitude = abs(x);
  const auto reduced = detail::reduce_exp(S(2) * select(magnitude > S(F::tanh_max), S(F::tanh_max), magnitude));
  const S scale = detail::power_of_two(reduced.n + S(F::rounder));
  const S expm1 = scale * reduced.expm1 + (scale - S(1));
  return copysign(expm1 / (expm1 + S(2)), x);
}

/// Natural logarithm. Error below 1 ulp (double and float). log(0) = -inf, log(x < 0) = NaN, log(inf) = inf.
template <class S, if_real<S> = 0> S log(S x) noexcept {
  using T = value_t<S>;
  using F = detail::Format<T>;
  using B = bits_t<S>;
  const mask_t<S> subnormal = x < S(std::numeric_limits<T>::min());
  const S normal = select(subnormal, x * S(F::integer * T(2)), x);
  // normal = 2^k m with m in [sqrt(1/2), sqrt(2)).
  const B shifted = bits_of(normal) + B(F::one - F::sqrt_half);
  const S k = ((from_bits<S>((shifted >> F::mantissa) | bits_of(S(F::integer))) - S(F::integer)) - S(T(F::bias))) -
              select(subnormal, S(T(F::mantissa + 1)), S(0));
  const B fraction = shifted & B((decltype(F::one)(1) << F::mantissa) - 1);
  const S f = from_bits<S>(fraction + B(F::sqrt_half)) - S(1);
  // log(1 + f) = f - (f^2/2 - s (f^2/2 + R)) with s = f / (2 + f): what is rounded is small.
  const S s = f / (S(2) + f);
  const S z = s * s;
  const S half_square = S(0.5) * f * f;
  const S tail = s * (half_square + z * detail::polynomial(z, F::log));
  const S result = k * S(F::ln2[0]) - ((half_square - (tail + k * S(F::ln2[1]))) - f);
  const S infinity = S(std::numeric_limits<T>::infinity());
  const S finite = select(x < infinity, result, x);  // +inf and NaN
  return select(x > S(0), finite,
                select(x < S(0), S(std::numeric_limits<T>::quiet_NaN()), select(x == S(0), -infinity, x)));
}

/// The sine and the cosine of one angle.
template <class S> struct SinCos {
  S sin;  ///< sine [1]
  S cos;  ///< cosine [1]
};

namespace detail {

/// An angle as quarter turns and what is left: x = n pi/2 + r + rest, |r| <= pi/4. `exact`: n and the rest are 0.
template <class S, bool exact = false> struct QuarterTurns {
  S n;              ///< a whole number
  bits_t<S> turns;  ///< its lowest two bits are those of n
  S r, rest;        ///< [rad]
};

/// Split an angle, given its nearest number of quarter turns, plus Format::rounder.
template <class S> QuarterTurns<S> quarter_turns(S x, S quarter) noexcept {
  using F = Format<value_t<S>>;
  const S n = quarter - S(F::rounder);
  // The first two differences are exact, the third one's rounding error is kept in the rest.
  const S r2 = (x - n * S(F::half_pi[0])) - n * S(F::half_pi[1]);
  const S p3 = n * S(F::half_pi[2]);
  const S r = r2 - p3;
  const S back = r - r2;
  const S error = (r2 - (r - back)) - (p3 + back);
  return {n, bits_of(quarter), r, (error - n * S(F::half_pi[3])) - n * S(F::half_pi[4])};
}

/// sin(r + rest).
template <class S, bool exact> S sine_of_rest(const QuarterTurns<S, exact>& x) noexcept {
  const S z = x.r * x.r;
  const S beyond = (x.r * z) * polynomial(z, Format<value_t<S>>::sin);
  if constexpr (exact) return x.r + beyond;
  return x.r + (beyond + x.rest);
}
/// cos(r + rest).
template <class S, bool exact> S cosine_of_rest(const QuarterTurns<S, exact>& x) noexcept {
  const S z = x.r * x.r;
  const S half = S(0.5) * z;
  const S top = S(1) - half;
  const S beyond = (z * z) * polynomial(z, Format<value_t<S>>::cos);
  if constexpr (exact) return top + (((S(1) - top) - half) + beyond);
  return top + (((S(1) - top) - half) + (beyond - x.r * x.rest));
}

/// The sine of x shifted by a number of quarter turns (0: sine, 1: cosine), given sin(r + rest) or cos(r + rest).
template <class S, bool exact>
S signed_quarter(const QuarterTurns<S, exact>& x, int shift, S magnitude) noexcept {
  using T = value_t<S>;
  using B = bits_t<S>;
  constexpr int to_sign = int(sizeof(T)) * 8 - 2;
  const B sign = ((x.turns + B(static_cast<bits_t<T>>(shift))) & B(2)) << to_sign;
  return select(abs(x.n) <= S(Format<T>::quarter_turns), from_bits<S>(bits_of(magnitude) ^ sign),
                S(std::numeric_limits<T>::quiet_NaN()));
}

/// then(x in quarter turns). For one double it branches on the quadrants of a joint's angles, which a processor
/// predicts, so that a simulation does not wait for their count. The bits are equal.
template <class S, class Then> auto with_quarter_turns(S x, Then then) noexcept {
  using F = Format<value_t<S>>;
  if constexpr (std::is_same<S, double>::value) {
    if (x > -0.785 && x < 0.785) return then(QuarterTurns<S, true>{0.0, 0, x, 0.0});
    if (x > 0.786 && x < 2.356) return then(quarter_turns(x, F::rounder + 1.0));
    if (x < -0.786 && x > -2.356) return then(quarter_turns(x, F::rounder - 1.0));
  }
  return then(quarter_turns(x, x * S(0.6366197723675814) + S(F::rounder)));
}

/// sin (shift 0) or cos (shift 1) alone: one double computes one of the two polynomials.
template <class S> S sine_shifted(S x, int shift) noexcept {
  return with_quarter_turns(x, [shift](const auto& at) noexcept {
    const bits_t<S> turns = at.turns + bits_t<S>(static_cast<bits_t<value_t<S>>>(shift));
    const mask_t<S> swapped = (turns & bits_t<S>(1)) != bits_t<S>(0);
    if constexpr (std::is_same<S, double>::value)
      return signed_quarter(at, shift, swapped ? cosine_of_rest(at) : sine_of_rest(at));
    else
      return signed_quarter(at, shift, select(swapped, cosine_of_rest(at), sine_of_rest(at)));
  });
}

}  // namespace detail

/// sin x and cos x, x [rad]. Error below 1.1 ulp while |x| < 4.2e8 (double) or 1.2e4 (float); NaN beyond, where one
/// unit in the last place of x is already a visible angle, and for infinities.
template <class S, if_real<S> = 0> SinCos<S> sincos(S x) noexcept {
  return detail::with_quarter_turns(x, [](const auto& at) noexcept {
    const S sine = detail::sine_of_rest(at), cosine = detail::cosine_of_rest(at);
    const mask_t<S> odd = (at.turns & bits_t<S>(1)) != bits_t<S>(0);
    return SinCos<S>{detail::signed_quarter(at, 0, select(odd, cosine, sine)),
                     detail::signed_quarter(at, 1, select(odd, sine, cosine))};
  });
}
template <class S, if_real<S> = 0> S sin(S x) noexcept { return detail::sine_shifted(x, 0); }
template <class S, if_real<S> = 0> S cos(S x) noexcept { return detail::sine_shifted(x, 1); }

}  // namespace PELLUCID_ABI
}  // namespace pellucid
