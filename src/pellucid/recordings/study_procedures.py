"""What study.toml may ask of recordings other than a joint with friction: one table for each."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from .study_fields import Table, quantity


class TransferFunction(Table):
    """A linear model from one channel to another: ``[transfer_function]``.

    Attributes
    ----------
    input, output : str
        Channels.
    poles, zeros : int
        Orders of denominator and numerator.
    hold : str
        What the input did between its samples: ``"first"`` (straight lines) or ``"zero"`` (steps).
    confidence : float
        Of the intervals, in (0, 1).
    """

    input: str = "torque"
    output: str = "position"
    poles: int = Field(ge=1, le=8)
    zeros: int = Field(0, ge=0)
    hold: Literal["first", "zero"] = "first"
    confidence: float = Field(0.95, gt=0, lt=1)

    @model_validator(mode="after")
    def _proper(self) -> TransferFunction:
        if self.zeros >= self.poles:
            raise ValueError(f"found zeros = {self.zeros} with poles = {self.poles}, expected fewer zeros than poles")
        return self


class Hinge(Table):
    """A hinge between two segments, each with an IMU: ``[hinge]``.

    Attributes
    ----------
    proximal, distal : str
        What the names of each IMU's channels begin with.
    calibration : float
        The first seconds, from which axes, joint centre and the angle's zero are found [s].
    score_from : float
        From when on the angle is judged [s].
    jump : float
        A reference angle that changes by more than this from one sample to the next is no measurement [rad].
    delay : float or None
        How much later the IMUs show a motion than the reference does [s]; left out, it is found from the angular rates
        of the calibration's seconds.
    """

    proximal: str = "proximal"
    distal: str = "distal"
    calibration: quantity("s", gt=0) = 10.0
    score_from: quantity("s", ge=0) = 10.0
    jump: quantity("rad", gt=0)
    delay: quantity("s") | None = None


class Coupling(Table):
    """A wearer strapped to an orthosis: ``[coupling]``.

    Attributes
    ----------
    imu, emg : str
        Streams of the limb's IMU and of the muscles.
    orientation : str
        Filter of the IMU: ``"vqf"`` or ``"madgwick"``.
    magnetometer : bool
        Whether it is used.
    confidence : float
        Of the intervals, in (0, 1).
    """

    imu: str = "imu"
    emg: str = "emg"
    orientation: Literal["vqf", "madgwick"] = "vqf"
    magnetometer: bool = True
    confidence: float = Field(0.95, gt=0, lt=1)


class LoadedSwing(Table):
    """An exoskeleton's swings, empty and with relaxed legs in it: ``[loaded_swing]``.

    Attributes
    ----------
    lowpass : float
        Cut-off of the zero-phase low-pass on position and torque [Hz].
    confidence : float
        Of the intervals, in (0, 1).
    """

    lowpass: quantity("Hz", gt=0) = 4.0
    confidence: float = Field(0.95, gt=0, lt=1)


class EmgTorque(Table):
    """Torque of joints from EMG: ``[emg_torque]``.

    Attributes
    ----------
    joints : tuple of str
        Each with channels ``angle.<joint>`` and ``moment.<joint>``, or the rig's own position and torque.
    muscles : tuple of str
        Channels ``emg.<muscle>`` to use; empty: all.
    emg, moments : str
        Streams, where these channels are not in the recording's own file.
    chain : str
        From raw EMG to envelopes: ``"knee"``, ``"able"``, ``"hill"``, or ``"none"`` where envelopes were recorded.
    reference_lowpass : float or None
        Cut-off of the zero-phase low-pass on the reference torque [Hz].
    muscle_file : str or None
        Path from the study's folder to an OpenSim model or a CEINMS subject, with the muscles' constants.
    muscle_names : dict of str to str
        What that file calls the study's muscles.
    """

    joints: tuple[str, ...] = Field(min_length=1)
    muscles: tuple[str, ...] = ()
    emg: str = "emg"
    moments: str = "moments"
    chain: Literal["knee", "able", "hill", "none"] = "knee"
    reference_lowpass: quantity("Hz", gt=0) | None = None
    muscle_file: str | None = None
    muscle_names: dict[str, str] = Field(default_factory=dict)


class IsolatedMuscle(Table):
    """One muscle, fully active, whose free end is moved: ``[isolated_muscle]``.

    Attributes
    ----------
    force, displacement : str
        Channels; the displacement in the recording's amplitudes.
    stream : str
        Of the displacement, where it is not in the recording's own file.
    isometric_force : float
        Measured at rest length: errors are shares of it [N].
    max_isometric_force : float
        F_0 of the model [N].
    optimal_fibre_length, tendon_slack_length : float
        [m]
    pennation : float
        Of the fibres at their optimal length [rad].
    max_velocity : float
        In optimal fibre lengths per second [1/s].
    damping : float
        Of the fibre [1].
    tendon_strain : float
        Of the tendon under F_0 [1].
    score_from : float
        From when on the force is fitted and judged [s].
    """

    force: str = "force"
    displacement: str = "displacement"
    stream: str = "displacement"
    isometric_force: quantity("N", gt=0)
    max_isometric_force: quantity("N", gt=0)
    optimal_fibre_length: quantity("m", gt=0)
    tendon_slack_length: quantity("m", gt=0)
    pennation: quantity("rad", ge=0) = 0.0
    max_velocity: float = Field(10.0, gt=0)
    damping: float = Field(0.1, ge=0)
    tendon_strain: float = Field(0.049, gt=0)
    score_from: quantity("s", ge=0) = 0.0


class Assessment(Table):
    """Whether conditions change how people move: ``[assessment]``. Recordings that name a condition take part.

    Attributes
    ----------
    control : str
        The condition the others are compared with.
    angle : str
        Channel of the angle; a study with `segment` does not need it.
    segment : tuple of str
        Markers on the moving segment, the proximal one first: its angle with the vertical is the angle.
    target : str
        Channel of the angle to be reached; each of its steps begins a movement and says how far.
    agonists, antagonists : tuple of str
        Muscles ``emg.<muscle>`` that make positive movements, and their opponents; none: no EMG.
    emg : str
        Stream of the muscles, where they are not in the recording's own file.
    interaction : str
        Channel of the robot's torque on the person.
    lowpass : float
        Cut-off of the zero-phase low-pass on the angle [Hz].
    order : int
        Of one pass.
    threshold : float
        Share of the largest speed that begins and ends a movement.
    cutoffs, thresholds : tuple of float
        With which the indices are computed again [Hz], [1].
    advance : float
        By which EMG is taken earlier than the motion [s].
    confidence : float
        Of the intervals, in (0, 1).
    """

    control: str
    angle: str = "position"
    segment: tuple[str, ...] = ()
    target: str = "target"
    agonists: tuple[str, ...] = ()
    antagonists: tuple[str, ...] = ()
    emg: str = "emg"
    interaction: str = "interaction"
    lowpass: quantity("Hz", gt=0) = 3.0
    order: int = Field(4, ge=1, le=12)
    threshold: float = Field(0.05, gt=0, lt=0.5)
    cutoffs: tuple[quantity("Hz", gt=0), ...] = (1.5, 3.0, 6.0, 12.0)
    thresholds: tuple[Annotated[float, Field(gt=0, lt=0.5)], ...] = (0.025, 0.05, 0.1)
    advance: quantity("s", ge=0) = 0.1
    confidence: float = Field(0.95, gt=0, lt=1)

    @model_validator(mode="after")
    def _two_markers(self) -> Assessment:
        if len(self.segment) not in (0, 2) or len(set(self.segment)) < len(self.segment):
            raise ValueError(f"segment: found {list(self.segment)}, expected two markers, the proximal one first")
        both = set(self.agonists) & set(self.antagonists)
        if both:
            raise ValueError(f"found {', '.join(sorted(both))} among agonists and antagonists, expected one of both")
        return self
