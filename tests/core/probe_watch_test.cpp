// The watch that probes: every verdict on a simulated joint, none on one that is right, and numbers by which it is so.
#include "check.hpp"

#include <pellucid/probe_watch.hpp>

#include <complex>
#include <initializer_list>
#include <random>

namespace p = pellucid;

namespace {

using F = p::SafetyFault;
constexpr double never = std::numeric_limits<double>::infinity();

template <class S> p::ProbeWatchParams<S> usual() {
  p::ProbeWatchParams<S> r;
  r.effort = S(0.2);
  r.inertia = S(0.05);
  r.noise = S(2.5e-5);
  return r;
}

/// A joint that somebody moves to and fro, and that answers the effort asked for by a gain, late, or not at all.
template <class S> struct Joint {
  p::ProbeWatchCoefficients<S> c;
  p::ProbeWatchState<S> s{};
  double gain = 1, sign = 1, inertia = 0.05, quantum = 9e-5, noise = 0, fastest = 2, effort_limit = 10, friction = 0;
  double shaken = 0, shaken_hz = 8;
  int late = 0;
  double place = 0, speed = 0, read = 0, asked[64] = {}, time = 0;
  int count = 0;
  Random random{7};

  explicit Joint(const p::ProbeWatchParams<S>& r = usual<S>()) : c(p::coefficients(r, S(1e-3))) {
    check(c.valid != 0, "the example makes sense");
  }
  double normal() {
    double sum = -6;
    for (int k = 0; k < 12; ++k) sum += random.uniform();
    return sum;
  }
  F period() {
    const double due = gain * asked[(count + 63 - late) % 64];
    const double slow = fastest * 0.3 * std::cos(3.0 * time);
    const double moves = slow + speed;
    double torque = due + inertia * shaken * std::sin(6.283185307179586 * shaken_hz * time);
    torque -= friction * ((moves > 0 ? 1 : moves < 0 ? -1 : 0) - (slow > 0 ? 1 : -1));  // the law carries its mean
    const double before = speed;
    speed += 1e-3 * torque / inertia;
    speed *= 0.999;
    place += 1e-3 * (0.5 * (before + speed));
    time += 1e-3;
    const double at = place + fastest * 0.1 * std::sin(3.0 * time);
    const double shown = quantum * std::floor(at / quantum + 0.5) + noise * normal();
    const double last = read;
    read = shown;
    const double mean = 0.5 * (asked[(count + 63) % 64] + asked[(count + 62) % 64]);
    const F found = p::step(c, s, static_cast<S>(sign * (read - last) / 1e-3), static_cast<S>(mean), S(0));
    double effort = 0.4 * std::sin(3.0 * time) + static_cast<double>(p::wave(c, s));
    if (effort > effort_limit) effort = effort_limit;
    if (effort < -effort_limit) effort = -effort_limit;
    asked[count % 64] = effort;
    count = (count + 1) % 64;
    return found;
  }
  /// What is found within so many periods; `after` says in which.
  F found(int periods) {
    for (after = 1; after <= periods; ++after) {
      const F one = period();
      if (one != F::none) return one;
    }
    return F::none;
  }
  int after = 0;
};

template <class S> void parameters() {
  const auto valid = [](auto change) {
    p::ProbeWatchParams<S> r = usual<S>();
    change(r);
    return p::coefficients(r, S(1e-3)).valid != 0;
  };
  check(valid([](auto&) {}), "as it is");
  check(valid([](auto& r) { r.samples = 40; }) && valid([](auto& r) { r.samples = 4000; }), "windows");
  check(!valid([](auto& r) { r.samples = 38; }) && !valid([](auto& r) { r.samples = 4002; }), "too short or long");
  check(!valid([](auto& r) { r.samples = 201; }), "odd");
  check(!valid([](auto& r) { r.inertia = S(0); }) && !valid([](auto& r) { r.moving = S(0); }), "of nothing");
  check(!valid([](auto& r) { r.effort = S(-0.1); }) && !valid([](auto& r) { r.evidence = S(0); }), "backwards");
  check(!valid([](auto& r) { r.noise = std::numeric_limits<S>::quiet_NaN(); }), "no number");
  check(valid([](auto& r) { r.effort = S(0), r.inertia = S(0), r.samples = 1; }), "without a wave nothing else matters");
  check(p::coefficients(usual<S>(), S(0)).valid == 0, "a period of nothing");
  check(p::probe_sum_count == 8, "reversed, gain, unanswered and five delays");
  const auto c = p::coefficients(usual<S>(), S(1e-3));
  check_close(static_cast<double>(c.smoothing), 0.0625, 1e-6, "16 ms of velocities");
  check_close(static_cast<double>(p::coefficients(usual<S>(), S(0.02)).smoothing), 1.0, 0.0, "and no more than all");
  // The encoder's noise is no noise between the waves.
  p::ProbeWatchState<S> s;
  p::ProbeWindowState<S> w;
  for (int k = 0; k < 2; ++k) w.answer[3 + k].real = p::sqrt(c.floor[3 + k] + S(2));
  p::judge(c, s, w);
  check_close(static_cast<double>(s.noise[0]), 1.0, 1e-3, "half of what is beyond it, below");
  check_close(static_cast<double>(s.noise[1]), 1.0, 1e-3, "and above");
  // A blow is forgotten where the next window shows no more than the encoder's noise at both places, and less so where
  // one of them shows more.
  for (const S shown : {S(0.1), S(1), S(3)})
    for (const int place : {0, 1}) {
      p::ProbeWindowState<S> quiet;
      quiet.answer[3 + place].imaginary = p::sqrt(shown * c.floor[3 + place]);
      for (int k = 0; k < 2; ++k) s.noise[k] = S(1000) * c.floor[3 + k];
      p::judge(c, s, quiet);
      for (int k = 0; k < 2; ++k)
        check_close(static_cast<double>(s.noise[k] / c.floor[3 + k]), shown > S(1) ? 12.0 : 4.0, 1e-3, "four times what is shown");
    }
  for (int k = 0; k < 2; ++k) s.noise[k] = S(4) * c.floor[3 + k];
  p::judge(c, s, {});
  check_close(static_cast<double>(s.noise[0] / c.floor[3]), 2.0, 1e-3, "and less than that fades by half");
  auto exact = usual<S>();
  exact.noise = S(0);
  s.noise[0] = S(8);
  p::judge(p::coefficients(exact, S(1e-3)), s, {});
  check_close(static_cast<double>(s.noise[0]), 4.0, 1e-6, "nor is it known what an exact encoder shows");
}

/// The wave has whole cycles in a window, no mean, its own size, and is 0 where there is none.
template <class S> void waves() {
  p::ProbeWatchState<S> s;
  for (const auto& one : s.phase) check(one.real == S(1) && one.imaginary == S(0), "all begin together");
  const auto c = p::coefficients(usual<S>(), S(1e-3));
  double sum = 0, squares = 0, most = 0, first[120];
  for (int k = 0; k < 480; ++k) {
    const double now = static_cast<double>(p::wave(c, s));
    if (k < 120) first[k] = now, sum += now, squares += now * now, most = std::fabs(now) > most ? std::fabs(now) : most;
    else check_close(now, first[k % 120], 1e-4, "the same in each window");
    check(p::step(c, s, S(0), S(0), S(0)) == F::none, "nothing is found at rest");
  }
  check_close(sum, 0.0, 1e-4, "no mean");
  check_close(squares / 120, 1.5 * 0.04, 1e-5, "three waves");
  check(most <= 0.2 * p::probe_crest && most > 0.4, "their crest");
  // A phase that memory has lost gives no wave beyond the crest, whatever rounding makes of it.
  for (const S beyond : {S(-1.002), S(-1.0005), S(1.0005), S(1.002)}) {
    p::ProbeWatchState<S> lost;
    for (auto& one : lost.phase) one = {S(0), S(0)};
    lost.phase[0].real = beyond * S(p::probe_crest);
    const double given = static_cast<double>(p::wave(c, lost)), due = static_cast<double>(beyond) * 0.2 * p::probe_crest;
    check_close(given, std::fabs(due) < 0.2002 * p::probe_crest ? due : 0, 1e-6, "no more than the crest");
  }
  auto off = usual<S>();
  off.effort = S(0);
  const auto none = p::coefficients(off, S(1e-3));
  p::ProbeWatchState<S> idle;
  for (int k = 0; k < 1000; ++k) {
    check(p::wave(none, idle) == S(0) && p::step(none, idle, S(k), S(-k), S(0)) == F::none, "off is off");
    check(idle.count == 0 && idle.velocity == S(0), "and does nothing");
  }
}

/// A right drive and encoder are left alone, whatever robot within bounds, wearer, quantum and clamp.
template <class S> void healthy() {
  for (const double inertia : {0.036, 0.05, 0.07})
    for (const double quantum : {1e-5, 9e-5, 4e-4})
      for (const int late : {0, 1, 2}) {
        Joint<S> j;
        j.inertia = inertia, j.quantum = quantum, j.late = late, j.shaken = 40, j.friction = 0.2;
        check(j.found(30000) == F::none, "right");
        check(j.s.learnt >= 6, "and it was learnt");
        check_close(static_cast<double>(j.s.known[0].real), 0.05 / inertia * std::cos(0.001 * 283 * late), 0.12, "as it is");
      }
  Joint<S> still;
  still.fastest = 0, still.gain = 0;
  check(still.found(30000) == F::none && still.s.sum[2] == S(0), "what stands says nothing");
  Joint<S> clamped;
  clamped.effort_limit = 0.1;
  check(clamped.found(20000) == F::none, "what was not asked is not missed");
}

/// Faults after a while, and from the start on.
template <class S> void verdicts() {
  struct Wrong {
    F fault;
    double gain, sign;
    int late, within;
  };
  const Wrong wrongs[] = {{F::polarity, -1, 1, 0, 700},   {F::polarity, 1, -1, 0, 700},
                          {F::gain, 3, 1, 0, 700},        {F::gain, 2, 1, 0, 1200},
                          {F::unanswered, 0, 1, 0, 1000}, {F::late_answer, 1, 1, 15, 1000},
                          {F::late_answer, 1, 1, 10, 1000}, {F::late_answer, 1, 1, 20, 1000}};
  for (const Wrong& w : wrongs)
    for (const double inertia : {0.036, 0.05, 0.07}) {
      Joint<S> j;
      j.inertia = inertia, j.friction = 0.2;
      check(j.found(10300) == F::none, "right so far");
      j.gain = w.gain, j.sign = w.sign, j.late = w.late;
      check(j.found(3000) == w.fault, p::safety_fault_names[static_cast<std::size_t>(w.fault)]);
      check(j.after <= w.within && j.after >= 100, "in time, but not at the first event");
    }
}

/// The evidence of one window, by the formula, and what is learnt from it.
void evidence() {
  auto r = usual<double>();
  r.noise = 0;
  const auto c = p::coefficients(r, 1e-3);
  for (const double moves : {1.0, 0.91, 0.9, 0.89, 0.75, 0.5, 0.49})
    for (const double g : {-2.0, -1.0, -0.1, 0.0, 0.31, 0.5, 0.62, 1.0, 1.3, 1.4, 1.7, 2.0, 3.0}) {
      p::ProbeWatchState<double> s;
      p::ProbeWindowState<double> w;
      const double errors[] = {0.05, 0.01, 0.1};
      s.learnt = 12;
      for (int i = 0; i < 3; ++i) s.known[i] = {1.0, 0.0}, s.error[i] = errors[i], w.asked[i] = {10.0, 0.0}, w.answer[i] = {10.0 * g, 0.0};
      w.answer[3] = {2.0, 0.0}, w.answer[4] = {0.0, 4.0}, w.moving = 60 * moves;
      const double variances[] = {4 + 7.5, 10 + 4.5, 16 + 15.0};
      double power = 0, late[5] = {};
      for (int i = 0; i < 3; ++i) {
        power += 100 / variances[i];
        for (int k = 0; k < 5; ++k)
          late[k] += 100 * g * std::cos(6.283185307179586 * p::probe_cycles[i] / 0.12 * 0.004 * (k + 2)) / variances[i];
      }
      const double match = g * power, least = 0.6 - 1.2 * (1 - moves);
      const double near = g < least ? least : g > 1.35 ? 1.35 : g;
      const double healthy = 2 * near * match - near * near * power;
      const double wanted[] = {-2 * match - power, 4 * match - 4 * power, 0.0,
                               2 * late[0] - power, 2 * late[1] - power, 2 * late[2] - power, 2 * late[3] - power,
                               2 * late[4] - power};
      check(p::judge(c, s, w) == F::none, "no window decides alone");
      double most = 0;
      for (int k = 0; k < 8; ++k) {
        const double more = wanted[k] - healthy, due = moves < 0.5 ? 0 : more > 12.5 ? 12.5 : more > 0 ? more : 0;
        check_close(s.sum[k], due, 1e-9, "the evidence of a window");
        most = due > most ? due : most;
      }
      check_close(s.noise[0], 2.0, 1e-12, "half of the noise below");
      check_close(s.noise[1], 8.0, 1e-12, "and of the noise above");
      const double fault = wanted[0] > wanted[1] ? wanted[0] : wanted[1], wrongs = fault > 0 ? fault : 0.0;
      const bool teaches = moves >= 0.9 && most <= 1.0 && healthy > wrongs;
      check(s.learnt == (teaches ? 13u : 12u), "a healthy window of a moving joint is learnt from");
      if (teaches) check_close(s.known[0].real, 1 + (g - 1) / 13, 1e-12, "by its share");
      // Page's sum: the evidence of two windows, and a verdict at the bound.
      const double first = s.sum[1];
      s.learnt = 12, s.known[0] = s.known[1] = s.known[2] = {1.0, 0.0};
      for (int i = 0; i < 3; ++i) s.error[i] = errors[i];
      auto strict = c;
      strict.params.evidence = first > 0 ? 2 * first * (1 - 1e-9) : 25;
      const F second = p::judge(strict, s, w);
      if (first > 0 && first < 12.5) check(second == F::gain || strict.params.evidence < 2 * first * 0.9, "found at the bound");
      if (first == 12.5) check(second == F::gain, "found by two windows");
    }
  // An answer that no drive gives, wrong or right, tells little: two waves turned round and one turned half as far leave
  // most of the window unexplained, as a robot across its backlash does.
  for (const double size : {1.0, 2.0, 5.0}) {
    p::ProbeWatchState<double> s;
    p::ProbeWindowState<double> w;
    s.learnt = 12, w.moving = 60;
    for (int i = 0; i < 3; ++i) s.known[i] = {1.0, 0.0}, s.error[i] = 0.05, w.asked[i] = {10.0, 0.0};
    w.answer[0] = {-10.0 * size, 0.0}, w.answer[1] = {10.0 * size, 0.0}, w.answer[2] = {0.0, 10.0 * size};
    p::judge(c, s, w);
    double power = 0, total = 0, best = 0;
    for (int i = 0; i < 3; ++i) power += 100 / 7.5, total += 100 * size * size / 7.5;
    for (int k = 0; k < 6; ++k) {  // no delay, and the five that are looked for
      double match = 0;
      for (int i = 0; i < 3; ++i) {
        const double turn = -6.283185307179586 * p::probe_cycles[i] / 0.12 * 0.004 * (k == 0 ? 0 : k + 1);
        match += 10 * (w.answer[i].real * std::cos(turn) + w.answer[i].imaginary * std::sin(turn)) / 7.5;
      }
      best = match * match > best ? match * match : best;
    }
    const double scale = (total - best / power) / 3;
    check(scale > 1, "the example fits nothing");
    // Nothing matches a drive without delay, so that healthy is worth the least gain, and no answer nothing.
    check_close(s.sum[2], (0.36 * power) / scale, 1e-9, "evidence over what is left unexplained");
  }
  // Evidence of any fault beyond a twenty-fifth of what a verdict needs keeps a right window from being learnt from.
  for (int k = 0; k < 8; ++k) {
    p::ProbeWindowState<double> w;
    w.moving = 60;
    for (int i = 0; i < 3; ++i) w.asked[i] = w.answer[i] = {10.0, 0.0};
    const auto after = [&](double sum) {
      p::ProbeWatchState<double> s;
      s.learnt = 12;
      for (int i = 0; i < 3; ++i) s.known[i] = {1.0, 0.0}, s.error[i] = 0.05;
      s.sum[k] = sum;
      p::judge(c, s, w);
      return s;
    };
    const double less = 200 - after(200).sum[k];
    for (const double left : {0.99, 1.01, 12.0}) {
      const auto s = after(left + less);
      check_close(s.sum[k], left, 1e-9, "what is left of the evidence");
      check(s.learnt == (left < 1 ? 13u : 12u), "a doubted drive teaches nothing");
    }
  }
  // Noise as large as the waves teaches nothing more.
  for (const double noise : {9.9, 10.0, 10.1}) {
    p::ProbeWatchState<double> s;
    p::ProbeWindowState<double> w;
    s.learnt = 12, w.moving = 60;
    for (int i = 0; i < 3; ++i) s.known[i] = {1.0, 0.0}, w.asked[i] = w.answer[i] = {10.0, 0.0};
    w.answer[3] = w.answer[4] = {noise, 0.0};
    p::judge(c, s, w);
    check(s.learnt == (noise <= 10 ? 13u : 12u), "noise as large as the waves");
  }
}

/// What a window says by the waves that nothing disturbs, by the formula: against the faults without delay, and for each of
/// the late drives.
struct Calm {
  double heard, late[5];
};
Calm calm_of(const p::ProbeWindowState<double>& w, double variance, double least) {
  using Complex = std::complex<double>;
  const auto number = [](const auto& one) { return Complex(one.real, one.imaginary); };
  const auto late = [](int i, int k) {
    return std::polar(1.0, -6.283185307179586 * p::probe_cycles[i] / 0.12 * 0.004 * (k == 0 ? 0 : k + 1));
  };
  double weights[] = {1, 1, 1}, power = 0, match[6] = {};
  for (int pass = 0; pass < 4; ++pass) {
    power = 0;
    int best = 0;
    for (int i = 0; i < 3; ++i) power += weights[i] * std::norm(number(w.asked[i])) / variance;
    for (int k = 0; k < 6; ++k) {
      match[k] = 0;
      for (int i = 0; i < 3; ++i)
        match[k] += weights[i] * (number(w.answer[i]) * std::conj(number(w.asked[i]) * late(i, k))).real() / variance;
      if (std::abs(match[k]) > std::abs(match[best])) best = k;
    }
    for (int i = 0; i < 3 && pass < 3; ++i) {
      const Complex left = number(w.answer[i]) - match[best] / power * late(i, best) * number(w.asked[i]);
      weights[i] = 1 / std::fmax(1.0, std::norm(left) / variance);
    }
  }
  const double near = std::fmin(std::fmax(match[0] / power, least), 1.35);
  const double healthy = near * (2 * match[0] - near * power);
  Calm made{healthy - std::fmax(std::fmax(-2 * match[0] - power, 4 * match[0] - 4 * power), 0.0), {}};
  for (int k = 0; k < 5; ++k) made.late[k] = 2 * match[1 + k] - power - healthy;
  return made;
}

/// One wave that something else turns hides no others, and is not late. A window between those that judge does nothing but
/// end the way.
void hearing() {
  auto r = usual<double>();
  r.noise = 0;
  const auto c = p::coefficients(r, 1e-3);
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  int heard = 0;
  for (int draw = 0; draw < 2000; ++draw) {
    p::ProbeWatchState<double> s;
    s.learnt = 12, s.way[0] = 0.2, s.way[1] = 0.1;
    p::ProbeWindowState<double> w;
    w.moving = draw % 2 == 0 ? 60 : 50;
    for (int i = 0; i < 3; ++i) {
      const double size = (i == draw % 5 ? 4 : 0.3) * (1 + draw % 3);
      s.known[i] = {1.0, 0.0}, s.error[i] = 0.05, w.asked[i] = {6.0, 0.0};
      constexpr double gains[] = {1, 1, 0, 1.5, 1.8, 2, -1};
      w.answer[i] = {6 * gains[draw % 7] + size * normal(random), size * normal(random)};
    }
    auto other = s;
    const auto wanted = calm_of(w, 1.5 * 0.05 * 36, 0.6 - 1.2 * (1 - w.moving / 60));
    p::judge(c, other, w, true);
    const bool is_heard = wanted.heard >= 3;
    heard += is_heard ? 1 : 0;
    check(other.way[0] == (is_heard ? 0 : 0.2) && other.way[1] == (is_heard ? 0 : 0.1), "by the waves that are left");
    check(other.heard == 0 && other.learnt == 12 && other.noise[0] == 0 && other.noise[1] == 0, "and nothing else");
    for (const double sum : other.sum) check(sum == 0, "no evidence of a fault");
    p::judge(c, s, w);
    check(!is_heard || (s.way[0] == 0 && s.way[1] == 0), "so do the windows that judge");
    for (int k = 0; k < 5; ++k)
      check_close(s.sum[3 + k], std::fmin(std::fmax(wanted.late[k], 0.0), 12.5), 1e-9, "late are the waves that are left");
  }
  check(heard > 200 && heard < 1800, "some are heard");
  // An encoder's ripple in one wave, much larger than what is due, does not hide two that answer.
  for (int i = 0; i < 3; ++i)
    for (const double phase : {0.0, 1.6, 3.1, 4.7}) {
      p::ProbeWatchState<double> s;
      s.learnt = 600, s.way[0] = 0.1;
      p::ProbeWindowState<double> w;
      w.moving = 60;
      for (int k = 0; k < 3; ++k) s.known[k] = {1.0, 0.0}, s.error[k] = 0.05, w.asked[k] = w.answer[k] = {10.0, 0.0};
      w.answer[i] = {10.0 + 60.0 * std::cos(phase), 60.0 * std::sin(phase)};
      check(p::judge(c, s, w) == F::none && s.way[0] == 0, "heard all the same");
    }
  // A wave that was not asked for says nothing, with an exact encoder as with another.
  p::ProbeWatchState<double> two;
  two.learnt = 600, two.way[0] = 0.1;
  p::ProbeWindowState<double> some;
  some.moving = 60;
  for (int k = 0; k < 3; ++k) two.known[k] = {1.0, 0.0}, two.error[k] = 0.05, some.asked[k] = some.answer[k] = {k > 0 ? 10.0 : 0.0, 0.0};
  check(p::judge(c, two, some) == F::none && two.way[0] == 0, "the others do");
  // Of the first windows only whole ones count, and each as soon as it ends: after one, one and a quarter, and so on.
  Joint<double> j;
  check(j.found(5000) == F::none && p::is_known(j.s), "it answers");
  j.s.begun = j.s.count = 0;
  for (auto& phase : j.s.phase) phase = {1.0, 0.0};
  for (auto& window : j.s.window) window = {};
  for (int period = 1; period <= 240; ++period) {
    const bool counts = period >= 120 && period % 30 == 0;
    j.s.way[0] = 7;
    j.period();
    check((j.s.way[0] < 7) == counts, "whole windows end the way");
  }
  // What a blow leaves is remembered.
  p::ProbeWatchState<double> after;
  after.learnt = 600, after.way[0] = 0.1, after.noise[0] = after.noise[1] = 1e6;
  for (int k = 0; k < 3; ++k) after.known[k] = {1.0, 0.0}, some.asked[k] = some.answer[k] = {10.0, 0.0};
  check(p::judge(c, after, some) == F::none && after.way[0] == 0.1, "not heard among so much noise");
  // Whatever window it lies in, each part of the way counts once, and the waves begin anew with each first window.
  auto all_of_it = usual<double>();
  all_of_it.travel = 100;
  auto exact = p::coefficients(all_of_it, 1e-3);
  exact.idle = 0;
  p::ProbeWatchState<double> goes;
  for (int period = 1; period <= 600; ++period) {
    check(p::step(exact, goes, 2.0, 0.0, 0.0) == F::none, "goes on");
    if (period > 120) check_close(p::way_of(goes), 2e-3 * (period - 90) + 2e-3 * 45, 0.02, "each part of the way once");
    if (period % 120 == 0) check(goes.count == 0 && goes.phase[0].real == 1 && goes.phase[0].imaginary == 0, "anew");
  }
  // Room for the waves: none up to half of the way, and their crest from three quarters on.
  auto bounded = usual<double>();
  bounded.travel = 0.5;
  const auto far = p::coefficients(bounded, 1e-3);
  for (const double share : {0.0, 0.2, 0.3, 0.5, 0.6, 0.75, 1.0}) {
    p::ProbeWatchState<double> s;
    s.way[0] = 0.5 * share;
    const double part = share < 0.5 ? 0 : share > 0.75 ? 1 : 4 * share - 2;
    check_close(p::room_of(far, p::used_way(far, s)), part * p::probe_crest * bounded.effort, 1e-12, "room for the waves");
    check(p::used_way(c, s) == 0 && p::room_of(c, 0.0) == 0, "none on an endless way");
    // The waves are twice as large from half of the way on, and as usual up to a quarter.
    const double louder = share < 0.25 ? 1 : share < 0.5 ? 4 * share : 2;
    check_close(p::wave(far, s, p::used_way(far, s)), louder * p::wave(far, s), 1e-12, "larger waves");
  }
  // None of them changes faster than is said.
  p::ProbeWatchState<double> s;
  double before = 0, steepest = 0;
  for (int period = 0; period < 240; ++period) {
    p::step(far, s, 0.0, 0.0, 0.0);
    const double now = p::wave(far, s, 1.0);
    if (period > 0) steepest = std::fmax(steepest, std::fabs(now - before));
    before = now;
  }
  check(steepest <= far.steepest && steepest > 0.7 * far.steepest, "as fast as is said");
}

/// What is known is a mean, of all windows and then of the latest fifty, with the mean square of their errors.
void learning() {
  p::ProbeWatchState<double> s;
  p::ProbeWindowState<double> w;
  for (int i = 0; i < 3; ++i) w.asked[i] = {0.0, 2.0}, w.answer[i] = {-8.0, 2.0};  // 1 + 4j
  p::learn(s, w);
  check_close(s.known[1].real, 1.0, 1e-12, "the first window");
  check_close(s.known[1].imaginary, 4.0, 1e-12, "is all that is known");
  check(s.error[1] == 0 && s.learnt == 1, "and has no error");
  for (int i = 0; i < 3; ++i) w.answer[i] = {-8.0, 6.0};  // 3 + 4j
  p::learn(s, w);
  check_close(s.known[2].real, 2.0, 1e-12, "the mean of two");
  check_close(s.error[2], 0.5 * 4.0 / 20.0, 1e-12, "half of the second's error");
  s.learnt = 1000;
  p::learn(s, w);
  check_close(s.known[0].real, 2.02, 1e-12, "a fiftieth of a new one");
  check_close(s.error[0], 0.1 + 0.02 * (1.0 / (2.02 * 2.02 + 16.0) - 0.1), 1e-12, "and of its error");
  for (int i = 0; i < 3; ++i) w.answer[i] = {-800.0, 600.0};
  const double before = s.error[0];
  s.known[0] = {1e-3, 0.0};
  s.learnt = 1000000;
  p::learn(s, w);
  check(s.error[0] <= before + 0.02 * 4.0, "no error counts for more than 4");
  for (int i = 0; i < 3; ++i) w.asked[i] = {};
  const auto known = s.known[1];
  p::learn(s, w);
  check(s.known[1].real == known.real && s.learnt == 1000000, "nothing was asked, nothing is learnt");
  const auto knows = [](std::uint32_t learnt, double error) {
    p::ProbeWatchState<double> one;
    one.learnt = learnt;
    for (double& each : one.error) each = error;
    return p::is_known(one);
  };
  check(!knows(5, 0) && knows(6, 0) && knows(6, 0.374) && !knows(6, 0.376), "six windows, or more where they differ");
  check(!knows(11, 0.75) && knows(12, 0.749), "in proportion");
}

/// The way since the drive was heard: what ends it, what does not, and what it costs to go further.
void travel() {
  auto r = usual<double>();
  r.noise = 0, r.travel = 0.5;
  const auto c = p::coefficients(r, 1e-3);
  p::ProbeWindowState<double> w;
  const auto fill = [&w](double asked, double answer, double noise, double way) {
    w = {};
    for (int i = 0; i < 3; ++i) w.asked[i] = {asked, 0.0}, w.answer[i] = {answer, 0.0};
    w.answer[3] = w.answer[4] = {noise, 0.0};
    w.moving = 60, w.way[0] = way;
  };
  const auto end = [&c](p::ProbeWatchState<double>& s, const p::ProbeWindowState<double>& window) {
    s.window[0] = window;
    return p::end_window(c, s, 0);
  };
  p::ProbeWatchState<double> s;
  s.learnt = 600;
  const auto know = [&s] {
    for (int i = 0; i < 3; ++i) s.known[i] = {1.0, 0.0}, s.error[i] = 0;
    s.noise[0] = s.noise[1] = 0;
  };
  // Nothing answers among so much noise that no window says anything: the way counts, up to its limit.
  know();
  fill(6, 0, 1000, 0.3);
  check(end(s, w) == F::none && s.way[0] == 0.3, "not heard");
  fill(0, 0, 1000, 0.2);
  w.moving = 0;
  check(end(s, w) == F::none && s.way[0] == 0.5, "as far as it may, although nothing was asked and it hardly moved");
  s.sum[2] = 0;
  check(p::step(c, s, 0.0, 0.0, 0.0) == F::none, "which is no fault yet");
  for (int k = 0; k < 2; ++k) {
    s.way[k] = 0.5001, s.way[1 - k] = 0;
    check(p::step(c, s, 0.0, 0.0, 0.0) == F::unanswered, "and no further, forth or back");
    s.way[k] = 0.4999, s.way[1 - k] = 0.4999;
    check(p::step(c, s, 0.0, 0.0, 0.0) == F::none, "each way has its own bound");
  }
  s.way[1] = 0;
  // Windows that are not whole yet count, too, each with its way.
  s.way[0] = 0.2, s.window[0].way[0] = 0.2, s.window[1].way[0] = 0.0999;
  check_close(p::way_of(s), 0.4999, 1e-12, "three parts of the way");
  check(p::step(c, s, 0.0, 0.0, 0.0) == F::none, "together within it");
  s.window[1].way[0] = 0.1001;
  check(p::step(c, s, 0.0, 0.0, 0.0) == F::unanswered, "or beyond it, within a window");
  // Evidence that nothing answers shortens it by as large a share, up to a third. Other evidence does not.
  s = {};
  for (double& sum : s.sum) sum = 24;
  for (const double share : {0.0, 0.2, 0.3, 0.34, 0.9}) {
    s.sum[2] = share * c.params.evidence;
    check_close(p::allowed_way(c, s), 0.5 * (1 - (share < 0.34 ? share : 1.0 / 3)), 1e-12, "the way that is left");
  }
  s.way[0] = 0.334;
  check(p::step(c, s, 0.0, 0.0, 0.0) == F::unanswered, "a doubted drive goes less far");
  s.way[0] = 0.333;
  check(p::step(c, s, 0.0, 0.0, 0.0) == F::none, "but not at once");
  // A right answer ends it, at the evidence of 3 and not before.
  s = {};
  s.learnt = 600;
  know();
  fill(6, 6, 6, 0.3);
  const double variance = 36 + (1 + 6.0 / 600) * 0.03 * 36, power = 3 * 36 / variance, one = power;  // against none at all
  check(end(s, w) == F::none, "a right answer");
  check_close(s.heard, one, 1e-9, "its evidence against nothing, the nearest of the faults");
  check(s.way[0] == 0.3, "is not enough alone");
  know();
  check(end(s, w) == F::none && s.way[0] == 0.0 && s.heard == 0.0, "two are");
  for (const double more : {-0.01, 0.01}) {
    know();
    s.heard = 3 - one + more, s.way[0] = s.way[1] = 0.1;
    const bool is_heard = end(s, w) == F::none && s.way[0] == 0 && s.way[1] == 0;
    check(is_heard == (more > 0) && (is_heard || s.way[1] == 0.1), "at the evidence of 3");
  }
  s.way[0] = s.way[1] = s.heard = 0;
  fill(6, -6, 6, 0.3);
  s.heard = 2;
  know();
  check(end(s, w) == F::none && s.heard == 0.0 && s.way[0] == 0.3, "a reversed one speaks against it");
  // Before it is known what the robot answers, something must answer.
  for (const double answer : {1.9, 2.0, 2.1}) {
    s = {};
    fill(6, answer, 1, 0.3);
    check(end(s, w) == F::none && s.way[0] == (answer < 2 ? 0.3 : 0.0), "the answer's power is twelve times the noise's");
  }
  // So it does where a wave answers nothing at all among no noise.
  s = {};
  fill(6, 3, 0, 0.3);
  w.answer[0] = {0.0, 0.0};
  check(end(s, w) == F::none && s.way[0] == 0, "two waves that answer are enough");
  // In a joint that stands nothing is heard.
  s = {};
  s.learnt = 600;
  know();
  fill(6, 6, 0, 0.3);
  w.moving = 29;
  check(end(s, w) == F::none && s.way[0] == 0.3 && s.heard == 0.0, "hardly moved");
  // The two windows share the way of a joint that goes forth and back, each with its part of it.
  Joint<double> j;
  j.c.params.travel = 1e9, j.gain = 0, j.fastest = 4;
  check(j.c.idle == 0, "of an endless way everything counts");
  j.c.idle = 0.01;
  double gone[2] = {};
  for (int k = 0; k < 20000; ++k) {
    j.period();
    gone[0] += 1e-3 * std::fmax(j.s.slow, 0.0), gone[1] += 1e-3 * std::fmax(-j.s.slow, 0.0);
  }
  for (int k = 0; k < 2; ++k) check(j.s.way[k] <= gone[k] && j.s.way[k] > 0.93 * gone[k] - 0.2, "each period counts once");
  // However slow the joint is, its way counts, and what trembles by less than a share of the bound does not.
  auto bounded_way = usual<double>();
  bounded_way.travel = 0.5;
  const auto near = p::coefficients(bounded_way, 1e-3);
  check_close(near.idle, 0.01, 1e-12, "a fiftieth of the way that it may go");
  for (const double direction : {1.0, -1.0}) {
    p::ProbeWatchState<double> slow;
    double from = 0;
    while (p::step(near, slow, direction * 0.02, 0.0, 0.0) == F::none && from < 1) from += 0.02e-3;
    check(from > 0.5 && from < 0.512, "a creeping joint is stopped where its way ends");
  }
  p::ProbeWatchState<double> trembles, sways;
  F found_trembling = F::none, found_swaying = F::none;
  for (int k = 0; k < 60000; ++k) {
    const double phase = 6.283185307179586 * 6 * 1e-3 * k, rate = 6.283185307179586 * 6 * std::cos(phase);
    found_trembling = p::step(near, trembles, 0.0098 * rate, 0.0, 0.0);
    if (found_swaying == F::none) found_swaying = p::step(near, sways, 0.02 * rate, 0.0, 0.0);
  }
  check(found_trembling == F::none && p::way_of(trembles) == 0, "a hand that trembles goes nowhere");
  check(found_swaying == F::unanswered, "one that sways by more goes somewhere");
  trembles.apart = std::numeric_limits<double>::quiet_NaN();
  check(p::step(near, trembles, 0.0, 0.0, 0.0) == F::none && trembles.apart == 0, "a place without a number begins anew");
  // A drive that dies is lost within its way, however much evidence its death needs.
  for (const double way : {0.4, 0.8}) {
    Joint<double> dies;
    dies.fastest = 5 * way;
    dies.c.params.travel = way, dies.c.idle = 0.02 * way, dies.c.params.evidence = 1e9;
    check(dies.found(10300) == F::none, "heard while it lives");
    dies.gain = 0;
    double went[2] = {};
    F found = F::none;
    for (int k = 0; k < 9000 && found == F::none; ++k) {
      found = dies.period();
      went[0] += 1e-3 * std::fmax(dies.s.slow, 0.0), went[1] += 1e-3 * std::fmax(-dies.s.slow, 0.0);
    }
    const double from = std::fmax(went[0], went[1]);
    check(found == F::unanswered && from >= 0.9 * way && from <= 1.2 * way, "within its way and what turns leave out");
  }
  // The law's effort is its own until half of the energy is used, and falls in proportion to what is left.
  auto some = usual<double>();
  some.energy = 4;
  const auto limited = p::coefficients(some, 1e-3);
  for (const double added : {0.0, 1.5, 2.0, 3.0, 3.5, 4.0, 5.0}) {
    s.added = added;
    const double left = added < 2 ? 1 : added > 4 ? 0 : (4 - added) / 2;
    check_close(p::bounded(limited, s, 6.0), 6 * left, 1e-12, "bounded");
  }
  for (const double energy : {4.0, never}) {
    auto other = some;
    other.energy = energy;
    if (energy == 4) other.effort = 0;
    s.added = 0;
    check(p::bounded(p::coefficients(other, 1e-3), s, 6.0) == 6.0, "its own, to the bit, without a wave or a bound");
    s.added = 1e9;
    check(energy == 4 || p::bounded(p::coefficients(other, 1e-3), s, 6.0) == 6.0, "whatever was added, without a bound");
  }
  auto any = usual<double>();
  check(!std::isfinite(p::coefficients(any, 1e-3).params.travel), "any way where none is stated");
  any.travel = 0;
  check(p::coefficients(any, 1e-3).valid == 0, "a way of nothing");
}

/// One period by hand: energy that three times the gain would have added, the torque of the motion, and whether it moves.
void one_period() {
  auto r = usual<double>();
  r.noise = 0, r.moving = 0.125;
  auto c = p::coefficients(r, 0x1p-10);
  p::ProbeWatchState<double> s;
  double added = 0;
  for (const double power : {6.0, 2.0, -4.0, 0.5}) {
    p::step(c, s, 0.5, power / 0.5, 0.0);
    added += power > 0 ? p::probe_added_gain * power * 0x1p-10 : 0;
    check_close(s.added, added, 1e-12, "what the drive gives is added, what it takes is not");
  }
  auto bounded = r;
  bounded.travel = 1;
  const auto held = p::coefficients(bounded, 0x1p-10);
  p::ProbeWatchState<double> trembles;
  for (int k = 0; k < 4000; ++k) p::step(held, trembles, k % 64 < 32 ? 0.5 : -0.5, 40.0, 0.0);
  check(trembles.added == 0, "a hand that trembles under a weight adds nothing");
  for (int k = 0; k < 1024; ++k) p::step(held, trembles, 0.5, 40.0, 0.0);
  check(trembles.added > p::probe_added_gain * 40.0 * (0.5 - 2 * 0.02), "a way does");
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), never}) {
    s.added = s.slow = bad;
    p::step(c, s, 0.5, 1.0, 0.0);
    check(s.added == 0 && s.slow == 0, "no number begins anew");
  }
  c.smoothing = 1;
  for (const double way : {-1.0, 1.0})
    for (const double speed : {0.125, 0.1875}) {
      p::ProbeWatchState<double> moves;
      for (int k = 0; k < 9; ++k) p::step(c, moves, way * speed, 0.0, 0.0);
      check((moves.window[0].moving > 0) == (speed > 0.125), "faster than that it moves");
      check(moves.slow == way * speed && moves.velocity == way * speed, "and goes its way");
    }
  for (const double late : {0.0, 0.5, 0.75}) {
    p::ProbeWatchState<double> follows;
    follows.due = 2;
    p::step(c, follows, 0.0, 6.0, late);
    check(follows.due == 6 - 4 * late, "as late as the loop");
  }
  auto senseless = usual<double>();
  senseless.samples = 201;
  const auto none = p::coefficients(senseless, 1e-3);
  check(none.valid == 0 && none.smoothing == 0 && none.idle == 0 && none.floor[0] == 0, "without sense nothing is computed");
}

/// A commissioned robot is judged from its first movement on, against what it answered then.
template <class S> void commissioned() {
  auto r = usual<S>();
  r.answer_error = S(0.1);
  const S answers[] = {S(1), S(0), S(1), S(-0.2), S(0.9), S(-0.3)};
  for (int k = 0; k < 6; ++k) r.answer[k] = answers[k];
  const auto c = p::coefficients(r, S(1e-3));
  p::ProbeWatchState<S> s;
  p::begin(c, s);
  for (int i = 0; i < 3; ++i) {
    check(s.known[i].real == answers[2 * i] && s.known[i].imaginary == answers[2 * i + 1], "what was stated");
    check(s.error[i] == S(0.1), "with its error");
  }
  check(s.learnt == 6 && p::is_known(s), "is known at once");
  s.known[0].real = S(2), s.learnt = 7;
  p::begin(c, s);
  check(s.known[0].real == S(2), "and what is learnt later is kept");
  p::ProbeWatchState<S> new_one;
  p::begin(p::coefficients(usual<S>(), S(1e-3)), new_one);
  check(new_one.learnt == 0, "a robot that was not commissioned knows nothing");
  const auto valid = [&r](S error, S answer) {
    auto other = r;
    other.answer_error = error, other.answer[3] = answer;
    return p::coefficients(other, S(1e-3)).valid != 0;
  };
  check(valid(S(0), S(0)) && !valid(S(-0.1), S(0)), "an error below 0");
  check(!valid(S(0.1), std::numeric_limits<S>::quiet_NaN()) && !valid(S(0.1), std::numeric_limits<S>::infinity()), "no number");
  struct Wrong {
    F fault;
    double gain, sign;
    int within;
  };
  for (const Wrong& w : {Wrong{F::polarity, -1, 1, 400}, Wrong{F::polarity, 1, -1, 400}, Wrong{F::gain, 3, 1, 500},
                         Wrong{F::gain, 2, 1, 1500}, Wrong{F::unanswered, 0, 1, 1000}}) {
    Joint<S> blind, knows(r);
    blind.gain = knows.gain = w.gain, blind.sign = knows.sign = w.sign;
    check(knows.found(6000) == w.fault, "wrong from its first sample on");
    check(knows.after <= w.within, "and found in the first movement");
    check(blind.found(6000) == F::none, "which nobody finds who does not know what is right");
  }
  // Another posture, payload and friction answer by a third more or less, and turned: no alarm, and that is learnt.
  for (const double inertia : {0.038, 0.05, 0.065})
    for (const int late : {0, 1}) {
      Joint<S> other(r);
      other.inertia = inertia, other.late = late, other.friction = 0.2, other.shaken = 40;
      check(other.found(30000) == F::none, "it answers otherwise than at its commissioning");
      check(other.s.learnt > 6, "and that is learnt");
    }
  // Numbers that are none are forgotten, what was commissioned is not.
  Joint<S> j(r);
  check(p::step(j.c, j.s, std::numeric_limits<S>::quiet_NaN(), S(0), S(0)) == F::none && j.found(2000) == F::none, "no number");
  j.gain = -1;
  check(j.found(1000) == F::polarity, "and it is found");
}

/// NaN and infinities are forgotten, and say nothing.
template <class S> void no_numbers() {
  for (const S bad : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity(), -std::numeric_limits<S>::max()}) {
    Joint<S> j;
    check(j.found(5000) == F::none, "right");
    check(p::step(j.c, j.s, bad, S(0), S(0)) == F::none && p::step(j.c, j.s, S(0), bad, S(0)) == F::none, "no verdict");
    check(j.found(3000) == F::none, "nor later");
    check(p::is_finite(p::wave(j.c, j.s)), "and a wave that is a number");
    j.s.phase[0].real = bad;
    check(p::wave(j.c, j.s) == S(0), "or none");
    check(j.found(3000) == F::none, "it begins again");
    j.gain = -1;
    check(j.found(3000) == F::polarity, "and still finds");
  }
}

/// With evidence of 3 instead of 25 false alarms are rarer than one in e^3 windows for each of the eight sums.
template <class S> void false_alarms() {
  long alarms = 0, windows = 0;
  for (int k = 0; k < 40; ++k) {
    auto r = usual<S>();
    r.evidence = S(3);
    Joint<S> j(r);
    j.random = Random(static_cast<std::uint64_t>(k));
    j.noise = 1e-3;  // as large as what the wave moves
    for (int n = 0; n < 20000; ++n)
      if (j.period() != F::none) {
        ++alarms;
        for (S& sum : j.s.sum) sum = S(0);
      }
    windows += 200;
  }
  check(static_cast<double>(alarms) <= 8 * 0.0498 * static_cast<double>(windows), "as rare as was said");
}

}  // namespace

int main() {
  parameters<double>();
  parameters<float>();
  waves<double>();
  waves<float>();
  one_period();
  evidence();
  learning();
  travel();
  hearing();
  healthy<double>();
  healthy<float>();
  verdicts<double>();
  verdicts<float>();
  commissioned<double>();
  commissioned<float>();
  no_numbers<double>();
  no_numbers<float>();
  false_alarms<double>();
  return failures();
}
