// The calibrated estimator: paths and their derivatives, stiffness against the model's own slope, and any nonsense in.
#include "check.hpp"

#include <pellucid/dual.hpp>
#include <pellucid/emg_estimator.hpp>

namespace p = pellucid;

constexpr double not_heard = std::numeric_limits<double>::quiet_NaN();

template <class T> struct Surface {
  T one[8]{}, two[8 * 7]{};
  Surface() {
    Random random(3);
    for (std::size_t i = 0; i < 8; ++i) one[i] = T(0.3 + 0.02 * static_cast<double>(i) + random.uniform(-0.002, 0.002));
    for (std::size_t i = 0; i < 8; ++i)
      for (std::size_t j = 0; j < 7; ++j)
        two[7 * i + j] = T(0.4 - 0.02 * static_cast<double>(i) + 0.01 * static_cast<double>(j) +
                           random.uniform(-0.002, 0.002));
  }
};

template <class T> p::MusclePathParams<T> path_one(const Surface<T>& s) {
  p::MusclePathParams<T> path;
  path.axis[0] = {0, T(-1), T(0.1), T(-0.5), T(0.3), 5};
  path.coefficient = s.one;
  return path;
}
template <class T> p::MusclePathParams<T> path_two(const Surface<T>& s) {
  p::MusclePathParams<T> path = path_one(s);
  path.axes = 2;
  path.axis[1] = {1, T(1), T(0), T(-0.8), T(0.4), 4};
  path.coefficient = s.two;
  return path;
}

void paths_have_their_derivatives() {
  const Surface<double> s;
  Random random(4);
  for (const auto& params : {path_one(s), path_two(s)}) {
    const auto c = p::coefficients(params);
    for (int i = 0; i < 400; ++i) {
      // Inside, at borders and beyond.
      const double q[2] = {random.uniform(-1.5, 1.5), random.uniform(-1.5, 1.5)}, h = 1e-5;
      const auto at = p::muscle_path(c, q, 2);
      for (std::size_t k = 0; k < c.axes; ++k) {
        double up[2] = {q[0], q[1]}, down[2] = {q[0], q[1]};
        up[k] += h;
        down[k] -= h;
        const auto above = p::muscle_path(c, up, 2), below = p::muscle_path(c, down, 2);
        check_close(at.slope[k], (above.length - below.length) / (2 * h), 1e-6, "slope");
        check_close(at.bend[k][k], (above.slope[k] - below.slope[k]) / (2 * h), 0.02, "bend");
      }
    }
    const double lost[2] = {not_heard, 0.0};
    check(!p::is_finite(p::muscle_path(c, lost, 2).length), "an angle that is no number gives no length");
  }
  p::MusclePathParams<double> wrong = path_one(s);
  wrong.coefficient = nullptr;
  check(!p::coefficients(wrong).valid && p::muscle_path(p::coefficients(wrong), s.one, 1).length == 0, "no surface");
}

template <class S> p::MuscleParams<S> example_muscle() {
  p::MuscleParams<S> m;
  m.optimal_fibre_length = S(0.09);
  m.tendon_slack_length = S(0.25);
  m.max_isometric_force = S(1200);
  m.pennation = S(0.3);
  m.damping = S(0.05);
  return m;
}

void hill_slope_is_the_derivative() {
  using D = p::Dual<double, 1>;
  const auto c = p::coefficients(example_muscle<double>());
  const auto exact = p::coefficients(example_muscle<D>());
  const auto range = p::coefficients(p::ShortRangeParams<double>{});
  Random random(5);
  for (int i = 0; i < 2000; ++i) {
    const double a = random.uniform(), length = random.uniform(0.26, 0.42), rate = random.uniform(-0.4, 0.4);
    const auto found = p::muscle_stiffness(range, c, a, p::fibre(c, length, rate), rate);
    const D force = p::tendon_force(exact, D(a), p::fibre(exact, D::parameter(length, 0), D(rate)));
    check_close(found.slope, force.derivative[0], 1e-7 * (1 + std::fabs(force.derivative[0])), "slope of the tendon's force");
  }
}

void short_range_has_its_limits() {
  const auto c = p::coefficients(example_muscle<double>());
  const double length = 0.25 + 0.09 * std::cos(0.3);
  const auto still = p::fibre(c, length, 0.0);
  const auto range = p::coefficients(p::ShortRangeParams<double>{});
  check(p::muscle_stiffness(range, c, 0.0, p::fibre(c, 0.30, 0.0), 0.0).short_range == 0, "no force, no stiffness");
  p::ShortRangeParams<double> stiff;
  stiff.tendon_strain = 1e-9;
  const auto rigid = p::coefficients(stiff);
  // At l_o, fully active: gamma F_0 / l_o along the fibre, its turning beside it.
  const double cosine = std::cos(0.3), sine = std::sin(0.3);
  check_close(p::muscle_stiffness(rigid, c, 1.0, still, 0.0).short_range,
              1200 / 0.09 * (23.4 * cosine * cosine + sine * sine), 1.0, "gamma F over l_o on a rigid tendon");
  const double compliant = p::muscle_stiffness(range, c, 1.0, still, 0.0).short_range;
  const double muscle = 1200 / 0.09 * (23.4 * cosine * cosine + sine * sine);
  const double tendon = 1200 / 0.25 * (1 - 0.33) / (0.033 * (1 - 0.6086155378758799));
  check_close(compliant, muscle * tendon / (muscle + tendon), 1e-6 * muscle, "tendon in series");
  double before = 0;
  for (double a = 0.0; a <= 1.0; a += 0.01) {
    const double k = p::muscle_stiffness(range, c, a, still, 0.0).short_range;
    check(k >= before && k <= tendon, "grows with activation and stays below the tendon's");
    before = k;
  }
  p::MuscleParams<double> bare = example_muscle<double>();
  bare.tendon_slack_length = 0;
  const auto none = p::coefficients(bare);
  check_close(p::muscle_stiffness(range, none, 1.0, p::fibre(none, 0.09 * cosine, 0.0), 0.0).short_range, muscle,
              1e-6 * muscle, "without a tendon the muscle's own");
}

using Small = p::EmgSize<2, 2, 2, 2, 32, 16>;

template <class T> p::EmgEstimatorParams<T, Small> example_estimator(const Surface<T>& s,
                                                                     const p::TorqueTerm<T> (&term)[3]) {
  p::EmgEstimatorParams<T, Small> e;
  e.channels = e.angles = e.muscles = e.joints = 2;
  for (auto& channel : e.channel) channel = {T(1), T(0.01), T(1)};
  e.motion.count = 1;
  e.motion.section[0] = {T(0.0976), T(0.1953), T(0.0976), T(-0.9428), T(0.3333)};
  for (std::size_t m = 0; m < 2; ++m) {
    e.muscle[m].muscle.muscle = example_muscle<T>();
    e.muscle[m].muscle.activation = {T(-1), T(0.02), T(0.02), T(0)};
    e.muscle[m].muscle.delay = T(0.03);
    e.muscle[m].path = m == 0 ? path_one(s) : path_two(s);
    e.muscle[m].share[m] = T(1);
    e.joint[m].angle = static_cast<std::uint32_t>(m);
    e.joint[m].stiffness = T(2);
    e.joint[m].limit = T(60);
  }
  e.joint[1].term = term;
  e.joint[1].terms = 3;
  e.lag[0] = 10;
  e.lags = 1;
  e.period = T(0.005);
  e.period_us = 5000;
  e.patience = 4;
  return e;
}

template <class T> void is_total() {
  const Surface<T> s;
  const p::TorqueTerm<T> term[3] = {{T(1), p::no_factor, p::no_factor}, {T(2), 1, p::no_factor}, {T(-3), 0, 4}};
  const auto c = p::coefficients(example_estimator(s, term));
  check(c.valid, "an estimator that makes sense");
  p::EmgEstimatorState<T, Small> state;
  p::EmgSamples<T, Small> in;
  in.angle[0] = T(not_heard);
  check(p::step(c, state, in).fault == p::EmgFault::angle && !state.started, "waits for every angle");
  Random random(6);
  for (int i = 0; i < 4000; ++i) {
    const bool sane = random.uniform() < 0.7;
    in.time += static_cast<std::int64_t>(random.uniform() < 0.9 ? 5000.0 : random.uniform(-20000, 90000));
    for (std::size_t k = 0; k < 2; ++k) {
      in.envelope[k] = sane ? T(random.uniform()) : random.anything<T>();
      in.angle[k] = sane ? T(random.uniform(-0.5, 0.5)) : random.anything<T>();
    }
    const auto out = p::step(c, state, in);
    const auto stiff = p::stiffness(c, state);
    for (std::size_t k = 0; k < 2; ++k) {
      check(p::abs(out.torque[k]) <= T(60), "within its limit");
      for (std::size_t j = 0; j < 2; ++j)
        check(p::is_finite(stiff.short_range[k][j]) && p::is_finite(stiff.slope[k][j]), "stiffness is finite");
    }
  }
  // What was nonsense does not stay: two long-settled states agree.
  p::EmgEstimatorState<T, Small> fresh;
  p::EmgEstimate<T, Small> one, other;
  for (int i = 0; i < 600; ++i) {
    in.time += 5000;
    in.envelope[0] = in.envelope[1] = T(0.3);
    in.angle[0] = in.angle[1] = T(0.1);
    one = p::step(c, state, in);
    other = p::step(c, fresh, in);
  }
  check(one.fault == p::EmgFault::none && other.fault == p::EmgFault::none, "well again");
  for (std::size_t k = 0; k < 2; ++k)
    check_close(static_cast<double>(one.torque[k]), static_cast<double>(other.torque[k]), 1e-3, "nothing stayed");
}

void says_what_an_estimate_is_worth() {
  const Surface<double> s;
  const p::TorqueTerm<double> term[3] = {{1, p::no_factor, p::no_factor}, {2, 1, p::no_factor}, {-3, 0, 4}};
  const auto params = example_estimator(s, term);
  const auto c = p::coefficients(params);
  p::EmgEstimatorState<double, Small> state;
  p::EmgSamples<double, Small> in;
  in.envelope[0] = in.envelope[1] = 0.4;
  in.angle[0] = 0.1;
  check(p::step(c, state, in).fault == p::EmgFault::restarted, "the first");
  const auto next = [&](std::int64_t gap = 5000) {
    in.time += gap;
    return p::step(c, state, in);
  };
  check(next().fault == p::EmgFault::none, "well");
  const double torque = next().torque[0];
  in.envelope[1] = not_heard;
  for (int i = 0; i < 4; ++i) check(next().fault == p::EmgFault::none, "a short silence is held");
  const auto lost = next();
  check(lost.fault == p::EmgFault::channel && lost.lost == 2u, "then the channel is lost, and named");
  in.envelope[1] = 0.4;
  check(next().fault == p::EmgFault::none, "and found again");
  in.envelope[0] = 7.0;
  const auto above = next();
  check(above.fault == p::EmgFault::ceiling && above.above == 1u, "no muscle's");
  in.envelope[0] = 0.4;
  for (int i = 0; i < 200; ++i) next();
  check_close(next().torque[0], torque, 1e-6, "as before");
  const auto still = next(0);
  check(still.fault == p::EmgFault::time && still.torque[0] == state.estimate.torque[0], "time stood still");
  check(next(20000).fault == p::EmgFault::none, "three periods missed are gone through");
  check(next(100000).fault == p::EmgFault::restarted, "twenty are not");
  in.angle[1] = not_heard;
  for (int i = 0; i < 4; ++i) next();
  const auto blind = next();
  check(blind.fault == p::EmgFault::angle && blind.blind == 2u && blind.torque[0] == 0 && blind.torque[1] == 0, "blind");
  check(p::stiffness(c, state).slope[0][0] == 0, "and without stiffness");
  auto linear = params;
  linear.joint[0].terms = 1;
  const p::TorqueTerm<double> in_proportion{2.0, 0, p::no_factor};
  linear.joint[0].term = &in_proportion;
  const auto with_term = p::coefficients(linear);
  const auto torque_at = [&](double envelope) {
    p::EmgEstimatorState<double, Small> fresh;
    p::EmgSamples<double, Small> now;
    now.envelope[0] = envelope;
    now.envelope[1] = 0.4;
    return p::step(with_term, fresh, now).torque[0];
  };
  check(with_term.valid && torque_at(0.3) > torque_at(0.0), "the term counts");
  check_close(torque_at(-0.3), torque_at(0.0), 1e-12, "a filter's undershoot is no activity");
  auto wrong = params;
  wrong.joint[0].angle = 9;
  check(!p::coefficients(wrong).valid, "an angle that is not there");
  wrong = params;
  wrong.muscle[1].muscle.muscle.optimal_fibre_length = -1;
  const auto refused = p::coefficients(wrong);
  check(!refused.valid && p::step(refused, state, in).fault == p::EmgFault::configuration, "a length below 0");
}

/// Four channels that go with a sine, and their pattern.
void watch_names_what_costs_torque() {
  p::EmgWatchParams<double, 4, 1> watch;
  watch.on = true;
  watch.forgetting = 0.01;
  watch.max_loss = 0.1;
  watch.period = 0.01;
  watch.residual = 0.1;
  watch.common_low = 1.0 / 3.0;
  watch.common_high = 3.0;
  for (auto& channel : watch.channel) channel = {1.0, 0.001, 0.5, 0.5, 0.5};
  watch.channel[3].consequence = 0.0;
  watch.angle[0] = {-1.0, 1.0, -1.0, 1.0};
  check(p::detail::is_sound(watch, 4, 1), "sound");
  const auto run = [&watch](const double (&gain)[4], std::uint32_t silent = 0, bool strange = false,
                            int steps = 1000) {
    p::EmgWatchState<double, 4> state;
    for (int i = 0; i < steps; ++i) {
      const double y = 1.0 + std::sin(0.05 * i), pattern[4] = {y, y, y, y};
      const double x[4] = {gain[0] * y, gain[1] * y, gain[2] * y, gain[3] * y};
      p::step(watch, state, x, pattern, 4, silent, strange);
    }
    return state;
  };
  check(run({1, 1, 1, 1}).changed == 0 && !run({1, 1, 1, 1}).unlike, "as it was");
  check(run({1, 1, 1, 1}).widening < 1.01 && run({1, 1.2, 1, 1}).widening > 1.05, "the interval widens by degrees");
  check(run({1, 1, 1, 1}, 1).widening > run({1, 1, 1, 1}).widening, "and with what is silent");
  check(run({2, 1, 1, 1}).changed == 1u, "a gain is named");
  check(run({1, 1, 1, 4}).changed == 0, "not one without consequence");
  check(run({2, 2, 2, 2}).changed == 0 && !run({2, 2, 2, 2}).unlike, "nor another effort");
  check(run({4, 4, 4, 4}).unlike && run({0.2, 0.2, 0.2, 0.2}).unlike, "unless it is far from what was fitted");
  check(run({9, 1, 0, 1}).unlike || run({9, 1, 0, 1}).changed == 5u, "two of four");
  check(run({1, 1, 1, 1}, 0, true).unlike, "another movement");
  check(run({2, 1, 1, 1}, 1).changed == 0 && !run({1, 1, 1, 1}, 15).unlike, "what is silent is not judged");
  check(run({not_heard, 1, 1, 1}).changed == 1u, "what is no number has changed");
  watch.channel[0].margin = 9.0;
  check(run({2, 1, 1, 1}).changed == 0 && run({2, 1, 1, 1}).widening > 1.5, "nor one that chance explains");
  watch.channel[0].margin = 0.0;
  watch.common_high = 5.0;
  check(!run({4, 4, 4, 4}).unlike, "unless that was fitted too");
  for (auto& channel : watch.channel) channel.usual = 9.0;
  check(run({0, 1, 1, 1}).changed == 0, "a silence that no pattern shows");
  watch.channel[0].floor = 0.01;
  watch.channel[0].floor_seconds = 4.0;
  check(run({0, 1, 1, 1}).changed == 1u && run({1, 1, 1, 1}).changed == 0, "is named by its floor");
  watch.channel[0].margin = 9.0;
  check(run({0, 1, 1, 1}, 0, false, 3000).changed == 1u, "for as long as it lasts");
  watch.channel[0].margin = 0.0;
  check((run({0, 1, 1, 1}, 0, false, 300).changed | run({0, 1, 1, 1}, 1).changed) == 0, "in time, and where it is heard");
  check(run({0, 1, 1, 1}, 0, false, 190).widening == 1.0 && run({0, 1, 1, 1}, 0, false, 300).widening > 1.5,
        "the interval widens before");
  check(run({0, 0, 0, 0}).changed == 0, "while all muscles rest, one is not named");
  watch.channel[0].floor_seconds = 0.0;
  watch.channel[0].idle = 0.2;
  watch.channel[0].idle_seconds = 4.0;
  check(run({0.05, 1, 1, 1}).changed == 1u && run({1, 1, 1, 1}).changed == 0, "or by its activity");
  watch.channel[0].consequence = 0.01;
  check(run({0, 1, 1, 1}).changed == 0, "not one without consequence");
  watch.common_low = 0.0;
  check(!p::detail::is_sound(watch, 4, 1), "a scale of 0");
  watch.common_low = 1.0 / 3.0;
  watch.forgetting = 0.0;
  check(!p::detail::is_sound(watch, 4, 1), "a watch that learns nothing");
  watch.forgetting = not_heard;
  check(!p::detail::is_sound(watch, 4, 1), "nor one that has no number");
}

int main() {
  watch_names_what_costs_torque();
  paths_have_their_derivatives();
  hill_slope_is_the_derivative();
  short_range_has_its_limits();
  is_total<double>();
  is_total<float>();
  says_what_an_estimate_is_worth();
  return failures();
}
