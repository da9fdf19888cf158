"""Angle of a segment from one IMU on it: samples, quaternions, orientation, and regression to an encoder.

Samples are made uniform in time, dropouts bridged and counted, or refused by name. Quaternions have w first.
Their products are written out: SciPy's `Rotation`, which takes seven times as long, rounds them otherwise, and a fit of
two poles to a strap multiplies that difference by 10^10.
Orientation is by Madgwick's filter [1]_ or by VQF [2]_, each with six or nine axes; a segment's angle is the turn about
a fixed axis that is in it.

.. [1] S. O. H. Madgwick, A. J. L. Harrison, R. Vaidyanathan, Estimation of IMU and MARG orientation using a gradient
   descent algorithm, IEEE ICORR, 2011 (in the revised form of the library imufusion).
.. [2] D. Laidig, T. Seel, VQF: Highly accurate IMU orientation estimation with bias estimation and magnetic
   disturbance rejection, Information Fusion 91, 2023.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..._errors import RecordingError, missing_compiled_package
from ...files.recording import Recording
from ...numerics.clocks import Alignment, align
from ...numerics.filters import runs, zero_phase_lowpass
from ...numerics.resampling import resample
from ...numerics.uncertainty import correlation_length

SENSORS = {
    "angular_velocity": "gyroscope",
    "acceleration": "accelerometer",
    "magnetic_field": "magnetometer",
}
"""Channel groups, each with ``.x``, ``.y``, ``.z``, and the sensor they come from."""


@dataclass(frozen=True, eq=False)
class Inertial:
    """Uniform samples of one IMU, in its own frame."""

    time: np.ndarray  # (n,) [s], on the IMU's clock
    angular_velocity: np.ndarray  # (n, 3) [rad/s]
    acceleration: np.ndarray  # (n, 3) Specific force [m/s^2]: a resting sensor reads 9.8 upwards
    magnetic_field: np.ndarray | None = None  # (n, 3) [T]
    interpolated: int = 0  # Samples that were missing and were bridged
    gaps: tuple[tuple[float, float], ...] = ()  # From when to when each was [s]

    @property
    def period(self) -> float:
        """Time from one sample to the next [s]."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    def __len__(self) -> int:
        return len(self.time)

    def between(self, start: float, stop: float) -> Inertial:
        """Samples of start <= time < stop [s]."""
        kept = (self.time >= start) & (self.time < stop)
        field = None if self.magnetic_field is None else self.magnetic_field[kept]
        return Inertial(self.time[kept], self.angular_velocity[kept], self.acceleration[kept], field)


def inertial(
    recording: Recording, prefix: str = "imu", *, magnetometer: bool = False, longest_gap: float = 2.0
) -> Inertial:
    """An IMU's channels on a uniform time axis.

    Samples that are missing (NaN, or rows that are not there) for less than `longest_gap` are bridged by straight
    lines and counted; times that jitter are brought to the mean rate in the same way.

    `prefix` [rad/s], [m/s^2], [T]; `longest_gap` [s].
    """
    where = f"{recording.path.name} (recording {recording.name})"
    wanted = [name for name in SENSORS if magnetometer or name != "magnetic_field"]
    values = {name: _triple(recording, prefix, name, where) for name in wanted}
    time = np.asarray(recording.time, float)
    if not np.isfinite(time).all() or len(time) < 2 or np.any(np.diff(time) <= 0.0):
        raise RecordingError(
            f"{where}: found times of {prefix} that do not increase at every sample, expected increasing times"
        )
    period = 1.0 / recording.fs
    grid = time[0] + period * np.arange(round((time[-1] - time[0]) / period) + 1)
    bridged, gaps = np.zeros(len(grid), bool), []
    for name in wanted:
        known = np.isfinite(values[name]).all(axis=1) & recording.sound
        channel = f"{prefix}.{name}"
        if not known.any():
            raise RecordingError(f"{where}: channel {channel}: found no sample with a value, expected {SENSORS[name]}")
        _refuse_frozen(time[known], values[name][known], where, channel, longest_gap)
        for start, stop in _gaps(time, known, grid[-1], period):
            if stop - start >= longest_gap:
                raise RecordingError(
                    f"{where}: channel {channel}: found no sample from {start:.3f} s to {stop:.3f} s, expected "
                    f"dropouts shorter than {longest_gap:g} s; leave that stretch out with a window"
                )
            bridged |= (grid > start + 0.5 * period) & (grid < stop - 0.5 * period)
            gaps.append((float(start), float(stop)))
        values[name] = np.stack([np.interp(grid, time[known], column) for column in values[name][known].T], axis=-1)
    return Inertial(
        time=grid,
        angular_velocity=values["angular_velocity"],
        acceleration=values["acceleration"],
        magnetic_field=values.get("magnetic_field"),
        interpolated=int(bridged.sum()),
        gaps=tuple(sorted(set(gaps))),
    )


def _triple(recording: Recording, prefix: str, name: str, where: str) -> np.ndarray:
    channels = [f"{prefix}.{name}.{axis}" for axis in "xyz"]
    missing = [channel for channel in channels if channel not in recording]
    if missing:
        purpose = "; nine axes need a magnetometer, six do without" if name == "magnetic_field" else ""
        raise RecordingError(
            f"{where}: no channel {', '.join(missing)}; found {', '.join(recording.channels)}{purpose}"
        )
    return np.stack([recording[channel] for channel in channels], axis=-1)


def _refuse_frozen(time: np.ndarray, values: np.ndarray, where: str, channel: str, longest: float) -> None:
    same = np.r_[False, (np.diff(values, axis=0) == 0.0).all(axis=1)]
    for run in runs(same):
        start, stop = time[run.start - 1], time[run.stop - 1]
        if stop - start >= longest:
            raise RecordingError(
                f"{where}: channel {channel}: the sensor is frozen: one value from {start:.3f} s to {stop:.3f} s, "
                f"expected noise at least every {longest:g} s"
            )


def _gaps(time: np.ndarray, known: np.ndarray, end: float, period: float) -> list[tuple[float, float]]:
    """Stretches between two known samples that are further apart than jitter explains; borders count too."""
    at = np.concatenate(([time[0] - period], time[known], [end + period]))
    wide = np.flatnonzero(np.diff(at) > 1.75 * period)
    return [(max(at[i], time[0]), min(at[i + 1], end)) for i in wide]


def multiply(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Hamilton's product. `left`, `right` (..., 4); gives (..., 4)."""
    a, b, c, d = np.moveaxis(np.asarray(left, float), -1, 0)
    w, x, y, z = np.moveaxis(np.asarray(right, float), -1, 0)
    return np.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        axis=-1,
    )


def conjugate(quaternions: np.ndarray) -> np.ndarray:
    """The opposite turns, shape (..., 4)."""
    return np.asarray(quaternions, float) * np.array([1.0, -1.0, -1.0, -1.0])


def continuous(quaternions: np.ndarray) -> np.ndarray:
    """The same turns, shape (n, 4), each with the sign that is nearer to the one before it."""
    dots = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    return quaternions * np.cumprod(np.concatenate(([1.0], np.where(dots < 0.0, -1.0, 1.0))))[:, None]


def angular_steps(quaternions: np.ndarray) -> np.ndarray:
    """Turn from each sample to the next, in the frame that the quaternions lead to. `quaternions` (n, 4); gives (n -
    1, 3) [rad]."""
    turns = Rotation.from_quat(quaternions, scalar_first=True)
    return (turns[1:] * turns[:-1].inv()).as_rotvec()


def twist(quaternions: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Angle of the part of each turn that is about `axis`, unwrapped. `quaternions` (n, 4); `axis` (3,); gives (n,)
    [rad]."""
    near = continuous(quaternions)
    return np.unwrap(2.0 * np.arctan2(near[:, 1:] @ axis, near[:, 0]))


ORIENTATION_FILTERS = ("madgwick", "vqf")
"""Orientation filters that `orientation` offers."""

AXES = (6, 9)
GRAVITY = 9.80665  # [m/s^2] in one g, imufusion's unit of acceleration
MADGWICK_GAIN = 0.5  # how fast gravity and field correct the gyroscope [rad/s]


def orientation(
    imu: Inertial,
    method: str = "vqf",
    *,
    axes: int = 6,
) -> np.ndarray:
    """From the sensor's frame to one with z up: x east and y north with nine axes, of free heading with six; (n, 4)."""
    if method not in ORIENTATION_FILTERS or axes not in AXES:
        raise RecordingError(
            f"orientation: found method {method!r} with {axes!r} axes, expected one of "
            f"{', '.join(ORIENTATION_FILTERS)} with 6 or 9"
        )
    if axes == 9 and imu.magnetic_field is None:
        raise RecordingError("orientation: nine axes need a magnetometer, found none; six axes do without")
    used = {"angular velocity": imu.angular_velocity, "acceleration": imu.acceleration}
    if axes == 9 and imu.magnetic_field is not None:
        used["magnetic field"] = imu.magnetic_field
    for name, samples in used.items():
        bad = np.flatnonzero(~np.isfinite(samples).all(axis=1))
        if len(bad):
            raise RecordingError(f"orientation: {name} is not finite at {imu.time[bad[0]]:.3f} s, expected a number")
    found = _vqf(imu, axes) if method == "vqf" else _madgwick(imu, axes)
    return continuous(found / np.linalg.norm(found, axis=1, keepdims=True))


def _vqf(imu: Inertial, axes: int) -> np.ndarray:
    try:
        from vqf import offlineVQF
    except ImportError:
        raise missing_compiled_package('orientation "vqf" (or choose "madgwick")', "vqf") from None
    rate, force = np.ascontiguousarray(_since_last(imu.angular_velocity)), np.ascontiguousarray(imu.acceleration)
    field = np.ascontiguousarray(imu.magnetic_field) if axes == 9 else None
    return np.asarray(offlineVQF(rate, force, field, imu.period)[f"quat{axes}D"])


def _madgwick(imu: Inertial, axes: int) -> np.ndarray:
    import imufusion

    settings = imufusion.AhrsSettings()
    settings.convention = imufusion.CONVENTION_ENU
    settings.sample_rate = 1.0 / imu.period
    settings.gain = MADGWICK_GAIN
    ahrs = imufusion.Ahrs()
    ahrs.set_settings(settings)
    rates, forces = np.degrees(_since_last(imu.angular_velocity)), imu.acceleration / GRAVITY
    # imufusion is written for microtesla.
    field = 1e6 * imu.magnetic_field if axes == 9 and imu.magnetic_field is not None else None
    out = np.empty((len(imu), 4))
    for i in range(len(imu)):
        if field is not None:
            ahrs.update(rates[i], forces[i], field[i])
        else:
            ahrs.update_no_magnetometer(rates[i], forces[i])
        out[i] = ahrs.get_quaternion()
    return out


def _since_last(rate: np.ndarray) -> np.ndarray:
    """Mean rate since the sample before. Both filters hold a rate over a whole period: the rate at its end would lead
    by half a sample, which at 20 Hz and a quick swing is two degrees."""
    return np.vstack([rate[:1], 0.5 * (rate[1:] + rate[:-1])])


COMMON_BAND_SHARE = 0.4
"""IMU and encoder are compared below this share of the IMU's rate, where both see a motion alike."""


def principal_axis(angular_velocity: np.ndarray) -> tuple[np.ndarray, float]:
    """The direction about which a sensor turns most, and the share of its turning that is about it.
    `angular_velocity` (n, 3) [rad/s]; gives `axis` (3,)."""
    _, size, directions = np.linalg.svd(angular_velocity, full_matrices=False)
    if size[0] == 0.0:
        raise RecordingError("principal axis: found no angular velocity, expected a sensor that turns")
    axis = directions[0]
    return axis * np.sign(axis[np.argmax(np.abs(axis))]), float(size[0] ** 2 / np.sum(size**2))


def segment_angle(quaternions: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Turn about an axis fixed in the sensor, since the first sample.

    A heading that drifts turns the sensor about the vertical. For a level axis that is across the turn looked for, and
    leaves no trace in it.

    `quaternions` (n, 4); `axis` (3,); gives (n,) [rad].
    """
    return twist(multiply(conjugate(quaternions[0]), quaternions), axis)


def euler_angles(quaternions: np.ndarray) -> np.ndarray:
    """Return unwrapped roll, pitch and yaw, shape (n, 3) [rad]; rotations about z, then y, then x."""
    turns = Rotation.from_quat(quaternions, scalar_first=True)
    return np.unwrap(turns.as_euler("ZYX")[:, ::-1], axis=0)


@dataclass(frozen=True, eq=False)
class AngleRegression:
    """An encoder's angle as a linear function of what an IMU gives."""

    gains: np.ndarray  # (k,) One for each input [1]
    offset: float  # [rad]
    standard_errors: np.ndarray  # (k + 1,) Of gains and offset; coloured misfit allowed for
    residual: float  # RMS misfit of the samples fitted [rad]

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """The encoder's angle, shape (n,) [rad], from `inputs` of shape (n,) or (n, k)."""
        return np.asarray(inputs, float).reshape(len(inputs), -1) @ self.gains + self.offset


def fit_angle(inputs: np.ndarray, encoder: np.ndarray) -> AngleRegression:
    """Regress an encoder's angle on an IMU's. `inputs` (n,); `encoder` (n,) [rad]."""
    inputs = np.asarray(inputs, float).reshape(len(inputs), -1)
    known = np.isfinite(inputs).all(axis=1) & np.isfinite(encoder)
    columns = np.column_stack([inputs[known], np.ones(int(known.sum()))])
    if len(columns) < 3 * columns.shape[1] or np.linalg.matrix_rank(columns) < columns.shape[1]:
        raise RecordingError(
            f"angle regression: {len(columns)} samples with both instruments do not determine {inputs.shape[1]} gains "
            "and an offset; move the segment through its range"
        )
    solution = np.linalg.lstsq(columns, encoder[known], rcond=None)[0]
    misfit = encoder[known] - columns @ solution
    freedom = len(columns) - columns.shape[1]
    covariance = np.linalg.inv(columns.T @ columns) * (misfit @ misfit) / freedom * correlation_length(misfit)
    return AngleRegression(
        solution[:-1], float(solution[-1]), np.sqrt(np.diag(covariance)), float(np.sqrt(np.mean(misfit**2)))
    )


@dataclass(frozen=True, eq=False)
class FilterError:
    """How one orientation filter's angle compares with an encoder."""

    # method, axes, inputs: ``"vqf"`` or ``"madgwick"``; 6 or 9; what was regressed: ``"axis"`` or ``"outputs"``
    method: str
    axes: int
    inputs: str
    fitted: float  # fitted, heldout: RMS error of the part the regression was fitted to, and of the rest [rad]
    heldout: float
    regression: AngleRegression
    angle: np.ndarray  # (m,) On the encoder's clock; NaN where the IMU does not reach [rad]


def compare_filters(
    imu: Inertial, time: np.ndarray, encoder: np.ndarray, *, fit_until: float, longest_delay: float = 1.0
) -> tuple[Alignment, tuple[FilterError, ...]]:
    """Madgwick and VQF, six axes and, where there is a magnetometer, nine, each by axis and by all outputs. `time`,
    `encoder` (m,) [s], [rad]; `fit_until` [s]; `longest_delay` [s]."""
    early = time < fit_until
    start = imu.between(imu.time[0], fit_until)
    if not early.any() or early.all() or len(start) < 2:
        raise RecordingError(
            f"compare filters: found no samples on one side of {fit_until:g} s, expected encoder and IMU on both"
        )
    axis, _ = principal_axis(start.angular_velocity)
    alignment = align_encoder(start, axis, time[early], encoder[early], longest=longest_delay)
    errors = []
    for method in ORIENTATION_FILTERS:
        for axes in (6, 9) if imu.magnetic_field is not None else (6,):
            turns = orientation(imu, method, axes=axes)
            for inputs, raw in (("axis", segment_angle(turns, axis)), ("outputs", euler_angles(turns))):
                fast = resample(imu.time + alignment.delay, raw, time).samples
                regression = fit_angle(fast[early], encoder[early])
                angle = regression(fast)
                miss = angle - encoder
                fitted, heldout = (float(np.sqrt(np.nanmean(miss[part] ** 2))) for part in (early, ~early))
                errors.append(FilterError(method, axes, inputs, fitted, heldout, regression, angle))
    return alignment, tuple(errors)


def align_encoder(
    imu: Inertial, axis: np.ndarray, time: np.ndarray, encoder: np.ndarray, *, longest: float = 1.0
) -> Alignment:
    """Delay of an encoder's clock against an IMU's, from the rate both see. `axis` (3,); `time`, `encoder` (m,) [s],
    [rad]; `longest` [s]."""
    fs = (len(time) - 1) / float(time[-1] - time[0])
    cutoff = COMMON_BAND_SHARE / imu.period
    rate = np.gradient(encoder, time)
    if cutoff < 0.5 * fs:
        rate = zero_phase_lowpass(rate, cutoff, 4, fs)
    return align(imu.time, imu.angular_velocity @ axis, time, rate, longest=longest)
