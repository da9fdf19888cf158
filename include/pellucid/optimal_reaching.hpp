// How a person moves a forearm to a target without a plan: feedback that is optimal for what the arm is expected to do.
//
// The person estimates where the arm is from what was felt a while ago and from what the muscles have been told since,
// and chooses at every moment the torque that is cheapest from there on: error, speed and the roughness of torque cost,
//
//   J = E int (e^2 + w (t_c v)^2 + t_c^8 (tau''/J_a)^2) dt,   J_a a = tau + d,   a's noise in proportion to tau,
//
// without an end (infinite horizon). t_c, the only number that a duration sets, is such that a movement without noise
// is as long as one of minimum jerk. d, a torque that nobody told of, is estimated with the arm's state and answered.
// Muscles resist at once, by as much as they are co-contracted, what the estimate does not know; how much they are is
// the cheapest against the torques that have come unexpected in the movements before. A target has a size: what rests
// inside is left there.
//
// E. Todorov, "Stochastic optimal control and estimation methods adapted to the noise characteristics of the
// sensorimotor system", Neural Computation 17, 2005; N. Qian, Y. Jiang, Z.-P. Jiang, P. Mazzoni, "Movement duration,
// Fitts's law, and an infinite-horizon optimal feedback control model for biological motor systems", Neural Computation
// 25, 2013; F. Crevecoeur, S. H. Scott, "Priors engaged in long-latency responses to mechanical perturbations suggest a
// rapid update in state estimation", PLoS Comput. Biol. 9, 2013; B. Berret, D. Verdel, E. Burdet, F. Jean,
// "Co-contraction embodies uncertainty: an optimal feedforward strategy for robust motor control", PLoS Comput. Biol.
// 20, 2024.
#pragma once

#include "reaching.hpp"
#include "riccati.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct OptimalReachingParams {
  static constexpr const char* model = "optimal";
  LimbParams<S> limb{};  ///< the person's internal model of the arm
  S resting_stiffness{}, stiffness_per_torque{}, damping_ratio{}, muscle_delay{}, activation_time{},
      flexion_max{}, extension_max{}, cocontraction{}, uncertainty{}, uncertainty_time{}, uncertainty_share{},
      noise_share{}, phasic_noise_share{}, noise_time{}, feedback_delay{}, position_noise{}, velocity_noise{},
      velocity_weight{}, correction_time{}, tolerance{}, sign_width{}, period{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pellucid::walk(p.limb, visit);
    visit(p.resting_stiffness, {"resting_stiffness", unit::stiffness, at_least(0), "stiffness of muscles at rest"});
    visit(p.stiffness_per_torque, {"stiffness_per_torque", unit::wave_number, above(0),
                              "stiffness over the torques of both muscle groups"});
    visit(p.damping_ratio, {"damping_ratio", unit::one, at_least(0), "damping ratio of the arm with that stiffness"});
    visit(p.muscle_delay, {"muscle_delay", unit::time, at_least(0), "delay from excitation to the first force"});
    visit(p.activation_time, {"activation_time", unit::time, above(0), "lag of the force behind that"});
    visit(p.flexion_max, {"flexion_max", unit::effort, above(0), "strongest torque of the flexors"});
    visit(p.extension_max, {"extension_max", unit::effort, above(0), "largest torque of the extensors"});
    visit(p.cocontraction, {"cocontraction", unit::one, at_least(0),
                            "excitation of both groups while nothing comes unexpected"});
    visit(p.uncertainty, {"uncertainty", unit::effort, above(0),
                          "standard deviation of unexpected torque that a person always reckons with"});
    visit(p.uncertainty_time, {"uncertainty_time", unit::time, above(0), "time over which unexpected torque changes"});
    visit(p.uncertainty_share, {"uncertainty_share", unit::one, share(),
                                "share of its variance that is carried over into the next movement"});
    visit(p.noise_share, {"noise_share", unit::one, at_least(0),
                          "standard deviation of a muscle's torque over the torque"});
    visit(p.phasic_noise_share, {"phasic_noise_share", unit::one, at_least(0), "and of what accelerates, over that"});
    visit(p.noise_time, {"noise_time", unit::time, above(0), "time over which noise of muscles and senses changes"});
    visit(p.feedback_delay, {"feedback_delay", unit::time, at_least(0),
                             "delay from the arm's position to an excitation"});
    visit(p.position_noise, {"position_noise", unit::coordinate, above(0), "standard deviation of the felt position"});
    visit(p.velocity_noise, {"velocity_noise", unit::velocity, above(0), "and of the felt velocity"});
    visit(p.velocity_weight, {"velocity_weight", unit::one, at_least(0), "w, cost of speed relative to error"});
    visit(p.correction_time, {"correction_time", unit::time, above(0),
                              "duration of what corrects a held arm, if the movement was longer"});
    visit(p.tolerance, {"tolerance", unit::coordinate, at_least(0), "error that is left as it is"});
    visit(p.sign_width, {"sign_width", unit::velocity, above(0),
                         "velocity over which expected friction changes its sign"});
    visit(p.period, {"period", unit::time, above(0), "between two steps"});
  }
};

constexpr std::size_t optimal_reaching_parameter_count = field_count<OptimalReachingParams<double>>;

/// Gains on error, speed, torque and torque rate, each in units of t_c.
template <class S> struct ReachingGains {
  S at[4];
};

/// The cheapest feedback in units of t_c, where a period is `step` long and noise has the `variance` for each unit of
/// torque squared. What noise costs depends on the cost itself, so that both are found in turn (Phillis, IEEE Trans.
/// Autom. Control 30, 1985).
template <class S>
ReachingGains<S> reaching_gains(const S& velocity_weight, const S& step, const S& variance) noexcept {
  constexpr std::uint32_t doublings = 14, turns = 4;
  SquareMatrix<S, 4> a = unit_square<S, 4>(), g = zero_square<S, 4>(), q = zero_square<S, 4>(), x = q;
  // A torque that is held for a period moves the arm; the next torque is what its rate and the roughness make of it.
  a.at[0][1] = a.at[1][2] = a.at[2][3] = step;
  a.at[0][2] = S(0.5) * step * step;
  const S b[2] = {S(0.5) * step * step, step};
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) g.at[2 + i][2 + j] = b[i] * b[j] / step;
  q.at[0][0] = step;
  q.at[1][1] = step * velocity_weight;
  for (std::uint32_t i = 0; i < turns; ++i) {
    q.at[2][2] = step * variance * x.at[1][1];
    x = riccati(a, g, q, doublings);
  }
  S weighted[4];
  for (int j = 0; j < 4; ++j) weighted[j] = b[0] * x.at[2][j] + b[1] * x.at[3][j];
  const S inverse = S(1) / (step + weighted[2] * b[0] + weighted[3] * b[1]);
  ReachingGains<S> gains;
  for (int j = 0; j < 4; ++j) {
    S sum = S(0);
    for (int i = 0; i < 4; ++i) sum = sum + weighted[i] * a.at[i][j];
    gains.at[j] = inverse * sum;
  }
  return gains;
}

/// Return the time for which a movement under these gains exceeds 5 % of its peak speed [t_c], at the gains' step.
template <class S> S movement_width(const ReachingGains<S>& gains, const S& step) noexcept {
  constexpr int steps = 4096;
  S peak = S(0), width = S(0);
  for (int pass = 0; pass < 2; ++pass) {
    S e = S(-1), v = S(0), t = S(0), rate = S(0);
    for (int k = 0; k < steps; ++k) {
      const S rough = -(gains.at[0] * e + gains.at[1] * v + gains.at[2] * t + gains.at[3] * rate);
      e = e + step * (v + S(0.5) * step * t);
      v = v + step * t;
      t = t + step * (rate + S(0.5) * step * rough);
      rate = rate + step * rough;
      if (pass == 0) peak = max(v, peak);
      else width = width + select(v > S(0.05) * peak, step, S(0));
    }
  }
  return width;
}

/// Coefficients computed once from OptimalReachingParams.
template <class S> struct OptimalReachingCoefficients {
  OptimalReachingParams<S> params{};  ///< as they are
  LimbCoefficients<S> limb{};         ///< the person's internal model of the arm
  std::uint32_t muscle_delay = 0;     ///< periods
  std::uint32_t feedback_delay = 0;   ///< periods from where the arm is to an excitation
  std::uint32_t loop_delay = 0;       ///< periods, of both
  S activation{};                     ///< share of a new excitation, a period [1]
  S inverse_activation{};             ///< [1]
  S noise_pole{};                     ///< pole of the noise [1]
  S noise_gain{};                     ///< so that its variance is 1 [1]
  S inverse_sign_width{};             ///< [s/rad]
  S held_noise{};                     ///< white noise of muscles that hold, for each unit of torque squared [s]
  S phasic_noise{};                   ///< noise of muscles that accelerate [s]
  S time_share{};                     ///< t_c over the duration of a movement of minimum jerk that is as long [1]
  S holding_time{};                   ///< t_c of corrections while the arm is held [s]
  ReachingGains<S> holding{};         ///< gains of muscles that hold
};

/// t_c of movements that take a duration [s].
template <class S> S unit_time(const OptimalReachingCoefficients<S>& c, const S& duration) noexcept {
  return max(c.time_share * duration, S(8) * c.params.period);
}

template <class S> OptimalReachingCoefficients<S> coefficients(const OptimalReachingParams<S>& p) noexcept {
  OptimalReachingCoefficients<S> c;
  c.params = p;
  c.limb = coefficients(p.limb);
  c.muscle_delay = delay_periods(p.muscle_delay, p.period);
  c.feedback_delay = delay_periods(p.feedback_delay, p.period);
  const std::uint32_t both_delays = c.muscle_delay + c.feedback_delay;
  c.loop_delay = both_delays < max_reaching_delay ? both_delays : max_reaching_delay - 1;
  c.feedback_delay = c.loop_delay - c.muscle_delay;
  c.activation = S(1) - exp(-p.period / p.activation_time);
  c.inverse_activation = S(1) / c.activation;
  c.noise_pole = exp(-p.period / p.noise_time);
  c.noise_gain = sqrt(S(1) - c.noise_pole * c.noise_pole);
  c.inverse_sign_width = S(1) / p.sign_width;
  const S step = S(0.005);
  // A movement of minimum jerk is faster than 5 % of its peak for sqrt(1 - sqrt(0.05)) of its duration.
  c.time_share = S(0.88113019) / movement_width(reaching_gains(p.velocity_weight, step, S(0)), step);
  c.held_noise = S(2) * p.noise_share * p.noise_share * p.noise_time;
  c.phasic_noise = S(2) * p.phasic_noise_share * p.phasic_noise_share * p.noise_time;
  c.holding_time = unit_time(c, p.correction_time);
  c.holding = reaching_gains(p.velocity_weight, p.period / c.holding_time, c.phasic_noise / c.holding_time);
  return c;
}

/// Choices of a person before a movement: stiffness, control gains, and trust in the feedback.
template <class S> struct ReachingPolicy {
  S moving_time{};          ///< t_c of the movement [s]
  S moving[4]{};            ///< roughness of torque for error, speed, torque and torque rate [N m/s^2 for each, SI]
  S holding[4]{};           ///< the same before and after the movement
  S cocontraction{};        ///< excitation of both groups [1]
  S stiffness{};            ///< stiffness of the muscles [N m/rad]
  S damping{};              ///< damping of the muscles [N m s/rad]
  S inverse_inertia{};      ///< 1 / inertia of arm and load [1/(kg m^2)]
  SquareMatrix<S, 3> transition = zero_square<S, 3>();  ///< transition of (q, v, unexpected torque) over a period
  S belief[3][2]{};         ///< what a felt position and velocity change of the estimate, as of when they were felt
  S now[3][2]{};            ///< and of the estimate of now
};

template <class S> struct OptimalReachingState {
  S time{};                                  ///< since the task was given [s]
  S reaction{};                              ///< when the movement starts [s]
  S duration{};                              ///< its duration [s]
  S origin{};                                ///< where the arm is held before [rad]
  S target{};                                ///< [rad]
  S resting{};                               ///< 1 where the arm rests inside the target, else 0
  S rest{};                                  ///< where [rad]
  ExpectedLoad<S> load{};                    ///< expected load
  ReachingPolicy<S> policy{};                ///< policy of this movement
  S variance{};                              ///< variance of unexpected torque that the policy reckons with [N^2 m^2]
  S surprise{};                              ///< integral of the square of what came unexpected [N^2 m^2 s]
  S position{};                              ///< where the arm will be when an excitation of now arrives [rad]
  S velocity{};                              ///< and how fast [rad/s]
  S wanted{};                                ///< torque beyond what is expected to be needed [N m]
  S rate{};                                  ///< its rate [N m/s]
  S felt[3]{};                               ///< position, velocity and unexpected torque when they were felt, SI
  S told{};                                  ///< torque that the muscles were to give last [N m]
  S expected_position[max_reaching_delay]{};  ///< expected angle of the arm, in a ring [rad]
  S expected_velocity[max_reaching_delay]{};  ///< [rad/s]
  S own_torque[max_reaching_delay]{};        ///< own torque that accelerates the arm [N m]
  S seen_position[max_reaching_delay]{};     ///< seen angle of the arm, in a ring [rad]
  S seen_velocity[max_reaching_delay]{};     ///< [rad/s]
  S excitation[max_reaching_delay]{};        ///< on its way to the muscle, in a ring [N m]
  std::uint32_t at = 0;                      ///< where the rings are
  S torque{};                                ///< torque of the muscles, without noise [N m]
  S noise[2]{};                              ///< noise of flexors and extensors [1]
};

/// Torque to hold the arm, to keep its velocity, and to carry the expected load [N m].
template <class S> S needed_torque(const OptimalReachingCoefficients<S>& c, const ExpectedLoad<S>& load,
                                   const S& position, const S& velocity) noexcept {
  return expected_torque(c, load, PlannedMotion<S>{position, velocity, S(0)});
}

/// The co-contraction that costs least against unexpected torque of a variance: least of effort a^2 and of squared
/// error variance / K(a)^2, with K = base + slope a; the weight between them is what makes the usual one right for the
/// usual variance, so that a K^3 grows with the variance.
template <class S> S cheapest_cocontraction(const OptimalReachingParams<S>& p, const S& base, const S& slope,
                                            const S& variance) noexcept {
  const S usual = base + slope * p.cocontraction;
  const S wanted = p.cocontraction * usual * usual * usual * (variance / (p.uncertainty * p.uncertainty));
  // Newton's steps on a convex function come down from above.
  S a = sqrt(sqrt(wanted / (slope * slope * slope)));
  for (int i = 0; i < 12; ++i) {
    const S k = base + slope * a;
    const S cube = k * k * k;
    a = a - (a * cube - wanted) / (cube + S(3) * a * slope * k * k);
  }
  return clamp(a, S(0), S(1));
}

/// Gains in units of t_c, of an inertia, in SI.
template <class S>
void in_si(const ReachingGains<S>& gains, const S& inertia, const S& unit_time, S (&si)[4]) noexcept {
  const S rate = S(1) / unit_time, rate2 = rate * rate;
  const S scale[4] = {inertia * rate2 * rate2, inertia * rate2 * rate, rate2, rate};
  for (int i = 0; i < 4; ++i) si[i] = scale[i] * gains.at[i];
}

/// The policy for a movement over an amplitude to a target that takes a duration, of an arm with a load.
template <class S>
ReachingPolicy<S> policy(const OptimalReachingCoefficients<S>& c, const ExpectedLoad<S>& load, const S& amplitude,
                         const S& target, const S& duration, const S& variance) noexcept {
  const OptimalReachingParams<S>& p = c.params;
  ReachingPolicy<S> policy;
  const S inertia = max(p.limb.inertia + load.inertia, S(0.1) * p.limb.inertia);
  policy.inverse_inertia = S(1) / inertia;
  policy.moving_time = unit_time(c, duration);
  const ReachingGains<S> gains =
      reaching_gains(p.velocity_weight, p.period / policy.moving_time, c.phasic_noise / policy.moving_time);
  in_si(gains, inertia, policy.moving_time, policy.moving);
  in_si(c.holding, inertia, c.holding_time, policy.holding);
  const mask_t<S> slow = policy.moving_time > c.holding_time;
  for (int i = 0; i < 4; ++i) policy.holding[i] = select(slow, policy.holding[i], policy.moving[i]);

  const S held = abs(needed_torque(c, load, target, S(0)));
  const S base = p.resting_stiffness + p.stiffness_per_torque * held;
  const S slope = p.stiffness_per_torque * (p.flexion_max + p.extension_max);
  policy.cocontraction = cheapest_cocontraction(p, base, slope, variance);
  policy.stiffness = base + slope * policy.cocontraction;
  policy.damping = S(2) * p.damping_ratio * sqrt(policy.stiffness * inertia);

  // What the estimate does not know of the arm is resisted by the muscles.
  SquareMatrix<S, 3> m = zero_square<S, 3>();
  m.at[0][1] = p.period;
  m.at[1][0] = -p.period * policy.stiffness * policy.inverse_inertia;
  m.at[1][1] = -p.period * policy.damping * policy.inverse_inertia;
  m.at[1][2] = p.period * policy.inverse_inertia;
  SquareMatrix<S, 3> term = unit_square<S, 3>();
  policy.transition = term;
  for (int i = 1; i < 6; ++i) {
    term = term * m;
    const S inverse = S(1) / S(static_cast<value_t<S>>(i));
    for (std::size_t j = 0; j < 9; ++j) term.at[j / 3][j % 3] = term.at[j / 3][j % 3] * inverse;
    policy.transition = policy.transition + term;
  }
  // Kalman's gain for noise of the muscles that hold the arm, unexpected torque that wanders, and senses.
  const S flexion = held + policy.cocontraction * p.flexion_max, extension = policy.cocontraction * p.extension_max;
  SquareMatrix<S, 3> q = zero_square<S, 3>(), g = q;
  const S held_square = flexion * flexion + extension * extension;
  // Of a smooth movement the acceleration's mean square is (0.107 A / t_c^2)^2.
  const S fastest = S(0.107) * amplitude / (policy.moving_time * policy.moving_time);
  q.at[1][1] = p.period * (c.held_noise * held_square * policy.inverse_inertia * policy.inverse_inertia +
                           c.phasic_noise * fastest * fastest);
  q.at[2][2] = p.period * S(2) * variance / p.uncertainty_time;
  const S sense = S(2) * p.noise_time / p.period;
  const S r[2] = {sense * p.position_noise * p.position_noise, sense * p.velocity_noise * p.velocity_noise};
  g.at[0][0] = S(1) / r[0];
  g.at[1][1] = S(1) / r[1];
  const SquareMatrix<S, 3> x = riccati(transposed(policy.transition), g, q, 14);
  const S s00 = x.at[0][0] + r[0], s11 = x.at[1][1] + r[1], s01 = x.at[0][1];
  const S inverse = S(1) / (s00 * s11 - s01 * s01);
  for (int i = 0; i < 3; ++i) {
    policy.belief[i][0] = inverse * (x.at[i][0] * s11 - x.at[i][1] * s01);
    policy.belief[i][1] = inverse * (x.at[i][1] * s00 - x.at[i][0] * s01);
  }
  // What it makes of now: the same, carried over the periods in between.
  SquareMatrix<S, 3> power = policy.transition, carried = unit_square<S, 3>();
  for (std::uint32_t left = c.loop_delay; left > 0; left /= 2) {
    if (left % 2 == 1) carried = carried * power;
    power = power * power;
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 2; ++j) {
      policy.now[i][j] = S(0);
      for (int k = 0; k < 3; ++k) policy.now[i][j] = policy.now[i][j] + carried.at[i][k] * policy.belief[k][j];
    }
  return policy;
}

/// A person who holds an arm still at an angle, expecting a load.
template <class S> OptimalReachingState<S> holding(const OptimalReachingCoefficients<S>& c, const S& position,
                                                   const ExpectedLoad<S>& load) noexcept {
  OptimalReachingState<S> state;
  state.reaction = S(1e9);
  state.duration = c.params.correction_time;
  state.origin = position;
  state.target = position;
  state.load = load;
  state.variance = c.params.uncertainty * c.params.uncertainty;
  state.policy = policy(c, load, S(0), position, state.duration, state.variance);
  state.position = position;
  state.felt[0] = position;
  state.told = needed_torque(c, load, position, S(0));
  state.torque = state.told;
  for (std::uint32_t i = 0; i < max_reaching_delay; ++i) {
    state.expected_position[i] = state.seen_position[i] = position;
    state.excitation[i] = state.told;
  }
  return state;
}

/// x, or what else there is where it is no number of that size.
template <class S> S within(const S& x, const S& most, const S& otherwise) noexcept {
  return select(abs(x) <= most, x, otherwise);
}

/// A new target. What came unexpected in the movement that ends here counts from now on.
template <class S> void aim(const OptimalReachingCoefficients<S>& c, OptimalReachingState<S>& state,
                            const ReachingTask<S>& task) noexcept {
  const OptimalReachingParams<S>& p = c.params;
  const S moved = state.time - state.reaction;
  const S usual = p.uncertainty * p.uncertainty;
  const S came = select(moved > S(0), state.surprise / select(moved > S(0), moved, S(1)), S(0));
  const S learnt = state.variance + p.uncertainty_share * (usual + came - state.variance);
  state.variance = select(moved > S(0), learnt, state.variance);
  state.surprise = S(0);
  const S aimed = select(state.time >= state.reaction, state.target, state.origin);
  state.origin = select(state.resting > S(0), state.rest, aimed);
  state.resting = S(0);
  state.time = S(0);
  const S most = S(1000), none = S(0);
  state.target = within(task.target, most, state.origin);
  state.duration = within(task.duration, most, state.duration);
  state.reaction = within(task.reaction, most, none);
  state.load = {within(task.load.inertia, most, none), within(task.load.viscous, most, none),
                within(task.load.coulomb, most, none), within(task.load.gravity_sine, most, none),
                within(task.load.gravity_cosine, most, none)};
  state.policy = policy(c, state.load, state.target - state.origin, state.target, state.duration, state.variance);
}

/// Return the arm's goal: its initial position until the reaction, then the target, and its resting position after it
/// stopped inside the target.
template <class S> S goal(const OptimalReachingCoefficients<S>& c, OptimalReachingState<S>& state) noexcept {
  const S error = abs(state.position - state.target);
  const mask_t<S> over = state.time > state.reaction + state.duration;
  const mask_t<S> rests = error + state.policy.moving_time * abs(state.velocity) <= c.params.tolerance;
  const mask_t<S> rested = both(state.resting > S(0), error <= c.params.tolerance);
  state.rest = select(rested, state.rest, state.position);
  const mask_t<S> resting = either(rested, both(over, rests));
  state.resting = select(resting, S(1), S(0));
  return select(resting, state.rest, select(state.time >= state.reaction, state.target, state.origin));
}

/// One period of an arm that is at a position and moves at a velocity; `flexor_noise` and `extensor_noise` are standard
/// normal numbers. What no arm can be is not felt.
template <class S>
ReachingOutput<S> step(const OptimalReachingCoefficients<S>& c, OptimalReachingState<S>& state, const S& position,
                       const S& velocity, const S& flexor_noise, const S& extensor_noise) noexcept {
  const OptimalReachingParams<S>& p = c.params;
  const ReachingPolicy<S>& how = state.policy;
  const auto before = [&state](std::uint32_t periods) {
    return (state.at + max_reaching_delay - periods) % max_reaching_delay;
  };
  state.at = (state.at + 1) % max_reaching_delay;
  state.seen_position[state.at] = position;
  state.seen_velocity[state.at] = velocity;

  // What is felt now was so a while ago; nobody is more surprised than by half a turn.
  const std::uint32_t felt = before(c.feedback_delay), then = before(c.loop_delay);
  const S half_turn = S(3.14159265), fastest = S(100), none = S(0), most = S(1000);
  const S news[2] = {clamp(within(state.seen_position[felt] - state.felt[0], most, none), -half_turn, half_turn),
                     clamp(within(state.seen_velocity[felt] - state.felt[1], most, none), -fastest, fastest)};
  for (int i = 0; i < 3; ++i) state.felt[i] = state.felt[i] + how.belief[i][0] * news[0] + how.belief[i][1] * news[1];
  state.position = state.position + how.now[0][0] * news[0] + how.now[0][1] * news[1];
  state.velocity = state.velocity + how.now[1][0] * news[0] + how.now[1][1] * news[1];
  const S unexpected = clamp(state.felt[2], -p.extension_max, p.flexion_max);
  state.felt[2] = unexpected;
  state.expected_position[state.at] = state.position;
  state.expected_velocity[state.at] = state.velocity;
  state.own_torque[state.at] = state.wanted;
  state.surprise = state.surprise + select(state.time >= state.reaction, p.period * unexpected * unexpected, S(0));

  // Told now what is to be there when it arrives, and by how much the muscles' lag will have fallen behind.
  const S wanted = state.wanted + needed_torque(c, state.load, state.position, state.velocity);
  state.excitation[state.at] =
      clamp(state.told + c.inverse_activation * (wanted - state.told), -p.extension_max, p.flexion_max);
  state.told = wanted;
  state.torque = state.torque + c.activation * (state.excitation[before(c.muscle_delay)] - state.torque);

  // From there on the cheapest torque; what comes unexpected is taken for a part of it.
  const S error = state.position - goal(c, state);
  const S net = state.wanted + unexpected;
  const mask_t<S> moves = both(state.time >= state.reaction, state.time <= state.reaction + state.duration);
  S gain[4];
  for (int i = 0; i < 4; ++i) gain[i] = select(moves, how.moving[i], how.holding[i]);
  const S rough = -(gain[0] * error + gain[1] * state.velocity + gain[2] * net + gain[3] * state.rate);
  const S acceleration = net * how.inverse_inertia;
  state.position = state.position + p.period * (state.velocity + S(0.5) * p.period * acceleration);
  state.velocity = state.velocity + p.period * acceleration;
  state.wanted = state.wanted + p.period * (state.rate + S(0.5) * p.period * rough);
  state.rate = state.rate + p.period * rough;

  // And what was felt, on by a period of what the muscles did then.
  const S drive = state.felt[2] + state.own_torque[then] + how.stiffness * state.expected_position[then] +
                  how.damping * state.expected_velocity[then];
  const S felt_position = state.felt[0], felt_velocity = state.felt[1];
  for (std::size_t i = 0; i < 2; ++i)
    state.felt[i] = how.transition.at[i][0] * felt_position + how.transition.at[i][1] * felt_velocity +
                    how.transition.at[i][2] * drive;

  state.noise[0] = c.noise_pole * state.noise[0] + c.noise_gain * within(flexor_noise, most, none);
  state.noise[1] = c.noise_pole * state.noise[1] + c.noise_gain * within(extensor_noise, most, none);
  const S flexion = max(state.torque, S(0)) + how.cocontraction * p.flexion_max;
  const S extension = max(-state.torque, S(0)) + how.cocontraction * p.extension_max;
  const std::uint32_t here = before(c.muscle_delay);
  const S phasic = p.phasic_noise_share * state.own_torque[here];
  const S shaken = (p.noise_share * flexion + max(phasic, S(0))) * state.noise[0] -
                   (p.noise_share * extension + max(-phasic, S(0))) * state.noise[1];
  const S own = how.stiffness * within(state.expected_position[here] - position, most, none) +
                how.damping * within(state.expected_velocity[here] - velocity, most, none);

  ReachingOutput<S> out;
  out.torque = state.torque + shaken + own;
  const S excited = state.excitation[state.at];
  out.flexor = min(max(excited, S(0)) / p.flexion_max + how.cocontraction, S(1));
  out.extensor = min(max(-excited, S(0)) / p.extension_max + how.cocontraction, S(1));
  out.planned = state.expected_position[here];
  state.time = state.time + p.period;
  return out;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
