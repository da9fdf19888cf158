// The torque on a body that its model and its command do not explain: what the wearer gives, or what a fault does.
//
//   r = w (J v - p),   p' = u - G(q) - f(v) + r
//
// An observer of the generalised momentum (A. De Luca, R. Mattone, ICRA 2005): it needs the velocity, no acceleration.
// At rest friction may be anything up to its level, and so may r; in motion it is known but for a share. A fault is only
// what lies beyond. Beyond the law's range of positions an end stop may hold the joint back, with whatever r or the force
// sensor would need.
#pragma once

#include "friction.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct BodyResidualParams {
  S inertia{}, gravity_sine{}, gravity_cosine{}, offset{}, coulomb{}, load{}, viscous{}, square_root{}, width = S(0.1),
    bandwidth = S(40), slow = S(5), wearer_torque = S(std::numeric_limits<S>::infinity()),
    wearer_push = wearer_torque, force_tolerance = wearer_torque, force_burst = wearer_torque,
    force_excess = wearer_torque;

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.inertia, {"body_inertia", unit::inertia, at_least(0),
                      "J of the robot alone; 0: no model, nothing is checked"});
    visit(p.gravity_sine, {"body_gravity_sine", unit::effort, any_number(), "gravity effort per sin q"});
    visit(p.gravity_cosine, {"body_gravity_cosine", unit::effort, any_number(), "gravity effort per cos q"});
    visit(p.offset, {"body_offset", unit::effort, any_number(), "effort that is always there"});
    visit(p.coulomb, {"body_coulomb", unit::effort, at_least(0), "friction's level, its rise towards rest included"});
    visit(p.load, {"body_load", unit::one, share(), "friction per load"});
    visit(p.viscous, {"body_viscous", unit::viscous, at_least(0), "friction per velocity"});
    visit(p.square_root, {"body_square_root", unit::root_viscous, at_least(0), "friction per root of the speed"});
    visit(p.width, {"body_width", unit::velocity, above(0), "velocity over which friction changes its sign"});
    visit(p.bandwidth, {"residual_bandwidth", unit::rate, above(0), "w of the observer; times the period below 1"});
    visit(p.slow, {"residual_slow", unit::rate, above(0),
                   "rate of the low-pass that defines a lasting residual; times the period below 1"});
    visit(p.wearer_torque, {"wearer_torque", unit::effort, above(0).or_infinite(),
                            "the most that a wearer gives lastingly, beyond friction; infinite: not checked"});
    visit(p.wearer_push, {"wearer_push", unit::effort, above(0).or_infinite(),
                          "the most that a wearer gives at once, beyond friction; infinite: not checked"});
    visit(p.force_tolerance, {"force_tolerance", unit::effort, above(0).or_infinite(),
                              "lasting difference from the force sensor beyond friction; infinite: not checked"});
    visit(p.force_burst, {"force_burst", unit::effort, above(0).or_infinite(),
                          "difference at once from the force sensor beyond friction; infinite: not checked"});
    visit(p.force_excess, {"force_excess", unit::effort, above(0).or_infinite(),
                           "lasting excess of the sensor over 1.5 times the residual; infinite: not checked"});
  }
};

constexpr double known_friction = 0.7;  ///< share of a moving joint's friction that the model is sure of [1]
constexpr double louder = 1.5;          ///< than the residual, a force sensor whose gain is right is not [1]
constexpr double louder_slow = 0.1;     ///< how slowly that is judged, of what lasts [1]

/// Coefficients computed once from BodyResidualParams and the period.
template <class S> struct BodyResidualCoefficients {
  BodyResidualParams<S> params{};  ///< as they are
  S period{};                      ///< [s]
  S inverse_width{};               ///< [s/rad]
  S following{};                   ///< share of a new force in what is as late as the residual [1]
  S smoothing{};                   ///< share of a new residual in what lasts [1]
  S lowest = -S(std::numeric_limits<S>::infinity());  ///< position below which an end stop may push up [rad]
  S highest = S(std::numeric_limits<S>::infinity());  ///< position above which one may push down [rad]
  bool checks = false;             ///< whether there is a model
  bool valid = false;              ///< whether the parameters make sense
};

template <class S>
BodyResidualCoefficients<S> coefficients(const BodyResidualParams<S>& p, const S& period) noexcept {
  BodyResidualCoefficients<S> c;
  c.params = p;
  c.period = period;
  c.inverse_width = S(1) / p.width;
  c.following = p.bandwidth * period;
  c.smoothing = p.slow * period;
  c.checks = p.inertia > S(0);
  c.valid = is_sound(p) && p.bandwidth * period < S(1) && c.smoothing < S(1);
  return c;
}

template <class S> struct BodyResidualState {
  S momentum{};          ///< p [N m s]
  S residual{};          ///< r [N m]
  S stop{};              ///< the part of r that an end stop may give [N m]
  S stop_beside_felt{};  ///< the same of r less what the force sensor says [N m]
  S push{};              ///< r without a stop's part [N m]
  S lasting{};           ///< its slow part [N m]
  S felt{};              ///< what the force sensor says, as late as r [N m]
  S burst{};             ///< r less that, without a stop's part [N m]
  S contradiction{};     ///< its slow part [N m]
  S excess{};            ///< by how much the sensor is too loud, over seconds [N m]
  S level{};             ///< friction at most, at rest under this load [N m]
  S drag{};              ///< friction at most, at this speed under this load [N m]
  S open{};              ///< slow part of the friction that is not known [N m]
  S weight{};            ///< gravity effort, now [N m]
  bool at_stop = false;  ///< whether an end stop may push the joint
  bool started = false;  ///< false until the first sample
};

/// An effort less what an end stop gives of it, which points `inwards`, 0 within the range. `part` is the stop's, and fades
/// from the effort as it does from the residual.
template <class S> S without_stop(const BodyResidualCoefficients<S>& c, S effort, S inwards, S& part) noexcept {
  part = inwards * effort > S(0) ? effort : part - c.following * part;
  return effort - part;
}

/// One period of a body under an effort; `felt` is what a force sensor says, if it is `sensed`.
template <class S> void step(const BodyResidualCoefficients<S>& c, BodyResidualState<S>& s, const S& position,
                             const S& velocity, const S& effort, const S& felt, bool sensed) noexcept {
  const BodyResidualParams<S>& p = c.params;
  const SinCos<S> at = sincos(position);
  s.weight = p.gravity_sine * at.sin + p.gravity_cosine * at.cos + p.offset;
  s.level = p.coulomb + p.load * abs(s.weight);
  const S direction = clamp(velocity * c.inverse_width, S(-1), S(1));
  const S speed = abs(velocity);
  S sliding = p.viscous * speed;
  if (p.square_root > S(0)) sliding = sliding + p.square_root * sqrt(speed);
  const S resisted = s.level * direction + (velocity < S(0) ? -sliding : sliding);
  s.drag = s.level + sliding;
  if (!s.started) {
    s.momentum = p.inertia * velocity;
    s.open = s.level;
    s.started = true;
  }
  s.momentum = s.momentum + c.period * (effort - s.weight - resisted + s.residual);
  s.residual = p.bandwidth * (p.inertia * velocity - s.momentum);
  s.felt = s.felt + c.following * ((sensed ? felt : S(0)) - s.felt);
  s.burst = sensed ? s.residual - s.felt : S(0);
  const S inwards = position > c.highest ? S(-1) : position < c.lowest ? S(1) : S(0);
  s.at_stop = inwards != S(0);
  s.push = without_stop(c, s.residual, inwards, s.stop);
  s.burst = without_stop(c, s.burst, inwards, s.stop_beside_felt);
  s.lasting = s.lasting + c.smoothing * (s.push - s.lasting);
  s.open = s.open + c.smoothing * (s.level * (S(1) - S(known_friction) * abs(direction)) - s.open);
  s.contradiction = s.contradiction + c.smoothing * (s.burst - s.contradiction);
  const S loud = sensed ? abs(s.felt) - S(louder) * abs(s.residual - s.stop_beside_felt) : S(0);
  s.excess = s.excess + S(louder_slow) * c.smoothing * (loud - s.excess);
  if (!is_finite(s.momentum + s.residual + s.lasting + s.contradiction + s.felt + s.excess + s.stop + s.stop_beside_felt)) s = {};
}

/// Fault that the residual shows, if any: `force_sensor` where that sensor alone contradicts it.
template <class S> SafetyFault shown(const BodyResidualCoefficients<S>& c, const BodyResidualState<S>& s) noexcept {
  const BodyResidualParams<S>& p = c.params;
  if (!(abs(s.lasting) <= p.wearer_torque + s.open) || !(abs(s.push) <= p.wearer_push + s.level))
    return SafetyFault::unexplained;
  const bool agrees = abs(s.contradiction) <= p.force_tolerance + s.open && abs(s.burst) <= p.force_burst + s.level &&
                      s.excess <= p.force_excess;
  return agrees ? SafetyFault::none : SafetyFault::force_sensor;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
