// What the numbers of a Params are, said once and where a program can walk it: name, unit, bounds, a sentence.
//
// A Params has a static `walk(params, visit)` that calls `visit(number, field)` for each of its numbers in the order
// that every array of them has. A default is what a Params has when it is made. Count, names, arrays, soundness, C
// structs, Python's faces and the documentation are all taken from that walk.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// An SI unit by its powers of effort (N m, or N where a joint is prismatic), coordinate (rad or m) and time (s); or
/// one that knows neither, as text.
struct Unit {
  float effort = 0;      ///< power
  float coordinate = 0;  ///< power
  float time = 0;        ///< power
  const char* own = nullptr;  ///< unit of a number that belongs to no joint, as text
};

namespace unit {
constexpr Unit one{};
constexpr Unit effort{1, 0, 0};
constexpr Unit effort_rate{1, 0, -1};
constexpr Unit energy{1, 1, 0};
constexpr Unit inertia{1, -1, 2};
constexpr Unit viscous{1, -1, 1};
constexpr Unit root_viscous{1, -0.5f, 0.5f};
constexpr Unit stiffness{1, -1, 0};
constexpr Unit mobility{-1, 1, -1};
constexpr Unit coordinate{0, 1, 0};
constexpr Unit wave_number{0, -1, 0};
constexpr Unit velocity{0, 1, -1};
constexpr Unit acceleration{0, 1, -2};
constexpr Unit time{0, 0, 1};
constexpr Unit rate{0, 0, -1};
constexpr Unit angle{0, 0, 0, "rad"};
constexpr Unit length{0, 0, 0, "m"};
constexpr Unit force{0, 0, 0, "N"};
constexpr Unit mass{0, 0, 0, "kg"};
constexpr Unit first_moment{0, 0, 0, "kg*m"};
constexpr Unit moment{0, 0, 0, "kg*m^2"};
}  // namespace unit

/// Admissible range of a number. NaN is never admissible, and infinity only where stated.
struct Bounds {
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  bool above = false;     ///< the lower end is outside
  bool below = false;     ///< the upper end is outside
  bool infinite = false;  ///< an infinity is a number too

  constexpr Bounds or_infinite() const noexcept { return {lower, upper, above, below, true}; }
};

constexpr Bounds any_number() noexcept { return {}; }
constexpr Bounds above(double lower) noexcept { return {lower, std::numeric_limits<double>::infinity(), true}; }
constexpr Bounds at_least(double lower) noexcept { return {lower, std::numeric_limits<double>::infinity()}; }
constexpr Bounds between(double lower, double upper) noexcept { return {lower, upper}; }
constexpr Bounds share() noexcept { return between(0, 1); }

/// Resistance of a coefficient of friction to a motion at speed |v| under a load |y|: |v|^speed |y|^load per unit.
struct Resists {
  bool at_all = false;    ///< false: the number is no coefficient of friction
  float speed = 0;        ///< power of the speed
  float load = 0;         ///< power of the load
  bool one_way = false;   ///< true: it acts in one of two directions, and another number acts in the other

  constexpr Resists only_one_way() const noexcept { return {at_all, speed, load, true}; }
};

namespace by {
constexpr Resists level{true, 0, 0};
constexpr Resists speed{true, 1, 0};
constexpr Resists root_of_speed{true, 0.5f, 0};
constexpr Resists load{true, 0, 1};
}  // namespace by

/// One number of a Params.
struct Field {
  const char* name;         ///< as arrays, C and Python have it, between what a walk around this one puts there
  Unit unit;                ///< SI
  Bounds bounds;            ///< where it may lie
  const char* sentence;     ///< description
  Resists resists{};        ///< how it resists, if it is a coefficient of friction
  const char* before = "";  ///< begins the name
  const char* after = "";   ///< ends the name
};

/// Every number of a Params, in order.
template <class P, class V> constexpr void walk(P& params, V&& visit) noexcept {
  std::remove_const_t<P>::walk(params, visit);
}

/// The numbers of a part whose names begin or end with more than their own.
template <class V> struct Renamed {
  V& visit;
  const char* before;
  const char* after;
  template <class T> constexpr void operator()(T& number, const Field& f) noexcept {
    visit(number, Field{f.name, f.unit, f.bounds, f.sentence, f.resists, before, after});
  }
};
template <class V> constexpr Renamed<V> prefixed(V& visit, const char* before) noexcept { return {visit, before, ""}; }
template <class V> constexpr Renamed<V> suffixed(V& visit, const char* after) noexcept { return {visit, "", after}; }

/// One number that stands in two places.
template <class V, class T> constexpr void both_are(V& visit, T& number, T& other, const Field& f) noexcept {
  visit(number, f);
  if constexpr (!std::is_const<T>::value) other = number;
}

namespace detail {
struct CountFields {
  std::size_t count = 0;
  template <class T> constexpr void operator()(T&, const Field&) noexcept { ++count; }
};
template <class P> constexpr std::size_t count_fields() noexcept {
  const P params{};
  CountFields visit;
  P::walk(params, visit);
  return visit.count;
}

template <class S> struct ReadFields {
  const S* at;
  constexpr void operator()(S& number, const Field&) noexcept { number = *at++; }
  /// Counts that a 32-bit integer cannot hold are none.
  constexpr void operator()(std::uint32_t& count, const Field&) noexcept {
    count = *at >= S(0) && *at <= S(1e6) ? static_cast<std::uint32_t>(*at) : 0;
    ++at;
  }
};
template <class S> struct WriteFields {
  S* at;
  constexpr void operator()(const S& number, const Field&) noexcept { *at++ = number; }
  constexpr void operator()(const std::uint32_t& count, const Field&) noexcept { *at++ = static_cast<S>(count); }
};

template <class S> constexpr bool lies_within(const Bounds& b, const S& x) noexcept {
  const S lower = static_cast<S>(b.lower), upper = static_cast<S>(b.upper);
  return (b.infinite || is_finite(x)) && (b.above ? x > lower : x >= lower) && (b.below ? x < upper : x <= upper);
}
struct SoundFields {
  bool sound = true;
  template <class S> constexpr void operator()(const S& number, const Field& f) noexcept {
    sound = sound && lies_within(f.bounds, number);
  }
  constexpr void operator()(const std::uint32_t&, const Field&) noexcept {}
};
}  // namespace detail

/// Number of parameters of a Params of scalar double.
template <class P> constexpr std::size_t field_count = detail::count_fields<P>();

/// A Params of its numbers, in order.
template <class P, class S> constexpr P from_numbers(const S* numbers) noexcept {
  P params{};
  detail::ReadFields<S> visit{numbers};
  P::walk(params, visit);
  return params;
}

/// The numbers of a Params, in order.
template <class P, class S> constexpr void to_numbers(const P& params, S* numbers) noexcept {
  detail::WriteFields<S> visit{numbers};
  P::walk(params, visit);
}

/// Whether every number lies where it may.
template <class P> constexpr bool is_sound(const P& params) noexcept {
  detail::SoundFields visit;
  P::walk(params, visit);
  return visit.sound;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
