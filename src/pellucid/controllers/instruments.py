"""A robot's instruments and their accuracy: the one table that lab, supervisor and exported controller read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace

from .._errors import PellucidError

SHORTEST_PROBE_WINDOW_S = 0.12
"""Duration of the shortest window of the probe."""

COMMISSIONING_CONDITION = "Nobody wears the robot, and the joint can move freely."
"""Condition of the ten starts that measure sign, gain and delay of a drive."""

MAX_WAVE_DIFFERENCE = 0.05
"""Largest difference of the amplitude of a wave from that of the start-up test, relative to it [1]."""

ENCODER_RESOLUTION = 4e-4
"""Error of one encoder reading if none is stated [rad or m]."""

DRIVE_GAIN_ERROR = 0.05
"""Default of `Instruments.drive_gain_error`: the accuracy of uncalibrated current sensors and torque constants [1]."""

DRIVE_OFFSET_SHARE = 0.01
"""Offset of the drive's measurement if none is stated, as a share of the law's limit of effort [1]."""

DRIVE_NOISE_SHARE = 0.01
"""Noise of the drive's measurement if none is stated, standard deviation as a share of the limit of effort [1]."""

DRIVE_LAG_S = 2e-3
"""Default of `Instruments.drive_lag`: the lag of a slow field bus [s]."""

FORCE_OFFSET_SHARE = 0.02
"""Offset of the force sensor if none is stated, as a share of the law's limit of effort [1].

It is twice the standard deviation of the sensors on which the thresholds of the force watch were chosen."""


@dataclass(frozen=True)
class Instruments:
    """Instruments of a joint and their accuracy, from which the supervisor's thresholds follow.

    The defaults are a joint with one encoder, without a measurement of its drive's effort and without a force sensor of
    known range. An accuracy that is not stated is the one with which the thresholds were chosen. A worse one widens
    them. A better one tightens only the energy that a drive may add by its own measurement.

    Parameters
    ----------
    encoder_resolution : float or None
        Error of one encoder reading, quantum and noise together [rad or m]; None: `ENCODER_RESOLUTION`, and 1e-3 for an
        orthosis behind a spring.
    joint_encoder : bool
        Whether there is a second encoder, behind the transmission.
    joint_tolerance : float
        Largest difference of both encoders without a fault: twist and backlash [rad or m].
    drive : bool
        Whether the drive measures its current or torque by a sensor that it does not regulate on.
    drive_limit : float
        Largest effort of the drive [N m or N].
    drive_gain_error : float
        Relative error of the drive's measurement [1].
    drive_offset : float or None
        Offset of that measurement [N m or N]; None: `DRIVE_OFFSET_SHARE` of the law's limit of effort, and 0.002 of it
        for a spring, which is tared where it is slack.
    drive_noise : float or None
        Standard deviation of that measurement's noise [N m or N]; None: `DRIVE_NOISE_SHARE` of that limit.
    drive_lag : float
        Time constant of that measurement's lag [s].
    drive_answer : float
        Measured effort per effort asked for at commissioning, which contains the gains of drive and measurement [1].
    spring_stiffness : float or None
        Stiffness of the series spring whose deflection is the drive's measurement [N m/rad or N/m]; None for a drive
        without a spring.
    force_range : float
        Range of the force sensor, of either sign [N m or N].
    force_gain_error : float
        Relative error of the force sensor [1].
    force_offset : float or None
        Offset of the force sensor [N m or N]; None: `FORCE_OFFSET_SHARE` of the law's limit of effort.
    emg_range : float
        Largest torque in the EMG calibration [N m].
    start_up_answer : float or None
        Work of the start-up test's wave at commissioning, with a drive known to be right [J]. None uses bounds for any
        robot, which allow a gain that is wrong by a factor of up to four.
    start_up_wave : float or None
        Amplitude of the wave that gave `start_up_answer` [N m or N]: a control law with another wave does not use the
        answer. None: that of the control law.
    probe : bool or None
        Whether a wave of effort may test encoder and drive while the law runs. None: an export decides, by
        whether the drive is measured; elsewhere it does not.
    probe_answer : sequence of float or None
        Answers to the probe's three waves at commissioning, with a drive and an encoder known to be right: real and
        imaginary part of each, shape (6,) [1]. None: the first movement after each start is taken for right.
    probe_window : float or None
        Duration of the windows that gave `probe_answer` [s]: a control law with others, whose waves have other
        frequencies, does not use the answer. None: the shortest.
    shaking : bool or None
        Whether a sustained oscillation of the joint, faster than reaching movements, switches the power off. It detects
        a drive whose own measurement is wrong, but also stops a wearer who stirs fast. None: an export
        decides, by whether a force sensor or a spring shows the same; elsewhere it does not.
    stated : frozenset of str
        Names of the fields that study.toml states. An exported README lists the others as assumed.

    Raises
    ------
    PellucidError
        If a number is negative or not a number, a resolution, range, limit or stiffness is 0, or `probe_answer` is
        not six finite numbers of which each pair has a size above 0.

    Examples
    --------
    A joint whose drive measures its current to 5 % and 0.1 N m:

    >>> import pellucid as pl
    >>> measured = pl.Instruments(drive=True, drive_limit=13.0, drive_gain_error=0.05, drive_offset=0.1)
    >>> measured.force_range
    inf

    `pellucid.supervised` takes them, and ``[rig.instruments]`` of study.toml states them for `pellucid.export`.
    """

    encoder_resolution: float | None = None
    joint_encoder: bool = False
    joint_tolerance: float = 0.05
    drive: bool = False
    drive_limit: float = math.inf
    drive_gain_error: float = DRIVE_GAIN_ERROR
    drive_offset: float | None = None
    drive_noise: float | None = None
    drive_lag: float = DRIVE_LAG_S
    drive_answer: float = 1.0
    spring_stiffness: float | None = None
    force_range: float = math.inf
    force_gain_error: float = 0.0
    force_offset: float | None = None
    emg_range: float = 40.0
    start_up_answer: float | None = None
    start_up_wave: float | None = None
    probe: bool | None = None
    probe_answer: tuple[float, ...] | None = None
    probe_window: float | None = None
    shaking: bool | None = None
    stated: frozenset[str] = field(default=frozenset(), compare=False, repr=False)

    def decided(self, *, has_force_sensor: bool, spring: bool = False, probe: bool | None = None) -> Instruments:
        """Return the instruments of an export: with what it decides about probe and check for oscillation.

        Parameters
        ----------
        has_force_sensor, spring : bool
            Whether the control law reads the interaction torque, and whether it drives a series spring.
        probe : bool or None
            Choice of the caller; None: that of the instruments.

        Returns
        -------
        Instruments
            A probe where nothing measures the drive, and the check where nothing shows what a drive adds.
        """
        asked = self.probe if probe is None else probe
        return replace(
            self,
            probe=not (self.drive or spring) if asked is None else asked,
            shaking=not (spring or has_force_sensor) if self.shaking is None else self.shaking,
        )

    def answer_to(self, wave: float) -> float | None:
        """Return the work of the start-up test at commissioning [J] with a wave of this amplitude, if known."""
        same = self.start_up_wave is None or abs(self.start_up_wave - wave) <= MAX_WAVE_DIFFERENCE * wave
        return self.start_up_answer if same else None

    def answer_to_probe(self, window: float) -> tuple[float, ...] | None:
        """Return the answer to the probe at commissioning with windows of this duration [s], if known."""
        known = SHORTEST_PROBE_WINDOW_S if self.probe_window is None else self.probe_window
        return self.probe_answer if abs(known - window) <= MAX_WAVE_DIFFERENCE * window else None

    @property
    def asks_at_rest(self) -> bool:
        """Whether a wave asks a joint whose encoder reads the same for long: in exports that probe or measure."""
        return bool(self.probe) or (self.drive and self.probe is not None)

    def __post_init__(self):
        if self.probe_answer is not None:
            object.__setattr__(self, "probe_answer", _checked_answer(self.probe_answer))
        positive = ("encoder_resolution", "joint_tolerance", "drive_limit", "drive_answer", "spring_stiffness",
                    "force_range", "emg_range", "start_up_answer", "start_up_wave", "probe_window")  # fmt: skip
        for name in (each.name for each in fields(self)):
            value = getattr(self, name)
            if value is None or isinstance(value, bool | tuple | frozenset):
                continue
            least = "more than 0" if name in positive else "0 or more"
            if not (value > 0.0 if name in positive else value >= 0.0):
                raise PellucidError(f"instruments: {name}: found {value:g}, expected {least}")

    def completed(
        self,
        effort_limit: float,
        *,
        encoder_resolution: float = ENCODER_RESOLUTION,
        drive_offset_share: float = DRIVE_OFFSET_SHARE,
    ) -> CompleteInstruments:
        """Return the same instruments with a number for each accuracy that is not stated.

        Parameters
        ----------
        effort_limit : float
            The law's limit of effort, to which the defaults of offsets and noise are proportional [N m or N].
        encoder_resolution : float
            Error of one encoder reading if none is stated [rad or m].
        drive_offset_share : float
            Offset of the drive's measurement if none is stated, as a share of that limit [1].

        Returns
        -------
        CompleteInstruments
            Instruments whose resolution, offsets and noise are numbers.
        """
        usual = {
            "encoder_resolution": encoder_resolution,
            "drive_offset": drive_offset_share * effort_limit,
            "drive_noise": DRIVE_NOISE_SHARE * effort_limit,
            "force_offset": FORCE_OFFSET_SHARE * effort_limit,
        }
        taken = {name: value for name, value in usual.items() if getattr(self, name) is None}
        return CompleteInstruments(**{**vars(self), **taken})


def _checked_answer(answer: Sequence[float]) -> tuple[float, ...]:
    """Return the six numbers of a probe's answer, or raise a PellucidError if they are none."""
    found = tuple(map(float, answer))
    waves = list(zip(found[::2], found[1::2], strict=False))
    if len(found) != 6 or not all(map(math.isfinite, found)) or not all(map(any, waves)):
        said = ", ".join(f"{number:g}" for number in found[:8])
        raise PellucidError(
            f"instruments: probe_answer: found {said or 'nothing'}, expected real and imaginary part of three answers, "
            "none of them 0"
        )
    return found


@dataclass(frozen=True)
class CompleteInstruments(Instruments):
    """Instruments of a joint with a number for each accuracy, as `Instruments.completed` gives them."""

    encoder_resolution: float = ENCODER_RESOLUTION
    drive_offset: float = 0.0
    drive_noise: float = 0.0
    force_offset: float = 0.0
