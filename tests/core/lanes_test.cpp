// What a lane computes has the bits of what one number computes: functions, and whole plants.
#include "example.hpp"

namespace p = pellucid;

template <class T> bool same_bits(T a, T b) {
  return std::memcmp(&a, &b, sizeof a) == 0 || (std::isnan(a) && std::isnan(b));
}

template <class T, std::size_t W> void functions() {
  using L = p::Lanes<T, W>;
  Random random(4);
  for (int round = 0; round < 20000; ++round) {
    L x(0), y(0);
    for (std::size_t i = 0; i < W; ++i) {
      x.set(i, round % 2 ? random.anything<T>() : static_cast<T>(random.uniform(-40, 40)));
      y.set(i, random.anything<T>());
    }
    const L results[] = {x + y,
                         x - y,
                         x * y,
                         x / y,
                         -x,
                         p::abs(x),
                         p::copysign(x, y),
                         p::sqrt(x),
                         p::min(x, y),
                         p::max(x, y),
                         p::clamp(x, L(-1), L(1)),
                         p::sign(x),
                         p::round(x),
                         p::exp(x),
                         p::log(x),
                         p::tanh(x),
                         p::sin(x),
                         p::cos(x)};
    for (std::size_t i = 0; i < W; ++i) {
      const T a = x[i], b = y[i];
      const T wanted[] = {a + b,
                          a - b,
                          a * b,
                          a / b,
                          -a,
                          p::abs(a),
                          p::copysign(a, b),
                          p::sqrt(a),
                          p::min(a, b),
                          p::max(a, b),
                          p::clamp(a, T(-1), T(1)),
                          p::sign(a),
                          p::round(a),
                          p::exp(a),
                          p::log(a),
                          p::tanh(a),
                          p::sin(a),
                          p::cos(a)};
      for (std::size_t f = 0; f < sizeof wanted / sizeof *wanted; ++f)
        check(same_bits(results[f][i], wanted[f]), "a function in a lane");
      check(p::is_finite(x)[i] == p::is_finite(a) && p::same_sign(x, y)[i] == p::same_sign(a, b), "a mask in a lane");
    }
  }
  check(p::any(L(1) > L(0)) && p::all(L(1) > L(0)) && !p::any(L(0) > L(0)) && !p::all(L(0) > L(0)), "any, all");
  L mixed(0);
  mixed.set(W - 1, T(1));
  check(p::any(mixed > L(0)) && (W == 1 || !p::all(mixed > L(0))), "any, all of a mixed mask");
  check(same_bits(L(T(-0.0))[0], T(-0.0)), "a negative zero in every lane");
}

template <class T, std::size_t W, p::Friction mode> void plants() {
  using L = p::Lanes<T, W>;
  Random random(5);
  p::PlantParams<T> one[W];
  p::PlantParams<L> all = example_plant<L>();
  const auto put = [](L& lanes, std::size_t i, T x) { lanes.set(i, x); };
  for (std::size_t i = 0; i < W; ++i) {
    one[i] = example_plant<T>();
    one[i].joint = random_joint<T>(random);
    one[i].joint.inertia = static_cast<T>(random.uniform(0.05, 0.2));
    if (i == 1)
      one[i].joint.friction.stribeck = one[i].joint.friction.load_motoring = one[i].joint.friction.load_generating = 0;
    if (i == 2) one[i].joint.friction.velocity_width = one[i].joint.gravity_sine = one[i].joint.gravity_cosine = 0;
    if (i == 3) one[i].drive.ripple_amplitude = one[i].encoder.quantum = one[i].loop.limit = 0;
    if (i % 2) one[i].presliding.travel = static_cast<T>(random.uniform(1e-3, 3e-2));
    put(all.presliding.travel, i, one[i].presliding.travel);
    put(all.joint.inertia, i, one[i].joint.inertia);
    put(all.joint.gravity_sine, i, one[i].joint.gravity_sine);
    put(all.joint.gravity_cosine, i, one[i].joint.gravity_cosine);
    put(all.joint.offset, i, one[i].joint.offset);
    p::FrictionParams<L>& f = all.joint.friction;
    const p::FrictionParams<T>& g = one[i].joint.friction;
    put(f.coulomb_positive, i, g.coulomb_positive);
    put(f.coulomb_negative, i, g.coulomb_negative);
    put(f.viscous_positive, i, g.viscous_positive);
    put(f.viscous_negative, i, g.viscous_negative);
    put(f.stribeck, i, g.stribeck);
    put(f.stribeck_velocity, i, g.stribeck_velocity);
    put(f.load_motoring, i, g.load_motoring);
    put(f.load_generating, i, g.load_generating);
    put(f.velocity_width, i, g.velocity_width);
    put(all.drive.ripple_amplitude, i, one[i].drive.ripple_amplitude);
    put(all.encoder.quantum, i, one[i].encoder.quantum);
    put(all.loop.limit, i, one[i].loop.limit);
  }
  const auto c = p::coefficients(all);
  p::PlantState<L> state;
  p::PlantState<T> states[W];
  for (std::size_t k = 0; k < 500; ++k) {
    const T r = static_cast<T>(reference_at(k));
    const auto out = p::step<mode>(c, state, p::PlantInput<L>{L(r), L(0), L(0), L(0)});
    for (std::size_t i = 0; i < W; ++i) {
      const auto wanted = p::step<mode>(p::coefficients(one[i]), states[i], p::PlantInput<T>{r, 0, 0, 0});
      check(same_bits(out.position[i], wanted.position) && same_bits(out.velocity[i], wanted.velocity) &&
                same_bits(out.acceleration[i], wanted.acceleration) && same_bits(out.command[i], wanted.command) &&
                same_bits(out.effort[i], wanted.effort) &&
                same_bits(out.measured_position[i], wanted.measured_position),
            "a plant in a lane");
    }
  }
}

int main() {
  functions<double, 1>();
  functions<double, 4>();
  functions<float, 8>();
  plants<double, 4, p::Friction::smooth>();
  plants<double, 8, p::Friction::stiction>();
  plants<float, 16, p::Friction::smooth>();
  plants<float, 4, p::Friction::stiction>();
  return failures();
}
