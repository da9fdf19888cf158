"""Propose what the columns of a log are, from arrays, data frames or files, as an object that can write the study."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._errors import PellucidError
from .._given import require_empty_folder
from .._tabular import data_frame, html_table, text_table
from ..files.readers import Columns
from ..files.stated_units import unit_from_text
from ..study.procedures.registry import open_study
from ..study.study import Study
from ..units import parse_quantity
from .given_columns import columns_of_arrays, is_table, write_columns
from .given_files import GivenFiles, GivenTable, read_given, tables_of_columns
from .init_from_files import copy_file, make_study, study_name
from .proposal import Layout, Proposal, Question
from .propose_study import propose_study
from .study_text import channel_mark, channel_name

if TYPE_CHECKING:
    import pandas

MAX_RATE_MISMATCH = 0.02
"""A stated sampling rate and that of a column of time differ by at most this share."""


@dataclass(frozen=True)
class ProposedRole:
    """Role that is proposed for a column.

    Attributes
    ----------
    column : str
        Name of the column.
    role : str
        Name of the channel, such as ``"position"`` or ``"torque.knee"``; ``""`` if the column is not used.
    unit : str
        Unit of the column's numbers; ``""`` if the column is not used.
    reason : str
        Evidence for the role and for the unit.
    certain : bool
        Whether evidence decides role and unit. study.toml marks the line otherwise.
    """

    column: str
    role: str
    unit: str
    reason: str
    certain: bool


@dataclass(frozen=True)
class ProposedClock:
    """Time of the rows of a log.

    Attributes
    ----------
    column : str or None
        Column that is time; None if only the rate is known, or nothing.
    unit : str
        Unit of that column.
    rate : float or None
        Sampling rate [Hz]; None if nothing states it.
    reason : str
        Evidence for it.
    """

    column: str | None
    unit: str
    rate: float | None
    reason: str


@dataclass(frozen=True, eq=False, repr=False)
class LogProposal:
    """What the columns of a log are, with the reason for each, and the study that follows.

    ``print(proposal)`` prints a table, and a notebook shows it.

    Attributes
    ----------
    roles : tuple of ProposedRole
        One of each column but the clock, in the log's order.
    clock : ProposedClock
        Time of the rows.
    questions : tuple of Question
        Questions that only a person can answer, at most five, each with its default.
    remarks : tuple of str
        What was noticed and not used.
    """

    roles: tuple[ProposedRole, ...]
    clock: ProposedClock
    questions: tuple[Question, ...]
    remarks: tuple[str, ...]
    _proposal: Proposal
    _columns: Mapping[Path, Columns]  # columns that no file holds, by the path that stands for them

    @property
    def reasons(self) -> dict[str, str]:
        """Reasons by column, the clock's first."""
        clock = {} if self.clock.column is None else {self.clock.column: self.clock.reason}
        return clock | {role.column: role.reason for role in self.roles}

    @property
    def units(self) -> dict[str, str]:
        """Units by column, the clock's first, of the columns that are used."""
        clock = {} if self.clock.column is None else {self.clock.column: self.clock.unit}
        return clock | {role.column: role.unit for role in self.roles if role.role}

    def __iter__(self) -> Iterator[ProposedRole]:
        return iter(self.roles)

    def __len__(self) -> int:
        return len(self.roles)

    def __getitem__(self, column: str) -> ProposedRole:
        """Return the role of a column.

        Raises
        ------
        KeyError
            If there is no such column; the message lists those that there are.
        """
        found = {role.column: role for role in self.roles}
        if column not in found:
            raise KeyError(f"{column!r}; found here: {', '.join(found) or 'no column'}")
        return found[column]

    def to_frame(self) -> pandas.DataFrame:
        """Return a row for each column: column, role, unit, certain and reason; the clock's row is the first.

        Raises
        ------
        PellucidError
            If pandas is not installed; the message says what to install.
        """
        head, rows = self._rows()
        return data_frame({name: [row[i] for row in rows] for i, name in enumerate(head)})

    def __repr__(self) -> str:
        head, rows = self._rows()
        shown = [(*row[:3], "yes" if row[3] else "no", row[4]) for row in rows]
        return "\n".join([self._headline(), text_table(head, shown), *self._sentences()])

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        head, rows = self._rows()
        shown = [(*row[:3], "yes" if row[3] else "no", row[4]) for row in rows]
        return html_table(self._headline(), head, shown, self._sentences())

    def _rows(self) -> tuple[tuple[str, ...], list[tuple[str, str, str, bool, str]]]:
        head = ("column", "role", "unit", "certain", "reason")
        rows = [(r.column, r.role or "not used", r.unit, r.certain, r.reason) for r in self.roles]
        if self.clock.column is None:
            return head, rows
        return head, [(self.clock.column, "time", self.clock.unit, True, self.clock.reason), *rows]

    def _headline(self) -> str:
        rate = f"{self.clock.rate:.5g} Hz" if self.clock.rate else "an unknown rate"
        return f"Proposal for {len(self.roles)} columns at {rate}"

    def _sentences(self) -> list[str]:
        said = self._proposal.answers
        asked = [
            f"question {q.key}: {q.text} {'Answer' if q.key in said else 'Default'}: {said.get(q.key, q.default)}."
            for q in self.questions
        ]
        return [*asked, *(f"note: {text}" for text in self.remarks)]

    def study(self, folder: str | os.PathLike) -> Study:
        """Write the study, as `init` does, and open it.

        Recordings of files are copied. Arrays are written as CSV, with every digit.

        Parameters
        ----------
        folder : path-like
            Folder to make; it may exist if it is empty.

        Returns
        -------
        Study
            For `identify`; its study.toml marks every guess, and ``proposal/index.html`` shows every column.

        Raises
        ------
        PellucidError
            If `folder` is no path.
        StudyError
            If the folder is not empty, or a stated unit is not known.
        UnfitRecordingError
            If `check` refuses the study. Its note names a page that shows what was understood.
        """
        if not isinstance(folder, (str, os.PathLike)):
            raise PellucidError(f"study: folder: found {type(folder).__name__}, expected a path")
        path = Path(folder)
        require_empty_folder(path)
        made = make_study(path, replace(self._proposal, name=study_name(path)), put=self._put)
        return open_study(made.folder)

    def _put(self, source: Path, target: Path) -> None:
        """Write a recording into the study: a copy of its file, or its arrays."""
        if source in self._columns:
            write_columns(target, self._columns[source])
        else:
            copy_file(source, target)


def propose(
    data: object,
    *,
    units: Mapping[str, str] | None = None,
    rate: float | str | None = None,
    answers: Mapping[str, str] | None = None,
    urdf: str | os.PathLike | None = None,
) -> LogProposal:
    """Propose what the columns of a log are: roles, units and clock, with the reason for each.

    Parameters
    ----------
    data : data frame, mapping of str to array_like, structured array, path-like, or sequence of these
        Columns by name, each of shape (n,); or files and folders. Several tables are several recordings. Masked,
        missing and NaN samples are missing. A datetime64 column, or such an index of a data frame, is time.
    units : mapping of str to str, optional
        Unit by column, such as ``{"angle": "deg"}``. A stated unit binds.
    rate : float or str, optional
        Sampling rate, in Hz or with its unit, of a log without a column of time.
    answers : mapping of str to str, optional
        Answers by the questions' keys; a question without an answer takes its default.
    urdf : path-like, optional
        Robot's file, which gives the joints.

    Returns
    -------
    LogProposal
        Its `study` writes the study, as `init` does with files.

    Raises
    ------
    PellucidError
        If an argument has another type, a unit is not known, or an answer cannot be. The message names the argument.
    StudyError
        If there is no column of numbers.

    Examples
    --------
    A pendulum of 2 N*m with viscous friction:

    >>> import math
    >>> import pellucid as pl
    >>> angle = [0.5 * math.sin(k / 20) for k in range(400)]  # [rad]
    >>> torque = [2.0 * math.sin(q) + 0.5 * math.cos(k / 20) for k, q in enumerate(angle)]  # [N*m]
    >>> proposal = pl.propose({"angle": angle, "torque": torque}, units={"angle": "rad", "torque": "N*m"}, rate=100.0)
    >>> [(role.column, role.role, role.unit) for role in proposal.roles]
    [('angle', 'position', 'rad'), ('torque', 'torque', 'N*m')]
    >>> study = proposal.study("swung-pendulum")
    >>> [recording.use for recording in study.recordings()]
    ['fit', 'validate']
    """
    stated = _units(units)
    rate_hz = _rate(rate)
    said = _texts(answers, "answers")
    if urdf is not None and not isinstance(urdf, (str, os.PathLike)):
        raise PellucidError(f"propose: urdf: found {type(urdf).__name__}, expected a path")
    given, columns = _given(data)
    if urdf is not None:
        given = given.with_robot(Path(urdf))
    given = _with_stated(given, stated, rate_hz)
    proposal = propose_study(given, "study", said)
    _require_rate(proposal, rate_hz)
    return LogProposal(
        roles=tuple(role for layout in proposal.layouts for role in _roles(layout, proposal)),
        clock=_clock(proposal),
        questions=proposal.asked,
        remarks=proposal.remarks,
        _proposal=proposal,
        _columns=columns,
    )


def _roles(layout: Layout, proposal: Proposal) -> Iterator[ProposedRole]:
    for role in layout.roles.roles:
        reason = "; ".join(dict.fromkeys(text for text in (role.why, role.unit_why) if text))
        if role.quantity is None:
            yield ProposedRole(role.column, "", "", reason, True)
        else:
            yield ProposedRole(role.column, channel_name(role), role.unit, reason, not channel_mark(role, proposal))


def _clock(proposal: Proposal) -> ProposedClock:
    clock = proposal.main.roles.clock
    return ProposedClock(clock.column, clock.unit if clock.column else "", proposal.rate, clock.why)


def _given(data: object) -> tuple[GivenFiles, dict[Path, Columns]]:
    """Return tables of files or of arrays, and the columns of arrays by the path that stands for each table."""
    several = isinstance(data, Sequence) and not isinstance(data, (str, bytes))
    parts: list[Any] = list(data) if several else [data]  # type: ignore[call-overload]
    if parts and all(isinstance(part, (str, os.PathLike)) for part in parts):
        return read_given(parts), {}
    if not parts or not all(map(is_table, parts)):
        strange = next((part for part in parts if not is_table(part)), data)
        raise PellucidError(
            f"propose: data: found {type(strange).__name__}, expected a data frame, a mapping of columns by name, a "
            "structured array, or the paths of files"
        )
    names = ["data"] if len(parts) == 1 else [f"data_{i}" for i in range(1, len(parts) + 1)]
    read = [columns_of_arrays(part, name, "propose") for part, name in zip(parts, names, strict=True)]
    tables = [table for columns in read for table in tables_of_columns(columns)]
    if not tables:
        raise PellucidError("propose: data: found no column with at least 8 numbers, expected one or more")
    return GivenFiles(tuple(tables), (), (), ()), {columns.path: columns for columns in read}


def _with_stated(given: GivenFiles, units: Mapping[str, str], rate: float | None) -> GivenFiles:
    """Return the tables with units and a sampling rate that the caller states."""
    names = {name for table in given.tables for name in table.columns}
    unknown = [name for name in units if name not in names]
    if unknown:
        raise PellucidError(
            f"propose: units: found the column {unknown[0]!r}, expected one of {', '.join(sorted(names))}"
        )

    def stated(table: GivenTable) -> GivenTable:
        own = {name: unit for name, unit in units.items() if name in table.columns}
        facts = {} if rate is None else {"Sampling rate": f"{rate:.12g} Hz"}
        return replace(table, units={**table.units, **own}, facts={**facts, **table.facts})

    return replace(given, tables=tuple(map(stated, given.tables)))


def _require_rate(proposal: Proposal, rate: float | None) -> None:
    """Raise a PellucidError if a stated sampling rate is not that of the column of time."""
    found, column = proposal.rate, proposal.main.roles.clock.column
    if rate is None or found is None or column is None or abs(found / rate - 1.0) <= MAX_RATE_MISMATCH:
        return
    raise PellucidError(
        f'propose: rate: found {rate:g} Hz, but the column "{column}" gives {found:.5g} Hz, expected the same rate'
    )


def _texts(given: object, argument: str) -> dict[str, str]:
    """Return a mapping of texts; a PellucidError names the argument where it is something else."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise PellucidError(f"propose: {argument}: found {type(given).__name__}, expected a mapping of str to str")
    for key, value in given.items():
        if not isinstance(key, str) or not isinstance(value, str):
            raise PellucidError(f"propose: {argument}: found {key!r}: {value!r}, expected a mapping of str to str")
    return dict(given)


def _units(given: object) -> dict[str, str]:
    """Return the stated units as study.toml writes them; a PellucidError names a column with another one."""
    units = {}
    for column, text in _texts(given, "units").items():
        unit = unit_from_text(text)
        if unit is None:
            raise PellucidError(
                f'propose: units: column "{column}": found the unknown unit "{text}", expected one such as "N*m", '
                '"deg", "rad/s" or "mA"'
            )
        units[column] = unit
    return units


def _rate(given: object) -> float | None:
    """Return a sampling rate [Hz]; a PellucidError where it is none."""
    if given is None:
        return None
    expected = 'expected a sampling rate in Hz, such as 200.0 or "1 kHz"'
    try:
        value = parse_quantity(given, "Hz", "") if isinstance(given, str) else float(given)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise PellucidError(f"propose: rate: found {given!r}, {expected}") from None
    if isinstance(given, bool) or not 0.0 < value < float("inf"):
        raise PellucidError(f"propose: rate: found {given!r}, {expected}")
    return value
