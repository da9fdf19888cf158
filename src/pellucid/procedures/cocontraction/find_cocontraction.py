"""Compute both indices of co-contraction for every pair of antagonists in every recording."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..._errors import RecordingError
from ...assessment.cocontraction import Cocontraction, cocontraction
from ...fit.parameter import Verdict
from ...recordings.fault import Fault
from ...recordings.results import ResultRow
from ...recordings.study import Study
from ..muscle_channels import MuscleEnvelopes, emg_faults, envelope_faults, raise_refusals, relative_envelopes
from ..procedure import Progress, quiet
from ..result import FigureTable, Result
from .procedure import CocontractionTable

DRAWN_STRETCH_S = 6.0
"""Duration of the drawn stretch of a recording [s]."""


@dataclass(frozen=True, eq=False)
class PairActivity:
    """Co-contraction of a pair of antagonists in one recording."""

    recording: str
    pair: tuple[str, str]  # Names of the muscles
    found: Cocontraction  # Both indices
    time: np.ndarray = field(repr=False)  # Time of the drawn stretch, shape (k,) [s]
    first: np.ndarray = field(repr=False)  # Envelope of the first muscle in the stretch, shape (k,) [1]
    second: np.ndarray = field(repr=False)  # Envelope of the second muscle in the stretch, shape (k,) [1]

    @property
    def words(self) -> str:
        """Names of the muscles in words."""
        return " and ".join(self.pair)


@dataclass(frozen=True, kw_only=True)
class CocontractionResult(Result):
    """Result of `cocontraction`."""

    pairs: tuple[PairActivity, ...] = field(default=(), repr=False)

    def written(self, study: Study) -> str:
        return "No card is made of indices"


def faults(study: Study, table: CocontractionTable) -> list[Fault]:
    """Return faults of EMG that is unfit for use, and of pairs without EMG."""
    return envelope_faults(study, table, lambda study, made: _require_pairs(study, table, made), "antagonists")


def find_cocontraction(study: Study, table: CocontractionTable, tell: Progress = quiet) -> CocontractionResult:
    """Compute both indices of every pair in every recording. `study` [cocontraction]."""
    raise_refusals(emg_faults(study, table))
    tell("envelopes", 0.1)
    recordings = _require_pairs(study, table, relative_envelopes(study, table))
    found, rows = [], []
    for each in recordings:
        for pair in table.pairs:
            first, second = (each.envelopes[muscle] for muscle in pair)
            try:
                index = cocontraction(each.time, first, second, level=table.confidence)
            except RecordingError as error:
                raise RecordingError(f"recording {each.name}, {' and '.join(pair)}: {error}") from None
            middle = 0.5 * (each.time[0] + each.time[-1])
            shown = np.abs(each.time - middle) <= 0.5 * DRAWN_STRETCH_S
            found.append(PairActivity(each.name, pair, index, each.time[shown], first[shown], second[shown]))
            rows += _rows(study.name, found[-1], each, table.confidence)
    return CocontractionResult(
        study=study.name,
        headline=_headline(found),
        tables=(_table(found),),
        verdicts=_verdicts(study, table, found),
        confidence=table.confidence,
        rows=tuple(rows),
        cards={},
        checksums={each.name: each.checksum for each in recordings},
        pairs=tuple(found),
    )


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
    if not recordings:
        raise RecordingError(f"{study.folder}: found maximal contractions alone, expected a recording of movement too")
    return recordings


def _rows(study: str, each: PairActivity, of: MuscleEnvelopes, level: float) -> list[ResultRow]:
    """Return the result rows of one pair in one recording."""
    base = f"{study}.{each.recording}.{'_'.join(each.pair)}"
    made = []
    for name, index in (("falconer_winter", each.found.common), ("rudolph", each.found.weighed)):
        if index.interval is None:
            note = "too short for an interval"
        else:
            note = f"{100 * level:g} % interval {index.interval[0]:.3g} to {index.interval[1]:.3g} %"
        made.append(ResultRow(f"{base}.{name}", index.value, "%", "cocontraction", "fitted", of.checksum, note))
    return made


def _headline(found: list[PairActivity]) -> str:
    """Return the headline: the range of the common index for each pair."""
    said = []
    for pair in dict.fromkeys(each.pair for each in found):
        values = [each.found.common.value for each in found if each.pair == pair]
        span = f"{values[0]:.0f}" if len(values) == 1 else f"{min(values):.0f} to {max(values):.0f}"
        said.append(f"{' and '.join(pair)} share {span} % of their activity")
    return "; ".join(said) + "."


def _verdicts(study: Study, table: CocontractionTable, found: list[PairActivity]) -> tuple[Verdict, ...]:
    """Return verdicts on the scale of envelopes and on recordings too short for an interval."""
    said = []
    if not any(r.protocol == "mvc" for r in study.recordings()) and table.chain != "none":
        said.append(
            Verdict(
                "warning",
                "No maximal contraction was recorded: envelopes are relative to the largest effort seen, and an index "
                "hangs on which effort that was. Compare conditions of one participant, not participants.",
            )
        )
    if table.chain == "none":
        said.append(
            Verdict(
                "note",
                "Envelopes were recorded: they are taken over the largest of each muscle in all recordings of a "
                "participant.",
            )
        )
    short = sorted({each.recording for each in found if each.found.common.interval is None})
    if short:
        said.append(Verdict("note", f"{', '.join(short)}: shorter than 4 s, no interval."))
    return tuple(said)


def _table(found: list[PairActivity]) -> FigureTable:
    """Return the table of both indices by recording and pair."""

    def words(index) -> str:
        if index.interval is None:
            return "–"
        return f"{index.interval[0]:.3g} to {index.interval[1]:.3g}"

    rows = tuple(
        (
            e.recording, e.words, e.found.common.value, words(e.found.common), e.found.weighed.value,
            words(e.found.weighed),
        )
        for e in found
    )  # fmt: skip
    heads = ("Recording", "Pair", "common [%]", "interval", "weighed [%]", "its interval")
    return FigureTable("Co-contraction: common after Falconer and Winter, weighed after Rudolph", heads, rows)
