// Control laws of a worn elbow: nonsense, rest, what does not drive, and the estimator's poles.
#include "check.hpp"

#include <pellucid/directional_compensation.hpp>
#include <pellucid/position_prediction.hpp>
#include <pellucid/reaching.hpp>
#include <pellucid/transparent_compensation.hpp>
#include <pellucid/worn_geared_plant.hpp>

namespace p = pellucid;

namespace {

template <class S> p::SafetyParams<S> gate() {
  return {S(10), S(1000), S(8), S(0), S(2.6), S(0.1), S(0.005), 2, S(0.001)};
}

template <class S> p::PositionPredictionParams<S> prediction() {
  return {S(2), S(0.3), S(0.4), S(400), S(0.02), {8}, gate<S>()};
}

template <class S> p::DirectionalCompensationParams<S> directional() {
  p::DirectionalCompensationParams<S> params;
  params.up = {S(2.3), S(0.3), S(0.3), S(0.06), S(0.05), S(-1)};
  params.down = {S(1.8), S(0.3), S(0.25), S(0.04), S(0.05), S(-1.9)};
  params.dead_band = S(0.05);
  params.inertia_limit = S(0.4);
  params.speed = {8};
  params.gate = gate<S>();
  return params;
}

template <class S> p::TransparentCompensationParams<S> transparent() {
  p::TransparentCompensationParams<S> t;
  t.body = {S(0.05), S(2), S(0.3), S(0), {S(0.25), S(0.2), S(0.05), S(0.04), S(0), S(0), S(0.13), S(0.11), S(0.06)}};
  t.gravity_share = S(1);
  t.friction_share = S(0.9);
  t.inertia_share = S(0.3);
  t.friction_lead = S(0.01);
  t.estimator = {S(200), S(0.02), 20};
  t.acceleration_limit = S(25);
  t.energy_store = S(0.2);
  t.feedback = {S(1), S(5), S(0.5), S(300), S(0.02), S(3)};
  t.emg = {S(0.08), S(2.4), S(0.1), S(0.5), S(25), S(0.5)};
  t.oscillator = {S(4), S(1), S(16), S(8), S(8), S(2), S(0.02)};
  t.oscillator_share = S(0.5);
  t.oscillator_lead = S(0.02);
  t.observer = {S(0.5), S(20), S(0.008), S(3)};
  t.dither = {S(0.5), S(900)};
  t.gate = gate<S>();
  return t;
}

/// The same with a force sensor that feels nothing.
template <class S> p::Samples<S> with_sensor(p::Samples<S> samples) {
  samples.interaction = samples.position;
  samples.interaction.value = S(0);
  return samples;
}

/// Whatever comes in, what goes out is within the limits, and after a fault it only falls.
template <class S, class C, class St> void survives(const C& c, St& state, long cycles, std::uint64_t seed) {
  Random random(seed);
  check(c.gate.valid, "the example makes sense");
  long unsafe = 0, moving = 0, faults = 0;
  S before = 0;
  std::int64_t time = 0;
  std::uint32_t sequence = 0;
  const S change = c.gate.max_change * (S(1) + S(1e-5));
  for (long k = 0; k < cycles; ++k) {
    time += 1000;
    ++sequence;
    p::Samples<S> in;
    in.position = {S(1.4) + S(0.5) * p::sin(S(0.006) * S(static_cast<S>(k % 1047))), 0, 0, true};
    in.interaction.value = S(random.uniform(-1, 1));
    in.muscle.value = S(random.uniform(-10, 10));
    in.interaction.valid = in.muscle.valid = random.uniform() < 0.9;
    const double chance = random.uniform();
    if (chance < 1e-3) in.position.value = random.anything<S>();
    if (chance > 0.999) in.interaction.value = random.anything<S>();
    if (chance > 0.4 && chance < 0.401) in.muscle.value = random.anything<S>();
    if (chance > 0.5 && chance < 0.5003) time += static_cast<std::int64_t>(random.bits() >> 40);
    if (chance > 0.6 && chance < 0.6003) sequence += static_cast<std::uint32_t>(random.bits());
    if (chance > 0.7 && chance < 0.7003) in.position.valid = false;
    in.position.time = time;
    in.position.sequence = sequence;
    const S out = p::step(c, state, in);
    const bool fault = state.gate.fault != p::SafetyFault::none;
    bool ok = out >= S(-10) && out <= S(10);
    if (std::fabs(out) > std::fabs(before)) ok = ok && !fault && std::fabs(out - before) <= change;
    unsafe += !ok;
    moving += out != S(0);
    before = out;
    faults += fault;
    if (fault && random.uniform() < 0.05) p::reset(state);
  }
  check(unsafe == 0, "no unsafe torque");
  check(moving > cycles / 4 && faults > cycles / 1000, "the gate opened and shut");
}

template <class S> void nonsense() {
  const auto a = p::coefficients(prediction<S>());
  p::PositionPredictionState<S> sa;
  survives<S>(a, sa, 200000, 61);
  const auto b = p::coefficients(directional<S>());
  p::DirectionalCompensationState<S> sb;
  survives<S>(b, sb, 200000, 62);
  const auto c = p::coefficients(transparent<S>());
  p::TransparentCompensationState<S> sc;
  survives<S>(c, sc, 200000, 63);
}

/// Equation 8 made safe: odd in v, finite at rest, never more than its limit.
void equation_eight() {
  const p::DirectionTerms<double> t{0, 0, 0, 0, 0.05, -1.9};
  check_close(p::inertia_term(t, 10.0, 0.5), 0.05 * std::pow(0.5, -1.9), 1e-12, "J |v|^k");
  check(p::inertia_term(t, 0.4, 1e-300) == 0.4, "limited towards rest");
  auto params = directional<double>();
  params.up = params.down;
  const auto c = p::coefficients(params);
  const double rates[] = {0.3, -0.3};
  for (const double rate : rates) {
    p::DirectionalCompensationState<double> s;
    double u = 0;
    for (std::uint32_t k = 0; k < 400; ++k)
      u = p::step(c, s, p::position_only<double>(1.2 + rate * 0.001 * k, 1000 * k, k));
    const double q = 1.2 + rate * 0.399;
    const double gravity = 1.8 * std::sin(q) + 0.3 * std::cos(q);
    const double expected = 0.04 * rate + (rate > 0 ? 1 : -1) * (0.25 + std::fmin(0.05 * std::pow(0.3, -1.9), 0.4));
    check_close(u - gravity, expected, 1e-6, "the law in words of the paper");
  }
}

/// The estimator follows a constant acceleration without error, and an outlier leaves no trace.
template <class S> void estimator() {
  const auto c = p::coefficients(p::MotionEstimatorParams<S>{S(200), S(0.02), 20}, S(0.001));
  check(c.valid, "the estimator makes sense");
  p::MotionEstimatorState<S> s;
  const auto true_position = [](int k) { return S(0.1) + S(0.5) * S(2) * S(1e-6) * S(k) * S(k); };
  for (int k = 0; k < 600; ++k) p::step(c, s, k == 300 ? S(55) : true_position(k));
  check_close(s.acceleration, S(2), sizeof(S) == 8 ? S(1e-6) : S(0.5), "acceleration");
  check_close(s.velocity, S(2) * S(0.599), sizeof(S) == 8 ? S(1e-8) : S(5e-3), "velocity");
  for (int k = 0; k < 40; ++k) p::step(c, s, std::numeric_limits<S>::quiet_NaN());
  check(!s.started, "after too many rejections it starts again");
}

/// A robot pushed to and fro by hand, in series with what the law adds: over a closed cycle it takes energy.
void does_not_drive() {
  const double shares[][2] = {{0.0, 0.0}, {0.9, 0.0}, {0.9, 1.0}};
  for (const auto& [share, dither] : shares) {
    auto params = transparent<double>();
    params.friction_share = share;
    params.dither.torque = dither;
    params.feedback.proportional = params.feedback.integral = 0;
    params.emg.share = params.oscillator_share = 0;
    const auto law = p::coefficients(params);
    p::TransparentCompensationState<double> state;
    double work = 0, friction = 0;
    const double rate = 5;
    for (std::uint32_t k = 0; k < 20000; ++k) {
      const double phase = rate * 0.001 * k;
      const double q = 1.4 + 0.3 * std::sin(phase), v = 0.3 * rate * std::cos(phase);
      const double u = p::step(law, state, p::position_only<double>(q, 1000 * k, k));
      if (k < 20000 - 2 * 1257) continue;  // the last two turns, 1256.6 periods each
      work += 0.001 * v * (u - 2 * std::sin(q) - 0.3 * std::cos(q));
      friction += 0.001 * v * p::friction(law.body.friction, v, 2 * std::sin(q));
    }
    check(work <= friction, "no more is put in than friction takes out");
    if (share > 0) check(work > 0.5 * friction, "and most of it is");
  }
}

/// Any body, any shares, any closed motion: beyond gravity no more is put in than friction takes and the store holds.
void never_drives() {
  Random random(71);
  double share_left = 1;
  for (int draw = 0; draw < 60; ++draw) {
    auto params = transparent<double>();
    auto& body = params.body;
    body.inertia = random.uniform(0.01, 0.1);
    body.gravity_sine = random.uniform(-4, 4), body.gravity_cosine = random.uniform(-1, 1);
    const auto up_to = [&random](double most) { return random.uniform(0, most); };
    body.friction = {up_to(0.6), up_to(0.6), up_to(0.3), up_to(0.3),  0,
                     0,          up_to(0.4), up_to(0.4), std::pow(10, random.uniform(-2, 0))};
    params.friction_share = draw % 10 == 0 ? 1 : random.uniform();
    params.inertia_share = draw % 10 == 1 ? 0 : random.uniform();
    params.friction_lead = random.uniform(0, 0.03);
    params.estimator.bandwidth = random.uniform(50, 250);
    params.energy_store = random.uniform(0, 0.3);
    params.feedback.proportional = params.feedback.integral = params.emg.share = params.oscillator_share = 0;
    params.dither = {draw % 2 ? random.uniform(0, 2) : 0, random.uniform(600, 1500)};
    const auto law = p::coefficients(params);
    check(law.gate.valid, "the drawn law makes sense");
    p::TransparentCompensationState<double> state;
    const double rate = random.uniform(1, 8), size = std::pow(10, random.uniform(-3, -0.3));
    const double second = random.uniform(-0.5, 0.5), turn = random.uniform(0, 6.28);
    double work = 0, friction = 0;
    for (std::uint32_t k = 0; k < 12000; ++k) {
      const double at = rate * 0.001 * k;
      const double q = 1.3 + size * (std::sin(at) + second * std::sin(2 * at + turn));
      const double v = size * rate * (std::cos(at) + 2 * second * std::cos(2 * at + turn));
      const double weight = body.gravity_sine * std::sin(q) + body.gravity_cosine * std::cos(q);
      const double u = p::step(law, state, p::position_only<double>(q, 1000 * k, k));
      if (std::fabs(u) < 9.9) work += 0.001 * v * (u - weight);
      friction += 0.001 * std::fabs(v * p::friction(law.body.friction, v, weight));
    }
    check(work <= params.energy_store + 1.02 * friction + 1e-4, "no more than friction takes and the store holds");
    share_left = std::fmin(share_left, 1 - work / (friction + params.energy_store));
  }
  check(share_left < 0.2, "and some come close to it");
}

/// Rest is gravity alone, and a motion too slow to be one changes nothing, in either direction.
template <class S> void rest() {
  auto params = transparent<S>();
  params.dither.torque = S(0);
  params.gate.rate_limit = S(1e6);
  const auto c = p::coefficients(params);
  const S wanted = S(2) * p::sin(S(1.2)) + S(0.3) * p::cos(S(1.2));
  const S tolerance = sizeof(S) == 8 ? S(1e-9) : S(1e-5);
  const S slow[] = {S(0), S(1e-30), S(-1e-30), S(1e-13), S(-1e-13)};
  for (const S speed : slow) {
    p::TransparentCompensationState<S> s;
    S u{};
    for (std::uint32_t k = 0; k < 3000; ++k)
      u = p::step(c, s, with_sensor(p::position_only(S(1.2) + speed * S(static_cast<S>(k)), 1000 * k, k)));
    check_close(u, wanted, tolerance, "gravity alone");
  }
}

/// What is constant beside the model is found, however the known torques swing, when all of them are of one age.
void disturbance() {
  const p::DisturbanceObserverParams<double> params{0.5, 30, 0.008, 3};
  const auto c = p::coefficients(params, 0.001);
  const auto prompt = p::coefficients(p::DisturbanceObserverParams<double>{0.5, 30, 0, 3}, 0.001);
  check(c.valid && c.delay == 8, "the observer makes sense");
  p::DisturbanceObserverState<double> s, hasty;
  const auto torque = [](int k) { return 1.2 * std::sin(0.02 * k); };
  const auto taken = [](int k) { return 0.7 * std::cos(0.03 * k); };
  double worst = 0, worse = 0;
  for (int k = 0; k < 2000; ++k) {
    const double late = 0.4 + taken(k - 8) - torque(k - 8);  // the wearer's torque: what is left is 0.4 of resistance
    const double found = p::step(c, s, torque(k), late, true, taken(k - 8));
    const double other = p::step(prompt, hasty, torque(k), late, true, taken(k - 8));
    if (k < 1000) continue;
    worst = std::fmax(worst, std::fabs(found - 0.5 * 0.4));
    worse = std::fmax(worse, std::fabs(other - 0.5 * 0.4));
  }
  check(worst < 1e-9, "half of the resistance, to the last digits");
  check(worse > 0.02, "a delay that is not known shows");
  for (int k = 0; k < 1000; ++k) p::step(c, s, 1.0, 9.0, false, 0.0);
  check(std::fabs(s.disturbance) < 1e-9, "without a sensor it is forgotten");
  for (int k = 0; k < 1000; ++k) p::step(c, s, 1.0, 99.0, true, 0.0);
  check(p::step(c, s, 1.0, 99.0, true, 0.0) == 3.0, "no more than its limit");
  check(!p::coefficients(p::DisturbanceObserverParams<double>{1, 30, 0.008, 3}, 0.001).valid, "a share of 1 is none");
  check(!p::coefficients(p::DisturbanceObserverParams<double>{0.5, 30, 0.04, 3}, 0.001).valid, "nor is 40 periods");
}

/// A wearer who pushes less than it takes to break a robot away moves it when it trembles, and not when it does not; a
/// tremble that is smaller than what contacts give hardly helps.
void dither() {
  const auto c = p::coefficients(p::DitherParams<double>{1.2, 942}, 0.001);
  p::WornGearedPlantParams<double> params;
  const double joint[p::geared_parameter_count] = {0.041, 2, 0.3, 0.0078, 600, 0.4, 0.0015, 0.22, 0.18, 0.06, 0.05,
                                                   0.05, 0.1, 0.14, 0.11, 0, 0.3, 0.05, 6, 6, 0, 0.02, 0.01};
  params.robot.joint = p::from_numbers<p::GearedJointParams<double>>(joint);
  params.robot.drive = {1, 0, 0, 0, 0};
  params.robot.loop.period = 0.001;
  params.robot.substeps = 10;
  params.strap = {120, 1.2, 0, 0, 0};
  params.limb = {0.06, 2.4, 0, 0.1, 0, 0, 0};
  const double hold = 2 * std::sin(1.2) + 0.3 * std::cos(1.2);
  double moved[4] = {};
  for (int run = 0; run < 4; ++run) {
    const bool on = run % 2 == 1;
    params.robot.joint.motor_friction.presliding.travel = run < 2 ? 0 : 3e-3;
    const auto plant = p::coefficients(params);
    auto body = p::balanced(plant, 1.2);
    p::DitherState<double> s;
    double sum = 0;
    for (int k = 0; k < 300; ++k) {
      const double tremble = on ? p::step(c, s) : 0.0;
      check(std::fabs(tremble) <= 1.2, "no more than its amplitude");
      sum += tremble;
      p::step(plant, body, hold + tremble, 2.4 * std::sin(1.2) + 0.2);
    }
    check(std::fabs(sum) < 2.4, "nothing on average");
    moved[run] = body.motor_position - p::balanced(plant, 1.2).motor_position;
  }
  check(moved[0] == 0, "it sticks");
  check(moved[1] > 0.005, "it gives way");
  check(moved[2] > 0 && moved[2] < 3e-3, "contacts give");
  check(moved[3] < 0.005, "and follow a small tremble");
  check(!p::coefficients(p::DitherParams<double>{1, 3200}, 0.001).valid, "not faster than two periods");
}

/// A torque that drives more than the store holds is let through no longer.
void store_runs_out() {
  p::EnergyObserverState<double> s;
  double given = 0;
  for (int k = 0; k < 5000; ++k) given += 0.001 * p::step(0.2, s, 0.001, 1.0, 1.0, 0.3);
  check(given <= 0.2 + 5 * 0.3 + 0.002 && given > 1.5, "the store and what friction takes, no more");
  check(p::step(0.2, s, 0.001, -1.0, 1.0, 0.0) == -1.0, "a brake always passes");
}

/// Everything at rest stays at rest, and a limb alone is a limb alone.
void plant() {
  p::WornGearedPlantParams<double> params;
  const double joint[p::geared_parameter_count] = {0.041, 2, 0.3, 0.0078, 600, 0.4, 0.0015, 0.22, 0.18, 0.06, 0.05,
                                                   0.05, 0.1, 0.14, 0.11, 0, 0.3, 0.05, 6, 6, 0, 0.02, 0.01};
  params.robot.joint = p::from_numbers<p::GearedJointParams<double>>(joint);
  params.robot.drive = {1.68, 0, 0, 0, 0};
  params.robot.loop.period = 0.001;
  params.strap = {120, 1.2, 0, 0, 0};
  params.limb = {0.06, 2.4, 0, 0.1, 0, 0, 0};
  const auto c = p::coefficients(params);
  auto s = p::balanced(c, 1.2);
  const double hold = (2 * std::sin(1.2) + 0.3 * std::cos(1.2)) / 1.68;
  for (int k = 0; k < 2000; ++k) p::step(c, s, hold, 2.4 * std::sin(1.2));
  check_close(s.limb_position, 1.2, 1e-3, "held");
  params.worn = false;
  const auto alone = p::coefficients(params);
  s = p::balanced(alone, 1.2);
  for (int k = 0; k < 300; ++k) p::step(alone, s, 5.0, 0.0);
  check(s.limb_position < 1.0 && s.link_position == 1.2, "the limb falls, the robot is not there");
}

/// Without noise a person arrives, and the plan is what the closed form says.
void person() {
  p::ReachingParams<double> who;
  who.limb = {0.06, 2.4, 0, 0.1, 0, 0, 0};
  who.stiffness = 5, who.damping = 0.5, who.reflex_stiffness = 2, who.reflex_damping = 0.3;
  who.reflex_delay = 0.035, who.muscle_delay = 0.02, who.activation_time = 0.04;
  who.flexion_max = 50, who.extension_max = 40, who.cocontraction = 0.01;
  who.noise_time = 0.05, who.visual_delay = 0.14, who.tolerance = 0.02, who.check_share = 0.8;
  who.correction_share = 0.5, who.correction_least = 0.2, who.sign_width = 0.05, who.period = 0.001;
  const auto c = p::coefficients(who);
  p::WornGearedPlantParams<double> params;
  params.worn = false;
  params.limb = who.limb;
  params.robot.loop.period = 0.001;
  params.robot.joint.motor_inertia = params.robot.joint.link.inertia = params.robot.joint.transmission.stiffness = 1;
  const auto plant = p::coefficients(params);
  auto body = p::balanced(plant, 1.0);
  auto s = p::holding(c, 1.0, p::ExpectedLoad<double>{});
  p::aim(c, s, p::ReachingTask<double>{1.6, 0.55, 0.7, 0.2, {}});
  double peak = 0;
  for (int k = 0; k < 2500; ++k) {
    const auto out = p::step(c, s, body.limb_position, body.limb_velocity, 0.0, 0.0);
    p::step(plant, body, 0.0, out.torque);
    if (body.limb_velocity > peak) peak = body.limb_velocity;
  }
  check_close(body.limb_position, 1.6, 0.021, "arrives");
  check_close(peak, 1.875 * 0.55 / 0.7, 0.08, "as fast as a minimum-jerk movement");
  check(s.count == 2, "after one correction");
}

/// A sine is learnt: its frequency, and where it goes next.
void oscillator() {
  const p::AdaptiveOscillatorParams<double> params{4, 1, 16, 8, 8, 2, 0.02};
  const auto c = p::coefficients(params, 0.001);
  p::AdaptiveOscillatorState<double> s;
  for (int k = 0; k < 40000; ++k) p::step(c, s, 1.0 + 0.4 * std::sin(5.5 * 0.001 * k));
  check_close(s.frequency, 5.5, 0.05, "frequency");
  const auto next = p::predict(c, s, 0.1);
  check_close(next.position, 1.0 + 0.4 * std::sin(5.5 * (39.999 + 0.1)), 0.03, "position to come");
  check(next.trust > 0.7, "trusted");
}

}  // namespace

int main() {
  nonsense<double>();
  nonsense<float>();
  equation_eight();
  estimator<double>();
  estimator<float>();
  does_not_drive();
  never_drives();
  rest<double>();
  rest<float>();
  disturbance();
  dither();
  store_runs_out();
  plant();
  person();
  oscillator();
  return failures();
}
