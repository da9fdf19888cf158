// How stiff a muscle with its tendon is along its line of pull: at once, and by Hill's curves.
//
//   k = k_f cos^2 phi + N sin^2 phi / l,   N the fibre's force, l its length
//   short range: k_f = gamma N_a / l_o, N_a the active part, and the tendon in series: 1 / (1 / k + 1 / k_t)
//   Hill:        k_f = dN/dl at held activation and rate of the whole, which is the slope of the model's own force
//
// The first is what attached cross-bridges give before any detaches (Rack and Westbury 1974), with the one number for
// all muscles of Cui et al. 2008. The second is what the force becomes once the muscle has settled at the new length.
#pragma once

#include "elastic_muscle.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct ShortRangeParams {
  S gamma{S(23.4)}, tendon_strain{S(0.033)};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.gamma, {"gamma", unit::one, at_least(0), "short-range stiffness of a fibre, in its force over l_o"});
    visit(p.tendon_strain, {"tendon_strain", unit::one, above(0), "e_0, of the tendon under F_0"});
  }
};

/// Coefficients computed once from ShortRangeParams.
template <class S> struct ShortRangeCoefficients {
  S gamma{};      ///< [1]
  S toe_rate{};   ///< rate of the tendon's toe region, 3 / toe strain [1]
  S stiffness{};  ///< stiffness of the tendon beyond the toe, in F_0 per strain [1]
};

template <class S> ShortRangeCoefficients<S> coefficients(const ShortRangeParams<S>& p) noexcept {
  const S toe = S(detail::toe_share) * p.tendon_strain;
  return {p.gamma, S(3) / toe, S(1.0 - detail::toe_force) / (p.tendon_strain - toe)};
}

/// Stiffness of one muscle with its tendon [N/m].
template <class S> struct MuscleStiffness {
  S short_range{};  ///< at once, the tendon in series; 0 without force
  S slope{};        ///< slope of the force by length, the tendon rigid; may be negative where the muscle is long
};

/// At an activation [1], a fibre, and the rate of the musculotendon length [m/s]; 0 where the fibre does not pull.
template <class S> MuscleStiffness<S> muscle_stiffness(const ShortRangeCoefficients<S>& c,
                                                       const MuscleCoefficients<S>& m, const S& activation,
                                                       const Fibre<S>& at, const S& rate) noexcept {
  const S relative = at.length * m.inverse_length;
  const S shift = S(1) / (m.shift * (S(1) - activation) + S(1));
  const S normalised = relative * shift;
  const S fl = activation * force_length(m, normalised);
  const ForceVelocity<S> fv = force_velocity(m, at.velocity);
  const PassiveForce<S> fp = passive_force(m, relative);
  const S active = fl * fv.value;
  const S n = active + m.passive_scale * fp.value + m.damping * at.velocity;
  const S inverse = S(1) / at.length;
  const S along = at.cosine * at.cosine, across = S(1) - along;
  const S turned = n * across * inverse;

  const S fibre = c.gamma * select(active < n, active, n) * m.inverse_length;
  const S muscle = fibre * along + turned;
  const S pull = n * at.cosine;
  const S scale = S(detail::toe_force * detail::toe_inverse_expm1);
  const S tendon = select(pull < S(detail::toe_force), (pull + scale) * c.toe_rate, c.stiffness);
  // 1 / (1 / k + l_ts / k_t): without a tendon the muscle's own.
  const S series = muscle * tendon / (tendon + muscle * m.slack);

  const S by_length =
      (S(-2) * (normalised - S(1)) * m.inverse_width * shift * active + m.passive_scale * fp.slope) * m.inverse_length;
  // A fibre that turns as it lengthens takes another share of the rate.
  const S by_turning = (fl * fv.slope + m.damping) * rate * m.inverse_velocity * across * inverse;
  // Where the tendon is slack the fibre's length is held, and with it the force.
  const mask_t<S> pulls = both(n > S(0), at.length * at.cosine > m.shortest * S(1.000001));
  return {select(n > S(0), m.force * series, S(0)),
          select(pulls, m.force * (by_length * along + by_turning * at.cosine + turned), S(0))};
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
