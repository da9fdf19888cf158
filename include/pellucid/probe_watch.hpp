// Whether drive and encoder answer as they must, asked with a small known wave of effort while a law runs.
//
// Without a measurement of the drive, a wearer who holds against a wrong drive moves as one who holds nothing. A wave
// p = a (cos w1 t + sin w2 t + cos w3 t), faster than people and straps, is added to the law's effort. In a window of N
// periods each wave makes whole cycles. With Hann weights h, effort u that was asked for and second difference q'' of
// the encoder, the lock-in of wave i is
//
//   A_i = sum h J q'' e^(-j w_i t),   V_i = sum h u e^(-j w_i t),   A_i = g r_i V_i + noise,
//
// with r_i what this robot has answered since its test at start-up, or at its commissioning, whatever its transmission
// and its drive's lag make of the wave, and g = 1 for a drive and an encoder that are right, -1 where one is reversed, 2 or more for a gain, 0 for
// one that is dead or stuck, e^(-j w_i T) for one that is late by T. The noise is measured between the waves in the same
// window. Every fault has a sum of log-likelihood ratios against the nearest g that a healthy robot may have, never below
// 0 (Page's test): false alarms are rarer than one in e^evidence windows where the noise is Gaussian. E. S. Page,
// "Continuous inspection schemes", Biometrika 41, 1954.
//
// An answer that neither a healthy nor a wrong drive gives, in whatever size, tells little of either: across backlash, or
// where friction turns the joint round, a robot answers in another way. What the best explanation of the window leaves is
// error, too: all ratios are divided by its mean square over the one that was expected, where that is above 1.
//
// Friction swallows the wave while the joint stands, so that only windows in which it mostly moves count.
//
// Until there is enough evidence of a fault, the joint is moved by a drive that nobody vouches for. So the way that it
// goes since drive and encoder were last heard is bounded, too: a drive that is stuck at T gives no more than T times the
// way in one direction, and takes as much on the way back. Ways forth and back are therefore counted apart, each with its
// own bound. All of a way counts, however slow the joint is and whatever a law at its limit leaves of the probe; only what
// trembles to and fro by less than a share of the bound does not. It counts at once, with the way of windows that are not
// whole yet: at the velocity limit a window is most of it. Evidence that nothing answers shortens the bound.
//
// They are heard where the evidence for them, against reversed, doubled and unanswered, has summed up to a log-likelihood
// ratio of `probe_heard_evidence` over windows (A. Wald, "Sequential tests of statistical hypotheses", Annals of
// Mathematical Statistics 16, 1945); and before r is known, where the answer is far above what lies between the waves.
// What turns with the joint, as an encoder's ripple does, disturbs one wave and not its neighbours. So the way also ends
// where one window says as much by the waves that are left: each weighs less by the mean square error that their best
// explanation leaves of it. At a few rad/s half a window is a long way, so that two more windows, which overlap those that
// judge, are heard in this way alone. And the law leaves room for the waves below its limits once half of the way is gone.
//
// A drive with three times the gain adds twice what it is asked for. So the energy that it would have added since it was
// last heard, E' = 2 max(u v, 0), is bounded as well: the law's effort falls from half of the bound on, to 0 at the bound.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

constexpr std::uint32_t probe_wave_count = 3;
/// Cycles in a window: of the three waves, of the two places between them at which noise is measured, and of the Hann
/// weights.
constexpr std::uint32_t probe_cycles[] = {5, 9, 13, 7, 11, 1};
constexpr std::uint32_t probe_bin_count = 5;
/// Windows at a time, each begun a quarter after the one before. Two that overlap by half judge and are learnt from; the
/// others are too like them for that, and can only end the way of a drive that was not heard.
constexpr std::uint32_t probe_window_count = 4;
/// Largest value of the three waves together, relative to the amplitude of one: their envelope is sqrt(5).
constexpr double probe_crest = 2.2360679774997896;
/// Bounds of a healthy g: loads and backlash change what a robot answers.
constexpr double probe_least_gain = 0.6, probe_most_gain = 1.35;
/// The gain that is looked for.
constexpr double probe_wrong_gain = 2;
/// Effort that a drive with three times the gain adds to each unit of the commanded effort.
constexpr double probe_added_gain = 2;
/// Least mean square of the error of a healthy answer, relative to it: ripple, friction, backlash.
constexpr double probe_least_error = 0.03;
/// Windows of a moving joint after which its answer is known, if the waves' inverse mean square errors then sum up to
/// the second number; with larger errors it takes more windows in proportion. Share of a new window in what is known,
/// at least.
constexpr std::uint32_t probe_learning_windows = 6;
constexpr double probe_known_precision = 8, probe_learning_share = 0.02;
/// Windows in which what is known has an error as large as that of one window again.
constexpr double probe_novelty = 6;
/// Largest noise of a window that is learnt from, beyond the encoder's, relative to the mean square of what is known.
constexpr double probe_learnt_noise = 1;
/// Share of a new window in the mean noise, and the largest mean over what both places show now, each as a multiple of
/// the encoder's noise there: a blow is no noise of the windows that come after it.
constexpr double probe_noise_share = 0.5, probe_noise_fall = 4;
/// Share of a window in which the joint must move: to be judged, and to be learnt from.
constexpr double probe_judged_share = 0.5, probe_learnt_share = 0.9;
/// Tolerated loss of response of a joint that stands still in a window, relative to its response while it moves.
constexpr double probe_standing_loss = 1.2;
/// Largest share of the evidence that one window may give, since one event alone is no fault; and the share of the
/// evidence beyond which the watch learns nothing.
constexpr double probe_window_share = 0.5, probe_doubt_share = 0.04;
/// Number of times that the waves of a window are weighed anew by what their best explanation leaves.
constexpr std::uint32_t probe_reweighings = 3;
/// Evidence for a drive and an encoder that are right, after which they count as heard.
constexpr double probe_heard_evidence = 3;
/// Sum over the waves of the answer's power over that of the noise, from which on something answers, whatever it is.
/// The noise alone is as large in one of 1,900 windows: it is a sum of three exponential variables.
constexpr double probe_loud_answer = 12;
/// Half of the way to and fro that counts as none, as a share of the way that the joint may go: a hand that trembles.
constexpr double probe_idle_share = 0.02;
/// Largest share of the way that evidence of no answer takes away: one blow can bring half of the evidence of a fault.
constexpr double probe_doubted_share = 1.0 / 3;
/// Size of the waves once half of the way is gone, relative to the usual one.
constexpr double probe_loudest = 2;
/// Delays that are looked for: multiples of this one [s], from the second on.
constexpr double probe_delay_step = 0.004;
constexpr std::uint32_t probe_delay_count = 5;
/// Sums of evidence: reversed, gain, unanswered, and one for each delay.
constexpr std::uint32_t probe_sum_count = 3 + probe_delay_count;

template <class S> struct ProbeWatchParams {
  S effort{};
  std::uint32_t samples = 120;
  S inertia{}, noise{}, moving = S(0.1), evidence = S(25), travel = S(std::numeric_limits<S>::infinity()), energy = travel;
  S answer_error{};                  ///< error of the answers below; 0: the robot was not commissioned
  S answer[2 * probe_wave_count]{};  ///< r of each wave at commissioning, real part and imaginary part

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.effort, {"probe_effort", unit::effort, at_least(0),
                     "amplitude of each of the probe's three waves; 0: no probe"});
    visit(p.samples, {"probe_samples", unit::one, between(40, 4000), "periods of a window, a multiple of four"});
    visit(p.inertia, {"probe_inertia", unit::inertia, at_least(0), "inertia of the robot that responds to the probe"});
    visit(p.noise, {"probe_noise", unit::coordinate, at_least(0), "standard deviation of one encoder reading"});
    visit(p.moving, {"probe_moving", unit::velocity, above(0), "slower, friction may swallow the probe's answer"});
    visit(p.evidence, {"probe_evidence", unit::one, above(0),
                       "log-likelihood ratio of a fault: false alarms are rarer than one in e^this windows"});
    visit(p.travel, {"probe_travel", unit::coordinate, above(0).or_infinite(),
                     "way in one direction that the joint may go while its drive is not heard; infinite: any"});
    visit(p.energy, {"probe_energy", unit::energy, above(0).or_infinite(),
                     "energy that a drive with three times the gain may add before detection; infinite: any"});
    visit(p.answer_error, {"probe_answer_error", unit::one, at_least(0),
                           "mean square by which a robot may answer otherwise than at its commissioning, relative to that "
                           "answer; 0: it was not commissioned"});
    visit(p.answer[0], {"probe_answer_low_real", unit::one, any_number(),
                        "answer to the lowest wave at commissioning"});
    visit(p.answer[1], {"probe_answer_low_imaginary", unit::one, any_number(), "its imaginary part"});
    visit(p.answer[2], {"probe_answer_middle_real", unit::one, any_number(),
                        "answer to the middle wave at commissioning"});
    visit(p.answer[3], {"probe_answer_middle_imaginary", unit::one, any_number(), "its imaginary part"});
    visit(p.answer[4], {"probe_answer_high_real", unit::one, any_number(),
                        "answer to the highest wave at commissioning"});
    visit(p.answer[5], {"probe_answer_high_imaginary", unit::one, any_number(), "its imaginary part"});
  }
};

/// Coefficients computed once from ProbeWatchParams and the period.
template <class S> struct ProbeWatchCoefficients {
  ProbeWatchParams<S> params{};                ///< as they are
  SinCos<S> turn[probe_bin_count + 1]{};       ///< change of the phases in a period
  SinCos<S> delay[probe_wave_count]{};         ///< turn of each wave's answer by one step of delay
  S floor[probe_bin_count]{};                  ///< mean square of a lock-in due to the encoder's noise [(N m)^2]
  S inertia_rate{};                            ///< inertia over period [N m s/rad]
  S period{};                                  ///< [s]
  S idle{};                                    ///< half of the way to and fro that counts as none [rad]
  S smoothing{};                               ///< share of a new velocity in the smooth one [1]
  S steepest{};                                ///< largest change of the waves in a period [N m]
  std::uint32_t valid = 0;                     ///< 1: the parameters make sense
};

template <class S> ProbeWatchCoefficients<S> coefficients(const ProbeWatchParams<S>& p, const S& period) noexcept {
  ProbeWatchCoefficients<S> c;
  c.params = p;
  const bool off = p.effort == S(0);
  const bool windows = p.samples % probe_window_count == 0;
  c.valid = is_sound(p) && (off || (p.inertia > S(0) && windows && period > S(0))) ? 1 : 0;
  if (c.valid == 0 || off) return c;
  const S cycle = S(6.283185307179586) / static_cast<S>(p.samples);
  for (std::uint32_t i = 0; i <= probe_bin_count; ++i) c.turn[i] = sincos(cycle * static_cast<S>(probe_cycles[i]));
  c.inertia_rate = p.inertia / period;
  c.period = period;
  c.idle = is_finite(p.travel) ? S(probe_idle_share) * p.travel : S(0);
  c.smoothing = period < S(0.016) ? period / S(0.016) : S(1);
  for (std::uint32_t i = 0; i < probe_bin_count; ++i) {
    // The second difference of a wave is 2 (1 - cos) of it; the squares of Hann weights sum up to 3/8 of their number.
    const S noise = p.noise * S(2) * (S(1) - c.turn[i].cos) * c.inertia_rate / period;
    c.floor[i] = S(0.375) * static_cast<S>(p.samples) * noise * noise;
  }
  c.steepest = S(probe_loudest * (probe_cycles[0] + probe_cycles[1] + probe_cycles[2])) * cycle * p.effort;
  for (std::uint32_t i = 0; i < probe_wave_count; ++i)
    c.delay[i] = sincos(S(-probe_delay_step) / period * cycle * static_cast<S>(probe_cycles[i]));
  return c;
}

template <class S> struct ProbePhasor {
  S real{};       ///< real part
  S imaginary{};  ///< imaginary part
};
template <class S> ProbePhasor<S> times(const ProbePhasor<S>& a, const ProbePhasor<S>& b) noexcept {
  return {a.real * b.real - a.imaginary * b.imaginary, a.imaginary * b.real + a.real * b.imaginary};
}
/// a times the conjugate of b.
template <class S> ProbePhasor<S> against(const ProbePhasor<S>& a, const ProbePhasor<S>& b) noexcept {
  return {a.real * b.real + a.imaginary * b.imaginary, a.imaginary * b.real - a.real * b.imaginary};
}
template <class S> S square(const ProbePhasor<S>& a) noexcept { return a.real * a.real + a.imaginary * a.imaginary; }

/// The sums of one window.
template <class S> struct ProbeWindowState {
  ProbePhasor<S> answer[probe_bin_count]{};  ///< inertia times acceleration, at the waves and between [N m]
  ProbePhasor<S> asked[probe_wave_count]{};  ///< effort asked for, at the waves [N m]
  S moving{};                                ///< Hann weights of the periods in which the joint moves [1]
  S way[2]{};                                ///< way forth and back, by weights: the windows share each period's [rad]
};

template <class S> struct ProbeWatchState {
  /// Phases of the waves, the places between and the weights, now.
  ProbePhasor<S> phase[probe_bin_count + 1] = {{S(1)}, {S(1)}, {S(1)}, {S(1)}, {S(1)}, {S(1)}};
  std::uint32_t count = 0;                      ///< periods in this window
  std::uint32_t begun = 0;                      ///< windows that began after the first, up to all
  S velocity{};                                 ///< the last [rad/s]
  S slow{};                                     ///< smooth velocity [rad/s]
  S due{};                                      ///< effort asked for, as late as the drive's torque loop [N m]
  ProbeWindowState<S> window[probe_window_count]{};  ///< the windows that overlap, each a quarter later
  ProbePhasor<S> known[probe_wave_count]{};     ///< r of each wave: what the robot has answered so far [1]
  S error[probe_wave_count]{};                  ///< mean square of the answers' errors, relative to what is known [1]
  std::uint32_t learnt = 0;                     ///< windows in what is known
  S noise[2]{};                                 ///< mean squares of what lies between the waves [(N m)^2]
  S sum[probe_sum_count]{};                     ///< evidence: reversed, gain, unanswered, delays [1]
  S heard{};                                    ///< evidence that drive and encoder are right, since they were heard [1]
  S way[2]{};                                   ///< way since then, forth and back [rad]
  S apart{};                                    ///< how far the joint is from the middle of what counts as no way [rad]
  S added{};                                    ///< energy that three times the gain would have added since then [J]
};

/// A law's effort while its drive is not heard [N m]: as it is, until half of the energy is used that a wrong gain may
/// add.
template <class S> S bounded(const ProbeWatchCoefficients<S>& c, const ProbeWatchState<S>& s, const S& effort) noexcept {
  const S left = S(2) * (c.params.energy - s.added);
  return left >= c.params.energy ? effort : left > S(0) ? effort * (left / c.params.energy) : S(0);
}

/// The longer way, forth or back, since drive and encoder were heard [rad], with that of windows that are not whole yet.
template <class S> S way_of(const ProbeWatchState<S>& s) noexcept {
  S way[2] = {s.way[0], s.way[1]};
  for (const ProbeWindowState<S>& w : s.window)
    for (std::uint32_t k = 0; k < 2; ++k) way[k] = way[k] + w.way[k];
  return max(way[0], way[1]);
}

/// The way that the joint may go now while its drive is not heard [rad].
template <class S> S allowed_way(const ProbeWatchCoefficients<S>& c, const ProbeWatchState<S>& s) noexcept {
  return c.params.travel * (S(1) - min(s.sum[2] / c.params.evidence, S(probe_doubted_share)));
}

/// Share of its way that the joint has gone since its drive was heard [1].
template <class S> S used_way(const ProbeWatchCoefficients<S>& c, const ProbeWatchState<S>& s) noexcept {
  return way_of(s) / allowed_way(c, s);
}

/// The effort to add in this period [N m]. The waves become larger before the joint has gone as far as it may unheard.
template <class S> S wave(const ProbeWatchCoefficients<S>& c, const ProbeWatchState<S>& s, const S& used = S(0)) noexcept {
  if (!(c.params.effort > S(0))) return S(0);
  const S usual = c.params.effort * (s.phase[0].real + s.phase[1].imaginary + s.phase[2].real);
  return abs(usual) <= S(probe_crest * 1.001) * c.params.effort ? usual * clamp(S(4) * used, S(1), S(probe_loudest)) : S(0);
}

/// Takes a window of a healthy robot into what is known of its answers.
template <class S> void learn(ProbeWatchState<S>& s, const ProbeWindowState<S>& w) noexcept {
  if (s.learnt < 1000000) ++s.learnt;
  const S share = max(S(1) / static_cast<S>(s.learnt), S(probe_learning_share));
  for (std::uint32_t i = 0; i < probe_wave_count; ++i) {
    const S size = square(w.asked[i]);
    if (!(size > S(0))) continue;
    const ProbePhasor<S> got = against(w.answer[i], w.asked[i]);
    ProbePhasor<S>& r = s.known[i];
    const ProbePhasor<S> other{got.real / size - r.real, got.imaginary / size - r.imaginary};
    r.real = r.real + share * other.real;
    r.imaginary = r.imaginary + share * other.imaginary;
    const S whole = square(r);
    // The first window differs from nothing; later ones from what was known before.
    if (s.learnt > 1 && whole > S(0)) s.error[i] = s.error[i] + share * (min(square(other) / whole, S(4)) - s.error[i]);
  }
}

/// Begins with what the robot answered at its commissioning, if it was: as if that had been learnt from as few windows
/// as there must be.
template <class S> void begin(const ProbeWatchCoefficients<S>& c, ProbeWatchState<S>& s) noexcept {
  if (s.learnt != 0 || !(c.params.answer_error > S(0))) return;
  for (std::uint32_t i = 0; i < probe_wave_count; ++i) {
    s.known[i] = {c.params.answer[2 * i], c.params.answer[2 * i + 1]};
    s.error[i] = c.params.answer_error;
  }
  s.learnt = probe_learning_windows;
}

/// Whether what the robot answers is known well enough to tell what is wrong.
template <class S> bool is_known(const ProbeWatchState<S>& s) noexcept {
  S precision = S(0);
  for (const S& error : s.error) precision = precision + S(1) / max(error, S(probe_least_error));
  const S windows = static_cast<S>(s.learnt) / S(probe_learning_windows);
  return s.learnt >= probe_learning_windows && windows * precision >= S(probe_known_precision);
}

/// Drive and encoder were right in the window that ended.
template <class S> void count_as_heard(ProbeWatchState<S>& s) noexcept {
  s.heard = s.way[0] = s.way[1] = s.added = S(0);
}

/// What the waves of a window say together.
template <class S> struct ProbeEvidence {
  S power{};                         ///< of what is due, over the errors' variances [1]
  S match[1 + probe_delay_count]{};  ///< of the answer with it, at no delay and at those that are looked for [1]
  S least{};                         ///< least gain of a healthy drive [1]
  std::uint32_t best = 0;            ///< delay that matches best, forwards or reversed
};

/// Sums up the waves, each with its `size` and `match`, by weights.
template <class S>
void weigh(ProbeEvidence<S>& e, const S* size, const S (*match)[1 + probe_delay_count], const S* weight) noexcept {
  e.power = S(0);
  for (std::uint32_t i = 0; i < probe_wave_count; ++i) e.power = e.power + weight[i] * size[i];
  e.best = 0;
  for (std::uint32_t k = 0; k <= probe_delay_count; ++k) {
    e.match[k] = S(0);
    for (std::uint32_t i = 0; i < probe_wave_count; ++i) e.match[k] = e.match[k] + weight[i] * match[i][k];
    if (abs(e.match[k]) > abs(e.match[e.best])) e.best = k;
  }
}

/// What the best explanation leaves of one wave, over its error's variance [1].
template <class S>
S left_of(const ProbeEvidence<S>& e, const S& size, const S& total, const S* match) noexcept {
  const S gain = e.match[e.best] / e.power;
  return total + gain * (gain * size - S(2) * match[e.best]);
}

/// Log-likelihood ratio of a gain without delay, against that nothing answers [1].
template <class S> S likelihood_of(const ProbeEvidence<S>& e, const S& gain) noexcept {
  return gain * (S(2) * e.match[0] - gain * e.power);
}
template <class S> S healthy_of(const ProbeEvidence<S>& e) noexcept {
  return likelihood_of(e, clamp(e.match[0] / e.power, e.least, S(probe_most_gain)));
}
template <class S> S wrong_of(const ProbeEvidence<S>& e) noexcept {
  return max(max(likelihood_of(e, S(-1)), likelihood_of(e, S(probe_wrong_gain))), S(0));
}

/// Return the fault after a whole window, if any, and update the learnt response of the robot from it.
template <class S>
SafetyFault judge(const ProbeWatchCoefficients<S>& c, ProbeWatchState<S>& s, const ProbeWindowState<S>& w,
                  bool hears_only = false) noexcept {
  S all = S(0);
  for (const ProbePhasor<S>& answer : w.answer) all = all + square(answer);
  for (const ProbePhasor<S>& asked : w.asked) all = all + square(asked);
  if (!is_finite(all)) {
    s = {};
    return SafetyFault::none;
  }
  // What lies between the waves, beyond the encoder's noise, is what a wave is disturbed by: the middle one by both.
  S beside[2], most = S(1);
  for (std::uint32_t k = 0; k < 2; ++k) {
    beside[k] = square(w.answer[probe_wave_count + k]);
    most = max(most, beside[k] / max(c.floor[probe_wave_count + k], S(std::numeric_limits<float>::min())));
  }
  for (std::uint32_t k = 0; k < 2; ++k) {
    const S& floor = c.floor[probe_wave_count + k];
    const S now = max(beside[k] - floor, S(0)), mean = s.noise[k] + S(probe_noise_share) * (now - s.noise[k]);
    const S lasting = floor > S(0) ? min(mean, S(probe_noise_fall) * most * floor) : mean;
    if (!hears_only) s.noise[k] = lasting;
    beside[k] = max(lasting, now);
  }
  const S noise[probe_wave_count] = {beside[0], S(0.5) * (beside[0] + beside[1]), beside[1]};
  const S moves = w.moving / (S(0.5) * static_cast<S>(c.params.samples));
  if (!(moves >= S(probe_judged_share))) return SafetyFault::none;
  const bool teaches = !hears_only && moves >= S(probe_learnt_share);
  begin(c, s);
  if (!is_known(s)) {
    S loud = S(0);
    for (std::uint32_t i = 0; i < probe_wave_count; ++i)
      loud = loud + square(w.answer[i]) / max(c.floor[i] + noise[i], S(std::numeric_limits<float>::min()));
    if (loud >= S(probe_loud_answer)) count_as_heard(s);
    if (teaches) learn(s, w);
    return SafetyFault::none;
  }

  // What was learnt from a few windows is less certain.
  const S novelty = S(1) + S(probe_novelty) / static_cast<S>(s.learnt);
  S quiet = S(0), size[probe_wave_count], total[probe_wave_count], match[probe_wave_count][1 + probe_delay_count];
  for (std::uint32_t i = 0; i < probe_wave_count; ++i) {
    const ProbePhasor<S> due = times(s.known[i], w.asked[i]), back{c.delay[i].cos, c.delay[i].sin};
    const S power = square(due);
    const S variance = max(c.floor[i] + noise[i] + novelty * max(S(probe_least_error), s.error[i]) * power,
                           S(std::numeric_limits<float>::min()));
    quiet = quiet + S(probe_learnt_noise) * power + c.floor[i] - noise[i];
    size[i] = power / variance;
    total[i] = square(w.answer[i]) / variance;
    ProbePhasor<S> turned = against(w.answer[i], due);
    for (std::uint32_t k = 0; k <= probe_delay_count; ++k) {
      match[i][k] = turned.real / variance;
      turned = against(turned, back);
      if (k == 0) turned = against(turned, back);
    }
  }
  // Where friction holds the joint for a part of the window, it may answer with less, and in the other direction.
  ProbeEvidence<S> e;
  e.least = S(probe_least_gain) - S(probe_standing_loss) * (S(1) - moves);
  S weight[probe_wave_count] = {S(1), S(1), S(1)};
  weigh(e, size, match, weight);
  if (!(e.power > S(0))) return SafetyFault::none;
  S left = S(0);
  for (std::uint32_t i = 0; i < probe_wave_count; ++i) left = left + left_of(e, size[i], total[i], match[i]);
  const S scale = max(left / S(probe_wave_count), S(1));
  // A wave that something else disturbs hides no others: each counts by what their best explanation leaves of it.
  ProbeEvidence<S> calm = e;
  for (std::uint32_t pass = 0; pass < probe_reweighings; ++pass) {
    for (std::uint32_t i = 0; i < probe_wave_count; ++i) weight[i] = S(1) / max(left_of(calm, size[i], total[i], match[i]), S(1));
    weigh(calm, size, match, weight);
  }
  const S sound = healthy_of(calm);
  if (sound - wrong_of(calm) >= S(probe_heard_evidence)) s.way[0] = s.way[1] = S(0);
  if (hears_only) return SafetyFault::none;
  for (S& each : weight) each = S(1) / scale;
  weigh(e, size, match, weight);
  const S healthy = healthy_of(e), wrongs = wrong_of(e);
  S likelihood[probe_sum_count] = {likelihood_of(e, S(-1)), likelihood_of(e, S(probe_wrong_gain)), S(0)};
  for (std::uint32_t k = 0; k < probe_delay_count; ++k) likelihood[3 + k] = S(2) * e.match[1 + k] - e.power;
  s.heard = max(s.heard + healthy - wrongs, S(0));
  if (s.heard >= S(probe_heard_evidence)) count_as_heard(s);
  // What is found is what explains this window best.
  std::uint32_t best = 0;
  bool is_found = false, is_doubtful = false;
  for (std::uint32_t k = 0; k < probe_sum_count; ++k) {
    // A wave that something else turns is not late.
    const S ratio = k < 3 ? likelihood[k] - healthy : S(2) * calm.match[k - 2] - calm.power - sound;
    const S more_evidence = min(ratio, S(probe_window_share) * c.params.evidence);
    s.sum[k] = max(s.sum[k] + more_evidence, S(0));
    is_found = is_found || s.sum[k] >= c.params.evidence;
    is_doubtful = is_doubtful || s.sum[k] > S(probe_doubt_share) * c.params.evidence;
    if (likelihood[k] > likelihood[best]) best = k;
  }
  // A window that a fault explains better is learnt from by no robot, lest a new fault become what is known.
  if (!is_doubtful && teaches && quiet >= S(0) && healthy > wrongs) learn(s, w);
  if (!is_found) return SafetyFault::none;
  constexpr SafetyFault verdicts[] = {SafetyFault::polarity, SafetyFault::gain, SafetyFault::unanswered};
  return best < 3 ? verdicts[best] : SafetyFault::late_answer;
}

/// Room below its limits that the law leaves to the waves [N m]: the more, the less of the way is left.
template <class S> S room_of(const ProbeWatchCoefficients<S>& c, const S& used) noexcept {
  return S(probe_crest) * c.params.effort * clamp(S(4) * used - S(2), S(0), S(1));
}

/// Ends a window: judges it, and begins the next.
template <class S>
SafetyFault end_window(const ProbeWatchCoefficients<S>& c, ProbeWatchState<S>& s, std::uint32_t which) noexcept {
  const ProbeWindowState<S> ended = s.window[which];
  s.window[which] = {};
  for (std::uint32_t k = 0; k < 2; ++k) s.way[k] = s.way[k] + ended.way[k];
  return judge(c, s, ended, which >= probe_window_count / 2);
}

/// One period: the velocity that the encoder shows [rad/s], and the mean effort between its last two readings [N m].
/// The drive's torque loop leaves the share `late` of a change to the next period. What is wrong, if anything.
template <class S>
SafetyFault step(const ProbeWatchCoefficients<S>& c, ProbeWatchState<S>& s, const S& velocity, const S& asked,
                 const S& late) noexcept {
  if (!(c.params.effort > S(0))) return SafetyFault::none;
  const S torque = c.inertia_rate * (velocity - s.velocity);
  s.velocity = velocity;
  s.slow = s.slow + c.smoothing * (velocity - s.slow);
  if (!is_finite(s.slow)) s.slow = S(0);
  s.due = asked + late * (s.due - asked);
  const S moves = abs(s.slow) > c.params.moving ? S(1) : S(0);
  s.apart = s.apart + velocity * c.period;
  if (!is_finite(s.apart)) s.apart = S(0);
  const S gone = s.apart - clamp(s.apart, -c.idle, c.idle);
  s.apart = s.apart - gone;
  s.added = s.added + max(S(probe_added_gain) * asked * gone, S(0));
  if (!is_finite(s.added)) s.added = S(0);
  const ProbePhasor<S>& weighs = s.phase[probe_bin_count];
  const S weights[probe_window_count] = {S(0.5) * (S(1) - weighs.real), S(0.5) * (S(1) + weighs.real),
                                         S(0.5) * (S(1) - weighs.imaginary), S(0.5) * (S(1) + weighs.imaginary)};
  for (std::uint32_t k = 0; k < probe_window_count; ++k) {
    ProbeWindowState<S>& w = s.window[k];
    const S answer = weights[k] * torque, given = weights[k] * s.due;
    for (std::uint32_t i = 0; i < probe_bin_count; ++i) {
      const ProbePhasor<S>& now = s.phase[i];
      w.answer[i].real = w.answer[i].real + answer * now.real;
      w.answer[i].imaginary = w.answer[i].imaginary - answer * now.imaginary;
      if (i >= probe_wave_count) continue;
      w.asked[i].real = w.asked[i].real + given * now.real;
      w.asked[i].imaginary = w.asked[i].imaginary - given * now.imaginary;
    }
    w.moving = w.moving + weights[k] * moves;
    const S part = weights[k] * S(2) / S(probe_window_count);
    w.way[0] = w.way[0] + part * max(gone, S(0));
    w.way[1] = w.way[1] + part * max(-gone, S(0));
  }
  for (std::uint32_t i = 0; i <= probe_bin_count; ++i)
    s.phase[i] = times(s.phase[i], ProbePhasor<S>{c.turn[i].cos, c.turn[i].sin});
  ++s.count;
  SafetyFault found = SafetyFault::none;
  const std::uint32_t quarter = c.params.samples / probe_window_count;
  if (s.count % quarter == 0) {
    // The window that ends at each quarter: those that are only heard end at the odd ones.
    constexpr std::uint32_t ends[] = {0, 2, 1, 3};
    const std::uint32_t which = ends[(s.count / quarter) % probe_window_count];
    if (s.begun < probe_window_count - 1) ++s.begun, s.window[which] = {};
    else found = end_window(c, s, which);
  }
  if (s.count >= c.params.samples) {
    s.count = 0;
    for (ProbePhasor<S>& one : s.phase) one = {S(1), S(0)};
  }
  if (found != SafetyFault::none) return found;
  return way_of(s) <= allowed_way(c, s) ? SafetyFault::none : SafetyFault::unanswered;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
