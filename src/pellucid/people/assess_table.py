"""Conditions compared from a table with one row for each movement, trial or participant.

Movements are compared within cells of alike ones (amplitude, target, direction), the limits on lost movements and
participants hold, and order and learning are doubted where columns state them: by the functions that compare a study's
recordings.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .._errors import PellucidError
from .._tabular import columns_of, data_frame, html_table, text_table
from .analysis import DEFAULT_MAX_LEFT_OUT, Analysis, EndPoint, Estimand, keywords_beside
from .certificate import PASS, Certificate, LostCounts, PeoplesChanges, decide, too_many_lost
from .certificate_text import change_text, interval_level, interval_with_unit, p_text, people_text
from .comparison import ConditionComparison, compare_conditions
from .design_columns import DesignRole, columns_with_role, design_roles, level_of, too_many_levels
from .equivalence import DEFAULT_CARRY_OVER, Equivalence, equivalence
from .learning import OrderedMovements, learning
from .margin import Margin
from .movement_indices import shared_cells
from .movement_noise import MovementNoise, movement_noise
from .share_of_people import DEFAULT_RULE
from .uneven_losses import completed_values, excess_losses

NO_MARGIN = Margin(-float("inf"), 0.0)
"""Margin of an index that has none: of its test only the change, its interval and the p value of no change are used."""


@dataclass(frozen=True, eq=False, repr=False)
class TableAssessment(Mapping[str, ConditionComparison]):
    """Comparison of conditions for each index of a table: a mapping from index to `ConditionComparison`.

    Attributes
    ----------
    comparisons : mapping of str to ConditionComparison
        Rank tests, effect sizes and intervals, by index.
    participants : tuple of str
        Participants who did all conditions.
    left_out : tuple of str
        Participants who lack a condition; they enter no comparison.
    certificates : mapping of str to Certificate
        By condition, whether it is transparent within the margins; empty without margins.
    lost : mapping of str to mapping of str to tuple of int
        By index and condition, the movements without a value and all movements. All are as many as the condition that
        has most rows of a participant's alike movements.
    factors : tuple of str
        Columns within whose levels movements are compared.
    uncompared : tuple of str
        Other columns that were taken as part of the design, and so are no indices.
    notes : tuple of str
        What limits the comparison, in sentences.
    changes : mapping of str to mapping of str to Equivalence
        By index and condition, people's changes from control: of an index with a margin those of its certificate, of
        another one differences in the unit of its column. The printed change, its 95 % interval and p are of these.
    """

    comparisons: Mapping[str, ConditionComparison]
    participants: tuple[str, ...]
    left_out: tuple[str, ...]
    certificates: Mapping[str, Certificate] = field(default_factory=dict)
    lost: Mapping[str, LostCounts] = field(default_factory=dict)
    factors: tuple[str, ...] = ()
    uncompared: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    changes: Mapping[str, Mapping[str, Equivalence]] = field(default_factory=dict)

    def __getitem__(self, index: str) -> ConditionComparison:
        if index not in self.comparisons:
            raise KeyError(f"found no index {index!r}, expected one of {', '.join(self.comparisons)}")
        return self.comparisons[index]

    def __iter__(self) -> Iterator[str]:
        return iter(self.comparisons)

    def __len__(self) -> int:
        return len(self.comparisons)

    def to_frame(self):
        """Return one row for each index and condition as a data frame; needs pandas."""
        rows = self._rows()
        return data_frame({name: [row[name] for row in rows] for name in rows[0]} if rows else {})

    def _rows(self) -> list[dict[str, Any]]:
        made = []
        for index, comparison in self.comparisons.items():
            holm_p = {name: each.p for name, each in comparison.pairwise.items()}
            for name, test in self.changes[index].items():
                point = self._point(index, name)
                low, high = (point.shown(end) for end in test.interval)
                made.append({
                    "index": index, "condition": name, "change": point.shown(test.estimate), "low": low, "high": high,
                    "unit": point.unit, "p": test.p_no_change, "p_signed_rank_holm": holm_p[name],
                    "standardised": comparison.pairwise[name].standardised,
                })  # fmt: skip
        return made

    def _point(self, index: str, condition: str) -> EndPoint:
        """Return the end point of an index; one without a margin is in the unit of its column."""
        own = self.certificates.get(condition)
        if own is not None and index in own.end_points:
            return own.point(index)
        return EndPoint("", "rad", "", NO_MARGIN, False)

    def _table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        head = ("index", "condition", "change", "95 % interval", "p")
        made = []
        for index, tests in self.changes.items():
            for name, test in tests.items():
                point = self._point(index, name)
                change, interval = change_text(point, test), interval_with_unit(point, test)
                made.append((index, name, change, interval, p_text(test.p_no_change)))
        return head, made

    def _facts(self) -> tuple[str, ...]:
        said = [f"{len(self.participants)} participants"]
        if self.left_out:
            said.append(f"excluded for a missing condition: {', '.join(self.left_out)}")
        said += [f"{name}: {each.statement}{self._why(name)}" for name, each in self.certificates.items()]
        if any(self._point(index, name).unit == "" for index, tests in self.changes.items() for name in tests):
            said.append("changes without % are in the unit of their column")
        if self.factors:
            said.append(f"factors, within whose levels movements are compared: {', '.join(self.factors)}")
        if self.uncompared:
            said.append(f"columns of the design, not compared: {', '.join(self.uncompared)}")
        if self.factors or self.uncompared:
            said[-1] += " (name one in indices to compare it)"
        return (*said, *self.notes)

    def _why(self, condition: str) -> str:
        """Return in brackets why a certificate cannot say, or what its claim rests on."""
        own = self.certificates[condition]
        if own.verdict == PASS:
            level = f"{interval_level(own.alpha)} interval"
            said = [
                f"{name} {change_text(own.point(name), test)}, {level} {interval_with_unit(own.point(name), test)}, "
                f"{people_text(test.share_test(own.rule))}"
                for name, test in own.end_points.items()
            ]
            points = [point for name in own.end_points if (point := own.tipping_point(name)) is not None]
            if points:
                said.append(f"{own.assumption()}; more than {min(points):.2f} margins would overturn the verdict")
            return f" ({'; '.join(said)})"
        reasons = []
        for name, test in own.end_points.items():
            reason = own.reason(name)
            if reason:
                losses = [] if own.contradicted(name) else self._losses(name, test.pairs)
                reasons.append(f"{name} {'; '.join((reason, *losses))}")
        return f" ({'; '.join(reasons)})" if reasons else ""

    def _losses(self, index: str, people: int) -> list[str]:
        """Return sentences on the participants and movements without a value of an index; empty without losses."""
        every = len(self.participants) + len(self.left_out)
        said = [f"{every - people} of {every} excluded"] if people < every else []
        return said + [f"{gone} of {of} movements lost in {c}" for c, (gone, of) in self.lost[index].items() if gone]

    def __repr__(self) -> str:
        return "\n".join((text_table(*self._table()), *self._facts()))

    def _repr_html_(self) -> str:
        return html_table("Changes from the control condition", *self._table(), self._facts())


def assess_table(
    table: object,
    *,
    analysis: Analysis | Mapping[str, Any] | str | os.PathLike[str] | None = None,
    control: str | None = None,
    indices: Sequence[str] | None = None,
    participant: str = "participant",
    condition: str = "condition",
    factors: Sequence[str] | None = None,
    margins: Mapping[str, float] | None = None,
    alpha: float = 0.05,
    estimand: Estimand = "mean",
    people: float | None = None,
    people_level: float = DEFAULT_RULE.alpha,
    largest_carry_over: float = DEFAULT_CARRY_OVER,
    max_left_out: float = DEFAULT_MAX_LEFT_OUT,
) -> TableAssessment:
    """Compare conditions over participants from a table, as the command ``assess`` compares a study's recordings.

    Parameters
    ----------
    table : data frame or mapping of str to sequence
        One row for each movement, trial or participant, with the columns `participant` and `condition` and one column
        for each index. A movement that gave no value has NaN, or no row. A participant's movements of one condition
        are averaged within each level of the `factors`, then over the levels that the participant has in all
        conditions. A column ``period`` says when conditions came: the change of an index with a margin is estimated
        without the effect of the period. ``block`` and ``trial`` say when movements came: such a change is tested
        without the effect of learning, too.
    analysis : Analysis, mapping, or path-like, optional
        What was stated before the data were seen: an object, its mapping, ``analysis.toml``, or study.toml with
        ``[assessment]``. It takes the place of all keywords but `indices`.
    control : str
        Name of the condition with which the others are compared.
    indices : sequence of str, optional
        Columns to compare. By default all numeric columns but those of the design: by their names, such as
        ``amplitude``, ``target_distance``, ``load``, ``side``, ``period``, ``order`` and ``trial``, or because they
        have few levels, the same ones in every condition and participant.
    participant, condition : str
        Names of the two columns that identify a row.
    factors : sequence of str, optional
        Columns that say which movements are alike; by default all columns of the design but those of order.
    margins : mapping of str to float, optional
        Largest relative change of an index that does not matter, by index: makes a certificate for each condition.
    alpha : float
        Level of the certificates.
    estimand : {"mean", "pseudo-median", "mean and people"}
        What must lie within the margins, as in `certify`.
    people : float, optional
        Share of people in (0, 1) who must be shown to lie within, for ``"mean and people"``.
    people_level : float
        Level of the tests of both shares of people, as in `certify`.
    largest_carry_over : float
        Largest effect of one session on the next, as a share of the margin, for which the certificate holds. It matters
        only with a column ``period``.
    max_left_out : float
        Largest share of a condition's movements, or of participants, that may be missing where "transparent" is said of
        the others, in [0, 1]; 1 where conditions have other numbers of movements by design.

    Returns
    -------
    TableAssessment

    Raises
    ------
    PellucidError
        If a column is missing, the control is no condition, or fewer than two participants did all conditions.
    """
    if analysis is not None:
        stated = Analysis.of(analysis)
        given = {
            "control": control, "margins": margins, "alpha": alpha, "estimand": estimand, "people": people,
            "people_level": people_level, "largest_carry_over": largest_carry_over, "factors": factors,
            "max_left_out": max_left_out, "participant": participant, "condition": condition,
        }  # fmt: skip
        if twice := keywords_beside(assess_table, given):
            raise PellucidError(
                f"assess: found analysis and {', '.join(twice)}, expected only analysis, which states them"
            )
    else:
        stated = Analysis(
            margins=margins or {}, control=control or "", estimand=estimand, people=people, people_level=people_level,
            false_transparent=alpha, largest_carry_over=largest_carry_over, max_left_out=max_left_out,
            participant=participant, condition=condition, factors=None if factors is None else tuple(factors),
            where="assess",
        )  # fmt: skip
    return _assessed(columns_of(table, "assess"), stated, indices)


def _assessed(
    columns: Mapping[str, Sequence[Any]], stated: Analysis, indices: Sequence[str] | None
) -> TableAssessment:
    """Return the comparison of a table's columns by an analysis."""
    participant, condition, control, margins = stated.participant, stated.condition, stated.control, stated.margins
    ordering = [stated.sequence] if stated.sequence else []
    stated_columns = [stated.period, *ordering] if stated.period else ordering
    for name in (participant, condition, *(indices or ()), *(stated.factors or ()), *margins, *stated_columns):
        if name not in columns:
            raise PellucidError(f"assess: found the columns {', '.join(columns)}, expected {name!r} among them")
    if stated.curves:
        raise PellucidError(
            f"{stated.where}: found margins of curves ({', '.join(stated.curves)}), expected none for a table: only "
            "recordings have curves"
        )
    if not control:
        raise PellucidError("assess: found no control, expected the name of the control condition")
    ends = stated.end_points()
    who, what = ([str(value) for value in columns[name]] for name in (participant, condition))
    conditions = list(dict.fromkeys(what))
    if control not in conditions:
        raise PellucidError(f"assess: found the conditions {', '.join(conditions)}, expected the control {control!r}")
    conditions = [control, *(name for name in conditions if name != control)]
    if len(conditions) < 2:
        raise PellucidError(f"assess: found the condition {control} alone, expected at least one other")
    others = [name for name in columns if name not in (participant, condition, *ordering)]
    named = {*margins, *(indices or ())}
    roles = design_roles({name: columns[name] for name in others if name not in named}, who, what)
    if stated.period:
        roles[stated.period] = DesignRole.PERIOD_FACTOR
    if indices is None:
        indices = [
            name for name in others
            if name in named
            or (name not in roles and name not in (stated.factors or ()) and _is_numeric(columns[name]))
        ]  # fmt: skip
    if not indices:
        taken = f", of which {', '.join(roles)} describe the design" if roles else ""
        raise PellucidError(
            f"assess: found no numeric column to compare among {', '.join(columns)}{taken}, expected at least one index"
        )
    strangers = [name for name in margins if name not in indices]
    if strangers:
        raise PellucidError(f"assess: found margins of {', '.join(strangers)}, expected them among the indices too")
    design = {name: columns[name] for name in others if name not in indices}
    cells, used, alike, notes = _cells(design, roles, stated.factors, what)
    numbers = {name: _numbers(name, columns[name]) for name in indices}
    rows = _Rows(who, what, cells, _order(design, roles), numbers, alike)
    people_names = list(dict.fromkeys(who))
    there = set(zip(who, what, strict=True))
    participants = tuple(
        p for p in people_names if p not in stated.excluded and all((p, c) in there for c in conditions)
    )
    left_out = tuple(p for p in people_names if p not in participants)
    tables = {name: _values(rows, name, participants, conditions) for name in indices}
    few = {name: len(people) for name, (people, _, _) in tables.items() if len(people) < 2}
    if few:
        name, count = next(iter(few.items()))
        raise PellucidError(
            f"assess, {name}: found {count} participants with alike movements in all conditions, expected at least 2"
        )
    comparisons = {
        name: compare_conditions(values, shown, control=control if control in shown else None)
        for name, (_, shown, values) in tables.items()
    }
    lost = {name: _lost(rows, name, tables[name][0], tables[name][1]) for name in indices}
    certificates = {}
    periods: Mapping[tuple[str, str], float] = {}
    if stated.sequence:
        periods = _periods_of_sequences(columns[stated.sequence], who, conditions, stated.sequence)
    elif stated.period:
        periods = _mean_periods(columns[stated.period], who, what, stated.period)
    else:
        periods = _periods(design, roles, who, what)
    if margins:
        both = [p for p in participants if all(p in tables[name][0] for name in margins)]
        for name in conditions[1:]:
            changes = {
                index: _changes(rows, tables[index], index, end, (control, name), both, conditions, periods, stated)
                for index, end in ends.items()
            }
            missing = len({*people_names, *stated.excluded}) - len(both)
            certificates[name] = decide(stated, changes, lost_people=missing, points=ends)
    tests = {index: _tests(tables[index], index, conditions, certificates, stated, periods) for index in indices}
    notes += _notes(tables, participants, lost, stated.max_left_out)
    notes += [f"{person}: excluded: {why}" for person, why in stated.excluded.items()]
    uncompared = tuple(name for name in roles if name not in used)
    return TableAssessment(
        comparisons, participants, left_out, certificates, lost, tuple(used), (*uncompared, *ordering), tuple(notes),
        tests,
    )  # fmt: skip


def _tests(
    table: tuple[tuple[str, ...], list[str], np.ndarray], index: str, conditions: Sequence[str],
    certificates: Mapping[str, Certificate], stated: Analysis, periods: Mapping[tuple[str, str], float],
) -> dict[str, Equivalence]:  # fmt: skip
    """Return the tests of an index's changes from control, by condition, with intervals of 95 %."""
    names, recorded, values = table
    control, made = conditions[0], {}
    for name in conditions[1:]:
        own = certificates.get(name)
        if own is not None and index in own.end_points:
            made[name] = own.end_points[index].tested_again(alpha=0.025)
        elif control in recorded and name in recorded:
            sessions = stated.sessions(periods, names, conditions, name)
            changes = values[:, recorded.index(name)] - values[:, recorded.index(control)]
            made[name] = equivalence(changes, NO_MARGIN, alpha=0.025, method=stated.method, sessions=sessions)
    return made


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of the table."""

    who: Sequence[str]
    what: Sequence[str]
    cells: Sequence[tuple]  # cell of alike movements, by row
    order: np.ndarray | None  # place of each row in time; None if it is not stated
    values: Mapping[str, np.ndarray]  # by index, (rows,)
    alike: bool  # whether columns say which movements are alike


def _is_numeric(values: Sequence[Any]) -> bool:
    return all(isinstance(value, (int, float, np.integer, np.floating)) for value in values)


def _numbers(name: str, values: Sequence[Any]) -> np.ndarray:
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError):
        raise PellucidError(f"assess, column {name}: found values that are no numbers, expected numbers") from None


def _cells(
    design: Mapping[str, Sequence[Any]], roles: Mapping[str, DesignRole], factors: Sequence[str] | None,
    conditions: Sequence[str],
) -> tuple[list[tuple], list[str], bool, list[str]]:  # fmt: skip
    """Return the cell of each row, the factors that make it, whether any does, and notes on those that do not.

    A factor with one level makes no cells, and says all the same that movements are alike.
    """
    wanted = columns_with_role(roles, DesignRole.CELL_FACTOR) if factors is None else list(factors)
    clash = [name for name in wanted if name not in design]
    if clash:
        raise PellucidError(
            f"assess: found {', '.join(clash)} both as index and as factor, expected one use of each column"
        )
    used, notes, parts, alike = [], [], [], False
    for name in wanted:
        levels = [_level(name, row, value) for row, value in enumerate(design[name])]
        count = len(set(levels))
        if too_many_levels(tuple(set(levels))):
            notes.append(f"{name} has {count} levels: movements are not compared within them")
        elif factors is None and count > 1 and not _shared_levels(levels, conditions):
            notes.append(f"{name} has other levels in every condition: movements are not compared within them")
        else:
            alike = True
            if count > 1:
                used.append(name)
                parts.append(levels)
    cells: list[tuple] = list(zip(*parts, strict=True)) if parts else [()] * len(conditions)
    return cells, used, alike, notes


def _shared_levels(levels: Sequence[object], conditions: Sequence[str]) -> set:
    """Return the levels that all conditions have."""
    own: dict[str, set] = {}
    for level, condition in zip(levels, conditions, strict=True):
        own.setdefault(condition, set()).add(level)
    return set.intersection(*own.values())


def _level(name: str, row: int, value: Any) -> object:
    """Return the level of a factor in a row."""
    if value is None or (isinstance(value, (float, np.floating)) and not np.isfinite(value)):
        raise PellucidError(f"assess, column {name}, row {row}: found no value, expected one of every movement")
    return level_of(value)


def _order(design: Mapping[str, Sequence[Any]], roles: Mapping[str, DesignRole]) -> np.ndarray | None:
    """Return the place of each row in time by the columns of the design that state it; None without one."""
    wanted = columns_with_role(roles, DesignRole.PERIOD_FACTOR) + columns_with_role(roles, DesignRole.TRIAL_FACTOR)
    known = [np.asarray(design[name], float) for name in wanted if _is_numeric(design[name])]
    if not columns_with_role(roles, DesignRole.TRIAL_FACTOR) or not known or not np.isfinite(known).all():
        return None
    return np.unique(np.array(known).T, axis=0, return_inverse=True)[1].ravel()


def _periods(
    design: Mapping[str, Sequence[Any]], roles: Mapping[str, DesignRole], who: Sequence[str], what: Sequence[str]
) -> Mapping[tuple[str, str], float]:
    """Return the mean period of each participant and condition; empty if it is not stated."""
    name = next((n for n in columns_with_role(roles, DesignRole.PERIOD_FACTOR) if _is_numeric(design[n])), None)
    if name is None or not np.isfinite(np.asarray(design[name], float)).all():
        return {}
    return _mean_periods(design[name], who, what, name)


def _mean_periods(
    values: Sequence[Any], who: Sequence[str], what: Sequence[str], name: str
) -> Mapping[tuple[str, str], float]:
    """Return the mean of a column of periods by participant and condition."""
    if not _is_numeric(values) or not np.isfinite(np.asarray(values, float)).all():
        raise PellucidError(f"assess, column {name}: found values that are no numbers, expected sessions' numbers")
    found: dict[tuple[str, str], list[float]] = {}
    for person, condition, value in zip(who, what, values, strict=True):
        found.setdefault((person, condition), []).append(float(value))
    return {key: float(np.mean(own)) for key, own in found.items()}


def _periods_of_sequences(
    values: Sequence[Any], who: Sequence[str], conditions: Sequence[str], name: str
) -> Mapping[tuple[str, str], float]:
    """Return the period by participant and condition from each participant's sequence of conditions.

    A sequence names the conditions in their order, or has the letters A and B of control and the other condition.
    """
    found: dict[tuple[str, str], float] = {}
    told: dict[str, str] = {}
    for person, value in zip(who, values, strict=True):
        text = str(value).strip()
        if told.setdefault(person, text) != text:
            raise PellucidError(
                f"assess, column {name}: found {told[person]!r} and {text!r} for {person}, "
                "expected one sequence for each participant"
            )
    for person, text in told.items():
        names = re.split(r"[\s,;>/-]+", text)
        if sorted(text.upper()) == ["A", "B"] and len(conditions) == 2 and sorted(names) != sorted(conditions):
            names = [conditions["AB".index(letter)] for letter in text.upper()]
        if sorted(names) != sorted(conditions):
            raise PellucidError(
                f"assess, column {name}: found {text!r} of {person}, expected all of {', '.join(conditions)} in their "
                "order, such as " + repr(" ".join(conditions)) + (" or 'AB' (A is control)" * (len(conditions) == 2))
            )
        found |= {(person, each): float(place) for place, each in enumerate(names, 1)}
    return found


def _values(
    rows: _Rows, index: str, participants: Sequence[str], conditions: Sequence[str]
) -> tuple[tuple[str, ...], list[str], np.ndarray]:
    """Return the participants with a value in every condition, these conditions, and the values, (n, k)."""
    sums: dict[tuple, list[float]] = {}
    for person, condition, cell, value in zip(rows.who, rows.what, rows.cells, rows.values[index], strict=True):
        if np.isfinite(value):
            sums.setdefault((person, condition, cell), []).append(float(value))
    means = {key: float(np.mean(own)) for key, own in sums.items()}
    recorded = [c for c in conditions if any(key[1] == c for key in means)]
    shared = shared_cells(means, participants, recorded) if recorded else {}
    values = np.array([[float(np.mean(own[c])) for c in recorded] for own in shared.values()])
    return tuple(shared), recorded, values.reshape(len(shared), len(recorded))


def _lost(rows: _Rows, index: str, participants: Sequence[str], conditions: Sequence[str]) -> LostCounts:
    """Count the movements without a value, and all that there should be, by condition."""
    rows_of: dict[tuple, int] = {}
    known: dict[tuple, int] = {}
    for person, condition, cell, value in zip(rows.who, rows.what, rows.cells, rows.values[index], strict=True):
        if person in participants and condition in conditions:
            key = (person, cell, condition)
            rows_of[key] = rows_of.get(key, 0) + 1
            known[key] = known.get(key, 0) + bool(np.isfinite(value))
    most: dict[tuple, int] = {}
    for (person, cell, _), count in rows_of.items():
        most[person, cell] = max(most.get((person, cell), 0), count)
    total = sum(most.values())
    return {c: (total - sum(known.get((*key, c), 0) for key in most), total) for c in conditions}


def _changes(
    rows: _Rows, table, index: str, end: EndPoint, pair: tuple[str, str], both: Sequence[str],
    conditions: Sequence[str], periods: Mapping[tuple[str, str], float], stated: Analysis,
) -> PeoplesChanges:  # fmt: skip
    """Return what the rows say of the changes of an index in the second condition of a `pair` against the first."""
    if len(both) < 2:
        raise PellucidError(f"assess, {pair[1]}: found {len(both)} participants with all margins, expected 2 or more")
    names, recorded, values = table
    lacking = [c for c in pair if c not in recorded]
    if lacking:
        raise PellucidError(f"assess, {index}: found no value in {', '.join(lacking)}, expected some for its margin")
    values = values[[names.index(person) for person in both]]
    base, own = (values[:, recorded.index(c)] for c in pair)
    if end.ratio and not (np.minimum(base, own) > 0.0).all():
        raise PellucidError(f"assess, {index}: found means of 0 or less, expected positive ones for its margin")
    seen = end.differences(own, base)
    used = rows.values[index]
    wrong = np.flatnonzero(np.isinf(used))
    if len(wrong):
        i = int(wrong[0])
        raise PellucidError(
            f"assess, column {index}, row {i} ({rows.who[i]}, {rows.what[i]}): found {used[i]:g}, expected a finite "
            "value, or NaN for a movement without one"
        )
    below = np.flatnonzero(used < 0.0)
    if end.ratio and len(below):
        i = int(below[0])
        raise PellucidError(
            f"assess, column {index}, row {i} ({rows.who[i]}, {rows.what[i]}): found {used[i]:g}, expected no negative "
            "values: its margin is a share of control"
        )
    known, zero = end.catalogued, np.flatnonzero(used == 0.0)
    if end.ratio and known is not None and known.is_positive and len(zero):
        i = int(zero[0])
        raise PellucidError(
            f"assess, column {index}, row {i} ({rows.who[i]}, {rows.what[i]}): found 0, expected a positive value: no "
            f"movement has a {known.words.lower()} of 0; a movement without a value has NaN"
        )
    if end.ratio:
        used = np.log(np.where(used > 0.0, used, np.nan))
    trend = learning(OrderedMovements(rows.who, rows.what, rows.cells, used, rows.order), both, pair)
    lost_by_person = [_lost(rows, index, [person], pair) for person in both]
    return PeoplesChanges(
        end.margin,
        seen,
        sessions=stated.sessions(periods, both, conditions, pair[1]),
        drift=None if trend is None else trend[0],
        at_end=None if trend is None else seen + trend[1],
        lost=_lost(rows, index, both, pair),
        losers=np.array([any(gone for gone, _ in each.values()) for each in lost_by_person]),
        alike=rows.alike,
        noise=_noise(rows, index, end, both, pair),
        completed=_completed(rows, index, end, both, pair, conditions),
    )


def _completed(
    rows: _Rows, index: str, end: EndPoint, both: Sequence[str], pair: tuple[str, str], conditions: Sequence[str]
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return people's changes, (n,) each, with the excess losses of one condition counted as extreme values.

    None without such losses.
    """
    excess = excess_losses(_lost(rows, index, both, pair), pair)
    if excess is None:
        return None
    movements = list(zip(rows.who, rows.what, rows.cells, strict=True))

    def changes(upwards: bool) -> np.ndarray:
        values = completed_values(rows.values[index], movements, *excess, upwards=upwards)
        names, recorded, means = _values(replace(rows, values={index: values}), index, both, conditions)
        means = means[[names.index(person) for person in both]]
        base, own = (means[:, recorded.index(c)] for c in pair)
        return end.differences(own, base)

    return changes(False), changes(True)


def _noise(
    rows: _Rows, index: str, end: EndPoint, both: Sequence[str], pair: tuple[str, str]
) -> MovementNoise | None:
    """Return the noise of people's changes by single movements: by rows of one person, condition and cell."""
    values = rows.values[index]
    order = np.arange(len(values)) if rows.order is None else np.argsort(rows.order, kind="stable")
    own = order[np.isfinite(values[order])]

    def change_of(part: np.ndarray) -> dict[str, float]:
        chosen = own[part]
        some = _Rows(
            [rows.who[i] for i in chosen], [rows.what[i] for i in chosen], [rows.cells[i] for i in chosen], None,
            {index: values[chosen]}, rows.alike,
        )  # fmt: skip
        names, recorded, means = _values(some, index, both, pair)
        if len(recorded) < len(pair):
            return {}
        with np.errstate(divide="ignore", invalid="ignore"):
            return dict(zip(names, end.differences(means[:, 1], means[:, 0]), strict=True))

    return movement_noise([(rows.who[i], rows.what[i], rows.cells[i]) for i in own], both, pair, change_of)


def _notes(tables, participants: Sequence[str], lost: Mapping[str, LostCounts], max_share: float) -> list[str]:
    """State who lacks an index, and which conditions lost more movements than is allowed."""
    notes = []
    for name, (people, _, _) in tables.items():
        absent = [person for person in participants if person not in people]
        if absent:
            notes.append(f"{name}: excluded for lack of equal movements in all conditions: {', '.join(absent)}")
        many = too_many_lost(lost[name], max_share)
        if many:
            counts = " and ".join(f"{gone} of {of} movements in {c}" for c, (gone, of) in many.items())
            notes.append(
                f"{name}: no value for {counts}, more than the {100.0 * max_share:g} % that max_left_out allows"
            )
    return notes
