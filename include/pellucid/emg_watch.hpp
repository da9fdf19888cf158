// Channels of EMG held against those that an estimator was calibrated on, sample by sample while it runs.
//
//   p_k = map of angles and rates        envelope of channel k in the fitted recordings, by the movement
//   s   = median_k sqrt(<x_k x_k> / <p_k p_k>)     another load or effort changes all channels together
//   e_k = <(x_k - s p_k)^2> / max(1, s^2) - usual_k                error beyond what the fitted recordings show
//   d_k = consequence_k (e_k - <p_k p_k> max(0, median_k(e_k / <p_k p_k>)))
//   q_k = consequence_k <x_k x_k>, as fitted, times how far a silence is beyond any that the fitted recordings show
//
// The last median takes off what all channels miss alike while the effort changes. A silence needs no pattern: it is the
// time for which an envelope stays below its floor, or below its usual activity, while the other channels are active.
//
// <> forgets within a second, one multiplication a step, so that every step costs the same. `consequence` is the share
// of the torque's variance that a squared error of the channel costs, so that d_k is the R² that a channel which no
// longer follows its pattern may take from the torque.
//
// A channel has changed when the excess of d_k over its limit, in multiples of it, adds up to `confirm_seconds`: a large
// loss is named at once, a small one when it lasts. The limit is `max_loss`, or consequence_k margin_k where this is
// larger: where the movement tells little of a muscle, other recordings exceed usual_k by chance. A silence of its
// longest time changes a channel too. Then s p_k takes its place, as it does for a channel that is not heard.
// It is heard again when it is not silent and d_k has been below its limit for as much activity of the pattern as
// `repair_seconds` of the fitted recordings hold: a muscle at rest is no evidence. The torque's error is
//
//   w^2 = 1 + sum_k u_k / residual,   u_k = max(d_k, q_k), or for a channel that is replaced consequence_k usual_k
//
// times the calibrated one; `residual` is the share of the torque's variance that the calibration leaves unexplained.
// Beyond `max_widening` the torque is not as good as its calibration, whether or not a channel can be named.
//
// Where most channels changed or miss their patterns, s lies outside its bounds or the movement is none of those that
// were fitted, nothing tells which channel is right, and no torque holds.
#pragma once

#include "fields.hpp"
#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Share of the patterns' mean square that most channels may miss at once, beyond which no torque holds. A step of all
/// efforts by a factor of two or three misses less for a moment; noise in place of envelopes misses all.
constexpr double max_common_miss = 0.25;
/// Share of the watched time outside the fitted movements beyond which no torque holds.
constexpr double max_strange_share = 0.25;
/// Sum over time of d / max_loss - 1, never below 0, at which a channel has changed [s]. While all efforts rise at once,
/// single channels lead the others for a part of a stride.
constexpr double confirm_seconds = 1.0;
/// Activity of a channel's pattern, in seconds of the fitted recordings, that must agree before it is heard again.
constexpr double repair_seconds = 5.0;
/// Error of the torque over its calibrated error beyond which it is not as good as its calibration.
constexpr double max_widening = 1.5;

/// A channel as it was in the fitted recordings.
template <class S> struct WatchedChannelParams {
  S consequence{}, usual{}, square{}, product{}, pattern_square{}, margin{};
  S floor{}, floor_seconds{}, idle{}, idle_seconds{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.consequence, {"consequence", unit::one, at_least(0),
                          "share of the torque's variance per squared envelope"});
    visit(p.usual, {"usual", unit::one, at_least(0), "largest <(x - s p)^2> in the fitted recordings"});
    visit(p.square, {"square", unit::one, at_least(0), "<x x> in the fitted recordings, with which the watch begins"});
    visit(p.product, {"product", unit::one, at_least(0), "<x p> in them"});
    visit(p.pattern_square, {"pattern_square", unit::one, at_least(0), "<p p> in them"});
    visit(p.margin, {"margin", unit::one, at_least(0), "by which other recordings may exceed it by chance"});
    visit(p.floor, {"floor", unit::one, at_least(0), "envelope below which a channel gives no signal"});
    visit(p.floor_seconds, {"floor_seconds", unit::time, at_least(0), "time below it that is a change; 0: none is"});
    visit(p.idle, {"idle", unit::one, at_least(0), "envelope below which its muscle is not active"});
    visit(p.idle_seconds, {"idle_seconds", unit::time, at_least(0), "time below it that is a change; 0: none is"});
  }
};

/// Range of an angle and of its rate in the fitted recordings, with a margin.
template <class S> struct WatchedAngleParams {
  S low{}, high{}, slowest{}, fastest{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.low, {"low", unit::angle, any_number(), "smallest angle that was fitted, less a margin"});
    visit(p.high, {"high", unit::angle, any_number(), "largest, with a margin"});
    visit(p.slowest, {"slowest", unit::velocity, any_number(), "smallest rate, less a margin"});
    visit(p.fastest, {"fastest", unit::velocity, any_number(), "largest, with a margin"});
  }
};

/// Reference values of a watch.
template <class S, std::size_t channels_, std::size_t angles_> struct EmgWatchParams {
  bool on = false;                             ///< whether channels are watched
  S forgetting{};                              ///< share of a mean that a step replaces, above 0 and at most 1
  S max_loss{};                                ///< least d above which a channel's change is confirmed [1], above 0
  S residual{};                                ///< share of the torque's variance that is unexplained; 0: not known
  S common_low{}, common_high{};               ///< s outside which no torque holds, above 0
  S period{};                                  ///< from one step to the next [s]
  WatchedChannelParams<S> channel[channels_]{};  ///< each
  WatchedAngleParams<S> angle[angles_]{};        ///< each
};

/// State of a watch. Zeros are a valid initial state.
template <class S, std::size_t channels_> struct EmgWatchState {
  S square[channels_]{}, product[channels_]{}, pattern_square[channels_]{};  ///< <x x>, <x p> and <p p>
  S loss[channels_]{};        ///< d of each channel at the last step
  S common{S(1)};             ///< s at the last step
  S doubt[channels_]{};       ///< sum of the excess of each channel's d [s]
  S below_floor[channels_]{}, idle[channels_]{};  ///< time below either level while the others are active [s]
  S agreed[channels_]{};      ///< activity of a changed channel's pattern since it last missed it [s]
  S widening{S(1)};           ///< error of the torque over its calibrated error
  S strange{};                ///< share of the time outside the fitted movements
  std::uint32_t changed = 0;  ///< channels that changed, a bit each
  bool unlike = false;        ///< whether no torque holds
  bool started = false;       ///< false until the first step
};

namespace detail {

template <class S, std::size_t channels_, std::size_t angles_>
bool is_sound(const EmgWatchParams<S, channels_, angles_>& p, std::size_t channels, std::size_t angles) noexcept {
  if (!p.on) return true;
  bool sound = channels >= 1 && channels <= channels_ && angles <= angles_ && p.forgetting > S(0) &&
               p.forgetting <= S(1) && p.max_loss > S(0) && is_finite(p.max_loss) && p.residual >= S(0) &&
               is_finite(p.residual) && p.period >= S(0) && is_finite(p.period) && p.common_low > S(0) &&
               p.common_low <= p.common_high && is_finite(p.common_high);
  for (std::size_t i = 0; sound && i < channels; ++i) sound = pellucid::is_sound(p.channel[i]);
  for (std::size_t k = 0; sound && k < angles; ++k) sound = pellucid::is_sound(p.angle[k]);
  return sound;
}

/// Insertion sort of the first `count` of `values`: there are few, and it is total.
template <class S, std::size_t most> void sort(S (&values)[most], std::size_t count) noexcept {
  for (std::size_t i = 1; i < count; ++i) {
    const S moved = values[i];
    std::size_t at = i;
    for (; at > 0 && values[at - 1] > moved; --at) values[at] = values[at - 1];
    values[at] = moved;
  }
}

/// Median of the first `count` of `values`, which are sorted; of up to three, the one nearest to 1 as a factor.
template <class S, std::size_t most> S common_factor(S (&values)[most], std::size_t count) noexcept {
  if (count == 0) return S(1);
  if (count <= 3) {
    std::size_t best = 0;
    const auto apart = [](S x) noexcept { return x < S(1) ? S(1) / max(x, S(1e-6)) : x; };
    for (std::size_t i = 1; i < count; ++i)
      if (apart(values[i]) < apart(values[best])) best = i;
    return values[best];
  }
  sort(values, count);
  return count % 2 == 1 ? values[count / 2] : S(0.5) * (values[count / 2 - 1] + values[count / 2]);
}

/// Time for which an envelope has stayed at or below a level, where `elapsed` is the time of a step.
template <class S> S time_below(S seconds, S envelope, S level, S limit, S elapsed) noexcept {
  return limit > S(0) && envelope <= level ? min(seconds + elapsed, limit) : S(0);
}

/// How far a silence is beyond the longest fitted one, which is at most half of the limit: 0 to 1.
template <class S> S silence(S seconds, S limit) noexcept {
  return limit > S(0) ? max(S(0), S(2) * seconds / limit - S(1)) : S(0);
}

/// Lower median of the first `count` of `values`, which are sorted; 0 for a single one, which has nothing beside it.
template <class S, std::size_t most> S lower_median(S (&values)[most], std::size_t count) noexcept {
  if (count < 2) return S(0);
  sort(values, count);
  return values[(count - 1) / 2];
}

}  // namespace detail

/// One step: envelopes, patterns and which channels are silent, a bit each, and whether the movement is a fitted one.
/// The bit of each channel that changed is in `changed`; its envelope, and a silent one's, is then to be common times
/// its pattern.
template <class S, std::size_t channels_, std::size_t angles_>
void step(const EmgWatchParams<S, channels_, angles_>& p, EmgWatchState<S, channels_>& s,
          const S (&envelope)[channels_], const S (&pattern)[channels_], std::size_t channels, std::uint32_t silent,
          bool strange) noexcept {
  if (!s.started) {
    for (std::size_t i = 0; i < channels; ++i) {
      s.square[i] = p.channel[i].square;
      s.product[i] = p.channel[i].product;
      s.pattern_square[i] = p.channel[i].pattern_square;
    }
    s.started = true;
  }
  s.strange = s.strange + p.forgetting * ((strange ? S(1) : S(0)) - s.strange);
  S factor[channels_]{};
  std::size_t heard = 0;
  for (std::size_t i = 0; i < channels; ++i) {
    if ((silent >> i & 1u) != 0) continue;
    const S x = envelope[i], y = pattern[i];
    s.square[i] = s.square[i] + p.forgetting * (x * x - s.square[i]);
    s.product[i] = s.product[i] + p.forgetting * (x * y - s.product[i]);
    s.pattern_square[i] = s.pattern_square[i] + p.forgetting * (y * y - s.pattern_square[i]);
    factor[heard++] = sqrt(max(s.square[i], S(0)) / max(s.pattern_square[i], S(1e-12)));
  }
  s.common = detail::common_factor(factor, heard);
  const S widened = max(S(1), s.common * s.common);
  S excess[channels_]{}, relative[channels_]{};
  heard = 0;
  for (std::size_t i = 0; i < channels; ++i) {
    if ((silent >> i & 1u) != 0) continue;
    const S missed = s.square[i] - S(2) * s.common * s.product[i] + s.common * s.common * s.pattern_square[i];
    excess[i] = missed / widened - p.channel[i].usual;
    relative[heard++] = excess[i] / max(s.pattern_square[i], S(1e-12));
  }
  const S alike = max(S(0), detail::lower_median(relative, heard));
  // While all muscles rest, silence is no evidence against one of them.
  const S effort = min(S(1), s.common), elapsed = p.period * effort * effort;
  std::uint32_t count = 0;
  S lost(0);
  for (std::size_t i = 0; i < channels; ++i) {
    const std::uint32_t bit = 1u << i;
    const WatchedChannelParams<S>& fitted = p.channel[i];
    if ((silent & bit) != 0) {
      s.changed &= ~bit;
      s.loss[i] = s.agreed[i] = s.doubt[i] = s.below_floor[i] = s.idle[i] = S(0);
      lost = lost + fitted.consequence * fitted.usual;
      continue;
    }
    s.loss[i] = fitted.consequence * (excess[i] - alike * s.pattern_square[i]);
    const S limit = max(p.max_loss, fitted.consequence * fitted.margin);
    const S excessive = s.doubt[i] + p.period * (s.loss[i] / limit - S(1));
    // What is no number has changed.
    s.doubt[i] = excessive <= S(confirm_seconds) ? max(S(0), excessive) : S(confirm_seconds);
    s.below_floor[i] = detail::time_below(s.below_floor[i], envelope[i], fitted.floor, fitted.floor_seconds, elapsed);
    s.idle[i] = detail::time_below(s.idle[i], envelope[i], fitted.idle * effort, fitted.idle_seconds, elapsed);
    const S quiet = max(detail::silence(s.below_floor[i], fitted.floor_seconds),
                        detail::silence(s.idle[i], fitted.idle_seconds));
    const S unheard = fitted.consequence * fitted.square;
    s.loss[i] = max(s.loss[i], quiet * unheard);
    if (s.doubt[i] >= S(confirm_seconds) || (quiet >= S(1) && unheard > p.max_loss)) s.changed |= bit;
    if ((s.changed & bit) != 0) {
      const S y = pattern[i];
      const S activity = p.period * y * y / max(fitted.pattern_square, S(1e-12));
      s.agreed[i] = s.loss[i] < limit && quiet <= S(0) ? s.agreed[i] + activity : S(0);
      if (s.agreed[i] >= S(repair_seconds)) {
        s.changed &= ~bit;
        s.doubt[i] = S(0);
      }
    }
    const bool replaced = (s.changed & bit) != 0;
    if (!replaced) s.agreed[i] = S(0);
    lost = lost + (replaced ? fitted.consequence * fitted.usual : max(S(0), s.loss[i]));
    count += replaced;
  }
  s.widening = p.residual > S(0) ? sqrt(S(1) + lost / p.residual) : S(1);
  s.unlike = 2 * count > heard || !(s.common <= p.common_high) || !(s.common >= p.common_low) ||
             !(alike <= S(max_common_miss)) || !(s.strange <= S(max_strange_share));
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
