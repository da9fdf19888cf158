// Torque of one or several joints from EMG and angles as they arrive, by calibrated muscles or by a map of products.
//
//   raw EMG -> filter, rectify, filter, scale -> envelope -> share of each muscle -> delay, lags, shape
//   angles  -> low-pass, differences          -> length, rate and arms of each muscle -> force -> sum of arms
//
// One set of forces serves all joints. Envelopes that were made elsewhere go in as they are. Whatever comes in, what
// goes out is finite and within each joint's limit, and `fault` says what it is worth:
//   a channel or an angle that is silent keeps its last value for `patience` periods; then the channel is replaced by its
//   pattern, or without a watch is at rest, and without an angle every torque is 0. Periods that were missed are gone through with what was last heard; after more
//   than `most_missed_periods` it starts anew.
//   a channel that no longer is what it was in the calibration, to the torque's cost, is replaced by its pattern, and
//   where nothing holds every torque is 0 (emg_watch.hpp).
#pragma once

#include "biquad.hpp"
#include "emg_watch.hpp"
#include "hill_torque.hpp"
#include "muscle_path.hpp"
#include "muscle_stiffness.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Capacities of the estimator.
template <std::size_t channels_, std::size_t angles_, std::size_t muscles_, std::size_t joints_, std::size_t delay_,
          std::size_t lag_ = 1>
struct EmgSize {
  static constexpr std::size_t channels = channels_;  ///< number of EMG channels, at most 32
  static constexpr std::size_t angles = angles_;      ///< at most 32
  static constexpr std::size_t muscles = muscles_;    ///< at least 1, used or not
  static constexpr std::size_t joints = joints_;      ///< number of joints whose torque is estimated
  static constexpr std::size_t delay = delay_;        ///< samples that a muscle keeps, 3 more than its delay; >= 4
  static constexpr std::size_t lag = lag_;            ///< samples of each envelope that a map keeps, >= 1
};

constexpr std::size_t most_emg_lags = 4;
constexpr std::uint32_t most_missed_periods = 8;
constexpr std::uint32_t no_factor = 0xffffffffu;

/// A muscle of the estimator.
template <class S, class Size> struct DrivenMuscleParams {
  EmgMuscleParams<S> muscle{};   ///< from the envelope on; its period is the estimator's
  MusclePathParams<S> path{};    ///< length and arms
  S share[Size::channels]{};     ///< share of each channel's envelope in the muscle's excitation [1]
};

/// One term of a map: weight times one feature, or times two.
template <class S> struct TorqueTerm {
  S weight{};                        ///< [N m per unit of what it multiplies]
  std::uint32_t first = no_factor;   ///< feature; none: an offset
  std::uint32_t second = no_factor;  ///< the other, or none
};

/// A joint that a torque is asked for.
template <class S> struct EstimatedJointParams {
  std::uint32_t angle = 0;                     ///< index of the joint's own angle
  S offset{}, stiffness{}, damping{}, limit{};  ///< its own tissue; the largest |torque|
  const TorqueTerm<S>* term = nullptr;         ///< terms of a linear map, beside the muscles; they outlive the coefficients
  std::uint32_t terms = 0;                     ///< how many

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.offset, {"offset", unit::effort, any_number(), "torque offset of the joint's own tissue"});
    visit(p.stiffness, {"stiffness", unit::stiffness, any_number(), "stiffness of that tissue, k in -k q"});
    visit(p.damping, {"damping", unit::viscous, any_number(), "damping of that tissue, b in -b dq/dt"});
    visit(p.limit, {"limit", unit::effort, above(0), "limit of |torque|, above all recorded values"});
  }
};

/// One channel of EMG.
template <class S> struct EmgChannelParams {
  S scale{S(1)}, rest{}, ceiling{S(1)};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.scale, {"scale", unit::one, above(0), "scale of the computed or given envelope"});
    visit(p.rest, {"rest", unit::one, any_number(), "envelope of a channel that is lost"});
    visit(p.ceiling, {"ceiling", unit::one, any_number(), "an envelope above it is no muscle's, and is cut off there"});
  }
};

/// Parameters of an estimator of torque from EMG.
template <class S, class Size> struct EmgEstimatorParams {
  std::uint32_t channels = 0, angles = 0, muscles = 0, joints = 0;  ///< how many of each are used
  bool raw = false;                             ///< whether EMG comes as it was recorded, through `listen`
  BiquadCoefficients<S, 6> before{};            ///< before it is rectified, at the rate of `listen`
  BiquadCoefficients<S, 4> after{};             ///< after
  EmgChannelParams<S> channel[Size::channels]{};  ///< in the order of its samples
  BiquadCoefficients<S, 1> motion{};            ///< low-pass on angles before they are differentiated
  DrivenMuscleParams<S, Size> muscle[Size::muscles]{};  ///< none beside a map
  EstimatedJointParams<S> joint[Size::joints]{};  ///< joints whose torque is estimated
  ShortRangeParams<S> short_range{};            ///< short-range stiffness
  EmgWatchParams<S, Size::channels, Size::angles> watch{};  ///< channels as they were in the calibration
  const TorqueTerm<S>* pattern[Size::channels]{};  ///< terms of each channel's pattern, of angles alone; they outlive the coefficients
  std::uint32_t pattern_terms[Size::channels]{};   ///< how many of each
  std::uint32_t lag[most_emg_lags]{};           ///< how much earlier a map sees envelopes too, in samples
  std::uint32_t lags = 0;                       ///< how many of them
  S period{};                                   ///< control period [s]
  std::uint32_t period_us = 0;                  ///< the same, rounded [us]
  std::uint32_t patience = 0;                   ///< periods that what is silent keeps its last value
};

/// Coefficients computed once from DrivenMuscleParams.
template <class S, class Size> struct DrivenMuscleCoefficients {
  EmgMuscleCoefficients<S> muscle{};    ///< from the envelope on
  MusclePathCoefficients<S> path{};     ///< length and arms
  S share[Size::channels]{};            ///< share of each channel's envelope in the muscle's excitation [1]
};

/// Coefficients computed once from EmgEstimatorParams.
template <class S, class Size> struct EmgEstimatorCoefficients {
  std::uint32_t channels = 0, angles = 0, muscles = 0, joints = 0;  ///< how many of each are used
  bool raw = false, valid = false;                ///< as asked; whether the parameters make sense
  BiquadCoefficients<S, 6> before{};              ///< before EMG is rectified
  BiquadCoefficients<S, 4> after{};               ///< after
  EmgChannelParams<S> channel[Size::channels]{};  ///< as they are
  BiquadCoefficients<S, 1> motion{};              ///< on angles
  DrivenMuscleCoefficients<S, Size> muscle[Size::muscles]{};  ///< each
  EstimatedJointParams<S> joint[Size::joints]{};  ///< as they are
  ShortRangeCoefficients<S> short_range{};        ///< short-range stiffness
  EmgWatchParams<S, Size::channels, Size::angles> watch{};  ///< as it is
  const TorqueTerm<S>* pattern[Size::channels]{};  ///< as they are
  std::uint32_t pattern_terms[Size::channels]{};   ///< how many of each
  std::uint32_t lag[most_emg_lags]{};             ///< in samples
  std::uint32_t lags = 0;                         ///< how many
  S rate{};                                       ///< steps a second [1/s]
  std::uint32_t period_us = 0;                    ///< [us]
  std::uint32_t patience = 0;                     ///< periods
};

namespace detail {

/// Largest plausible angle of a joint [rad] and sample of an amplifier [V]; filters would retain larger ones for long.
constexpr double largest_angle = 100.0;
constexpr double largest_emg = 1e6;

template <class S> bool is_angle(const S& x) noexcept { return abs(x) <= S(largest_angle); }

template <class S, class Size> bool is_sound(const EmgEstimatorParams<S, Size>& p) noexcept {
  bool sound = p.channels <= Size::channels && p.angles >= 1 && p.angles <= Size::angles && p.muscles <= Size::muscles &&
               p.joints >= 1 && p.joints <= Size::joints && p.lags <= most_emg_lags && p.period > S(0) &&
               is_finite(p.period) && p.period_us > 0 && pellucid::is_sound(p.short_range);
  if (!sound) return false;
  for (std::size_t i = 0; i < p.lags; ++i) sound = sound && p.lag[i] < Size::lag;
  for (std::size_t i = 0; i < p.channels; ++i)
    sound = sound && pellucid::is_sound(p.channel[i]) && p.channel[i].ceiling >= p.channel[i].rest;
  const std::uint32_t features = p.channels * (1 + p.lags) + 3 * p.angles;
  for (std::size_t j = 0; j < p.joints; ++j) {
    const EstimatedJointParams<S>& joint = p.joint[j];
    sound = sound && joint.angle < p.angles && pellucid::is_sound(joint) && (joint.terms == 0 || joint.term != nullptr);
    for (std::size_t i = 0; sound && i < joint.terms; ++i) {
      const TorqueTerm<S>& term = joint.term[i];
      sound = is_finite(term.weight) && (term.first == no_factor || term.first < features) &&
              (term.second == no_factor || term.second < features);
    }
  }
  sound = sound && is_sound(p.watch, p.channels, p.angles);
  for (std::size_t i = 0; p.watch.on && sound && i < p.channels; ++i) {
    sound = p.pattern_terms[i] == 0 || p.pattern[i] != nullptr;
    for (std::size_t t = 0; sound && t < p.pattern_terms[i]; ++t) {
      const auto is_of_angles = [&p, features](std::uint32_t x) {
        return x == no_factor || (x >= p.channels * (1 + p.lags) && x < features);
      };
      const TorqueTerm<S>& term = p.pattern[i][t];
      sound = is_finite(term.weight) && is_of_angles(term.first) && is_of_angles(term.second);
    }
  }
  for (std::size_t m = 0; m < p.muscles; ++m) {
    sound = sound && pellucid::is_sound(p.muscle[m].muscle) && coefficients(p.muscle[m].path).valid;
    for (std::size_t i = 0; i < p.channels; ++i) sound = sound && is_finite(p.muscle[m].share[i]);
  }
  return sound;
}

}  // namespace detail

template <class S, class Size>
EmgEstimatorCoefficients<S, Size> coefficients(const EmgEstimatorParams<S, Size>& p) noexcept {
  static_assert(Size::channels <= 32 && Size::angles <= 32, "a bit for each");
  static_assert(Size::delay >= 4 && Size::lag >= 1, "four samples make one between");
  EmgEstimatorCoefficients<S, Size> c;
  c.valid = detail::is_sound(p);
  if (!c.valid) return c;
  c.channels = p.channels;
  c.angles = p.angles;
  c.muscles = p.muscles;
  c.joints = p.joints;
  c.raw = p.raw;
  c.before = p.before;
  c.after = p.after;
  c.motion = p.motion;
  for (std::size_t i = 0; i < p.channels; ++i) c.channel[i] = p.channel[i];
  for (std::size_t m = 0; m < p.muscles; ++m) {
    EmgMuscleParams<S> muscle = p.muscle[m].muscle;
    muscle.activation.period = p.period;
    c.muscle[m].muscle = coefficients(muscle, Size::delay - 3);
    c.muscle[m].path = coefficients(p.muscle[m].path);
    for (std::size_t i = 0; i < p.channels; ++i) c.muscle[m].share[i] = p.muscle[m].share[i];
  }
  for (std::size_t j = 0; j < p.joints; ++j) c.joint[j] = p.joint[j];
  c.short_range = coefficients(p.short_range);
  c.watch = p.watch;
  for (std::size_t i = 0; i < p.channels; ++i) {
    c.pattern[i] = p.pattern[i];
    c.pattern_terms[i] = p.pattern_terms[i];
  }
  for (std::size_t i = 0; i < most_emg_lags; ++i) c.lag[i] = p.lag[i];
  c.lags = p.lags;
  c.rate = S(1) / p.period;
  c.period_us = p.period_us;
  c.patience = p.patience;
  return c;
}

/// A cascade as if `x` had always been there.
template <class S, std::size_t most>
void settle(const BiquadCoefficients<S, most>& c, BiquadState<S, most>& state, S x) noexcept {
  for (std::size_t i = 0; i < c.count && i < most; ++i) {
    const BiquadSection<S>& k = c.section[i];
    const S y = x * ((k.b0 + k.b1 + k.b2) / (S(1) + k.a1 + k.a2));
    state.s2[i] = k.b2 * x - k.a2 * y;
    state.s1[i] = (k.b1 * x - k.a1 * y) + state.s2[i];
    x = y;
  }
}

/// Validity of an estimate.
enum class EmgFault : std::uint8_t {
  none,           ///< as good as its calibration
  configuration,  ///< the parameters make no sense: every torque is 0
  time,           ///< the time did not go on: the last answer once more
  angle,          ///< an angle is lost, or was never heard: every torque is 0
  channel,        ///< a channel is lost: its pattern stands in its place, or without a watch it counts as at rest
  ceiling,        ///< an envelope is above what a muscle gives, and was cut off
  limit,          ///< a torque was beyond its limit, and was cut off; or it was no number, and is 0
  restarted,      ///< the first step, or the first after too long a gap: lags and rates begin anew
  changed,        ///< a channel is not what it was in the calibration: its pattern stands in its place
  unlike,         ///< channels or movement are unlike the calibration: every torque is 0
  uncertain,      ///< channels cost the torque more than it may lose, and none can be named: its interval widened
};
constexpr const char* emg_fault_names[] = {"none",    "configuration", "time",  "angle",
                                           "channel", "ceiling",       "limit", "restarted",
                                           "changed", "unlike", "uncertain"};

/// Inputs at one instant.
template <class S, class Size> struct EmgSamples {
  std::int64_t time = 0;          ///< on any clock that only goes on [us]
  S envelope[Size::channels]{};   ///< where they were made elsewhere; what is not finite was not heard
  S angle[Size::angles]{};        ///< [rad]; what is not finite, or beyond 100, was not heard
};

/// Outputs.
template <class S, class Size> struct EmgEstimate {
  S torque[Size::joints]{};             ///< [N m], finite and within each limit
  std::uint32_t lost = 0;               ///< channels that have been silent for too long, a bit each
  std::uint32_t above = 0;              ///< channels above their ceiling
  std::uint32_t blind = 0;              ///< angles that are lost
  std::uint32_t changed = 0;            ///< channels that changed since the calibration, replaced by their patterns
  S widening{S(1)};                     ///< error of the torque over its calibrated error
  EmgFault fault = EmgFault::angle;     ///< the gravest; without one this is `none`
};

/// State of one angle.
template <class S> struct AngleState {
  BiquadState<S, 1> filter{};  ///< low-pass
  S heard{};                   ///< last value [rad]
  S smooth{};                  ///< through the filter [rad]
  S rate{};                    ///< [rad/s]
  S acceleration{};            ///< [rad/s^2]
  std::uint32_t silent = 0;    ///< periods since
};

/// State of one channel.
template <class S, std::size_t lag> struct ChannelState {
  BiquadState<S, 6> before{};  ///< filters of raw EMG
  BiquadState<S, 4> after{};   ///< filters of rectified EMG
  S level{};                   ///< last output of these
  bool fresh = false;          ///< whether they gave anything since the last step
  S heard{};                   ///< last envelope
  std::uint32_t silent = 0;    ///< periods since
  S past[lag]{};               ///< envelopes as they were used, a ring
};

/// State of the estimator. Zeros are a valid initial state.
template <class S, class Size> struct EmgEstimatorState {
  ChannelState<S, Size::lag> channel[Size::channels]{};  ///< each one's filters and lags
  AngleState<S> angle[Size::angles]{};  ///< each, with its speed
  EmgMuscleState<S, Size::delay> muscle[Size::muscles]{};  ///< activation and what is on its way
  MusclePath<S> path[Size::muscles]{};  ///< at the last step
  S stretch[Size::muscles]{};           ///< rate of each length [m/s]
  EmgWatchState<S, Size::channels> watch{};  ///< channels against those of the calibration
  std::size_t next = 0;                 ///< where the next envelope goes in a ring
  std::int64_t time = 0;                ///< time of the last step [us]
  bool started = false;                 ///< false until every angle has been heard once
  EmgEstimate<S, Size> estimate{};      ///< the last
};

/// One raw sample of every channel, at the rate that the filters are made for. What is not finite, or beyond 1e6, is
/// passed over.
template <class S, class Size> void listen(const EmgEstimatorCoefficients<S, Size>& c, EmgEstimatorState<S, Size>& s,
                                           const S (&raw)[Size::channels]) noexcept {
  if (!c.valid || !c.raw) return;
  for (std::size_t i = 0; i < c.channels; ++i) {
    ChannelState<S, Size::lag>& state = s.channel[i];
    if (!(abs(raw[i]) <= S(detail::largest_emg))) continue;
    state.level = step(c.after, state.after, abs(step(c.before, state.before, raw[i])));
    state.fresh = is_finite(state.level);
  }
}

namespace detail {

/// Torque of the muscles and the map at what is heard or held now.
template <class S, class Size> void advance(const EmgEstimatorCoefficients<S, Size>& c, EmgEstimatorState<S, Size>& s,
                                            const EmgSamples<S, Size>& in, bool heard) noexcept {
  EmgEstimate<S, Size>& out = s.estimate;
  const bool first = !s.started;
  out = {};
  S envelope[Size::channels]{};
  for (std::size_t i = 0; i < c.channels; ++i) {
    ChannelState<S, Size::lag>& state = s.channel[i];
    const EmgChannelParams<S>& p = c.channel[i];
    const S x = (c.raw ? state.level : in.envelope[i]) * p.scale;
    if (first) state.heard = p.rest;
    if (heard && is_finite(x) && (!c.raw || state.fresh)) {
      state.heard = x;
      state.silent = 0;
    } else if (state.silent < 0xffffffffu) {
      ++state.silent;
    }
    if (heard) state.fresh = false;
    const bool lost = state.silent > c.patience;
    if (lost) out.lost |= 1u << i;
    if (!lost && state.heard > p.ceiling) out.above |= 1u << i;
    // A filter's undershoot is no activity below 0.
    envelope[i] = lost ? p.rest : max(S(0), min(state.heard, p.ceiling));
    if (first)
      for (S& past : state.past) past = envelope[i];
    state.past[s.next] = envelope[i];
  }
  S angle[Size::angles]{}, rate[Size::angles]{};
  for (std::size_t k = 0; k < c.angles; ++k) {
    AngleState<S>& state = s.angle[k];
    if (heard && is_angle(in.angle[k])) {
      state.heard = in.angle[k];
      state.silent = 0;
    } else if (state.silent < 0xffffffffu) {
      ++state.silent;
    }
    if (state.silent > c.patience) out.blind |= 1u << k;
    if (first) {
      settle(c.motion, state.filter, state.heard);
      state.smooth = state.heard;
    }
    const S smooth = step(c.motion, state.filter, state.heard);
    const S speed = first ? S(0) : c.rate * (smooth - state.smooth);
    state.acceleration = first ? S(0) : c.rate * (speed - state.rate);
    state.rate = rate[k] = speed;
    state.smooth = smooth;
    angle[k] = state.heard;
  }
  const auto feature = [&c, &s](std::uint32_t i) {
    const std::uint32_t seen = 1 + c.lags, all = c.channels * seen;
    if (i >= all) {
      const AngleState<S>& state = s.angle[(i - all) / 3];
      return (i - all) % 3 == 0 ? state.smooth : (i - all) % 3 == 1 ? state.rate : state.acceleration;
    }
    const std::size_t age = i % seen == 0 ? 0 : c.lag[i % seen - 1];
    return s.channel[i / seen].past[s.next >= age ? s.next - age : s.next + Size::lag - age];
  };
  const auto product = [&feature](const TorqueTerm<S>& term) {
    const S one = term.first == no_factor ? S(1) : feature(term.first);
    return term.weight * one * (term.second == no_factor ? S(1) : feature(term.second));
  };
  if (c.watch.on && out.blind == 0) {
    S pattern[Size::channels]{};
    for (std::size_t i = 0; i < c.channels; ++i) {
      S sum(0);
      for (std::size_t t = 0; t < c.pattern_terms[i]; ++t) sum = sum + product(c.pattern[i][t]);
      pattern[i] = is_finite(sum) ? max(S(0), min(sum, c.channel[i].ceiling)) : S(0);
    }
    bool strange = false;
    for (std::size_t k = 0; k < c.angles; ++k) {
      const WatchedAngleParams<S>& fitted = c.watch.angle[k];
      strange = strange || s.angle[k].smooth < fitted.low || s.angle[k].smooth > fitted.high ||
                rate[k] < fitted.slowest || rate[k] > fitted.fastest;
    }
    step(c.watch, s.watch, envelope, pattern, c.channels, out.lost, strange);
    out.changed = s.watch.changed;
    out.widening = s.watch.widening;
    for (std::size_t i = 0; i < c.channels; ++i)
      if (((out.changed | out.lost) >> i & 1u) != 0) {
        const S instead = s.watch.common * pattern[i];
        envelope[i] = is_finite(instead) ? max(S(0), min(instead, c.channel[i].ceiling)) : c.channel[i].rest;
        s.channel[i].past[s.next] = envelope[i];
      }
  }
  S torque[Size::joints]{};
  for (std::size_t m = 0; m < c.muscles; ++m) {
    const DrivenMuscleCoefficients<S, Size>& muscle = c.muscle[m];
    S excitation(0);
    for (std::size_t i = 0; i < c.channels; ++i) excitation = excitation + muscle.share[i] * envelope[i];
    s.path[m] = muscle_path(muscle.path, angle, c.angles);
    S stretch(0);
    for (std::size_t a = 0; a < muscle.path.axes; ++a)
      if (muscle.path.axis[a].axis.angle < c.angles)
        stretch = stretch + s.path[m].slope[a] * rate[muscle.path.axis[a].axis.angle];
    s.stretch[m] = stretch;
    const S force = step(muscle.muscle, s.muscle[m], excitation, s.path[m].length, stretch);
    for (std::size_t j = 0; j < c.joints; ++j)
      for (std::size_t a = 0; a < muscle.path.axes; ++a)
        if (muscle.path.axis[a].axis.angle == c.joint[j].angle) torque[j] = torque[j] - s.path[m].slope[a] * force;
  }
  bool cut = false;
  for (std::size_t j = 0; j < c.joints; ++j) {
    const EstimatedJointParams<S>& joint = c.joint[j];
    S sum = torque[j] + (joint.offset - joint.stiffness * angle[joint.angle] - joint.damping * rate[joint.angle]);
    for (std::size_t i = 0; i < joint.terms; ++i) sum = sum + product(joint.term[i]);
    const S bounded = is_finite(sum) ? clamp(sum, -joint.limit, joint.limit) : S(0);
    cut = cut || !(sum == bounded);
    out.torque[j] = out.blind != 0 || (c.watch.on && s.watch.unlike) ? S(0) : bounded;
  }
  s.next = s.next + 1 < Size::lag ? s.next + 1 : 0;
  s.started = true;
  out.fault = out.blind != 0   ? EmgFault::angle
              : c.watch.on && s.watch.unlike ? EmgFault::unlike
              : out.lost != 0  ? EmgFault::channel
              : out.changed != 0 ? EmgFault::changed
              : !(out.widening <= S(max_widening)) ? EmgFault::uncertain
              : out.above != 0 ? EmgFault::ceiling
              : cut            ? EmgFault::limit
              : first          ? EmgFault::restarted
                               : EmgFault::none;
}

/// All but the filters of raw EMG as at power-on: these have gone on.
template <class S, class Size> void restart(EmgEstimatorState<S, Size>& s) noexcept {
  for (auto& channel : s.channel) channel.silent = 0;
  for (auto& angle : s.angle) angle.silent = 0;
  for (auto& muscle : s.muscle) muscle.settled = muscle.delay.any = false;
  s.next = 0;
  s.started = false;
}

}  // namespace detail

/// One period: torques, and what they are worth.
template <class S, class Size> EmgEstimate<S, Size> step(const EmgEstimatorCoefficients<S, Size>& c,
                                                         EmgEstimatorState<S, Size>& s,
                                                         const EmgSamples<S, Size>& in) noexcept {
  EmgEstimate<S, Size> refused;
  if (!c.valid) {
    refused.fault = EmgFault::configuration;
    return refused;
  }
  if (s.started) {
    const std::uint64_t gap = static_cast<std::uint64_t>(in.time) - static_cast<std::uint64_t>(s.time);
    const std::uint64_t half = c.period_us / 2u;
    if (gap > 0x7fffffffffffffffu || gap < half) {
      refused = s.estimate;
      refused.fault = EmgFault::time;
      return refused;
    }
    const std::uint64_t periods = (gap + half) / c.period_us;
    if (periods > most_missed_periods + 1u)
      detail::restart(s);
    else
      for (std::uint64_t missed = 1; missed < periods; ++missed) detail::advance(c, s, in, false);
  }
  if (!s.started) {
    for (std::size_t k = 0; k < c.angles; ++k)
      if (!detail::is_angle(in.angle[k])) refused.blind |= 1u << k;
    refused.fault = EmgFault::angle;
    if (refused.blind != 0) return refused;
  }
  s.time = in.time;
  detail::advance(c, s, in, true);
  return s.estimate;
}

/// Stiffness of the joints at the last step, -d torque / d angle [N m/rad]: row by the torque, column by the angle.
template <class S, class Size> struct JointStiffness {
  S short_range[Size::joints][Size::joints]{};  ///< at once: attached cross-bridges, tendons, arms that turn, tissue
  S slope[Size::joints][Size::joints]{};        ///< slope of the model's torque: Hill's curves, arms that turn, tissue
};

template <class S, class Size> JointStiffness<S, Size> stiffness(const EmgEstimatorCoefficients<S, Size>& c,
                                                                 const EmgEstimatorState<S, Size>& s) noexcept {
  JointStiffness<S, Size> k;
  if (!c.valid || !s.started || s.estimate.blind != 0) return k;
  for (std::size_t m = 0; m < c.muscles; ++m) {
    const DrivenMuscleCoefficients<S, Size>& muscle = c.muscle[m];
    const EmgMuscleState<S, Size::delay>& state = s.muscle[m];
    const MuscleStiffness<S> along =
        muscle_stiffness(c.short_range, muscle.muscle.muscle, state.activation, state.fibre, s.stretch[m]);
    for (std::size_t a = 0; a < muscle.path.axes; ++a)
      for (std::size_t b = 0; b < muscle.path.axes; ++b) {
        const S arms = s.path[m].slope[a] * s.path[m].slope[b], turning = s.path[m].bend[a][b] * state.force;
        for (std::size_t i = 0; i < c.joints; ++i)
          for (std::size_t j = 0; j < c.joints; ++j)
            if (muscle.path.axis[a].axis.angle == c.joint[i].angle &&
                muscle.path.axis[b].axis.angle == c.joint[j].angle) {
              k.short_range[i][j] = k.short_range[i][j] + (arms * along.short_range + turning);
              k.slope[i][j] = k.slope[i][j] + (arms * along.slope + turning);
            }
      }
  }
  for (std::size_t j = 0; j < c.joints; ++j) {
    k.short_range[j][j] = k.short_range[j][j] + c.joint[j].stiffness;
    k.slope[j][j] = k.slope[j][j] + c.joint[j].stiffness;
  }
  for (std::size_t i = 0; i < c.joints; ++i)
    for (std::size_t j = 0; j < c.joints; ++j) {
      k.short_range[i][j] = is_finite(k.short_range[i][j]) ? k.short_range[i][j] : S(0);
      k.slope[i][j] = is_finite(k.slope[i][j]) ? k.slope[i][j] : S(0);
    }
  return k;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
