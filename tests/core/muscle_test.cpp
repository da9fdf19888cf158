// A muscle: what its curves must hold, derivatives worked out by hand beside duals, and nothing undefined for anything.
#include "check.hpp"

#include <pellucid/dual.hpp>
#include <pellucid/elastic_muscle.hpp>
#include <pellucid/hill_torque.hpp>
#include <pellucid/muscle_slopes.hpp>

namespace p = pellucid;
using Dual = p::Dual<double, 16>;

template <class S> p::MuscleParams<S> vastus() {
  p::MuscleParams<S> m;
  m.optimal_fibre_length = S(0.089);
  m.tendon_slack_length = S(0.126);
  m.max_isometric_force = S(1294);
  m.pennation = S(0.0873);
  m.damping = S(0.05);
  return m;
}

void random_numbers(Random& random, double (&x)[p::muscle_parameter_count]) {
  const double low[] = {-3, 0, 0.001, 0, 0.04, 0.1, 0.3, 0, 2, 0.2, 0, 500, 0, 0, 0.15, 1.2, 0.4, 2};
  const double high[] = {0, 0.06, 0.06, 0.1, 0.2, 0.4, 3, 0.3, 15, 0.8, 2, 3000, 0.4, 0.2, 0.5, 1.9, 0.8, 6};
  for (std::size_t i = 0; i < p::muscle_parameter_count; ++i) x[i] = random.uniform(low[i], high[i]);
  if (random.uniform() < 0.1) x[0] = random.uniform(-0.02, 0.02);
}

void curves() {
  const auto c = p::coefficients(vastus<double>());
  for (const double h : {1e-4, 1e-6}) {
    const double left = (p::force_velocity(c, 0.0).value - p::force_velocity(c, -h).value) / h;
    const double right = (p::force_velocity(c, h).value - p::force_velocity(c, 0.0).value) / h;
    check_close(left, right, 60 * h, "one slope at v = 0");
    check_close(left, 5.0, 60 * h, "which is 1 + 1/A_f");
  }
  check_close(p::force_velocity(c, 0.0).value, 1.0, 0.0, "isometric");
  check(p::force_velocity(c, -1.0).value == 0 && p::force_velocity(c, -1.2).value == 0, "no force beyond v_max");
  check(p::force_velocity(c, -0.1).value < 1 && p::force_velocity(c, 0.1).value > 1, "shortening is weaker");
  check(p::force_velocity(c, 1e9).value <= 1.5, "lengthening has a limit");
  check(p::force_length(c, 1.0) == 1 && p::force_length(c, 0.5) == p::force_length(c, 1.5), "f_l peaks at 1");
  check(p::passive_force(c, 1.0).value == 0 && p::passive_force(c, 0.3).value == 0, "nothing passive below l_o");
  check_close(p::passive_force(c, 1.6).value, 1.0, 1e-12, "F_0 at its strain");
  check(p::is_finite(p::passive_force(c, 1e6).value), "and finite however long");
  double before = 0;
  for (int i = 0; i <= 400; ++i) {
    const double l = 0.8 + 0.005 * i;
    const p::PassiveForce<double> f = p::passive_force(c, l);
    check(f.value >= before, "passive force never falls");
    before = f.value;
    const double h = 1e-6;
    if (std::fabs(l - 1) > h && std::fabs(l - 1.6) > h)
      check_close((p::passive_force(c, l + h).value - p::passive_force(c, l - h).value) / (2 * h), f.slope,
                  1e-6 * (1 + f.slope), "slope");
  }
  const auto at = p::fibre(c, 0.126 + 0.089 * std::cos(0.0873), 0.0);
  check_close(at.length, 0.089, 1e-15, "optimal length at the optimal angle");
  check_close(at.cosine, std::cos(0.0873), 1e-15, "of that cosine");
  check(p::tendon_force(c, 0.0, p::fibre(c, 0.2, -5.0)) == 0, "a tendon does not push");
}

void activation() {
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    p::ActivationParams<double> a{random.uniform(-3, 0), random.uniform(0, 0.06), random.uniform(0, 0.06), 0.001};
    if (i % 3 == 0) a.shape = random.uniform(-0.02, 0.02);
    const auto c = p::coefficients(a);
    p::ActivationState<double> state;
    double out = 0;
    for (int k = 0; k < 300; ++k) {
      out = p::step(c, state, random.uniform(-0.5, 1.5));
      check(out >= 0 && out <= 1, "activation stays in [0, 1]");
    }
    for (int k = 0; k < 4000; ++k) out = p::step(c, state, 1.0);
    check_close(out, 1.0, 1e-12, "gain 1 at rest");
    check_close(p::shaped(c, 0.0), 0.0, 0.0, "nothing from nothing");
    const double u = random.uniform();
    const double exact = a.shape == 0 ? u : std::expm1(a.shape * u) / std::expm1(a.shape);
    check_close(p::shaped(c, u), exact, 1e-14, "shape");
  }
  // The recursion of Lloyd and Besier, literally.
  const p::ActivationParams<double> a{0.0, 0.02, 0.04, 0.005};
  const auto c = p::coefficients(a);
  const double c1 = -std::exp(-0.25), c2 = -std::exp(-0.125), b1 = c1 + c2, b2 = c1 * c2;
  p::ActivationState<double> state;
  double u1 = 0, u2 = 0;
  for (int k = 0; k < 200; ++k) {
    const double e = random.uniform();
    const double u = (1 + b1 + b2) * e - b1 * u1 - b2 * u2;
    check_close(p::neural_activation(c, state, e), u, 1e-14, "two lags are the recursion");
    u2 = u1;
    u1 = u;
  }
  const p::ActivationDynamicsParams<double> dynamics{0.01, 0.04, 0.001};
  double up = 0, down = 1;
  for (int k = 0; k < 20; ++k) {
    p::step(dynamics, up, 1.0);
    p::step(dynamics, down, 0.0);
  }
  check(up > 0.75 && down > 0.4, "activation rises faster than it falls");
}

void delays() {
  Random random(4);
  for (const double d : {0.0, 0.3, 0.999999, 1.0, 1.5, 7.25, 40.0}) {
    const auto c = p::delay_coefficients(d, 61);
    p::DelayState<double, 64> state;
    double worst = 0, least = 1, most = 0;
    for (int k = 0; k < 300; ++k) {
      const double y = p::step(c, state, std::sin(0.05 * k));
      if (k > 60 && d >= 1) worst = std::fmax(worst, std::fabs(y - std::sin(0.05 * (k - d))));
    }
    check(worst < 2e-5, "a delayed sine is a sine delayed");
    p::DelayState<double, 64> ramp;
    for (int k = 0; k < 300; ++k) {
      const double y = p::step(c, ramp, 0.01 * k);
      if (k > 60) check_close(y, 0.01 * (k - d), 1e-12, "a ramp is late by the delay");
    }
    p::DelayState<double, 64> jump;
    for (int k = 0; k < 300; ++k) {
      const double y = p::step(c, jump, k < 100 ? 0.0 : 1.0);
      least = std::fmin(least, y);
      most = std::fmax(most, y);
    }
    check(least > -0.08 && most < 1.08, "an edge rings little");
    double total = 0, slope = 0;
    for (int i = 0; i < 4; ++i) {
      total += c.weight[i];
      slope += c.slope[i];
    }
    check_close(total, 1.0, 1e-15, "weights sum to 1");
    check_close(slope, 0.0, 1e-14, "and stay so");
  }
  p::DelayState<double, 64> state;
  const auto c = p::delay_coefficients(2.0, 61);
  check(p::step(c, state, 5.0) == 5.0, "what was before the first sample is the first sample");
  check(!p::is_finite(p::step(c, state, std::nan(""))), "a bad sample passes");
  for (int k = 0; k < 5; ++k) check(p::step(c, state, 5.0) == 5.0, "and does not stay");
}

/// Every derivative of muscle_slopes.hpp against duals through muscle.hpp.
void slopes_are_duals() {
  Random random(5);
  double worst = 0;
  for (int i = 0; i < 20000; ++i) {
    double x[p::muscle_parameter_count];
    random_numbers(random, x);
    const double u = random.uniform(), velocity = random.uniform(-1.5, 1.5) * x[4] * x[8];
    const double length = x[5] + x[4] * random.uniform(-0.1, 1.9);
    Dual d[p::muscle_parameter_count];
    for (std::size_t j = 0; j < p::muscle_parameter_count; ++j) d[j] = Dual(x[j]);
    for (const std::size_t j : {0, 4, 5, 6, 7, 8, 9, 10}) d[j].derivative.set(j, 1.0);
    const auto dual = p::emg_muscle_params(d, Dual(0.01));
    const auto plain = p::emg_muscle_params(x, 0.01);
    const auto ca = p::coefficients(plain.activation);
    const auto cm = p::coefficients(plain.muscle);
    const Dual a = p::shaped(p::coefficients(dual.activation), Dual::parameter(u, 1));
    const auto dm = p::coefficients(dual.muscle);
    const Dual force = p::tendon_force(dm, a, p::fibre(dm, length, velocity));
    const p::MuscleSlopes<double> s = p::slopes(ca, cm, u, length, velocity);
    check(s.force == p::tendon_force(cm, p::shaped(ca, u), p::fibre(cm, length, velocity)), "the same force");
    const double got[] = {s.shape,
                          s.neural,
                          s.optimal_fibre_length,
                          s.tendon_slack_length,
                          s.strength,
                          s.optimal_length_shift,
                          s.max_velocity,
                          s.force_length_width,
                          s.passive_scale};
    const std::size_t at[] = {0, 1, 4, 5, 6, 7, 8, 9, 10};
    const double scale[] = {1, 1, x[4], x[4], 1, 1, x[8], x[9], 1};
    for (std::size_t j = 0; j < 9; ++j) {
      // A dual of the shape's quotient loses digits as A goes to 0, which the series does not.
      const double tolerance = (j == 0 ? 1e-12 : 1e-11) * (x[11] * x[6] + std::fabs(got[j]) * scale[j]);
      const double error = std::fabs(got[j] - force.derivative[at[j]]) * scale[j];
      worst = std::fmax(worst, error / tolerance);
      check(error <= tolerance, "a derivative by hand is a dual's");
    }
  }
  std::printf("derivatives by hand beside duals: %.2g of the tolerance\n", worst);
}

void elastic() {
  auto m = vastus<double>();
  const auto c = p::coefficients(p::ElasticMuscleParams<double>{m, 0.033, 0.001});
  check_close(p::tendon_pull(c, 0.126 * 1.033).value, 1.0, 1e-12, "F_0 at its strain");
  check(p::tendon_pull(c, 0.12).value == 0, "slack");
  const double toe = 0.126 * (1 + 0.033 * 0.6086155378758799);
  check_close(p::tendon_pull(c, toe * (1 - 1e-9)).slope, p::tendon_pull(c, toe * (1 + 1e-9)).slope, 0.3,
              "the toe goes over into the straight");
  Random random(6);
  for (int i = 0; i < 3000; ++i) {
    const double a = random.uniform(), length = random.uniform(0.15, 0.28);
    auto state = p::balanced(c, a, length);
    double n = p::fibre_force(c.muscle, a, p::fibre_along(c.muscle, state.along, 0.0));
    const double pull = p::tendon_pull(c, length - state.along).value;
    check_close(n * state.along / state.length, pull, 1e-9 * (1 + pull), "at rest both pull alike");
    const double force = p::step(c, state, a, length);
    check_close(force, 1294 * pull, 1e-6 * (1 + force), "and stay so");
    for (int k = 0; k < 20; ++k) {
      const double moved = length + random.uniform(-0.03, 0.03), u = random.uniform();
      const double was = state.length;
      const double f = p::step(c, state, u, moved);
      const double speed = (state.length - was) / 0.001;
      n = p::fibre_force(c.muscle, u, {state.length, state.along / state.length, speed * c.muscle.inverse_velocity});
      check(f >= 0 && p::is_finite(f), "a bounded search ends");
      if (state.along > c.muscle.shortest * 1.001)
        check_close(n * state.along / state.length * 1294, f, 1e-6 * (1 + f), "in equilibrium after any jump");
    }
  }
  // A very stiff tendon is a rigid one.
  const auto stiff = p::coefficients(p::ElasticMuscleParams<double>{m, 1e-5, 0.001});
  auto state = p::balanced(stiff, 0.6, 0.21);
  check_close(p::step(stiff, state, 0.6, 0.21), p::tendon_force(c.muscle, 0.6, p::fibre(c.muscle, 0.21, 0.0)), 0.5,
              "a stiff tendon is rigid");
  // Duals through the search.
  using One = p::Dual<double, 1>;
  p::ElasticMuscleParams<One> dual;
  dual.muscle = vastus<One>();
  dual.muscle.optimal_fibre_length = One::parameter(0.089, 0);
  dual.tendon_strain = One(0.033);
  dual.period = One(0.001);
  const auto run = [](auto params, auto scalar) {
    using S = decltype(scalar);
    const auto k = p::coefficients(params);
    auto s = p::balanced(k, S(0.3), S(0.21));
    S f(0);
    for (int i = 0; i < 50; ++i) f = p::step(k, s, S(0.3 + 0.01 * i), S(0.21 + 0.0005 * i));
    return f;
  };
  const One got = run(dual, One(0));
  const double h = 1e-6;
  auto up = p::ElasticMuscleParams<double>{m, 0.033, 0.001}, down = up;
  up.muscle.optimal_fibre_length += h;
  down.muscle.optimal_fibre_length -= h;
  const double slope = (run(up, 0.0) - run(down, 0.0)) / (2 * h);
  check_close(got.derivative[0], slope, 1e-5 * std::fabs(slope), "a dual passes through the equilibrium");
}

/// Whatever the bits are, a step returns, and what it returns is a number or NaN; sanitizers watch.
template <class T> void anything() {
  Random random(7);
  for (int i = 0; i < 4000; ++i) {
    T x[p::muscle_parameter_count];
    for (T& value : x) value = random.anything<T>();
    p::HillTorqueParams<T, 2> params;
    params.count = random.bits() % 3;
    params.muscle[0] = params.muscle[1] = p::emg_muscle_params(x, random.anything<T>());
    const auto c = p::coefficients<16>(params);
    p::HillTorqueState<T, 2, 16> state;
    const auto e =
        p::coefficients(p::ElasticMuscleParams<T>{params.muscle[0].muscle, random.anything<T>(), random.anything<T>()});
    p::ElasticMuscleState<T> elastic_state{};
    for (int k = 0; k < 5; ++k) {
      p::HillTorqueInput<T, 2> input;
      for (int m = 0; m < 2; ++m)
        input.excitation[m] = input.length[m] = input.velocity[m] = input.moment_arm[m] = random.anything<T>();
      p::step(c, state, input);
      p::step(e, elastic_state, random.anything<T>(), random.anything<T>());
    }
  }
}

void a_bad_sample_does_not_stay() {
  double x[p::muscle_parameter_count] = {-1,   0.02, 0.02, 0.003,  0.089, 0.126, 1,   0.15, 10,
                                         0.45, 1,    1294, 0.0873, 0,     0.25,  1.5, 0.6,  4};
  p::HillTorqueParams<double, 1> params;
  params.count = 1;
  params.muscle[0] = p::emg_muscle_params(x, 0.001);
  const auto c = p::coefficients<16>(params);
  p::HillTorqueState<double, 1, 16> state;
  for (const double e : {std::nan(""), 0.5, 0.5, std::nan(""), 0.5, HUGE_VAL, 0.5}) {
    const double torque = p::step(c, state, {{e}, {0.21}, {0.0}, {0.04}});
    check(p::is_finite(torque) == p::is_finite(e), "a bad sample is seen once");
    if (p::is_finite(e)) check(torque > 10, "and the next is as if it had not been");
  }
}

template <class S> S all_scalars() {
  p::HillTorqueParams<S, 1> params;
  params.count = 1;
  params.muscle[0].activation = {S(-1), S(0.02), S(0.02), S(0.001)};
  params.muscle[0].muscle = vastus<S>();
  const auto c = p::coefficients(params.muscle[0].muscle);
  const auto a = p::coefficients(params.muscle[0].activation);
  p::ActivationState<S> state;
  S u(0);
  for (int k = 0; k < 30; ++k) u = p::neural_activation(a, state, S(0.6));
  const auto e = p::coefficients(p::ElasticMuscleParams<S>{params.muscle[0].muscle, S(0.033), S(0.001)});
  auto rest = p::balanced(e, S(0.5), S(0.21));
  check(p::all(p::abs(p::step(e, rest, S(0.5), S(0.21))) < S(3000)), "elastic");
  return p::tendon_force(c, p::shaped(a, u), p::fibre(c, S(0.21), S(0.1)));
}

int main() {
  curves();
  activation();
  delays();
  slopes_are_duals();
  elastic();
  anything<double>();
  anything<float>();
  a_bad_sample_does_not_stay();
  const double exact = all_scalars<double>();
  check_close(static_cast<double>(all_scalars<float>()), exact, 1e-3 * exact, "float");
  check_close(all_scalars<p::Dual<double, 8>>().value, exact, 0.0, "Dual");
  check_close((all_scalars<p::Lanes<double, 4>>()[3]), exact, 0.0, "Lanes");
  check_close(static_cast<double>(all_scalars<p::Lanes<float, 8>>()[0]), exact, 1e-3 * exact, "Lanes of float");
  return failures();
}
