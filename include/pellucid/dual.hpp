// A number and its derivatives by N parameters, carried through the same program: exact Jacobians in the same pass.
//
// Forward mode: (x, x') with (f(x))' = f'(x) x'. Comparisons and select look at values alone.
#pragma once

#include "lanes.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// A value of type T and its N derivatives. T is double or float.
template <class T, std::size_t N = 8> struct Dual {
  static_assert(std::is_floating_point<T>::value, "the value of a Dual is double or float");
  using Derivative = Lanes<T, N>;

  T value{};                                 ///< x
  Derivative derivative = Derivative(T(0));  ///< dx / dp_i

  Dual() noexcept = default;
  /// A constant.
  template <class A, std::enable_if_t<std::is_arithmetic<A>::value, int> = 0> explicit Dual(A x) noexcept
      : value(static_cast<T>(x)) {}
  Dual(T x, const Derivative& dx) noexcept : value(x), derivative(dx) {}
  /// The parameter of number `index`: its derivative by itself is 1.
  static Dual parameter(T x, std::size_t index) noexcept {
    Dual result(x);
    result.derivative.set(index, T(1));
    return result;
  }

  friend Dual operator+(const Dual& a, const Dual& b) noexcept {
    return {a.value + b.value, a.derivative + b.derivative};
  }
  friend Dual operator-(const Dual& a, const Dual& b) noexcept {
    return {a.value - b.value, a.derivative - b.derivative};
  }
  friend Dual operator*(const Dual& a, const Dual& b) noexcept {
    return {a.value * b.value, a.derivative * b.value + b.derivative * a.value};
  }
  friend Dual operator/(const Dual& a, const Dual& b) noexcept {
    const T quotient = a.value / b.value;
    return {quotient, (a.derivative - b.derivative * quotient) * (T(1) / b.value)};
  }
  friend Dual operator-(const Dual& a) noexcept { return {-a.value, -a.derivative}; }

  friend Dual operator+(const Dual& a, T b) noexcept { return {a.value + b, a.derivative}; }
  friend Dual operator+(T a, const Dual& b) noexcept { return {a + b.value, b.derivative}; }
  friend Dual operator-(const Dual& a, T b) noexcept { return {a.value - b, a.derivative}; }
  friend Dual operator-(T a, const Dual& b) noexcept { return {a - b.value, -b.derivative}; }
  friend Dual operator*(const Dual& a, T b) noexcept { return {a.value * b, a.derivative * b}; }
  friend Dual operator*(T a, const Dual& b) noexcept { return {a * b.value, b.derivative * a}; }
  friend Dual operator/(const Dual& a, T b) noexcept { return {a.value / b, a.derivative * (T(1) / b)}; }

  friend bool operator<(const Dual& a, const Dual& b) noexcept { return a.value < b.value; }
  friend bool operator>(const Dual& a, const Dual& b) noexcept { return a.value > b.value; }
  friend bool operator<=(const Dual& a, const Dual& b) noexcept { return a.value <= b.value; }
  friend bool operator>=(const Dual& a, const Dual& b) noexcept { return a.value >= b.value; }
  friend bool operator==(const Dual& a, const Dual& b) noexcept { return a.value == b.value; }
  friend bool operator!=(const Dual& a, const Dual& b) noexcept { return a.value != b.value; }
};

template <class T, std::size_t N> struct ScalarTraits<Dual<T, N>> {
  using Value = T;
  using Real = T;
  using Mask = bool;
  static constexpr bool is_real = false;
};

template <class T, std::size_t N> Dual<T, N> select(bool mask, const Dual<T, N>& a, const Dual<T, N>& b) noexcept {
  return mask ? a : b;
}
template <class T, std::size_t N> T value_of(const Dual<T, N>& x) noexcept { return x.value; }
template <class T, std::size_t N> Dual<T, N> with_value(const Dual<T, N>& x, T value) noexcept {
  return {value, x.derivative};
}
template <class T, std::size_t N> bool is_identically_zero(const Dual<T, N>& x) noexcept {
  return x.value == T(0) && is_identically_zero(x.derivative);
}

/// |x|' = sign(x) x'
template <class T, std::size_t N> Dual<T, N> abs(const Dual<T, N>& x) noexcept {
  return {abs(x.value), x.derivative * sign(x.value)};
}
template <class T, std::size_t N> Dual<T, N> copysign(const Dual<T, N>& x, const Dual<T, N>& s) noexcept {
  const T value = copysign(x.value, s.value);
  return {value, x.derivative * (sign(x.value) * sign(value))};
}
/// A staircase: its derivative is 0 (with_value gives the mean slope instead).
template <class T, std::size_t N> Dual<T, N> round(const Dual<T, N>& x) noexcept { return Dual<T, N>(round(x.value)); }
template <class T, std::size_t N> Dual<T, N> sqrt(const Dual<T, N>& x) noexcept {
  const T root = sqrt(x.value);
  return {root, x.derivative * (T(0.5) / root)};
}
template <class T, std::size_t N> Dual<T, N> exp(const Dual<T, N>& x) noexcept {
  const T power = exp(x.value);
  return {power, x.derivative * power};
}
template <class T, std::size_t N> Dual<T, N> expm1(const Dual<T, N>& x) noexcept {
  const T less = expm1(x.value);
  return {less, x.derivative * (less + T(1))};
}
template <class T, std::size_t N> Dual<T, N> log(const Dual<T, N>& x) noexcept {
  return {log(x.value), x.derivative * (T(1) / x.value)};
}
template <class T, std::size_t N> Dual<T, N> tanh(const Dual<T, N>& x) noexcept {
  const T tangent = tanh(x.value);
  return {tangent, x.derivative * (T(1) - tangent * tangent)};
}
template <class T, std::size_t N> SinCos<Dual<T, N>> sincos(const Dual<T, N>& x) noexcept {
  const SinCos<T> at = sincos(x.value);
  return {{at.sin, x.derivative * at.cos}, {at.cos, x.derivative * (-at.sin)}};
}
template <class T, std::size_t N> Dual<T, N> sin(const Dual<T, N>& x) noexcept { return sincos(x).sin; }
template <class T, std::size_t N> Dual<T, N> cos(const Dual<T, N>& x) noexcept { return sincos(x).cos; }

}  // namespace PELLUCID_ABI
}  // namespace pellucid
