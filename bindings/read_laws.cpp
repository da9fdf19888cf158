// Laws of the core's list, made of the numbers that Python gives. All units that take a law by its name share these.
#include "laws.hpp"

namespace bindings {

template <class S> AnyLaw<S> read_law(const std::string& name, nb::handle parameters) {
  AnyLaw<S> found;
  std::string known = "\"none\"";
  bool is_known = name == "none";
  pellucid::Laws::for_each([&](auto of) {
    using L = typename decltype(of)::template law<S>;
    known += std::string(", \"") + L::name + "\"";
    if (name != L::name) return;
    is_known = true;
    pellucid::Controller<L> law;
    pellucid::configure(law, read_params<typename L::Params, S>("law_parameters", parameters));
    found = law;
  });
  if (!is_known) throw nb::value_error(("law: found \"" + name + "\", expected one of " + known).c_str());
  return found;
}

template <class S> AnySupervised<S> read_supervised(const std::string& name, nb::handle parameters, nb::handle numbers) {
  AnySupervised<S> found;
  AnyLaw<S> law = read_law<S>(name, parameters);
  const auto rules = numbers.is_none() ? pellucid::SupervisorParams<S>{}
                                       : read_params<pellucid::SupervisorParams<S>, S>("supervisor", numbers);
  pellucid::Laws::for_each([&](auto of) {
    using L = typename decltype(of)::template law<S>;
    if (name != L::name) return;
    pellucid::Supervised<L> made;
    pellucid::configure(made, read_params<typename L::Params, S>("law_parameters", parameters), rules);
    found = made;
  });
  return found;
}

void seal_law(AnySupervised<double>& law) {
  of_law(law, 0, [](auto& one) { return pellucid::seal(one), 0; });
}

template AnyLaw<double> read_law<double>(const std::string&, nb::handle);
template AnyLaw<float> read_law<float>(const std::string&, nb::handle);
template AnySupervised<double> read_supervised<double>(const std::string&, nb::handle, nb::handle);
template AnySupervised<float> read_supervised<float>(const std::string&, nb::handle, nb::handle);

}  // namespace bindings
