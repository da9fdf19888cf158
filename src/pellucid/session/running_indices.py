"""Indices that run along with a session, and what a certificate could say by now.

The indices of the finished trials are those of `assess`: the same movements by the same rule. EMG waits for `assess`,
which needs every trial of a person for its scale. What is said here takes no doubts into account (order, learning, what
was left out), so that it never replaces the certificate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from .._errors import PellucidError
from ..assessment.certificate import certificate
from ..assessment.equivalence_power import Active, find_equivalence_participants
from ..assessment.index_table import index_table
from ..assessment.indices import Index, indices_along
from ..procedures.assessment.assessment_table import AssessmentTable
from ..procedures.assessment.certified import PLANNED_POWER, end_points
from ..procedures.assessment.measured_study import MeasuredStudy, join_studies, measure
from ..procedures.assessment.pointing import labelled_amplitudes, pointing_record, with_rule
from ..recordings.recording import Recording

SHOWN_INDEX_NAMES = ("duration_median", "vmax", "end_absolute", "torque_rms", "unsettled")
"""Indices that the operator's page shows."""

SIMULATED_STUDIES = 200
"""Number of simulated studies behind "about n more people"; fewer than `assess` takes, so that it answers at once."""


@dataclass(frozen=True)
class ShownIndex:
    """One index in each condition of the person who is there."""

    words: str
    unit: str
    values: Mapping[str, float]  # by condition, in the unit shown


@dataclass(frozen=True)
class RunningVerdict:
    """What a certificate of one condition could say by now."""

    condition: str
    said: str  # "transparent", "not transparent" or "cannot say yet"
    people: int  # people with every end point
    more: int | None  # further people for a power of 90 %; None if that is not known
    why: str = ""


@dataclass
class RunningIndices:
    """Measures trials once each, and keeps what was measured."""

    spec: AssessmentTable
    _measured: dict[str, MeasuredStudy] = field(default_factory=dict)
    _along: str = "rad"

    def add(self, recording: Recording) -> int:
        """Measure a trial's movements; return how many were found. A trial without movements is left out."""
        try:
            record = pointing_record(recording, self.spec)
            found = measure([record], self.spec, with_rule(self.spec), {}, {}, named=labelled_amplitudes([record]))
        except PellucidError:
            return 0
        self._measured[recording.name] = found
        return len(found.movements)

    def shown(self, participant: str) -> list[ShownIndex]:
        """Return the indices of one person by condition."""
        own = [m for m in self._measured.values() if {p for p, _ in m.recorded.values()} == {participant}]
        made = []
        for name in SHOWN_INDEX_NAMES:
            index = self._indices[name]
            values = {}
            for condition in dict.fromkeys(c for m in own for _, c in m.recorded.values()):
                there = [m for m in own if {c for _, c in m.recorded.values()} == {condition}]
                table = self._table(there, index, [participant], [condition])
                if table is not None and condition in table.conditions:
                    factor, _ = index.shown
                    values[condition] = factor * float(table.column(condition)[0])
            if values:
                made.append(ShownIndex(index.words, index.shown[1], values))
        return made

    @property
    def _indices(self) -> Mapping[str, Index]:
        from ..units import COORDINATES_BY_UNIT

        return indices_along(COORDINATES_BY_UNIT[self._along])

    def _table(self, parts: Sequence[MeasuredStudy], index: Index, people: Sequence[str], conditions: Sequence[str]):
        if not any(part.movements for part in parts):
            return None
        whole = join_studies(parts)
        return index_table(whole.movements, index, people, conditions, self.spec.control, whole.lasted)

    def verdicts(self, conditions: Sequence[str]) -> list[RunningVerdict]:
        """Return what a certificate of each condition but control could say by now."""
        points = end_points(self.spec, self._indices)
        if not points:
            return []
        parts = list(self._measured.values())
        there = [each for m in parts for each in m.recorded.values()]
        people = list(dict.fromkeys(person for person, _ in there))
        return [self._verdict(c, points, parts, people) for c in conditions if c != self.spec.control]

    def _verdict(self, condition, points, parts, people) -> RunningVerdict:
        pair = (self.spec.control, condition)
        changes: dict[str, dict[str, float]] = {}
        for name, point in points.items():
            table = self._table(parts, point.index, people, pair)
            if table is None or condition not in table.conditions:
                return RunningVerdict(condition, "cannot say yet", 0, None, f"no {point.index.words.lower()} yet")
            base = table.column(pair[0]) if pair[0] in table.conditions and not point.index.over_control else None
            found = point.differences(table.column(condition), base)
            changes[name] = dict(zip(table.participants, found.tolist(), strict=True))
        both = [person for person in people if all(person in own for own in changes.values())]
        if len(both) < 2:
            return RunningVerdict(condition, "cannot say yet", len(both), None, "two people are the least")
        seen = {name: np.array([own[person] for person in both]) for name, own in changes.items()}
        margins = {name: point.margin for name, point in points.items()}
        try:
            said = certificate(
                seen, margins, alpha=self.spec.alpha, estimand=self.spec.estimand, people=self.spec.people
            ).verdict
            more = None
            if said == "cannot say" and len(both) > 2:
                covariance = np.atleast_2d(np.cov(np.array(list(seen.values()))))
                needed = find_equivalence_participants(
                    covariance, list(margins.values()), power=PLANNED_POWER, alpha=self.spec.alpha,
                    active=Active(self.spec.estimand, self.spec.people), studies=SIMULATED_STUDIES,
                )  # fmt: skip
                more = None if needed is None else max(needed - len(both), 1)
        except PellucidError as error:
            return RunningVerdict(condition, "cannot say yet", len(both), None, str(error))
        why = "" if len(both) > 2 else "three people are the least for a forecast"
        return RunningVerdict(condition, "cannot say yet" if said == "cannot say" else said, len(both), more, why)
