"""Motion prepared for identification: filtered once, differentiated, with the effort at the same samples.

Long motions are filtered piece by piece, each piece with its own borders, and downsampled before decimation.

Pieces follow each other without a gap: the trimmed border of one lies inside its neighbours. Within the trimmed border
the low-pass's transient decays to one part in 10^13, so that the pieces equal one pass over the whole motion.

Held-out data have types of their own, which no fit accepts.

A recording with ``use = "validate"`` may reach reported errors and the verdict on the prediction, and nothing else.
Data from such a recording derive from `JudgedData`, and every function that fits, scales or chooses calls
`require_fitted`.

Speed of a movement, and the samples from its onset to its end.

Onset, peak and end of a movement are decided by its speed, the norm of its tangential velocity. A velocity along one
direction is no substitute: an overshoot and its correction backwards would not count.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from .. import _core
from .._errors import PellucidError, RecordingError
from ..models.filtered_dynamics import share_smooth_regressor
from .filters import central_difference, decimate, decimation_memory, lowpass_memory, zero_phase_lowpass


class JudgedData:
    """Mark of held-out data: recordings, and motions and records made of them."""

    __slots__ = ()


class JudgedDataInFitError(PellucidError, TypeError):
    """Held-out data were given to a function that fits, scales or chooses. It is an error in the program."""


def require_fitted(parts: Iterable[object], what: str) -> None:
    """Raise a `JudgedDataInFitError` if any of `parts` is held out; `what` names the function that was called."""
    held = [part for part in parts if isinstance(part, JudgedData)]
    if held:
        names = ", ".join(dict.fromkeys(str(getattr(part, "recording", getattr(part, "name", "?"))) for part in held))
        raise JudgedDataInFitError(f"{what}: found held-out data ({names}), expected fitted recordings only")


SLOW_SHARE = 0.02


@dataclass(frozen=True)
class Filtering:
    """What is done to position and effort alike before a regression."""

    lowpass: float | None  # Cut-off of the zero-phase Butterworth low-pass [Hz]; None for none
    order: int = 4  # order of one pass of the filter
    decimate: int = 1  # one sample in this many enters a regression
    dead_band: float = 0.0  # slower samples are excluded [rad/s or m/s]
    trim: int = 0  # samples dropped at either border, where the filter has not settled
    thin: int = 1  # for a piece of a long motion: factor of thinning between the low-pass and the decimation
    margin: int = 0  # for a piece of a long motion: rows beyond the trimmed borders that only settle the decimation
    # Cut-off of the position whose turns change the sign of friction, over that of the low-pass. A low-pass rounds the
    # jump of acceleration at a turn, and so moves the turn.
    direction_share: float = 1.0
    presliding_travel: float = 0.0  # friction builds up over this distance after a turn [rad or m]; 0: at once

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
        if self.direction_share > 1.0 and self.lowpass:
            parts.append(f"friction turns with the position low-passed at {self.direction_share * self.lowpass:g} Hz")
        if self.presliding_travel:
            parts.append(f"friction builds up over {1e3 * self.presliding_travel:.3g} m{unit.partition('/')[0]}")
        if self.trim:
            parts.append(f"{self.trim} samples dropped at either border")
        if self.decimate > 1:
            parts.append(f"both sides decimated by {self.decimate}")
        if self.dead_band:
            parts.append(
                f"samples excluded that depend by more than {SLOW_SHARE:.0%} on velocities below {self.dead_band:g} "
                f"{unit}"
            )
        return "; ".join(parts)


@dataclass(frozen=True)
class Motion:
    """One uninterrupted stretch of a recording."""

    fs: float  # Sampling rate [Hz]
    # time, position, velocity, acceleration, effort: (n,) SI; filtered with the same zero-phase low-pass. Effort is at
    # the joint, in the drive's effort unit
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray
    filtering: Filtering
    recording: str = ""  # recording, split: The recording's name, and "fitted" or "heldout"
    split: str = "fitted"
    # raw_position, command: (n,) As recorded [rad or m; the drive's unit]: what a simulation starts from and is driven
    # by
    raw_position: np.ndarray | None = None
    command: np.ndarray | None = None
    # reference, injected: (n,) What the machine's own controller followed, and what was added after its limit
    reference: np.ndarray | None = None
    injected: np.ndarray | None = None
    payload: tuple[float, float] = (0.0, 0.0)  # Known added mass and its distance from the axis [kg, m]
    initial: tuple[float, float] = (0.0, 0.0)  # Position and velocity where a simulation starts [rad or m; per second]
    # (n,) -1 to 1: what takes the place of the sign of velocity where friction gives before it slips
    direction: np.ndarray | None = None
    # (n,) [rad/s or m/s]: the velocity with the sign of the direction of motion, if that is sharper than the velocity's
    slip_velocity: np.ndarray | None = None

    @cached_property
    def count(self) -> int:
        """Number of samples, for which stored ones are read once."""
        return len(self.position)

    @property
    def inner(self) -> slice:
        """Samples left after trimming either border."""
        return slice(self.filtering.trim, self.count - self.filtering.trim)

    def reduce(self, samples: np.ndarray) -> np.ndarray:
        """Trim and decimate: the last, common step of both sides of a regression. `samples` (n,); gives (m,)."""
        f, rows = self.filtering, self.inner
        wide = slice(rows.start - f.margin * f.decimate, rows.stop + f.margin * f.decimate)
        reduced = decimate(samples[wide][:: f.thin], f.decimate // f.thin)
        return reduced[f.margin : len(reduced) - f.margin]

    def smooth(self, samples: np.ndarray, share: float = 1.0) -> np.ndarray:
        """The low-pass that position and effort went through, for what a model makes of the sign of velocity.
        `samples` (n,). The cut-off is `share` times that of the motion."""
        filtering = self.filtering
        if share != 1.0 and filtering.lowpass:
            filtering = replace(filtering, lowpass=share * filtering.lowpass)
        return lowpassed(samples, self.fs, filtering)

    def rows(self, samples: np.ndarray) -> np.ndarray:
        """The samples, (n,) or (n, k), that a regression uses."""
        return self.reduce(samples)[self.moving]

    @property
    def states(self) -> np.ndarray:
        """Time, position, velocity, acceleration and effort of the rows, shape (m, 5)."""
        return self.state_columns.T

    @cached_property
    def state_columns(self) -> np.ndarray:
        """The same, one after the other, shape (5, m): predictions of all models share them."""
        signals = np.column_stack([self.position, self.velocity, self.acceleration, self.effort])
        return np.vstack([self.time[self.kept], self.rows(signals).T])

    @property
    def kept(self) -> np.ndarray:
        """Samples at which rows are taken, shape (m,)."""
        return np.arange(self.count)[self.inner][:: self.filtering.decimate][self.moving]

    @cached_property
    def moving(self) -> np.ndarray:
        """Reduced samples of which filters drew no more than `SLOW_SHARE` from samples slower than the dead band, shape
        (m,): those a regression uses."""
        dead_band = self.filtering.dead_band
        slow = (np.abs(self.velocity) <= dead_band).astype(float)
        if dead_band <= 0.0 or not slow.any():
            return np.ones(len(range(len(slow))[self.inner][:: self.filtering.decimate]), bool)
        return np.abs(self.reduce(self.smooth(slow))) < SLOW_SHARE


class JudgedMotion(Motion, JudgedData):
    """A held-out motion: errors and the verdict on the prediction may depend on it, and nothing else."""


def differentiate(position: np.ndarray, fs: float, filtering: Filtering) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Low-passed position, velocity and acceleration, each (n,), of `position` [rad or m] sampled at `fs` [Hz], by a
    `filtering`; simulated positions take this way too."""
    smooth = lowpassed(position, fs, filtering)
    velocity = central_difference(smooth, fs)
    return smooth, velocity, central_difference(velocity, fs)


MIN_SLIP_SPEED = 1e-9
"""Speed of a motion that has a direction but no velocity [rad/s or m/s]."""


def friction_signals(
    position: np.ndarray, velocity: np.ndarray, fs: float, filtering: Filtering
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """What decides on the sign of friction, of a recorded `position` and the filtered `velocity`, (n,), at `fs` [Hz].

    Gives `slip_velocity` and `direction` of a `Motion`; None where the sign of the velocity decides."""
    cutoff = filtering.lowpass and filtering.direction_share * filtering.lowpass
    sharp = replace(filtering, lowpass=cutoff)
    if filtering.presliding_travel:
        direction = _core.presliding(filtering.presliding_travel, lowpassed(position, fs, sharp))
        return None, direction
    if filtering.lowpass is None or filtering.direction_share <= 1.0:
        return None, None
    turning = central_difference(lowpassed(position, fs, sharp), fs)
    slip = np.copysign(np.maximum(np.abs(velocity), MIN_SLIP_SPEED), np.where(turning == 0.0, velocity, turning))
    return slip, None


def with_friction_direction(motion: Motion, share: float = 1.0, travel: float = 0.0) -> Motion:
    """The motion with its sign of friction from a position low-passed at `share` times its cut-off.

    Friction builds up over a `travel` [rad or m] after a turn. Pieces of long motions keep no recorded position, and
    thus the sign of their velocity."""
    if motion.raw_position is None:
        return motion
    filtering = replace(motion.filtering, direction_share=share, presliding_travel=travel)
    slip, direction = friction_signals(motion.raw_position, motion.velocity, motion.fs, filtering)
    made = replace(motion, filtering=filtering, slip_velocity=slip, direction=direction)
    vars(made)["moving"] = motion.moving  # a regression uses the same rows of both
    share_smooth_regressor(motion, made)
    return made


SETTLING_PERIODS = 2.0
"""Length over which a low-pass settles at either end of a recording, in periods of its cut-off. The second derivative
of a position needs it. With half a period, on a simulated arm that moves when its recording begins, the error of the
effort is ten times as large."""


def settling_samples(cutoff: float, fs: float) -> int:
    """Return the number of samples at `fs` [Hz] over which a low-pass of a `cutoff` [Hz] settles."""
    # A rate that rounding leaves above a whole number of samples needs no further sample.
    return int(np.ceil(round(SETTLING_PERIODS * fs / cutoff, 6)))


def lowpassed(samples: np.ndarray, fs: float, filtering: Filtering) -> np.ndarray:
    """`samples`, (n,) or (n, k), at `fs` [Hz] through the zero-phase low-pass of a `filtering`, if it has one."""
    if filtering.lowpass is None:
        return np.asarray(samples, float)
    return zero_phase_lowpass(samples, filtering.lowpass, filtering.order, fs)


START_SAMPLES = 20
"""First samples whose parabola gives a recording's initial state: a filter's border would spoil its derivative."""


def initial_state(position: np.ndarray, fs: float, start: str) -> tuple[float, float]:
    """Position and velocity at the first sample, from a parabola through the first samples. `position` (n,) [rad or
    m]; `fs` [Hz]; gives `position`, `velocity` [rad or m; per second]."""
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
    velocity: np.ndarray | None = None,
    **more,
) -> Motion:
    """Return a motion from arrays, filtered once and differentiated, with its effort.

    `time`, `position`, `command` (n,) [s], [rad or m]; `fs` [Hz]. A recorded `velocity`, (n,), replaces the derivative
    of `position`.
    """
    rate = (len(time) - 1) / float(time[-1] - time[0]) if fs is None else fs
    try:
        if velocity is None:
            smooth, velocity, acceleration = differentiate(position, rate, filtering)
        else:
            smooth, velocity = lowpassed(np.column_stack([position, velocity]), rate, filtering).T
            acceleration = central_difference(velocity, rate)
        effort = gain * lowpassed(command, rate, filtering) - back_emf * velocity
    except ValueError as error:
        raise RecordingError(str(error)) from None
    slip, direction = friction_signals(position, velocity, rate, filtering)
    return (JudgedMotion if more.get("split") == "heldout" else Motion)(
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
        slip_velocity=slip,
        direction=direction,
        **more,
    )


def shortest(filtering: Filtering) -> int:
    """Samples below which a stretch leaves nothing to regress on."""
    return max(2 * filtering.trim + 30 * filtering.decimate, 60)


MIN_LONG_SAMPLES = 60_000
"""Longer stretches are processed in pieces."""

PIECE_SAMPLES = 1 << 17
"""Approximate number of samples of a piece: few enough for the processor's cache, many compared with its borders."""

MIN_SAMPLES_PER_PERIOD = 4.0
"""Thinning leaves at least this many samples per period of the low-pass's cut-off."""

MOST_ROWS = 2_000_000
"""Rows of a regression that a stretch gives at most."""


def thinned(filtering: Filtering, fs: float, samples: int) -> Filtering:
    """The `filtering` of `samples` at `fs` [Hz] with as much thinning as its low-pass allows, and few enough rows."""
    most = 1 if filtering.lowpass is None else max(1, int(fs / (MIN_SAMPLES_PER_PERIOD * filtering.lowpass)))
    thin = max(k for k in range(1, most + 1) if filtering.decimate == 1 or filtering.decimate % k == 0)
    decimate = max(filtering.decimate, thin)
    fewer = -(-samples // (decimate * MOST_ROWS))
    return replace(filtering, thin=thin * fewer, decimate=decimate * fewer)


def pieces(
    time: np.ndarray,
    position: np.ndarray,
    command: np.ndarray,
    filtering: Filtering,
    *,
    fs: float,
    velocity: np.ndarray | None = None,
    **more,
) -> Iterator[Motion]:
    """A stretch as motions whose inner samples follow each other; `time`, `position`, `command`, a recorded `velocity`
    (n,) [s], [rad or m], in the drive's unit; `fs` [Hz]. What else `motion_of` takes goes to it."""
    f = thinned(filtering, fs, len(time))
    margin = -(-decimation_memory(f.decimate // f.thin) * f.thin // f.decimate)
    settled = 0 if f.lowpass is None else lowpass_memory(f.order, f.lowpass, fs)
    border = f.trim + f.decimate * (margin + max(0, -(-(settled - f.trim) // f.decimate)))
    rows = (len(time) - 2 * border) // f.decimate
    count = max(1, round(rows * f.decimate / max(PIECE_SAMPLES, 20 * border)))
    edges = [border + f.decimate * (i * rows // count) for i in range(count + 1)]
    own = replace(f, trim=border, margin=margin)
    for first, last in pairwise(edges):
        part = slice(first - border, last + border)
        recorded = None if velocity is None else velocity[part]
        # A view of the time would keep that of the whole stretch.
        made = motion_of(np.array(time[part]), position[part], command[part], own, fs=fs, velocity=recorded, **more)
        yield replace(made, raw_position=None, command=None)


def tangential_speed(velocity: np.ndarray) -> np.ndarray:
    """Return the norm of a `velocity`, shape (n,) of one coordinate or (n, d) of a point; shape (n,), same unit."""
    velocity = np.asarray(velocity, float)
    return np.abs(velocity) if velocity.ndim == 1 else np.linalg.norm(velocity, axis=1)


def moving_samples(speed: np.ndarray, threshold: float) -> tuple[int, int]:
    """Return the first and the last sample of a `speed` (n,), not all 0, above the share `threshold` of its largest."""
    above = np.flatnonzero(speed > threshold * np.max(speed))
    return int(above[0]), int(above[-1])
