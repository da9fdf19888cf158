r"""Correlate envelopes of EMG with force in every contraction, and find what holds over people.

The force passes the low-pass of an envelope, so that both are equally smooth. Fisher's :math:`z = \mathrm{artanh}\, r`
of each person is a sample; the interval of the mean z over people is Student's, turned back into correlations. A muscle
follows the force if the interval lies above the correlation that was stated beforehand, and tells some of it if the
interval lies above 0. It tells little of the force if the interval reaches 0 and lies below the stated correlation.
Anything else cannot be said from these people.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from ...._errors import RecordingError
from ....files.fault import Fault
from ....models.estimates import Verdict
from ....numerics.filters import zero_phase_lowpass
from ....study.answer import (
    Answer,
    AnswerNumber,
    AnswerPart,
    AnswerVerdict,
    Basis,
    Step,
    answer_of_parts,
)
from ....study.pages.quantities import MINUS_SIGN
from ....study.procedures.procedure import Progress, quiet
from ....study.procedures.result import FigureTable, Result
from ....study.results import ResultRow
from ....study.study import Study
from ..muscle_channels import (
    MuscleEnvelopes,
    emg_faults,
    envelope_faults,
    enveloped_channels,
    raise_refusals,
    raw_emg_steps,
    relative_envelopes,
)
from .emg_force_table import EmgForceTable

FORCE_LOWPASS_HZ = 6.0
"""Cut-off of the low-pass on force [Hz], as on envelopes of the chain "hill"."""

MIN_PEOPLE = 3
"""Smallest number of people whose mean gets an interval."""

MAX_CORRELATION = 0.9999
"""Correlations are cut off here before they are transformed: z of 1 is infinite."""

ForceAnswer = Literal["follows the force", "tells some of the force", "tells little of the force", "cannot say"]
"""Possible answers to whether a muscle's EMG follows the force."""

SPOILED_WORDS = "an envelope, filtered as raw EMG"
"""Why nothing can be said of a muscle."""

MAX_PEOPLE = 200
"""Largest number of people that a next step advises."""

POWER = 0.8
"""Probability with which the advised number of people decides, if correlations are as those recorded."""

HEADLINE_WORDS: dict[AnswerVerdict, str] = {
    "yes": "{least:g} or more",
    "no": "less than {least:g}",
    "cannot say": "undecided, because the interval includes {least:g}",
}
"""Words for the correlations of each verdict in the headline."""


@dataclass(frozen=True)
class MuscleForce:
    """Correlation of one muscle's EMG with the force of one task."""

    task: str
    muscle: str
    agonist: bool  # Whether the study names this muscle for the task
    people: tuple[str, ...] = field(repr=False)
    each: tuple[float, ...] = field(repr=False)  # Correlation of each person
    mean: float  # Mean correlation, by the mean of Fisher's z
    low: float  # Lower end of its interval over people
    high: float  # Upper end
    follows: float  # Correlation that counts as following the force, stated beforehand
    confidence: float = 0.95  # Level of the interval
    is_spoiled: bool = False  # Whether a recorded envelope was filtered as raw EMG, which says nothing of the muscle

    @property
    def answer(self) -> ForceAnswer:
        """Answer for the stated correlation."""
        if self.is_spoiled:
            return "cannot say"
        if self.low >= self.follows:
            return "follows the force"
        if self.low > 0.0:
            return "tells some of the force"
        return "tells little of the force" if self.high < self.follows else "cannot say"

    @property
    def verdict(self) -> AnswerVerdict:
        """Whether the correlation is the stated one or more."""
        if self.is_spoiled:
            return "cannot say"
        return "yes" if self.low >= self.follows else "no" if self.high < self.follows else "cannot say"


@dataclass(frozen=True, kw_only=True, repr=False)
class EmgForceResult(Result):
    """Result of `emg_force`."""

    found: tuple[MuscleForce, ...] = field(default=(), repr=False)
    # Number of recordings of each muscle that hold an envelope, not raw EMG
    enveloped: Mapping[str, int] = field(default_factory=dict)

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return force_answer(self)

    def written(self, study: Study) -> str:
        return "No card is made of correlations"


def find_emg_force(study: Study, tell: Progress = quiet) -> EmgForceResult:
    """Correlate every muscle's envelope with the force of each task, over people."""
    table = study.table(EmgForceTable)
    raise_refusals(emg_faults(study, table))
    tell("envelopes", 0.1)
    recordings = _require_tasks(study, table, relative_envelopes(study, table))
    forces = {r.name: (r.time, r[table.force], r.fs) for r in study.recordings() if table.force in r.channels}
    each: dict[tuple[str, str], dict[str, float]] = {}
    for recording in recordings:
        time, force, fs = forces[recording.name]
        smooth = np.interp(recording.time, time, zero_phase_lowpass(force, FORCE_LOWPASS_HZ, 4, fs))
        for muscle, envelope in recording.envelopes.items():
            key = str(recording.condition), muscle
            each.setdefault(key, {})[recording.participant or recording.name] = _correlation(envelope, smooth)
    smooth = set(enveloped_channels(study, table))
    spoiled = {(str(r.condition), muscle) for r in recordings for muscle in r.envelopes if (r.name, muscle) in smooth}
    found = tuple(
        replace(summarise_people(task, muscle, table, own), is_spoiled=(task, muscle) in spoiled)
        for (task, muscle), own in sorted(each.items(), key=lambda item: table.agonists.get(item[0][0]) != item[0][1])
    )
    return EmgForceResult(
        study=study.name, headline=_headline(found, table.confidence), tables=(_table(found, table.confidence),),
        rows=tuple(_rows(study.name, found, table.confidence)), found=found, verdicts=tuple(_verdicts(found)),
        confidence=table.confidence, cards={}, checksums={each.name: each.checksum for each in recordings},
        enveloped=Counter(muscle for _, muscle in smooth),
    )  # fmt: skip


def force_answer(result: EmgForceResult) -> Answer:
    """Return whether the EMG of each task's own muscle follows the force, by the interval of its correlation."""
    parts, numbers = [], []
    for each in (each for each in result.found if each.agonist):
        name = f"{_words(each.muscle)} in {_words(each.task)}"
        interval = f"{each.low:.2f} to {each.high:.2f}"
        reason = SPOILED_WORDS if each.is_spoiled else f"r {each.mean:.2f} ({interval}): {each.answer}"
        parts.append(AnswerPart(name, each.verdict, reason))
        numbers.append(AnswerNumber(f"correlation of {name} with the force", each.mean, "1", (each.low, each.high)))
    count, least = len(result.checksums), next((each.follows for each in result.found), 1.0)
    return answer_of_parts(
        f"Does the EMG of the named muscles follow the force, with a correlation of {least:g} or more?",
        result.headline,
        parts,
        numbers,
        Basis(count, count),
        improve=_improving(result),
    )


def _improving(result: EmgForceResult) -> tuple[Step, ...]:
    """Return what improves muscles that are not shown to follow the force: raw EMG, more people, or other muscles."""
    own = [each for each in result.found if each.agonist and each.verdict != "yes"]
    smooth = {each.muscle: result.enveloped[each.muscle] for each in own if each.is_spoiled}
    steps = list(raw_emg_steps(smooth))
    open_ones = [each for each in own if each.verdict == "cannot say" and not each.is_spoiled]
    if open_ones:
        needed: dict[int | None, list[str]] = {}
        for each in open_ones:
            needed.setdefault(needed_people(each), []).append(_muscle_words(each, result.found))
        named = [f"{people} in all for {', '.join(names)}" for people, names in needed.items() if people is not None]
        if named:
            steps.append(Step(f"Record more people, for a power of {100 * POWER:g} %: {'; '.join(named)}"))
        if None in needed:
            text = f"even {MAX_PEOPLE} people would not give a clear answer; check the electrodes and the load cell"
            steps.append(Step(f"{', '.join(needed[None])}: {text}"))
    rest = [each for each in own if each.verdict == "no"]
    if rest:
        names = ", ".join(dict.fromkeys(_words(each.muscle) for each in rest))
        text = f"Check the electrodes of {names} and the load cell, or record a muscle that acts in this task"
        steps.append(Step(text))
    return tuple(steps)


def faults(study: Study) -> list[Fault]:
    """Return the faults of EMG, and of tasks that lack a force or an envelope."""
    table = study.table(EmgForceTable)
    return envelope_faults(study, table, lambda made: _require_tasks(study, table, made), "force and EMG of each task")


def _require_tasks(study: Study, table: EmgForceTable, recordings: list[MuscleEnvelopes]) -> list[MuscleEnvelopes]:
    """Return the recordings of the tasks; raise a RecordingError if a force, a task or its muscle is missing."""
    channels = {r.name: r.channels for r in study.recordings()}
    for each in recordings:
        if each.condition not in table.agonists:
            raise RecordingError(
                f"{study.folder}: [emg_force.agonists], recording {each.name}: found the condition {each.condition}, "
                f"expected one of {', '.join(table.agonists)}"
            )
        muscle = table.agonists[each.condition]
        if muscle not in each.envelopes:
            raise RecordingError(
                f"{study.folder}: [emg_force.agonists], recording {each.name}: found EMG of "
                f"{', '.join(each.envelopes)}, expected {muscle} too"
            )
        if table.force not in channels[each.name]:
            raise RecordingError(
                f"{study.folder}: [emg_force], recording {each.name}: found no {table.force}, expected the force"
            )
    return recordings


def summarise_people(task: str, muscle: str, table: EmgForceTable, each: dict[str, float]) -> MuscleForce:
    """Return the mean correlation over people with its interval, given each person's correlation by name."""
    from scipy.stats import t as student

    values = np.array(list(each.values()))
    z = np.arctanh(np.clip(values, -MAX_CORRELATION, MAX_CORRELATION))
    half = float("inf")
    if len(z) >= MIN_PEOPLE:
        half = float(student.ppf(0.5 + 0.5 * table.confidence, len(z) - 1) * z.std(ddof=1) / np.sqrt(len(z)))
    mean = float(z.mean())
    low, high = (float(np.tanh(end)) for end in (mean - half, mean + half))
    own = table.agonists.get(task) == muscle
    return MuscleForce(
        task, muscle, own, tuple(each), tuple(map(float, values)), float(np.tanh(mean)), low, high, table.follows,
        table.confidence,
    )


def needed_people(found: MuscleForce) -> int | None:
    """Return with how many people the interval excludes the stated correlation, with the probability `POWER`.

    Mean and spread over people are taken as those of the people recorded. None above `MAX_PEOPLE`.
    """
    from scipy.stats import nct
    from scipy.stats import t as student

    z = np.arctanh(np.clip(found.each, -MAX_CORRELATION, MAX_CORRELATION))
    if len(z) < MIN_PEOPLE:
        return MIN_PEOPLE
    effect = abs(z.mean() - np.arctanh(min(found.follows, MAX_CORRELATION))) / z.std(ddof=1)
    counts = np.arange(len(z) + 1, MAX_PEOPLE + 1)
    limits = student.ppf(0.5 + 0.5 * found.confidence, counts - 1)
    enough = counts[nct.sf(limits, counts - 1, effect * np.sqrt(counts)) >= POWER]
    return int(enough[0]) if len(enough) else None


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Return the correlation of two signals, shape (n,) each; 0 if one of them does not change."""
    if not (np.std(a) > 0.0 and np.std(b) > 0.0):
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


def _words(name: str) -> str:
    return name.replace("_", " ")


def _muscle_words(each: MuscleForce, found: Sequence[MuscleForce]) -> str:
    """Return a task's own muscle in words, with the task if the muscle is that of several."""
    is_shared = sum(e.agonist and e.muscle == each.muscle for e in found) > 1
    return f"{_words(each.muscle)} in {_words(each.task)}" if is_shared else _words(each.muscle)


def _headline(found: Sequence[MuscleForce], level: float) -> str:
    """Return the headline: each task's own muscle with its correlation and interval, by verdict."""
    own = [e for e in found if e.agonist]
    counts = sorted({len(e.each) for e in own})
    people = "person" if counts == [1] else "people"
    parts = []
    for verdict, words in HEADLINE_WORDS.items():
        told = [
            f"{_muscle_words(e, found)} {e.mean:.2f} ({e.low:.2f} to {e.high:.2f})"
            for e in own
            if e.verdict == verdict and not e.is_spoiled
        ]
        if told:
            parts.append(f"{words.format(least=own[0].follows)}: {', '.join(told)}")
    spoiled = dict.fromkeys(_words(e.muscle) for e in own if e.is_spoiled)
    parts += [f"{SPOILED_WORDS}: {', '.join(spoiled)}"] if spoiled else []
    of = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    return f"Correlation of EMG and force, {of} {people} ({100 * level:g} % interval): {'; '.join(parts)}."


def _table(found: Sequence[MuscleForce], level: float) -> FigureTable:
    """Return the table of correlations by task and muscle, each task's own muscle first."""
    heads = ("Task", "Muscle", "Own", "r over people", f"{100 * level:g} % interval", "of people", "EMG")
    rows = tuple(
        (
            _words(e.task), _words(e.muscle), "yes" if e.agonist else "no", e.mean,
            f"{e.low:.2f} to {e.high:.2f}".replace("-", MINUS_SIGN),
            f"{min(e.each):.2f} to {max(e.each):.2f}".replace("-", MINUS_SIGN), e.answer,
        )
        for e in found
    )  # fmt: skip
    return FigureTable("Envelope against force", heads, rows)


def _rows(study: str, found: Sequence[MuscleForce], level: float) -> Iterator[ResultRow]:
    """Yield a row for each task and muscle, and the ends of the interval of the task's own muscle."""
    for e in found:
        note = f"{len(e.each)} people, {100 * level:g} % interval {e.low:.2f} to {e.high:.2f}: {e.answer}"
        yield ResultRow(f"{study}.{e.task}.{e.muscle}.r", e.mean, "1", "emg-force", "fitted", None, note)


def _verdicts(found: Sequence[MuscleForce]) -> Iterator[Verdict]:
    """Yield a warning for each muscle whose EMG tells little of the force of its own task."""
    for e in found:
        if e.agonist and e.answer == "tells little of the force":
            yield Verdict(
                "warning",
                f"{_words(e.task)}: the envelope of {_words(e.muscle)} hardly follows the force (r {e.mean:.2f}, "
                f"{e.low:.2f} to {e.high:.2f}), so that the force cannot be estimated from it.",
                "Check the electrode and the load cell, and record a muscle that acts in this task.",
            )
        if e.agonist and len(e.each) < MIN_PEOPLE:
            yield Verdict("note", f"{_words(e.task)}: fewer than {MIN_PEOPLE} people, no interval.")
