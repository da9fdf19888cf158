// Whether a drive gives what it was asked for, by its own measurement of current or torque.
//
// The measurement of this period answers the command of the last. A drive follows within a share of the command, a
// tolerance, and what it may still be making of the command: its last change, or how far it is from what was asked for
// as late as its loop. Longer than a few periods outside is a fault, named by what it looks like.
//
// A drive may lose energy, to friction that its own loop does not make up for, but not add to what it was asked for.
// With due effort d, given effort g and its velocity v, the energy that it adds beyond the accuracy of its measurement is
//
//   S' = (g - d) v - (gain |d| + offset) |v| - S/T,   S >= 0,
//
// so that an error of the measurement within `gain` and `offset` never accumulates, whatever the motion. What its noise
// and its lag add is forgotten with the time constant T. A slow torque loop may give what it was asked for a while ago:
// where the command turns with the motion, as under dither or at the end of a strap's slack, being late alone adds
// energy. So d is the last command, the one before it, or the command as late as the loop, whichever gives most energy:
// a drive may be quicker than its loop is thought, and a period later.
//
// A torque loop may leave its drive's inertia to whoever moves the joint: it takes energy while the joint speeds up and
// gives it back while it slows down, beside any command. Nobody knows how much of it a loop makes up for. So there are two
// accounts, one for none of the `inertia` J, the other for all of it,
//
//   S'  and  S' + d/dt (J v^2 / 2),
//
// and a fault is what exceeds both: a drive that adds energy does so whether the joint speeds up or slows down.
//
// One reading alone that is outside is a disturbed measurement, no drive: what it would add waits for the next one to agree.
// A reading beyond what the drive can give is none.
//
// Drive and measurement together read `answer` times the command where both are right, as a commissioning found. It is
// divided by that before anything is compared.
#pragma once

#include "fields.hpp"
#include "sample.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S> struct DriveWatchParams {
  std::uint32_t expected = 0, cycles = 4;
  S tolerance = S(std::numeric_limits<S>::infinity()), relative = S(0.15), limit = tolerance,
    surplus = tolerance, late{}, gain{}, offset{}, forget{}, inertia{}, answer = S(1);

  template <class P, class V> static constexpr void walk(P& p, V& visit) noexcept {
    visit(p.expected, {"drive_expected", unit::one, between(0, 1),
                       "1: the drive measures its effort, and must say so"});
    visit(p.cycles, {"drive_cycles", unit::one, at_least(1), "periods in a row outside, or silent, that are a fault"});
    visit(p.tolerance, {"drive_tolerance", unit::effort, above(0).or_infinite(),
                        "largest error of the measured effort"});
    visit(p.relative, {"drive_share", unit::one, share(), "more of it, per effort asked for"});
    visit(p.limit, {"drive_limit", unit::effort, above(0).or_infinite(), "largest effort of the drive"});
    visit(p.surplus, {"drive_surplus", unit::energy, above(0).or_infinite(),
                      "energy that it may give beyond what it was asked for; infinite: any"});
    visit(p.late, {"drive_late", unit::one, share(),
                   "share of what it was asked for that a period leaves to its torque loop; 0: it has none"});
    visit(p.gain, {"drive_gain", unit::one, share(),
                   "share of its own value by which its measurement may be wrong without adding to the surplus"});
    visit(p.offset, {"drive_offset", unit::effort, at_least(0),
                     "offset of its measurement that does not add to the surplus"});
    visit(p.forget, {"drive_forget", unit::one, share(),
                     "share of the surplus that is forgotten in a period; 0: none"});
    visit(p.inertia, {"drive_inertia", unit::inertia, at_least(0),
                      "largest inertia that its torque loop leaves; the second encoder is then its own. 0: none"});
    visit(p.answer, {"drive_answer", unit::one, above(0), "its measurement over the effort asked for, of a right drive"});
  }
};

/// Readings from one that was outside alone to the next that may be.
constexpr std::uint32_t lone_reading_gap = 100;

template <class S> struct DriveWatchState {
  S asked{};                  ///< last [N m]
  S asked_before{};           ///< the time before [N m]
  S due{};                    ///< asked for, as late as its loop [N m]
  S given{};                  ///< when it was first outside [N m]
  S surplus{};                ///< energy given beyond what was asked for and the measurement's accuracy [J]
  S inert_surplus{};          ///< the same, if its inertia gives back what it took [J]
  S kinetic{};                ///< energy of that inertia [J]
  std::uint32_t outside = 0;  ///< periods in a row
  std::uint32_t silent = 0;   ///< periods in a row
  S waiting{};                ///< energy of the first reading that is outside, until the next agrees [J]
  std::uint32_t agreed = lone_reading_gap;  ///< readings since one was outside alone, at most that
};

/// Command of this period, to a drive that is on.
template <class S> void ask(DriveWatchState<S>& s, const S& effort) noexcept {
  s.asked_before = s.asked;
  s.asked = effort;
}

/// Return the tolerated deviation of the drive from its command [N m]; call after `account`.
template <class S> S may_stray(const DriveWatchParams<S>& p, const DriveWatchState<S>& s) noexcept {
  const S asked = clamp(s.asked, -p.limit, p.limit);
  return p.tolerance + p.relative * abs(asked) + max(abs(s.asked - s.asked_before), abs(asked - s.due));
}

/// Return the effort that a reading stands for, as it was asked for [N m].
template <class S> S given_of(const DriveWatchParams<S>& p, const S& reading) noexcept { return reading / p.answer; }

/// Whether the drive can give what its measurement says; a measurement of more is none.
template <class S> bool can_give(const DriveWatchParams<S>& p, const S& given) noexcept {
  return abs(given) <= p.limit + p.tolerance + p.relative * p.limit;
}

/// Update the accounts of commands with the effort `given`, at a `velocity` [rad/s] of the drive for a `period` [s].
template <class S>
void account(const DriveWatchParams<S>& p, DriveWatchState<S>& s, const S& given, const S& velocity, const S& period) noexcept {
  const S moved = period * velocity;
  const S asked = clamp(s.asked, -p.limit, p.limit);
  s.due = asked + p.late * (s.due - asked);
  const S earlier = clamp(s.asked_before, -p.limit, p.limit);
  const S later = (s.due - earlier) * moved > S(0) ? s.due : earlier;
  const S meant = (asked - later) * moved > S(0) ? asked : later;
  const S accuracy = p.gain * abs(meant) + p.offset;
  const S added = (given - meant) * moved - accuracy * abs(moved), before = s.kinetic;
  s.kinetic = S(0.5) * p.inertia * velocity * velocity;
  const bool is_outside = !(abs(given - asked) <= may_stray(p, s));
  const bool is_alone = is_outside && s.outside == 0 && s.agreed >= lone_reading_gap;
  const S counted = is_alone ? S(0) : is_outside ? added + s.waiting : added;
  s.waiting = is_alone ? max(added, S(0)) : S(0);
  s.agreed = is_alone ? 0 : s.agreed < lone_reading_gap ? s.agreed + 1 : s.agreed;
  s.surplus = max((S(1) - p.forget) * s.surplus + counted, S(0));
  s.inert_surplus = p.inertia > S(0) ? max((S(1) - p.forget) * s.inert_surplus + (counted + (s.kinetic - before)), S(0)) : s.surplus;
}

/// Energy that the drive gave beyond what was asked for, whatever its loop makes up for of its inertia [J].
template <class S> S least_surplus(const DriveWatchState<S>& s) noexcept {
  return s.surplus <= s.inert_surplus ? s.surplus : s.inert_surplus;
}

/// Return the fault of the effort that the drive gives, if any, after the command `s.asked`, while the drive had a
/// `velocity` [rad/s] for a `period` [s].
template <class S> SafetyFault step(const DriveWatchParams<S>& p, DriveWatchState<S>& s, const S& given, const S& velocity,
                                    const S& period, bool heard) noexcept {
  if (p.expected == 0) return SafetyFault::none;
  if (!heard) return ++s.silent >= p.cycles ? SafetyFault::drive_silent : SafetyFault::none;
  s.silent = 0;
  const S asked = clamp(s.asked, -p.limit, p.limit);
  account(p, s, given, velocity, period);
  if (!(least_surplus(s) <= p.surplus)) {
    s.surplus = s.inert_surplus = S(0);
    return SafetyFault::drive_effort;
  }
  if (abs(given - asked) <= may_stray(p, s)) {
    s.outside = 0;
    return SafetyFault::none;
  }
  if (s.outside == 0) s.given = given;
  if (++s.outside < p.cycles) return SafetyFault::none;
  s.outside = 0;
  if (abs(given - s.given) <= S(0.1) * p.tolerance) return SafetyFault::drive_stuck;
  return same_sign(given, -asked) && abs(given) > p.tolerance ? SafetyFault::drive_sign : SafetyFault::drive_effort;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
