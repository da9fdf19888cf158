"""One input and one output of a recording, made ready for a dynamic model: time that increases, no sample missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._errors import RecordingError
from ..files.cut import MIN_GAP_STEP_RATIO
from ..files.defects import garbage
from ..files.recording import Recording
from ..numerics.filters import runs

MAX_LOST_SAMPLES = 5
"""At most this many consecutive samples may be lost; a simulation holds the input over them."""


@dataclass(frozen=True)
class InputOutput:
    """A sampled input and the output it made."""

    recording: str  # recording, split: Name; ``"fitted"`` or ``"heldout"``
    split: str
    time: np.ndarray  # time, input, output: (n,) Time increases [s], evenly or not; the others in SI
    input: np.ndarray
    output: np.ndarray
    notes: tuple[str, ...] = ()  # What was left out, and what a simulation has to bridge

    def __post_init__(self):
        shapes = {np.shape(x) for x in (self.time, self.input, self.output)}
        if len(shapes) != 1 or len(next(iter(shapes))) != 1:
            raise RecordingError(
                f"recording '{self.recording}': found time, input and output of shapes "
                f"{np.shape(self.time)}, {np.shape(self.input)}, {np.shape(self.output)}, expected one shape (n,)"
            )

    def __len__(self) -> int:
        return len(self.time)

    def part(self, begin: int, end: int, split: str) -> InputOutput:
        """Samples `begin` to `end`, as of a `split`."""
        inside = slice(begin, end)
        return InputOutput(self.recording, split, self.time[inside], self.input[inside], self.output[inside])


def input_output(recording: Recording, channels: Sequence[str]) -> InputOutput:
    """A recording's input and output over time that increases with every sample.

    Samples with a missing number are excluded. If time runs backwards, the log contains the rest of an earlier one;
    only the longest increasing stretch is kept. If a time repeats, one sample is kept. The notes count all exclusions,
    including the rows of garbage that the reader excluded at either end.
    """
    name_in, name_out = channels
    table = np.column_stack([recording.time, recording[name_in], recording[name_out]])
    notes = [f"{cut.found}; they are excluded" for cut in recording.cuts if cut.kind == garbage.KIND]
    finite = np.isfinite(table).all(axis=1)
    known = finite & recording.sound
    if not finite.all():
        notes.append(f"{_samples(int((~finite).sum()))} with a missing number excluded")
    lost = [run.stop - run.start for run in runs(~known)]
    if max(lost, default=0) > MAX_LOST_SAMPLES:
        # What drove it meanwhile is not known, and a simulation cannot go on over it.
        begins = [0, *(r.stop for r in runs(~known) if r.stop - r.start > MAX_LOST_SAMPLES), len(known)]
        stops = [*(r.start for r in runs(~known) if r.stop - r.start > MAX_LOST_SAMPLES), len(known)]
        begin, end = max(zip(begins, stops, strict=False), key=lambda part: part[1] - part[0])
        notes.append(
            f"{max(lost)} consecutive samples are missing; only the longest stretch without them, {end - begin} "
            "samples, is kept"
        )
        known[:begin] = False
        known[end:] = False
    if not known.all():
        table = table[known]
    starts = np.concatenate([[0], np.flatnonzero(np.diff(table[:, 0]) < 0.0) + 1])
    if len(starts) > 1:
        ends = np.append(starts[1:], len(table))
        longest = int(np.argmax(ends - starts))
        left = len(table) - int(ends[longest] - starts[longest])
        times = "once" if len(starts) == 2 else f"{len(starts) - 1} times"
        notes.append(
            f"time runs backwards {times}; the longest stretch is kept, {_samples(left)} of the others excluded"
        )
        table = table[starts[longest] : ends[longest]]
    repeats = np.concatenate([[False], np.diff(table[:, 0]) == 0.0]) if len(table) else np.zeros(0, bool)
    if repeats.any():
        notes.append(f"{_samples(int(repeats.sum()))} with a repeated time excluded")
        table = table[~repeats]
    if len(table) < 2:
        raise RecordingError(
            f"{recording.path.name} (recording {recording.name}): found {_samples(len(table))} of {name_in} and "
            f"{name_out} over time that increases, expected a recorded movement"
        )
    steps = np.diff(table[:, 0])
    gaps = steps > MIN_GAP_STEP_RATIO * np.median(steps)
    if gaps.any():
        word = "gap" if gaps.sum() == 1 else "gaps"
        notes.append(f"{int(gaps.sum())} {word} of up to {steps.max():.3g} s bridged by the input's hold")
    split = "fitted" if recording.use == "fit" else "heldout"
    time, given, answered = np.ascontiguousarray(table.T)
    return InputOutput(recording.name, split, time, given, answered, tuple(notes))


def _samples(count: int) -> str:
    return f"{count} sample{'' if count == 1 else 's'}"
