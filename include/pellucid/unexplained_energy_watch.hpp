// Whether a drive adds energy that neither its command nor the wearer gives. It needs a force sensor.
//
// With inertia J, velocity v, gravity effort w, commanded effort u, sensed interaction torque F and known friction f,
//
//   E' = (J v²/2)' + (w + sure f - u - F) v - (gain |F| + offset) |v| - E/T,   E >= 0
//
// is the energy that the joint gained and that nobody accounts for. It is a passivity observer (B. Hannaford and J.-H.
// Ryu, IEEE Transactions on Robotics and Automation 18(1), 2002) on what the drive does beside its command. A wrong
// inertia or weight of the model lends energy and takes it back, so that a limit of E covers it whatever the motion.
// Friction is counted as far as the model is sure of it, and errors of the sensor as far as they are stated, so that none
// of them adds to E. Somebody who pushes the robot beside its sensor adds to E, too. An end stop returns what it was given:
// beyond the law's range of positions E only falls.
//
// Inertia and motion are squared and compared as they are, not through the momentum observer: what its lag of 25 ms adds
// to a healthy joint's E is more than twice as much.
#pragma once

#include "body_residual.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct UnexplainedEnergyParams {
  S limit = S(std::numeric_limits<S>::infinity()), gain{}, offset{}, memory = S(0.1);

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.limit, {"unexplained_limit", unit::energy, above(0).or_infinite(),
                    "energy that neither command nor force sensor explains; infinite: any"});
    visit(p.gain, {"unexplained_gain", unit::one, share(), "largest relative error of the force sensor"});
    visit(p.offset, {"unexplained_offset", unit::effort, at_least(0),
                     "offset of force sensor and model that adds no energy"});
    visit(p.memory, {"unexplained_memory", unit::rate, above(0),
                     "rate at which such energy is forgotten. Times the period below 1"});
  }
};

/// Coefficients computed once from UnexplainedEnergyParams and the period.
template <class S> struct UnexplainedEnergyCoefficients {
  UnexplainedEnergyParams<S> params{};  ///< as they are
  S period{};                           ///< [s]
  S keeping{};                          ///< share of the energy that a period leaves [1]
  std::uint32_t valid = 0;              ///< 1: the parameters make sense
};

template <class S>
UnexplainedEnergyCoefficients<S> coefficients(const UnexplainedEnergyParams<S>& p, const S& period) noexcept {
  UnexplainedEnergyCoefficients<S> c{p, period, S(1) - p.memory * period, 0};
  c.valid = is_sound(p) && c.keeping > S(0) ? 1 : 0;
  return c;
}

template <class S> struct UnexplainedEnergyState {
  S energy{};            ///< E [J]
  S kinetic{};           ///< kinetic energy, the period before [J]
  bool started = false;  ///< false until the first period
};

/// One period of a joint under an effort that moves with a velocity, while a force sensor says `felt`. `body` is what
/// the momentum observer made of the same period. No number is a fault.
template <class S>
SafetyFault step(const UnexplainedEnergyCoefficients<S>& c, UnexplainedEnergyState<S>& s,
                 const BodyResidualCoefficients<S>& of, const BodyResidualState<S>& body, const S& velocity,
                 const S& effort, const S& felt) noexcept {
  if (!is_finite(c.params.limit)) return SafetyFault::none;
  const S speed = abs(velocity);
  const S kinetic = S(0.5) * of.params.inertia * velocity * velocity;
  const S friction = body.drag - body.level * (S(1) - min(speed * of.inverse_width, S(1)));
  const S accuracy = c.params.gain * abs(felt) + c.params.offset;
  const S gained = s.started ? kinetic - s.kinetic : S(0);
  const S power = (body.weight - effort - felt) * velocity + (S(known_friction) * friction - accuracy) * speed;
  const S energy = c.keeping * s.energy + gained + c.period * power;
  const S counted = body.at_stop ? min(energy, s.energy) : energy;
  s.energy = is_finite(energy + kinetic) ? max(counted, S(0)) : S(std::numeric_limits<S>::infinity());
  s.kinetic = kinetic;
  s.started = true;
  return s.energy <= c.params.limit ? SafetyFault::none : SafetyFault::unexplained_energy;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
