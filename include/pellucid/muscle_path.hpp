// How long a muscle with its tendon is at a posture, and how that changes: a cubic spline over one or two angles.
//
//   l = sum_ij c_ij B(u_1 - i) B(u_2 - j),   r_k = -dl/dq_k,   u the angle in steps of an even grid
//
// Length, slope and bend come from the same coefficients, so that muscle work and joint work agree and a joint's
// stiffness is the derivative of its torque. Beyond the grid length goes on straight.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

constexpr std::size_t path_axes = 2;
constexpr std::uint32_t most_path_cells = 4096;

/// One angle of a path: where the grid lies, and which of the angles given it is.
template <class S> struct PathAxis {
  std::uint32_t angle = 0;  ///< its index; what is no angle given stays at `offset`
  S sign{1};                ///< -1 where the angle given grows the other way
  S offset{};               ///< added to it [rad]
  S start{};                ///< where the grid begins [rad]
  S step{1};                ///< distance of knots [rad], > 0
  std::uint32_t cells = 1;  ///< between knots, >= 1
};

template <class S> struct MusclePathParams {
  PathAxis<S> axis[path_axes]{};     ///< the first `axes` of them
  std::uint32_t axes = 1;            ///< 1 or 2
  const S* coefficient = nullptr;    ///< cells + 3 of each axis, the last axis fastest [m]; outlives what is made of it
};

/// Coefficients computed once from PathAxis.
template <class S> struct PathAxisCoefficients {
  PathAxis<S> axis{};  ///< as it is
  S end{};             ///< where the grid ends [rad]
  S inverse_step{};    ///< [1/rad]
};

/// Coefficients computed once from MusclePathParams.
template <class S> struct MusclePathCoefficients {
  PathAxisCoefficients<S> axis[path_axes]{};  ///< the first `axes` of them
  std::uint32_t axes = 1;                     ///< 1 or 2
  const S* coefficient = nullptr;             ///< [m]
  bool valid = false;                         ///< whether the parameters make sense
};

template <class S> MusclePathCoefficients<S> coefficients(const MusclePathParams<S>& p) noexcept {
  MusclePathCoefficients<S> c;
  c.axes = p.axes;
  c.coefficient = p.coefficient;
  c.valid = p.coefficient != nullptr && p.axes >= 1 && p.axes <= path_axes;
  for (std::size_t k = 0; k < path_axes && k < p.axes; ++k) {
    const PathAxis<S>& a = p.axis[k];
    c.valid = c.valid && a.step > S(0) && is_finite(a.step) && is_finite(a.start) && is_finite(a.offset) &&
              is_finite(a.sign) && a.cells >= 1 && a.cells <= most_path_cells;
    c.axis[k] = {a, a.start + S(static_cast<value_t<S>>(a.cells)) * a.step, S(1) / a.step};
  }
  return c;
}

/// A muscle at a posture, by the angles as they were given.
template <class S> struct MusclePath {
  S length{};                        ///< length of muscle and tendon [m]
  S slope[path_axes]{};              ///< dl/dq, which is the moment arm with its sign turned [m]
  S bend[path_axes][path_axes]{};    ///< d2l/dq2 [m/rad]
};

namespace detail {

/// The four splines that are not 0 in a cell, and their derivatives.
template <class S> struct CubicWeights {
  S value[4]{}, slope[4]{}, bend[4]{};
  std::size_t first = 0;
  S beyond{};          // how far the angle is from the grid; NaN of NaN
  bool within = true;  // whether it is on it
};

template <class S> CubicWeights<S> cubic_weights(const PathAxisCoefficients<S>& c, const S& q) noexcept {
  CubicWeights<S> w;
  const S x = is_finite(q) ? clamp(q, c.axis.start, c.end) : c.axis.start;
  w.beyond = q - x;
  w.within = w.beyond == S(0);
  const S u = max((x - c.axis.start) * c.inverse_step, S(0));
  const std::size_t last = c.axis.cells - 1;
  w.first = u < S(static_cast<value_t<S>>(last)) ? static_cast<std::size_t>(value_of(u)) : last;
  const S t = u - S(static_cast<value_t<S>>(w.first)), r = S(1) - t;
  const S sixth = S(1.0 / 6.0), one = c.inverse_step, two = c.inverse_step * c.inverse_step;
  w.value[0] = sixth * (r * r * r);
  w.value[1] = sixth * (t * t * (S(3) * t - S(6)) + S(4));
  w.value[2] = sixth * (t * (t * (S(3) - S(3) * t) + S(3)) + S(1));
  w.value[3] = sixth * (t * t * t);
  w.slope[0] = one * (S(-0.5) * (r * r));
  w.slope[1] = one * (t * (S(1.5) * t - S(2)));
  w.slope[2] = one * (t * (S(1) - S(1.5) * t) + S(0.5));
  w.slope[3] = one * (S(0.5) * (t * t));
  w.bend[0] = two * r;
  w.bend[1] = two * (S(3) * t - S(2));
  w.bend[2] = two * (S(1) - S(3) * t);
  w.bend[3] = two * t;
  return w;
}

}  // namespace detail

/// A path at `angles` angles [rad]. Angles that are not finite give a length that is not.
template <class S>
MusclePath<S> muscle_path(const MusclePathCoefficients<S>& c, const S* angle, std::size_t angles) noexcept {
  MusclePath<S> path;
  if (!c.valid) return path;
  const auto of = [&c, angle, angles](std::size_t k) {
    const PathAxis<S>& a = c.axis[k].axis;
    return detail::cubic_weights(c.axis[k], a.angle < angles ? a.offset + a.sign * angle[a.angle] : a.offset);
  };
  const detail::CubicWeights<S> w = of(0);
  if (c.axes == 1) {
    S value(0), slope(0), bend(0);
    for (std::size_t i = 0; i < 4; ++i) {
      const S k = c.coefficient[w.first + i];
      value = value + w.value[i] * k;
      slope = slope + w.slope[i] * k;
      bend = bend + w.bend[i] * k;
    }
    path.length = value + w.beyond * slope;
    path.slope[0] = c.axis[0].axis.sign * slope;
    path.bend[0][0] = w.within ? bend : S(0);
    return path;
  }
  const detail::CubicWeights<S> v = of(1);
  const std::size_t row = c.axis[1].axis.cells + 3;
  S value(0), first(0), second(0), first_bend(0), mixed(0), second_bend(0), bend_across(0), slope_bent(0);
  for (std::size_t i = 0; i < 4; ++i) {
    const S* k = c.coefficient + (w.first + i) * row + v.first;
    S along(0), across(0), bent(0);
    for (std::size_t j = 0; j < 4; ++j) {
      along = along + v.value[j] * k[j];
      across = across + v.slope[j] * k[j];
      bent = bent + v.bend[j] * k[j];
    }
    value = value + w.value[i] * along;
    first = first + w.slope[i] * along;
    first_bend = first_bend + w.bend[i] * along;
    second = second + w.value[i] * across;
    mixed = mixed + w.slope[i] * across;
    second_bend = second_bend + w.value[i] * bent;
    bend_across = bend_across + w.bend[i] * across;
    slope_bent = slope_bent + w.slope[i] * bent;
  }
  path.length = value + w.beyond * first + v.beyond * second;
  // Where the other angle is beyond its grid, the length that goes on straight there bends with this one.
  const S one = c.axis[0].axis.sign, two = c.axis[1].axis.sign;
  path.slope[0] = one * (w.within ? first + v.beyond * mixed : first);
  path.slope[1] = two * (v.within ? second + w.beyond * mixed : second);
  path.bend[0][0] = w.within ? first_bend + v.beyond * bend_across : S(0);
  path.bend[1][1] = v.within ? second_bend + w.beyond * slope_bent : S(0);
  path.bend[0][1] = path.bend[1][0] = w.within || v.within ? one * two * mixed : S(0);
  return path;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
