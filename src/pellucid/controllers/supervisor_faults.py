"""Catalogue of the supervisor's faults: when each is found, what the supervisor then does, and what to do about it.

The core's ``sample.hpp`` has their names and their order. Exported controllers, and whoever reads a log, take their
words from here. Faults of a drive without a measurement, which are often not found, are listed at the end.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .. import _core

FAULT_NAMES: tuple[str, ...] = tuple(_core.FAULTS)
"""Names of all faults, in the order of the core's codes."""

NO_FAULT: str = _core.FAULTS[0]
"""Name that stands where nothing was found."""

_POWER_OFF = "power off"
_DAMPED_STOP = "damped stop"
_CHECK_WIRING = "Check plug, cable and supply of the sensor; then reset."
_CHECK_CLOCK = "Check the clock that stamps samples, and the rate of the task; then reset."
_CHECK_ENCODER = "Check that the encoder is mounted firmly and its offset is right; then test at start-up again."
_CHECK_DRIVE = "Check leads, gain and current sensor of the drive without a wearer before it is worn again."


@dataclass(frozen=True)
class SupervisorFault:
    """Faults of the supervisor that are found and answered alike."""

    names: tuple[str, ...]  # names of the core, in the order of tables
    when: str  # condition under which one is found; ``{sample}`` and ``{max_repeats}`` stand for those of a law
    response: str  # what the supervisor then does
    advice: str  # what to do before the robot is worn again

    def when_of_law(self, sensors: int, max_repeats: float) -> str:
        """Return the condition for a law with this number of sensors, which accepts a sample so many times."""
        sample = "a required sample is" if sensors > 1 else "the sample is"
        return self.when.format(sample=sample, max_repeats=f"{max_repeats:g}")


SUPERVISOR_FAULTS: tuple[SupervisorFault, ...] = (
    SupervisorFault(("not_finite",), "{sample} NaN, infinite or not valid", _POWER_OFF, _CHECK_WIRING),
    SupervisorFault(
        ("stale",),
        "one is older than `max_age`, came after a longer gap, or was seen more than {max_repeats} times again",
        _POWER_OFF,
        "Check that the sensor is read once a period and the task is never late; then reset.",
    ),
    SupervisorFault(
        ("out_of_order",), "a number or a time went backwards, or lies in the future", _POWER_OFF, _CHECK_CLOCK
    ),
    SupervisorFault(
        ("rate",), "the mean interval of the task is off the period by more than a fifth", _POWER_OFF, _CHECK_CLOCK
    ),
    SupervisorFault(
        ("overspeed", "velocity"),
        "raw differences, or the law's estimate, are beyond the limit",
        _DAMPED_STOP,
        "Look in the log at the motion before; reset when the cause is known.",
    ),
    SupervisorFault(
        ("jump", "range", "frozen", "disagreement"),
        "the encoder went where no motion leads, is beyond the stops, stopped dead, does not answer a wave at rest, or "
        "differs from the second",
        _POWER_OFF,
        _CHECK_ENCODER,
    ),
    SupervisorFault(
        ("force_sensor", "muscle", "lost"),
        "the sensor is beyond its range or silent; or it contradicts model and motion",
        "goes on without it where it can; damped stop",
        "Check zero, sign and cable of the force sensor, or the electrodes and their channels; then reset.",
    ),
    SupervisorFault(
        ("drive_effort", "drive_sign", "drive_stuck", "drive_silent"),
        "the drive's own measurement is not what it was asked for",
        _POWER_OFF,
        _CHECK_DRIVE,
    ),
    SupervisorFault(
        ("unexplained",),
        "model and command do not explain the motion, nor can a wearer",
        _POWER_OFF,
        "Look for a load, a collision or a changed robot; identify it again if it has changed.",
    ),
    SupervisorFault(
        ("power", "energy"),
        "the whole command gives more than its budget",
        _DAMPED_STOP,
        "Look in the log at the motion before; let the law carry less if it happens again.",
    ),
    SupervisorFault(
        ("polarity", "gain"),
        "the wave of effort at start-up, or the probe's, moved the joint the wrong way, or too far",
        _POWER_OFF,
        _CHECK_DRIVE,
    ),
    SupervisorFault(
        ("unanswered", "late_answer"),
        "the moving joint does not answer the probe's small wave of effort, or answers it too late",
        _POWER_OFF,
        "Check that drive and encoder are alive, and that no task is late, without a wearer before it is worn again.",
    ),
    SupervisorFault(
        ("integrity",),
        "numbers in memory are not those that were configured",
        _POWER_OFF,
        "Switch off and on again; look for writes beyond an array if it happens again.",
    ),
    SupervisorFault(
        ("push",),
        "beyond weight and friction the effort is larger than its limit",
        _DAMPED_STOP,
        "Look in the log at the motion before; let the law carry less if it happens again.",
    ),
    SupervisorFault(
        ("ringing",),
        "the effort oscillates faster than a person moves",
        _POWER_OFF,
        "Lower the gains of the law, or measure the delay of the loop; then reset.",
    ),
    SupervisorFault(
        ("shaking",),
        "the joint oscillates for seconds, faster than a person reaches",
        _POWER_OFF,
        "Ask the wearer whether they shook the robot; if not, check the drive before it is worn again.",
    ),
    SupervisorFault(
        ("unexplained_energy",),
        "the joint gains energy that neither the command nor the force sensor explains",
        _POWER_OFF,
        "Ask whether somebody pushed the robot outside its force sensor; if not, check drive and force sensor.",
    ),
    SupervisorFault(
        ("stopped",), "you called `pellucid_stop`", _DAMPED_STOP, "Reset when the reason for which you stopped is gone."
    ),
    SupervisorFault(
        ("configuration", "not_started"),
        "`pellucid_init` refused, or was not called",
        _POWER_OFF,
        "Call `pellucid_init` once at power-on, with numbers that `pellucid export` wrote.",
    ),
)
"""Every fault, in the order of tables."""

SUPERVISOR_FAULTS_BY_NAME: Mapping[str, SupervisorFault] = {
    name: fault for fault in SUPERVISOR_FAULTS for name in fault.names
}

# Fifteen laws, as `pellucid export` wrote them, worn on twenty foreign plants (`evidence._exported`, seed
# 20290601), without a measurement of the drive. Runs lasted ten seconds after the onset of the fault.
UNMEASURED_FAULTS = (
    "its polarity is reversed: found in 80 of 300, up to 14.6 J",
    "it gives three times the effort: found in 63 of 300, up to 34.6 J",
    "it is stuck at an effort: found in 91 of 300, up to 27.8 J",
    "it gives no effort: found in 60 of 300, up to 5.9 J",
)
"""Faults of a drive that does not measure its effort, in how many runs each was found, and the excess work on the limb
in the worst run."""

PROBED_FAULTS = (
    "its polarity is reversed: 278 of 278, up to 2.4 J",
    "it gives three times the effort: 277 of 277, up to 2.7 J",
    "it is stuck at an effort: 276 of 276, up to 6.9 J",
    "it gives no effort: 276 of 276, up to 1.0 J",
)
"""The same where the supervisor probes and was commissioned."""

MEASURED_FAULTS_FOUND_S = 1.61
"""Time in which all of these were found with a measurement of the drive [s]."""

MEASURED_FAULTS_ENERGY_J = 0.07
"""Largest excess work on the limb of all of these with a measurement of the drive [J]."""


def warn_of_unmeasured_drive(probes: bool) -> str:
    """Return what is then not found and what that costs, for a supervisor that probes or one that does not."""
    measured = (
        f"With a measurement it detected all of them within {MEASURED_FAULTS_FOUND_S:g} s, at most "
        f"{MEASURED_FAULTS_ENERGY_J:g} J. Add [rig.instruments.drive_sensor] to study.toml and export again."
    )
    if probes:
        return (
            "The drive reports no measured torque or current, so the supervisor asks it by a probe that the wearer may "
            f"feel. On simulated wearers it then detected these faults ({'; '.join(PROBED_FAULTS)}). {measured}"
        )
    return (
        "Limited fault detection: the drive reports no measured torque or current. On simulated wearers the supervisor "
        f"missed many faults of such a drive ({'; '.join(UNMEASURED_FAULTS)}). {measured}"
    )
