"""Catalogue of the supervisor's faults: condition, response of the supervisor, and advice.

The core's ``sample.hpp`` defines their names and order. Exported controllers and log reports take their texts from
here. The end of the catalogue lists detection rates of drive faults without a measurement of the drive.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from .. import _core
from ..models.plausible_effort import UNIT_ADVICE, doubt_torques
from .instruments import Instruments
from .supervised import unheard_energies

FAULT_NAMES: tuple[str, ...] = tuple(_core.FAULTS)
"""Names of all faults, in the order of the core's codes."""

NO_FAULT: str = _core.FAULTS[0]
"""Name that stands for no fault."""

_POWER_OFF = "power off"
_DAMPED_STOP = "damped stop"
_CHECK_WIRING = "Check plug, cable and supply of the sensor; then reset."
_CHECK_CLOCK = "Check the clock of the sample times and the rate of the control task; then reset."
_CHECK_ENCODER = "Check that the encoder is mounted firmly and its offset is right; then repeat the start-up test."
_CHECK_DRIVE = "Check leads, gain and current sensor of the drive without a wearer before it is worn again."


@dataclass(frozen=True)
class SupervisorFault:
    """Faults of the supervisor with the same condition and response."""

    names: tuple[str, ...]  # names of the core, in the order of tables
    when: str  # condition of detection; ``{sample}`` and ``{max_repeats}`` stand for those of a control law
    response: str  # response of the supervisor
    advice: str  # advice to follow before the robot is worn again

    def when_of_law(self, sensors: int, max_repeats: float) -> str:
        """Return the condition for a law with this number of sensors, which accepts `max_repeats` repeated samples."""
        sample = "a required sample is" if sensors > 1 else "the sample is"
        return self.when.format(sample=sample, max_repeats=f"{max_repeats:g}")


SUPERVISOR_FAULTS: tuple[SupervisorFault, ...] = (
    SupervisorFault(("not_finite",), "{sample} NaN, infinite or not valid", _POWER_OFF, _CHECK_WIRING),
    SupervisorFault(
        ("stale",),
        "no new sample within `max_age`, or the same sample was repeated more than {max_repeats} times",
        _POWER_OFF,
        "Check that the sensor is read once per period and the control task meets its deadline; then reset.",
    ),
    SupervisorFault(
        ("out_of_order",), "a sample number or time decreased, or a time is in the future", _POWER_OFF, _CHECK_CLOCK
    ),
    SupervisorFault(
        ("rate",), "the mean interval of the task differs from the period by more than 20 %", _POWER_OFF, _CHECK_CLOCK
    ),
    SupervisorFault(
        ("overspeed", "velocity"),
        "the velocity from raw positions, or the estimate of the control law, exceeds the limit",
        _DAMPED_STOP,
        "Check the motion before the stop in the log; reset when the cause is known.",
    ),
    SupervisorFault(
        ("jump", "range", "frozen", "disagreement"),
        "the encoder jumped further than the joint can move, is beyond the stops, stopped changing, does not respond "
        "to a test wave at rest, or differs from the second encoder",
        _POWER_OFF,
        _CHECK_ENCODER,
    ),
    SupervisorFault(
        ("force_sensor", "muscle", "lost"),
        "the sensor is out of range or missing, or contradicts model and motion",
        "continues without the sensor if possible; otherwise damped stop",
        "Check zero, sign and cable of the force sensor, or the electrodes and their channels; then reset.",
    ),
    SupervisorFault(
        ("drive_effort", "drive_sign", "drive_stuck", "drive_silent"),
        "the effort measured by the drive differs from the command",
        _POWER_OFF,
        _CHECK_DRIVE,
    ),
    SupervisorFault(
        ("unexplained",),
        "neither model and command nor a wearer can explain the motion",
        _POWER_OFF,
        "Check for a load, a collision or a changed robot; identify the robot again if it has changed.",
    ),
    SupervisorFault(
        ("power", "energy"),
        "the command delivers more power or energy to the joint than its limit",
        _DAMPED_STOP,
        "Check the motion before the stop in the log; reduce the compensation if it happens again.",
    ),
    SupervisorFault(
        ("polarity", "gain"),
        "the start-up test or the probe moved the joint in the wrong direction, or too far",
        _POWER_OFF,
        _CHECK_DRIVE,
    ),
    SupervisorFault(
        ("unanswered", "late_answer"),
        "the moving joint does not respond to the waves of the probe, or responds too late",
        _POWER_OFF,
        "Without a wearer, check that drive and encoder work and that the control task meets its deadline.",
    ),
    SupervisorFault(
        ("integrity",),
        "parameters in memory differ from the configured ones",
        _POWER_OFF,
        "Switch off and on again; if it happens again, look for writes beyond an array.",
    ),
    SupervisorFault(
        ("push",),
        "the effort beyond gravity and friction exceeds its limit",
        _DAMPED_STOP,
        "Check the motion before the stop in the log; reduce the compensation if it happens again.",
    ),
    SupervisorFault(
        ("ringing",),
        "the effort oscillates faster than a person moves",
        _POWER_OFF,
        "Reduce the gains of the controller, or measure the delay of the loop; then reset.",
    ),
    SupervisorFault(
        ("shaking",),
        "sustained oscillation, faster than in reaching movements",
        _POWER_OFF,
        "If the wearer shook the robot, state `shaking = false` in [rig.instruments]; if not, check the drive.",
    ),
    SupervisorFault(
        ("unexplained_energy",),
        "the joint gains energy that neither the command nor the force sensor explains",
        _POWER_OFF,
        "Ask whether somebody pushed the robot elsewhere than at its force sensor; if not, check drive and sensor.",
    ),
    SupervisorFault(
        ("stopped",), "the program called `pellucid_stop`", _DAMPED_STOP, "Reset when the reason for the stop is gone."
    ),
    SupervisorFault(
        ("configuration", "not_started"),
        "`pellucid_init` rejected the configuration, or was not called",
        _POWER_OFF,
        "Call `pellucid_init` once at power-on, with numbers that `pellucid export` wrote.",
    ),
)
"""Every fault, in the order of tables."""

SUPERVISOR_FAULTS_BY_NAME: Mapping[str, SupervisorFault] = {
    name: fault for fault in SUPERVISOR_FAULTS for name in fault.names
}

# Fifteen laws, as `pellucid export` wrote them, worn on twenty foreign plants (`evidence._exported`). Runs lasted ten
# seconds after the onset of the fault. A test compares these words with the stored results.
UNMEASURED_FAULTS = (
    "reversed polarity: detected in 79 of 300 runs, up to 11 J",
    "three times the effort: detected in 64 of 286 runs, up to 32 J",
    "effort stuck at a value: detected in 84 of 300 runs, up to 25 J",
    "no effort: detected in 60 of 300 runs, up to 5.9 J",
)
"""Faults of a drive without a measurement of its effort, their detection rates, and the largest excess energy delivered
to the limb."""

PROBED_FAULTS = (
    "reversed polarity: detected in 300 of 300 runs, up to 1.4 J",
    "three times the effort: detected in 300 of 300 runs, up to 2.8 J",
    "effort stuck at a value: detected in 300 of 300 runs, up to 3.5 J",
    "no effort: detected in 300 of 300 runs, up to 0.84 J",
)
"""Detection rates and largest excess energy of the same faults if the supervisor probes and was commissioned."""

MEASURED_FAULTS = (
    "reversed polarity: detected in 300 of 300 runs, up to 0.0077 J",
    "three times the effort: detected in 300 of 300 runs, up to 0.0034 J",
    "effort stuck at a value: detected in 300 of 300 runs, up to 0.018 J",
    "no effort: detected in 300 of 300 runs, up to 0.15 J",
)
"""The same with a measurement of the drive."""

UNSEEN_FAULTS = (
    "three times the effort, with a current sensor that reads a third: detected in 67 of 284 runs, up to 20 J",
)
"""The same with a measurement that has the drive's own fault."""


SIMULATED_ROBOTS = "simulated elbow robots with an effort limit of 10 N·m"
"""Robots on which drive faults were tried."""


LARGE_WAVE_SHARE = 0.25
"""Share of the effort limit from which the wearer is warned of the start-up wave [1]."""


@dataclass(frozen=True)
class DriveWatch:
    """What the supervisor of one joint does about faults of its drive: a sentence, and short lines."""

    said: str
    details: tuple[str, ...]


def describe_drive_watch(numbers: Mapping[str, float], effort_unit: str = "N*m") -> DriveWatch:
    """Return how far the supervisor of one joint limits faults of its drive: first on this robot, then in simulation.

    `numbers` are those of the law and of its supervisor, by name; `effort_unit` is that of its efforts.
    """
    lines = [] if numbers["drive_expected"] == 1.0 else _energy_lines(numbers, effort_unit)
    if numbers["drive_expected"] == 1.0:
        said = "The supervisor compares the drive's measured effort with its command"
        lines += [f"On {SIMULATED_ROBOTS}:", *_listed(MEASURED_FAULTS)]
        lines += ["A current sensor that is wrong by the drive's own factor hides its fault:", *_listed(UNSEEN_FAULTS)]
        lines += ["Use a sensor outside the drive's control loop to detect it."]
    else:
        probed = numbers["probe_effort"] > 0.0
        said = "A probe tests the drive, which has no measured effort" if probed else "Nothing tests the running drive"
        condition = "commissioned " if probed else ""
        lines += [f"On {condition}{SIMULATED_ROBOTS}:", *_listed(PROBED_FAULTS if probed else UNMEASURED_FAULTS)]
        lines += [f"With a measured effort there: {_together(MEASURED_FAULTS)}."]
        lines += ["If the drive measures its effort, add [rig.instruments.drive_sensor]."]
    return DriveWatch(said, (*_unit_doubts(numbers, effort_unit), *lines, *start_up_wave_lines(numbers, effort_unit)))


def _unit_doubts(numbers: Mapping[str, float], effort_unit: str) -> tuple[str, ...]:
    """Return a warning of torques that no worn robot has, in lines; () without one."""
    if effort_unit != "N*m":
        return ()
    weight = math.hypot(numbers["body_gravity_sine"], numbers["body_gravity_cosine"])
    doubt = doubt_torques(weight, numbers["body_inertia"], numbers["effort_limit"])
    return (f"Warning: {doubt}.", f"{UNIT_ADVICE}.") if doubt else ()


def start_up_wave_lines(numbers: Mapping[str, float], effort_unit: str) -> tuple[str, ...]:
    """Return the size of the start-up wave, and a warning where the wearer feels it; () without a wave."""
    effort, limit = numbers["test_effort"], numbers["effort_limit"]
    if not effort > 0.0:
        return ()
    unit, duration = effort_unit.replace("*", "·"), 2e3 * numbers["test_samples"] * numbers["period"]
    share = f"{100.0 * effort / limit:.0f} % of the effort limit"
    size = f"Start-up wave: {effort:.3g} {unit}, {share}, {duration:.0f} ms."
    is_large = effort >= LARGE_WAVE_SHARE * limit
    repeated = "It is repeated if the response is too large."
    return (size, repeated, *(("The wearer feels it: warn them before each start.",) if is_large else ()))


def _energy_lines(numbers: Mapping[str, float], effort_unit: str) -> list[str]:
    """Return the energies of undetected faults of a drive on this robot, for what they hold, and how to reduce them."""
    if effort_unit not in DISTANCE_UNITS:
        return [f"The effort is in {effort_unit}: the energy of a fault on this robot is not known in J."]
    named = zip(UNHEARD_FAULTS, unheard_energies(numbers), strict=True)
    listed = [f"- {name}: about {f'{one:.2g}' if one < 10.0 else f'{one:.0f}'} J" for name, one in named]
    if numbers["probe_effort"] > 0.0:
        if not math.isfinite(numbers["probe_travel"]):
            return ["Without a velocity limit the energy of a fault is not bounded: set one in [rig.limits]."]
        known = numbers["probe_answer_error"] > 0.0
        head = "Largest energy of a fault on this robot" + ("" if known else ", once commissioned")
        before = () if known else ("Before, it may miss faults in the first movement: run pellucid commission.",)
        return [f"{head}:", *listed, *SATURATED_DRIVE, "A lower velocity limit in [rig.limits] reduces it.", *before]
    low, high = numbers["position_min"], numbers["position_max"]
    is_limited = math.isfinite(low) and math.isfinite(high)
    head = "over the range of positions" if is_limited else f"over 1 {DISTANCE_UNITS[effort_unit]}"
    advice = () if is_limited else ("State position_min and position_max in [rig.limits]: they limit a movement.",)
    return [
        f"Energy of an undetected fault on this robot, {head}:",
        *listed,
        "Each movement may add as much: the supervisor does not bound the sum.",
        *advice,
        "A lower effort limit in [rig.limits] reduces it; a probe (--probe) bounds it.",
    ]


DISTANCE_UNITS: Mapping[str, str] = {"N*m": "rad", "N": "m"}
"""Unit of the way over which an effort does work, by the unit of the effort."""

UNHEARD_FAULTS = ("effort stuck at half of its limit", "reversed polarity or three times the effort", "no effort")
"""Faults of a drive whose energies `unheard_energies` returns."""


SATURATED_DRIVE = (
    "A drive that saturates near the effort limit may hide three times the effort:",
    "check the gain by pellucid commission after each change of drive or wiring.",
)
"""Lines on the fault whose energy the travel of a probe does not bound."""


def _listed(faults: tuple[str, ...]) -> list[str]:
    return [f"- {fault}" for fault in faults]


def _together(faults: tuple[str, ...]) -> str:
    """Return the runs and the largest energy of all `faults` that a tuple of this module states."""
    found = [re.search(r"detected in (\d+) of (\d+) runs, up to (\S+) J", fault) for fault in faults]
    detected, runs, energies = zip(*(one.groups() for one in found if one is not None), strict=True)
    return f"detected in {sum(map(int, detected))} of {sum(map(int, runs))} runs, up to {max(energies, key=float)} J"


def undetectable_notes(instruments: Instruments, *, has_force_sensor: bool) -> tuple[str, ...]:
    """Return a note of the faults of one joint that its sensors may not show, each with its remedy; () without any.

    `has_force_sensor` tells whether the control law reads the interaction torque.
    """
    faults = []
    if not instruments.joint_encoder:
        faults.append("an encoder that drifts, is mirrored or loses counts (remedy: a second encoder at the joint)")
    if not instruments.asks_at_rest:
        faults.append("an encoder that freezes at rest (remedy: a probe, or a measurement of the drive)")
    if not instruments.drive:
        faults.append("a drive that gives half of the effort (remedy: a measurement of the drive)")
    if instruments.drive and not has_force_sensor:
        faults.append(
            "a drive sensor that is wrong by the same factor as the drive (remedy: a sensor outside the drive's "
            "control loop, or a control law with a force sensor)"
        )
    if not (instruments.drive or has_force_sensor):
        small = ", too small for the check for sustained oscillation" if instruments.shaking else ""
        faults.append(
            f"a drive that adds a slow sine{small} (remedy: a measurement of the drive, or a control law with a force "
            "sensor)"
        )
    return (f"The supervisor may not detect {'; or '.join(faults)}.",) if faults else ()
