// What a control law is, and the front that its samples pass on a robot, in the lab and from Python alike.
//
// A law is a struct L<S> with
//   Params, Coefficients, State   of its own; Params ends with a SafetyParams `gate`, whose period is the law's,
//                                 Coefficients and State each have a `gate` of the last step
//   name, type, title             in export and study files, in C++ and Python, in a few words
//   sensors                       what it reads: an array of SensorUse, the position first
// and, found by their arguments,
//   Coefficients coefficients(const Params&)                   gate.valid is false where the parameters make no sense
//   S step(const Coefficients&, State&, const Samples<S>&)     one control period: an effort that passed the gate
//   void reset(State&)                                         opens the gate again
// The list of all laws is laws.hpp. A law lives in a header with its type's name.
#pragma once

#include "safety.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// Quantities that may be measured on a robot and its wearer.
enum class Quantity : std::uint8_t {
  position,     ///< angle of the joint's encoder
  torque,       ///< torque of the spring, or of the drive, on the joint
  interaction,  ///< torque of the wearer on the robot
  muscle,       ///< torque of the wearer's muscles at the joint
};

/// In words.
struct QuantityText {
  const char* name;     ///< in C and in Python
  Unit unit;            ///< SI
  const char* meaning;  ///< for the engineer
};
constexpr QuantityText quantities[] = {
    {"position", unit::coordinate, "the joint's encoder, with zero and sign as in the recordings"},
    {"torque", unit::effort, "the spring's torque on the robot"},
    {"interaction", unit::effort, "the wearer's torque on the robot, from a force sensor"},
    {"muscle", unit::effort, "the wearer's torque at the joint, from EMG"},
};
constexpr std::size_t quantity_count = sizeof quantities / sizeof *quantities;

/// A quantity that a law reads, and how.
struct SensorUse {
  Quantity quantity;  ///< the quantity
  bool required;      ///< whether the law stops without it; if not, it goes on with less
  double swing;       ///< amplitude that tests play, SI
  double noise;       ///< resolution that tests play, SI
};

/// All that may have been measured in a period; a law reads of it what its sensors say.
template <class S> struct Samples {
  Sample<S> position{}, torque{}, interaction{}, muscle{};

  constexpr Sample<S>& operator[](Quantity q) noexcept {
    return q == Quantity::position      ? position
           : q == Quantity::torque      ? torque
           : q == Quantity::interaction ? interaction
                                        : muscle;
  }
};

/// Samples of the position alone.
template <class S> constexpr Samples<S> position_only(const S& position, std::int64_t time, std::uint32_t sequence,
                                                      bool valid = true) noexcept {
  Samples<S> samples;
  samples.position = {position, time, sequence, valid};
  return samples;
}

/// The last step of every law: what was computed from these samples goes through the gate [N m].
template <class S> S guard(const SafetyCoefficients<S>& c, SafetyState<S>& state, const S& wanted, const S& velocity,
                           const Sample<S>& position) noexcept {
  return step(c, state, {wanted, position.value, velocity, position.time, position.sequence, position.valid});
}

template <class L> constexpr std::size_t sensor_count = sizeof L::sensors / sizeof *L::sensors;

/// A law behind its front: whatever is read is examined first, and what may not be believed does not reach the law.
template <class L> struct Controller {
  using Law = L;

  typename L::Coefficients law{};           ///< as configured
  typename L::State state{};                ///< state of the law
  SampleState seen[sensor_count<L>]{};      ///< state of its sensors
  SafetyFault fault = SafetyFault::none;    ///< latched, the first
  std::uint32_t steps = 0;                  ///< since it was configured
};

/// Starts with an effort of 0. False where the parameters make no sense; every step is then 0.
template <class L> bool configure(Controller<L>& c, const typename L::Params& params) noexcept {
  c = {};
  c.law = coefficients(params);
  if (!c.law.gate.valid) c.fault = c.state.gate.fault = SafetyFault::configuration;
  return c.law.gate.valid;
}

/// The first fault stays.
template <class L> void latch(Controller<L>& c, SafetyFault fault) noexcept {
  if (c.fault == SafetyFault::none) c.fault = fault;
}

/// Inputs of the law from all sensors at the time `now` [us]; a fault of one that it needs is latched.
template <class L, class S>
Samples<S> believed(Controller<L>& c, const Samples<S>& read, std::int64_t now) noexcept {
  Samples<S> samples = read;
  bool good[sensor_count<L>];
  for (std::size_t i = 0; i < sensor_count<L>; ++i) {
    const SafetyFault found = examine(c.law.gate.rules, c.seen[i], samples[L::sensors[i].quantity], now);
    good[i] = found == SafetyFault::none;
    if (L::sensors[i].required && !good[i]) latch(c, found);
  }
  for (std::size_t i = 0; i < sensor_count<L>; ++i) {
    if (good[i] && !(L::sensors[i].required && c.fault != SafetyFault::none)) continue;
    Sample<S>& sample = samples[L::sensors[i].quantity];
    sample.value = std::numeric_limits<S>::quiet_NaN();
    sample.valid = false;
  }
  return samples;
}

/// One control period: the effort for the drive, whatever comes in [N m].
template <class L, class S> S step(Controller<L>& c, const Samples<S>& read, std::int64_t now) noexcept {
  const Samples<S> samples = believed(c, read, now);
  const S effort = step(c.law, c.state, samples);
  latch(c, c.state.gate.fault);
  ++c.steps;
  return effort;
}

/// Samples that are all read just now: a sensor that says nothing starts anew when it speaks again.
template <class L, class S> Samples<S> stamped(Controller<L>& c, Samples<S> read, std::int64_t now) noexcept {
  for (std::size_t i = 0; i < sensor_count<L>; ++i) {
    Sample<S>& sample = read[L::sensors[i].quantity];
    if (!is_heard(sample)) c.seen[i] = {};
    sample.time = now;
    sample.sequence = c.steps;
  }
  return read;
}

/// The same of such samples.
template <class L, class S> S step_now(Controller<L>& c, const Samples<S>& read, std::int64_t now) noexcept {
  return step(c, stamped(c, read, now), now);
}

/// Ramps the effort to 0 from the next step on.
template <class L> void stop(Controller<L>& c) noexcept { latch(c, SafetyFault::stopped); }

/// Opens the gate again; the effort goes on from where it is, within the rate limit.
template <class L> void reset(Controller<L>& c) noexcept {
  reset(c.state);
  for (SampleState& seen : c.seen) seen = {};
  c.fault = SafetyFault::none;
  if (!c.law.gate.valid) c.fault = c.state.gate.fault = SafetyFault::configuration;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
