"""Faults of a drive that a supervisor does not find if the drive does not measure its own effort."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class UnmeasuredFault:
    """How one fault of a drive without a measurement ended."""

    words: str  # what the drive does
    found: int  # number of runs in which the supervisor found it
    runs: int  # number of runs
    energy: float  # excess work on the limb in the worst run [J]


# Fifteen laws, as `pellucid export` wrote them, worn on twenty foreign plants (`evidence._exported`, seed
# 20290601), without a measurement of the drive. Runs lasted ten seconds after the onset of the fault.
UNMEASURED_FAULTS = (
    UnmeasuredFault("its polarity is reversed", 80, 300, 14.6),
    UnmeasuredFault("it gives three times the effort", 63, 300, 34.6),
    UnmeasuredFault("it is stuck at an effort", 91, 300, 27.8),
    UnmeasuredFault("it gives no effort", 60, 300, 5.9),
)
"""Faults of a drive that does not measure its effort, as they ended on virtual wearers."""

MEASURED_FAULTS_FOUND_S = 1.61
"""Time in which all of these were found with a measurement of the drive [s]."""

MEASURED_FAULTS_ENERGY_J = 0.07
"""Largest excess work on the limb of all of these with a measurement of the drive [J]."""


def warn_of_unmeasured_drive() -> str:
    """Return one sentence that says which faults are then not found, and what they cost."""
    faults = "; ".join(f"{f.words}: found in {f.found} of {f.runs}, up to {f.energy:g} J" for f in UNMEASURED_FAULTS)
    return (
        "The drive measures nothing that the supervisor could compare with its command. On virtual wearers many faults "
        f"of such a drive were not found ({faults}). With a measurement all were found within "
        f"{1e3 * MEASURED_FAULTS_FOUND_S:g} ms, {MEASURED_FAULTS_ENERGY_J:g} J at most: state it in "
        "[rig.instruments.drive_sensor] and export again."
    )
