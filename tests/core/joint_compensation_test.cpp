// A joint carried by its own model: against closed forms, in every fault, and over a million cycles of anything.
#include "example.hpp"
#include <pellucid/joint_compensation.hpp>
#include <pellucid/sample.hpp>

namespace p = pellucid;

template <class T> p::JointCompensationParams<T> sensible() {
  p::JointCompensationParams<T> params;
  params.body = {T(0.05), T(1.5), T(0.2), T(0.1), {T(0.3), T(0.25), T(0.1), T(0.08), T(0), T(0), T(0.15), T(0.1), T(0.06)}};
  params.gravity_share = T(1);
  params.friction_share = T(0.8);
  params.bandwidth = T(200);
  params.gate = {T(5), T(250), T(8), T(-1), T(2.5), T(0.05), T(0.005), 2, T(1e-3)};
  return params;
}

/// After the filter has settled: gravity, offset and a share of the friction at the ramp's speed.
template <class T> void carries(T speed) {
  const auto params = sensible<T>();
  const auto c = p::coefficients(params);
  p::JointCompensationState<T> s;
  check(c.gate.valid, "sensible numbers are sound");
  T q = speed > T(0) ? T(-0.4) : T(1.2), u = T(0);
  for (std::uint32_t k = 1; k <= 400; ++k) {
    q += speed * T(1e-3);
    u = p::step(c, s, p::position_only<T>(q, std::int64_t(k) * 1000, k));
  }
  const double at = static_cast<double>(q), v = static_cast<double>(speed);
  const double weight = 1.5 * std::sin(at) + 0.2 * std::cos(at);
  const double alpha = weight * v > 0 ? 0.15 : 0.1, smooth = std::tanh(v / 0.06);
  const double friction = (v > 0 ? 0.3 : 0.25) * smooth + (v > 0 ? 0.1 : 0.08) * v + alpha * std::fabs(weight) * smooth;
  check_close(static_cast<double>(s.velocity), v, 1e-3, "the ramp's speed");
  check_close(static_cast<double>(u), weight + 0.1 + 0.8 * friction, 2e-3, "what is carried");
  check(s.gate.fault == p::SafetyFault::none, "no fault");
}

/// Half of the samples lost: the speed stays, since the time that passed is the sample's own.
template <class T> void bears_lost_samples() {
  const auto c = p::coefficients(sensible<T>());
  p::JointCompensationState<T> s;
  std::uint32_t number = 0;
  for (std::int64_t k = 1; k <= 800; k += 1 + k % 2) {
    const T q = T(0.001) * static_cast<T>(static_cast<std::int32_t>(k)) - T(0.4);
    p::step(c, s, p::position_only<T>(q, k * 1000, ++number));
  }
  check_close(static_cast<double>(s.velocity), 1.0, 2e-3, "the speed, with samples lost");
}

template <class T> void refuses() {
  const auto shut = [](auto change) {
    auto params = sensible<T>();
    change(params);
    const auto c = p::coefficients(params);
    p::JointCompensationState<T> s;
    const T u = p::step(c, s, p::position_only<T>(T(0.5), 1000, 1));
    return !c.gate.valid && u == T(0) && s.gate.fault == p::SafetyFault::configuration;
  };
  check(shut([](auto& x) { x.body.friction.coulomb_positive = T(-0.1); }), "friction that drives");
  check(shut([](auto& x) { x.body.friction.velocity_width = T(0); }), "a true sign");
  check(shut([](auto& x) { x.friction_share = T(1.2); }), "more than all of the friction");
  check(shut([](auto& x) { x.bandwidth = std::numeric_limits<T>::quiet_NaN(); }), "a bandwidth that is none");
  check(shut([](auto& x) { x.body.gravity_sine = std::numeric_limits<T>::infinity(); }), "gravity without end");
  check(shut([](auto& x) { x.gate.period = T(0); }), "no period");
}

template <class T> void fuzz() {
  const auto params = sensible<T>();
  const auto c = p::coefficients(params);
  p::JointCompensationState<T> s;
  Random random(17);
  long unsafe = 0, faults = 0, moved = 0;
  std::int64_t time = 0;
  std::uint32_t number = 0;
  double phase = 0;
  const T step = c.gate.max_change * T(1 + 1e-5);
  for (int k = 0; k < 1000000; ++k) {
    const T before = s.gate.output;
    const double kind = random.uniform();
    phase += 4e-3;
    p::Samples<T> samples = p::position_only(static_cast<T>(0.7 + std::sin(phase)), time += 1000, ++number);
    p::Sample<T>& input = samples.position;
    if (kind < 0.003)
      input.value = random.anything<T>();
    else if (kind < 0.005)
      input.time = static_cast<std::int64_t>(random.bits());
    else if (kind < 0.007)
      input.sequence = static_cast<std::uint32_t>(random.bits());
    else if (kind < 0.017)
      input.sequence -= 1;
    else if (kind < 0.019)
      input.valid = false;
    const T out = p::step(c, s, samples);
    bool safe = std::isfinite(out) && std::fabs(out) <= params.gate.effort_limit;
    const bool grows = std::fabs(out) > std::fabs(before) || out * before < 0;
    if (grows) safe = safe && std::fabs(out - before) <= step;
    if (s.gate.fault != p::SafetyFault::none) safe = safe && std::fabs(out) <= std::fabs(before);
    unsafe += !safe;
    moved += out != 0;
    if (s.gate.fault != p::SafetyFault::none && random.uniform() < 0.05) {
      ++faults;
      p::reset(s);
      time += 1000;
    }
  }
  check(unsafe == 0, "nothing unsafe in a million cycles");
  check(faults > 1000 && moved > 100000, "there were faults, and efforts");
}

void samples() {
  using F = p::SafetyFault;
  const p::SampleRules rules{5000, 2};
  p::SampleState s;
  const auto seen = [&](float value, std::int64_t time, std::uint32_t number, bool valid, std::int64_t now) {
    return p::examine(rules, s, p::Sample<float>{value, time, number, valid}, now);
  };
  check(seen(1, 1000, 0xffffffffu, true, 1100) == F::none, "the first");
  check(seen(1, 2000, 0, true, 2100) == F::none, "a number that wraps around");
  check(seen(1, 2000, 0, true, 3100) == F::none && seen(1, 2000, 0, true, 4100) == F::none, "seen again, twice");
  check(seen(1, 2000, 0, true, 5100) == F::stale, "seen again too often");
  check(seen(1, 3000, 1, true, 8001) == F::stale, "too old");
  check(seen(1, 3000, 1, true, 8000) == F::none, "just not too old");
  check(seen(1, 2900, 2, true, 7000) == F::out_of_order, "a time that goes backwards");
  check(seen(1, 4000, 0, true, 8000) == F::out_of_order, "a number that goes backwards");
  check(seen(1, 9001, 3, true, 9000) == F::out_of_order, "from the future");
  check(seen(1, 9001, 3, true, 9500) == F::stale, "after too long a gap");
  check(seen(1, 4000, 4, false, 4100) == F::not_finite, "not valid");
  check(seen(std::numeric_limits<float>::quiet_NaN(), 4000, 4, true, 4100) == F::not_finite, "NaN");
  check(seen(1, std::numeric_limits<std::int64_t>::min(), 4, true, std::numeric_limits<std::int64_t>::max()) != F::none,
        "clocks at their ends");
}

int main() {
  for (const double speed : {1.5, -1.5, 0.3}) {
    carries<float>(static_cast<float>(speed));
    carries<double>(speed);
  }
  bears_lost_samples<float>();
  bears_lost_samples<double>();
  refuses<float>();
  refuses<double>();
  fuzz<float>();
  fuzz<double>();
  samples();
  return failures();
}
