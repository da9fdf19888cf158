"""One recorded trial: named channels over one time axis, in SI, with their source.

Trim the ends of a recording at which channels that are needed have no samples.

An amplifier is stopped before the motion capture, or started after it, and exports fill the rest with empty cells. What
lies between the ends is whole, and is used.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from .._errors import RecordingError
from .clock import BLOCK_SAMPLES, SampleClock, loses_samples_only, sample_clock, step_range
from .cut import MAX_EVEN_JITTER, MIN_GAP_JITTER_RATIO, MIN_GAP_STEP_RATIO, Cut, sound_samples, spans_between
from .optical import OpticalRecording

MAXIMAL_PROTOCOL = "mvc"
"""Protocol of a maximal contraction. Its EMG alone is used, so that its file may lack every other channel."""

LOCKED_SPRING_PROTOCOL = "locked_spring"
"""Protocol of a recording in which one end of a spring is locked and the other is driven."""

NEGLIGIBLE_JITTER = 0.01
"""If no time step is off by more than this share, the largest deviation is reported as the jitter. Its percentile is
then not needed."""


@dataclass(frozen=True, eq=False)
class Channel:
    """Samples of one signal.

    Attributes
    ----------
    name : str
        Name of the channel, such as ``"position"`` or ``"emg.biceps"``.
    samples : ndarray, shape (n,)
        Values in `unit`, float64, read-only; a missing sample is NaN.
    unit : str
        SI unit, as plain text.
    column : str or int
        Name or number of its column in the file.
    """

    name: str
    samples: np.ndarray
    unit: str
    column: str | int

    def __post_init__(self):
        # A copy is needed only if the caller can still write into the samples.
        samples = np.asarray(self.samples, dtype=np.float64)
        if samples.ndim != 1:
            raise RecordingError(f"channel {self.name}: found shape {samples.shape}, expected (n,)")
        if samples.flags.writeable:
            samples = samples.copy()
            samples.flags.writeable = False
        object.__setattr__(self, "samples", samples)

    def __len__(self) -> int:
        return len(self.samples)

    @property
    def unit_words(self) -> str:
        """Unit for a sentence, with a blank before it; "" without a dimension."""
        return "" if self.unit in ("", "1") else f" {self.unit}"

    def within(self, span: slice) -> Channel:
        """Return the channel with only the samples in a `span`."""
        return replace(self, samples=self.samples[span])


@dataclass(frozen=True)
class Payload:
    """A mass fixed to the moving segment."""

    mass: float | None  # mass [kg]; None if it is unknown
    distance: float = 0.0  # distance of the mass's centre from the joint's axis [m]; 0 for a prismatic joint


@dataclass(frozen=True, eq=False)
class Recording:
    """One trial of a study.

    Attributes
    ----------
    name : str
        Name of the recording, which is part of the ids of its figures.
    path : Path
        The file.
    checksum : str
        SHA-256 of the file, hexadecimal.
    use : str
        ``"fit"`` or ``"validate"``; a validating recording is never fitted.
    channels : Mapping[str, Channel]
        Channels of one length n, ``"time"`` [s] among them.
    protocol, participant, condition : str or None
        Names from study.toml.
    repetition : int or None
        Number of the repetition, from 1, if study.toml states it.
    period : int or None
        Position of the trial in the participant's order, from 1, if study.toml states it.
    amplitude : float or None
        Signed distance that each movement was to cover [rad or m], if no channel records it.
    payload : Payload or None
        Known mass carried during the trial.
    start : str
        Initial state of a simulation of the trial: ``"measured"`` or at ``"rest"``.
    optical : OpticalRecording or None
        Motion capture of the trial; the whole file, even if the recording is a window.
    slider : float or None
        Distance from the axis at which the carriage was clamped, measured with a ruler [m].
    streams : Mapping[str, Recording]
        Recordings of the trial by other instruments, each on its own clock; whole files, even if the recording is a
        window.
    cuts : tuple of Cut
        Stretches with defects, and those that study.toml excludes, in order of time.
    repeats : int
        Number of rows that were excluded because a packet was delivered twice.
    bridged : int
        Number of rows with a missing sample that was interpolated.
    smooth_stamps : str
        Whether time stamps are smoothed: ``"automatic"``, ``"always"`` or ``"never"``.
    uncut : Recording or None
        Time and EMG of the whole file, if the recording is a window of a file with EMG. Filters need the samples around
        a window.
    piece_of : str
        Name of the recording that this is a piece of, between two cuts; "" for a whole one.

    Raises
    ------
    RecordingError
        If there is no time, or channels differ in length.
    """

    name: str
    path: Path
    checksum: str
    use: str
    channels: Mapping[str, Channel] = field(repr=False)
    protocol: str | None = None
    participant: str | None = None
    condition: str | None = None
    payload: Payload | None = None
    start: str = "measured"
    optical: OpticalRecording | None = None
    slider: float | None = None
    streams: Mapping[str, Recording] = field(default_factory=dict, repr=False)
    amplitude: float | None = None
    repetition: int | None = None
    period: int | None = None
    cuts: tuple[Cut, ...] = ()
    repeats: int = 0
    bridged: int = 0
    smooth_stamps: str = "automatic"
    uncut: Recording | None = field(default=None, repr=False)
    piece_of: str = ""

    def __post_init__(self):
        if "time" not in self.channels:
            raise RecordingError(f"{self.path.name}: no time channel; found {', '.join(self.channels) or 'none'}")
        n = len(self.channels["time"])
        for channel in self.channels.values():
            if len(channel) != n:
                raise RecordingError(
                    f"{self.path.name}: channel {channel.name} (column {channel.column!r}) has {len(channel)} samples, "
                    f"expected {n} as in time"
                )
        object.__setattr__(self, "channels", MappingProxyType(dict(self.channels)))
        object.__setattr__(self, "streams", MappingProxyType(dict(self.streams)))

    def __getitem__(self, name: str) -> np.ndarray:
        try:
            return self.channels[name].samples
        except KeyError:
            raise RecordingError(
                f"{self.path.name} (recording {self.name}): no channel {name}; study.toml gives it "
                f"{', '.join(self.channels)}"
            ) from None

    def of_joints(self, quantity: str, joints: Sequence[str]) -> np.ndarray:
        """Return a quantity of several joints, as in ``r.of_joints("position", ["shoulder", "elbow"])``.

        Parameters
        ----------
        quantity : str
            First part of the channels' names.
        joints : sequence of str
            Last part of the channels' names. Channels of a recording's only joint may lack it.

        Returns
        -------
        ndarray, shape (n, joints)
            Samples in SI, one column per joint, in the given order.

        Raises
        ------
        RecordingError
            If a joint has no such channel, or several joints' units differ.
        """
        names = [f"{quantity}.{joint}" for joint in joints]
        if len(names) == 1 and names[0] not in self:
            names = [quantity]
        columns = [self[name] for name in names]
        units = dict.fromkeys(self.channels[name].unit for name in names)
        if len(units) > 1:
            raise RecordingError(
                f"{self.path.name} (recording {self.name}), channels {', '.join(names)}: found the units "
                f"{', '.join(units)}, expected one for all"
            )
        return np.column_stack(columns) if columns else np.empty((len(self), 0))

    def stream(self, name: str) -> Recording:
        """Return the recording of this trial by another instrument.

        Raises
        ------
        RecordingError
            If study.toml gives this recording no such stream.
        """
        try:
            return self.streams[name]
        except KeyError:
            raise RecordingError(
                f"{self.path.name} (recording {self.name}): no stream {name}; study.toml gives it "
                f"{', '.join(self.streams) or 'none'}"
            ) from None

    def stream_or_self(self, name: str) -> Recording:
        """Return the recording of this trial by another instrument, or this one, if its own file has what is asked."""
        return self.streams.get(name, self)

    @property
    def trial(self) -> str:
        """Name of the trial: that of the whole recording, of which this may be a piece."""
        return self.piece_of or self.name

    def __contains__(self, name: object) -> bool:
        return name in self.channels

    def __len__(self) -> int:
        return len(self.channels["time"])

    @property
    def time(self) -> np.ndarray:
        """Time on the file's own clock, shape (n,) [s]."""
        return self.channels["time"].samples

    @cached_property
    def _step_range(self) -> tuple[float, float]:
        """Shortest and longest time step of a long recording [s]; NaN for a short one, or if a time is missing."""
        if len(self) < BLOCK_SAMPLES:
            return np.nan, np.nan
        return step_range(self.time)

    @cached_property
    def fs(self) -> float:
        """Sampling rate, the reciprocal of the mean time step without gaps [Hz].

        Raises
        ------
        RecordingError
            If there are fewer than two samples or time does not advance.
        """
        shortest, longest = self._step_range
        if shortest > 0.0 and longest < MIN_GAP_STEP_RATIO * shortest:
            # No step is a gap, so that a long recording does not need its median.
            first, last = self.time[[0, -1]]
            return (len(self) - 1) / float(last - first)
        steps = np.diff(self.time)
        steps = steps[np.isfinite(steps) & (steps > 0.0)]
        if steps.size == 0:
            raise RecordingError(
                f"{self.path.name} (recording {self.name}): time does not advance, so that there is no sampling rate; "
                "check the column of channel time, or state its rate"
            )
        # The median alone is only as fine as the clock's last digit; the mean alone would count gaps.
        return 1.0 / float(np.mean(steps[steps < MIN_GAP_STEP_RATIO * np.median(steps)]))

    @cached_property
    def advances(self) -> bool:
        """Whether time increases with every sample; missing times are ignored."""
        if self._step_range[0] > 0.0:
            return True
        time = self.time[np.isfinite(self.time)]
        return len(time) > 1 and bool(np.all(np.diff(time) > 0.0))

    def steps_within(self, max_step: float) -> bool:
        """Whether no time is missing and every time step is above 0 and at most `max_step` [s]."""
        shortest, longest = self._step_range
        return shortest > 0.0 and longest <= max_step

    @cached_property
    def longest_step(self) -> float:
        """Longest time step without a missing sample [s]: half as long again as usual, more if the clock jitters."""
        usual = MIN_GAP_STEP_RATIO / self.fs
        if self._step_range[1] <= usual:
            return usual
        steps = np.diff(self.time)
        steps = steps[np.isfinite(steps)]
        if steps.max(initial=0.0) <= usual:
            return usual
        return max(usual, MIN_GAP_JITTER_RATIO * float(np.quantile(steps[:: max(1, len(steps) // 200_000)], 0.98)))

    @cached_property
    def jitter(self) -> float:
        """99th percentile of the deviations of time steps, as a share of the usual step; the largest if negligible."""
        shortest, longest = self._step_range
        largest = max(longest * self.fs - 1.0, 1.0 - shortest * self.fs) if shortest > 0.0 else np.inf
        if largest < NEGLIGIBLE_JITTER:
            return largest
        steps = np.diff(self.time)
        steps = steps[steps <= self.longest_step]
        return float(np.quantile(np.abs(steps * self.fs - 1.0), 0.99)) if steps.size else 0.0

    @cached_property
    def loses_samples(self) -> bool:
        """Whether steps of the time are whole numbers of the usual step, because samples are lost now and then."""
        if len(self) < 3 or not self.advances or not np.isfinite(self.time).all():
            return False
        near = np.diff(self.time) <= self.longest_step
        return loses_samples_only(self.time, self.spans, near, 1.0 / self.fs)

    @property
    def clock(self) -> SampleClock:
        """Estimated times of the samples."""
        return self._smoothed_clock or SampleClock(self.time)

    @cached_property
    def _smoothed_clock(self) -> SampleClock | None:
        """Smoothed times of the samples; None where the stamps stand, of which no copy is kept.

        Unless `smooth_stamps` decides it, stamps are smoothed only if they jitter, are not those of a clock that loses
        samples, and fit the recorded motion better when they are smoothed: a stamp then records the arrival of a
        sample."""
        names = [name for name in self.channels if name.partition(".")[0] in ("position", "motor_position")]
        if not names or len(self) < 3 or not self.advances or not np.isfinite(self.time).all():
            return None
        always = self.smooth_stamps == "always"
        if self.smooth_stamps == "never" or not (always or (self.jitter > MAX_EVEN_JITTER and not self.loses_samples)):
            return None
        nothing = Channel("velocity", np.full(len(self), np.nan), "", "")
        velocities = [self.channels.get(name.replace("position", "velocity", 1), nothing) for name in names]
        found = sample_clock(
            self.time,
            np.column_stack([self[name] for name in names]),
            np.column_stack([velocity.samples for velocity in velocities]),
            self.spans,
            np.diff(self.time) <= self.longest_step,
            always=always,
        )
        return found if found.window > 0 else None

    @property
    def stamped_evenly(self) -> bool:
        """Whether stamps are smoothed, because they jitter around an even clock."""
        return self._smoothed_clock is not None

    @cached_property
    def enabled(self) -> np.ndarray:
        """Mask of the samples with all drives on, shape (n,) bool; all True if no channel ``enabled`` is recorded."""
        on = np.ones(len(self), dtype=bool)
        for name in self.channels:
            if name.partition(".")[0] == "enabled":
                on &= self[name] != 0.0
        on.flags.writeable = False
        return on

    @cached_property
    def sound(self) -> np.ndarray:
        """Mask of the samples outside all cuts, shape (n,) bool."""
        sound = sound_samples(len(self), self.cuts)
        sound.flags.writeable = False
        return sound

    @cached_property
    def spans(self) -> tuple[slice, ...]:
        """Spans of samples between cuts and gaps, in order; no filter may cross their borders."""
        return spans_between(len(self), self.cuts)


def channels_within(recording: Recording, span: slice) -> dict[str, Channel]:
    """Return all channels of a recording with only the samples in a `span`."""
    return {name: channel.within(span) for name, channel in recording.channels.items()}


def make_cut(recording: Recording, kind: str, channel: str, *, first: int, last: int, found: str) -> Cut:
    """Return the cut of a recording's samples `first` to `last`, both included; a gap has `last` before `first`."""
    time = recording.time
    stop = float(time[last + 1] if last + 1 < len(time) else time[-1] + 1.0 / recording.fs)
    start = float(time[first] if first <= last else time[last])
    return Cut(kind, channel, start, stop, int(first), int(last), found)


EMPTY_END_KIND = "empty_end"
"""Kind of the cut that describes trimmed samples. It contains no remaining sample."""

MAX_TRIMMED_SHARE = 0.5
"""A recording is trimmed only if at least half of it is left. Chosen by judgement; no measurement is recorded."""


def trim_missing_ends(recording: Recording, channels: Collection[str]) -> Recording:
    """Return a recording without the rows at its ends in which one of some channels has no sample (NaN).

    Missing samples between two whole parts stay, and so does everything if less than half would be left.
    """
    missing = [~np.isfinite(recording[name]) for name in channels]
    if not missing:
        return recording
    whole = np.flatnonzero(~np.any(missing, axis=0))
    if not len(whole):
        return recording
    lacking = [
        name
        for name, lost in zip(channels, missing, strict=True)
        if lost[: whole[0]].any() or lost[whole[-1] + 1 :].any()
    ]
    text = f"no samples (NaN) of {', '.join(lacking)}"
    return _keep_rows(recording, slice(int(whole[0]), int(whole[-1]) + 1), text)


def within_streams(recording: Recording) -> Recording:
    """Return a recording cut to the times of those of its streams whose ends were trimmed."""
    for name, stream in recording.streams.items():
        if not any(cut.kind == EMPTY_END_KIND for cut in stream.cuts):
            continue
        first = int(np.searchsorted(recording.time, stream.time[0]))
        kept = slice(first, int(np.searchsorted(recording.time, stream.time[-1], side="right")))
        recording = _keep_rows(recording, kept, f"nothing of the stream {name}, which was trimmed")
    return recording


def _keep_rows(recording: Recording, kept: slice, text: str) -> Recording:
    """Return some rows of a recording, with a cut at each end that was trimmed; all if too few would be left."""
    n = len(recording)
    if (kept.start, kept.stop) == (0, n) or kept.stop - kept.start < max(2, (1.0 - MAX_TRIMMED_SHARE) * n):
        return recording
    channels = {name: replace(c, samples=c.samples[kept]) for name, c in recording.channels.items()}
    time, left = recording.time, kept.stop - kept.start
    cuts = [
        replace(cut, first=cut.first - kept.start, last=cut.last - kept.start)
        for cut in recording.cuts
        if cut.first < kept.stop and cut.last >= kept.start
    ]
    if kept.start:
        found = f"{text} in the first {kept.start} of {n} rows"
        cuts.insert(0, Cut(EMPTY_END_KIND, "time", float(time[0]), float(time[kept.start]), 0, -1, found))
    if kept.stop < n:
        found = f"{text} in the last {n - kept.stop} of {n} rows"
        at = float(time[kept.stop - 1])
        cuts.append(Cut(EMPTY_END_KIND, "time", at, at, left, left - 1, found))
    return replace(recording, channels=channels, cuts=tuple(cuts))
