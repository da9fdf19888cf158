"""Tables of study.toml that a live session and a controller require in addition to the rig.

``[rig.instruments]`` states a robot's measurements at a joint and their accuracy; ``[session]`` defines a live session.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from .study_fields import DERIVED_PREFIX, ShownText, StudyTable, Word, quantity

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
    PositiveShare = float
    PositiveTime = float
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
    PositiveShare = quantity("1", gt=0)
    PositiveTime = quantity("s", gt=0)

SomeTable = TypeVar("SomeTable", bound=StudyTable)
"""The class of a table that is completed."""


class DriveSensor(StudyTable):
    """The drive's measurement of its own effort at the joint: ``[rig.instruments.drive_sensor]``.

    A drive that regulates on this sensor measures nothing for the supervisor: a wrong reading is then followed.

    Attributes
    ----------
    present : bool
        ``false`` for a joint without the measurement that the table of all joints states.
    gain_error : float or None
        Relative error of the reading [1]; 5 % if unstated.
    offset : float or None
        Reading at no effort [effort]; 1 % of the controller's effort limit if unstated, 0.2 % for a spring.
    noise : float or None
        Standard deviation of the noise [effort]; 1 % of that limit if unstated.
    lag : float or None
        Time constant of the reading's lag [s]; 2 ms if unstated.
    largest_effort : float or None
        Largest effort of the drive [effort]; by default it follows from the ``limit`` in ``[rig.drive]``.
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
        Largest reading of either sign [effort].
    gain_error : float or None
        Relative error of the reading [1]; 0 if unstated.
    offset : float or None
        Reading at no effort [effort]; 2 % of the controller's effort limit if unstated.
    """

    range: PositiveEffort | None = None
    gain_error: ErrorShare | None = None
    offset: Effort | None = None


class InstrumentsTable(StudyTable):
    """Measurements of the robot at a joint: ``[rig.instruments]``. All keys are optional.

    The thresholds of the supervisor follow from it. Where an accuracy is not stated, the one with which the thresholds
    were chosen is assumed; a lower accuracy widens them. With ``[[rig.joints]]`` the table holds for all joints, and
    ``[rig.joints.instruments]`` of a joint replaces single keys.

    Attributes
    ----------
    encoder_resolution : float or None
        Error of one encoder reading, quantum and noise together [rad or m]; 0.4 mrad or 0.4 mm if unstated, 1 mrad for
        an orthosis behind a spring.
    second_encoder : bool
        Whether there is a second encoder, behind the transmission.
    second_encoder_tolerance : float or None
        Largest difference of both encoders without a fault: twist and backlash [rad or m]; 0.05 if unstated.
    drive_sensor : DriveSensor or None
        The drive's measurement of its own effort, by a sensor that it does not regulate on; the table may be empty.
    force_sensor : ForceSensor or None
        Accuracy of the force sensor; None without a sensor or a known accuracy.
    spring_stiffness : float or None
        Stiffness of the series spring whose deflection is the drive's measurement [N m/rad or N/m]. It requires no
        ``drive_sensor``, except to state the accuracy.
    emg_range : float or None
        Largest torque in the EMG calibration [effort]; 40 N*m if unstated.
    drive_answer : float or None
        Measured effort of the drive per commanded effort [1], which ``commission`` writes; 1 if unstated.
    start_up_answer : float or None
        Work of the start-up test's excitation at commissioning [J], which ``commission`` writes.
    start_up_wave : float or None
        Amplitude of that excitation [effort], which ``commission`` writes: a controller with another one does not use
        the answer.
    probe : bool or None
        Whether a small excitation of the effort may test encoder and drive while the controller runs. By default only
        if the drive is not measured; ``false`` then requires ``export --unmeasured``.
    probe_answer : tuple of float or None
        Responses to the probe's three excitations at commissioning, which ``commission`` writes: real and imaginary
        part of each [1]. Without it, the first movement after each start is assumed to be healthy.
    probe_window : float or None
        Duration of the window that gave ``probe_answer`` [s], which ``commission`` writes: a controller with another
        one does not use the answer.
    shaking : bool or None
        Whether oscillation that is faster than reaching switches the power off. It detects a drive whose own
        measurement is wrong. It also stops wearers who stir fast: state ``false`` for such tasks. By default only
        without a force sensor and a spring.
    """

    encoder_resolution: PositiveAngle | None = None
    second_encoder: bool = False
    second_encoder_tolerance: PositiveAngle | None = None
    drive_sensor: DriveSensor | None = None
    force_sensor: ForceSensor | None = None
    spring_stiffness: PositiveStiffness | None = None
    emg_range: PositiveEffort | None = None
    drive_answer: PositiveShare | None = None
    start_up_answer: PositiveWork | None = None
    start_up_wave: PositiveEffort | None = None
    probe: bool | None = None
    probe_answer: tuple[float, float, float, float, float, float] | None = None
    probe_window: PositiveTime | None = None
    shaking: bool | None = None

    def completed_by(self, common: InstrumentsTable) -> InstrumentsTable:
        """Return this table with those keys of `common` that it does not say."""
        return _completed(self, common)

    def require_encoder(self) -> None:
        """Raise a ValueError if a tolerance is stated for a second encoder that is not there."""
        if self.second_encoder_tolerance is not None and not self.second_encoder:
            raise ValueError("instruments: found second_encoder_tolerance, expected second_encoder = true with it")


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


if TYPE_CHECKING:
    # A type checker sees the numbers that the quantities become, SI.
    Angle = float
    PositiveAngle = float
    PositiveFrequency = float
    PositiveTime = float
    Time = float
    Torque = float
    PositiveTorque = float
    TorqueSize = float
    PositiveTorqueRate = float
else:
    Angle = quantity("rad")
    PositiveAngle = quantity("rad", gt=0)
    PositiveFrequency = quantity("Hz", gt=0)
    PositiveTime = quantity("s", gt=0)
    Time = quantity("s", ge=0)
    Torque = quantity("N*m")
    PositiveTorque = quantity("N*m", gt=0)
    TorqueSize = quantity("N*m", ge=0)
    PositiveTorqueRate = quantity("N*m/s", gt=0)

RUN_FOLDER = ".live"
"""Folder of a study for the files of a session that runs."""

MAX_TEXT_PARAGRAPHS = 40
"""Largest number of paragraphs of a consent or an instruction."""


def _each_once(values: tuple) -> tuple:
    if not values or len(set(values)) < len(values):
        raise ValueError(f"found {list(values)}, expected at least one, each once")
    return values


Paragraphs = Annotated[tuple[Annotated[str, Field(max_length=2000)], ...], Field(max_length=MAX_TEXT_PARAGRAPHS)]
"""A text for the person, one string for each paragraph."""


class SessionTask(StudyTable):
    """One kind of trial: one entry of ``[[session.tasks]]``.

    Attributes
    ----------
    name : str
        Name of the task, which is part of the names of its recordings.
    trials : int
        Number of trials in each condition.
    conditions : tuple of str
        Conditions in which the task is done; empty: all.
    instructions : tuple of str
        Paragraphs that the participant's page shows before the first trial of the task.
    use : str
        ``"fit"`` or ``"validate"``, as in ``[[recordings]]``. ``"last"`` holds out the last trial of each condition.
    kind : str
        Kind of the task, which decides its other keys.
    protocol : str
        Protocol of the recordings, as in ``[[recordings]]``.
    """

    name: Word
    trials: int = Field(1, ge=1, le=1000)
    conditions: tuple[Word, ...] = ()
    instructions: Paragraphs = ()
    use: Literal["fit", "validate", "last"] = "fit"


class PointingTask(SessionTask):
    """Pointing, target after target: ``[[session.tasks]]``.

    Attributes
    ----------
    start : float
        Angle to which every second movement returns [rad].
    amplitudes : tuple of float
        Distances of the other targets from there [rad].
    repetitions : int
        Number of movements to each of them in one trial. Each is followed by the movement back.
    hold : float
        Time for which the pointer must stay on a target [s].
    tolerance : float
        Largest distance from the target that counts as on it [rad].
    longest : float
        Time after which the next target appears anyway [s].
    """

    kind: Literal["pointing"]
    protocol: Word = "pointing"
    start: Angle
    amplitudes: Annotated[tuple[Angle, ...], AfterValidator(_each_once)]
    repetitions: int = Field(1, ge=1, le=1000)
    hold: PositiveTime = 2.0
    tolerance: PositiveAngle = 0.045
    longest: PositiveTime = 20.0


class TrackingTask(SessionTask):
    """Tracking of a target that moves as a sine: ``[[session.tasks]]``.

    Attributes
    ----------
    centre : float
        Mean angle of the target [rad].
    amplitude : float
        Amplitude of the target's sine [rad].
    frequency : float
        Frequency of the target's sine [Hz].
    duration : float
        Duration of a trial [s].
    """

    kind: Literal["tracking"]
    protocol: Word = "tracking"
    centre: Angle
    amplitude: PositiveAngle
    frequency: PositiveFrequency
    duration: PositiveTime


class HoldingTask(SessionTask):
    """Holding an angle against the robot's torques: ``[[session.tasks]]``.

    Attributes
    ----------
    angles : tuple of float
        Angles that are held [rad]; each has its own trials.
    torques : tuple of float
        Torques that the robot adds one after another [N*m]. The operator's slider may change each.
    duration : float
        Time of each torque [s].
    ramp : float
        Part of that time in which the torque changes to the next one [s].
    tolerance : float
        Largest distance from the angle that counts as held [rad].
    """

    kind: Literal["holding"]
    protocol: Word = "held_angle"
    angles: Annotated[tuple[Angle, ...], AfterValidator(_each_once)]
    torques: Annotated[tuple[Torque, ...], Field(min_length=1)] = (0.0,)
    duration: PositiveTime = 5.0
    ramp: Time = 2.0
    tolerance: PositiveAngle = 0.09


class ContractionTask(SessionTask):
    """Contractions to a level of their EMG: ``[[session.tasks]]``.

    Attributes
    ----------
    levels : tuple of float
        Levels one after another, as shares of a maximal contraction; 1 asks for the maximal one.
    direction : str
        ``"flexion"`` or ``"extension"``: which way the person pulls.
    muscles : tuple of str
        Muscles whose mean EMG level is shown.
    duration, rest : float
        Time of each contraction, and of the rest after it [s].
    tolerance : float
        Largest distance from the level that counts as on it [1].
    """

    kind: Literal["contraction"]
    protocol: Word = "mvc"
    levels: Annotated[tuple[Annotated[float, Field(gt=0, le=1)], ...], Field(min_length=1)] = (1.0,)
    direction: Literal["flexion", "extension"]
    muscles: Annotated[tuple[Word, ...], AfterValidator(_each_once)]
    duration: PositiveTime = 3.0
    rest: PositiveTime = 2.0
    tolerance: float = Field(0.1, gt=0, le=0.5)


def _tag(table: Any) -> str:
    kind = table.get("kind") if isinstance(table, dict) else getattr(table, "kind", None)
    return f"{DERIVED_PREFIX}{kind}"


AnyTask = Annotated[
    Annotated[PointingTask, Tag(DERIVED_PREFIX + "pointing")]
    | Annotated[TrackingTask, Tag(DERIVED_PREFIX + "tracking")]
    | Annotated[HoldingTask, Tag(DERIVED_PREFIX + "holding")]
    | Annotated[ContractionTask, Tag(DERIVED_PREFIX + "contraction")],
    Discriminator(
        _tag,
        custom_error_type="task_kind",
        custom_error_message='kind: expected "pointing", "tracking", "holding" or "contraction"',
    ),
]
"""One entry of ``[[session.tasks]]``; its `kind` says which."""


class SessionLimits(StudyTable):
    """Limits of the controller in a session: ``[session.limits]``. Omitted keys are as in ``[rig.limits]``.

    Attributes
    ----------
    effort : float or None
        Largest torque of law and slider together [N*m].
    slider : float
        Largest torque that the operator's slider asks for [N*m].
    slider_rate : float
        Largest rate at which the slider's torque changes [N*m/s].
    """

    effort: PositiveTorque | None = None
    slider: TorqueSize = 10.0
    slider_rate: PositiveTorqueRate = 5.0


class SessionTable(StudyTable):
    """A live session: ``[session]``.

    Attributes
    ----------
    device : str
        The machine, such as ``"virtual-elbow"``.
    conditions : dict of str to str
        ``[session.conditions]``: the controller of each condition, ``"not worn"`` if the robot is not worn.
    pointer : str
        Channel of the device on the participant's page: ``"position"`` is the robot's encoder.
    order : str
        ``"balanced"``: over participants, each condition has each place and follows each other one equally often;
        ``"random"``: randomised for each participant; ``"given"``: as ``[session.conditions]`` lists them.
    seed : int
        Seed of every random draw of the plan.
    pause : float
        Rest between trials [s]. The participant's page counts it down.
    pause_every : int
        Number of trials between two rests.
    streams : tuple of str
        Names of the streams that are recorded in addition to the robot's own. A trial starts only while each delivers
        data, and should be repeated if a stream stops. Empty: every stream of the device's types, none required.
    consent, instructions : tuple of str
        Paragraphs for the participant. Without consent text the page requests no consent.
    limits : SessionLimits
        Limits of the torque in the session.
    tasks : tuple of SessionTask
        Kinds of trials, in the order in which they are done.
    """

    device: Word
    conditions: dict[Word, ShownText] = Field(default_factory=lambda: {"worn": "zero_torque"})
    pointer: Word = "position"
    order: Literal["balanced", "random", "given"] = "balanced"
    seed: int = Field(1, ge=0)
    pause: Time = 0.0
    pause_every: int = Field(1, ge=1)
    streams: tuple[Word, ...] = ()
    consent: Paragraphs = ()
    instructions: Paragraphs = ()
    limits: SessionLimits = SessionLimits()
    tasks: Annotated[tuple[AnyTask, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _names_fit_together(self) -> SessionTable:
        names = [task.name for task in self.tasks]
        if len(set(names)) < len(names):
            raise ValueError(f"found the tasks {', '.join(names)}, expected each name once")
        if not self.conditions:
            raise ValueError("[session.conditions] found no condition, expected at least one")
        for task in self.tasks:
            unknown = [name for name in task.conditions if name not in self.conditions]
            if unknown:
                raise ValueError(
                    f'[[session.tasks]] {task.name}: found the condition "{unknown[0]}", expected some of '
                    f"{', '.join(self.conditions)}"
                )
        return self
