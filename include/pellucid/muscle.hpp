// One muscle of Hill's type on a rigid tendon: force from activation, musculotendon length and velocity.
//
//   F = s F_0 max(0, a f_l(l~) f_v(v~) + k_p f_p(l / l_o) + beta v~) cos phi
//   l~ = l / (l_o (lambda (1 - a) + 1)),   v~ = (dl/dt) / (v_max l_o), lengthening positive
//
// The fibre keeps the height l_o sin phi_o, so l cos phi = l_mt - l_ts alone fixes length and angle. The tendon cannot
// push. f_l after Thelen, with the optimal length of Lloyd and Besier, longer where the muscle is less active.
#pragma once

#include "fields.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct MuscleParams {
  S optimal_fibre_length{}, tendon_slack_length{}, strength{S(1)}, optimal_length_shift{S(0.15)}, max_velocity{S(10)},
      force_length_width{S(0.45)}, passive_scale{S(1)}, max_isometric_force{}, pennation{}, damping{},
      curvature{S(0.25)}, eccentric_force{S(1.5)}, passive_strain{S(0.6)}, passive_shape{S(4)};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.optimal_fibre_length, {"optimal_fibre_length", unit::length, above(0),
                                   "l_o, where the fully active fibre is strongest"});
    visit(p.tendon_slack_length, {"tendon_slack_length", unit::length, at_least(0), "l_ts"});
    visit(p.strength, {"strength", unit::one, at_least(0),
                       "s, strength of this person relative to the anatomical value"});
    visit(p.optimal_length_shift, {"optimal_length_shift", unit::one, any_number(),
                                   "lambda, how much longer l_o is at no activation"});
    visit(p.max_velocity, {"max_velocity", unit::rate, above(0), "v_max, of shortening without load, in l_o"});
    visit(p.force_length_width, {"force_length_width", unit::one, above(0), "gamma of f_l"});
    visit(p.passive_scale, {"passive_scale", unit::one, at_least(0), "k_p"});
    visit(p.max_isometric_force, {"max_isometric_force", unit::force, at_least(0), "F_0"});
    visit(p.pennation, {"pennation", unit::angle, at_least(0), "phi_o, the fibre's angle to the tendon at l_o"});
    visit(p.damping, {"damping", unit::one, at_least(0), "beta, of the fibre"});
    visit(p.curvature, {"curvature", unit::one, above(0), "A_f of f_v; small is more curved"});
    visit(p.eccentric_force, {"eccentric_force", unit::one, above(1), "g, what f_v rises to while lengthening"});
    visit(p.passive_strain, {"passive_strain", unit::one, above(0), "e_0, where passive force reaches F_0"});
    visit(p.passive_shape, {"passive_shape", unit::one, above(0), "k of f_p"});
  }
};

/// Coefficients computed once from MuscleParams.
template <class S> struct MuscleCoefficients {
  S force{};                  ///< s F_0 [N]
  S max_isometric_force{};    ///< F_0 [N]
  S optimal_length{};         ///< l_o [m]
  S inverse_length{};         ///< 1 / l_o [1/m]
  S slack{};                  ///< l_ts [m]
  S shortest{};               ///< what l cos phi is at least: the tendon is slack before [m]
  S height_squared{};         ///< (l_o sin phi_o)^2 [m^2]
  S shift{};                  ///< lambda [1]
  S inverse_max_velocity{};   ///< 1 / v_max [s]
  S inverse_velocity{};       ///< 1 / (v_max l_o) [s/m]
  S inverse_width{};          ///< 1 / gamma [1]
  S passive_scale{};          ///< k_p [1]
  S damping{};                ///< beta [1]
  S inverse_curvature{};      ///< 1 / A_f [1]
  S eccentric_force{};        ///< g [1]
  S eccentric_velocity{};     ///< c = A_f (g - 1) / (A_f + 1), which makes f_v smooth at 0 [1]
  S passive_rate{};           ///< k / e_0 [1]
  S passive_inverse_expm1{};  ///< 1 / (e^k - 1) [1]
  S passive_end{};            ///< e_0, from where f_p goes on straight [1]
};

namespace detail {
/// A fibre is not taken for shorter along the tendon than this share of l_o; the tendon is then slack.
constexpr double shortest_fibre = 0.1;
}  // namespace detail

template <class S> MuscleCoefficients<S> coefficients(const MuscleParams<S>& p) noexcept {
  MuscleCoefficients<S> c;
  const S height = p.optimal_fibre_length * sin(p.pennation);
  c.force = p.strength * p.max_isometric_force;
  c.max_isometric_force = p.max_isometric_force;
  c.optimal_length = p.optimal_fibre_length;
  c.inverse_length = S(1) / p.optimal_fibre_length;
  c.slack = p.tendon_slack_length;
  c.shortest = S(detail::shortest_fibre) * p.optimal_fibre_length;
  c.height_squared = height * height;
  c.shift = p.optimal_length_shift;
  c.inverse_max_velocity = S(1) / p.max_velocity;
  c.inverse_velocity = c.inverse_max_velocity * c.inverse_length;
  c.inverse_width = S(1) / p.force_length_width;
  c.passive_scale = p.passive_scale;
  c.damping = p.damping;
  c.inverse_curvature = S(1) / p.curvature;
  c.eccentric_force = p.eccentric_force;
  c.eccentric_velocity = p.curvature * (p.eccentric_force - S(1)) / (p.curvature + S(1));
  c.passive_rate = p.passive_shape / p.passive_strain;
  c.passive_inverse_expm1 = S(1) / expm1(p.passive_shape);
  c.passive_end = p.passive_strain;
  return c;
}

/// Length, pennation and velocity of the fibre.
template <class S> struct Fibre {
  S length;    ///< l [m]
  S cosine;    ///< cos phi [1]
  S velocity;  ///< v~, in v_max l_o, lengthening positive [1]
};

/// The fibre of a length along the tendon, l cos phi, never below that of a slack tendon.
template <class S> Fibre<S> fibre_along(const MuscleCoefficients<S>& c, const S& along, const S& velocity) noexcept {
  const S p = select(along < c.shortest, c.shortest, along);
  const S length = sqrt(p * p + c.height_squared);
  const S cosine = p / length;
  return {length, cosine, velocity * cosine * c.inverse_velocity};
}

/// The fibre on a rigid tendon, of the musculotendon length [m] and its rate [m/s].
template <class S, class R>
Fibre<S> fibre(const MuscleCoefficients<S>& c, const R& length, const R& velocity) noexcept {
  return fibre_along(c, length - c.slack, S(velocity));
}

/// Active force over length, f_l = exp(-(l~ - 1)^2 / gamma) [1].
template <class S> S force_length(const MuscleCoefficients<S>& c, const S& normalised) noexcept {
  const S x = normalised - S(1);
  return exp(-(x * x) * c.inverse_width);
}

/// Force over velocity as a quotient, so that its slope costs nothing more.
template <class S> struct ForceVelocity {
  S value;  ///< f_v >= 0 [1]
  S slope;  ///< d f_v / d v~; the same from both sides at 0 [1]
};

/// Hill's hyperbola while shortening, to 0 at v~ = -1, and its mirror towards g while lengthening.
template <class S> ForceVelocity<S> force_velocity(const MuscleCoefficients<S>& c, const S& velocity) noexcept {
  const mask_t<S> lengthens = velocity > S(0);
  const S v = select(velocity < S(-1), S(-1), velocity);
  const S top = select(lengthens, c.eccentric_force * v + c.eccentric_velocity, S(1) + v);
  const S bottom = select(lengthens, v + c.eccentric_velocity, S(1) - v * c.inverse_curvature);
  const S inverse = S(1) / bottom;
  const S rise = select(lengthens, c.eccentric_velocity * (c.eccentric_force - S(1)), S(1) + c.inverse_curvature);
  return {top * inverse, select(velocity < S(-1), S(0), rise * inverse * inverse)};
}

/// Passive force of the fibre over length.
template <class S> struct PassiveForce {
  S value;  ///< f_p >= 0 [1]
  S slope;  ///< d f_p / d(l / l_o) [1]
};

/// (e^{k (l/l_o - 1) / e_0} - 1) / (e^k - 1) above l_o, straight on above l_o (1 + e_0), 0 below.
template <class S> PassiveForce<S> passive_force(const MuscleCoefficients<S>& c, const S& normalised) noexcept {
  const S strain = normalised - S(1);
  if (!any(strain > S(0))) return {select(strain <= S(0), S(0), strain), S(0)};
  const S bent = select(strain < S(0), S(0), select(strain > c.passive_end, c.passive_end, strain));
  const S rise = expm1(c.passive_rate * bent);
  const S slope = select(strain > S(0), (rise + S(1)) * c.passive_rate * c.passive_inverse_expm1, S(0));
  return {rise * c.passive_inverse_expm1 + slope * select(strain > c.passive_end, strain - c.passive_end, S(0)), slope};
}

/// Force of the fibre relative to s F_0, before it is turned into the tendon; may be negative through damping [1].
template <class S> S fibre_force(const MuscleCoefficients<S>& c, const S& activation, const Fibre<S>& at) noexcept {
  const S relative = at.length * c.inverse_length;
  const S normalised = relative * (S(1) / (c.shift * (S(1) - activation) + S(1)));
  return activation * force_length(c, normalised) * force_velocity(c, at.velocity).value +
         c.passive_scale * passive_force(c, relative).value + c.damping * at.velocity;
}

/// Force in the tendon [N]: never negative.
template <class S> S tendon_force(const MuscleCoefficients<S>& c, const S& activation, const Fibre<S>& at) noexcept {
  const S n = fibre_force(c, activation, at);
  return c.force * select(n < S(0), S(0), n) * at.cosine;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
