"""Indices that run along with a session, and what a certificate could say by now.

The indices of the finished trials are those of `assess`: the same functions measure all trials of a person together,
and compare movements that every condition has. EMG waits for `assess`, which needs every trial of a person for its
scale. What is said here takes periods and carry-over into account, but no doubts (learning, what was left out), so that
it never replaces the certificate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..._errors import PellucidError
from ...files.recording import Recording
from ...people.certificate import certificate
from ...people.indices import Index, indices_along
from ...people.movement_indices import index_table
from ...people.power import Active, find_equivalence_participants
from ...people.study.assessment_table import AssessmentTable
from ...people.study.certified import PLANNED_POWER, end_points
from ...people.study.measured_study import MeasuredStudy, join_studies, measure, with_assumed_delays
from ...people.study.pointing import PointingRecord, labelled_amplitudes, session_order, usable_records, with_rule

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
    """Keeps the trials of a session, and measures each person's trials together."""

    spec: AssessmentTable
    _records: dict[str, PointingRecord] = field(default_factory=dict)
    _measured: dict[tuple, MeasuredStudy] = field(default_factory=dict)  # by person, trials and labelled amplitudes
    _along: str = "rad"

    def add(self, recording: Recording) -> int:
        """Take a trial; return how many movements were found. A trial that `assess` would leave out is left out."""
        try:
            records, _ = usable_records([recording], self.spec)
            found = sum(len(record.movements(with_rule(self.spec))[1]) for record in records)
        except PellucidError:
            return 0
        self._records |= {record.recording.name: record for record in records}
        return found

    def shown(self, participant: str) -> list[ShownIndex]:
        """Return the indices of one person by condition."""
        own = [part for part in self._parts() if {p for p, _ in part.recorded.values()} == {participant}]
        conditions = self._conditions(own)
        made = []
        for name in SHOWN_INDEX_NAMES:
            index = self._indices[name]
            table = self._table(own, index, [participant], conditions)
            if table is None:
                continue
            factor, unit = index.shown
            values = {condition: factor * float(table.column(condition)[0]) for condition in table.conditions}
            made.append(ShownIndex(index.words, unit, values))
        return made

    def _parts(self) -> list[MeasuredStudy]:
        """Return each person's movements, measured as `assess` measures them."""
        if not self._records:
            return []
        records, _ = with_assumed_delays(list(self._records.values()))
        named, rule = labelled_amplitudes(records), with_rule(self.spec)
        parts = []
        for person in dict.fromkeys(record.recording.participant for record in records):
            own = [record for record in records if record.recording.participant == person]
            key = (person, tuple(record.recording.name for record in own), tuple(named))
            if key not in self._measured:
                self._measured = {k: part for k, part in self._measured.items() if k[0] != person}
                self._measured[key] = measure(own, self.spec, rule, {}, {}, named=named)
            parts.append(self._measured[key])
        return parts

    def _conditions(self, parts: Sequence[MeasuredStudy]) -> list[str]:
        """Return the conditions that were recorded, control first."""
        found = dict.fromkeys(condition for part in parts for _, condition in part.recorded.values())
        return sorted(found, key=lambda condition: condition != self.spec.control)

    @property
    def _indices(self) -> Mapping[str, Index]:
        from ...units import COORDINATES_BY_UNIT

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
        parts = self._parts()
        there = [each for m in parts for each in m.recorded.values()]
        people = list(dict.fromkeys(person for person, _ in there))
        return [self._verdict(c, points, parts, people) for c in conditions if c != self.spec.control]

    def _verdict(self, condition, points, parts, people) -> RunningVerdict:
        control, recorded = self.spec.control, self._conditions(parts)
        changes: dict[str, dict[str, float]] = {}
        for name, point in points.items():
            table = self._table(parts, point.index, people, recorded)
            if table is None or condition not in table.conditions:
                return RunningVerdict(condition, "cannot say yet", 0, None, f"no {point.index.words.lower()} yet")
            base = table.column(control) if control in table.conditions and not point.index.over_control else None
            found = point.differences(table.column(condition), base)
            changes[name] = dict(zip(table.participants, found.tolist(), strict=True))
        both = [person for person in people if all(person in own for own in changes.values())]
        if len(both) < 2:
            return RunningVerdict(condition, "cannot say yet", len(both), None, "two people are the least")
        seen = {name: np.array([own[person] for person in both]) for name, own in changes.items()}
        margins = {name: point.margin for name, point in points.items()}
        order = session_order([record.recording for record in self._records.values()])
        rule = self.spec.share_rule
        try:
            sessions = order.sessions(both, recorded, control, condition)
            found = certificate(
                seen, margins, alpha=self.spec.alpha, estimand=self.spec.estimand, people=self.spec.people,
                people_level=rule.alpha, sessions=sessions, largest_carry_over=self.spec.largest_carry_over,
            )  # fmt: skip
            said = found.verdict
            more = None
            if said == "cannot say" and len(both) > 2:
                covariance = np.atleast_2d(np.cov([test.differences for test in found.end_points.values()]))
                needed = find_equivalence_participants(
                    covariance, list(margins.values()), power=PLANNED_POWER, alpha=self.spec.alpha,
                    active=Active(
                        self.spec.estimand, self.spec.people, rule.alpha, sessions is not None,
                        self.spec.largest_carry_over,
                    ),
                    studies=SIMULATED_STUDIES,
                )  # fmt: skip
                more = None if needed is None else max(needed - len(both), 1)
        except PellucidError as error:
            return RunningVerdict(condition, "cannot say yet", len(both), None, str(error))
        why = "" if len(both) > 2 else "three people are the least for a forecast"
        return RunningVerdict(condition, "cannot say yet" if said == "cannot say" else said, len(both), more, why)
