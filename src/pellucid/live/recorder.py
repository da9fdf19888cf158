"""Record a session: `python -m pellucid.live.recorder REGION SESSION_FILE SETTINGS_FILE`.

The recorder follows the engine's records, the session's events and the streams that were taken in. It appends them to
an XDF file a trial, between the events "record_begin" and "record_end", and every number that the law was given to one
file of the whole session, from which `replay` computes the commands again. Each round ends with a row of the stream
"recorder" that says how far it came. A recorder that was killed is started again, removes what is behind the last such
row, and goes on from there: no sample is lost, and none is written twice, as long as the rings still hold them.

Seal the files that a session left unfinished when its computer lost power or its recorder was killed.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import PellucidError
from ..files.readers.read import find_lost_end
from ..files.xdf_writer import FIRST_BYTES, SAMPLES_TAG, XdfStream, XdfWriter, chunks, sample_block, scan_xdf, seal_xdf
from .replay import RAW_COLUMNS, READABLE_COLUMNS, raw_values, robot_values
from .setup import ORPHAN_S, SessionProcess
from .shared_memory import Event, Region, remove_region
from .stream_ring import StreamRing, ask_for_niceness

POLL_S = 0.02
"""Time between two rounds."""

CLOCK_INTERVAL_S = 2.0
"""Time between two rows of the clocks."""

CLOSING_S = 0.4
"""Longest time that is waited for late samples after the end of a recording."""

ENGINE_SILENCE_S = 0.5
"""An engine that said nothing for this time after its session's death has ended [s]."""

MAX_STREAMS = 8
"""Largest number of streams that are taken in."""

ROBOT_ID = 1
"""Identity of the stream of the engine's records."""

EVENTS_ID = 2
"""Identity of the stream of events."""

RECORDER_ID = 3
"""Identity of the stream that says how far the recorder came."""

CLOCKS_ID = 4
"""Identity of the stream of clock estimates."""

FIRST_STREAM_ID = 10
"""Identity of the first stream that was taken in; the others follow."""

CURSOR_COLUMNS = ("records", "events", *(f"stream{i}" for i in range(MAX_STREAMS)))
"""Columns of the stream "recorder"."""

CLOCK_COLUMNS = ("stream", "offset", "drift", "jumps", "batches", "lost", "rate")
"""Columns of the stream "clocks"."""


@dataclass
class OpenRecording:
    """A file that is being written."""

    path: Path
    about: Path | None  # note that exists until a trial's file is sealed; None for the file of the session
    writer: XdfWriter
    begun: float  # [s]
    ends: float | None = None  # time after which nothing is written [s]
    closing: float | None = None  # time at which it is sealed whatever is late [s]
    records: int = 0
    events: int = 0
    streams: list[int] = field(default_factory=lambda: [0] * MAX_STREAMS)
    told_clocks: float = 0.0


class Recorder:
    """Follow a region, and write its recordings.

    Parameters
    ----------
    region : Region
    session : Path or None
        File of the whole session; None: there is none.
    settings : str
        The engine's numbers, which are kept in that file.
    """

    def __init__(self, region: Region, session: Path | None = None, settings: str = "") -> None:
        self.region = region
        self.rings: list[StreamRing] = []
        self.recording: OpenRecording | None = None
        self.session = None if session is None else self._open_session(session, settings)
        self._events = 0
        self._sealed = 0
        self._looked = -np.inf

    def step(self) -> None:
        """Write everything that has arrived since the last step."""
        now = time.monotonic()
        if now - self._looked > 0.5:
            self._looked = now
            self.rings = StreamRing.all_of(self.region.path)[:MAX_STREAMS]
        texts: list[tuple[float, str]] = []
        self._events, events = self.region.events_since(self._events)
        base = self._events - len(events)
        if self.session is not None:
            fresh = [event for n, event in enumerate(events, base + 1) if n > self.session.events]
            self._flush(self.session, [(event.time, _event_text(event)) for event in fresh], self._events)
        for number, event in enumerate(events, base + 1):
            if event.kind == "record_begin":
                self._begin(event.time, Path(event.data["path"]), Path(event.data["about"]), number)
            elif self.recording is None or number <= self.recording.events:
                continue
            elif event.kind == "record_end":
                self.recording.ends, self.recording.closing = event.time, time.monotonic() + CLOSING_S
                self._flush(self.recording, texts, number)
                texts = []
            else:
                texts.append((event.time, _event_text(event)))
        if self.recording is not None:
            self._flush(self.recording, texts, self._events)
        self.region.tell_recorder(
            process=os.getpid(), heartbeat=time.monotonic_ns(), records=self.recording.records if self.recording else 0,
            events=self._events, sealed=self._sealed, recording=int(self.recording is not None),
        )  # fmt: skip

    def _begin(self, begun: float, path: Path, about: Path, number: int) -> None:
        if not about.exists():
            return  # sealed before this recorder was started
        if self.recording is not None and self.recording.path != path:
            self._seal()
        if path.exists():
            self.recording = resume(path, about)
            if self.recording is not None:
                self.recording.begun = begun
                return
            path.unlink()
        said = json.loads(about.read_text(encoding="utf-8"))
        description = {key: value if isinstance(value, str) else json.dumps(value) for key, value in said.items()}
        writer = self._new_file(path, "robot", "Robot", READABLE_COLUMNS, description)
        _, kept, _ = self.region.records_since(0)
        late = np.searchsorted(kept["deadline"], round(1e9 * begun))
        first = int(kept["number"][late]) - 1 if late < len(kept) else self.region.record_count
        self.recording = OpenRecording(path, about, writer, begun, records=first, events=number)

    def _open_session(self, path: Path, settings: str) -> OpenRecording:
        if path.exists():
            found = resume(path, None)
            if found is not None:
                return found
            path.unlink()
        columns = [(name, "") for name in RAW_COLUMNS]
        writer = self._new_file(path, "engine", "Engine", columns, {"settings": settings})
        return OpenRecording(path, None, writer, 0.0)

    def _new_file(
        self, path: Path, name: str, type_: str, columns: Sequence[tuple[str, str]], description: Mapping[str, str]
    ) -> XdfWriter:
        writer = XdfWriter(path)
        known = {"software": f"pellucid {version('pellucid')}", "period": repr(1e-9 * self.region.period_ns)}
        writer.add_stream(
            ROBOT_ID, name, type_, columns, source="pellucid-engine", description={**known, **description}
        )
        writer.add_stream(EVENTS_ID, "events", "Markers", [("event", "")], format="string")
        writer.add_stream(RECORDER_ID, "recorder", "Recorder", [(name, "") for name in CURSOR_COLUMNS])
        writer.add_stream(CLOCKS_ID, "clocks", "Clocks", [(name, "") for name in CLOCK_COLUMNS])
        for identity in writer.streams:
            writer.write_clock_offset(identity, time.monotonic(), 0.0)
        return writer

    def _flush(self, open_: OpenRecording, texts: list[tuple[float, str]], events: int) -> None:
        """Append what the rings hold for a recording, and the row that says so; seal a trial's file that has ended."""
        writer = open_.writer
        cursor, records, _ = self.region.records_since(open_.records)
        seconds = 1e-9 * records["deadline"]
        if open_.ends is not None:
            inside = seconds <= open_.ends
            cursor = open_.records + int(np.count_nonzero(inside)) if not inside.all() else cursor
            records, seconds = records[inside], seconds[inside]
        writer.write_samples(ROBOT_ID, seconds, raw_values(records) if open_.about is None else robot_values(records))
        open_.records = cursor
        complete = open_.ends is not None and 1e-9 * self.region.status()["heartbeat"] > open_.ends
        for i, ring in enumerate(self.rings if open_.about is not None else ()):
            complete = self._flush_ring(open_, i, ring) and complete
        writer.write_texts(EVENTS_ID, [t for t, _ in texts], [text for _, text in texts])
        open_.events = max(open_.events, events)
        moment = time.monotonic()
        if moment - open_.told_clocks > CLOCK_INTERVAL_S and self.rings:
            open_.told_clocks = moment
            rows = [
                [i, *(getattr(ring.clock, name) for name in CLOCK_COLUMNS[1:])] for i, ring in enumerate(self.rings)
            ]
            writer.write_samples(CLOCKS_ID, np.full(len(rows), moment), np.array(rows, float))
        row = [[float(open_.records), float(open_.events), *map(float, open_.streams)]]
        writer.write_samples(RECORDER_ID, np.array([moment]), np.array(row))
        if open_.closing is not None and (complete or moment > open_.closing):
            self._seal()

    def _flush_ring(self, open_: OpenRecording, index: int, ring: StreamRing) -> bool:
        """Append what one stream has; whether it has reached the recording's end."""
        identity, writer = FIRST_STREAM_ID + index, open_.writer
        if identity not in writer.streams:
            writer.add_stream(
                identity, ring.name, ring.type, list(zip(ring.labels, ring.units, strict=True)), rate=ring.nominal_rate,
                format="float32" if ring.type == "EMG" else "double64", source=ring.source,
            )  # fmt: skip
            writer.write_clock_offset(identity, open_.begun, 0.0)
        samples = ring.read_since(open_.streams[index])
        inside = samples.time >= open_.begun
        reached = False
        if open_.ends is not None:
            inside &= samples.time <= open_.ends
            reached = bool(len(samples.time)) and bool(samples.time[-1] > open_.ends)
            silent = time.monotonic() - 1e-9 * ring.heard_ns > CLOSING_S
            reached = reached or silent
        writer.write_samples(identity, samples.time[inside], samples.values[inside])
        open_.streams[index] = samples.cursor
        return reached

    def _seal(self) -> None:
        if self.recording is None:
            return
        self.recording.writer.seal()
        if self.recording.about is not None:
            self.recording.about.unlink(missing_ok=True)
        self.recording = None
        self._sealed += 1

    def close(self) -> None:
        """Write what is left, and seal an open file."""
        self.step()
        self._seal()
        if self.session is not None:
            self.session.writer.seal()


def _event_text(event: Event) -> str:
    return json.dumps({"kind": event.kind, **event.data}, ensure_ascii=False)


def resume(path: Path, about: Path | None) -> OpenRecording | None:
    """Go on with the file of a killed recorder, from its last row of the stream "recorder"; None if it has none."""
    data = path.read_bytes()
    end, row = 0, None
    known = XdfStream(RECORDER_ID, "double64", len(CURSOR_COLUMNS))
    # A file that a full disk kept from its first bytes holds nothing.
    for chunk in chunks(data) if data.startswith(FIRST_BYTES) else ():
        if chunk.tag == SAMPLES_TAG and int.from_bytes(chunk.content[:4], "little") == RECORDER_ID:
            block: Any = sample_block(chunk.content, known)
            end, row = chunk.end, block["value"][-1]
    if row is None:
        return None
    found = scan_xdf(path, until=end)
    writer = XdfWriter.resume(path, end, found.streams)
    cursors = [int(value) for value in row]
    return OpenRecording(path, about, writer, 0.0, records=cursors[0], events=cursors[1], streams=cursors[2:])


def run(path: Path, session: Path, settings: Path) -> None:
    """Record until SIGTERM."""
    ends: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, frame: ends.append(number))
    ask_for_niceness()
    region, process = Region(path), SessionProcess()
    region.tell_recorder(error=0)
    try:
        recorder = Recorder(region, session, settings.read_text(encoding="utf-8"))
        while not ends and not _has_nothing_to_record(region, process):
            recorder.step()
            time.sleep(POLL_S)
        recorder.close()
    except (OSError, PellucidError) as error:
        # The log may lie on the same full disk: the session reads the cause from the region.
        region.tell_recorder(error=getattr(error, "errno", None) or 0)
        with suppress(OSError):
            print(f"recorder: {error}", file=sys.stderr, flush=True)
        sys.exit(1)
    finally:
        if process.gone_for() > 0.0:
            remove_region(path)


def _has_nothing_to_record(region: Region, process: SessionProcess) -> bool:
    """Return whether the session is dead, and its engine has ended or should have ended."""
    silent = time.monotonic() - 1e-9 * int(region.status()["heartbeat"]) > ENGINE_SILENCE_S
    return process.gone_for() > (ENGINE_SILENCE_S if silent else 2.0 * ORPHAN_S)


if __name__ == "__main__":
    run(*map(Path, sys.argv[1:4]))


MIN_UNFINISHED_AGE_S = 2.0
"""A file that grew within this time may still have a recorder, which appends 50 times a second."""

NOTE_ENDING = ".about.json"
"""Ending of the note that accompanies a trial's file until it is sealed."""


def seal_unfinished(recordings: Path, run_folder: Path) -> list[str]:
    """Seal the unfinished files of earlier sessions; return a sentence for each.

    Parameters
    ----------
    recordings : Path
        Folder of the trials. A trial's file is unfinished if its note is there.
    run_folder : Path
        Folder of the files of whole sessions.
    """
    trials = {note.with_name(f"{note.name.removesuffix(NOTE_ENDING)}.xdf"): note for note in _notes(recordings)}
    sessions = (path for path in sorted(run_folder.glob("session*.xdf")) if _is_unfinished(path))
    paths = [*(path for path in trials if path.is_file()), *sessions]
    _wait_for_recorders(paths)
    said = []
    for path in paths:
        if _age(path) < MIN_UNFINISHED_AGE_S:
            continue  # another session writes it
        try:
            before = path.stat().st_size
            removed = seal_xdf(path)
        except (PellucidError, OSError) as error:
            said.append(f"{path}: not sealed: {error}")
            continue
        if path.stat().st_size != before:
            said.append(f"{path}: the recorder had stopped; sealed without {removed} bytes of an incomplete chunk")
        if path in trials:
            trials[path].unlink(missing_ok=True)
    return said


def _notes(folder: Path) -> list[Path]:
    return sorted(folder.glob(f"*{NOTE_ENDING}")) if folder.is_dir() else []


def _is_unfinished(path: Path) -> bool:
    try:
        return bool(find_lost_end(path))
    except (PellucidError, OSError):
        return False  # no file of streams


def _wait_for_recorders(paths: list[Path]) -> None:
    """Wait until the recorder of a session that has just died has ended; it ends by itself."""
    until = time.monotonic() + 2.0 * MIN_UNFINISHED_AGE_S
    while time.monotonic() < until and any(_age(path) < MIN_UNFINISHED_AGE_S for path in paths):
        time.sleep(0.1)


def _age(path: Path) -> float:
    """Return the time since a file was written [s]; a computer that lost power may have another date than before."""
    return abs(time.time() - path.stat().st_mtime)
