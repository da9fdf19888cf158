"""One IMU's samples made ready: uniform in time, dropouts bridged and counted, or refused by name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._errors import RecordingError
from ...files.recording import Recording
from ...numerics.filters import runs

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
        raise RecordingError(f"{where}: the clock of {prefix} does not advance at every sample")
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
