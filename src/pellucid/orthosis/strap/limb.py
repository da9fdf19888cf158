"""Identify the limb without the strap, calibrate its IMU, and estimate its muscles' torque from EMG.

Gravity is measured on a rigid plate with relaxed muscles; inertia follows from body proportions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from ..._errors import IdentificationError, RecordingError
from ...emg.signals.emg_chain import EmgChain
from ...emg.signals.emg_quality import relaxed_faults, resting_level
from ...files.recording import Recording
from ...models.anthropometry import Segment
from ...models.estimates import Parameter
from ...numerics.filters import zero_phase_lowpass
from ...numerics.gravity_holds import GravityFit, Hold, added_gravity, find_holds
from ..imu.imu_angle import (
    FilterError,
    Inertial,
    align_encoder,
    compare_filters,
    orientation,
    principal_axis,
    segment_angle,
)
from ..input_output import InputOutput
from .strap_model import Limb

INERTIA_SPREAD_SHARE = 0.10
"""Relative standard deviation of a shank's inertia around anthropometric tables: the difference between the tables."""

KNEE_DAMPING_SPREAD = 0.2
"""Prior standard deviation of a relaxed knee's damping, which no recording here measures [N m s/rad]."""


@dataclass(frozen=True, eq=False)
class LimbFit:
    """The identified shank and foot of one wearer."""

    gravity: Parameter  # gravity torque m g l [N m]
    zero: Parameter  # angle at which the limb hangs [rad]
    inertia: Parameter  # inertia about the knee, from body proportions and the measured gravity [kg m^2]
    trials: tuple[tuple[Hold, ...], ...] = field(repr=False)  # holds of limb and orthosis together, by trial
    refused: Mapping[str, str] = field(repr=False)  # reasons why trials were not used, by trial
    # segments by table: ``"winter"`` (knee to ankle), ``"published"`` (Winter's proportions of the length from knee to
    # heel), ``"de_leva"``; only the tables whose inputs are known of the participant
    segments: Mapping[str, Segment] = field(repr=False)

    @property
    def limb(self) -> Limb:
        """The parameters as the strap's torque needs them; the damping is unknown and taken as 0."""
        spread = np.diag([self.inertia.standard_error, self.gravity.standard_error, KNEE_DAMPING_SPREAD])
        return Limb(self.inertia.value, self.gravity.value, 0.0, spread**2, self.zero.value)


def fit_limb(
    relaxed: Sequence[InputOutput],
    alone: GravityFit,
    segments: Mapping[str, Segment],
    *,
    at_work: Mapping[str, str] | None = None,
) -> LimbFit:
    """Identify the limb: the gravity of limb and orthosis on a rigid plate, minus that of the orthosis `alone`.

    `at_work` gives the reasons why trials are refused because the muscles were active, by trial.
    """
    refused = dict(at_work or {})
    used = [r for r in relaxed if r.recording not in refused]
    if not used:
        why = "; ".join(refused.values()) or "none was recorded"
        raise IdentificationError(f"the limb's gravity: found no relaxed trial to use, expected one or more: {why}")
    trials = tuple(find_holds(r.time, r.output, r.input, recording=r.recording) for r in used)
    gravity, zero = added_gravity(trials, alone)
    return LimbFit(gravity, zero, _inertia(gravity, segments), trials, refused, dict(segments))


def _inertia(gravity: Parameter, segments: Mapping[str, Segment]) -> Parameter:
    """Return the inertia from the measured gravity and the ratio I/(m g l) of the anthropometric tables."""
    if not segments:
        return Parameter("inertia", "kg*m^2", float("nan"), float("nan"), identifiable=False)
    # The ratio of inertia to gravity depends on the length alone, which the tables predict better than the mass.
    ratios = [s.inertia / s.gravity() for s in segments.values()]
    value = float(np.mean(ratios)) * gravity.value
    return Parameter("inertia", "kg*m^2", value, INERTIA_SPREAD_SHARE * value)


FITTED_SHARE = 0.6
"""Gain and axis are fitted to this first share of the calibration and evaluated on the rest."""

MAX_CLOCK_DELAY_S = 1.5
"""Largest difference between the clocks of IMU and encoder that is searched [s]."""


@dataclass(frozen=True, eq=False)
class ImuCalibration:
    """Calibration of an IMU that is fixed to the orthosis, against the orthosis's encoder."""

    gain: Parameter  # change of the IMU's angle per change of the encoder's angle [1]
    sd: float  # RMS error of the IMU's angle in the held-out part [rad]
    filters: tuple[FilterError, ...] = field(repr=False)  # errors of all orientation filters, for comparison


def calibrate_imu(imu: Inertial, encoder: InputOutput, *, method: str, axes: int) -> ImuCalibration:
    """Compare an IMU with the encoder of the orthosis that carries it."""
    end = encoder.time[0] + FITTED_SHARE * (encoder.time[-1] - encoder.time[0])
    _, errors = compare_filters(imu, encoder.time, encoder.output, fit_until=end, longest_delay=MAX_CLOCK_DELAY_S)
    chosen = next(e for e in errors if (e.method, e.axes, e.inputs) == (method, axes, "axis"))
    slope, error = abs(float(chosen.regression.gains[0])), float(chosen.regression.standard_errors[0])
    return ImuCalibration(Parameter("gain", "1", 1.0 / slope, error / slope**2), chosen.heldout, errors)


@dataclass(frozen=True, eq=False)
class JointAxis:
    """The joint's axis in the frame of an IMU."""

    axis: np.ndarray  # (3,) unit vector
    sense: float  # 1 if a positive rotation about the axis is positive for the orthosis too, otherwise -1


def find_joint_axis(imu: Inertial, encoder: InputOutput) -> JointAxis:
    """Find the joint's axis in a trial in which the limb moves."""
    axis, _ = principal_axis(imu.angular_velocity - imu.angular_velocity.mean(axis=0))
    found = align_encoder(imu, axis, encoder.time, encoder.output, longest=MAX_CLOCK_DELAY_S)
    return JointAxis(axis, float(np.sign(found.gain)))


def limb_angle_by_imu(imu: Inertial, turning: JointAxis, *, method: str, axes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times and the limb's angle in a trial, each of shape (m,) [s], [rad].

    The angle has the orthosis's sign and is 0 at the first sample.
    """
    rate = imu.angular_velocity @ turning.axis
    between = CubicSpline(imu.time, rate).antiderivative()(imu.time) - cumulative_trapezoid(rate, imu.time, initial=0.0)
    turned = segment_angle(orientation(imu, method, axes=axes), turning.axis)
    # A rotation axis is determined up to its sign, so the spline's correction takes the sign that fits.
    angle = turning.sense * (turned + np.sign(np.sum(np.diff(turned) * rate[1:])) * between)
    for start, stop in imu.gaps:
        angle[(imu.time > start) & (imu.time < stop)] = np.nan
    return imu.time, angle


ENVELOPE_SETTLING_S = 0.5
"""Envelopes have not settled for this time at either end of a recording [s]."""

TORQUE_LOWPASS_HZ = 2.0
"""Cut-off of the low-pass on the reference torque, equal to that of the envelopes."""

REGRESSION_RATE_HZ = 20.0
"""Rate of the samples that enter the regression."""


@dataclass(frozen=True, eq=False)
class Levels:
    """A wearer's envelopes at rest and in a maximal contraction, by muscle [V]."""

    rest: Mapping[str, float]
    maximum: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class MuscleTorque:
    """Torque of the knee as a linear function of envelopes and angle."""

    muscles: tuple[str, ...]
    # (2 k + 2,) coefficients of the relative envelopes, their products with the angle, 1, and the angle [N m, N m/rad]
    coefficients: np.ndarray
    levels: Levels
    # RMS error of the torque [N m]: by leave-one-repetition-out where there are several repetitions, else of the fit
    rmse: float

    def __call__(self, envelopes: Mapping[str, np.ndarray], angle: np.ndarray) -> np.ndarray:
        """Return the torque, shape (n,) [N m], from envelopes [V] and an `angle` [rad], each of shape (n,)."""
        return _columns(self.muscles, envelopes, self.levels, angle) @ self.coefficients


def envelopes(emg: Recording, chain: EmgChain) -> dict[str, np.ndarray]:
    """Return the zero-phase envelope of every muscle of a recording, each of shape (n,) [V]."""
    names = [name for name in emg.channels if name.startswith("emg.")]
    if not names:
        raise RecordingError(f"{emg.path.name}: found {', '.join(emg.channels)}, expected channels emg.<muscle>")
    chain.require_rate(emg.fs, f"{emg.path.name}, channel {names[0]}")
    return {name.removeprefix("emg."): chain.zero_phase(emg[name], emg.fs) for name in names}


def without_settling_ends(emg: Recording, made: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return envelopes without the ends of the recording, where the filters have not settled."""
    inside = (emg.time >= emg.time[0] + ENVELOPE_SETTLING_S) & (emg.time <= emg.time[-1] - ENVELOPE_SETTLING_S)
    return {muscle: envelope[inside] for muscle, envelope in made.items()}


def find_levels(maximal: Sequence[Recording], chain: EmgChain) -> Levels:
    """Return a wearer's resting and maximal envelope of each muscle, from recordings of maximal contractions."""
    made = [without_settling_ends(r, envelopes(r, chain)) for r in maximal]
    return Levels(
        {m: resting_level([e[m] for e in made]) for m in made[0]},
        {m: max(float(np.max(e[m])) for e in made) for m in made[0]},
    )


def at_work(emg: Recording, chain: EmgChain, levels: Levels) -> str:
    """Return in one sentence why a recording was not relaxed, or an empty string if it was."""
    faults = relaxed_faults(emg, without_settling_ends(emg, envelopes(emg, chain)), levels.rest, levels.maximum)
    return "; ".join(fault.message for fault in faults)


def fit_muscle_torque(
    angles: Sequence[np.ndarray],
    torques: Sequence[np.ndarray],
    made: Sequence[Mapping[str, np.ndarray]],
    levels: Levels,
    fs: float,
    gravity: float,
) -> MuscleTorque:
    """Regress the knee's torque on envelopes and angle.

    Each repetition has an angle [rad], a torque [N m] and envelopes `made` [V] of shape (n,), sampled at `fs` [Hz].
    `gravity` is that of limb and orthosis together [N m].
    """
    muscles = tuple(levels.maximum)
    step = max(1, round(fs / REGRESSION_RATE_HZ))
    blocks, targets = [], []
    for angle, torque, envelope in zip(angles, torques, made, strict=True):
        angle, torque = zero_phase_lowpass(np.column_stack([angle, torque]), TORQUE_LOWPASS_HZ, 2, fs).T
        inside = slice(round(ENVELOPE_SETTLING_S * fs), len(angle) - round(ENVELOPE_SETTLING_S * fs), step)
        blocks.append(_columns(muscles, envelope, levels, angle)[inside])
        targets.append((gravity * np.sin(angle) - torque)[inside])
    if sum(len(t) for t in targets) < 10 * (2 * len(muscles) + 2):
        raise IdentificationError(
            f"found {sum(len(t) for t in targets)} samples of torque against EMG, expected ten for each of "
            f"{2 * len(muscles) + 2} coefficients"
        )
    found = _solve(blocks, targets)
    left_out = [
        b @ (_solve(blocks[:i] + blocks[i + 1 :], targets[:i] + targets[i + 1 :]) if len(blocks) > 1 else found) - t
        for i, (b, t) in enumerate(zip(blocks, targets, strict=True))
    ]
    return MuscleTorque(muscles, found, levels, float(np.sqrt(np.mean(np.concatenate(left_out) ** 2))))


def _columns(muscles, made: Mapping[str, np.ndarray], levels: Levels, angle: np.ndarray) -> np.ndarray:
    relative = np.column_stack([(made[m] - levels.rest[m]) / (levels.maximum[m] - levels.rest[m]) for m in muscles])
    return np.column_stack([relative, relative * angle[:, None], np.ones(len(angle)), angle])


def _solve(blocks: list[np.ndarray], targets: list[np.ndarray]) -> np.ndarray:
    return np.linalg.lstsq(np.vstack(blocks), np.concatenate(targets), rcond=None)[0]
