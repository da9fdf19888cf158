"""A virtual rig's recordings: as files of a study, or straight to recordings where thousands are wanted.

Both hold the same numbers: what the instruments stored, made SI by what study.toml says of it. A clock or an angle that
a file holds to some digits has all of them in memory.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from .._atomic import write_text_atomically
from .._given import read_given
from ..procedures.registry import open_study, study_model
from ..recordings.optical import AXES, OpticalRecording
from ..recordings.recording import Channel, Recording
from ..studies.lock import hold_lock
from ..studies.study import STUDY_FILE, Study
from ..studies.study_file import ChannelSpec, RecordingEntry, StudyFile, rig_units
from .recorded_table import MAIN_STREAM, MARKER_STREAM, StoredTable, file_name
from .rig import Rig, Taken, Tell, Trial
from .study_text import study_text

UNFINISHED_FOLDER = ".unfinished"
"""Folder within a study's of what a simulation has recorded so far."""

TRUTH_FILE = "lab/truth.json"
"""What only tests, benchmarks and reproductions may read."""

WRITTEN_FILE = "lab/simulated.json"
"""The SHA-256 of the study.toml that a simulation wrote, by which a later one sees that somebody has changed it."""

MAX_WRITTEN_BYTES = 10_000
"""Largest size of that file that is read: it holds one digest."""


def study_config(said: Mapping[str, Any]) -> StudyFile:
    """A study.toml as read, from what it says."""
    return study_model().model_validate(said, context=rig_units(said))


def write_study(
    folder: Path,
    rig: Rig,
    *,
    name: str,
    seed: int,
    trials: Sequence[Trial] | None = None,
    threads: int = 2,
    on_progress: Tell | None = None,
) -> Study:
    """Record trials on a rig and write them as a lab would: study.toml and CSV files; the truth stands apart, in
    ``lab/truth.json``."""
    return _written(folder, rig, name, seed, trials, threads, on_progress)[0]


def write_full_study(
    folder: Path, rig: Rig, *, name: str, seed: int, on_progress: Tell | None = None
) -> tuple[Study, float]:
    """The full protocol of a `rig` written to a `folder`, as `write_study` does with `name`, `seed` and `on_progress`,
    and for how long the joint moved [s]."""
    return _written(folder, rig, name, seed, None, 2, on_progress)


def _written(folder, rig, name, seed, trials, threads, on_progress) -> tuple[Study, float]:
    made_in, names = folder / UNFINISHED_FOLDER, []

    def write(taken: Taken) -> tuple[Taken, float]:
        for recording, streams in taken.files.items():
            for stream, stored in streams.items():
                names.append(file_name(recording, stream))
                write_text_atomically(made_in / names[-1], stored.text)
        return taken.noted, taken.duration

    trials = rig.trials(seed) if trials is None else trials
    # A study is one seed's whole or another's: all that is new stands apart until nothing is missing.
    with hold_lock(folder / STUDY_FILE):
        rmtree(made_in, ignore_errors=True)
        try:
            made = list(rig.record_all(trials, seed, then=write, threads=threads, on_progress=on_progress))
            taken = [one for one, _ in made]
            truth = {"seed": seed, "rig": rig.name, **rig.truth(seed)}
            truth["trials"] = {one.trial.name: one.truth for one in taken}
            write_text_atomically(made_in / TRUTH_FILE, json.dumps(truth, indent=1) + "\n")
            text = study_text({**rig.study(taken), "name": name}, rig.comments)
            write_text_atomically(made_in / STUDY_FILE, text)
            digest = hashlib.sha256(text.encode("utf-8")).hexdigest()
            write_text_atomically(made_in / WRITTEN_FILE, json.dumps({STUDY_FILE: digest}) + "\n")
            (folder / STUDY_FILE).unlink(missing_ok=True)
            for file in (TRUTH_FILE, WRITTEN_FILE, *names, STUDY_FILE):
                (folder / file).parent.mkdir(parents=True, exist_ok=True)
                (made_in / file).replace(folder / file)
        finally:
            rmtree(made_in, ignore_errors=True)
    return open_study(folder), sum(duration for _, duration in made)


def is_changed_by_hand(folder: Path) -> bool:
    """Return whether study.toml differs from the one that the last simulation wrote; False if that is not known."""
    try:
        written = json.loads(read_given(folder / WRITTEN_FILE, MAX_WRITTEN_BYTES).decode("utf-8"))[STUDY_FILE]
    except (OSError, ValueError, LookupError, TypeError):
        return False
    return hashlib.sha256((folder / STUDY_FILE).read_bytes()).hexdigest() != written


def record_in_memory(
    rig: Rig,
    trials: Sequence[Trial],
    *,
    seed: int,
    threads: int = 1,
    keep: Callable[[Taken], Any] = lambda taken: taken.inside,
) -> tuple[StudyFile, tuple[Recording, ...], list[Taken]]:
    """What the study of a rig and a seed would hold, without writing it."""

    def kept(taken: Taken) -> Taken:
        return replace(taken, inside=keep(taken))

    made = list(rig.record_all(trials, seed, then=kept, threads=threads))
    config = study_config(rig.study(made))
    entries, recordings = {entry.name: entry for entry in config.recordings}, {}
    for i, taken in enumerate(made):
        for name, streams in taken.files.items():
            recordings[name] = _recording(config, entries[name], streams)
        made[i] = replace(taken.noted, inside=taken.inside)
    # As study.toml lists them: a rig may order conditions, not people.
    return config, tuple(recordings[name] for name in entries), made


def _recording(config: StudyFile, entry: RecordingEntry, streams: Mapping[str, StoredTable]) -> Recording:
    """A recording as reading its files would give it."""

    def beside(stream: str) -> Recording:
        channels = _channels(streams[stream], config.streams[stream].channels)
        path, digest = Path(entry.streams[stream]), streams[stream].digest
        return Recording(f"{entry.name}.{stream}", path, digest, entry.use, channels, entry.protocol, entry.participant)

    return Recording(
        name=entry.name,
        path=Path(entry.file),
        checksum=streams[MAIN_STREAM].digest,
        use=entry.use,
        channels=_channels(streams[MAIN_STREAM], config.channels_of(entry)),
        protocol=entry.protocol,
        participant=entry.participant,
        condition=entry.condition,
        optical=_optical(config, Path(entry.optical), streams[MARKER_STREAM]) if entry.optical else None,
        streams={stream: beside(stream) for stream in entry.streams},
    )


def _channels(stored: StoredTable, specs: Mapping[str, ChannelSpec]) -> dict[str, Channel]:
    made = {}
    for name, spec in specs.items():
        samples = _si(stored, spec)
        # Nobody writes into them any more: the channel keeps these samples themselves.
        samples.flags.writeable = False
        made[name] = Channel(name, samples, spec.si_unit, spec.column)
    return made


def _si(stored: StoredTable, spec: ChannelSpec) -> np.ndarray:
    return (spec.scale * stored.column(spec.column) + spec.offset) * spec.si_factor


def _optical(config: StudyFile, path: Path, stored: StoredTable) -> OpticalRecording:
    spec, rail = config.optical, config.rig.slider
    markers = {
        marker: spec.si_factor * np.column_stack([stored.column(spec.column(marker, axis)) for axis in AXES])
        for marker in spec.markers
    }
    time, down = _si(stored, spec.time), np.array(spec.down)
    return OpticalRecording(path, stored.digest, time, markers, down, rail.marker if rail is not None else None)
