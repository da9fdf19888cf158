// EMG torque, the residual compensator and the strap's estimator: nonsense in, safe torques out; rest is rest.
#include "check.hpp"

#include <pellucid/emg_torque.hpp>
#include <pellucid/residual_compensator.hpp>
#include <pellucid/strap_estimator.hpp>

namespace p = pellucid;

template <class T> p::ResidualParams<T> example() {
  p::ResidualParams<T> r;
  r.bodies = {T(0.048), T(0.008), T(1.56), T(0.02), T(0.05), T(0.33), T(0.2), T(8.2), T(14), T(0.4), T(0)};
  const T correction[5] = {T(0.41), T(52), T(4.5), T(144), T(1367)};
  for (int i = 0; i < 5; ++i) r.correction[i] = correction[i];
  r.innovation_limit = T(0.05);
  r.gravity_share = T(0.8);
  r.viscous_share = T(0.8);
  r.friction_share = T(0.5);
  r.assist_width = T(0.6);
  r.inertia_share = T(0.7);
  r.actuator = {T(0.055), T(0.1), T(2.6), T(1.7)};
  r.torque_gain = T(0.3);
  r.proportional = T(1);
  r.integral = T(0.5);
  r.derivative = T(0.01);
  r.integral_limit = T(1);
  r.preview = T(0.01);
  r.emg_limit = T(40);
  r.trust_time = T(0.3);
  r.swing_rate = T(4.4);
  r.gate = {T(10), T(300), T(15), T(-0.6), T(2.2), T(0.1), T(0.01), 2, T(0.002)};
  return r;
}

/// Encoder, spring and EMG of one period; what EMG says counts where it is `heard`.
template <class T> p::Samples<T> samples(T position, T torque, T muscle, bool heard, std::int64_t time, std::uint32_t k) {
  p::Samples<T> s = p::position_only(position, time, k);
  s.torque = {torque, time, k, true};
  s.muscle = {muscle, time, k, heard};
  return s;
}

template <class T> T odd(Random& random, T usual) {
  const double chance = random.uniform();
  if (chance < 2e-3) return random.anything<T>();
  if (chance < 3e-3) return std::numeric_limits<T>::quiet_NaN();
  if (chance < 4e-3) return std::numeric_limits<T>::infinity();
  return usual;
}

template <class T> void nonsense() {
  const auto c = p::coefficients(example<T>());
  check(c.gate.valid, "the example makes sense");
  p::ResidualState<T> s;
  Random random(41);
  T before = 0;
  long unsafe = 0, moving = 0, shut = 0;
  const T most = T(300) * T(0.002) * (T(1) + T(1e-5));
  std::int64_t time = 0;
  for (long k = 0; k < 200000; ++k) {
    time += 2000;
    const T swing = T(0.6) + T(0.5) * p::sin(T(0.008) * T(static_cast<T>(k % 4000)));
    const T position = odd(random, swing), torque = odd(random, T(random.uniform(-3, 3)));
    const T muscle = odd(random, T(random.uniform(-15, 15)));
    const bool heard = random.uniform() > 1e-3;
    const std::int64_t at = random.uniform() < 1e-4 ? static_cast<std::int64_t>(random.bits()) : time;
    const auto in = samples(position, torque, muscle, heard, at, static_cast<std::uint32_t>(k + 1));
    const T u = p::step(c, s, in);
    bool ok = u >= T(-10) && u <= T(10);
    if (std::fabs(u) > std::fabs(before)) ok = ok && std::fabs(u - before) <= most;
    if (s.gate.fault != p::SafetyFault::none) {
      ok = ok && std::fabs(u) <= std::fabs(before);
      ++shut;
      if (random.uniform() < 0.05) p::reset(s);
    }
    unsafe += !ok;
    moving += u != T(0);
    before = u;
  }
  check(unsafe == 0, "no unsafe torque");
  check(shut > 5000 && moving > 50000, "the gate shut and opened");
}

template <class T> void rests() {
  const auto c = p::coefficients(example<T>());
  p::ResidualState<T> s;
  T u = 1;
  for (int k = 1; k <= 5000; ++k) u = p::step(c, s, samples(T(0), T(0), T(0), true, 2000 * k, static_cast<std::uint32_t>(k)));
  check(u == T(0) && s.strap_torque == T(0), "at rest, hanging, nothing is asked for");
  check(std::fabs(s.trust - T(1)) < T(1e-3), "EMG has faded in");
  for (int k = 5001; k <= 5400; ++k)
    u = p::step(c, s, samples(T(0), T(0), std::numeric_limits<T>::quiet_NaN(), true, 2000 * k, static_cast<std::uint32_t>(k)));
  check(s.trust == T(0) && s.gate.fault == p::SafetyFault::none, "EMG that is no number fades out and is no fault");
}

template <class T> void refuses() {
  auto params = example<T>();
  params.bodies.limb_inertia = T(0);
  check(!p::coefficients(params).gate.valid, "a limb without inertia");
  params = example<T>();
  params.bodies.strap_stiffness = T(1e5);
  check(!p::coefficients(params).gate.valid, "a strap that a period cannot resolve");
  params = example<T>();
  params.torque_gain = std::numeric_limits<T>::quiet_NaN();
  const auto c = p::coefficients(params);
  p::ResidualState<T> s;
  check(p::step(c, s, samples(T(1), T(1), T(1), true, 2000, 1u)) == T(0), "gives 0");
  check(s.gate.fault == p::SafetyFault::configuration, "and says why");
}

void phases() {
  auto params = example<double>();
  for (std::size_t i = 0; i < p::swing_phases; ++i) params.phase_gain[i] = static_cast<double>(i);
  const auto c = p::coefficients(params);
  const double rate = params.swing_rate;
  check_close(p::swing_gain(c, 1.0, 0.0), 0.0, 1e-12, "out at the positive end");
  check_close(p::swing_gain(c, 0.5, 0.5 * rate), 1.0, 1e-12, "an eighth on");
  check_close(p::swing_gain(c, 0.0, rate), 2.0, 1e-12, "through the middle");
  check_close(p::swing_gain(c, -1.0, 0.0), 4.0, 1e-12, "at the other end");
  check_close(p::swing_gain(c, 0.0, -rate), 6.0, 1e-12, "back through the middle");
  check_close(p::swing_gain(c, 0.75, -0.25 * rate), 3.5, 1e-12, "and between the last and the first");
}

void float_follows_double() {
  const auto c = p::coefficients(example<double>());
  const auto f = p::coefficients(example<float>());
  p::ResidualState<double> s;
  p::ResidualState<float> t;
  double worst = 0, largest = 0;
  for (int k = 0; k < 20000; ++k) {
    const double phase = 0.009 * k;
    const double q = 0.6 + 0.4 * std::sin(phase), u = 1.5 * std::cos(phase), e = 6 * std::sin(phase + 0.3);
    const double wide = p::step(c, s, samples(q, u, e, true, 2000 * (k + 1), static_cast<std::uint32_t>(k)));
    const float narrow =
        p::step(f, t, samples(static_cast<float>(q), static_cast<float>(u), static_cast<float>(e), true, 2000 * (k + 1), static_cast<std::uint32_t>(k)));
    worst = std::fmax(worst, std::fabs(wide - static_cast<double>(narrow)));
    largest = std::fmax(largest, std::fabs(wide));
  }
  std::printf("residual compensator, float beside double: %.2e of %.2f N m\n", worst, largest);
  check(largest > 1 && worst < 1e-2 * largest, "float stays near double");
}

template <class T> void strap_stays_bounded() {
  p::StrapEstimatorParams<T> params;
  params.bodies = example<T>().bodies;
  params.bandwidth = T(30);
  params.slowest = T(1);
  params.forgetting = T(5);
  params.prior_mismatch = T(0.02);
  params.excitation = T(0.01);
  params.stiffness_min = T(7);
  params.stiffness_max = T(21);
  params.damping_min = T(0.2);
  params.damping_max = T(0.8);
  params.period = T(0.002);
  const auto c = p::coefficients(params);
  check(c.valid, "the estimator makes sense");
  p::StrapEstimatorState<T> s;
  Random random(43);
  long outside = 0, learnt = 0;
  for (long k = 0; k < 200000; ++k) {
    const T swing = T(0.6) + T(0.5) * p::sin(T(0.008) * T(static_cast<T>(k % 4000)));
    p::step(c, s,
            samples(odd(random, swing), odd(random, T(random.uniform(-3, 3))), odd(random, T(random.uniform(-15, 15))),
                    random.uniform() > 1e-3, 0, 0u));
    outside += !(s.stiffness >= T(7) && s.stiffness <= T(21) && s.damping >= T(0.2) && s.damping <= T(0.8));
    learnt += s.learns;
  }
  check(outside == 0, "stiffness and damping stay within their bounds");
  check(learnt > 1000, "and something was learnt");
}

template <class T> void emg() {
  p::EmgTorqueParams<T> params;
  params.band.count = 0;
  params.envelope.count = 1;
  params.envelope.section[0] = {T(0.1), T(0), T(0), T(-0.9), T(0)};
  params.muscles = 2;
  params.powers = 2;
  params.weight[0][0] = T(0.5);
  params.weight[1][0] = T(-100);
  params.weight[2][0] = T(80);
  params.weight[2][1] = T(10);
  params.floor[0] = params.floor[1] = T(0.001);
  params.ceiling[0] = params.ceiling[1] = T(1);
  params.patience = 50;
  params.torque_limit = T(30);
  const auto c = p::coefficients(params);
  p::EmgTorqueState<T> s;
  for (int k = 0; k < 400; ++k) {
    const T sample[p::max_muscles] = {k % 2 == 0 ? T(0.02) : T(-0.02), T(0.05), T(0), T(0)};
    p::listen(c, s, sample);
  }
  check(p::is_heard(c, s), "a muscle is heard");
  check_close(p::emg_torque(c, s, T(0.5)), T(0.5 - 2 + 4 + 0.25), T(1e-4), "the map");
  for (int k = 0; k < 200; ++k) p::listen(c, s, {T(0), T(0), T(0), T(0)});
  check(!p::is_heard(c, s), "a detached electrode is not");
  check(p::emg_torque(c, s, std::numeric_limits<T>::quiet_NaN()) == T(0), "an angle that is no number");
  Random random(44);
  long wrong = 0;
  for (int k = 0; k < 200000; ++k) {
    p::listen(c, s, {random.anything<T>(), odd(random, T(0.1)), T(0), T(0)});
    const T torque = p::emg_torque(c, s, odd(random, T(0.3)));
    wrong += !(torque >= T(-30) && torque <= T(30));
  }
  check(wrong == 0, "finite and within the limit, whatever comes in");
}

int main() {
  nonsense<double>();
  nonsense<float>();
  rests<double>();
  rests<float>();
  refuses<double>();
  refuses<float>();
  phases();
  float_follows_double();
  strap_stays_bounded<double>();
  strap_stays_bounded<float>();
  emg<double>();
  emg<float>();
  return failures();
}
