"""Bursts of every muscle in every recording, each with its beginning and end."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...._atomic import write_text_atomically
from ...._errors import RecordingError
from ...._given import csv_cell
from ....files.fault import Fault
from ....files.recording import Recording
from ....models.estimates import Verdict
from ....study.answer import PAPER_STEP, Answer, AnswerNumber, AnswerPart, Basis, Step, reason_of_parts
from ....study.drawing.drawing import outline
from ....study.procedures.procedure import Progress, quiet
from ....study.procedures.result import FigureTable, Result
from ....study.results import ResultRow
from ....study.study import Study
from ...signals.emg_onset import (
    ENVELOPE_CAUSE,
    OTHER_CAUSE,
    Burst,
    ChangePoint,
    UnseenOnsetError,
    activations,
    require_activity,
)
from ..muscle_channels import (
    counted_muscles,
    emg_faults,
    emg_stream,
    find_recordings_with_emg,
    find_used_muscles,
    name_channel,
    raise_refusals,
    raw_channel,
    raw_emg_steps,
    raw_whole_file,
)
from .onset_table import OnsetTable

MAX_DRAWN_RECORDINGS = 6
"""Largest number of recordings that a page draws."""


MAX_BRIEF_ROWS = 8
"""Largest number of muscles and recordings in the table on a terminal without ``-v``."""


@dataclass(frozen=True, eq=False)
class MuscleBursts:
    """Bursts of one muscle in one recording."""

    recording: str
    muscle: str
    bursts: tuple[Burst, ...]
    rest: tuple[float, float]  # Beginning and end of the rest with which activity is compared [s]
    rest_rms: float  # RMS of the raw EMG at rest [V]
    active: float  # Share of the recording in which the muscle is active
    time: np.ndarray = field(repr=False)  # Time of the samples for a figure, shape (k,) [s]
    samples: np.ndarray = field(repr=False)  # Raw EMG for a figure, shape (k,) [V]


@dataclass(frozen=True)
class MissedMuscle:
    """A muscle of one recording in which no onset could be looked for."""

    recording: str
    muscle: str
    cause: str  # why, in few words that are the same for every channel of this cause
    text: str  # why, with file, channel and numbers


@dataclass(frozen=True, kw_only=True, repr=False)
class OnsetResult(Result):
    """Result of `onset`."""

    muscles: tuple[MuscleBursts, ...] = field(default=(), repr=False)
    missed: tuple[MissedMuscle, ...] = ()  # muscles of recordings in which no onset could be looked for

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return onset_answer(self)

    def written(self, study: Study) -> str:
        return f"All bursts are listed in {study.made / 'tables' / 'onsets.csv'}"

    def save_more(self, study: Study) -> None:
        folder = study.place("tables")
        folder.mkdir(parents=True, exist_ok=True)
        text = io.StringIO()
        out = csv.writer(text, lineterminator="\n")
        out.writerow(
            ("recording", "muscle", "onset_s", "onset_low_s", "onset_high_s", "end_s", "end_low_s", "end_high_s",
             "threshold_s", "rms_V")
        )  # fmt: skip
        for each in self.muscles:
            for b in each.bursts:
                numbers = b.onset.time, b.onset.low, b.onset.high, b.end.time, b.end.low, b.end.high, b.crossed, b.rms
                words = csv_cell(each.recording), csv_cell(each.muscle)
                out.writerow((*words, *(f"{x:.6g}" for x in numbers)))
        write_text_atomically(folder / "onsets.csv", text.getvalue())


def faults(study: Study) -> list[Fault]:
    """Return faults of EMG that is unfit for use, or in which no onset can be found."""
    table = study.table(OnsetTable)
    found = emg_faults(study, table)
    for recording in find_recordings_with_emg(study, table):
        stream = emg_stream(recording, table)
        for muscle in _sought_muscles(stream, table):
            name = f"emg.{muscle}"
            if any(fault.channel == name and fault.severity == "refuse" for fault in found):
                continue
            try:
                _with_raw_emg(require_activity, stream, muscle, table)
            except RecordingError as error:
                kind = "refuse" if stream.channels[name].unit != "V" else "note"
                found.append(Fault(kind, "rest", stream.path.name, name, str(error), "rest and activity", str(error)))
    return found


def find_onsets(study: Study, tell: Progress = quiet) -> OnsetResult:
    """Find the bursts of every muscle in every recording. `study` [onset]."""
    table = study.table(OnsetTable)
    raise_refusals(emg_faults(study, table))
    recordings = find_recordings_with_emg(study, table)
    found, rows, missed, doubtful = [], [], [], []
    for i, recording in enumerate(recordings):
        tell(f"onsets in {recording.name}", i / len(recordings))
        stream, split = emg_stream(recording, table), "fitted" if recording.use == "fit" else "heldout"
        for muscle in _sought_muscles(stream, table):
            raw_channel(stream, muscle)
            base = f"{study.name}.{recording.name}.{muscle}"
            settings = {"shortest": table.shortest, "pause": table.pause, "level": table.confidence}
            try:
                active = _with_raw_emg(activations, stream, muscle, table, **settings)
            except UnseenOnsetError as error:
                missed.append(MissedMuscle(recording.name, muscle, error.cause, str(error)))
                rows.append(ResultRow(f"{base}.bursts", None, "1", "onset", split, stream.checksum, str(error)))
                continue
            span = float(stream.time[-1] - stream.time[0])
            time, samples = outline(stream.time, 1.0 * raw_channel(stream, muscle))
            each = MuscleBursts(
                recording.name, muscle, active.bursts, active.rest, active.rest_rms, active.active / span, time, samples
            )
            found.append(each)
            doubtful += [
                f"{name_channel(stream, muscle)}: {one.found} ({one.start:.2f} to {one.end:.2f} s). Onsets and their "
                "intervals are not reliable there."
                for one in active.doubtful
            ]
            rows += _rows(base, each, table.confidence, stream.checksum, split)
    if not found:
        raise RecordingError("\n".join(each.text for each in missed))
    verdicts = [Verdict("warning", f"{each.text}; no onset is reported there.") for each in missed]
    verdicts += [Verdict("note", text) for text in doubtful]
    if table.rest is None:
        quiet_text = (
            "The half second with the lowest EMG of each muscle is taken as rest. To choose another period, set "
            "rest = [start, end] in [onset]."
        )
        verdicts.append(Verdict("note", quiet_text))
    bursts = [burst for each in found for burst in each.bursts]
    seen = [burst for burst in bursts if burst.seen]
    if not seen:
        raise RecordingError(f"{study.folder}: found no muscle that begins to be active, expected rest before activity")
    late = float(np.median([b.crossed - b.onset.time for b in seen]))
    late_text = (
        f"A threshold alone would detect onsets {1e3 * late:.0f} ms later (median). An interval covers the time at "
        "which the variance begins to rise, whether abruptly or over up to 0.3 s."
    )
    verdicts.append(Verdict("note", late_text))
    return OnsetResult(
        study=study.name,
        headline=_headline(found, missed, table.confidence),
        tables=(_table(found),),
        verdicts=tuple(verdicts),
        confidence=table.confidence,
        rows=tuple(rows),
        cards={},
        checksums={recording.name: recording.checksum for recording in recordings},
        muscles=tuple(found),
        missed=tuple(missed),
    )


def _sought_muscles(stream: Recording, table: OnsetTable) -> tuple[str, ...]:
    """Return the muscles that the table names, or those of raw EMG; all if none is raw."""
    used = find_used_muscles(stream, table)
    raw = tuple(muscle for muscle in used if stream.channels[f"emg.{muscle}"].unit == "V")
    return used if table.muscles else raw or used


def _headline(found: Sequence[MuscleBursts], missed: Sequence[MissedMuscle], level: float) -> str:
    """Return in how many channels the first onset was found, and its interval."""
    onsets, count = first_onsets(found), len(found) + len(missed)
    recordings = len({each.recording for each in (*found, *missed)})
    return (
        f"The first onset was found in {len(onsets)} of {count} EMG channel{'s' * (count > 1)} ({recordings} "
        f"recording{'s' * (recordings > 1)}), to ±{half_width_ms(onsets):.0f} ms (half-width of its "
        f"{100 * level:g} % interval, median)."
    )


def first_onsets(found: Sequence[MuscleBursts]) -> list[ChangePoint]:
    """Return the first onset of each muscle and recording in which one was seen."""
    firsts = (next((burst.onset for burst in each.bursts if burst.seen), None) for each in found)
    return [onset for onset in firsts if onset is not None]


def half_width_ms(onsets: Sequence[ChangePoint]) -> float:
    """Return the median half-width of the intervals of onsets [ms]."""
    return float(np.median([500.0 * (onset.high - onset.low) for onset in onsets]))


def onset_answer(result: OnsetResult) -> Answer:
    """Return whether the onset of every muscle was found in every recording."""
    unseen = [each for each in result.muscles if not any(burst.seen for burst in each.bursts)]
    enveloped = Counter(each.muscle for each in result.missed if each.cause == ENVELOPE_CAUSE)
    lacking = [(each, "no onset detected") for each in unseen] + [(each, each.cause) for each in result.missed]
    parts = [AnswerPart(f"{each.muscle} in {each.recording}", "no", cause) for each, cause in lacking]
    onsets, recordings = first_onsets(result.muscles), len(result.checksums)
    quiet_ones = Counter(each.muscle for each, cause in lacking if cause != ENVELOPE_CAUSE)
    return Answer(
        "Was the onset of every muscle found, in every recording?",
        "no" if parts else "yes",
        result.headline,
        f"{len(parts)} not found: {reason_of_parts(parts)}" if parts else "",
        tuple(parts),
        (
            AnswerNumber("channels with an onset", len(onsets), "1"),
            AnswerNumber("half-width of the interval of a first onset, median", half_width_ms(onsets), "ms"),
        ),
        Basis(recordings, recordings),
        next=(*raw_emg_steps(enveloped), *_rest_steps(quiet_ones)) if parts else (PAPER_STEP,),
    )


def _rest_steps(lacking: Mapping[str, int]) -> tuple[Step, ...]:
    """Return the step that muscles need whose raw EMG shows no onset, with the number of their recordings."""
    if not lacking:
        return ()
    return (
        Step(
            f"Attach the electrodes of {counted_muscles(lacking)} again, and record half a second of rest before each "
            "effort; or state the rest as `rest = [start, end]` in [onset]"
        ),
    )


def _with_raw_emg(
    find: Callable[..., Any], stream: Recording, muscle: str, table: OnsetTable, **settings: float
) -> Any:
    """Return what `find` gives for a muscle's raw EMG in its whole file; errors name the file and the channel."""
    try:
        samples, inside = raw_whole_file(stream, muscle)
        time = (stream.uncut or stream).time
        return find(time, samples, rest=table.rest, height=table.height, inside=inside, **settings)
    except RecordingError as error:
        text = str(error)
        text = text if text.startswith(stream.path.name) else f"{name_channel(stream, muscle)}: {text}"
        raise UnseenOnsetError(text, getattr(error, "cause", OTHER_CAUSE)) from None


def _rows(base: str, each: MuscleBursts, level: float, checksum: str, split: str) -> Iterator[ResultRow]:
    """Yield the result rows of one muscle in one recording of a `split`."""

    def row(what: str, value: float | None, unit: str, note: str = "") -> ResultRow:
        return ResultRow(f"{base}.{what}", value, unit, "onset", split, checksum, note)

    yield row("bursts", len(each.bursts), "1")
    yield row("active", each.active, "1", "share of the recording")
    seen = [b.onset for b in each.bursts if b.seen]
    if seen:
        first, half = seen[0], float(np.median([0.5 * (b.high - b.low) for b in seen]))
        yield row("first_onset", first.time, "s", f"{100 * level:g} % interval {first.low:.4f} to {first.high:.4f} s")
        yield row("onset_half_width", half, "s", "median over bursts")
        yield row("duration", float(np.median([b.duration for b in each.bursts])), "s", "median over bursts")


def _table(found: list[MuscleBursts]) -> FigureTable:
    """Return the table of all muscles and recordings."""
    heads = ("Recording", "Muscle", "bursts", "first onset (s)", "± (ms)", "duration (s)", "active (%)")
    rows = []
    for each in found:
        first = next((b.onset for b in each.bursts if b.seen), None)
        numbers = (None, None, None)
        if first is not None:
            numbers = first.time, 500.0 * (first.high - first.low), float(np.median([b.duration for b in each.bursts]))
        rows.append((each.recording, each.muscle, len(each.bursts), *numbers, 100.0 * each.active))
    return FigureTable("When muscles become active", heads, tuple(rows), MAX_BRIEF_ROWS)
