// What a Params says of its numbers, for Python: names, descriptions, and a Params of an array.
#pragma once

#include "arrays.hpp"

#include <pellucid/fields.hpp>

#include <nanobind/stl/string.h>

namespace bindings {

/// effort, coordinate and time of a unit as powers, or the text of one that is no joint's.
inline nb::object dimension_of(const pellucid::Unit& unit) {
  if (unit.own != nullptr) return nb::str(unit.own);
  const auto power = [](float of) -> nb::object {
    const int whole = static_cast<int>(of);
    return static_cast<float>(whole) == of ? nb::object(nb::int_(whole)) : nb::object(nb::float_(of));
  };
  return nb::make_tuple(power(unit.effort), power(unit.coordinate), power(unit.time));
}

inline std::string name_of(const pellucid::Field& f) { return std::string(f.before) + f.name + f.after; }

/// Appends what a Params says of one number. Out of line, as is `append_name`: a Params has up to a hundred numbers, and
/// the walk would repeat the code for each of them.
[[gnu::noinline]] inline void append_field(nb::list& list, const pellucid::Field& f, double value, bool count) {
  nb::dict one;
  one["name"] = name_of(f);
  one["dimension"] = dimension_of(f.unit);
  one["default"] = value;
  one["lower"] = f.bounds.lower;
  one["upper"] = f.bounds.upper;
  one["above"] = f.bounds.above;
  one["below"] = f.bounds.below;
  one["infinite"] = f.bounds.infinite;
  one["count"] = count;
  one["sentence"] = f.sentence;
  if (f.resists.at_all) one["resists"] = nb::make_tuple(f.resists.speed, f.resists.load, f.resists.one_way);
  list.append(one);
}

/// Every number of a Params of doubles as a dictionary, in order.
template <class P> nb::list fields_of() {
  nb::list list;
  P params{};
  pellucid::walk(params, [&list](auto& number, const pellucid::Field& f) {
    append_field(list, f, static_cast<double>(number), std::is_integral<std::remove_reference_t<decltype(number)>>::value);
  });
  return list;
}

[[gnu::noinline]] inline void append_name(nb::list& list, const pellucid::Field& f) { list.append(name_of(f)); }

/// Their names alone.
template <class P> nb::tuple names_of() {
  nb::list list;
  P params{};
  pellucid::walk(params, [&list](auto&, const pellucid::Field& f) { append_name(list, f); });
  return nb::tuple(list);
}

/// A Params of scalar S of an array of its numbers.
template <class P, class S> P read_params(const char* name, nb::handle numbers) {
  constexpr std::size_t n = pellucid::field_count<P>;
  const Array array = read_array(name, numbers);
  array.expect(text({n}), {n});
  S values[n];
  for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<S>(array.data[i]);
  return pellucid::from_numbers<P>(values);
}

}  // namespace bindings
