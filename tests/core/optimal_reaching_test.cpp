// People who reach by optimal feedback: their gains solve their equations, movements come to their targets, lanes are
// single people, and nonsense stays outside.
#include "check.hpp"

#include <pellucid/pellucid.hpp>

namespace p = pellucid;

template <class S> p::OptimalReachingParams<S> example_person() {
  p::OptimalReachingParams<S> x;
  x.limb = {S(0.0625), S(3.2), S(0), S(0.1), S(2), S(0), S(0.1)};
  x.resting_stiffness = S(1.1);
  x.stiffness_per_torque = S(3);
  x.damping_ratio = S(0.35);
  x.muscle_delay = S(0.02);
  x.activation_time = S(0.04);
  x.flexion_max = S(54);
  x.extension_max = S(41);
  x.cocontraction = S(0.012);
  x.uncertainty = S(0.15);
  x.uncertainty_time = S(0.5);
  x.uncertainty_share = S(0.25);
  x.noise_share = S(0.006);
  x.phasic_noise_share = S(0.16);
  x.noise_time = S(0.05);
  x.feedback_delay = S(0.06);
  x.position_noise = S(0.008);
  x.velocity_noise = S(0.08);
  x.velocity_weight = S(1.4);
  x.correction_time = S(0.4);
  x.tolerance = S(0.02);
  x.sign_width = S(0.05);
  x.period = S(0.001);
  return x;
}

constexpr double start = 1.05;

/// An arm and who moves it.
template <class S> struct Arm {
  p::OptimalReachingCoefficients<S> person;
  p::OptimalReachingState<S> state;
  S position = S(start), velocity = S(0);

  explicit Arm(const p::OptimalReachingParams<S>& params)
      : person(p::coefficients(params)), state(p::holding(person, S(start), p::ExpectedLoad<S>{})) {}
  p::ReachingOutput<S> period(const S& flexors, const S& extensors, const S& push) {
    const auto out = p::step(person, state, position, velocity, flexors, extensors);
    for (int i = 0; i < 4; ++i) {
      velocity = velocity + S(0.00025) * p::acceleration(person.limb, position, velocity, out.torque + push);
      position = position + S(0.00025) * velocity;
    }
    return out;
  }
};
template <class S> p::ReachingTask<S> task_of(double amplitude, double duration) {
  p::ReachingTask<S> task;
  task.target = S(start + amplitude);
  task.amplitude = S(amplitude);
  task.duration = S(duration);
  task.reaction = S(0.1);
  return task;
}
double normal(Random& random) {  // to three decimals of its variance
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += random.uniform();
  return sum;
}

/// What came of a movement.
struct Moved {
  double width = 0, peak_time = 0, peak = 0, end = 0, over = 0, last = 0, stiffness = 0, most = 0;
};
Moved move(Arm<double>& arm, double amplitude, double duration, Random* random, double push = 0, double from = 1e9) {
  const auto task = task_of<double>(amplitude, duration);
  p::aim(arm.person, arm.state, task);
  constexpr int n = 6000;
  static double v[n], q[n];
  for (int k = 0; k < n; ++k) {
    const double now = 0.001 * k;
    arm.period(random ? normal(*random) : 0, random ? normal(*random) : 0, now >= from && now < from + 0.05 ? push : 0);
    v[k] = amplitude < 0 ? -arm.velocity : arm.velocity;
    q[k] = amplitude < 0 ? -(arm.position - task.target) : arm.position - task.target;
  }
  Moved moved;
  int top = 0;
  for (int k = 0; k < n; ++k) {
    if (v[k] > v[top]) top = k;
    moved.over = std::fmax(moved.over, q[k]);
    moved.most = std::fmax(moved.most, std::fabs(q[k]));
  }
  int first = top, last = top;
  while (first > 0 && v[first - 1] > 0.05 * v[top]) --first;
  while (last < n - 1 && v[last + 1] > 0.05 * v[top]) ++last;
  moved.width = 0.001 * (last - first + 1);
  moved.peak_time = static_cast<double>(top - first) / (last - first + 1);
  moved.peak = v[top];
  moved.end = q[last];
  moved.last = q[n - 1];
  moved.stiffness = arm.state.policy.stiffness;
  return moved;
}

/// A movement without noise is as long as one of minimum jerk of that duration, a bell, and comes to rest in the target.
void durations() {
  for (double amplitude : {0.2, 0.63, -0.63, 1.05})
    for (double duration : {0.3, 0.5, 0.8, 1.1, 1.6, 2.5}) {
      Arm<double> arm(example_person<double>());
      const Moved m = move(arm, amplitude, duration, nullptr);
      check_close(m.width, 0.881 * duration, 0.06 * duration, "as long as asked for");
      check(m.peak_time > 0.35 && m.peak_time < 0.55, "a bell");
      check_close(m.peak * m.width / std::fabs(amplitude), 1.76, 0.06, "peak over mean velocity");
      check(m.over < 0.011 * std::fabs(amplitude) + 0.001, "hardly beyond");
      check(std::fabs(m.last) <= 0.021, "and it stays in the target");
    }
}

/// The spread of ends over movements with noise.
double spread(p::OptimalReachingParams<double> person, double duration) {
  Random random(3);
  double sum = 0, square = 0;
  constexpr int n = 40;
  for (int i = 0; i < n; ++i) {
    Arm<double> arm(person);
    const double end = move(arm, 0.63, duration, &random).end;
    sum += end;
    square += end * end;
  }
  return std::sqrt(square / n - sum * sum / n / n);
}
void spreads() {
  auto person = example_person<double>();
  const double slow = spread(person, 0.6), fast = spread(person, 0.3);
  check(fast > 1.5 * slow && slow > 0.002, "ends spread more, the faster");
  person.phasic_noise_share *= 2;
  person.noise_share *= 2;
  check(spread(person, 0.3) > 1.2 * fast, "and the noisier");
}

/// Naive value iteration of the same problem, and the noise of torque in it.
void cost_is_least() {
  for (double variance : {0.0, 0.05}) {
    constexpr double step = 0.02, weight = 1.4;
    const double a[4][4] = {{1, step, step * step / 2, 0}, {0, 1, step, 0}, {0, 0, 1, step}, {0, 0, 0, 1}};
    const double b[4] = {0, 0, step * step / 2, step};
    double x[4][4] = {};
    double gain[4] = {};
    for (int k = 0; k < 20000; ++k) {
      double xa[4][4] = {}, bx[4] = {}, next[4][4] = {}, bxb = step;
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
          for (int l = 0; l < 4; ++l) xa[i][j] += x[i][l] * a[l][j];
      for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) {
          bx[j] += b[i] * xa[i][j];
          bxb += j == 0 ? b[i] * (x[i][2] * b[2] + x[i][3] * b[3]) : 0;
        }
      for (int i = 0; i < 4; ++i) gain[i] = bx[i] / bxb;
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) {
          for (int l = 0; l < 4; ++l) next[i][j] += a[l][i] * xa[l][j];
          next[i][j] -= bx[i] * bx[j] / bxb;
        }
      next[0][0] += step;
      next[1][1] += step * weight;
      next[2][2] += step * variance * x[1][1];
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) x[i][j] = next[i][j];
    }
    const auto found = p::reaching_gains(weight, step, variance);
    for (int i = 0; i < 4; ++i) check_close(found.at[i], gain[i], 1e-4 * gain[i], "gains of least cost");
  }
}

/// A push on the way is answered; no plan is added: what is left is less than what a plan that goes on would leave.
void pushed() {
  Arm<double> arm(example_person<double>());
  const Moved m = move(arm, 0.63, 0.8, nullptr, 4.0, 0.5);
  check(m.most < 0.75 && std::fabs(m.last) <= 0.021, "back in the target");
  // Inside the target nothing is corrected.
  Arm<double> still(example_person<double>());
  move(still, 0.3, 0.6, nullptr);
  const double short_of = still.position - start - 0.3;
  for (int k = 0; k < 3000; ++k) still.period(0, 0, 0);
  check(std::fabs(short_of) > 1e-3, "not in the middle of the target");
  check_close(still.position - start - 0.3, short_of, 2e-4, "and left there");
  // A torque that nobody told of is borne after a while.
  for (int k = 0; k < 3000; ++k) still.period(0, 0, 0.5);
  check(std::fabs(still.position - start - 0.3) <= 0.021, "an unexpected load is borne");
  check_close(still.state.felt[2], 0.5, 0.1, "and known");
}

/// Who was surprised is stiffer in the next movement, and forgets it.
void stiffens() {
  Arm<double> arm(example_person<double>());
  const double usual = move(arm, 0.1, 0.6, nullptr).stiffness;
  move(arm, -0.1, 0.6, nullptr);
  for (int k = 0; k < 6000; ++k) arm.period(0, 0, 1.0);
  const double after = move(arm, 0.1, 0.6, nullptr).stiffness;
  for (int i = 0; i < 19; ++i) move(arm, i % 2 ? 0.1 : -0.1, 0.6, nullptr);
  const double later = move(arm, 0.1, 0.6, nullptr).stiffness;
  check(after > 1.2 * usual, "stiffer after a surprise");
  check(later < usual + 0.1 * (after - usual), "which is forgotten");
  const auto params = example_person<double>();
  const double slope = 3 * 95, rest = p::cheapest_cocontraction(params, 10.0, slope, 0.15 * 0.15);
  check_close(rest, params.cocontraction, 1e-12, "the usual one for the usual variance");
  for (double variance : {1e-6, 0.01, 0.5, 30.0}) {
    // The least of what it costs, by looking around.
    const double a = p::cheapest_cocontraction(params, 10.0, slope, variance), k0 = 10 + slope * params.cocontraction;
    const double price = params.cocontraction * k0 * k0 * k0 / (slope * 0.15 * 0.15);
    const auto cost = [&](double x) { return x * x + price * variance / ((10 + slope * x) * (10 + slope * x)); };
    check(a > 0 && cost(a) <= cost(1.01 * a) && cost(a) <= cost(0.99 * a), "the cheapest");
  }
}

template <class T> void lanes_are_people() {
  constexpr std::size_t W = 4;
  using L = p::Lanes<T, W>;
  const double amplitudes[W] = {0.2, -0.4, 0.63, 1.0}, times[W] = {0.3, 0.5, 0.9, 1.4};
  auto many = example_person<L>();
  for (std::size_t i = 0; i < W; ++i) many.uncertainty.set(i, static_cast<T>(0.1 + 0.05 * static_cast<double>(i)));
  Arm<L> all(many);
  p::ReachingTask<L> task;
  task.load = {L(0.01), L(0.02), L(0.1), L(0), L(0.1)};
  task.reaction = L(0.1);
  for (std::size_t i = 0; i < W; ++i) {
    task.target.set(i, static_cast<T>(start + amplitudes[i]));
    task.duration.set(i, static_cast<T>(times[i]));
  }
  task.amplitude = L(0);
  p::aim(all.person, all.state, task);
  L torque[1500];
  for (auto& t : torque) t = all.period(L(0.3), L(-0.2), L(0)).torque;
  for (std::size_t i = 0; i < W; ++i) {
    auto one = example_person<T>();
    one.uncertainty = many.uncertainty[i];
    Arm<T> arm(one);
    auto own = task_of<T>(amplitudes[i], times[i]);
    own.load = {T(0.01), T(0.02), T(0.1), T(0), T(0.1)};
    p::aim(arm.person, arm.state, own);
    for (const auto& t : torque) {
      const T alone = arm.period(T(0.3), T(-0.2), T(0)).torque;
      const T lane = t[i];
      check(std::memcmp(&alone, &lane, sizeof alone) == 0, "a lane has the bits of one person");
    }
  }
}

/// Single precision moves alike.
void in_float() {
  Arm<float> arm(example_person<float>());
  Arm<double> exact(example_person<double>());
  p::aim(arm.person, arm.state, task_of<float>(0.63, 0.8));
  p::aim(exact.person, exact.state, task_of<double>(0.63, 0.8));
  for (int k = 0; k < 2000; ++k) {
    arm.period(0, 0, 0);
    exact.period(0, 0, 0);
    check_close(static_cast<double>(arm.position), exact.position, 0.02, "float near double");
  }
}

/// Whatever is felt or asked for, what is told to the muscles is a number within their strength.
void total() {
  Random random(5);
  const auto any = [&random] { return random.anything<double>(); };
  Arm<double> arm(example_person<double>());
  for (int k = 0; k < 20000; ++k) {
    if (k % 500 == 0) {
      p::ReachingTask<double> task{any(), 0.1, any(), any(), {any(), any(), any(), any(), any()}};
      if (k % 1000 == 0) task = task_of<double>(0.2, 0.5);
      p::aim(arm.person, arm.state, task);
    }
    const bool mad = k % 7 == 0;
    const auto out = p::step(arm.person, arm.state, mad ? any() : start, mad ? any() : 0.0, mad ? any() : 0.0,
                             mad ? any() : 0.0);
    check(p::is_finite(out.torque) || mad, "a torque that is a number where what is felt is one");
    check(out.flexor >= 0 && out.flexor <= 1 && out.extensor >= 0 && out.extensor <= 1, "excitations");
  }
  const double nan = std::nan("");
  for (int k = 0; k < 3000; ++k) {
    const auto out = p::step(arm.person, arm.state, nan, nan, nan, nan);
    check(p::is_finite(out.torque) && p::is_finite(out.planned), "nothing felt is no torque that is none");
  }
}

int main() {
  durations();
  spreads();
  cost_is_least();
  pushed();
  stiffens();
  lanes_are_people<double>();
  lanes_are_people<float>();
  in_float();
  total();
  return failures();
}
