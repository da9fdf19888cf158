"""A recording made ready for identification: evenly sampled, filtered once, differentiated, effort beside motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import _core
from .._errors import RecordingError
from ..recordings.recording import Recording
from ..recordings.study import Study
from ..recordings.study_file import Processing
from .effort import DriveModel, command_of, drive_model
from .filters import central_difference, decimate, runs, zero_phase_lowpass

SLOW_SHARE = 0.02
SMOOTH_TERMS = np.array(
    [
        _core.PARAMETER_NAMES.index(name)
        for name in ("inertia", "gravity_sine", "gravity_cosine", "offset", "viscous_positive", "viscous_negative")
    ]
)
"""Core parameters whose effort is smooth in the states; the others multiply the sign of velocity."""


@dataclass(frozen=True)
class Motion:
    """One uninterrupted stretch of a recording.

    Parameters
    ----------
    recording, split : str
        The recording's name, and "fitted" or "heldout".
    fs : float
        Sampling rate [Hz].
    time, position, velocity, acceleration, effort : ndarray, shape (n,)
        SI; filtered with the same zero-phase low-pass. Effort is at the joint, in the drive's effort unit.
    raw_position, command : ndarray, shape (n,)
        As recorded [rad or m; the drive's unit].
    reference, injected : ndarray, shape (n,), or None
        What the machine's own controller followed, and what was added after its limit.
    inner : slice
        Samples left after `trim` at either border.
    decimate : int
        One sample in so many enters a regression.
    dead_band : float
        Slower samples do not [rad/s or m/s].
    lowpass, order : float or None, int
        The low-pass that was applied [Hz].
    payload : tuple of float
        Known added mass and its distance from the axis [kg, m].
    initial : tuple of float
        Position and velocity where a simulation starts [rad or m; per second].
    """

    recording: str
    split: str
    fs: float
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray
    raw_position: np.ndarray
    command: np.ndarray
    reference: np.ndarray | None
    injected: np.ndarray | None
    inner: slice
    decimate: int
    dead_band: float
    lowpass: float | None = None
    order: int = 4
    payload: tuple[float, float] = (0.0, 0.0)
    initial: tuple[float, float] = (0.0, 0.0)

    def reduce(self, samples: np.ndarray) -> np.ndarray:
        """Trim and decimate: the last, common step of both sides of a regression.

        Parameters
        ----------
        samples : ndarray, shape (n,) or (n, k)

        Returns
        -------
        ndarray, shape (m,) or (m, k)
        """
        return decimate(samples[self.inner], self.decimate)

    def smooth(self, samples: np.ndarray) -> np.ndarray:
        """The low-pass that position and effort went through, for what a model makes of the sign of velocity.

        Parameters
        ----------
        samples : ndarray, shape (n,) or (n, k)

        Returns
        -------
        ndarray, same shape
        """
        if self.lowpass is None:
            return samples
        return zero_phase_lowpass(samples, self.lowpass, self.order, self.fs)

    @cached_property
    def smooth_regressor(self) -> np.ndarray:
        """The core's regressor of the terms that are smooth in the states, shape (n, k): it depends on no parameter."""
        return _core.inverse_dynamics_jacobian(
            np.zeros(len(_core.PARAMETER_NAMES)), self.position, self.velocity, self.acceleration, SMOOTH_TERMS
        )[1]

    @cached_property
    def moving(self) -> np.ndarray:
        """Reduced samples of which filters drew no more than `SLOW_SHARE` from samples slower than the dead band, shape
        (m,): those a regression uses."""
        slow = (np.abs(self.velocity) <= self.dead_band).astype(float)
        if self.dead_band <= 0.0 or not slow.any():
            return np.ones(len(self.reduce(slow)), bool)
        return np.abs(self.reduce(self.smooth(slow))) < SLOW_SHARE


def evenly_sampled(recording: Recording, processing: Processing) -> tuple[float, np.ndarray, dict[str, np.ndarray]]:
    """Sampling rate [Hz], time, shape (n,), and channels on an even grid; interpolated only where the study says so.

    Parameters
    ----------
    recording : Recording
    processing : Processing
        `resample` [Hz] asks for linear interpolation on a grid of that rate.

    Returns
    -------
    fs, time, channels
    """
    time = recording.time
    values = {name: channel.samples for name, channel in recording.channels.items() if name != "time"}
    if processing.resample is None:
        return recording.fs, time, values
    fs = processing.resample
    grid = time[0] + np.arange(int(np.floor((time[-1] - time[0]) * fs)) + 1) / fs
    held = {"enabled"}
    nearest = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, len(time) - 1)
    return fs, grid, {n: x[nearest] if n in held else np.interp(grid, time, x) for n, x in values.items()}


def differentiate(position: np.ndarray, fs: float, processing: Processing) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Filtered position, velocity and acceleration, as the study says; simulated positions take this way too.

    Parameters
    ----------
    position : ndarray, shape (n,)
        [rad or m].
    fs : float
        Sampling rate [Hz].
    processing : Processing

    Returns
    -------
    position, velocity, acceleration : ndarray, shape (n,)
        SI.
    """
    smooth = lowpassed(position, fs, processing)
    velocity = central_difference(smooth, fs)
    return smooth, velocity, central_difference(velocity, fs)


def lowpassed(samples: np.ndarray, fs: float, processing: Processing) -> np.ndarray:
    """The study's zero-phase low-pass; the samples themselves where it states none.

    Parameters
    ----------
    samples : ndarray, shape (n,)
    fs : float
        [Hz]
    processing : Processing

    Returns
    -------
    ndarray, shape (n,)
    """
    if processing.lowpass is None:
        return np.asarray(samples, float)
    return zero_phase_lowpass(samples, processing.lowpass, processing.order, fs)


START_SAMPLES = 20
"""First samples whose parabola gives a recording's initial state: a filter's border would spoil its derivative."""


def initial_state(position: np.ndarray, fs: float, start: str) -> tuple[float, float]:
    """Position and velocity at the first sample, from a parabola through the first samples.

    Parameters
    ----------
    position : ndarray, shape (n,)
        As recorded [rad or m].
    fs : float
        [Hz]
    start : {"measured", "rest"}
        "rest" is the first position, at rest.

    Returns
    -------
    position, velocity : float
        [rad or m; per second]
    """
    if start == "rest":
        return float(position[0]), 0.0
    n = min(START_SAMPLES, len(position))
    _, velocity, first = np.polyfit(np.arange(n) / fs, position[:n], 2)
    return float(first), float(velocity)


def motions(study: Study, use: str | None = None) -> tuple[Motion, ...]:
    """Every stretch of every recording of a study in which the drive was enabled, filtered and differentiated.

    Parameters
    ----------
    study : Study
    use : {"fit", "validate"}, optional
        Only recordings of this use.

    Returns
    -------
    tuple of Motion

    Raises
    ------
    RecordingError
        If a recording lacks position or the drive's channel, or is too short for the filter.
    """
    model = drive_model(study.rig)
    return tuple(m for r in study.recordings(use) for m in _stretches(r, study, model))


def _stretches(recording: Recording, study: Study, model: DriveModel) -> Iterator[Motion]:
    processing, loop = study.processing, study.rig.loop
    if "position" not in recording:
        raise RecordingError(
            f"{recording.path}: no channel 'position'; found {', '.join(recording.channels)}. "
            "Identification needs the joint's position in [channels]"
        )
    fs, time, channels = evenly_sampled(recording, processing)
    even = replace(
        recording,
        channels={
            "time": replace(recording.channels["time"], samples=time),
            **{n: replace(recording.channels[n], samples=x) for n, x in channels.items()},
        },
    )
    command = command_of(even, study.rig)
    injected = even[loop.injected] if loop is not None and loop.injected and loop.injected in even else None
    reference = even["reference"] if "reference" in even.channels else None
    shortest = max(2 * processing.trim + 30 * processing.decimate, 60)
    stretches = [s for s in runs(np.asarray(even.enabled, bool)) if s.stop - s.start >= shortest]
    if not stretches:
        raise RecordingError(
            f"{recording.path}: {len(time)} samples, no enabled stretch of at least {shortest}; "
            "expected a longer recording, a smaller [processing] decimate or trim"
        )
    for part in stretches:
        raw = even["position"][part]
        try:
            position, velocity, acceleration = differentiate(raw, fs, processing)
            effort = model.gain * lowpassed(command[part], fs, processing) - model.back_emf * velocity
        except ValueError as error:
            raise RecordingError(f"{recording.path}: {error}") from None
        yield Motion(
            recording=recording.name,
            split="fitted" if recording.use == "fit" else "heldout",
            fs=fs,
            time=time[part],
            position=position,
            velocity=velocity,
            acceleration=acceleration,
            effort=effort,
            raw_position=raw,
            command=command[part],
            reference=None if reference is None else reference[part],
            injected=None if injected is None else injected[part],
            inner=slice(processing.trim, len(raw) - processing.trim),
            decimate=processing.decimate,
            dead_band=processing.dead_band,
            lowpass=processing.lowpass,
            order=processing.order,
            initial=initial_state(raw, fs, recording.start),
            payload=(0.0, 0.0) if recording.payload is None else (recording.payload.mass, recording.payload.distance),
        )
