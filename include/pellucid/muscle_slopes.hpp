// The rigid muscle's force and its derivatives by what identification frees, worked out by hand: one pass, no duals.
//
// tests/core/muscle_test.cpp compares every one with a Dual through muscle.hpp.
#pragma once

#include "activation.hpp"
#include "muscle.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Force in the tendon, and its derivatives.
template <class S> struct MuscleSlopes {
  S force;                 ///< F [N]
  S neural;                ///< by u [N]
  S shape;                 ///< by A [N]
  S optimal_fibre_length;  ///< by l_o [N/m]
  S tendon_slack_length;   ///< by l_ts [N/m]
  S strength;              ///< by s [N]
  S optimal_length_shift;  ///< by lambda [N]
  S max_velocity;          ///< by v_max [N s]
  S force_length_width;    ///< by gamma [N]
  S passive_scale;         ///< by k_p [N]
};

/// Activation and its derivatives by u and A.
template <class S> struct ShapeSlopes {
  S value;   ///< a [1]
  S neural;  ///< da/du [1]
  S shape;   ///< da/dA [1]
};

template <class S> ShapeSlopes<S> shape_slopes(const ActivationCoefficients<S>& c, const S& neural) noexcept {
  const S u = clamp(neural, S(0), S(1));
  const S a = shaped(c, u);
  const S q = u * (u - S(1)), m = S(2) * u - S(1);
  const S by_shape = S(1.0 / 6) * m + c.shape * (S(1.0 / 8) * q + c.shape * (S(4.0 / 720) * m * (S(3) * q - S(1))));
  // d/du of the same, with q' = m, m' = 2.
  const S by_u =
      S(0.5) * m +
      c.shape * (S(1.0 / 12) * (m * m + S(2) * q) +
                 c.shape * (S(1.0 / 12) * q * m +
                            c.shape * (S(1.0 / 720) * (m * m * (S(6) * q - S(1)) + S(2) * q * (S(3) * q - S(1))))));
  return {a, select(c.straight, S(1) + c.shape * by_u, c.shape * (c.inverse_expm1 + a)),
          select(c.straight, q * (S(0.5) + c.shape * by_shape), a * (u - S(1)) + (u - a) * c.inverse_expm1)};
}

/// At neural activation u, musculotendon length [m] and its rate [m/s].
template <class S> MuscleSlopes<S> slopes(const ActivationCoefficients<S>& activation, const MuscleCoefficients<S>& c,
                                          const S& neural, const S& length, const S& velocity) noexcept {
  const ShapeSlopes<S> a = shape_slopes(activation, neural);
  const S along = length - c.slack;
  const mask_t<S> slack = along < c.shortest;
  const Fibre<S> at = fibre_along(c, along, velocity);
  const S relative = at.length * c.inverse_length;
  const S longer = S(1) / (c.shift * (S(1) - a.value) + S(1));
  const S normalised = relative * longer;
  const S fl = force_length(c, normalised);
  const ForceVelocity<S> fv = force_velocity(c, at.velocity);
  const PassiveForce<S> fp = passive_force(c, relative);
  const S active = a.value * fl * fv.value;
  const S n = active + c.passive_scale * fp.value + c.damping * at.velocity;

  const S gain = select(n < S(0), S(0), c.force * at.cosine);
  const S x = normalised - S(1);
  const S by_normalised = S(-2) * x * c.inverse_width * active;  // d n / d l~
  const S by_velocity = a.value * fl * fv.slope + c.damping;     // d n / d v~
  const S by_relative = by_normalised * longer + c.passive_scale * fp.slope;

  // Along the tendon at fixed l_o: dl = cos phi dp, dcos phi = (1 - cos^2 phi) / l dp.
  const S inverse = S(1) / at.length;
  const S tilt = (S(1) - at.cosine * at.cosine) * inverse;
  const S rate = velocity * c.inverse_velocity;  // v~ = rate cos phi
  const S by_along = by_relative * at.cosine * c.inverse_length + by_velocity * rate * tilt;
  const S turned = c.force * select(n < S(0), S(0), n);  // dF / dcos phi
  const S force = turned * at.cosine;
  const S dp = gain * by_along + turned * tilt;
  // With l_o at fixed p: the height grows with it, and what is measured in it shrinks.
  const S widen = c.height_squared * inverse * c.inverse_length;  // dl / dl_o
  const S dcos = -(at.cosine * inverse * widen);
  const S dlo = gain * (by_relative * (widen - relative) * c.inverse_length +
                        by_velocity * (rate * dcos - at.velocity * c.inverse_length)) +
                turned * dcos;

  MuscleSlopes<S> d;
  d.force = force;
  const S by_activation = gain * (fl * fv.value + by_normalised * normalised * c.shift * longer);
  d.neural = by_activation * a.neural;
  d.shape = by_activation * a.shape;
  d.optimal_fibre_length = dlo + select(slack, dp * (c.shortest * c.inverse_length), S(0));
  d.tendon_slack_length = select(slack, S(0), -dp);
  d.strength = select(n < S(0), S(0), c.max_isometric_force * at.cosine) * n;
  d.optimal_length_shift = -(gain * by_normalised * normalised * (S(1) - a.value) * longer);
  d.max_velocity = -(gain * by_velocity * at.velocity * c.inverse_max_velocity);
  d.force_length_width = gain * active * (x * x) * (c.inverse_width * c.inverse_width);
  d.passive_scale = gain * fp.value;
  return d;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
