// The core's list of control laws: by name, in either scalar, and as a Python class.
#pragma once

#include "fields.hpp"

#include <pellucid/laws.hpp>
#include <pellucid/supervisor.hpp>

#include <variant>

namespace bindings {

template <class... C> using OneOf = std::variant<std::monostate, C...>;
/// Any law behind its front; none is there too.
template <class S> using AnyLaw = pellucid::Laws::any<OneOf, pellucid::Controller, S>;

/// The same under its supervisor.
template <class S> using AnySupervised = pellucid::Laws::any<OneOf, pellucid::Supervised, S>;

/// A law of the list under its name, of its numbers. "none" is nothing.
template <class S> AnyLaw<S> read_law(const std::string& name, nb::handle parameters);
extern template AnyLaw<double> read_law<double>(const std::string&, nb::handle);
extern template AnyLaw<float> read_law<float>(const std::string&, nb::handle);

/// The same under a supervisor of its numbers, or under one that holds nothing against anybody. To be sealed where it lies.
template <class S> AnySupervised<S> read_supervised(const std::string& name, nb::handle parameters, nb::handle numbers);
extern template AnySupervised<double> read_supervised<double>(const std::string&, nb::handle, nb::handle);
extern template AnySupervised<float> read_supervised<float>(const std::string&, nb::handle, nb::handle);

/// Takes the checksums of a supervised law where it lies.
void seal_law(AnySupervised<double>& law);

/// f(controller) of whichever law it is; `otherwise` where there is none.
template <class R, class Any, class F> R of_law(Any& any, R otherwise, F f) {
  return std::visit(
      [&](auto& law) -> R {
        if constexpr (std::is_same<std::decay_t<decltype(law)>, std::monostate>::value) return otherwise;
        else return f(law);
      },
      any);
}

inline const char* fault_name(pellucid::SafetyFault fault) {
  return pellucid::safety_fault_names[static_cast<std::size_t>(fault)];
}

/// Law, law, laws, fuzz_law and time_law into the module.
void add_laws(nb::module_& m);

struct Nobody {
  template <class T> void operator()(const T&, const pellucid::Field&) const {}
};
template <class L, class = void> struct HasEstimates : std::false_type {};
template <class L>
struct HasEstimates<L, std::void_t<decltype(L::estimates(std::declval<const typename L::State&>(), Nobody()))>>
    : std::true_type {};

/// Estimates of a law in addition to its effort, by name; empty for a law without any.
template <class L, class State> nanobind::dict estimates_of(const State& state) {
  nanobind::dict found;
  if constexpr (HasEstimates<L>::value)
    L::estimates(state, [&found](const auto& x, const pellucid::Field& f) { found[f.name] = static_cast<double>(x); });
  return found;
}

}  // namespace bindings
