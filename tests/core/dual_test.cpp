// Every operation of Dual against central differences, and the corners where a derivative could become NaN.
#include "example.hpp"

namespace p = pellucid;
using D = p::Dual<double, 8>;

template <class F>
void against_difference(F f, double x, double tolerance, const char* what, int line = __builtin_LINE()) {
  const D exact = f(D::parameter(x, 3));
  const double h = 1e-6 * (1 + std::fabs(x));
  const double slope = (f(D(x + h)).value - f(D(x - h)).value) / (2 * h);
  check_close(exact.derivative[3], slope, tolerance * (1 + std::fabs(slope)), what, line);
  check(exact.value == f(D(x)).value, what, line);
  for (std::size_t i = 0; i < 8; ++i) check(i == 3 || exact.derivative[i] == 0, what, line);
}

int main() {
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    const double x = random.uniform(-3, 3), y = random.uniform(0.1, 3);
    const double tolerance = 1e-8;
    against_difference([y](D d) { return d * D(y) + d / D(y) - D(y) / (D(4) + d); }, x, tolerance, "arithmetic");
    against_difference([y](D d) { return (d + y) * (y - d) - d * y / y + (-d) - y + (y + d); }, x, tolerance,
                       "arithmetic with constants");
    against_difference([](D d) { return p::exp(d) + p::tanh(d); }, x, tolerance, "exp, tanh");
    against_difference([](D d) { return p::sin(d) * p::cos(d); }, x, tolerance, "sin, cos");
    against_difference([](D d) { return p::log(d) + p::sqrt(d); }, y, tolerance, "log, sqrt");
    against_difference([](D d) { return p::abs(d) + p::copysign(d, D(-1)); }, std::fabs(x) < 1e-3 ? 1.0 : x, tolerance,
                       "abs, copysign");
    against_difference([](D d) { return p::clamp(d, D(-1), D(1)) + p::max(d, D(0.5)) + p::min(d, D(0.7)); },
                       std::fabs(x) + 1.1, tolerance, "clamp");
  }
  check(p::round(D::parameter(2.7, 1)).derivative[1] == 0 && p::round(D::parameter(2.7, 1)).value == 3,
        "round is a staircase");
  check(p::with_value(D::parameter(2.7, 1), 3.0).derivative[1] == 1, "with_value keeps the slope");
  check(p::is_identically_zero(D(0)) && !p::is_identically_zero(D::parameter(0, 1)),
        "a parameter that is 0 is not identically 0");

  // No Stribeck velocity, no width, no friction at all, at rest: derivatives by all parameters are numbers.
  for (const double velocity : {0.0, -0.0, 1e-300, 1e-8, -0.3, 50.0})
    for (const double stribeck_velocity : {0.0, -1.0, 1e-300, 0.1})
      for (std::size_t first = 0; first < p::parameter_count; first += 8) {
        D values[p::parameter_count];
        for (std::size_t i = 0; i < p::parameter_count; ++i) values[i] = D(i == 0 ? 1.0 : 0.0);
        values[8] = D(0.2);
        values[9] = D(stribeck_velocity);
        for (std::size_t i = first; i < p::parameter_count && i < first + 8; ++i)
          values[i].derivative.set(i - first, 1.0);
        const auto c = p::coefficients(p::from_numbers<p::JointParams<D>>(values));
        const D effort = p::inverse_dynamics(c, 0.3, velocity, 0.5);
        const D acceleration = p::forward_dynamics(c, 0.3, velocity, 0.4);
        for (std::size_t i = 0; i < 8; ++i)
          check(p::is_finite(effort.derivative[i]) && p::is_finite(acceleration.derivative[i]),
                "no NaN in a derivative");
        if (!(stribeck_velocity > 0))
          check(first != 8 || (effort.derivative[0] == 0 && effort.derivative[1] == 0),
                "no Stribeck velocity, no Stribeck term");
      }
  return failures();
}
