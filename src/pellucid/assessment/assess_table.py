"""Conditions compared from a table with one row for each movement, trial or participant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .._errors import PellucidError
from .._tabular import columns_of, data_frame, html_table, text_table
from .certificate import Certificate
from .certify import certify
from .comparison import ConditionComparison, compare_conditions


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
    """

    comparisons: Mapping[str, ConditionComparison]
    participants: tuple[str, ...]
    left_out: tuple[str, ...]
    certificates: Mapping[str, Certificate] = field(default_factory=dict)

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
        return [
            {
                "index": index,
                "condition": name,
                "change": each.change,
                "low": each.interval[0],
                "high": each.interval[1],
                "p": each.p,
                "standardised": each.standardised,
            }
            for index, comparison in self.comparisons.items()
            for name, each in comparison.pairwise.items()
        ]

    def _table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        head = ("index", "condition", "change", "95 % interval", "p")
        return head, [
            (
                row["index"],
                row["condition"],
                f"{row['change']:+.4g}",
                f"{row['low']:+.4g} to {row['high']:+.4g}",
                f"{row['p']:.3g}",
            )
            for row in self._rows()
        ]

    def _facts(self) -> tuple[str, ...]:
        said = [f"{len(self.participants)} participants"]
        if self.left_out:
            said.append(f"left out for a missing condition: {', '.join(self.left_out)}")
        said += [f"{name}: {each.verdict}" for name, each in self.certificates.items()]
        return tuple(said)

    def __repr__(self) -> str:
        return "\n".join((text_table(*self._table()), *self._facts()))

    def _repr_html_(self) -> str:
        return html_table("Changes from the control condition", *self._table(), self._facts())


def assess_table(
    table: object,
    *,
    control: str,
    indices: Sequence[str] | None = None,
    participant: str = "participant",
    condition: str = "condition",
    margins: Mapping[str, float] | None = None,
    alpha: float = 0.05,
) -> TableAssessment:
    """Compare conditions over participants from a table.

    Parameters
    ----------
    table : data frame or mapping of str to sequence
        One row for each movement, trial or participant, with the columns `participant` and `condition` and one column
        for each index. A participant's rows of one condition are averaged.
    control : str
        Name of the condition with which the others are compared.
    indices : sequence of str, optional
        Columns to compare; all other numeric columns by default.
    participant, condition : str
        Names of the two columns that identify a row.
    margins : mapping of str to float, optional
        Largest relative change of an index that does not matter, by index: makes a certificate for each condition.
    alpha : float
        Level of the certificates.

    Returns
    -------
    TableAssessment

    Raises
    ------
    PellucidError
        If a column is missing, the control is no condition, or fewer than two participants did all conditions.
    """
    columns = columns_of(table, "assess")
    for name in (participant, condition, *(indices or ()), *(margins or ())):
        if name not in columns:
            raise PellucidError(f"assess: found the columns {', '.join(columns)}, expected {name!r} among them")
    who, what = ([str(value) for value in columns[name]] for name in (participant, condition))
    conditions = list(dict.fromkeys(what))
    if control not in conditions:
        raise PellucidError(f"assess: found the conditions {', '.join(conditions)}, expected the control {control!r}")
    conditions = [control, *(name for name in conditions if name != control)]
    if len(conditions) < 2:
        raise PellucidError(f"assess: found the condition {control} alone, expected at least one other")
    if indices is None:
        indices = [name for name in columns if name not in (participant, condition) and _is_numeric(columns[name])]
    if not indices:
        raise PellucidError(f"assess: found no numeric column among {', '.join(columns)}, expected at least one index")
    people = list(dict.fromkeys(who))
    means = {name: _means(name, columns[name], who, what, people, conditions) for name in indices}
    complete = np.all([np.isfinite(each).all(axis=1) for each in means.values()], axis=0)
    if complete.sum() < 2:
        raise PellucidError(
            f"assess: found {int(complete.sum())} participants with all conditions, expected at least 2"
        )
    comparisons = {
        name: compare_conditions(each[complete], conditions, control=control) for name, each in means.items()
    }
    certificates = {}
    for column, name in enumerate(conditions[1:], start=1):
        if margins:
            pairs = {index: (means[index][complete, 0], means[index][complete, column]) for index in margins}
            certificates[name] = certify(pairs, margins, alpha=alpha)
    return TableAssessment(
        comparisons,
        tuple(name for name, whole in zip(people, complete, strict=True) if whole),
        tuple(name for name, whole in zip(people, complete, strict=True) if not whole),
        certificates,
    )


def _is_numeric(values: Sequence[Any]) -> bool:
    return all(isinstance(value, (int, float, np.integer, np.floating)) for value in values)


def _means(name, values, who, what, people, conditions) -> np.ndarray:
    """Return the mean of an index for each participant and condition, shape (participants, conditions)."""
    try:
        numbers = np.asarray(values, float)
    except (TypeError, ValueError):
        raise PellucidError(f"assess, column {name}: found values that are no numbers, expected numbers") from None
    total, count = np.zeros((len(people), len(conditions))), np.zeros((len(people), len(conditions)))
    row = {each: i for i, each in enumerate(people)}
    column = {each: i for i, each in enumerate(conditions)}
    for person, state, number in zip(who, what, numbers, strict=True):
        if np.isfinite(number):
            total[row[person], column[state]] += number
            count[row[person], column[state]] += 1.0
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(count > 0.0, total / count, np.nan)
