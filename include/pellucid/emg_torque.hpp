// From raw EMG to a joint torque, causally: band-pass, rectify, low-pass, then a map that is linear in the envelopes.
//
//   tau = sum_p q^p (w_0p + sum_m w_mp e_m),   q the joint's angle, e_m the envelope of muscle m
//
// Samples come as they are recorded (some at every control period); the torque is asked for once a period.
#pragma once

#include "biquad.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

constexpr std::size_t max_muscles = 4;
constexpr std::size_t max_angle_powers = 4;

template <class S> struct EmgTorqueParams {
  BiquadCoefficients<S, 4> band{};                ///< before rectification
  BiquadCoefficients<S, 2> envelope{};            ///< after it
  std::size_t muscles = 0;                        ///< how many, 1 to max_muscles
  std::size_t powers = 1;                         ///< highest power of the angle, 1 to max_angle_powers
  S weight[max_muscles + 1][max_angle_powers]{};  ///< w, row 0 without EMG [N m], then by muscle [N m per unit]
  S floor[max_muscles]{};                         ///< an envelope below it is no muscle's [V], >= 0
  S ceiling[max_muscles]{};                       ///< nor one above it [V], > floor
  std::uint32_t patience = 0;                     ///< samples in a row outside before EMG is not valid
  S torque_limit{};                               ///< limit of |tau| [N m], > 0
};

/// Validity of EmgTorqueParams, computed once.
template <class S> struct EmgTorqueCoefficients {
  EmgTorqueParams<S> params{};  ///< as they are
  bool valid = false;           ///< whether they make sense
};

template <class S> EmgTorqueCoefficients<S> coefficients(const EmgTorqueParams<S>& p) noexcept {
  EmgTorqueCoefficients<S> c;
  c.params = p;
  c.valid = p.muscles >= 1 && p.muscles <= max_muscles && p.powers >= 1 && p.powers <= max_angle_powers &&
            p.torque_limit > S(0) && is_finite(p.torque_limit);
  for (std::size_t m = 0; m < max_muscles && m < p.muscles; ++m)
    c.valid = c.valid && p.floor[m] >= S(0) && p.ceiling[m] > p.floor[m];
  return c;
}

/// State of the chain.
template <class S> struct EmgTorqueState {
  BiquadState<S, 4> band[max_muscles]{};      ///< one a muscle
  BiquadState<S, 2> envelope[max_muscles]{};  ///< one a muscle
  S level[max_muscles]{};                     ///< the envelopes [V]
  std::uint32_t outside[max_muscles]{};       ///< samples in a row outside floor and ceiling
};

/// One raw sample of every muscle [V].
template <class S>
void listen(const EmgTorqueCoefficients<S>& c, EmgTorqueState<S>& s, const S (&raw)[max_muscles]) noexcept {
  for (std::size_t m = 0; m < c.params.muscles && m < max_muscles; ++m) {
    const S level = step(c.params.envelope, s.envelope[m], abs(step(c.params.band, s.band[m], raw[m])));
    s.level[m] = is_finite(level) ? level : S(0);
    const bool inside = level >= c.params.floor[m] && level <= c.params.ceiling[m];
    s.outside[m] = inside ? 0 : s.outside[m] + (s.outside[m] < 0xffffffffu ? 1 : 0);
  }
}

/// Whether what the electrodes say can be a muscle.
template <class S> bool is_heard(const EmgTorqueCoefficients<S>& c, const EmgTorqueState<S>& s) noexcept {
  bool heard = c.valid;
  for (std::size_t m = 0; m < c.params.muscles && m < max_muscles; ++m)
    heard = heard && s.outside[m] <= c.params.patience;
  return heard;
}

/// The torque at this angle [N m], finite and within its limit; 0 at an angle that is no number.
template <class S> S emg_torque(const EmgTorqueCoefficients<S>& c, const EmgTorqueState<S>& s, S position) noexcept {
  if (!c.valid || !is_finite(position)) return S(0);
  const EmgTorqueParams<S>& p = c.params;
  S torque = S(0);
  for (std::size_t k = p.powers; k-- > 0;) {
    S coefficient = p.weight[0][k];
    for (std::size_t m = 0; m < p.muscles; ++m) coefficient = coefficient + p.weight[m + 1][k] * s.level[m];
    torque = torque * position + coefficient;
  }
  return is_finite(torque) ? clamp(torque, -p.torque_limit, p.torque_limit) : S(0);
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
