// The elementary functions against long double, over the whole range of double and float; prints the worst errors.
#include "check.hpp"

#include <pellucid/math.hpp>

#include <algorithm>
#include <limits>

namespace p = pellucid;
using Long = long double;

template <class T> Long ulp_of(Long x) {
  using L = std::numeric_limits<T>;
  const Long magnitude = std::fabs(x);
  if (!(magnitude >= Long(L::min()))) return Long(L::denorm_min());
  int exponent;
  std::frexp(magnitude, &exponent);
  return std::ldexp(Long(1), exponent - L::digits);
}

struct Worst {
  Long error = 0, at = 0;
};

/// Compares one point; counts its error in ulp, and checks the points where there is no error to count.
template <class T> void compare(Worst& worst, T x, T got, Long exact, const char* what) {
  if (std::isnan(exact)) return check(std::isnan(got), what);
  if (std::fabs(exact) > Long(std::numeric_limits<T>::max())) {
    // Rounds to infinity, or lies within the last half unit before it.
    return check(std::isinf(got) && std::signbit(got) == std::signbit(exact), what);
  }
  if (std::isinf(got)) {
    const bool at_the_brink =
        std::fabs(exact) > Long(std::numeric_limits<T>::max()) * (1 - 2 * Long(std::numeric_limits<T>::epsilon()));
    return check(at_the_brink, what);
  }
  if (std::isnan(got)) return check(false, what);
  const Long error = std::fabs(Long(got) - exact) / ulp_of<T>(exact);
  if (error > worst.error) worst = {error, Long(x)};
}

template <class T> struct Functions {
  Worst exp, log, sin, cos, tanh, sqrt;

  void at(T x) {
    const Long l = Long(x);
    compare(exp, x, p::exp(x), std::exp(l), "exp");
    compare(log, x, p::log(x), x < 0 ? std::numeric_limits<Long>::quiet_NaN() : std::log(l), "log");
    compare(tanh, x, p::tanh(x), std::tanh(l), "tanh");
    compare(sqrt, x, p::sqrt(x), std::sqrt(l), "sqrt");
    const T range = sizeof(T) == 8 ? T(4.2e8) : T(1.2e4);
    if (std::fabs(x) < range) {
      compare(sin, x, p::sin(x), std::sin(l), "sin");
      compare(cos, x, p::cos(x), std::cos(l), "cos");
    } else if (!(std::fabs(x) < T(1.1) * range)) {
      check(std::isnan(p::sin(x)) && std::isnan(p::cos(x)), "sin and cos have no value far away");
    }
  }
};

template <class T> void expm1_near_and_far(const char* type) {
  using L = std::numeric_limits<T>;
  const T most = sizeof(T) == 8 ? T(709) : T(88);
  Worst worst;
  const auto at = [&worst, most](T x) {
    if (!(x > most)) compare(worst, x, p::expm1(x), std::expm1(Long(x)), "expm1");
  };
  for (const T x : {T(0), -T(0), L::denorm_min(), L::min(), L::lowest(), -L::infinity(), L::quiet_NaN(), T(0.35), most})
    at(x);
  check(std::isinf(p::expm1(L::infinity())) && std::isinf(p::expm1(L::max())), "expm1 far away");
  Random random(2);
  for (int i = 0; i < 300000; ++i) {
    at(random.anything<T>());
    at(static_cast<T>(random.uniform(-1, 1)));
    at(static_cast<T>(random.uniform(-30, 30)));
    at(static_cast<T>(random.uniform(-800, 800)));
  }
  std::printf("%-6s  expm1 %.2Lf ulp at %.17Lg\n", type, worst.error, worst.at);
  check(worst.error < Long(2), "expm1: no worse than stated");
}

template <class T> void sweep(const char* type, const double (&stated)[6]) {
  using L = std::numeric_limits<T>;
  Functions<T> f;
  for (const T x : {T(0),      -T(0),       L::denorm_min(), -L::denorm_min(), L::min(),
                    L::max(),  L::lowest(), L::infinity(),   -L::infinity(),   L::quiet_NaN(),
                    T(1),      T(-1),       L::epsilon(),    T(0.5),           T(710),
                    T(709.78), T(-745),     T(-746),         T(88.72),         T(-103.9)})
    f.at(x);
  Random random(1);
  for (int i = 0; i < 600000; ++i) {
    f.at(random.anything<T>());
    f.at(static_cast<T>(random.uniform(-1, 1)));
    f.at(static_cast<T>(random.uniform(-30, 30)));
    f.at(static_cast<T>(random.uniform(-750, 750)));
    f.at(static_cast<T>(random.uniform(-1e4, 1e4)));
    f.at(static_cast<T>(std::exp(random.uniform(-745, 709))));
  }
  // Where sin and cos pass through zero, and where their arguments are reduced the most.
  for (int n = 1; n < 200000; ++n) {
    const T x = static_cast<T>(Long(n) * (sizeof(T) == 8 ? 1337 : 1) * 1.57079632679489661923132169163975144L);
    f.at(x);
    f.at(std::nextafter(x, T(0)));
  }
  const Worst* worst[] = {&f.exp, &f.log, &f.sin, &f.cos, &f.tanh, &f.sqrt};
  const char* names[] = {"exp", "log", "sin", "cos", "tanh", "sqrt"};
  for (int i = 0; i < 6; ++i) {
    std::printf("%-6s %-4s %.3Lf ulp at %.9Lg (stated %.1f)\n", type, names[i], worst[i]->error, worst[i]->at,
                stated[i]);
    check(worst[i]->error <= Long(stated[i]), names[i]);
  }
}

template <class T> void small_functions() {
  using L = std::numeric_limits<T>;
  const T nan = L::quiet_NaN(), inf = L::infinity();
  Random random(2);
  for (int i = 0; i < 300000; ++i) {
    const T x = i % 2 ? random.anything<T>() : static_cast<T>(random.uniform(-1e6, 1e6));
    const T rounded = p::round(x);
    check(
        std::isnan(x) ? std::isnan(rounded) : rounded == std::nearbyint(x) && std::signbit(rounded) == std::signbit(x),
        "round");
    check(p::is_finite(x) == std::isfinite(x), "is_finite");
    check(std::isnan(x) || p::abs(x) == std::fabs(x), "abs");
    check(std::isnan(x) || p::copysign(x, T(-1)) == std::copysign(x, T(-1)), "copysign");
  }
  check(p::sign(T(3)) == 1 && p::sign(T(-3)) == -1 && p::sign(T(0)) == 0 && p::sign(nan) == 0, "sign");
  check(p::clamp(T(3), T(-1), T(1)) == 1 && p::clamp(-inf, T(-1), T(1)) == -1 && std::isnan(p::clamp(nan, T(-1), T(1))),
        "clamp");
  check(p::min(T(1), T(2)) == 1 && p::max(T(1), T(2)) == 2, "min, max");
  check(p::same_sign(T(1), L::min()) && p::same_sign(T(-1), -L::min()) && !p::same_sign(T(1), T(-1)) &&
            !p::same_sign(T(0), T(1)) && !p::same_sign(nan, T(1)),
        "same_sign");
  const p::SinCos<T> both = p::sincos(T(0.7));
  check(both.sin == p::sin(T(0.7)) && both.cos == p::cos(T(0.7)), "sincos");
}

int main() {
  sweep<double>("double", {1.1, 1.0, 1.1, 1.1, 2.6, 0.51});
  sweep<float>("float", {1.1, 1.0, 1.1, 1.1, 2.6, 0.51});
  small_functions<double>();
  small_functions<float>();
  expm1_near_and_far<double>("double");
  expm1_near_and_far<float>("float");
  return failures();
}
