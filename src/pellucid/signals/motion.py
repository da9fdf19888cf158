"""A motion made ready for identification: filtered once, differentiated, effort beside it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .._errors import RecordingError
from .filters import central_difference, decimate, zero_phase_lowpass

SLOW_SHARE = 0.02


@dataclass(frozen=True)
class Filtering:
    """What is done to position and effort alike before a regression.

    Attributes
    ----------
    lowpass : float or None
        Cut-off of the zero-phase Butterworth low-pass [Hz]; None for none.
    order : int
        Of one pass.
    decimate : int
        One sample in so many enters a regression.
    dead_band : float
        Slower samples do not [rad/s or m/s].
    trim : int
        Samples dropped at either border, where a filter has not settled.
    """

    lowpass: float | None
    order: int = 4
    decimate: int = 1
    dead_band: float = 0.0
    trim: int = 0

    def sentence(self, unit: str) -> str:
        """The same in words, for notes and cards; `unit` is the velocity's."""
        parts = [
            f"zero-phase Butterworth low-pass, order {self.order}, {self.lowpass:g} Hz"
            if self.lowpass
            else "no low-pass",
            "central differences",
        ]
        if self.lowpass:
            parts.append("friction low-passed as effort is")
        if self.trim:
            parts.append(f"{self.trim} samples dropped at either border")
        if self.decimate > 1:
            parts.append(f"both sides decimated by {self.decimate}")
        if self.dead_band:
            parts.append(f"samples left out that draw more than {SLOW_SHARE:.0%} from below {self.dead_band:g} {unit}")
        return "; ".join(parts)


@dataclass(frozen=True)
class Motion:
    """One uninterrupted stretch of a recording.

    Parameters
    ----------
    fs : float
        Sampling rate [Hz].
    time, position, velocity, acceleration, effort : ndarray, shape (n,)
        SI; filtered with the same zero-phase low-pass. Effort is at the joint, in the drive's effort unit.
    filtering : Filtering
    recording, split : str
        The recording's name, and "fitted" or "heldout".
    raw_position, command : ndarray, shape (n,), or None
        As recorded [rad or m; the drive's unit]: what a simulation starts from and is driven by.
    reference, injected : ndarray, shape (n,), or None
        What the machine's own controller followed, and what was added after its limit.
    payload : tuple of float
        Known added mass and its distance from the axis [kg, m].
    initial : tuple of float
        Position and velocity where a simulation starts [rad or m; per second].
    """

    fs: float
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray
    filtering: Filtering
    recording: str = ""
    split: str = "fitted"
    raw_position: np.ndarray | None = None
    command: np.ndarray | None = None
    reference: np.ndarray | None = None
    injected: np.ndarray | None = None
    payload: tuple[float, float] = (0.0, 0.0)
    initial: tuple[float, float] = (0.0, 0.0)

    @property
    def inner(self) -> slice:
        """Samples left after trimming either border."""
        return slice(self.filtering.trim, len(self.position) - self.filtering.trim)

    def reduce(self, samples: np.ndarray) -> np.ndarray:
        """Trim and decimate: the last, common step of both sides of a regression.

        Parameters
        ----------
        samples : ndarray, shape (n,) or (n, k)

        Returns
        -------
        ndarray, shape (m,) or (m, k)
        """
        return decimate(samples[self.inner], self.filtering.decimate)

    def smooth(self, samples: np.ndarray) -> np.ndarray:
        """The low-pass that position and effort went through, for what a model makes of the sign of velocity.

        Parameters
        ----------
        samples : ndarray, shape (n,) or (n, k)

        Returns
        -------
        ndarray, same shape
        """
        return lowpassed(samples, self.fs, self.filtering)

    def rows(self, samples: np.ndarray) -> np.ndarray:
        """The samples, (n,) or (n, k), that a regression uses."""
        return self.reduce(samples)[self.moving]

    @cached_property
    def moving(self) -> np.ndarray:
        """Reduced samples of which filters drew no more than `SLOW_SHARE` from samples slower than the dead band, shape
        (m,): those a regression uses."""
        dead_band = self.filtering.dead_band
        slow = (np.abs(self.velocity) <= dead_band).astype(float)
        if dead_band <= 0.0 or not slow.any():
            return np.ones(len(self.reduce(slow)), bool)
        return np.abs(self.reduce(self.smooth(slow))) < SLOW_SHARE


def differentiate(position: np.ndarray, fs: float, filtering: Filtering) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Low-passed position, velocity and acceleration, each (n,), of `position` [rad or m] sampled at `fs` [Hz], by a
    `filtering`; simulated positions take this way too."""
    smooth = lowpassed(position, fs, filtering)
    velocity = central_difference(smooth, fs)
    return smooth, velocity, central_difference(velocity, fs)


def lowpassed(samples: np.ndarray, fs: float, filtering: Filtering) -> np.ndarray:
    """`samples`, (n,) or (n, k), at `fs` [Hz] through the zero-phase low-pass of a `filtering`, if it has one."""
    if filtering.lowpass is None:
        return np.asarray(samples, float)
    return zero_phase_lowpass(samples, filtering.lowpass, filtering.order, fs)


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


def motion_of(
    time: np.ndarray,
    position: np.ndarray,
    command: np.ndarray,
    filtering: Filtering,
    *,
    gain: float = 1.0,
    back_emf: float = 0.0,
    fs: float | None = None,
    start: str = "measured",
    **more,
) -> Motion:
    """A motion from arrays: filtered once, differentiated, the effort beside it.

    Parameters
    ----------
    time, position, command : ndarray, shape (n,)
        Evenly sampled [s]; [rad or m]; the drive's command, or the effort at the joint itself.
    filtering : Filtering
    gain, back_emf : float
        effort = gain * command - back_emf * velocity.
    fs : float, optional
        Sampling rate [Hz]; from the first and last time if left out.
    start : {"measured", "rest"}
        What a simulation starts from.
    **more
        Other fields of `Motion`: `recording`, `split`, `reference`, `injected`, `payload`.

    Returns
    -------
    Motion

    Raises
    ------
    RecordingError
        If there are too few samples for the filter, or the low-pass is not below half the sampling rate.
    """
    rate = (len(time) - 1) / float(time[-1] - time[0]) if fs is None else fs
    try:
        smooth, velocity, acceleration = differentiate(position, rate, filtering)
        effort = gain * lowpassed(command, rate, filtering) - back_emf * velocity
    except ValueError as error:
        raise RecordingError(str(error)) from None
    return Motion(
        fs=rate,
        time=time,
        position=smooth,
        velocity=velocity,
        acceleration=acceleration,
        effort=effort,
        filtering=filtering,
        raw_position=position,
        command=command,
        initial=initial_state(position, rate, start),
        **more,
    )


def shortest(filtering: Filtering) -> int:
    """Samples below which a stretch leaves nothing to regress on."""
    return max(2 * filtering.trim + 30 * filtering.decimate, 60)
