// How a person moves a forearm to a target: a plan, corrected now and then, carried out by two muscles with delays.
//
// The plan is a smooth primary movement that falls a little short, and corrections as the eye sees them needed. What the
// muscles are told is what the person expects the arm, and what is strapped to it, to need; in addition the stretch
// reflex answers, late, to where the arm is off the plan, and so does the muscles' own stiffness, at once. Muscles
// follow their excitation with a delay and a lag, and are the noisier the harder they pull.
#pragma once

#include "limb.hpp"
#include "minimum_jerk.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

constexpr std::uint32_t max_reaching_delay = 256;   // periods
constexpr std::uint32_t max_submovements = 16;

/// The load that a person expects of what is strapped on, by how the arm moves.
template <class S> struct ExpectedLoad {
  S inertia{};         ///< [kg m^2]
  S viscous{};         ///< [N m s/rad]
  S coulomb{};         ///< [N m]
  S gravity_sine{};    ///< [N m]
  S gravity_cosine{};  ///< [N m]
};

template <class S> struct ReachingParams {
  static constexpr const char* model = "reaching";
  LimbParams<S> limb{};  ///< the person's internal model of the arm
  S stiffness{}, damping{}, reflex_stiffness{}, reflex_damping{}, reflex_delay{}, muscle_delay{}, activation_time{},
      flexion_max{}, extension_max{}, cocontraction{}, noise_share{}, noise_time{}, visual_delay{}, tolerance{},
      check_share{}, correction_share{}, correction_least{}, sign_width{}, period{};

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    pellucid::walk(p.limb, visit);
    visit(p.stiffness, {"stiffness", unit::stiffness, at_least(0), "stiffness of the muscles"});
    visit(p.damping, {"damping", unit::viscous, at_least(0), "damping of the muscles"});
    visit(p.reflex_stiffness, {"reflex_stiffness", unit::stiffness, at_least(0), "stiffness of the stretch reflex"});
    visit(p.reflex_damping, {"reflex_damping", unit::viscous, at_least(0), "damping of the stretch reflex"});
    visit(p.reflex_delay, {"reflex_delay", unit::time, at_least(0), "delay from stretch to excitation"});
    visit(p.muscle_delay, {"muscle_delay", unit::time, at_least(0), "delay from excitation to the first force"});
    visit(p.activation_time, {"activation_time", unit::time, above(0), "lag of the force behind that"});
    visit(p.flexion_max, {"flexion_max", unit::effort, above(0), "strongest torque of the flexors"});
    visit(p.extension_max, {"extension_max", unit::effort, above(0), "largest torque of the extensors"});
    visit(p.cocontraction, {"cocontraction", unit::one, at_least(0), "excitation that both always have"});
    visit(p.noise_share, {"noise_share", unit::one, at_least(0),
                          "standard deviation of a muscle's torque over the torque"});
    visit(p.noise_time, {"noise_time", unit::time, above(0), "time over which that noise changes"});
    visit(p.visual_delay, {"visual_delay", unit::time, at_least(0), "delay from the arm's position to a correction"});
    visit(p.tolerance, {"tolerance", unit::coordinate, at_least(0), "error that is left as it is"});
    visit(p.check_share, {"check_share", unit::one, at_least(0),
                          "time of the first correction, as a share of the primary movement's duration"});
    visit(p.correction_share, {"correction_share", unit::one, at_least(0),
                               "a correction's duration, of the primary movement's"});
    visit(p.correction_least, {"correction_least", unit::time, at_least(0), "a correction's least duration"});
    visit(p.sign_width, {"sign_width", unit::velocity, above(0),
                         "velocity over which expected friction changes its sign"});
    visit(p.period, {"period", unit::time, above(0), "between two steps"});
  }
};

constexpr std::size_t reaching_parameter_count = field_count<ReachingParams<double>>;

/// Coefficients computed once from ReachingParams.
template <class S> struct ReachingCoefficients {
  ReachingParams<S> params{};      ///< as they are
  LimbCoefficients<S> limb{};      ///< the person's internal model of the arm
  std::uint32_t reflex_delay = 0;  ///< periods
  std::uint32_t muscle_delay = 0;  ///< periods
  std::uint32_t visual_delay = 0;  ///< periods
  S activation{};                  ///< share of a new excitation, a period [1]
  S noise_pole{};                  ///< pole of the noise [1]
  S noise_gain{};                  ///< so that its variance is 1 [1]
  S inverse_sign_width{};          ///< [s/rad]
};

/// A delay in periods; of several lanes the longest.
template <class S> std::uint32_t delay_periods(const S& delay, const S& period) noexcept {
  const S periods = round(delay / period);
  std::uint32_t count = 0;
  while (count < max_reaching_delay - 1 && any(periods > S(static_cast<value_t<S>>(count)))) ++count;
  return count;
}

template <class S> ReachingCoefficients<S> coefficients(const ReachingParams<S>& p) noexcept {
  ReachingCoefficients<S> c;
  c.params = p;
  c.limb = coefficients(p.limb);
  c.reflex_delay = delay_periods(p.reflex_delay, p.period);
  c.muscle_delay = delay_periods(p.muscle_delay, p.period);
  c.visual_delay = delay_periods(p.visual_delay, p.period);
  c.activation = S(1) - exp(-p.period / p.activation_time);
  c.noise_pole = exp(-p.period / p.noise_time);
  c.noise_gain = sqrt(S(1) - c.noise_pole * c.noise_pole);
  c.inverse_sign_width = S(1) / p.sign_width;
  return c;
}

/// Decisions before a movement.
template <class S> struct ReachingTask {
  S target{};              ///< [rad]
  S amplitude{};           ///< amplitude of the primary movement [rad]
  S duration{};            ///< duration of the primary movement [s], > 0
  S reaction{};            ///< time to its start [s]
  ExpectedLoad<S> load{};  ///< known load
};

template <class S> struct ReachingState {
  S time{};                                        ///< since the task was given [s]
  S origin{};                                      ///< where the plan starts [rad]
  S target{};                                      ///< [rad]
  S primary_duration{};                            ///< [s]
  S next_check{};                                  ///< when a correction is next decided [s]
  ExpectedLoad<S> load{};                          ///< expected load
  MinimumJerk<S> submovements[max_submovements]{};  ///< submovements of the plan
  std::uint32_t count = 0;                         ///< number of submovements
  S expected{};                                    ///< torque that the plan needed last [N m]
  S excitation[max_reaching_delay]{};              ///< on its way to the muscle, in a ring [N m]
  S position_error[max_reaching_delay]{};          ///< plan less arm, in a ring [rad]
  S velocity_error[max_reaching_delay]{};          ///< [rad/s]
  std::uint32_t now = 0;                           ///< where the rings are
  S torque{};                                      ///< torque of the muscles, without noise [N m]
  S noise[2]{};                                    ///< noise of flexors and extensors [1]
};

/// Torques of the muscles in a period.
template <class S> struct ReachingOutput {
  S torque{};    ///< torque of the muscles on the arm [N m]
  S flexor{};    ///< excitation, 0 to 1
  S extensor{};  ///< excitation, 0 to 1
  S planned{};   ///< where the plan is [rad]
};

/// The plan at a time.
template <class S> PlannedMotion<S> planned(const ReachingState<S>& state, const S& time) noexcept {
  PlannedMotion<S> sum{state.origin, S(0), S(0)};
  for (std::uint32_t i = 0; i < state.count; ++i) {
    const PlannedMotion<S> one = at(state.submovements[i], time);
    sum.position = sum.position + one.position;
    sum.velocity = sum.velocity + one.velocity;
    sum.acceleration = sum.acceleration + one.acceleration;
  }
  return sum;
}

/// Torque that a motion is expected to need, of the arm and of what is strapped to it [N m]. `Person` is any model's
/// coefficients.
template <class Person, class S>
S expected_torque(const Person& c, const ExpectedLoad<S>& load, const PlannedMotion<S>& m) noexcept {
  const SinCos<S> angle = sincos(m.position);
  const S arm = c.params.limb.inertia * m.acceleration + c.limb.viscous * m.velocity + gravity(c.limb, m.position) -
                passive_torque(c.limb, m.position);
  return arm + load.inertia * m.acceleration + load.viscous * m.velocity +
         load.coulomb * tanh(m.velocity * c.inverse_sign_width) + load.gravity_sine * angle.sin +
         load.gravity_cosine * angle.cos;
}

/// A person who holds an arm still at an angle, expecting a load.
template <class S> ReachingState<S> holding(const ReachingCoefficients<S>& c, const S& position,
                                            const ExpectedLoad<S>& load) noexcept {
  ReachingState<S> state;
  state.origin = position;
  state.target = position;
  state.load = load;
  state.next_check = S(1e9);
  state.expected = expected_torque(c, load, PlannedMotion<S>{position, S(0), S(0)});
  state.torque = state.expected;
  for (S& e : state.excitation) e = state.expected;
  return state;
}

/// A new target. The plan goes on from where it has come to.
template <class S> void aim(const ReachingCoefficients<S>& c, ReachingState<S>& state,
                            const ReachingTask<S>& task) noexcept {
  // Everything planned before has ended, or ends here: targets are given to people at rest.
  state.origin = planned(state, S(1e9)).position;
  state.count = 1;
  state.submovements[0] = {task.reaction, task.amplitude, task.duration};
  state.time = S(0);
  state.target = task.target;
  state.primary_duration = task.duration;
  state.next_check = task.reaction + c.params.check_share * task.duration;
  state.load = task.load;
}

/// Makes room for a correction: the oldest submovement, which has long ended, becomes part of where the plan starts.
template <class S> void retire(ReachingState<S>& state) noexcept {
  state.origin = state.origin + state.submovements[0].amplitude;
  for (std::uint32_t i = 1; i < state.count; ++i) state.submovements[i - 1] = state.submovements[i];
  --state.count;
}

/// Decides a correction, if one is due and needed.
template <class S> void correct(const ReachingCoefficients<S>& c, ReachingState<S>& state) noexcept {
  if (!(state.time >= state.next_check)) return;
  if (state.count == max_submovements) retire(state);
  const std::uint32_t seen = (state.now + max_reaching_delay - c.visual_delay) % max_reaching_delay;
  // Where the plan will end, less by how much the arm was seen to be behind it.
  const S end = planned(state, S(1e9)).position - state.position_error[seen];
  const S error = state.target - end;
  state.next_check = state.time + c.params.visual_delay;
  if (!(abs(error) > c.params.tolerance)) return;
  const S duration = max(c.params.correction_share * state.primary_duration, c.params.correction_least);
  state.submovements[state.count] = {state.time, error, duration};
  ++state.count;
  state.next_check = state.time + duration + c.params.visual_delay;
}

/// One period of an arm that is at a position and moves at a velocity; `flexor_noise` and `extensor_noise` are standard
/// normal numbers.
template <class S> ReachingOutput<S> step(const ReachingCoefficients<S>& c, ReachingState<S>& state, const S& position,
                                          const S& velocity, const S& flexor_noise, const S& extensor_noise) noexcept {
  const ReachingParams<S>& p = c.params;
  const PlannedMotion<S> now = planned(state, state.time);
  state.now = (state.now + 1) % max_reaching_delay;
  state.position_error[state.now] = now.position - position;
  state.velocity_error[state.now] = now.velocity - velocity;
  correct(c, state);

  // Told now what is needed when it arrives, and a lag's worth more of its change.
  const S ahead = state.time + S(static_cast<value_t<S>>(c.muscle_delay)) * p.period;
  const S expected = expected_torque(c, state.load, planned(state, ahead));
  const S told = expected + (p.activation_time / p.period) * (expected - state.expected);
  state.expected = expected;
  const std::uint32_t felt = (state.now + max_reaching_delay - c.reflex_delay) % max_reaching_delay;
  const S reflex = p.reflex_stiffness * state.position_error[felt] + p.reflex_damping * state.velocity_error[felt];
  state.excitation[state.now] = clamp(told + reflex, -p.extension_max, p.flexion_max);

  const std::uint32_t arrived = (state.now + max_reaching_delay - c.muscle_delay) % max_reaching_delay;
  state.torque = state.torque + c.activation * (state.excitation[arrived] - state.torque);
  state.noise[0] = c.noise_pole * state.noise[0] + c.noise_gain * flexor_noise;
  state.noise[1] = c.noise_pole * state.noise[1] + c.noise_gain * extensor_noise;
  const S flexion = max(state.torque, S(0)) + p.cocontraction * p.flexion_max;
  const S extension = max(-state.torque, S(0)) + p.cocontraction * p.extension_max;
  const S shaken = p.noise_share * (flexion * state.noise[0] - extension * state.noise[1]);
  const S own = p.stiffness * state.position_error[state.now] + p.damping * state.velocity_error[state.now];

  ReachingOutput<S> out;
  out.torque = state.torque + shaken + own;
  const S wanted = state.excitation[state.now];
  out.flexor = min(max(wanted, S(0)) / p.flexion_max + p.cocontraction, S(1));
  out.extensor = min(max(-wanted, S(0)) / p.extension_max + p.cocontraction, S(1));
  out.planned = now.position;
  state.time = state.time + p.period;
  return out;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
