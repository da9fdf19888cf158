"""Tables of study.toml that say what a joint's robot measures, and how well: ``[rig.instruments]``."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from .study_fields import StudyTable, quantity

if TYPE_CHECKING:
    ErrorShare = float
    DriveEffort = float
    PositiveDriveEffort = float
    LagTime = float
    Effort = float
    PositiveEffort = float
    PositiveAngle = float
    PositiveStiffness = float
    PositiveWork = float
else:
    ErrorShare = quantity("1", ge=0, le=1)
    DriveEffort = quantity("<scaled_effort>", ge=0)
    PositiveDriveEffort = quantity("<scaled_effort>", gt=0)
    LagTime = quantity("s", ge=0, le=1)
    Effort = quantity("<effort>", ge=0)
    PositiveEffort = quantity("<effort>", gt=0)
    PositiveAngle = quantity("<coordinate>", gt=0)
    PositiveStiffness = quantity("<stiffness>", gt=0)
    PositiveWork = quantity("J", gt=0)

SomeTable = TypeVar("SomeTable", bound=StudyTable)
"""The class of a table that is completed."""


class DriveSensor(StudyTable):
    """The drive's measurement of its own effort at the joint: ``[rig.instruments.drive_sensor]``.

    A drive that regulates on this sensor measures nothing for the supervisor: a wrong reading is then followed.

    Attributes
    ----------
    present : bool
        Whether there is such a measurement; a joint can so refuse the table that all joints share.
    gain_error : float or None
        Relative error of the reading [1].
    offset : float or None
        Reading at no effort [effort].
    noise : float or None
        Standard deviation of the noise [effort].
    lag : float or None
        Time constant of the reading's lag [s].
    largest_effort : float or None
        Largest effort of the drive [effort]; None: that of the ``limit`` in ``[rig.drive]``.
    """

    present: bool = True
    gain_error: ErrorShare | None = None
    offset: DriveEffort | None = None
    noise: DriveEffort | None = None
    lag: LagTime | None = None
    largest_effort: PositiveDriveEffort | None = None


class ForceSensor(StudyTable):
    """The sensor of the interaction torque or force: ``[rig.instruments.force_sensor]``.

    Attributes
    ----------
    range : float or None
        Largest reading of either sign [effort]; None: it is not known.
    gain_error : float or None
        Relative error of the reading [1].
    offset : float or None
        Reading at no effort [effort].
    """

    range: PositiveEffort | None = None
    gain_error: ErrorShare | None = None
    offset: Effort | None = None


class InstrumentsTable(StudyTable):
    """What the joint's robot measures: ``[rig.instruments]``. All keys are optional.

    With ``[[rig.joints]]`` the table ``[rig.instruments]`` holds for all joints, and the table
    ``[rig.joints.instruments]`` of a joint takes the place of single keys.

    Attributes
    ----------
    encoder_resolution : float or None
        Error of one encoder reading, quantum and noise together [rad or m].
    second_encoder : bool
        Whether there is a second encoder, behind the transmission.
    second_encoder_tolerance : float or None
        Largest difference of both encoders without a fault: twist and backlash [rad or m].
    drive_sensor : DriveSensor or None
        The drive's measurement of its own effort; None if there is none.
    force_sensor : ForceSensor or None
        Accuracy of the force sensor; None if there is none, or nothing is known of it.
    spring_stiffness : float or None
        Stiffness of the series spring whose deflection is the drive's measurement [N m/rad or N/m]. It needs no
        ``drive_sensor`` beside it, except for its accuracy.
    emg_range : float or None
        Largest torque in the EMG calibration [effort].
    start_up_answer : float or None
        Work of the start-up test's wave at commissioning [J].
    probe : bool
        Whether a small wave of effort may test encoder and drive while the law runs.
    probe_answer : tuple of float or None
        Answers to the probe's three waves at commissioning: real and imaginary part of each, shape (6,) [1].
    """

    encoder_resolution: PositiveAngle | None = None
    second_encoder: bool = False
    second_encoder_tolerance: PositiveAngle | None = None
    drive_sensor: DriveSensor | None = None
    force_sensor: ForceSensor | None = None
    spring_stiffness: PositiveStiffness | None = None
    emg_range: PositiveEffort | None = None
    start_up_answer: PositiveWork | None = None
    probe: bool = False
    probe_answer: tuple[float, float, float, float, float, float] | None = None

    def completed_by(self, common: InstrumentsTable) -> InstrumentsTable:
        """Return this table with those keys of `common` that it does not say."""
        return _completed(self, common)

    def require_encoder(self) -> None:
        """Raise a ValueError if a tolerance is stated for a second encoder that is not there."""
        if self.second_encoder_tolerance is not None and not self.second_encoder:
            raise ValueError("instruments: found second_encoder_tolerance, expected second_encoder = true beside it")


def _completed(own: SomeTable, common: StudyTable) -> SomeTable:
    """Return the table `own` with those keys of `common` that it does not say, tables in it likewise."""
    taken = {}
    for key in common.model_fields_set:
        there, here = getattr(common, key), getattr(own, key)
        if key not in own.model_fields_set:
            taken[key] = there
        elif isinstance(there, StudyTable) and isinstance(here, StudyTable):
            taken[key] = _completed(here, there)
    return own.model_copy(update=taken)
