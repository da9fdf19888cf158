"""Recordings of a virtual rig: written as the files of a study, or kept in memory where thousands are needed.

Both hold the same numbers: those that the instruments stored, converted to SI as study.toml says. The one difference is
that clocks and angles are rounded to a few digits in a file, and not in memory.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from operator import attrgetter
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from pellucid._atomic import atomically, write_text_atomically
from pellucid._given import read_given
from pellucid.files.optical import AXES, OpticalRecording
from pellucid.files.recording import Channel, Recording
from pellucid.study.kept import hold_lock
from pellucid.study.procedures.registry import open_study, study_model
from pellucid.study.study import STUDY_FILE, Study
from pellucid.study.study_file import ChannelSpec, RecordingEntry, StudyFile, rig_units

from .recorded_table import MAIN_STREAM, MARKER_STREAM, StoredTable, file_name
from .rig import Rig, Streams, Taken, Tell, Trial
from .study_text import study_text

UNFINISHED_FOLDER = ".unfinished"
"""Folder within the study's folder where a simulation keeps its files until all of them are written."""

TRUTH_FILE = "lab/truth.json"
"""Path of the true parameters, which only tests, benchmarks and reproductions may read."""

WRITTEN_FILE = "lab/simulated.json"
"""Path of the SHA-256 of the study.toml that a simulation wrote; it shows whether somebody has changed study.toml."""

MAX_WRITTEN_BYTES = 10_000
"""Largest size of `WRITTEN_FILE` that is read [B]; the file holds one digest."""


def study_config(tables: Mapping[str, Any]) -> StudyFile:
    """Return a validated study.toml, from its tables."""
    return study_model(tables).model_validate(tables, context=rig_units(tables))


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
    """Record trials on a rig and write them as a lab would: study.toml and CSV files.

    The true parameters are written to ``lab/truth.json``. Without `trials`, the rig's full protocol is recorded.
    """
    return _record_and_write(folder, rig, name, seed, trials, threads, on_progress)[0]


def write_full_study(
    folder: Path,
    rig: Rig,
    *,
    name: str,
    seed: int,
    executor: Executor | None = None,
    on_progress: Tell | None = None,
) -> tuple[Study, float]:
    """Record the full protocol as `write_study` does; return the study and its recordings' total duration [s]."""
    return _record_and_write(folder, rig, name, seed, None, 2, on_progress, executor)


def _write_recording(folder: Path, recording: str, streams: Streams) -> Streams:
    """Write the files of a recording into a folder, and return its tables without rows."""
    for stream, stored in streams.items():
        with atomically(folder / file_name(recording, stream)) as file:
            file.writelines(stored.parts)
    return {stream: stored.emptied for stream, stored in streams.items()}


def _record_and_write(folder, rig, name, seed, trials, threads, on_progress, executor=None) -> tuple[Study, float]:
    """Record `trials` and write the study of them; return it and its recordings' total duration [s]."""
    made_in = folder / UNFINISHED_FOLDER
    trials = rig.trials(seed) if trials is None else trials
    # A study must never mix files of two seeds: new files are kept in a folder of their own until all are written.
    with hold_lock(folder / STUDY_FILE):
        rmtree(made_in, ignore_errors=True)
        try:
            recorded = rig.record_all(
                trials, seed, store=partial(_write_recording, made_in.absolute()), then=attrgetter("noted"),
                threads=threads, executor=executor, on_progress=on_progress,
            )  # fmt: skip
            taken = list(recorded)
            truth = {"seed": seed, "rig": rig.name, **rig.truth(seed)}
            truth["trials"] = {one.trial.name: one.truth for one in taken}
            write_text_atomically(made_in / TRUTH_FILE, json.dumps(truth, indent=1) + "\n")
            text = study_text({**rig.study(taken), "name": name, "simulated": True}, rig.comments)
            write_text_atomically(made_in / STUDY_FILE, text)
            digest = hashlib.sha256(text.encode("utf-8")).hexdigest()
            write_text_atomically(made_in / WRITTEN_FILE, json.dumps({STUDY_FILE: digest}) + "\n")
            (folder / STUDY_FILE).unlink(missing_ok=True)
            files = (file_name(name, stream) for one in taken for name, own in one.files.items() for stream in own)
            for file in (TRUTH_FILE, WRITTEN_FILE, *files, STUDY_FILE):
                (folder / file).parent.mkdir(parents=True, exist_ok=True)
                (made_in / file).replace(folder / file)
        finally:
            rmtree(made_in, ignore_errors=True)
    return open_study(folder), sum(own[MAIN_STREAM].duration for one in taken for own in one.files.values())


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
    """Record trials and return the study's configuration, recordings and trials, without writing a file.

    The returned trials hold no samples but what the function `keep` returns for each, as their ``inside``.
    """

    def replace_inside(taken: Taken) -> Taken:
        return replace(taken, inside=keep(taken))

    made = list(rig.record_all(trials, seed, then=replace_inside, threads=threads))
    config = study_config({**rig.study(made), "simulated": True})
    entries, recordings = {entry.name: entry for entry in config.recordings}, {}
    for i, taken in enumerate(made):
        recordings |= {name: _recording(config, entries[name], streams) for name, streams in taken.files.items()}
        # The tables are released one by one.
        made[i] = replace(taken.noted, inside=taken.inside)
    # The recordings follow study.toml, where a rig may have sorted them by condition.
    return config, tuple(recordings[name] for name in entries), made


def _recording(config: StudyFile, entry: RecordingEntry, streams: Mapping[str, StoredTable]) -> Recording:
    """Return the recording that reading these files would give."""

    def stream_recording(stream: str) -> Recording:
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
        streams={stream: stream_recording(stream) for stream in entry.streams},
    )


def _channels(stored: StoredTable, specs: Mapping[str, ChannelSpec]) -> dict[str, Channel]:
    """Return the channels of a stored table by name, in SI."""
    made = {}
    for name, spec in specs.items():
        samples = _si(stored, spec)
        # A read-only array is kept by the channel as it is; a writable one would be copied.
        samples.flags.writeable = False
        made[name] = Channel(name, samples, spec.si_unit, spec.column)
    return made


def _si(stored: StoredTable, spec: ChannelSpec) -> np.ndarray:
    """Return one channel's samples in SI, shape (n,)."""
    return (spec.scale * stored.column(spec.column) + spec.offset) * spec.si_factor


def _optical(config: StudyFile, path: Path, stored: StoredTable) -> OpticalRecording:
    """Return the optical recording that reading a motion capture's file would give."""
    spec, rail = config.optical, config.rig.slider
    markers = {
        marker: spec.si_factor * np.column_stack([stored.column(spec.column(marker, axis)) for axis in AXES])
        for marker in spec.markers
    }
    time, down = _si(stored, spec.time), np.array(spec.down)
    return OpticalRecording(path, stored.digest, time, markers, down, rail.marker if rail is not None else None)
