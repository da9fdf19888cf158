// Laws of friction and joint, each at zero, near 1e-8 and at random points, in double and float.
#include "example.hpp"

#include <pellucid/resistance.hpp>

namespace p = pellucid;

template <class T> void laws() {
  const T epsilon = std::numeric_limits<T>::epsilon();
  Random random(6);
  for (int i = 0; i < 20000; ++i) {
    const auto params = random_joint<T>(random);
    const auto c = p::coefficients(params);
    const double scale = i % 3 == 0 ? 0.0 : i % 3 == 1 ? 1e-8 : 1.0;
    const T q = static_cast<T>(random.uniform(-3, 3) * scale);
    const T v = static_cast<T>(random.uniform(-5, 5) * scale);
    const T effort = static_cast<T>(random.uniform(-30, 30) * scale);

    // inverse(forward) = identity, and the other way round.
    const T a = p::forward_dynamics(c, q, v, effort);
    const T size = p::abs(effort) + p::abs(params.inertia * a) + T(40);
    check_close(p::inverse_dynamics(c, q, v, a), effort, 32 * epsilon * size, "inverse(forward) is the identity");
    const T wanted = static_cast<T>(random.uniform(-50, 50) * scale);
    const T back = p::forward_dynamics(c, q, v, p::inverse_dynamics(c, q, v, wanted));
    check_close(back, wanted, 64 * epsilon * (p::abs(wanted) + T(60) / params.inertia),
                "forward(inverse) is the identity");

    // Friction takes power, whatever the load.
    const T load = static_cast<T>(random.uniform(-20, 20) * scale);
    check(p::friction(c.friction, v, load) * v >= 0, "friction takes power");
    check(p::friction(c.friction, T(0), load) == 0, "no friction at rest");

    // A joint at rest starts exactly when the net effort exceeds the breakaway effort.
    const T g = p::gravity(c, q);
    const T net = effort - params.offset - g;
    const T direction = p::sign(net);
    const T start = p::acceleration(c, g, p::resistance(c.friction, T(0), direction), effort);
    const T margin = p::abs(net) - p::breakaway(c, g, net);
    if (p::abs(margin) > 32 * epsilon * size) check((start * direction > 0) == (margin > 0), "breakaway");
  }
}

template <class T> void total() {
  // Every parameter and every input may be anything: no trap, no hang. The sanitizers watch.
  Random random(7);
  T sum = 0;
  for (int i = 0; i < 20000; ++i) {
    T values[p::parameter_count];
    for (T& value : values) value = random.anything<T>();
    const auto c = p::coefficients(p::from_numbers<p::JointParams<T>>(values));
    sum += p::inverse_dynamics(c, random.anything<T>(), random.anything<T>(), random.anything<T>());
    sum += p::forward_dynamics(c, random.anything<T>(), random.anything<T>(), random.anything<T>());
  }
  check(!(sum == T(1)), "computed");
}

void terms() {
  p::FrictionParams<double> f{0.3, 0.25, 0.1, 0.15, 0.12, 0.1, 0.08, 0.15, 0.0};
  const auto at = [&f](double v, double y) { return p::friction(p::coefficients(f), v, y); };
  check_close(at(1e9, 0) - 0.1e9, 0.3, 1e-6, "level far from rest");
  check_close(at(1e-7, 0), 0.42, 1e-7, "level at rest, upwards");
  check_close(at(-1e-7, 0), -0.37, 1e-7, "level at rest, downwards");
  check_close(at(0.1, 0), 0.3 + 0.12 * std::exp(-1.0) + 0.01, 1e-15, "Stribeck");
  check_close(at(1, 2) - at(1, 0), 0.08 * 2, 1e-15, "motoring load");
  check_close(at(1, -2) - at(1, 0), 0.15 * 2, 1e-15, "generating load");
  check_close(at(-1, -2) - at(-1, 0), -0.08 * 2, 1e-15, "motoring load, downwards");
  f.stribeck_velocity = 0;
  check(at(1e-7, 0) == 0.3 + 0.1 * 1e-7, "no Stribeck velocity");
  f.load_generating = 5;
  check(at(1, -2) - at(1, 0) > 1.89 && at(1, -2) - at(1, 0) < 1.91, "the generating coefficient stays below 0.95");
  f.velocity_width = 0.1;
  check_close(at(0.05, 0), 0.3 * std::tanh(0.5) + 0.005, 1e-15, "smooth sign");
}

/// The most that is resisted is never less than friction, at any speed and load, and is met by a single term.
template <class T> void most() {
  const T epsilon = std::numeric_limits<T>::epsilon();
  Random random(8);
  for (int i = 0; i < 20000; ++i) {
    const auto params = random_joint<T>(random);
    const T v = static_cast<T>(random.uniform(-5, 5)), y = static_cast<T>(random.uniform(-20, 20));
    const T most = p::max_resistance(params, p::abs(v), p::abs(y));
    const T found = p::abs(p::friction(p::coefficients(params.friction), v, y));
    check(found <= most * (T(1) + 16 * epsilon), "friction is at most what resists");
    check(p::max_resistance(params.friction, p::abs(v), p::abs(y)) == most, "a part resists as the whole");
  }
  p::FrictionParams<T> f{};
  f.coulomb_positive = T(0.3), f.coulomb_negative = T(0.4), f.stribeck = T(0.1);
  check(p::max_resistance(f, T(0), T(0)) == T(0.1) + T(0.4), "of two directions the larger counts");
  f = {};
  f.square_root = T(2);
  check(p::max_resistance(f, T(9), T(5)) == T(6), "root of speed");
  check(p::max_resistance(f, T(0), T(5)) == T(0), "no speed");
  f = {};
  f.load_motoring = T(0.5), f.load_generating = T(0.25);
  check(p::max_resistance(f, T(3), T(4)) == T(2), "load");
}

/// Powers that no term of friction has.
void powers() {
  check(p::power(3.0, 2.0f) == 9.0, "square");
  check_close(p::power(3.0, 1.75f), std::pow(3.0, 1.75), 1e-14, "any power");
  check(p::power(0.0, 0.75f) == 0.0, "any power of 0");
  check_close(p::power(2.0, 1.5f), std::pow(2.0, 1.5), 1e-15, "power with a root");
  p::ResistanceSums<double, 1> sums;
  sums.add({true, 2, 0, false}, -0.5);
  sums.add({true, 2, 0, true}, 0.25);
  sums.add(p::by::level, 9.0);  // beyond one power
  sums.add({}, 9.0);            // without a role
  check(sums.count == 1 && sums.at(2.0, 1.0) == 3.0, "by powers");
}

int main() {
  most<double>();
  most<float>();
  powers();
  laws<double>();
  laws<float>();
  total<double>();
  total<float>();
  terms();
  return failures();
}
