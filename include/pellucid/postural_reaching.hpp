// A person who reaches and then holds: stiff in posture and compliant in movement, and stiffer after movements that went
// wrong.
//
// The plan is that of reaching.hpp, a primary movement and corrections, and so are muscles, reflex and noise. Different
// are the impedance about the plan,
//
//   K = K_p + (K_m - K_p) phi + kappa (c - c_0)(F_f + F_e),   D = 2 (z_p + (z_m - z_p) phi) sqrt(K J),
//   phi = x^2 (3 - 2 x),  x = min(|planned speed| / v_m, 1),
//
// the co-contraction c, which a movement that went wrong raises whichever way it did, and every movement lets decay,
//
//   c' = c + r e - d (c - c_0)  within [c_0, c_1],   e = late error beyond the tolerance, and a tolerance a correction
//   that did not help,
//
// and the corrections: none within the tolerance; what is seen is late and noisy, and told forward by what was planned
// since; after each look, and each correction, comes a refractory time; what did not help is believed in less the next
// time; and who has tried for long enough, or failed often enough, rests where the arm is. Excitation tires a muscle, and
// rest lets it recover.
//
// D. J. Bennett, J. M. Hollerbach, Y. Xu, I. W. Hunter, "Time-varying stiffness of human elbow joint during cyclic
// voluntary movement", Experimental Brain Research 88, 1992. D. W. Franklin et al., "CNS learns stable, accurate, and
// efficient movements using a simple algorithm", Journal of Neuroscience 28(44), 2008. E. Todorov, M. I. Jordan,
// "Optimal feedback control as a theory of motor coordination", Nature Neuroscience 5, 2002. I. D. Loram et al., "Human
// control of an inverted pendulum: is continuous control necessary?", Journal of Physiology 589(2), 2011. T. Xia, L. A.
// Frey Law, "A theoretical approach for modeling peripheral muscle fatigue and recovery", Journal of Biomechanics 41,
// 2008.
#pragma once

#include "reaching.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Submovements that a plan has at once: a primary one and two corrections, since each waits for the one before.
constexpr std::size_t postural_submovements = 3;

template <class S> struct PosturalParams {
  static constexpr const char* model = "postural";
  LimbParams<S> limb{};  ///< the person's internal model of the arm
  S posture_stiffness{}, movement_stiffness{}, posture_damping_ratio{}, movement_damping_ratio{}, movement_speed{},
      stiffness_per_torque{}, reflex_stiffness{}, reflex_damping{}, reflex_delay{}, muscle_delay{}, activation_time{},
      flexion_max{}, extension_max{}, cocontraction{}, cocontraction_most{}, cocontraction_rise{}, cocontraction_decay{},
      late_time{}, noise_share{}, noise_time{}, visual_delay{}, visual_noise{}, tolerance{}, check_share{},
      correction_share{}, correction_least{}, correction_gain{}, correction_discount{}, refractory_time{}, patience{},
      failures_most{}, fatigue_rate{}, recovery_rate{}, sign_width{}, period{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pellucid::walk(p.limb, visit);
    visit(p.posture_stiffness, {"posture_stiffness", unit::stiffness, above(0), "K_p, of muscles that hold"});
    visit(p.movement_stiffness, {"movement_stiffness", unit::stiffness, above(0), "K_m, of muscles that move"});
    visit(p.posture_damping_ratio, {"posture_damping_ratio", unit::one, at_least(0), "z_p, of the arm that holds"});
    visit(p.movement_damping_ratio, {"movement_damping_ratio", unit::one, at_least(0), "z_m, of the arm that moves"});
    visit(p.movement_speed, {"movement_speed", unit::velocity, above(0),
                             "v_m, planned, from which on it wholly moves"});
    visit(p.stiffness_per_torque, {"stiffness_per_torque", unit::wave_number, at_least(0),
                                   "kappa, stiffness over torque of both groups that co-contract"});
    visit(p.reflex_stiffness, {"reflex_stiffness", unit::stiffness, at_least(0), "stiffness of the stretch reflex"});
    visit(p.reflex_damping, {"reflex_damping", unit::viscous, at_least(0), "damping of the stretch reflex"});
    visit(p.reflex_delay, {"reflex_delay", unit::time, at_least(0), "delay from stretch to excitation"});
    visit(p.muscle_delay, {"muscle_delay", unit::time, at_least(0), "delay from excitation to the first force"});
    visit(p.activation_time, {"activation_time", unit::time, above(0), "lag of the force behind that"});
    visit(p.flexion_max, {"flexion_max", unit::effort, above(0), "F_f, strongest torque of the flexors, rested"});
    visit(p.extension_max, {"extension_max", unit::effort, above(0), "F_e, of the extensors"});
    visit(p.cocontraction, {"cocontraction", unit::one, share(), "c_0, excitation that both always have"});
    visit(p.cocontraction_most, {"cocontraction_most", unit::one, share(), "c_1, that errors can raise it to"});
    visit(p.cocontraction_rise, {"cocontraction_rise", unit::wave_number, at_least(0), "r, of an error"});
    visit(p.cocontraction_decay, {"cocontraction_decay", unit::one, share(), "d, from movement to movement"});
    visit(p.late_time, {"late_time", unit::time, above(0), "time over which errors count as late"});
    visit(p.noise_share, {"noise_share", unit::one, at_least(0),
                          "standard deviation of a muscle's torque over the torque"});
    visit(p.noise_time, {"noise_time", unit::time, above(0), "time over which this noise and that of the eye change"});
    visit(p.visual_delay, {"visual_delay", unit::time, at_least(0), "delay from the arm's position to a correction"});
    visit(p.visual_noise, {"visual_noise", unit::coordinate, at_least(0), "standard deviation of where it is seen"});
    visit(p.tolerance, {"tolerance", unit::coordinate, at_least(0), "error that is left as it is"});
    visit(p.check_share, {"check_share", unit::one, at_least(0),
                          "time of the first correction, as a share of the primary movement's duration"});
    visit(p.correction_share, {"correction_share", unit::one, at_least(0),
                               "a correction's duration, of the primary movement's"});
    visit(p.correction_least, {"correction_least", unit::time, above(0), "a correction's least duration"});
    visit(p.correction_gain, {"correction_gain", unit::one, share(), "share of an error that is corrected at once"});
    visit(p.correction_discount, {"correction_discount", unit::one, between(0.01, 1),
                                  "share of the next correction that remains after one that did not help"});
    visit(p.refractory_time, {"refractory_time", unit::time, at_least(0),
                              "time after a look or a correction without another"});
    visit(p.patience, {"patience", unit::time, at_least(0), "time after the primary movement until it is given up"});
    visit(p.failures_most, {"failures_most", unit::one, at_least(0),
                            "corrections that failed, at which it is given up"});
    visit(p.fatigue_rate, {"fatigue_rate", unit::rate, at_least(0), "strength lost, of the excitation"});
    visit(p.recovery_rate, {"recovery_rate", unit::rate, at_least(0), "recovery rate of the strength lost"});
    visit(p.sign_width, {"sign_width", unit::velocity, above(0),
                         "velocity over which expected friction changes its sign"});
    visit(p.period, {"period", unit::time, above(0), "between two steps"});
  }
};

/// Coefficients computed once from PosturalParams.
template <class S> struct PosturalCoefficients {
  PosturalParams<S> params{};  ///< as they are
  LimbCoefficients<S> limb{};  ///< the person's internal model of the arm
  S reflex_delay{};            ///< periods, whole
  S muscle_delay{};            ///< periods, whole
  S visual_delay{};            ///< periods, whole
  S lead{};                    ///< time by which muscles are told the plan ahead: their delay [s]
  S activation{};              ///< share of a new excitation, a period [1]
  S activation_lead{};         ///< periods of change that make up for that lag [1]
  S noise_pole{};              ///< pole of the noise [1]
  S noise_gain{};              ///< so that its variance is 1 [1]
  S inverse_sign_width{};      ///< [s/rad]
  S inverse_speed{};           ///< 1 / v_m [s/rad]
  S tension_stiffness{};       ///< kappa (F_f + F_e), of a unit of co-contraction [N m/rad]
  S late_weight{};             ///< a period of the late time [1]
};

namespace detail {
constexpr double never = 1e9;            // s
constexpr double largest_error = 6.3;    // rad: no joint is further off its plan
constexpr double largest_speed = 100.0;  // rad/s: nor faster
constexpr double most_tired = 0.95;      // of a muscle's strength

/// A delay in whole periods that a ring can hold; 0 for NaN.
template <class S> S whole_periods(const S& delay, const S& period) noexcept {
  const S periods = round(delay / period);
  return select(periods > S(0), min(periods, S(static_cast<value_t<S>>(max_reaching_delay - 1))), S(0));
}

/// Value of a ring buffer a number of periods ago, lane by lane.
template <class S>
S recalled(const S (&ring)[max_reaching_delay], std::uint32_t now, const S& periods) noexcept {
  if constexpr (std::is_same<mask_t<S>, bool>::value) {
    return ring[(now + max_reaching_delay - static_cast<std::uint32_t>(value_of(periods))) % max_reaching_delay];
  } else {
    S past(0);
    for (std::size_t i = 0; i < sizeof(S) / sizeof(value_t<S>); ++i) {
      const auto ago = static_cast<std::uint32_t>(periods[i]);
      past.set(i, ring[(now + max_reaching_delay - ago) % max_reaching_delay][i]);
    }
    return past;
  }
}

template <class S> S finite_or(const S& x, const S& otherwise) noexcept { return select(is_finite(x), x, otherwise); }
}  // namespace detail

template <class S> PosturalCoefficients<S> coefficients(const PosturalParams<S>& p) noexcept {
  PosturalCoefficients<S> c;
  c.params = p;
  c.limb = coefficients(p.limb);
  c.reflex_delay = detail::whole_periods(p.reflex_delay, p.period);
  c.muscle_delay = detail::whole_periods(p.muscle_delay, p.period);
  c.visual_delay = detail::whole_periods(p.visual_delay, p.period);
  c.lead = c.muscle_delay * p.period;
  c.activation = S(1) - exp(-p.period / p.activation_time);
  c.activation_lead = p.activation_time / p.period;
  c.noise_pole = exp(-p.period / p.noise_time);
  c.noise_gain = sqrt(S(1) - c.noise_pole * c.noise_pole);
  c.inverse_sign_width = S(1) / p.sign_width;
  c.inverse_speed = S(1) / p.movement_speed;
  c.tension_stiffness = p.stiffness_per_torque * (p.flexion_max + p.extension_max);
  c.late_weight = p.period / p.late_time;
  return c;
}

template <class S> struct PosturalState {
  S time{};                                              ///< since the task was given [s]
  S origin{};                                            ///< where the plan starts [rad]
  S target{};                                            ///< [rad]
  S correction_duration{};                               ///< [s]
  S primary_end{};                                       ///< [s]
  S plan_end{};                                          ///< when the plan is at rest [s]
  S next_check{};                                        ///< from when on a correction may be decided [s]
  ExpectedLoad<S> load{};                                ///< expected load
  MinimumJerk<S> submovements[postural_submovements]{};  ///< submovements of the plan, the newest last
  PlannedMotion<S> ahead{};                              ///< the plan when what is told now arrives
  S expected{};                                          ///< torque that the plan needs then [N m]
  S planned_position[max_reaching_delay]{};              ///< planned angles on their way to muscles, in a ring [rad]
  S planned_velocity[max_reaching_delay]{};              ///< [rad/s]
  S excitation[max_reaching_delay]{};                    ///< on its way to the muscle, in a ring [N m]
  S position_error[max_reaching_delay]{};                ///< plan less arm, in a ring [rad]
  S velocity_error[max_reaching_delay]{};                ///< [rad/s]
  std::uint32_t now = 0;                                 ///< where the rings are
  S torque{};                                            ///< torque of the muscles, without noise [N m]
  S noise[3]{};                                          ///< noise of flexors, extensors and eyes [1]
  S turn{S(1)};                                          ///< 1 and -1 by turns
  // Of this movement.
  S corrections{};                                       ///< corrections so far
  S failures{};                                          ///< corrections that failed
  S trust{};                                             ///< in the next, 1 where none has failed
  S last_error{};                                        ///< error that the last submovement was to correct [rad]
  S last_share{};                                        ///< how much of it [1]
  S late{};                                              ///< mean error when one correction had been enough [rad]
  S given_up{};                                          ///< 1 once the person rests where the arm is
  // From movement to movement.
  S movements{};                                         ///< number of aimed movements
  S cocontraction{};                                     ///< c, that is aimed at [1]
  S tone{};                                              ///< c, as the muscles have followed [1]
  S fatigue[2]{};                                        ///< strength lost of flexors and of extensors [1]
  S effort{};                                            ///< squared excitation of both, summed over time [s]
};

/// Impedance about the plan.
template <class S> struct Impedance {
  S stiffness{};  ///< [N m/rad]
  S damping{};    ///< [N m s/rad]
};

/// Impedance of somebody who moves at a planned speed [rad/s] and co-contracts [1].
template <class S> Impedance<S> impedance(const PosturalCoefficients<S>& c, const S& speed, const S& tone) noexcept {
  const PosturalParams<S>& p = c.params;
  const S x = min(abs(speed) * c.inverse_speed, S(1));
  const S moving = x * x * (S(3) - S(2) * x);
  const S stiffness = p.posture_stiffness + (p.movement_stiffness - p.posture_stiffness) * moving +
                      c.tension_stiffness * max(tone - p.cocontraction, S(0));
  const S ratio = p.posture_damping_ratio + (p.movement_damping_ratio - p.posture_damping_ratio) * moving;
  return {stiffness, S(2) * ratio * sqrt(stiffness * p.limb.inertia)};
}

/// Co-contraction of the next movement [1] after a late error [rad], of either sign, and so many corrections that
/// failed.
template <class S> S adapted_cocontraction(const PosturalCoefficients<S>& c, const S& cocontraction, const S& late,
                                           const S& failures) noexcept {
  const PosturalParams<S>& p = c.params;
  const S error = abs(late) + p.tolerance * failures;
  const S next =
      cocontraction + p.cocontraction_rise * error - p.cocontraction_decay * (cocontraction - p.cocontraction);
  return clamp(next, p.cocontraction, max(p.cocontraction_most, p.cocontraction));
}

/// Return the end position of the plan [rad].
template <class S> S plan_end(const PosturalState<S>& state) noexcept {
  S end = state.origin;
  for (const MinimumJerk<S>& one : state.submovements) end = end + one.amplitude;
  return end;
}

/// A person who holds an arm still at an angle, expecting a load.
template <class S> PosturalState<S> holding(const PosturalCoefficients<S>& c, const S& position,
                                            const ExpectedLoad<S>& load) noexcept {
  PosturalState<S> state;
  state.origin = state.target = detail::finite_or(position, S(0));
  for (MinimumJerk<S>& one : state.submovements) one.duration = S(1);
  state.load = load;
  state.next_check = S(detail::never);
  state.primary_end = S(detail::never);
  state.ahead = {state.origin, S(0), S(0)};
  state.expected = expected_torque(c, load, state.ahead);
  state.torque = state.expected;
  for (S& e : state.excitation) e = state.expected;
  for (S& q : state.planned_position) q = state.origin;
  state.trust = S(1);
  state.cocontraction = state.tone = c.params.cocontraction;
  return state;
}

/// A new target. The plan goes on from where it ends; what went wrong with the movement before is learnt from.
template <class S> void aim(const PosturalCoefficients<S>& c, PosturalState<S>& state,
                            const ReachingTask<S>& task) noexcept {
  const PosturalParams<S>& p = c.params;
  state.cocontraction = select(
      state.movements > S(0), adapted_cocontraction(c, state.cocontraction, state.late, state.failures),
      state.cocontraction);
  state.movements = state.movements + S(1);
  // Everything planned before has ended, or ends here: targets are given to people at rest.
  state.origin = plan_end(state);
  for (MinimumJerk<S>& one : state.submovements) one = {S(0), S(0), S(1)};
  const S duration = select(task.duration > S(0), detail::finite_or(task.duration, S(1)), S(1));
  const S reaction = detail::finite_or(task.reaction, S(0));
  state.submovements[postural_submovements - 1] = {reaction, detail::finite_or(task.amplitude, S(0)), duration};
  state.time = S(0);
  state.target = detail::finite_or(task.target, state.target);
  state.correction_duration = max(p.correction_share * duration, p.correction_least);
  state.primary_end = state.plan_end = reaction + duration;
  state.next_check = reaction + p.check_share * duration;
  state.load = {detail::finite_or(task.load.inertia, S(0)), detail::finite_or(task.load.viscous, S(0)),
                detail::finite_or(task.load.coulomb, S(0)), detail::finite_or(task.load.gravity_sine, S(0)),
                detail::finite_or(task.load.gravity_cosine, S(0))};
  state.corrections = state.failures = state.last_error = state.last_share = state.late = state.given_up = S(0);
  state.trust = S(1);
}

/// Decides a correction, if one may be and is needed, or gives the movement up.
template <class S> void correct(const PosturalCoefficients<S>& c, PosturalState<S>& state) noexcept {
  const mask_t<S> due = both(state.time >= state.next_check, state.given_up == S(0));
  if (!any(due)) return;
  const PosturalParams<S>& p = c.params;
  // Where the arm will end: the plan's end, less by how much the arm was seen to be behind the plan. What was told since
  // is in the plan, and is not corrected twice.
  const S end = plan_end(state);
  const S behind = detail::recalled(state.position_error, state.now, c.visual_delay);
  const S error = state.target - (end - behind - p.visual_noise * state.noise[2]);
  const mask_t<S> needed = both(due, abs(error) > p.tolerance);
  state.next_check = select(due, state.time + p.refractory_time, state.next_check);
  if (!any(needed)) return;
  const mask_t<S> again = both(needed, state.corrections > S(0));
  const mask_t<S> failed = both(again, abs(error) > (S(1) - S(0.5) * state.last_share) * abs(state.last_error));
  const mask_t<S> helped = both(again, !failed);
  state.failures = select(failed, state.failures + S(1), state.failures);
  state.trust = select(failed, state.trust * p.correction_discount,
                       select(helped, min(state.trust / p.correction_discount, S(1)), state.trust));
  const mask_t<S> over = both(needed, either(state.time > state.primary_end + p.patience,
                                             both(failed, state.failures >= p.failures_most)));
  state.given_up = select(over, S(1), state.given_up);
  const S told = p.correction_gain * state.trust;
  // Who gives up pushes no longer.
  const S amplitude = select(over, -behind, told * error);
  state.corrections = select(both(needed, !over), state.corrections + S(1), state.corrections);
  state.last_error = select(needed, error, state.last_error);
  state.last_share = select(needed, told, state.last_share);
  // The oldest submovement, which has long ended, becomes part of where the plan starts.
  state.origin = select(needed, state.origin + state.submovements[0].amplitude, state.origin);
  const S start = state.time + c.lead;
  const MinimumJerk<S> fresh{start, amplitude, state.correction_duration};
  for (std::size_t i = 0; i < postural_submovements; ++i) {
    MinimumJerk<S>& one = state.submovements[i];
    const MinimumJerk<S>& next = i + 1 < postural_submovements ? state.submovements[i + 1] : fresh;
    one = {select(needed, next.start, one.start), select(needed, next.amplitude, one.amplitude),
           select(needed, next.duration, one.duration)};
  }
  const S done = start + state.correction_duration;
  state.plan_end = select(needed, max(state.plan_end, done), state.plan_end);
  state.next_check = select(needed, done + p.refractory_time, state.next_check);
}

/// One period of an arm that is at a position and moves at a velocity; `flexor_noise` and `extensor_noise` are standard
/// normal numbers. What is not finite is not felt.
template <class S> ReachingOutput<S> step(const PosturalCoefficients<S>& c, PosturalState<S>& state, const S& position,
                                          const S& velocity, const S& flexor_noise, const S& extensor_noise) noexcept {
  const PosturalParams<S>& p = c.params;
  state.now = (state.now + 1) % max_reaching_delay;

  // A plan that is at rest stays where it is.
  const S then = state.time + c.lead;
  const S before = state.expected;
  if (any(then < state.plan_end + S(2) * p.period)) {
    PlannedMotion<S> sum{state.origin, S(0), S(0)};
    for (const MinimumJerk<S>& submovement : state.submovements) {
      const PlannedMotion<S> one = at(submovement, then);
      sum.position = sum.position + one.position;
      sum.velocity = sum.velocity + one.velocity;
      sum.acceleration = sum.acceleration + one.acceleration;
    }
    state.ahead = sum;
    state.expected = expected_torque(c, state.load, sum);
  }
  state.planned_position[state.now] = state.ahead.position;
  state.planned_velocity[state.now] = state.ahead.velocity;
  const S planned_position = detail::recalled(state.planned_position, state.now, c.muscle_delay);
  const S planned_velocity = detail::recalled(state.planned_velocity, state.now, c.muscle_delay);
  const S far = S(detail::largest_error), fast = S(detail::largest_speed);
  const S behind = clamp(detail::finite_or(planned_position - position, S(0)), -far, far);
  const S slower = clamp(detail::finite_or(planned_velocity - velocity, S(0)), -fast, fast);
  state.position_error[state.now] = behind;
  state.velocity_error[state.now] = slower;

  // The eyes' noise is what of the muscles' alternates, which their lag passes none of.
  const S flexor_white = detail::finite_or(flexor_noise, S(0)), extensor_white = detail::finite_or(extensor_noise, S(0));
  state.noise[0] = c.noise_pole * state.noise[0] + c.noise_gain * flexor_white;
  state.noise[1] = c.noise_pole * state.noise[1] + c.noise_gain * extensor_white;
  state.turn = -state.turn;
  state.noise[2] = c.noise_pole * state.noise[2] +
                   c.noise_gain * state.turn * S(0.7071067811865476) * (flexor_white - extensor_white);
  correct(c, state);

  // Told now what is needed when it arrives, and a lag's worth more of its change.
  const S told = state.expected + c.activation_lead * (state.expected - before);
  const S reflex = p.reflex_stiffness * detail::recalled(state.position_error, state.now, c.reflex_delay) +
                   p.reflex_damping * detail::recalled(state.velocity_error, state.now, c.reflex_delay);
  const S flexion_max = p.flexion_max * (S(1) - state.fatigue[0]);
  const S extension_max = p.extension_max * (S(1) - state.fatigue[1]);
  const S wanted = clamp(told + reflex, -extension_max, flexion_max);
  state.excitation[state.now] = wanted;
  const S arrived = detail::recalled(state.excitation, state.now, c.muscle_delay);
  state.torque = state.torque + c.activation * (arrived - state.torque);
  state.tone = state.tone + c.activation * (state.cocontraction - state.tone);

  const S flexion = max(state.torque, S(0)) + state.tone * flexion_max;
  const S extension = max(-state.torque, S(0)) + state.tone * extension_max;
  const S shaken = p.noise_share * (flexion * state.noise[0] - extension * state.noise[1]);
  const Impedance<S> own = impedance(c, planned_velocity, state.tone);

  ReachingOutput<S> out;
  out.torque = detail::finite_or(state.torque + shaken + own.stiffness * behind + own.damping * slower, S(0));
  out.flexor = detail::finite_or(min(max(wanted, S(0)) / flexion_max + state.tone, S(1)), S(0));
  out.extensor = detail::finite_or(min(max(-wanted, S(0)) / extension_max + state.tone, S(1)), S(0));
  out.planned = planned_position;

  // What it costs, and what is left to learn from.
  const S used[2] = {out.flexor, out.extensor};
  for (int i = 0; i < 2; ++i) {
    const S change = p.fatigue_rate * used[i] * (S(1) - state.fatigue[i]) - p.recovery_rate * state.fatigue[i];
    state.fatigue[i] = clamp(state.fatigue[i] + p.period * change, S(0), S(detail::most_tired));
  }
  state.effort = state.effort + p.period * (out.flexor * out.flexor + out.extensor * out.extensor);
  const S late_from = state.primary_end + p.visual_delay + state.correction_duration;
  const S off = abs(state.target - planned_position + behind) - p.tolerance;
  const mask_t<S> late = both(both(state.time >= late_from, state.time < late_from + p.late_time), off > S(0));
  state.late = state.late + select(late, c.late_weight * off, S(0));
  state.time = state.time + p.period;
  return out;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
