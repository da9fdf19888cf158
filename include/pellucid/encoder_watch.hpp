// What an encoder's raw readings say by themselves: limits that no estimator can outrun, for none is asked.
//
// Speed is the last difference over its own time, acceleration the change of that; an encoder that is off by one count
// is allowed for. A joint that was fast a moment ago and whose reading then stands still to the bit has a frozen
// encoder: no stop is that sudden.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct EncoderWatchParams {
  S speed_limit = S(std::numeric_limits<S>::infinity()), acceleration_limit = speed_limit, range_min = -speed_limit,
    range_max = speed_limit, resolution{}, freeze_speed = speed_limit;
  std::uint32_t freeze_samples = 20;

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.speed_limit, {"raw_speed_limit", unit::velocity, above(0).or_infinite(),
                          "limit of the encoder's raw differences; infinite: none"});
    visit(p.acceleration_limit, {"raw_acceleration_limit", unit::acceleration, above(0).or_infinite(),
                                 "limit of their changes; beyond, the encoder has jumped"});
    visit(p.range_min, {"range_min", unit::coordinate, any_number().or_infinite(),
                        "position below which a fault is detected"});
    visit(p.range_max, {"range_max", unit::coordinate, any_number().or_infinite(),
                        "position above which a fault is detected"});
    visit(p.resolution, {"encoder_resolution", unit::coordinate, at_least(0), "error of one reading"});
    visit(p.freeze_speed, {"freeze_speed", unit::velocity, above(0).or_infinite(),
                           "faster than this, nothing comes to rest within two samples"});
    visit(p.freeze_samples, {"freeze_samples", unit::one, at_least(1),
                             "readings equal to the bit, after a motion that fast, that are a frozen encoder"});
  }
};

/// Coefficients computed once from EncoderWatchParams and the period.
template <class S> struct EncoderWatchCoefficients {
  EncoderWatchParams<S> params{};  ///< as they are
  S period{};                      ///< [s]
  S inverse_period{};              ///< [1/s]
  std::uint32_t micros = 0;        ///< the period [us]
  bool valid = false;              ///< whether the parameters make sense
};

template <class S>
EncoderWatchCoefficients<S> coefficients(const EncoderWatchParams<S>& p, const S& period) noexcept {
  EncoderWatchCoefficients<S> c;
  c.params = p;
  c.period = period;
  c.inverse_period = S(1) / period;
  c.valid = is_sound(p) && p.range_min < p.range_max && period > S(0) && period < S(1);
  c.micros = c.valid ? static_cast<std::uint32_t>(period * S(1e6) + S(0.5)) : 0;
  return c;
}

template <class S> struct EncoderWatchState {
  S position{};                ///< the last reading [rad]
  S velocity{};                ///< over the last two [rad/s]
  S before{};                  ///< smoothed over two, when the reading last changed [rad/s]
  std::uint32_t time = 0;      ///< time of the last reading, its low half [us]
  std::uint32_t sequence = 0;  ///< sequence number of the last reading
  std::uint32_t equal = 0;     ///< readings in a row that did not change
  std::uint32_t heard = 0;     ///< readings since the start, up to 3
};

/// Speed that a joint at rest may seem to have by its last two readings [rad/s].
template <class S> S speed_at_rest(const EncoderWatchCoefficients<S>& c) noexcept {
  return S(2) * c.params.resolution * c.inverse_period;
}

/// Return the fault of a reading relative to the last one, if any, and store it. A repeated reading changes nothing.
template <class S>
SafetyFault step(const EncoderWatchCoefficients<S>& c, EncoderWatchState<S>& s, const Sample<S>& reading) noexcept {
  if (!is_heard(reading)) return SafetyFault::none;  // the front sees to that
  const EncoderWatchParams<S>& p = c.params;
  const S at = reading.value;
  if (s.heard != 0 && reading.sequence == s.sequence) return SafetyFault::none;
  // The front has seen to clocks; of a gap within its rules 32 bits are all.
  const std::uint32_t gap = static_cast<std::uint32_t>(reading.time) - s.time;
  const bool steady = gap == c.micros || gap == 0 || gap > 1000000u;
  const S passed = steady ? c.period : S(1e-6) * static_cast<S>(static_cast<std::int32_t>(gap));
  const S rate = steady ? c.inverse_period : S(1) / passed;
  const S moved = at - s.position;
  const S went = s.heard != 0 ? moved : S(0), by_time = went * rate, by_period = went * c.inverse_period;
  // Stamps may jitter about regular samples, or with them: the joint's inertia says which.
  const bool jitters = !steady && gap > c.micros / 2 && gap < c.micros + c.micros / 2;
  const S velocity = jitters && abs(by_period - s.velocity) < abs(by_time - s.velocity) ? by_period : by_time;
  const S change = velocity - s.velocity;
  const S blur = S(2) * p.resolution * rate;
  SafetyFault found = SafetyFault::none;
  if (s.heard > 2 && !(abs(change) <= p.acceleration_limit * passed + S(2) * blur)) found = SafetyFault::jump;
  else if (!(abs(velocity) <= p.speed_limit + blur)) found = SafetyFault::overspeed;
  else if (!(at >= p.range_min && at <= p.range_max)) found = SafetyFault::range;

  if (moved == S(0)) {
    if (s.equal == 0) s.before = S(0.5) * (s.velocity + s.before);
    if (s.equal < 0xffffffffu) ++s.equal;
    if (found == SafetyFault::none && s.equal >= p.freeze_samples && abs(s.before) > p.freeze_speed)
      found = SafetyFault::frozen;
  } else {
    s.before = s.velocity;
    s.equal = 0;
  }
  s.position = at;
  s.velocity = velocity;
  s.time = static_cast<std::uint32_t>(reading.time);
  s.sequence = reading.sequence;
  if (s.heard < 3) ++s.heard;
  return found;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
