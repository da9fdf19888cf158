// W numbers that go through the same program at once, on the vector extensions of GCC and clang.
//
// Each lane gets exactly the operations a single number would get, so its bits are those of the scalar run.
// A Lanes of more numbers than one register holds is several registers: independent work for a pipelined processor.
#pragma once

#include "math.hpp"

#include <utility>

#if defined(__GNUC__) || defined(__clang__)

namespace pellucid {
inline namespace PELLUCID_ABI {
namespace detail {
#if defined(__AVX512F__)
constexpr std::size_t register_bytes = 64;
#elif defined(__AVX__)
constexpr std::size_t register_bytes = 32;
#else
constexpr std::size_t register_bytes = 16;
#endif
template <std::size_t bytes> constexpr std::size_t vector_bytes = bytes < register_bytes ? bytes : register_bytes;
}  // namespace detail

/// Result of a comparison of Lanes<T, W>: all bits set in the lanes where it is true.
template <class T, std::size_t W> struct Mask;

/// W numbers of type T (double or float; unsigned integers as their bit patterns).
template <class T, std::size_t W> struct Lanes {
  static_assert(W >= 1 && (W & (W - 1)) == 0, "the number of lanes is a power of two");
  static constexpr std::size_t bytes = detail::vector_bytes<W * sizeof(T)>;
  static constexpr std::size_t parts = W * sizeof(T) / bytes;
  static constexpr std::size_t per_part = bytes / sizeof(T);
  using Index = std::make_index_sequence<parts>;
  typedef T Vector __attribute__((vector_size(bytes)));

  Vector part[parts];  ///< the lanes, a register at a time

  Lanes() noexcept = default;
  /// The same number in every lane.
  template <class A, std::enable_if_t<std::is_arithmetic<A>::value, int> = 0> explicit Lanes(A x) noexcept
      : Lanes(make([x](std::size_t) { return static_cast<T>(x) - Vector{}; })) {}

  template <class F> static Lanes make(F f) noexcept { return make(f, Index{}); }
  template <class F, std::size_t... I> static Lanes make(F f, std::index_sequence<I...>) noexcept {
    Lanes result;
    ((result.part[I] = f(I)), ...);
    return result;
  }
  T operator[](std::size_t lane) const noexcept { return part[lane / per_part][lane % per_part]; }
  void set(std::size_t lane, T x) noexcept { part[lane / per_part][lane % per_part] = x; }

  friend Lanes operator+(const Lanes& a, const Lanes& b) noexcept {
    return make([&](std::size_t i) { return a.part[i] + b.part[i]; });
  }
  friend Lanes operator-(const Lanes& a, const Lanes& b) noexcept {
    return make([&](std::size_t i) { return a.part[i] - b.part[i]; });
  }
  friend Lanes operator*(const Lanes& a, const Lanes& b) noexcept {
    return make([&](std::size_t i) { return a.part[i] * b.part[i]; });
  }
  friend Lanes operator/(const Lanes& a, const Lanes& b) noexcept {
    return make([&](std::size_t i) { return a.part[i] / b.part[i]; });
  }
  friend Lanes operator*(const Lanes& a, T b) noexcept {
    return make([&](std::size_t i) { return a.part[i] * b; });
  }
  friend Lanes operator-(const Lanes& a) noexcept {
    return make([&](std::size_t i) { return -a.part[i]; });
  }

  friend Lanes operator&(const Lanes& a, const Lanes& b) noexcept {
    return make([&](std::size_t i) { return a.part[i] & b.part[i]; });
  }
  friend Lanes operator|(const Lanes& a, const Lanes& b) noexcept {
    return make([&](std::size_t i) { return a.part[i] | b.part[i]; });
  }
  friend Lanes operator^(const Lanes& a, const Lanes& b) noexcept {
    return make([&](std::size_t i) { return a.part[i] ^ b.part[i]; });
  }
  friend Lanes operator<<(const Lanes& a, int n) noexcept {
    return make([&](std::size_t i) { return a.part[i] << n; });
  }
  friend Lanes operator>>(const Lanes& a, int n) noexcept {
    return make([&](std::size_t i) { return a.part[i] >> n; });
  }

  friend Mask<T, W> operator<(const Lanes& a, const Lanes& b) noexcept {
    return Mask<T, W>::make([&](std::size_t i) { return a.part[i] < b.part[i]; });
  }
  friend Mask<T, W> operator>(const Lanes& a, const Lanes& b) noexcept {
    return Mask<T, W>::make([&](std::size_t i) { return a.part[i] > b.part[i]; });
  }
  friend Mask<T, W> operator<=(const Lanes& a, const Lanes& b) noexcept {
    return Mask<T, W>::make([&](std::size_t i) { return a.part[i] <= b.part[i]; });
  }
  friend Mask<T, W> operator>=(const Lanes& a, const Lanes& b) noexcept {
    return Mask<T, W>::make([&](std::size_t i) { return a.part[i] >= b.part[i]; });
  }
  friend Mask<T, W> operator==(const Lanes& a, const Lanes& b) noexcept {
    return Mask<T, W>::make([&](std::size_t i) { return a.part[i] == b.part[i]; });
  }
  friend Mask<T, W> operator!=(const Lanes& a, const Lanes& b) noexcept {
    return Mask<T, W>::make([&](std::size_t i) { return a.part[i] != b.part[i]; });
  }
};

template <class T, std::size_t W> struct Mask {
  using Vector = decltype(std::declval<typename Lanes<T, W>::Vector>() < std::declval<typename Lanes<T, W>::Vector>());
  static constexpr std::size_t parts = Lanes<T, W>::parts;

  Vector part[parts];  ///< one signed integer a lane: -1 true, 0 false

  Mask() noexcept = default;
  /// A mask over as many lanes of a type as wide: what the bits of a number say is said of the number.
  template <class U, std::enable_if_t<sizeof(U) == sizeof(T) && !std::is_same<U, T>::value, int> = 0>
  Mask(const Mask<U, W>& other) noexcept : Mask(make([&](std::size_t i) { return (Vector)other.part[i]; })) {}

  template <class F> static Mask make(F f) noexcept { return make(f, std::make_index_sequence<parts>{}); }
  template <class F, std::size_t... I> static Mask make(F f, std::index_sequence<I...>) noexcept {
    Mask result;
    ((result.part[I] = f(I)), ...);
    return result;
  }
  bool operator[](std::size_t lane) const noexcept {
    return part[lane / Lanes<T, W>::per_part][lane % Lanes<T, W>::per_part] != 0;
  }
  friend Mask both(const Mask& a, const Mask& b) noexcept {
    return make([&](std::size_t i) { return a.part[i] & b.part[i]; });
  }
  friend Mask either(const Mask& a, const Mask& b) noexcept {
    return make([&](std::size_t i) { return a.part[i] | b.part[i]; });
  }
  friend Mask operator!(const Mask& a) noexcept {
    return make([&](std::size_t i) { return ~a.part[i]; });
  }
};

template <class T, std::size_t W> struct ScalarTraits<Lanes<T, W>> {
  using Value = T;
  using Real = Lanes<T, W>;
  using Mask = pellucid::Mask<T, W>;
  using Bits = Lanes<std::conditional_t<sizeof(T) == 8, std::uint64_t, std::uint32_t>, W>;
  static constexpr bool is_real = true;
};

template <class S> struct is_lanes : std::false_type {};
template <class T, std::size_t W> struct is_lanes<Lanes<T, W>> : std::true_type {};
template <class S> using if_lanes = std::enable_if_t<is_lanes<S>::value, int>;

template <class T, std::size_t W> bool any(const Mask<T, W>& mask) noexcept {
  bool result = false;
  for (std::size_t i = 0; i < W; ++i) result = result || mask[i];
  return result;
}
template <class T, std::size_t W> bool all(const Mask<T, W>& mask) noexcept { return !any(!mask); }
template <class T, std::size_t W> bool is_identically_zero(const Lanes<T, W>& x) noexcept {
  return all(x == Lanes<T, W>(0));
}

template <class T, std::size_t W>
Lanes<T, W> select(const Mask<T, W>& mask, const Lanes<T, W>& a, const Lanes<T, W>& b) noexcept {
  return Lanes<T, W>::make([&](std::size_t i) { return mask.part[i] ? a.part[i] : b.part[i]; });
}
template <class T, std::size_t W> bits_t<Lanes<T, W>> bits_of(const Lanes<T, W>& x) noexcept {
  using B = bits_t<Lanes<T, W>>;
  return B::make([&](std::size_t i) { return (typename B::Vector)x.part[i]; });
}
template <class S, if_lanes<S> = 0> S from_bits(const bits_t<S>& bits) noexcept {
  return S::make([&](std::size_t i) { return (typename S::Vector)bits.part[i]; });
}
template <class T, std::size_t W> Lanes<T, W> abs(const Lanes<T, W>& x) noexcept {
  using B = bits_t<Lanes<T, W>>;
  return from_bits<Lanes<T, W>>(bits_of(x) & (~B(0) >> 1));
}
template <class T, std::size_t W> Lanes<T, W> operator~(const Lanes<T, W>& a) noexcept {
  return Lanes<T, W>::make([&](std::size_t i) { return ~a.part[i]; });
}
template <class T, std::size_t W> Lanes<T, W> copysign(const Lanes<T, W>& x, const Lanes<T, W>& s) noexcept {
  using B = bits_t<Lanes<T, W>>;
  const B magnitude = ~B(0) >> 1;
  return from_bits<Lanes<T, W>>((bits_of(x) & magnitude) | (bits_of(s) & ~magnitude));
}
template <class T, std::size_t W> Lanes<T, W> sqrt(const Lanes<T, W>& x) noexcept {
  Lanes<T, W> result;
  for (std::size_t i = 0; i < W; ++i) result.set(i, sqrt(x[i]));
  return result;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid

#endif  // __GNUC__ or __clang__
