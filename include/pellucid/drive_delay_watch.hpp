// Whether a drive answers late, by its own measurement, where lateness alone stays within every tolerance.
//
// With the effort a that it was asked for and what it gave instead, both smoothed,
//
//   a - given = T a' + g a + c + noise
//
// T is how late it is, g and c are errors of its measurement. Least squares with forgetting over a' and a, means taken off,
// give T; it is judged only while a' varies enough, beside what a itself explains of it, and where T a' makes at least a
// share of what g a leaves of the difference: a drive that is wrong in another way is no late one.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct DriveDelayWatchParams {
  S limit = S(std::numeric_limits<S>::infinity()), rate = limit, smoothing = S(60), forget = S(0.5), share{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.limit, {"drive_delay", unit::time, above(0).or_infinite(),
                    "largest delay of the drive's response; infinite: any"});
    visit(p.rate, {"drive_delay_rate", unit::effort_rate, above(0).or_infinite(),
                   "smallest standard deviation of the command's rate for the check of the delay"});
    visit(p.smoothing, {"drive_delay_smoothing", unit::rate, above(0),
                        "bandwidth of the low-pass on command and response; times the period below 1"});
    visit(p.forget, {"drive_delay_forget", unit::rate, above(0),
                     "rate at which earlier samples are forgotten; times the period below 1"});
    visit(p.share, {"drive_delay_share", unit::one, pellucid::share(),
                    "share of the response's error that the delay must explain; 0: any"});
  }
};

constexpr double delay_memory = 0.4;  ///< share of the memory's time constant before which nothing is judged [1]

/// Coefficients computed once from DriveDelayWatchParams and the period of the watch.
template <class S> struct DriveDelayWatchCoefficients {
  DriveDelayWatchParams<S> params{};  ///< as they are
  S smoothing{};                      ///< share of a new effort in the smoothed one [1]
  S forget{};                         ///< share of what was seen before that a period forgets [1]
  S inverse_period{};                 ///< [1/s]
  S needed{};                         ///< variance of the command's rate that is needed
  bool valid = false;                 ///< whether the parameters make sense
};

template <class S>
DriveDelayWatchCoefficients<S> coefficients(const DriveDelayWatchParams<S>& p, const S& period) noexcept {
  DriveDelayWatchCoefficients<S> c;
  c.params = p;
  c.smoothing = p.smoothing * period;
  c.forget = p.forget * period;
  c.inverse_period = S(1) / period;
  c.needed = p.rate * p.rate;
  c.valid = is_sound(p) && c.smoothing < S(1) && c.forget < S(1) && period > S(0);
  return c;
}

template <class S> struct DriveDelayWatchState {
  S asked{};      ///< smoothed command [N m]
  S given{};      ///< smoothed answer [N m]
  S mean{};       ///< mean of the smoothed command [N m]
  S mean_rate{};  ///< mean of its rate [N m/s]
  S mean_error{};  ///< mean of command less answer [N m]
  S aa{}, ar{}, rr{}, ea{}, er{}, ee{};  ///< covariances of command a, its rate r and command less answer e
  S count{};                       ///< answers so far, up to the memory's
};

/// Estimate of the delay from the responses so far.
template <class S> struct SeenLateness {
  S late{};               ///< how late they are, times `varied`
  S varied{};             ///< variance of the command's rate beside the command, times the command's
  bool is_shown = false;  ///< whether the rate varied enough, and lateness explains enough of what is wrong
};

template <class S>
SeenLateness<S> seen_lateness(const DriveDelayWatchCoefficients<S>& c, const DriveDelayWatchState<S>& s) noexcept {
  SeenLateness<S> seen;
  seen.varied = s.rr * s.aa - s.ar * s.ar;
  seen.late = s.er * s.aa - s.ea * s.ar;
  // Errors less what the command explains of them, times aa; lateness explains its square over what varied.
  const S errors = s.ee * s.aa - s.ea * s.ea;
  seen.is_shown = s.count * c.forget >= S(delay_memory) && seen.varied > c.needed * s.aa &&
                  seen.late * seen.late >= c.params.share * seen.varied * errors;
  return seen;
}

/// One period in which the answer to a command was heard: `drive_effort` where it is late.
template <class S> SafetyFault step(const DriveDelayWatchCoefficients<S>& c, DriveDelayWatchState<S>& s, const S& asked,
                                    const S& given) noexcept {
  if (!(s.count > S(0))) {
    s.asked = s.mean = asked;
    s.given = given;
    s.mean_error = asked - given;
  }
  // Until the memory is full each answer weighs the same.
  if (s.count * c.forget < S(1)) s.count = s.count + S(1);
  const S share = max(c.forget, S(1) / s.count);
  const S before = s.asked;
  s.asked = s.asked + c.smoothing * (asked - s.asked);
  s.given = s.given + c.smoothing * (given - s.given);
  const S a = s.asked - s.mean, r = (s.asked - before) * c.inverse_period - s.mean_rate,
          e = s.asked - s.given - s.mean_error, keep = S(1) - share;
  s.mean = s.mean + share * a;
  s.mean_rate = s.mean_rate + share * r;
  s.mean_error = s.mean_error + share * e;
  s.aa = keep * (s.aa + share * a * a);
  s.ar = keep * (s.ar + share * a * r);
  s.rr = keep * (s.rr + share * r * r);
  s.ea = keep * (s.ea + share * e * a);
  s.er = keep * (s.er + share * e * r);
  s.ee = keep * (s.ee + share * e * e);
  if (!is_finite(s.asked + s.given + s.aa + s.ar + s.rr + s.ea + s.er + s.ee)) {
    s = {};
    return SafetyFault::none;
  }
  const SeenLateness<S> seen = seen_lateness(c, s);
  return seen.is_shown && !(seen.late <= c.params.limit * seen.varied) ? SafetyFault::drive_effort : SafetyFault::none;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
