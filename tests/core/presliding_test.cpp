// Friction below slip: its curve, its memory, no drift, what is passive and what is not, and every input.
#include "example.hpp"

namespace p = pellucid;

constexpr double N = static_cast<double>(p::presliding_elements);

struct Contact {
  p::PreslidingCoefficients<double> c;
  p::PreslidingState<double> state{};

  explicit Contact(double travel) : c(p::coefficients(p::PreslidingParams<double>{travel})) {}
  double move(double way) { return p::step(c, state, way); }
  double s() const { return p::direction(state); }
  /// Stored per level [rad].
  double stored() const {
    double sum = -0.5 * state.strain[p::presliding_elements - 1] * state.strain[p::presliding_elements - 1];
    for (const double z : state.strain) sum += z * z;
    return sum / (c.elements_per_travel * N * N);
  }
};

void curve() {
  for (const double travel : {0.3e-3, 1e-3, 3.0}) {
    for (const double side : {1.0, -1.0}) {
      Contact contact(travel);
      for (int i = 1; i <= 800; ++i) {
        const double s = contact.move(side * travel / 800), x = i / 800.0;
        check_close(s, side * x * (2 - x), 1 / (4 * N * N) + 1e-9, "near the parabola");
        const double element = x * N, whole = std::floor(element + 1e-9);
        const auto at = [](double k) { return k / N * (2 - k / N); };
        check_close(s, side * (at(whole) + (element - whole) * (at(whole + 1) - at(whole))), 1e-9, "chords of it");
      }
      contact.move(side * 1e-9 * travel);  // what 800 sums have rounded away
      check(contact.s() == side, "slips with s = 1 to the bit");
      check(contact.move(side * 100) == side && contact.move(side * 1e300) == side, "and goes on so");
    }
  }
}

void remembers() {
  // A loop within a loop closes on its own turning point, and the outer one goes on as if there had been none.
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    Contact with(1e-3), without(1e-3);
    const double out = random.uniform(0.2, 1.5) * 1e-3, back = random.uniform(0.1, 0.9) * out;
    const double inner = random.uniform(0.1, 0.9) * back, rest = random.uniform(0, 1) * 1e-3;
    for (Contact* contact : {&with, &without}) {
      contact->move(out);
      contact->move(-back);
    }
    const double turned = with.s();
    with.move(inner);
    with.move(-inner);
    check_close(with.s(), turned, 1e-12, "the inner loop closes");
    check_close(with.move(rest), without.move(rest), 1e-12, "and is forgotten");
    // How fast the way is gone does not count.
    Contact slow(1e-3), fast(1e-3);
    for (int k = 0; k < 100; ++k) slow.move(rest / 100);
    check_close(slow.s(), fast.move(rest), 1e-12, "of the way alone");
  }
}

void is_passive() {
  Random random(4);
  for (int i = 0; i < 100; ++i) {
    Contact contact(1e-3);
    double rising_least = 0, rising = 0;
    for (int k = 0; k < 2000; ++k) {
      const double way = random.uniform(-1, 1) * (random.uniform() < 0.2 ? 2e-3 : 3e-4), before = contact.stored();
      const double s = contact.move(way);
      check(s * way >= contact.stored() - before - 1e-15, "stores no more than it takes");
      check(s >= -1 && s <= 1, "within the level");
      const double level = 1 + (s * way < 0 ? 1 : 0);  // stiffens while it gives back
      rising += level * s * way;
      rising_least = std::fmin(rising_least, rising);
    }
    check(rising > 0, "the slips outweigh it here");
  }
  // A level that doubles while the contact is bent: more comes back than went in.
  Contact contact(1e-3);
  double taken = 0;
  for (int cycle = 0; cycle < 10; ++cycle) {
    for (int k = 0; k < 100; ++k) taken += contact.move(1e-6);
    for (int k = 0; k < 100; ++k) taken -= 2 * contact.move(-1e-6);
  }
  check(taken < 0, "not passive under a level that rises at the wrong time");
}

/// A bench without gravity, its command straight to the effort.
p::PlantParams<double> free_joint(double travel) {
  auto params = example_plant<double>();
  params.joint.gravity_sine = params.joint.gravity_cosine = params.joint.offset = 0;
  params.joint.friction.load_motoring = params.joint.friction.load_generating = params.joint.friction.stribeck = 0;
  params.joint.friction.coulomb_negative = params.joint.friction.coulomb_positive;
  params.joint.friction.viscous_negative = params.joint.friction.viscous_positive;
  params.drive = {};
  params.encoder = {};
  params.loop = {p::LoopKind::none, 0, 0, 0, 0, 0, 0, 1e-3};
  params.substeps = 20;
  params.presliding.travel = travel;
  return params;
}

void keeps_its_place() {
  // An effort that swings below the level, a mean beside it: where LuGre drifts, this is where it was a period ago.
  const auto params = free_joint(1e-3);
  const auto c = p::coefficients(params);
  const double level = params.joint.friction.coulomb_positive;
  p::PlantState<double> state;
  double settled = 0;
  for (int k = 0; k <= 40000; ++k) {
    const double effort = level * (0.3 + 0.4 * std::sin(6.283185307179586 * 2e-3 * k));  // 2 Hz
    p::step<p::Friction::stiction>(c, state, p::PlantInput<double>{effort, 0, 0, 0});
    if (k == 20000) settled = state.position;
  }
  check(std::fabs(settled) > 1e-5, "it has given");
  check_close(state.position, settled, 1e-8, "after twenty periods more it is where it was");
  // Held, it comes to rest where the spring holds it; let go, not back at 0: what slid within stays.
  for (int k = 0; k < 20000; ++k)
    p::step<p::Friction::stiction>(c, state, p::PlantInput<double>{0.9 * level, 0, 0, 0});
  check_close(p::direction(state.presliding), 0.9, 1e-6, "the spring carries it");
  check(std::fabs(state.velocity) < 1e-9, "at rest");
  const double held = state.position;
  for (int k = 0; k < 20000; ++k) p::step<p::Friction::stiction>(c, state, p::PlantInput<double>{0, 0, 0, 0});
  check(state.position < held - 1e-5 && state.position > 1e-5, "let go, it goes back in part");
}

void slips_as_before() {
  // Far from rest the travel is gone from every bit of the friction.
  auto params = free_joint(1e-3);
  const auto with = p::coefficients(params);
  params.presliding.travel = 0;
  const auto without = p::coefficients(params);
  p::PlantState<double> a, b;
  a.velocity = b.velocity = 1;
  for (int k = 0; k < 4; ++k) {  // until it has gone the travel, the efforts are set apart
    p::step<p::Friction::stiction>(with, a, p::PlantInput<double>{2, 0, 0, 0});
    p::step<p::Friction::stiction>(without, b, p::PlantInput<double>{2, 0, 0, 0});
  }
  b = a;
  for (int k = 0; k < 300; ++k) {
    p::step<p::Friction::stiction>(with, a, p::PlantInput<double>{2, 0, 0, 0});
    p::step<p::Friction::stiction>(without, b, p::PlantInput<double>{2, 0, 0, 0});
    check(a.position == b.position && a.velocity == b.velocity, "the same bits");
  }
}

void keeps_energy_within_bounds() {
  // Struck at rest it never moves faster than the blow, at the substep that the header calls good.
  Random random(6);
  for (int i = 0; i < 100; ++i) {
    auto params = free_joint(random.uniform(1e-4, 3e-3));
    params.joint.friction.viscous_positive = params.joint.friction.viscous_negative = 0;
    const double stiffness = (2 - 1 / N) * params.joint.friction.coulomb_positive / params.presliding.travel;
    params.substeps = 1;
    params.loop.period = 0.5 / std::sqrt(stiffness / params.joint.inertia);
    const auto c = p::coefficients(params);
    p::PlantState<double> state;
    const double blow = state.velocity = random.uniform(0.01, 0.3);
    for (int k = 0; k < 5000; ++k) {
      p::step<p::Friction::stiction>(c, state, p::PlantInput<double>{});
      check(std::fabs(state.velocity) <= 1.04 * blow, "no faster");  // semi-implicit Euler: h w / 4 of its energy
    }
    check(std::fabs(state.position) < 1, "and stays near");
  }
}

/// Duals carry the derivative by the travel through the bent contact.
void is_differentiable() {
  using Dual = p::Dual<double, 8>;
  const auto position = [](auto travel, std::size_t samples) {
    using S = decltype(travel);
    auto params = example_plant<S>();
    params.presliding.travel = travel;
    params.encoder = {};
    const auto c = p::coefficients(params);
    p::PlantState<S> state;
    for (std::size_t k = 0; k < samples; ++k)
      p::step<p::Friction::smooth>(c, state, p::PlantInput<S>{S(reference_at(k)), S(0), S(0), S(0)});
    return state.position;
  };
  for (const std::size_t samples : {20u, 300u, 900u}) {
    const double h = 1e-9;
    const double difference = (position(1e-2 + h, samples) - position(1e-2 - h, samples)) / (2 * h);
    const Dual exact = position(Dual::parameter(1e-2, 0), samples);
    check(std::fabs(difference) > 1e-4, "the travel counts");
    check_close(exact.derivative[0], difference, 1e-3 * std::fabs(difference) + 1e-6, "by the travel");
  }
}

template <class T> void total() {
  Random random(7);
  for (int i = 0; i < 3000; ++i) {
    const auto c = p::coefficients(p::PreslidingParams<T>{random.anything<T>()});
    p::PreslidingState<T> state;
    if (i % 2)
      for (T& z : state.strain) z = random.anything<T>();
    for (int k = 0; k < 20; ++k) {
      const T s = p::step(c, state, random.anything<T>());
      check(s >= T(-1) && s <= T(1), "a number between -1 and 1, whatever came");
    }
    p::PlantParams<T> params = example_plant<T>();
    params.presliding.travel = random.anything<T>();
    const auto plant = p::coefficients(params);
    p::PlantState<T> joint;
    for (int k = 0; k < 5; ++k) {
      const p::PlantInput<T> input{random.anything<T>(), random.anything<T>(), random.anything<T>(), T(0)};
      p::step<p::Friction::stiction>(plant, joint, input);
    }
  }
  // One sample that is no number is none: the contact stays as it is.
  const auto c = p::coefficients(p::PreslidingParams<T>{T(1e-3)});
  p::PreslidingState<T> state;
  const T before = p::step(c, state, T(3e-4));
  check(p::step(c, state, std::numeric_limits<T>::quiet_NaN()) == before, "NaN is no motion");
  check(p::step(c, state, -std::numeric_limits<T>::infinity()) == T(-1), "infinity slips");
}

int main() {
  curve();
  remembers();
  is_passive();
  keeps_its_place();
  slips_as_before();
  keeps_energy_within_bounds();
  is_differentiable();
  total<double>();
  total<float>();
  return failures();
}
