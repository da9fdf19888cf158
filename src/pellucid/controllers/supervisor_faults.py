"""Catalogue of the supervisor's faults: condition, response of the supervisor, and advice.

The core's ``sample.hpp`` defines their names and order. Exported controllers and log reports take their texts from
here. The end of the catalogue lists detection rates of drive faults without a measurement of the drive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from .. import _core
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
        "the moving joint does not respond to the small waves of the probe, or responds too late",
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
    "reversed polarity: detected in 80 of 300 runs, up to 11 J",
    "three times the effort: detected in 61 of 285 runs, up to 42 J",
    "effort stuck at a value: detected in 85 of 300 runs, up to 22 J",
    "no effort: detected in 63 of 300 runs, up to 5.2 J",
)
"""Faults of a drive without a measurement of its effort, their detection rates, and the largest excess energy delivered
to the limb."""

PROBED_FAULTS = (
    "reversed polarity: detected in 300 of 300 runs, up to 2 J",
    "three times the effort: detected in 300 of 300 runs, up to 2.9 J",
    "effort stuck at a value: detected in 300 of 300 runs, up to 3.8 J",
    "no effort: detected in 300 of 300 runs, up to 0.95 J",
)
"""Detection rates and largest excess energy of the same faults if the supervisor probes and was commissioned."""

MEASURED_FAULTS = (
    "reversed polarity: detected in 300 of 300 runs, up to 0.0064 J",
    "three times the effort: detected in 300 of 300 runs, up to 0.0054 J",
    "effort stuck at a value: detected in 300 of 300 runs, up to 0.0092 J",
    "no effort: detected in 300 of 300 runs, up to 0.16 J",
)
"""The same with a measurement of the drive."""

UNSEEN_FAULTS = (
    "three times the effort, with a current sensor that reads a third: detected in 71 of 284 runs, up to 21 J",
)
"""The same with a measurement that has the drive's own fault."""


SIMULATED_ROBOTS = "simulated elbow robots with an effort limit of 10 N·m"
"""Robots on which drive faults were tried."""


def describe_drive_watch(numbers: Mapping[str, float]) -> str:
    """Return which faults of a drive the supervisor of one joint detects.

    `numbers` are those of the law and of its supervisor, by name.
    """
    if numbers["drive_expected"] != 1.0:
        return warn_of_unmeasured_drive(numbers)
    return (
        "The supervisor compares the measured effort of the drive with its command. Detection of drive faults on "
        f"{SIMULATED_ROBOTS}, with the largest excess energy delivered to the wearer: {'; '.join(MEASURED_FAULTS)}. A "
        f"measurement that has the fault of the drive hides it: {'; '.join(UNSEEN_FAULTS)}."
    )


def warn_of_unmeasured_drive(numbers: Mapping[str, float]) -> str:
    """Return the limits of fault detection without a drive measurement, with a probe or without one.

    `numbers` are those of the law and of its supervisor, by name.
    """
    measured = (
        f"With a drive measurement: {'; '.join(MEASURED_FAULTS)}. Add [rig.instruments.drive_sensor] and export again."
    )
    if numbers["probe_effort"] > 0.0:
        return (
            "The drive reports no measured torque or current, so that the supervisor tests it with a probe, which the "
            f"wearer may feel. {_bound_of_energies(numbers)}Detection of drive faults on commissioned "
            f"{SIMULATED_ROBOTS}, with the largest excess energy delivered to the wearer: {'; '.join(PROBED_FAULTS)}. "
            f"{measured}"
        )
    return (
        "Limited fault detection: the drive reports no measured torque or current. The supervisor missed many drive "
        f"faults of {SIMULATED_ROBOTS}. Detection rates, with the largest excess energy delivered to the wearer: "
        f"{'; '.join(UNMEASURED_FAULTS)}. {measured}"
    )


def _bound_of_energies(numbers: Mapping[str, float]) -> str:
    if not math.isfinite(numbers["probe_travel"]):
        return "Without a velocity limit the energy of its faults is not bounded. "
    stuck, wrong, dead = (f"{energy:.2g}" if energy < 10.0 else f"{energy:.0f}" for energy in unheard_energies(numbers))
    known = numbers["probe_answer_error"] > 0.0
    when = "On this robot" if known else "On this robot, once commissioned,"
    before = "" if known else " Before, faults in the first movement may stay undetected."
    return (
        f"{when} the supervisor limits the energy to about {stuck} J if the effort is stuck at half of its limit, "
        f"{wrong} J with reversed polarity or three times the effort, and {dead} J without effort. A lower velocity "
        f"limit in [rig.limits] reduces it.{before} "
    )


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
