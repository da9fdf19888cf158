// The laws of a person who reaches and then holds, in every scalar.
#include "check.hpp"

#include <pellucid/dual.hpp>
#include <pellucid/lanes.hpp>
#include <pellucid/postural_reaching.hpp>

namespace p = pellucid;

namespace {

template <class S> p::PosturalParams<S> somebody() {
  p::PosturalParams<S> who;
  who.limb = {S(0.06), S(2.4), S(0), S(0.1), S(2), S(0), S(0.1)};
  who.posture_stiffness = S(15), who.movement_stiffness = S(5), who.posture_damping_ratio = S(0.35);
  who.movement_damping_ratio = S(0.25), who.movement_speed = S(0.5), who.stiffness_per_torque = S(3);
  who.reflex_stiffness = S(2), who.reflex_damping = S(0.3), who.reflex_delay = S(0.035), who.muscle_delay = S(0.02);
  who.activation_time = S(0.04), who.flexion_max = S(50), who.extension_max = S(40);
  who.cocontraction = S(0.012), who.cocontraction_most = S(0.15), who.cocontraction_rise = S(0.3);
  who.cocontraction_decay = S(0.1), who.late_time = S(1), who.noise_time = S(0.05), who.visual_delay = S(0.14);
  who.tolerance = S(0.02), who.check_share = S(0.82), who.correction_share = S(0.5), who.correction_least = S(0.2);
  who.correction_gain = S(0.9), who.correction_discount = S(0.7), who.refractory_time = S(0.15);
  who.patience = S(6), who.failures_most = S(8), who.fatigue_rate = S(0.009), who.recovery_rate = S(0.001);
  who.sign_width = S(0.05), who.period = S(0.001);
  return who;
}

/// Their forearm, alone.
template <class S> struct Arm {
  p::LimbCoefficients<S> limb;
  S position, velocity = S(0), inverse_inertia, period;
  Arm(const p::PosturalParams<S>& who, S at) : limb(p::coefficients(who.limb)), position(at), period(who.period) {
    inverse_inertia = S(1) / who.limb.inertia;
  }
  void move(const S& torque) {
    velocity = velocity + period * p::acceleration(limb, position, velocity, torque);
    position = position + period * velocity;
  }
};

const p::ReachingTask<double> up{1.6, 0.55, 0.7, 0.2, {}};

/// One movement of an arm that is free, or stuck; where it ends.
double movement(const p::PosturalCoefficients<double>& c, p::PosturalState<double>& s, Arm<double>& arm,
                const p::ReachingTask<double>& task, bool stuck, double seconds = 3) {
  p::aim(c, s, task);
  for (int k = 0; k < static_cast<int>(1000 * seconds); ++k) {
    const auto out = p::step(c, s, arm.position, arm.velocity, 0.0, 0.0);
    if (!stuck) arm.move(out.torque);
  }
  return arm.position;
}

void arrives() {
  const auto who = somebody<double>();
  const auto c = p::coefficients(who);
  auto s = p::holding(c, 1.0, p::ExpectedLoad<double>{});
  Arm<double> arm(who, 1.0);
  check_close(movement(c, s, arm, up, false), 1.6, who.tolerance, "without noise the target is reached");
  check(s.corrections == 1 && s.failures == 0 && s.given_up == 0, "with one correction, which helped");
  check(s.late == 0 && s.effort > 0, "nothing is late, and everything costs");
  // Told by how much one falls short within the tolerance, nothing is corrected: the target is the dead zone.
  movement(c, s, arm, {1.0, (1.0 - 1.6) * 0.98, 0.7, 0.2, {}}, false);
  check(s.corrections == 0, "an error within the tolerance is left as it is");
  check(std::fabs(arm.position - 1.0) > 0.2 * who.tolerance, "and is there");
}

void stiffens_in_posture() {
  const auto who = somebody<double>();
  const auto c = p::coefficients(who);
  const auto held = p::impedance(c, 0.0, who.cocontraction), moved = p::impedance(c, 0.5, who.cocontraction),
             faster = p::impedance(c, -7.0, who.cocontraction), tense = p::impedance(c, 0.0, 0.05);
  check(held.stiffness == 15 && moved.stiffness == 5 && faster.stiffness == 5, "the ends are what they are named");
  check_close(held.damping, 2 * 0.35 * std::sqrt(15 * 0.06), 1e-12, "so is the damping of posture");
  check_close(moved.damping, 2 * 0.25 * std::sqrt(5 * 0.06), 1e-12, "and of movement");
  check_close(tense.stiffness - held.stiffness, 3 * 90 * (0.05 - 0.012), 1e-9, "co-contraction adds to it");
  double last = held.stiffness;
  for (double v = 0.01; v < 0.6; v += 0.01) {
    const double now = p::impedance(c, v, who.cocontraction).stiffness;
    check(now <= last && last - now < 0.4, "it falls without a step");
    last = now;
  }
}

void learns() {
  const auto who = somebody<double>();
  const auto c = p::coefficients(who);
  const double before = 0.05;
  double last = 0;
  for (int i = 0; i <= 20; ++i) {
    const double late = 0.01 * i, up_to = p::adapted_cocontraction(c, before, late, 0.0);
    check(up_to == p::adapted_cocontraction(c, before, -late, 0.0), "either sign raises it alike");
    check(up_to > last && up_to >= who.cocontraction && up_to <= who.cocontraction_most, "the more, the larger");
    last = up_to;
  }
  check(p::adapted_cocontraction(c, before, 0.0, 0.0) < before, "without an error it decays");
  check(p::adapted_cocontraction(c, who.cocontraction, 0.0, 0.0) == who.cocontraction, "to what is always there");
  check(p::adapted_cocontraction(c, before, 0.0, 3.0) > p::adapted_cocontraction(c, before, 0.0, 0.0),
        "corrections that failed are errors too");
  check(p::adapted_cocontraction(c, before, 1e9, 0.0) == who.cocontraction_most, "and there is a most");

  auto s = p::holding(c, 1.0, p::ExpectedLoad<double>{});
  Arm<double> arm(who, 1.0);
  movement(c, s, arm, up, true);
  check(s.late > 0.4, "an arm that is stuck is late");
  movement(c, s, arm, {1.0, -1e-9, 0.7, 0.2, {}}, false);
  const double raised = s.cocontraction;
  check(raised > 0.1, "which is learnt from at the next target");
  const auto out = p::step(c, s, arm.position, arm.velocity, 0.0, 0.0);
  check(out.extensor > 0.1 && out.flexor > out.extensor, "antagonists show it");
  for (int i = 0; i < 40; ++i) movement(c, s, arm, {1.0, -1e-9, 0.7, 0.2, {}}, false, 1.5);
  check(s.cocontraction < 0.2 * raised, "and unlearnt while all goes well");
}

void stuck() {
  auto who = somebody<double>();
  who.patience = 100;
  const auto c = p::coefficients(who);
  auto s = p::holding(c, 1.0, p::ExpectedLoad<double>{});
  Arm<double> arm(who, 1.0);
  p::aim(c, s, up);
  double amplitudes[12] = {};
  int n = 0;
  for (int k = 0; k < 12000 && s.given_up == 0; ++k) {
    p::step(c, s, arm.position, arm.velocity, 0.0, 0.0);
    if (n < static_cast<int>(s.corrections)) amplitudes[n++] = s.submovements[p::postural_submovements - 1].amplitude;
  }
  check(n == 8 && s.failures == 8 && s.given_up == 1, "after so many that failed it is given up");
  // The first was decided before the arm was seen to be stuck.
  for (int i = 2; i < n; ++i) check_close(amplitudes[i] / amplitudes[i - 1], 0.7, 1e-3, "each is told less of the error");
  for (int k = 0; k < 1500; ++k) p::step(c, s, arm.position, arm.velocity, 0.0, 0.0);
  const auto rests = p::step(c, s, arm.position, arm.velocity, 0.0, 0.0);
  check_close(rests.planned, arm.position, 1e-9, "who has given up rests where the arm is");
  check(s.corrections == 8, "and corrects no more");
  // The plan says 1.0 again, and all begins anew.
  movement(c, s, arm, {1.3, 0.3, 0.7, 0.2, {}}, false);
  check_close(arm.position, 1.3, who.tolerance, "the next target is tried again");

  who.patience = 1;
  const auto hasty = p::coefficients(who);
  auto t = p::holding(hasty, 1.0, p::ExpectedLoad<double>{});
  Arm<double> wall(who, 1.0);
  movement(hasty, t, wall, up, true, 4);
  check(t.given_up == 1 && t.failures < 8, "or after so long");
}

void tires() {
  auto who = somebody<double>();
  who.fatigue_rate = 0.5;
  const auto c = p::coefficients(who);
  auto s = p::holding(c, 1.6, p::ExpectedLoad<double>{});
  Arm<double> arm(who, 1.6);
  const double fresh = p::step(c, s, arm.position, arm.velocity, 0.0, 0.0).flexor;
  double tired = 0;
  for (int k = 0; k < 60000; ++k) tired = p::step(c, s, arm.position, arm.velocity, 0.0, 0.0).flexor;
  check(s.fatigue[0] > 0.5 && s.fatigue[0] > s.fatigue[1], "who pulls tires, more than who does not");
  check(tired > 2 * fresh, "the same torque takes more excitation then");
}

/// With noise: the standard deviation of a held arm.
double wander(double cocontraction) {
  auto who = somebody<double>();
  who.noise_share = 0.015;
  const auto c = p::coefficients(who);
  auto s = p::holding(c, 1.6, p::ExpectedLoad<double>{});
  s.cocontraction = cocontraction;
  Arm<double> arm(who, 1.6);
  Random random(9);
  double sum = 0, squares = 0, normal[2];
  const int n = 60000;
  for (int k = 0; k < n; ++k) {
    for (double& x : normal) {
      x = -6;
      for (int i = 0; i < 12; ++i) x += random.uniform();
    }
    arm.move(p::step(c, s, arm.position, arm.velocity, normal[0], normal[1]).torque);
    sum += arm.position, squares += arm.position * arm.position;
  }
  return std::sqrt(squares / n - sum / n * (sum / n));
}

void noise() {
  const double loose = wander(0.012);
  check(loose > 3e-4 && loose < 5e-3, "a held arm wanders a little");
  // In a muscle that pulls already, what noise adds outweighs what stiffness takes only by little.
  check(wander(0.1) < 3 * loose, "co-contraction is noise and stiffness");
}

/// In S, what double gives: to its accuracy.
template <class S> void scalar(double accuracy, const char* name) {
  const auto who = somebody<S>();
  const auto wanted = somebody<double>();
  const auto c = p::coefficients(who);
  const auto reference = p::coefficients(wanted);
  auto s = p::holding(c, S(1), p::ExpectedLoad<S>{});
  auto t = p::holding(reference, 1.0, p::ExpectedLoad<double>{});
  Arm<S> arm(who, S(1));
  Arm<double> other(wanted, 1.0);
  p::aim(c, s, p::ReachingTask<S>{S(1.6), S(0.55), S(0.7), S(0.2), {}});
  p::aim(reference, t, up);
  for (int k = 0; k < 2000; ++k) {
    arm.move(p::step(c, s, arm.position, arm.velocity, S(0), S(0)).torque);
    other.move(p::step(reference, t, other.position, other.velocity, 0.0, 0.0).torque);
  }
  check(p::all(p::abs(arm.position - S(other.position)) < S(accuracy)), name);
}

template <class T> bool same_bits(T a, T b) { return std::memcmp(&a, &b, sizeof a) == 0; }

/// People who differ, side by side: each lane has the bits of one alone.
template <class T, std::size_t W> void lanes() {
  using L = p::Lanes<T, W>;
  auto all = somebody<L>();
  p::PosturalParams<T> one[W];
  for (std::size_t i = 0; i < W; ++i) {
    one[i] = somebody<T>();
    const T share = static_cast<T>(i) / static_cast<T>(W);
    one[i].visual_delay = T(0.1) + T(0.1) * share, one[i].reflex_delay = T(0.06) - T(0.03) * share;
    one[i].tolerance = T(0.01) + T(0.1) * share, one[i].noise_share = T(0.02) * share;
    one[i].visual_noise = T(0.005) * share, one[i].patience = T(3) * share, one[i].correction_gain = T(1) - T(0.5) * share;
    all.visual_delay.set(i, one[i].visual_delay), all.reflex_delay.set(i, one[i].reflex_delay);
    all.tolerance.set(i, one[i].tolerance), all.noise_share.set(i, one[i].noise_share);
    all.visual_noise.set(i, one[i].visual_noise), all.patience.set(i, one[i].patience);
    all.correction_gain.set(i, one[i].correction_gain);
  }
  const auto c = p::coefficients(all);
  auto s = p::holding(c, L(1), p::ExpectedLoad<L>{});
  Arm<L> arm(all, L(1));
  p::PosturalCoefficients<T> cs[W];
  p::PosturalState<T> ss[W];
  Arm<T> arms[W] = {Arm<T>(one[0], 1), Arm<T>(one[0], 1), Arm<T>(one[0], 1), Arm<T>(one[0], 1)};
  for (std::size_t i = 0; i < W; ++i) cs[i] = p::coefficients(one[i]), ss[i] = p::holding(cs[i], T(1), {});
  Random random(3);
  for (int m = 0; m < 3; ++m) {
    L target(0), duration(0);
    for (std::size_t i = 0; i < W; ++i) {
      const T to = static_cast<T>(random.uniform(0.8, 2.0)), in = static_cast<T>(random.uniform(0.3, 1.2));
      target.set(i, to), duration.set(i, in);
      p::aim(cs[i], ss[i], {to, T(0.9) * (to - T(1)), in, T(0.2), {}});
    }
    p::aim(c, s, {target, L(T(0.9)) * (target - L(1)), duration, L(T(0.2)), {}});
    for (int k = 0; k < 2500; ++k) {
      const T f = static_cast<T>(random.uniform(-1.7, 1.7)), e = static_cast<T>(random.uniform(-1.7, 1.7));
      const auto out = p::step(c, s, arm.position, arm.velocity, L(f), L(e));
      // In the second movement the arms are stuck.
      if (m != 1) arm.move(out.torque);
      for (std::size_t i = 0; i < W; ++i) {
        const auto wanted = p::step(cs[i], ss[i], arms[i].position, arms[i].velocity, f, e);
        if (m != 1) arms[i].move(wanted.torque);
        check(same_bits(out.torque[i], wanted.torque) && same_bits(out.extensor[i], wanted.extensor) &&
                  same_bits(out.planned[i], wanted.planned),
              "a person in a lane");
      }
    }
  }
  for (std::size_t i = 0; i < W; ++i) check(s.given_up[i] == ss[i].given_up, "who gives up");
}

/// Whatever comes in, what goes out is finite, and excitations are shares.
template <class T> void nonsense() {
  const auto c = p::coefficients(somebody<T>());
  auto s = p::holding(c, std::numeric_limits<T>::quiet_NaN(), p::ExpectedLoad<T>{});
  Random random(6);
  for (int k = 0; k < 200000; ++k) {
    if (k % 500 == 0)
      p::aim(c, s, {random.anything<T>(), random.anything<T>(), random.anything<T>(), random.anything<T>(),
                    {random.anything<T>(), 0, 0, random.anything<T>(), 0}});
    const auto out = p::step(c, s, random.anything<T>(), random.anything<T>(), random.anything<T>(), random.anything<T>());
    check(std::isfinite(out.torque) && out.flexor >= 0 && out.flexor <= 1 && out.extensor >= 0 && out.extensor <= 1,
          "defined");
  }
}

}  // namespace

int main() {
  arrives();
  stiffens_in_posture();
  learns();
  stuck();
  tires();
  noise();
  scalar<float>(2e-4, "float");
  scalar<p::Dual<double, 4>>(1e-12, "Dual<double>");
  scalar<p::Lanes<double, 4>>(1e-300, "4 lanes of double");
  scalar<p::Lanes<float, 8>>(2e-4, "8 lanes of float");
  lanes<double, 4>();
  lanes<float, 4>();
  nonsense<double>();
  nonsense<float>();
  return failures();
}
