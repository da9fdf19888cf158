// The core asks for no memory: every allocation is counted while it runs.
#include "example.hpp"
#include "law_numbers.hpp"

#include <pellucid/supervisor.hpp>

#include <cstdlib>
#include <new>

namespace {
long allocations = 0;
}
extern "C" {
void* __real_malloc(std::size_t);
void* __real_calloc(std::size_t, std::size_t);
void* __real_realloc(void*, std::size_t);
void* __wrap_malloc(std::size_t n) {
  ++allocations;
  return __real_malloc(n);
}
void* __wrap_calloc(std::size_t n, std::size_t size) {
  ++allocations;
  return __real_calloc(n, size);
}
void* __wrap_realloc(void* p, std::size_t n) {
  ++allocations;
  return __real_realloc(p, n);
}
}
void* operator new(std::size_t n) { return __wrap_malloc(n); }
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }

namespace p = pellucid;

/// A law over a swing, with samples that are none, faults and resets among them.
template <class L, class S> void swing() {
  p::Controller<L> c;
  check(p::configure(c, typical_params<typename L::Params>()), L::name);
  long moving = 0, faults = 0;
  for (std::uint32_t k = 0; k < 100000; ++k) {
    const S q = S(1.2) + S(0.6) * static_cast<S>(reference_at(k));
    const std::int64_t now = 1000 * static_cast<std::int64_t>(k);
    p::Samples<S> in{{q, now, k, k % 997 != 0}, {q, now, k, true}, {q, now, k, k % 3 == 0}, {q, now, k, k % 5 == 0}};
    if (k % 1499 == 0) in.position.value = std::numeric_limits<S>::quiet_NaN();
    moving += p::step(c, in, now) != S(0);
    faults += c.fault != p::SafetyFault::none;
    if (k % 100 == 0) p::reset(c);
  }
  check(moving > 30000 && faults > 1000, "the law moved, and was shut");
}

/// The same under a supervisor whose checks are all at work.
template <class L, class S> void supervised_swing() {
  p::SupervisorParams<S> rules;
  rules.encoder.resolution = S(1e-3);
  rules.encoder.acceleration_limit = S(5000);
  rules.encoder.speed_limit = S(8);
  rules.body.inertia = S(0.05);
  rules.drive.expected = rules.joint_expected = rules.force.expected = rules.muscle.expected = 1;
  rules.drive.tolerance = rules.joint_tolerance = S(1);
  rules.reset_delay = S(0.01);
  rules.healthy_samples = 10;
  p::Supervised<L> s;
  check(p::configure(s, typical_params<typename L::Params>(), rules), L::name);
  long moving = 0;
  std::uint32_t token = 0;
  for (std::uint32_t k = 0; k < 100000; ++k) {
    const S q = S(1.2) + S(0.6) * static_cast<S>(reference_at(k));
    const std::int64_t now = 1000 * static_cast<std::int64_t>(k);
    p::Samples<S> in{{q, now, k, k % 997 != 0}, {q, now, k, true}, {q, now, k, true}, {q, now, k, k % 5 == 0}};
    if (k % 1499 == 0) in.position.value = std::numeric_limits<S>::quiet_NaN();
    if (k % 5003 == 0) s.state.doing.word ^= 1u;
    const auto out = p::step(s, in, p::Feedback<S>{{s.state.output, now, k, true}, {q, now, k, true}, token}, now);
    token = out.challenge;
    moving += out.effort != S(0);
  }
  check(moving > 30000 && p::faults_of(s.state) > 100, "it moved, and was stopped");
}

template <class S> void laws() {
  p::Laws::for_each([](auto of) { swing<typename decltype(of)::template law<S>, S>(); });
  p::Laws::for_each([](auto of) { supervised_swing<typename decltype(of)::template law<S>, S>(); });
  p::StrapEstimatorParams<S> worn{typical_params<p::ResidualParams<S>>().bodies, S(30), S(1), S(5), S(0.02), S(0.01),
                                  S(7), S(21), S(0.2), S(0.8), S(0.002)};
  const auto f = p::coefficients(worn);
  check(f.valid, "the strap's estimator makes sense");
  p::StrapEstimatorState<S> sf;
  p::EmgTorqueParams<S> emg;
  emg.muscles = p::max_muscles;
  emg.torque_limit = S(30);
  for (S& most : emg.ceiling) most = S(1);
  const auto g = p::coefficients(emg);
  p::EmgTorqueState<S> sg;
  const auto h = p::coefficients(p::TorqueLoopParams<S>{S(2), S(20), S(0.01), S(25), S(30), S(170), 2, 1, S(0.002)});
  p::TorqueLoopState<S> sh;
  for (std::uint32_t k = 0; k < 100000; ++k) {
    const S q = S(1.2) + S(0.6) * static_cast<S>(reference_at(k));
    p::listen(g, sg, {q, q, q, q});
    p::Samples<S> in = p::position_only(q, 2000 * static_cast<std::int64_t>(k), k);
    in.torque = in.muscle = in.position;
    in.muscle.value = p::emg_torque(g, sg, q);
    p::step(h, sh, S(0.2) * q, S(0.1) * q);
    p::step(f, sf, in);
  }
}

int main() {
  delete new volatile int(1);
  check(allocations > 0, "the counter counts");
  allocations = 0;
  const auto c = p::coefficients(example_plant<double>());
  const auto f = p::coefficients(example_plant<float>());
  const auto d = p::coefficients(example_plant<p::Dual<double, 8>>());
  const auto l = p::coefficients(example_plant<p::Lanes<double, 8>>());
  p::GearedPlantParams<double> geared;
  geared.joint.link = example_joint<double>();
  geared.joint.motor_inertia = 0.05;
  geared.joint.transmission = {600, 1, 0.01};
  geared.loop.period = 1e-3;
  const auto m = p::coefficients(geared);
  auto ms = p::balanced(m, 0.1, 0.0);
  p::CoupledPlantParams<double> worn;
  worn.motor_inertia = worn.orthosis.inertia = worn.limb.inertia = 0.1;
  worn.spring_stiffness = worn.loop.stiffness = 170;
  worn.strap = {20, 0.5, 0.01, 1, 0.1};
  worn.loop.period = 2e-3;
  const auto w = p::coefficients(worn);
  auto ws = p::balanced(w, 0.1, 0.0);
  const auto gate = p::coefficients(p::SafetyParams<double>{10, 500, 20, -1, 1.5, 0.2, 0.01, 3, 1e-3});
  p::BiquadCoefficients<double> filter;
  filter.count = 2;
  p::HillTorqueParams<double, 3> muscles;
  muscles.count = 3;
  for (auto& muscle : muscles.muscle) {
    muscle.activation = {-1, 0.02, 0.02, 1e-3};
    muscle.muscle.optimal_fibre_length = 0.09;
    muscle.muscle.tendon_slack_length = 0.1;
  }
  const auto h = p::coefficients<64>(muscles);
  p::HillTorqueState<double, 3, 64> hs;
  p::PlantState<double> cs;
  p::PlantState<float> fs;
  p::PlantState<p::Dual<double, 8>> ds;
  p::PlantState<p::Lanes<double, 8>> ls;
  p::SafetyState<double> gs;
  p::BiquadState<double> bs;
  laws<double>();
  laws<float>();
  for (std::size_t k = 0; k < 100000; ++k) {
    const double r = reference_at(k);
    const double q = p::step<p::Friction::stiction>(c, cs, p::PlantInput<double>{r, 0, 0, 0}).measured_position;
    p::step<p::Friction::smooth>(f, fs, p::PlantInput<float>{static_cast<float>(r), 0, 0, 0});
    p::step(m, ms, p::PlantInput<double>{r, 0, 0, 0});
    p::step(w, ws, p::CoupledPlantInput<double>{r, 1, 0});
    p::step(h, hs, {{r, r, r}, {0.2, 0.2, 0.2}, {r, r, r}, {0.04, 0.04, 0.04}});
    if (k % 100 == 0) {
      p::step<p::Friction::smooth>(d, ds, {p::Dual<double, 8>(r), {}, {}, {}});
      p::step<p::Friction::smooth>(
          l, ls, {p::Lanes<double, 8>(r), p::Lanes<double, 8>(0), p::Lanes<double, 8>(0), p::Lanes<double, 8>(0)});
    }
    p::step(gate, gs,
            p::SafetyInput<double>{p::step(filter, bs, q), q, 0, static_cast<std::int64_t>(k) * 1000,
                                   static_cast<std::uint32_t>(k), true});
  }
  const long counted = allocations;
  std::printf("allocations in 100000 cycles: %ld\n", counted);
  check(counted == 0, "no allocation");
  return failures();
}
