"""Indices of co-contraction of every pair in every recording, and of conditions against each other."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..._errors import RecordingError
from ...assessment.cocontraction import Cocontraction, cocontraction
from ...fit.parameter import Verdict
from ...recordings.fault import Fault
from ...recordings.results import ResultRow
from ...recordings.study import Study
from ..muscle_channels import MuscleEnvelopes, emg_faults, envelope_faults, refuse, relative_envelopes
from ..procedure import Progress, quiet
from ..result import FigureTable, Result
from .procedure import CocontractionTable

STRETCH = 6.0
"""Seconds of a recording that are drawn."""


@dataclass(frozen=True, eq=False)
class PairActivity:
    """A pair in one recording."""

    recording: str
    pair: tuple[str, str]
    found: Cocontraction
    time: np.ndarray = field(repr=False)  # time, first, second: (k,) In the recording's middle [s], [1]
    first: np.ndarray = field(repr=False)
    second: np.ndarray = field(repr=False)

    @property
    def words(self) -> str:
        """Of the pair."""
        return " and ".join(self.pair)


@dataclass(frozen=True, kw_only=True)
class CocontractionResult(Result):
    """What `cocontraction` found."""

    pairs: tuple[PairActivity, ...] = field(default=(), repr=False)

    def written(self, study: Study) -> str:
        return "No card is made of indices"


def faults(study: Study) -> list[Fault]:
    """EMG that is not fit to be used, and pairs that are none."""
    return envelope_faults(study, study.table(CocontractionTable), _checked, "antagonists")


def find_cocontraction(study: Study, tell: Progress = quiet) -> CocontractionResult:
    """Both indices of every pair in every recording. `study` [cocontraction]."""
    table = study.table(CocontractionTable)
    refuse(emg_faults(study, table))
    tell("envelopes", 0.1)
    recordings = _checked(study, relative_envelopes(study, table))
    found, rows = [], []
    for each in recordings:
        for pair in table.pairs:
            first, second = (each.envelopes[muscle] for muscle in pair)
            try:
                index = cocontraction(each.time, first, second, level=table.confidence)
            except RecordingError as error:
                raise RecordingError(f"recording {each.name}, {' and '.join(pair)}: {error}") from None
            middle = 0.5 * (each.time[0] + each.time[-1])
            shown = np.abs(each.time - middle) <= 0.5 * STRETCH
            found.append(PairActivity(each.name, pair, index, each.time[shown], first[shown], second[shown]))
            rows += _rows(study.name, found[-1], each, table.confidence)
    return CocontractionResult(
        study=study.name,
        headline=_headline(found),
        tables=(_table(found),),
        verdicts=_verdicts(study, found),
        confidence=table.confidence,
        rows=tuple(rows),
        cards={},
        checksums={each.name: each.checksum for each in recordings},
        pairs=tuple(found),
    )


def _checked(study: Study, recordings: list[MuscleEnvelopes]) -> list[MuscleEnvelopes]:
    """Recordings in which every pair is; RecordingError where one is not."""
    for pair in study.table(CocontractionTable).pairs:
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
    said = []
    for pair in dict.fromkeys(each.pair for each in found):
        values = [each.found.common.value for each in found if each.pair == pair]
        span = f"{values[0]:.0f}" if len(values) == 1 else f"{min(values):.0f} to {max(values):.0f}"
        said.append(f"{' and '.join(pair)} share {span} % of their activity")
    return "; ".join(said) + "."


def _verdicts(study: Study, found: list[PairActivity]) -> tuple[Verdict, ...]:
    said = []
    if not any(r.protocol == "mvc" for r in study.recordings()) and study.table(CocontractionTable).chain != "none":
        said.append(
            Verdict(
                "warning",
                "No maximal contraction was recorded: envelopes are relative to the largest effort seen, and an index "
                "hangs on which effort that was. Compare conditions of one participant, not participants.",
            )
        )
    if study.table(CocontractionTable).chain == "none":
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
