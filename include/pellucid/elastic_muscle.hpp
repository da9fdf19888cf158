// A muscle on an elastic tendon: the fibre finds the length at which both pull alike.
//
// Tendon after Thelen: an exponential toe up to a third of F_0, then straight on, strain e_0 at F_0. One period is one
// implicit Euler step of the fibre, so that a slack or stiff tendon needs no small steps: Newton's method between bounds
// that it halves where it would leave them, a bounded number of times.
#pragma once

#include "muscle.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct ElasticMuscleParams {
  MuscleParams<S> muscle{};   ///< fibre, and the tendon's slack length; its damping should be above 0
  S tendon_strain{S(0.033)};  ///< e_0, of the tendon under F_0 [1], > 0
  S period{};                 ///< sampling period [s], > 0
};

/// Coefficients computed once from ElasticMuscleParams.
template <class S> struct ElasticMuscleCoefficients {
  MuscleCoefficients<S> muscle{};  ///< coefficients of the fibre
  S inverse_period{};              ///< [1/s]; 0: at rest
  S inverse_slack{};               ///< 1 / l_ts [1/m]
  S toe_rate{};                    ///< 3 / toe strain [1]
  S toe_strain{};                  ///< where the toe ends [1]
  S stiffness{};                   ///< beyond the toe, in F_0 per strain [1]
};

/// State of an elastic muscle.
template <class S> struct ElasticMuscleState {
  S along{};   ///< l cos phi [m]
  S length{};  ///< l [m]
};

namespace detail {
constexpr double toe_force = 0.33;                         // of F_0
constexpr double toe_inverse_expm1 = 0.05239569649125595;  // 1 / (e^3 - 1)
constexpr double toe_share = 0.6086155378758799;           // 99 e^3 / (166 e^3 - 67), of e_0
constexpr int elastic_iterations = 60;                     // enough to halve a metre to nothing
}  // namespace detail

template <class S> ElasticMuscleCoefficients<S> coefficients(const ElasticMuscleParams<S>& p) noexcept {
  ElasticMuscleCoefficients<S> c;
  c.muscle = coefficients(p.muscle);
  c.inverse_period = S(1) / p.period;
  c.inverse_slack = S(1) / p.muscle.tendon_slack_length;
  c.toe_strain = S(detail::toe_share) * p.tendon_strain;
  c.toe_rate = S(3) / c.toe_strain;
  c.stiffness = S(1.0 - detail::toe_force) / (p.tendon_strain - c.toe_strain);
  return c;
}

/// Force of a tendon in F_0 and its slope by strain.
template <class S> struct TendonPull {
  S value;  ///< >= 0 [1]
  S slope;  ///< per strain [1]
};

/// 0 while slack, the toe, straight on.
template <class S> TendonPull<S> tendon_pull(const ElasticMuscleCoefficients<S>& c, const S& length) noexcept {
  const S strain = length * c.inverse_slack - S(1);
  const S toe = select(strain < S(0), S(0), select(strain > c.toe_strain, c.toe_strain, strain));
  const S rise = expm1(c.toe_rate * toe);
  const S scale = S(detail::toe_force * detail::toe_inverse_expm1);
  const S past = strain - c.toe_strain;
  const mask_t<S> straight = past > S(0);
  return {scale * rise + select(straight, c.stiffness * past, S(0)),
          select(strain > S(0), select(straight, c.stiffness, scale * (rise + S(1)) * c.toe_rate), S(0))};
}

/// Fibre length and force in the tendon one period on, or at rest where the inverse period is 0.
template <class S> S step(const ElasticMuscleCoefficients<S>& c, ElasticMuscleState<S>& state, const S& activation,
                          const S& length) noexcept {
  const MuscleCoefficients<S>& m = c.muscle;
  const S rate = c.inverse_period * m.inverse_velocity;
  const S shift = S(1) / (m.shift * (S(1) - activation) + S(1));
  S low = m.shortest;
  S high = select(length > m.shortest, length, m.shortest);
  S p = clamp(state.along, low, high);
  S pull(0);
  const S enough = m.optimal_length * S(std::numeric_limits<value_t<S>>::epsilon() * value_t<S>(4));
  bool last = false;
  for (int i = 0; i < detail::elastic_iterations; ++i) {
    const S fibre_length = sqrt(p * p + m.height_squared);
    const S inverse = S(1) / fibre_length;
    const S cosine = p * inverse;
    const S relative = fibre_length * m.inverse_length;
    const S normalised = relative * shift;
    const S velocity = (fibre_length - state.length) * rate;
    const S fl = activation * force_length(m, normalised);
    const ForceVelocity<S> fv = force_velocity(m, velocity);
    const PassiveForce<S> fp = passive_force(m, relative);
    const TendonPull<S> tendon = tendon_pull(c, length - p);
    const S n = fl * fv.value + m.passive_scale * fp.value + m.damping * velocity;
    const S by_length =
        (S(-2) * (normalised - S(1)) * m.inverse_width * shift * fl * fv.value + m.passive_scale * fp.slope) *
            m.inverse_length +
        (fl * fv.slope + m.damping) * rate;
    const S excess = n * cosine - tendon.value;
    const S slope =
        by_length * cosine * cosine + n * (S(1) - cosine * cosine) * inverse + tendon.slope * c.inverse_slack;
    pull = tendon.value;
    const mask_t<S> above = excess > S(0);
    high = select(above, p, high);
    low = select(above, low, p);
    S next = p - excess / slope;
    // The bounds are kept while searching; the last step is Newton's whatever they are, which makes duals exact.
    const mask_t<S> inside = both(next >= low, next <= high);
    next = select(inside, next, S(0.5) * (low + high));
    const S move = next - p;
    p = next;
    if (last) break;
    last = all(abs(move) <= enough);
  }
  const mask_t<S> keep = is_finite(p);
  pull = tendon_pull(c, length - p).value;
  state.along = select(keep, p, state.along);
  state.length = select(keep, sqrt(p * p + m.height_squared), state.length);
  return m.force * pull;
}

/// Fibre and tendon at rest at an activation and a musculotendon length [m].
template <class S>
ElasticMuscleState<S> balanced(const ElasticMuscleCoefficients<S>& c, const S& activation, const S& length) noexcept {
  ElasticMuscleCoefficients<S> still = c;
  still.inverse_period = S(0);
  ElasticMuscleState<S> state{length - c.muscle.slack, S(0)};
  step(still, state, activation, length);
  return state;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
