// Laws of the core's list, made and stepped by their place in a variant.
#include "laws.hpp"

#include <cmath>

namespace engine {

namespace p = pellucid;

std::string Condition::make() {
  if (kind == "none") return "";
  bool known = false, sound = false;
  std::string wrong;
  p::Laws::for_each([&](auto of) {
    using L = typename decltype(of)::template law<double>;
    if (kind != L::name) return;
    known = true;
    constexpr std::size_t k = p::field_count<typename L::Params>, m = p::field_count<p::SupervisorParams<double>>;
    if (numbers.size() != k || supervisor.size() != m) {
      wrong = "condition " + name + ": found " + std::to_string(numbers.size()) + " numbers of the law and " +
              std::to_string(supervisor.size()) + " of its supervisor, expected " + std::to_string(k) + " and " + std::to_string(m);
      return;
    }
    const auto params = p::from_numbers<typename L::Params>(numbers.data());
    p::Supervised<L> made;
    sound = p::configure(made, params, p::from_numbers<p::SupervisorParams<double>>(supervisor.data()));
    effort_limit = params.gate.effort_limit;
    rate_limit = params.gate.rate_limit;
    velocity_limit = params.gate.velocity_limit;
    position_min = params.gate.position_min;
    position_max = params.gate.position_max;
    fresh = made;
  });
  if (!known) return "condition " + name + ": found the law \"" + kind + "\", expected a law of the core";
  if (!wrong.empty()) return wrong;
  return sound ? "" : "condition " + name + ": found numbers of its law or supervisor outside their bounds";
}

bool adjust(AnyLaw& law, std::vector<double>& numbers, std::size_t field, double value) noexcept {
  if (field >= numbers.size() || !std::isfinite(value)) return false;
  return of_law(law, false, [&](auto& one) {
    using Params = typename NumbersOf<std::decay_t<decltype(one)>>::Params;
    const double before = numbers[field];
    numbers[field] = value;
    const auto params = p::from_numbers<Params>(numbers.data());
    const auto made = coefficients(params);
    if (!made.gate.valid) {
      numbers[field] = before;
      return false;
    }
    p::adjust(one, params);
    return true;
  });
}

p::SupervisorOutput<double> step(AnyLaw& law, const p::Samples<double>& samples, const p::Feedback<double>& back,
                                 std::int64_t now_us) noexcept {
  return of_law(law, p::SupervisorOutput<double>{}, [&](auto& one) {
    using L = typename std::decay_t<decltype(one.controller)>::Law;
    p::Samples<double> read;
    for (const p::SensorUse& use : L::sensors) {
      p::Samples<double> all = samples;
      read[use.quantity] = all[use.quantity];
    }
    return p::step(one, read, back, now_us);
  });
}

double velocity(const AnyLaw& law) noexcept {
  return of_law(law, 0.0, [](const auto& one) { return one.state.encoder.velocity; });
}

}  // namespace engine
