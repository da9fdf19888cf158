"""Indices during a session, and the provisional verdict of a certificate.

The indices of the finished trials are those of `assess`: the same functions measure all trials of a person together,
and compare movements that every condition has. EMG waits for `assess`, which needs every trial of a person for its
scale. The provisional verdict takes periods and carry-over into account, but neither learning nor excluded trials, so
that it never replaces the certificate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..._errors import PellucidError
from ...files.recording import Recording
from ...people.analysis import Analysis, EndPoint
from ...people.certificate import CANNOT_SAY, decide
from ...people.indices import Index, indices_along
from ...people.movement_indices import index_table
from ...people.study.assessment_answer import CERTIFICATE_VERDICTS
from ...people.study.assessment_table import AssessmentTable
from ...people.study.certified import people_needed, study_changes
from ...people.study.measured_study import MeasuredStudy, join_studies, measure, with_assumed_delays
from ...people.study.pointing import PointingRecord, labelled_amplitudes, session_order, usable_records, with_rule
from ...study.answer import Answer, Basis, Step

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
    said: str  # "transparent", "not transparent", each also "(post hoc)", or "cannot say yet"
    people: int  # people with every end point
    more: int | None  # further people for a power of 90 %; None if that is not known
    why: str = ""

    @property
    def answer(self) -> Answer:
        """Whether the condition is transparent by what was recorded so far, as the operator's page shows it."""
        verdict = CERTIFICATE_VERDICTS.get(self.said.partition(" (")[0], "cannot say")
        who = f"{self.people} {'person' if self.people == 1 else 'people'} so far"
        words = f"{self.condition.replace('_', ' ')}: {self.said}"
        step = Step("Record the next participant")
        if self.more is not None:
            more = f"about {self.more} more {'person' if self.more == 1 else 'people'}"
            words, step = f"{words}, {more}", Step(f"Record {more}")
        said = f"{words}; {who}{f' ({self.why})' if self.why else ''}"
        reason = "" if verdict == "yes" else self.why or f"the endpoints of {who} do not show it"
        basis = Basis(self.people, self.people, "participant")
        return Answer(f"Is {self.condition.replace('_', ' ')} transparent?", verdict, said, reason, basis=basis,
                      next=(step,))  # fmt: skip


@dataclass
class RunningIndices:
    """Keeps the trials of a session, and measures each person's trials together."""

    spec: AssessmentTable
    registered: Analysis | None = None  # analysis that was registered before the data
    _records: dict[str, PointingRecord] = field(default_factory=dict)
    _measured: dict[tuple, MeasuredStudy] = field(default_factory=dict)  # by person, trials and labelled amplitudes
    _along: str = "rad"

    def add(self, recording: Recording) -> int:
        """Add a trial and return its number of movements; trials that `assess` would exclude are excluded."""
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
        points = self.spec.analysis.end_points(self._indices)
        if not points:
            return []
        parts = self._parts()
        there = [each for m in parts for each in m.recorded.values()]
        people = list(dict.fromkeys(person for person, _ in there))
        return [self._verdict(c, points, parts, people) for c in conditions if c != self.spec.control]

    def _verdict(
        self, condition: str, points: Mapping[str, EndPoint], parts: Sequence[MeasuredStudy], people: Sequence[str]
    ) -> RunningVerdict:
        control, recorded, analysis = self.spec.control, self._conditions(parts), self.spec.analysis
        kept = [person for person in people if person not in analysis.excluded]
        tables = {}
        for name, point in points.items():
            table = self._table(parts, point.index, kept, recorded)
            if table is None or condition not in table.conditions:
                return RunningVerdict(condition, "cannot say yet", 0, None, f"no {point.index.words.lower()} yet")
            tables[name] = table
        both = [person for person in kept if all(person in table.participants for table in tables.values())]
        if len(both) < 2:
            return RunningVerdict(condition, "cannot say yet", len(both), None, "at least two people are required")
        order = session_order([record.recording for record in self._records.values()])
        missing = len({*people, *analysis.excluded}) - len(both)
        more = None
        try:
            whole = join_studies(parts)
            changes = study_changes(whole, points, tables, [control, *(c for c in recorded if c != control)], condition,
                                    both, order, analysis)  # fmt: skip
            found = decide(analysis, changes, lost_people=missing, registered=self.registered)
            if found.verdict == CANNOT_SAY:
                needed = people_needed(points, found, changes, analysis, order, studies=SIMULATED_STUDIES)
                more = None if needed is None else max(needed - len(both), 1)
        except PellucidError as error:
            return RunningVerdict(condition, "cannot say yet", len(both), None, str(error))
        why = "" if len(both) > 2 else "three people are the least for a forecast"
        said = "cannot say yet" if found.verdict == CANNOT_SAY else found.statement
        return RunningVerdict(condition, said, len(both), more, why)
