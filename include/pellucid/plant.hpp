// A joint under its own controller: what a rig does in one control period.
//
// The loop reads the encoder once a period and holds its command; the joint moves in substeps of semi-implicit Euler,
//   v <- v + h a(q, v),   q <- q + h v.
// Friction is smooth (tanh; differentiable, so that it can be identified through) or true stiction, which holds a
// joint still, to the bit, under less than its breakaway effort. With a presliding travel it gives before it slips,
// whichever of the two it is otherwise: nothing is reset and nothing jumps, so that dual numbers may pass.
#pragma once

#include "drive.hpp"
#include "joint.hpp"
#include "loops.hpp"
#include "presliding.hpp"
#include "sensor.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

enum class Friction : std::uint8_t {
  smooth,    ///< FrictionParams as they are
  stiction,  ///< the true sign whatever velocity_width is, and rest is rest; not differentiable
};

template <class S> struct PlantParams {
  JointParams<S> joint{};            ///< the mechanism
  DriveParams<S> drive{};            ///< dynamics from command to effort
  LoopParams<S> loop{};              ///< the controller, and the control period
  EncoderParams<S> encoder{};        ///< the controller's encoder
  std::uint32_t substeps = 4;        ///< integration steps per control period, >= 1
  PreslidingParams<S> presliding{};  ///< presliding of the joint's friction; a travel of 0: it slips at once
};

/// Coefficients computed once from PlantParams.
template <class S> struct PlantCoefficients {
  JointCoefficients<S> joint{};            ///< the mechanism
  DriveCoefficients<S> drive{};            ///< dynamics from command to effort
  LoopCoefficients<S> loop{};              ///< the controller
  EncoderCoefficients<S> encoder{};        ///< the controller's encoder
  S substep{};                             ///< h [s]
  std::uint32_t substeps = 4;              ///< per control period
  PreslidingCoefficients<S> presliding{};  ///< presliding of the joint's friction
};

template <class S> PlantCoefficients<S> coefficients(const PlantParams<S>& params) noexcept {
  PlantCoefficients<S> c;
  c.joint = coefficients(params.joint);
  c.drive = coefficients(params.drive);
  c.loop = coefficients(params.loop);
  c.encoder = coefficients(params.encoder);
  c.presliding = coefficients(params.presliding);
  c.substeps = params.substeps > 0 ? params.substeps : 1;
  c.substep = params.loop.period / S(static_cast<value_t<S>>(c.substeps));
  return c;
}

template <class S> struct PlantState {
  S position{};                     ///< q [rad]
  S velocity{};                     ///< v [rad/s]
  LoopState<S> loop{};              ///< state of the controller
  PreslidingState<S> presliding{};  ///< state of the contacts
};

/// Inputs of a plant in each period.
template <class S> struct PlantInput {
  S reference{};      ///< reference of the loop [rad]; velocity_pi [rad/s]; none: the command [u]
  S injected{};       ///< added to the command after the limit [u]
  S disturbance{};    ///< effort on the joint from outside [N m]
  S encoder_noise{};  ///< added to the measured position [rad]
};

/// Values at the start of the period.
template <class S> struct PlantOutput {
  S position{};           ///< q [rad]
  S velocity{};           ///< v [rad/s]
  S acceleration{};       ///< a [rad/s^2]
  S command{};            ///< u, limited, with what was injected [u]
  S effort{};             ///< k u - k_e v, without ripple and disturbance: what a current sensor sees [N m]
  S measured_position{};  ///< reading of the encoder [rad]
};

/// Acceleration at (q, v) [rad/s^2]; `rests` becomes true where stiction holds the joint, at v = 0, under this effort.
template <Friction mode, class S>
S acceleration(const PlantCoefficients<S>& c, const S& position, const S& velocity, const PreslidingState<S>& contacts,
               const S& command, const S& disturbance, mask_t<S>& rests) noexcept {
  const S gravity_effort = gravity(c.joint, position);
  const S outside = ripple(c.drive, position) + disturbance;
  const S effort = drive_effort(c.drive, command, velocity) + outside;
  S at_once{};
  if constexpr (mode == Friction::smooth) {
    at_once = acceleration(c.joint, gravity_effort, resistance(c.joint.friction, velocity), effort);
  } else {
    at_once = acceleration(c.joint, gravity_effort, velocity, effort, c.drive.params.gain * command + outside, rests);
  }
  if (!c.presliding.any_gives) return at_once;
  rests = both(rests, !c.presliding.gives);
  const Resistance<S> bent = bent_resistance(c.joint.friction, velocity, direction(contacts));
  return select(c.presliding.gives, acceleration(c.joint, gravity_effort, bent, effort), at_once);
}

/// One control period.
template <Friction mode, class S>
PlantOutput<S> step(const PlantCoefficients<S>& c, PlantState<S>& state, const PlantInput<S>& input) noexcept {
  static_assert(mode == Friction::smooth || ScalarTraits<S>::is_real,
                "stiction resets the velocity, which would drop its derivative: identify with smooth friction");
  PlantOutput<S> out;
  out.position = state.position;
  out.velocity = state.velocity;
  out.measured_position = step(c.encoder, state.position, input.encoder_noise);
  out.command =
      step(c.loop, state.loop, LoopInput<S>{input.reference, out.measured_position, state.velocity}) + input.injected;
  out.effort = drive_effort(c.drive, out.command, state.velocity);

  S q = state.position;
  S v = state.velocity;
  for (std::uint32_t i = 0; i < c.substeps; ++i) {
    mask_t<S> rests{};
    const S a = acceleration<mode>(c, q, v, state.presliding, out.command, input.disturbance, rests);
    if (i == 0) out.acceleration = a;
    S next = v + c.substep * a;
    if constexpr (mode == Friction::stiction) next = stick(rests, v, next);
    v = next;
    q = q + c.substep * v;
    if (c.presliding.any_gives) step(c.presliding, state.presliding, c.substep * v);
  }
  state.position = q;
  state.velocity = v;
  return out;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
