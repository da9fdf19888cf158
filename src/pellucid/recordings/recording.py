"""One recorded trial: named channels over one time axis, in SI, with where they came from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from .._errors import RecordingError
from .clock import SampleClock, sample_clock
from .cut import BEYOND_JITTER, GAP_STEPS, Cut, sound_samples, spans_between
from .optical import OpticalRecording

LONG = 100_000
"""Samples from which on a recording's time steps are looked at in blocks of so many."""

NO_JITTER = 0.01
"""Share of a step: where no sample is off by more, how many are is nobody's question."""


@dataclass(frozen=True, eq=False)
class Channel:
    """Samples of one signal.

    Attributes
    ----------
    name : str
        ``"position"``, ``"emg.biceps"``.
    samples : ndarray, shape (n,)
        Values in `unit`, float64, read-only; NaN where a sample is missing.
    unit : str
        SI unit, as plain text.
    column : str or int
        What the file calls it.
    """

    name: str
    samples: np.ndarray
    unit: str
    column: str | int

    def __post_init__(self):
        # A copy only where the caller could still write into the samples.
        samples = np.asarray(self.samples, dtype=np.float64)
        if samples.ndim != 1:
            raise RecordingError(f"channel {self.name}: found shape {samples.shape}, expected (n,)")
        if samples.flags.writeable:
            samples = samples.copy()
            samples.flags.writeable = False
        object.__setattr__(self, "samples", samples)

    def __len__(self) -> int:
        return len(self.samples)


@dataclass(frozen=True)
class Payload:
    """A known mass fixed to the moving segment."""

    mass: float  # [kg]
    distance: float = 0.0  # From the joint's axis to the mass's centre [m]; 0 for a prismatic joint


@dataclass(frozen=True, eq=False)
class Recording:
    """One trial of a study.

    Attributes
    ----------
    name : str
        The recording's part of a figure's id.
    path : Path
        The file.
    checksum : str
        SHA-256 of the file, hexadecimal.
    use : str
        ``"fit"`` or ``"validate"``; a validating recording is never fitted.
    channels : Mapping[str, Channel]
        All of one length n, ``"time"`` [s] among them.
    protocol, participant, condition : str or None
        As study.toml names them.
    repetition : int or None
        Which time of several that the same was done, from 1, where study.toml says so.
    period : int or None
        When its participant did it, 1 first, where study.toml says so.
    amplitude : float or None
        How far each movement in it was to go, signed [rad or m], where no channel says so.
    payload : Payload or None
        Known mass carried during the trial.
    start : str
        Where a simulation of it starts: ``"measured"`` or at ``"rest"``.
    optical : OpticalRecording or None
        What a motion capture saw of the trial, all of it even where the recording is a window.
    slider : float or None
        Where the carriage was clamped, by a ruler: distance from the axis [m].
    streams : Mapping[str, Recording]
        What other instruments recorded of the trial, each on its own clock, all of it even where the recording is a
        window.
    cuts : tuple of Cut
        What was found in it that nothing is to be made of, and what study.toml excludes, by time.
    repeats : int
        Rows of the file, or of its window, that were left out because a packet was delivered twice.
    uncut : Recording or None
        Time and EMG of the whole file, where the recording is a window of a file that has EMG: filters need what lies
        around a window.

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
    uncut: Recording | None = field(default=None, repr=False)

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
        """A quantity of several joints: ``r.of_joints("position", ["shoulder", "elbow"])``.

        Parameters
        ----------
        quantity : str
            First part of the channels' names.
        joints : sequence of str
            Their last part. The only joint of a recording may be left out of its channel's name.

        Returns
        -------
        ndarray, shape (n, joints)
            SI, a column a joint, in the order given.

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
        """What an instrument recorded of this trial.

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

    def __contains__(self, name: object) -> bool:
        return name in self.channels

    def __len__(self) -> int:
        return len(self.time)

    @property
    def time(self) -> np.ndarray:
        """Time on the file's own clock, shape (n,) [s]."""
        return self.channels["time"].samples

    @cached_property
    def _step_range(self) -> tuple[float, float]:
        """Shortest and longest time step of a long recording [s]; NaN of another, or where a time is missing."""
        if len(self) < LONG:
            return np.nan, np.nan
        blocks = (np.diff(self.time[i : i + LONG + 1]) for i in range(0, len(self) - 1, LONG))
        shortest, longest = zip(*((steps.min(), steps.max()) for steps in blocks), strict=True)
        return float(np.min(shortest)), float(np.max(longest))

    @cached_property
    def fs(self) -> float:
        """Sampling rate, one over the mean time step, gaps left out [Hz].

        Raises
        ------
        RecordingError
            If there are fewer than two samples or time does not advance.
        """
        shortest, longest = self._step_range
        if shortest > 0.0 and longest < GAP_STEPS * shortest:
            # Of hours, without looking for the median.
            return (len(self) - 1) / float(self.time[-1] - self.time[0])
        steps = np.diff(self.time)
        steps = steps[np.isfinite(steps) & (steps > 0.0)]
        if steps.size == 0:
            raise RecordingError(f"{self.path.name} (recording {self.name}): time does not advance, so it has no rate")
        # The median alone is only as fine as the clock's last digit; the mean alone would count gaps.
        return 1.0 / float(np.mean(steps[steps < GAP_STEPS * np.median(steps)]))

    @cached_property
    def advances(self) -> bool:
        """Whether time, where it is known, increases with every sample."""
        if self._step_range[0] > 0.0:
            return True
        time = self.time[np.isfinite(self.time)]
        return len(time) > 1 and bool(np.all(np.diff(time) > 0.0))

    def steps_within(self, most: float) -> bool:
        """Whether time is known throughout and every step of it is above 0 and at most so long [s]."""
        shortest, longest = self._step_range
        return shortest > 0.0 and longest <= most

    @cached_property
    def longest_step(self) -> float:
        """Time step beyond which samples are missing: half as long again as usual, more where the clock jitters [s]."""
        usual = GAP_STEPS / self.fs
        if self._step_range[1] <= usual:
            return usual
        steps = np.diff(self.time)
        steps = steps[np.isfinite(steps)]
        if steps.max(initial=0.0) <= usual:
            return usual
        return max(usual, BEYOND_JITTER * float(np.quantile(steps[:: max(1, len(steps) // 200_000)], 0.98)))

    @cached_property
    def jitter(self) -> float:
        """Share of the time step by which 1 sample in 100 is off; by which all are where that is next to nothing."""
        shortest, longest = self._step_range
        if shortest > 0.0 and (most := max(longest * self.fs - 1.0, 1.0 - shortest * self.fs)) < NO_JITTER:
            return most
        steps = np.diff(self.time)
        steps = steps[steps <= self.longest_step]
        return float(np.quantile(np.abs(steps * self.fs - 1.0), 0.99)) if steps.size else 0.0

    @cached_property
    def clock(self) -> SampleClock:
        """When samples were taken: stamps smoothed over neighbours where positions then lie more smoothly, which shows
        that a stamp says when a sample arrived; the stamps themselves elsewhere."""
        names = [name for name in self.channels if name.partition(".")[0] in ("position", "motor_position")]
        if not names or len(self) < 3 or not self.advances or not np.isfinite(self.time).all():
            return SampleClock(self.time)
        near = np.diff(self.time) <= self.longest_step
        return sample_clock(self.time, np.column_stack([self[name] for name in names]), self.spans, near)

    @property
    def stamped_evenly(self) -> bool:
        """Whether positions lie more smoothly over smoothed stamps than over the recorded ones."""
        return self.clock.window > 0

    @cached_property
    def enabled(self) -> np.ndarray:
        """Samples in which the drive was on, shape (n,) bool; all where no channel ``enabled`` is recorded; of
        several joints, where each was."""
        on = np.ones(len(self), dtype=bool)
        for name in self.channels:
            if name.partition(".")[0] == "enabled":
                on &= self[name] != 0.0
        on.flags.writeable = False
        return on

    @cached_property
    def sound(self) -> np.ndarray:
        """Samples that no cut holds, shape (n,) bool."""
        sound = sound_samples(len(self), self.cuts)
        sound.flags.writeable = False
        return sound

    @cached_property
    def spans(self) -> tuple[slice, ...]:
        """Runs of sound samples, in order: no filter may cross their borders. A gap in time ends one too."""
        return spans_between(len(self), self.cuts)


def channels_within(recording: Recording, span: slice) -> dict[str, Channel]:
    """All channels of a recording, only those of its samples that are in a `span`."""
    return {name: replace(channel, samples=channel.samples[span]) for name, channel in recording.channels.items()}
