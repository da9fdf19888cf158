// Every law of the core's list under its supervisor, of the numbers that a file gives.
#pragma once

#include <pellucid/laws.hpp>
#include <pellucid/supervisor.hpp>

#include <string>
#include <type_traits>
#include <variant>
#include <vector>

namespace engine {

template <class... L> using OneOf = std::variant<std::monostate, L...>;
/// Any supervised law; none is a robot without power.
using AnyLaw = pellucid::Laws::any<OneOf, pellucid::Supervised, double>;

template <class R, class Any, class F> R of_law(Any& any, R otherwise, F f) {
  return std::visit(
      [&](auto& law) -> R {
        if constexpr (std::is_same<std::decay_t<decltype(law)>, std::monostate>::value) return otherwise;
        else return f(law);
      },
      any);
}

template <class Law> struct NumbersOf;
template <class L> struct NumbersOf<pellucid::Supervised<L>> {
  using Params = typename L::Params;
};

/// One condition of a session: a law, or a robot without power, worn or not.
struct Condition {
  std::string name, kind = "none";
  bool worn = true;
  std::vector<double> numbers, supervisor;
  double effort_limit = 0, rate_limit = 0, velocity_limit = 0, position_min = 0, position_max = 0;
  AnyLaw fresh{};  ///< as configured, never stepped

  /// Makes `fresh` of the numbers. An empty text, or what is wrong.
  std::string make();
};

/// `law` becomes the law of a condition that has never been stepped.
inline void begin(AnyLaw& law, const Condition& condition) noexcept {
  law = condition.fresh;
  of_law(law, 0, [](auto& one) { return pellucid::seal(one), 0; });
}

/// Changes one number of a law that runs; false where it has none in that place or the number makes no sense there.
bool adjust(AnyLaw& law, std::vector<double>& numbers, std::size_t field, double value) noexcept;

/// One control period. Samples that the law does not read are kept from the supervisor too, as on a microcontroller.
pellucid::SupervisorOutput<double> step(AnyLaw& law, const pellucid::Samples<double>& samples,
                                        const pellucid::Feedback<double>& back, std::int64_t now_us) noexcept;

/// The joint's velocity as the supervisor sees it; 0 without a law.
double velocity(const AnyLaw& law) noexcept;

}  // namespace engine
