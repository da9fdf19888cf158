"""Compute both indices of co-contraction for every pair of antagonists in every recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...._errors import RecordingError
from ....files.fault import Fault
from ....models.estimates import Verdict
from ....study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step, answer_of_parts
from ....study.procedures.procedure import Progress, quiet
from ....study.procedures.result import FigureTable, Result
from ....study.results import ResultRow
from ....study.study import Study
from ...cocontraction import (
    BLOCK_COUNT_BOUNDS,
    MIN_BLOCK_S,
    Cocontraction,
    CocontractionIndex,
    cocontraction_over_time,
)
from ..muscle_channels import (
    MAXIMAL_PROTOCOL,
    MuscleEnvelopes,
    emg_faults,
    envelope_faults,
    enveloped_channels,
    raise_refusals,
    raw_emg_steps,
    relative_envelopes,
)
from .cocontraction_table import CocontractionTable

MIN_INTERVAL_S = BLOCK_COUNT_BOUNDS[0] * MIN_BLOCK_S
"""Shortest recording whose indices have an interval [s]."""

DRAWN_STRETCH_S = 6.0
"""Duration of the drawn stretch of a recording [s]."""

NO_MAXIMAL_CONTRACTION = (
    "No maximal contraction was recorded. Envelopes are therefore relative to the largest recorded effort, and the "
    "indices depend on it. Compare conditions of one participant, not participants."
)
"""Warning where envelopes have no maximal contraction as their scale."""

RECORDED_ENVELOPES = (
    "Envelopes were recorded instead of raw EMG. They are normalised by the muscle's largest value in all recordings "
    "of a participant."
)
"""Note where study.toml says that the channels are envelopes."""


@dataclass(frozen=True, eq=False)
class PairActivity:
    """Co-contraction of a pair of antagonists in one recording."""

    recording: str
    pair: tuple[str, str]  # Names of the muscles
    found: Cocontraction  # Both indices
    time: np.ndarray = field(repr=False)  # Time of the drawn stretch, shape (k,) [s]
    first: np.ndarray = field(repr=False)  # Envelope of the first muscle in the stretch, shape (k,) [1]
    second: np.ndarray = field(repr=False)  # Envelope of the second muscle in the stretch, shape (k,) [1]
    enveloped: tuple[str, ...] = ()  # Muscles of which an envelope was recorded, and filtered as raw EMG


@dataclass(frozen=True, kw_only=True, repr=False)
class CocontractionResult(Result):
    """Result of `cocontraction`."""

    pairs: tuple[PairActivity, ...] = field(default=(), repr=False)

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return cocontraction_answer(self)

    def written(self, study: Study) -> str:
        return "No card is made of indices"


def find_cocontraction(study: Study, tell: Progress = quiet) -> CocontractionResult:
    """Compute both indices of every pair of the table in every recording."""
    table = study.table(CocontractionTable)
    raise_refusals(emg_faults(study, table))
    tell("envelopes", 0.1)
    recordings = _require_pairs(study, table, relative_envelopes(study, table))
    smooth = enveloped_channels(study, table)
    found, rows = [], []
    for each in recordings:
        for pair in table.pairs:
            first, second = (each.envelopes[muscle] for muscle in pair)
            try:
                index = cocontraction_over_time(each.time, first, second, level=table.confidence)
            except RecordingError as error:
                raise RecordingError(f"recording {each.name}, {' and '.join(pair)}: {error}") from None
            shown = np.abs(each.time - 0.5 * (each.time[0] + each.time[-1])) <= 0.5 * DRAWN_STRETCH_S
            own = tuple(muscle for muscle in pair if (each.name, muscle) in smooth)
            found.append(PairActivity(each.name, pair, index, each.time[shown], first[shown], second[shown], own))
            rows += _rows(study.name, found[-1], each, table.confidence)
    return CocontractionResult(
        study=study.name, headline=_headline(found), tables=(_table(found),), rows=tuple(rows), pairs=tuple(found),
        verdicts=tuple(_verdicts(study, table, found)), confidence=table.confidence, cards={},
        checksums={each.name: each.checksum for each in recordings},
    )  # fmt: skip


def cocontraction_answer(result: CocontractionResult) -> Answer:
    """Return whether the co-contraction of each pair is known with an interval."""
    parts, numbers = [], []
    for each in result.pairs:
        name, index = f"{' and '.join(each.pair)} in {each.recording}", each.found.common
        numbers.append(AnswerNumber(f"common activity of {name}", index.value, "%", index.interval))
        if each.enveloped:
            named = " and ".join(each.enveloped).replace("_", " ")
            parts.append(AnswerPart(name, "cannot say", f"{named}: an envelope, filtered as raw EMG"))
        elif index.interval is None:
            parts.append(AnswerPart(name, "cannot say", f"{index.value:.0f} %; too short for an interval"))
        else:
            parts.append(AnswerPart(name, "yes", f"{index.value:.0f} % ({_interval_text(index)} %)"))
    count = len(result.checksums)
    smooth = Counter(muscle for each in result.pairs for muscle in each.enveloped)
    short = any(each.found.common.interval is None for each in result.pairs)
    return answer_of_parts(
        "Is the co-contraction of each pair known, with an interval?",
        result.headline,
        parts,
        numbers,
        Basis(count, count),
        improve=(*raw_emg_steps(smooth), *((LONGER_STEP,) if short else ())),
    )


LONGER_STEP = Step(f"Record each pair for {MIN_INTERVAL_S:g} s or longer: shorter recordings give no interval")
"""Next step where recordings are too short."""


def faults(study: Study) -> list[Fault]:
    """Return the faults of EMG, and of pairs that lack an envelope."""
    table = study.table(CocontractionTable)
    return envelope_faults(study, table, lambda made: _require_pairs(study, table, made), "antagonists")


def _require_pairs(study: Study, table: CocontractionTable, recordings: list[MuscleEnvelopes]) -> list[MuscleEnvelopes]:
    """Return the recordings; raise a RecordingError if a pair is invalid or lacks EMG in one of them."""
    for pair in table.pairs:
        if pair[0] == pair[1]:
            raise RecordingError(f"{study.folder}: [cocontraction] pairs: found {pair[0]} twice, expected antagonists")
        for each in recordings:
            missing = [muscle for muscle in pair if muscle not in each.envelopes]
            if missing:
                raise RecordingError(
                    f"{study.folder}: [cocontraction] pairs, recording {each.name}: found EMG of "
                    f"{', '.join(each.envelopes)}, expected {', '.join(missing)} too"
                )
    return recordings


def _rows(study: str, each: PairActivity, of: MuscleEnvelopes, level: float) -> Iterator[ResultRow]:
    """Return the result rows of one pair in one recording."""
    base = f"{study}.{each.recording}.{'_'.join(each.pair)}"
    for name, index in (("falconer_winter", each.found.common), ("rudolph", each.found.weighed)):
        interval = _interval_text(index)
        note = f"{100 * level:g} % interval {interval} %" if interval else "too short for an interval"
        split = "heldout" if of.heldout else "fitted"
        yield ResultRow(f"{base}.{name}", index.value, "%", "cocontraction", split, of.checksum, note)


def _headline(found: list[PairActivity]) -> str:
    """Return the headline: the range of the common index for each pair, and in how many recordings it is known."""
    sentences = []
    for pair in dict.fromkeys(each.pair for each in found):
        own = [each for each in found if each.pair == pair]
        values = [each.found.common.value for each in own if not each.enveloped]
        names, of = " and ".join(pair).replace("_", " "), f"{len(own)} recording{'s' * (len(own) > 1)}"
        if not values:
            sentences.append(f"the co-contraction of {names} is not known in {of}")
            continue
        span = f"{values[0]:.0f} %" if len(values) == 1 else (
            f"{min(values):.0f} to {max(values):.0f} % (median {np.median(values):.0f} %)"
        )
        where = of if len(values) == len(own) else f"{len(values)} of {of}, unknown in the others"
        sentences.append(f"{names} have {span} of their activity in common, in {where}")
    return "; ".join(sentences) + "."


def _verdicts(study: Study, table: CocontractionTable, found: list[PairActivity]) -> Iterator[Verdict]:
    """Return verdicts on the scale of envelopes and on recordings too short for an interval."""
    if table.chain == "none":
        yield Verdict("note", RECORDED_ENVELOPES)
    elif not any(r.protocol == MAXIMAL_PROTOCOL for r in study.recordings()):
        yield Verdict("warning", NO_MAXIMAL_CONTRACTION)
    short = sorted({each.recording for each in found if each.found.common.interval is None})
    if short:
        names = ", ".join(short)
        yield Verdict("note", f"{names}: shorter than {MIN_INTERVAL_S:g} s, too short for a confidence interval.")


def _table(found: list[PairActivity]) -> FigureTable:
    """Return the table of both indices by recording and pair."""
    rows = []
    for each in found:
        common, weighed = each.found.common, each.found.weighed
        cells = common.value, _interval_text(common) or "–", weighed.value, _interval_text(weighed) or "–"
        rows.append((each.recording, " and ".join(each.pair), *cells))
    heads = ("Recording", "Pair", "common [%]", "interval", "weighed [%]", "its interval")
    return FigureTable("Co-contraction: common after Falconer and Winter, weighed after Rudolph", heads, tuple(rows))


def _interval_text(index: CocontractionIndex) -> str:
    """Return both ends of an index's interval, in per cent; nothing where the recording is too short for one."""
    return "" if index.interval is None else f"{index.interval[0]:.3g} to {index.interval[1]:.3g}"
