// What Python sees of a law under its supervisor, whichever law it is and in either scalar.
#pragma once

#include "laws.hpp"

#include <memory>

namespace bindings {

/// Python interface of any supervised law.
class Supervised {
 public:
  Supervised() = default;
  Supervised(const Supervised&) = delete;
  virtual ~Supervised() = default;
  virtual std::size_t sensors() const = 0;
  virtual double step_now(double time, const double* values, double drive, double joint, std::uint32_t token) = 0;
  virtual double step_samples(std::int64_t now, const pellucid::Sample<double>* from, std::size_t count, std::uint32_t token) = 0;
  virtual bool configure(nb::handle parameters, nb::handle supervisor) = 0;
  virtual void adjust(nb::handle parameters) = 0;
  virtual void stop() = 0;
  virtual nb::list log() const = 0;
  virtual void record(std::uint32_t records, std::uint32_t decimation, std::uint32_t after) = 0;
  virtual bool is_recorded() const = 0;
  virtual nb::bytes incident(bool slides) = 0;
  virtual nb::dict estimates() const = 0;
  virtual nb::tuple probe_answer() const = 0;
  pellucid::SupervisorOutput<double> out{};
};

/// f(LawOf) of the law with that name.
template <class F> void with_law(const std::string& name, F&& f) {
  bool known = false;
  std::string names;
  pellucid::Laws::for_each([&](auto of) {
    names += (names.empty() ? "\"" : ", \"") + std::string(decltype(of)::template law<double>::name) + "\"";
    if (name == decltype(of)::template law<double>::name) f(of), known = true;
  });
  if (!known) throw nb::value_error(("law: found \"" + name + "\", expected one of " + names).c_str());
}

/// A law of the list under its supervisor. Compiled for each scalar in a unit of its own.
template <class S>
std::unique_ptr<Supervised> make_supervised(const std::string& name, nb::handle parameters, nb::handle supervisor);
extern template std::unique_ptr<Supervised> make_supervised<double>(const std::string&, nb::handle, nb::handle);
extern template std::unique_ptr<Supervised> make_supervised<float>(const std::string&, nb::handle, nb::handle);

}  // namespace bindings
