"""Detect dead efforts: a torque, force, current, voltage or duty that is constant, or a copy of another channel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..._errors import UnfitRecordingError
from ...files.defects.constant import few_levels, finite_samples
from ...files.fault import Fault
from ...files.recording import Recording
from ...numerics.filters import central_difference
from ...numerics.motion import lowpassed, shortest
from ..find_defects import watched_part
from ..recorded_motions import filtering_of, stretches_of
from ..study import Study

MIN_EXPLAINED_SHARE = 0.5
"""A channel with so few values is a switching drive if the motion explains at least this share of its variance."""

UNCOPYABLE_QUANTITIES = {"time", "position", "motor_position", "velocity"}
"""Quantities that an effort channel must not be a copy of."""

FIRST_SAMPLES = slice(1000)
"""Samples that are compared first: channels that differ there are no copies."""

COPY_TOLERANCE = 1e-6
"""Two channels of one column are copies if a factor and an offset explain all but this share of the largest sample."""

USE_NAMES = {"fit": "fitted", "validate": "held-out"}
"""Names of the uses of recordings in messages."""


def dead_effort_faults(study: Study) -> list[Fault]:
    """Return a fault for each effort that is dead in all fitted or in all held-out recordings.

    An effort that is constant in a single recording in which its joint moves gives a note.
    """
    return [fault for use in USE_NAMES for fault in _faults_of_use(study, study.recordings(use), USE_NAMES[use])]


def require_live_effort(study: Study) -> None:
    """Refuse a study with a dead effort."""
    refused = [fault.message for fault in dead_effort_faults(study) if fault.severity == "refuse"]
    if refused:
        raise UnfitRecordingError("\n".join(refused))


def _faults_of_use(study: Study, recordings: Sequence[Recording], use: str) -> Iterator[Fault]:
    efforts: dict[str, list[tuple[Recording, str, np.ndarray]]] = {}
    for recording in recordings:
        watched = watched_part(recording, study.config, study.specs_of(recording), study.processing_of(recording))
        for position, drive in watched.drives.items():
            if position in recording:
                samples = watched.samples(drive)
                supply = drive.replace("duty", "supply", 1)
                if drive.startswith("duty") and supply in recording:
                    samples = samples * recording[supply]
                efforts.setdefault(drive, []).append((recording, position, finite_samples(samples)))
    for drive, seen in efforts.items():
        for recording, _, _ in seen:
            yield from _copied(recording, drive)
        files = ", ".join(dict.fromkeys(recording.path.name for recording, _, _ in seen))
        unit = "" if drive.startswith("duty") else f" {seen[0][0].channels[drive].unit}"
        levels = few_levels([samples for _, _, samples in seen])
        wanted = "an effort that changes as the joint moves: check the sensor, its cable and the column in [channels]"
        where = f"every sample of all {use} recordings"
        if levels is None:
            yield from _dead_in_one(drive, seen, unit)
        elif levels.size == 1:
            found = f"the one value {levels[0]:z.6g}{unit} in {where}"
            yield _fault("refuse", files, drive, found, wanted)
        elif (
            levels.size > 1
            and (explained_share := _explained(study, drive, [r for r, _, _ in seen])) < MIN_EXPLAINED_SHARE
        ):
            values = ", ".join(f"{level:.6g}" for level in levels)
            found = (
                f"only the values {values}{unit} in {where}; motion explains {100 * explained_share:.2g} % of their "
                "variance"
            )
            yield _fault("refuse", files, drive, found, wanted)


def _dead_in_one(drive: str, seen: Sequence[tuple[Recording, str, np.ndarray]], unit: str) -> Iterator[Fault]:
    """Yield a note on recordings in which the joint moves with a constant effort that is alive elsewhere."""
    for recording, position, samples in seen:
        levels = few_levels([samples])
        if levels is not None and levels.size == 1 and few_levels([recording[position]]) is None:
            found = f"the one value {levels[0]:z.6g}{unit} in every sample (recording {recording.name})"
            wanted = "an effort that changes, unless the drive was off or held its command"
            yield _fault("note", recording.path.name, drive, found, wanted)


def _copied(recording: Recording, drive: str) -> Iterator[Fault]:
    """Yield a fault for channels of time or motion that are copies of the effort, or read from the same column."""
    effort = recording.channels[drive]
    for name, channel in recording.channels.items():
        if name.partition(".")[0] not in UNCOPYABLE_QUANTITIES or few_levels([channel.samples]) is not None:
            continue
        pair = channel, effort
        # All samples are read only where the first ones agree.
        parts = ((x.within(some).samples for x in pair) for some in (FIRST_SAMPLES, slice(None)))
        same = all(np.array_equal(*part, equal_nan=True) for part in parts)
        if same or (channel.column == effort.column and _is_proportional(*(x.samples for x in pair))):
            found = f"the samples of {name} (recording {recording.name})"
            wanted = f"the effort's own: check the columns of {drive} and {name} in [channels]"
            yield _fault("refuse", recording.path.name, drive, found, wanted, "copied_effort")


def _is_proportional(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two signals, each (n,), differ only by a factor and an offset, as after unit conversion."""
    known = np.isfinite(one) & np.isfinite(other)
    one, other = one[known] - one[known].mean(), other[known] - other[known].mean()
    factor = float(one @ other) / max(float(one @ one), np.finfo(float).tiny)
    return bool(np.abs(other - factor * one).max(initial=0.0) <= COPY_TOLERANCE * np.abs(other).max(initial=0.0))


def _fault(severity: str, file: str, channel: str, found: str, wanted: str, kind: str = "dead_effort") -> Fault:
    message = f"{file}, channel {channel}: found {found}, expected {wanted}"
    return Fault(severity, kind, file, channel, found, wanted, message)


def _explained(study: Study, drive: str, recordings: Sequence[Recording]) -> float:
    """Return the share of an effort's variance that a linear regression on the filtered motion of all joints explains.

    Returns 0 if no samples are left.
    """
    rows, efforts = [], []
    for recording in recordings:
        processing = study.processing_of(recording)
        filtering = filtering_of(processing)
        names = [n for n in recording.channels if n.partition(".")[0] in ("position", "motor_position")]
        for stretch in stretches_of(recording, processing):
            if len(stretch.time) < shortest(filtering):
                continue
            q = lowpassed(np.column_stack([stretch.recording[n] for n in names]), stretch.fs, filtering)
            v = np.column_stack([central_difference(x, stretch.fs) for x in q.T])
            a = np.column_stack([central_difference(x, stretch.fs) for x in v.T])
            effort = lowpassed(stretch.recording[drive], stretch.fs, filtering)
            inner = slice(filtering.trim, len(effort) - filtering.trim)
            rows.append(np.column_stack([np.ones(len(q)), q, np.sin(q), np.cos(q), v, np.sign(v), a])[inner])
            efforts.append(effort[inner])
    if not efforts:
        return 0.0
    design, effort = np.concatenate(rows), np.concatenate(efforts)
    design = design / np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    off = effort - design @ np.linalg.lstsq(design, effort, rcond=1e-10)[0]
    spread = float(np.sum((effort - effort.mean()) ** 2))
    return max(0.0, 1.0 - float(off @ off) / spread) if spread > 0.0 else 0.0
