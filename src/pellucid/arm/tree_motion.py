"""A recording of all joints of a robot made ready for identification: filtered and decimated, both sides alike.

A robot some of whose joints are held: they become welds, at the place where they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from .._errors import RecordingError
from ..numerics.filters import central_difference, runs, zero_phase_lowpass
from ..numerics.motion import Filtering, JudgedData, lowpassed


@dataclass(frozen=True)
class SegmentSettings:
    """How a recording is divided into segments."""

    default_part_count: int = 10  # a recording whose joints do not stop together is divided into this many equal parts
    # A recording is divided at its common stops if there are at least this many, otherwise into equal parts.
    min_common_stops: int = 4
    # A segment must have at least this many rows with motion; shorter ones are joined to the one before.
    min_segment_rows: int = 20


SEGMENT_SETTINGS = SegmentSettings()

THINNING_CUTOFF_SHARE = 0.8
"""Cut-off of the filter before samples are dropped, as a share of half the rate that is left."""

THINNING_ORDER = 8
"""Order of one pass of that filter. It is maximally flat (Butterworth)."""


class CarriedPayload(Protocol):
    """A mass that a link of the robot carries."""

    @property
    def mass(self) -> float | None:
        """Mass [kg], None if it is unknown."""

    @property
    def link(self) -> str | None:
        """Name of the link, None for the last one."""

    @property
    def centre(self) -> tuple[float, float, float] | None:
        """Centre of the mass in the link's frame [m], None if it is unknown."""


@dataclass(frozen=True, eq=False)
class RecordedSpeeds:
    """Speeds at the rate of a recording, and the filter of its effort.

    Friction jumps where a joint turns. The low-pass of the effort rounds these jumps, so the model's friction passes
    the same filter before rows are taken.
    """

    velocity: np.ndarray  # (N, m) [rad/s; m/s]
    rate: float  # [Hz]
    filtering: Filtering  # that of the effort
    inner: slice  # samples that are kept at the recorded rate
    thinning: Filtering  # its decimation makes rows of them

    def rows(self, friction: np.ndarray) -> np.ndarray:
        """Return the rows, (n,), of friction at the recorded rate, (N,)."""
        return _thinned(lowpassed(friction, self.rate, self.filtering)[self.inner], self.rate, self.thinning)


@dataclass(frozen=True)
class TreeMotion:
    """Rows of one uninterrupted stretch of a recording; n rows, m joints in the order of the robot's coordinates."""

    recording: str
    use: Literal["fit", "validate"]
    # time (n,) [s]; position, velocity, acceleration (n, m) [rad; m, and per second]
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray  # (n, m) at the joints, after gears and through the transposed transmission [N m; N]
    moving: np.ndarray  # (n, m) bool: rows that count for a joint, and for the motors that turn with it
    segment: np.ndarray  # (n,) int: stretch between common stops, or equal parts; -1: belongs to none
    still: np.ndarray | None = None  # (n, m) bool: rows in which a joint is within its dead band
    protocol: str | None = None
    payload: CarriedPayload | None = None
    # drive (n, m): what each motor's drive reports, in its own unit, less what back-EMF takes; gain (m,): effort at the
    # joint per that unit, 1 or -1 where it is not known: effort = (gain * drive) @ turns
    drive: np.ndarray | None = None
    gain: np.ndarray | None = None
    drive_units: tuple[str, ...] = ()  # "A", "V", "N*m" or "N", of each motor
    gain_known: tuple[bool, ...] = ()  # whether each motor's gain is known; else its effort is in its drive's unit
    desired: np.ndarray | None = None  # (n, m) the controller's own rigid-body effort, where it was recorded [N m; N]
    desired_drive: np.ndarray | None = None  # (n, m) the drive that the controller asked for, in the drive's unit
    rate: float = float("nan")  # rate of the rows [Hz]
    recorded: RecordedSpeeds | None = None  # None where the rows are all there is

    def friction(self, law: Callable[[np.ndarray], np.ndarray], turn: np.ndarray) -> np.ndarray:
        """Return friction of a `law` of the speed velocity @ `turn`, filtered as the effort is, in all rows, (n,)."""
        if self.recorded is None:
            return law(self.velocity @ turn)
        return self.recorded.rows(law(self.recorded.velocity @ turn))

    def __len__(self) -> int:
        return len(self.time)


class JudgedTreeMotion(TreeMotion, JudgedData):
    """A held-out stretch: errors and the verdict on the prediction may depend on it, and nothing else."""


def fitted_without_payload(motions: Sequence[TreeMotion]) -> list[TreeMotion]:
    """Return the motions without a payload that may be fitted."""
    return [m for m in motions if m.payload is None and m.use == "fit"]


def tree_motion_of(
    time: np.ndarray,
    position: np.ndarray,
    drive: np.ndarray,
    filtering: Filtering,
    *,
    fs: float | None = None,
    gain: np.ndarray | None = None,
    back_emf: np.ndarray | None = None,
    turns: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    desired: np.ndarray | None = None,
    desired_drive: np.ndarray | None = None,
    effort_lowpass: float | None = None,
    dead_band: Sequence[float] | float | None = None,
    segments: int | Sequence[float] | None = None,
    recording: str = "",
    use: Literal["fit", "validate"] = "fit",
    **more,
) -> TreeMotion:
    """Rows from evenly sampled arrays: `time` (n,) [s], `position` and `drive` (n, m).

    A `velocity` (n, m) that was recorded takes the place of the position's. `effort_lowpass` [Hz]: of effort alone.
    `back_emf` (m,) is what a motor's own speed takes off its effort [N m s/rad; N s/m].
    `dead_band` [rad/s; m/s] of each joint, of all, or the filtering's. `segments`: ends of each [s], how many equal
    parts, or None: between common stops.
    """
    m = position.shape[1]
    rate = (len(time) - 1) / float(time[-1] - time[0]) if fs is None else fs
    gain = np.ones(m) if gain is None else np.asarray(gain, float)
    turns = np.eye(m) if turns is None else np.asarray(turns, float)
    slow = np.broadcast_to(np.asarray(filtering.dead_band if dead_band is None else dead_band, float), (m,))
    of_effort = filtering if effort_lowpass is None else Filtering(effort_lowpass, filtering.order)
    try:
        q = lowpassed(position, rate, filtering)
        v = central_difference(q, rate) if velocity is None else lowpassed(velocity, rate, filtering)
        a = central_difference(v, rate)
        u = lowpassed(drive, rate, of_effort)
        wanted, asked = (None if x is None else lowpassed(x, rate, of_effort) for x in (desired, desired_drive))
    except ValueError as error:
        raise RecordingError(str(error)) from None
    inner = slice(filtering.trim, len(time) - filtering.trim)
    recorded = None if of_effort.lowpass is None else RecordedSpeeds(v, rate, of_effort, inner, filtering)
    q, v, a, u = (_thinned(x[inner], rate, filtering) for x in (q, v, a, u))
    wanted, asked = (None if x is None else _thinned(x[inner], rate, filtering) for x in (wanted, asked))
    kept = time[inner][:: filtering.decimate]
    if back_emf is not None and np.any(back_emf):
        u = u - back_emf / gain * (v @ turns.T)
    moving = moving_rows(v, slow, turns)
    return (TreeMotion if use == "fit" else JudgedTreeMotion)(
        recording=recording,
        use=use,
        time=kept,
        position=q,
        velocity=v,
        acceleration=a,
        effort=(gain * u) @ turns,
        moving=moving,
        still=np.abs(v) <= slow,
        segment=segments_of(kept, moving, np.abs(v) <= slow, segments),
        drive=u,
        gain=gain,
        desired=wanted,
        desired_drive=asked,
        rate=rate / filtering.decimate,
        recorded=recorded,
        **more,
    )


def moving_rows(velocity: np.ndarray, dead_band: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Rows (n, m) in which a joint, and every motor that turns with it, is faster than its dead band (m,)."""
    fast = np.abs(velocity) > dead_band
    turning = np.abs(velocity @ turns.T) > dead_band
    moving = fast.copy()
    for motor in np.flatnonzero(np.count_nonzero(turns, axis=1) > 1):
        moving[:, turns[motor] != 0.0] &= turning[:, [motor]]
    return moving


def segments_of(
    time: np.ndarray, moving: np.ndarray, still: np.ndarray, asked: int | Sequence[float] | None = None
) -> np.ndarray:
    """Return the segment of each row, shape (n,), counted from 0; -1 for none. `moving` and `still` are (n, m) bool."""
    if asked is not None and not isinstance(asked, int):
        ends = np.asarray(asked, float)
        found = np.searchsorted(ends, time, side="right")
        return np.where(found < len(ends), found, -1)
    if asked is None:
        stops = runs(np.asarray(still.all(axis=1)))
        within = [stop for stop in stops if stop.start > 0 and stop.stop < len(time)]
        if len(within) >= SEGMENT_SETTINGS.min_common_stops:
            return _between(stops, np.asarray(moving.any(axis=1)))
    parts = min(asked or SEGMENT_SETTINGS.default_part_count, max(len(time) // SEGMENT_SETTINGS.min_segment_rows, 1))
    return np.arange(len(time)) * parts // max(len(time), 1)


def _between(stops: list[slice], moves: np.ndarray) -> np.ndarray:
    """Rows numbered from stop to stop; those of a stop belong to none."""
    n = len(moves)
    segment, number, gathered = np.full(n, -1), 0, 0
    edges = [0, *(x for stop in stops for x in (stop.start, stop.stop)), n]
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if start == stop:
            continue
        if gathered >= SEGMENT_SETTINGS.min_segment_rows:
            number, gathered = number + 1, 0
        segment[start:stop] = number
        gathered += int(moves[start:stop].sum())
    if 0 < gathered < SEGMENT_SETTINGS.min_segment_rows and number > 0:
        segment[segment == number] = number - 1
    return segment


def _thinned(samples: np.ndarray, rate: float, filtering: Filtering) -> np.ndarray:
    """Return every n-th sample, without a second filter if the low-pass already prevents aliasing.

    Efforts depend on angles by sines. A filter with ripple, which changes every angle by about one percent, would
    therefore not commute with the model, and the error would look like a spring.
    """
    factor = filtering.decimate
    if factor == 1 or (filtering.lowpass is not None and filtering.lowpass <= 0.25 * rate / factor):
        return samples[::factor]
    cutoff = THINNING_CUTOFF_SHARE * 0.5 * rate / factor
    return zero_phase_lowpass(samples, cutoff, THINNING_ORDER, rate)[::factor]
