"""Procedures as domains and plug-ins describe them: what asks for one, and the functions that check, run and show it.

Nothing heavy is imported here: ``pellucid --help`` names every command, and a study is opened without what it does not
ask for.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..._domains import find_domains, load_reference
from ..._errors import RecordingError, UnfitRecordingError
from ..._plugins import load_plugins, require_attributes
from ..._printed_command import printed_command

if TYPE_CHECKING:
    from ...files.fault import Fault
    from ..pages.page import Page
    from ..study import Study
    from ..study_fields import ProcedureTable
    from .command import Command
    from .result import Result

Progress = Callable[[str, float], None]
"""A function that receives the current step in words, and the completed share of all work."""

Table = TypeVar("Table", bound="ProcedureTable | None")
"""The class of the table that asks for a procedure; None where other tables do."""

Found = TypeVar("Found", bound="Result")
"""The class of the result that a procedure returns, and that its page shows."""


def quiet(text: str, share: float) -> None:
    """Ignore progress."""


class CostedSteps:
    """Progress of steps one after another, each with its share of the cost of all.

    Parameters
    ----------
    tell : callable
        Told what is done and the share of all work done.
    costs : mapping of str to float
        Measured cost of each step relative to the others, in the order of the steps.

    Examples
    --------
    >>> steps = CostedSteps(lambda text, share: print(text, share), {"filtering": 1.0, "fitting": 3.0})
    >>> steps.begin("filtering")
    filtering 0.0
    >>> steps.part("fitting")("fitting load", 0.5)
    fitting load 0.625
    """

    def __init__(self, tell: Progress, costs: Mapping[str, float]) -> None:
        total, done = sum(costs.values()), 0.0
        self._tell = tell
        self._parts: dict[str, tuple[float, float]] = {}  # share done before each step, and its own share
        for name, cost in costs.items():
            self._parts[name] = done / total, cost / total
            done += cost

    def begin(self, name: str) -> None:
        """Tell that a step begins."""
        self._tell(name, self._parts[name][0])

    def part(self, name: str) -> Progress:
        """Return a function that receives the progress of one step."""
        before, own = self._parts[name]
        return lambda text, share: self._tell(text, before + own * share)


class Procedure(ABC, Generic[Table, Found]):
    """A question that a study can ask: its table, the faults that prevent an answer, its run and its page.

    Pellucid's own are a `ProcedureEntry` each. Another package may write a subclass instead, in the ``procedure.py`` of
    a package with ``PROCEDURE_ORDER``, and name that package as an entry point of ``pellucid.procedures``.
    """

    name: str  # Its name in messages and results, and that of its table in study.toml
    command: str  # Command that runs it, such as ``"identify"``; a command may run several procedures
    table: Any = None  # Class of its table in study.toml; None where other tables ask for it
    # Whether it needs recordings without a break. Recordings with a cut are then left out, and named.
    whole: bool = False
    # With `whole`: recordings with cuts are taken as the pieces between them that are at least so long [s]. None:
    # they are left out.
    shortest_piece: float | None = None
    cost: float = 1.0  # Measured processor time relative to procedures that stand in the same studies
    takes_families: bool = False  # Whether the caller may choose the friction families that it compares
    takes_each_joint: bool = False  # Whether it identifies the joints of a machine of several, each on its own
    # Whether its cards hold the limits of joints. For other procedures the limits belong to a controller, and may be
    # set after an identification.
    uses_limits: bool = False
    makes_joint_cards: bool = False  # Whether its cards hold parameters of joints, which `compare` takes

    def asked(self, study: Study) -> bool:
        """Return whether a study asks for this procedure."""
        return study.has_table(self.name)

    def table_of(self, study: Study) -> Any:
        """Return the table of a study that asks for this procedure; None where other tables do."""
        return None if self.table is None else study.table(self.table)

    @abstractmethod
    def faults(self, study: Study, table: Table) -> list[Fault]:
        """Return the faults that keep recordings from being used, or that a user should know of.

        Raises
        ------
        RecordingError
            If a recording cannot be read.
        """

    def cut(self, study: Study) -> list[Fault]:
        """Return excluded and possibly clipped samples of the recordings, to be reported with the result."""
        from ..quality import clipped_effort_faults, cut_faults, sensor_range_faults, short_piece_fault

        faults: list[Fault] = []
        for recording in study.recordings():
            faults += cut_faults(recording)
            faults += sensor_range_faults(recording, study) + clipped_effort_faults(recording, study)
            short = None if self.shortest_piece is None else short_piece_fault(recording, self.shortest_piece)
            faults += [short] if short is not None else []
        return faults + list(self.unfit(study).values())

    def unfit(self, study: Study) -> dict[str, Fault]:
        """Return the fault of each excluded recording by its name: too much of it is cut, or anything if it must be
        whole.
        """
        from ..quality import left_out_fault

        faults = {r.name: left_out_fault(r, study, self.whole, self.shortest_piece) for r in study.recordings()}
        return {name: fault for name, fault in faults.items() if fault is not None}

    def excluded_faults(self, study: Study, names: Collection[str]) -> list[Fault]:
        """Return further faults of excluded recordings, by their `names`, next to the reason of their exclusion."""
        return []

    def taken(self, study: Study) -> Study:
        """Return the study without unfit recordings; raise a RecordingError where no other is left."""
        unfit = self.unfit(study)
        if unfit and len(unfit) == len(study.recordings()):
            raise RecordingError("\n".join(fault.message for fault in unfit.values()))
        taken = study.without(unfit) if unfit else study
        return taken if self.shortest_piece is None else taken.in_pieces(self.shortest_piece)

    @abstractmethod
    def run(self, study: Study, table: Table, *tell: Any, **options: Any) -> Found:
        """Return the result of a study whose `table` asks for this procedure.

        The third argument, `tell`, is called with a text and the share done. A procedure names the `options` that it
        has.

        Raises
        ------
        PellucidError
            If the recordings cannot carry a result.
        """

    @abstractmethod
    def page(self, study: Study, found: Found) -> Page:
        """Return the part of the report that shows a result."""

    def inputs(self, study: Study) -> Iterable[Path]:
        """Return the files that it reads in addition to study.toml and the recordings."""
        return ()


@dataclass(frozen=True)
class ProcedureEntry(Procedure[Any, Any]):
    """A procedure as a row of a domain's ``domain.py``: its properties and the places of its functions.

    Functions and tables are named as ``"module:attribute"`` and imported when they are called, the module relative to
    `package`: ``".hinge.faults"`` is in the folder ``hinge`` of that package. Functions that require the table
    take it from the study.
    """

    package: str  # Package of the files below, such as ``pellucid.emg.study.onset``
    name: str
    command: str
    order: int  # Place among all procedures; the smallest is checked, and drawn in reports, first
    find_faults: str  # Function of a study that returns its faults
    find: str  # Function of a study and of `tell`, with the procedure's own options, that returns the result
    draw: str  # Function of a study and of the result that returns the page
    table_class: str | None = None  # Subclass of `ProcedureTable`; None where other tables ask for it
    is_asked: str | None = None  # Function of a study, where it is not the table that asks
    find_inputs: str | None = None  # Function of a study that returns the files that it reads beside the recordings
    find_notes: str | None = None  # Function of a study that returns further faults to be told beside the result
    # Function of a study and of names that returns what else is wrong with the excluded recordings of these names
    find_excluded_faults: str | None = None
    brings: Command | None = None  # Its command, unless that has options of its own and stands in `cli.py`
    leaves_out: bool = True  # Whether recordings with too many cuts are left out; otherwise they refuse the study
    whole: bool = False
    shortest_piece: float | None = None
    cost: float = 1.0
    takes_families: bool = False
    takes_each_joint: bool = False
    uses_limits: bool = False
    makes_joint_cards: bool = False

    @property
    def table(self) -> Any:
        """Class of its table in study.toml; None where other tables ask for it."""
        return None if self.table_class is None else self._load(self.table_class)

    def asked(self, study: Study) -> bool:
        return super().asked(study) if self.is_asked is None else self._load(self.is_asked)(study)

    def faults(self, study: Study, table: Any) -> list[Fault]:
        return self._load(self.find_faults)(study)

    def cut(self, study: Study) -> list[Fault]:
        """Return excluded and possibly clipped samples of the recordings, and this procedure's own notes."""
        return super().cut(study) + ([] if self.find_notes is None else self._load(self.find_notes)(study))

    def unfit(self, study: Study) -> dict[str, Fault]:
        """Return the fault of each excluded recording; none if such a recording stops the procedure."""
        return super().unfit(study) if self.leaves_out else {}

    def excluded_faults(self, study: Study, names: Collection[str]) -> list[Fault]:
        """Return what else is wrong with excluded recordings, where this procedure looks at them."""
        if self.find_excluded_faults is None or not names:
            return []
        find = self._load(self.find_excluded_faults)
        key = find, *sorted(names)  # procedures that look by the same function find the same
        if key not in study.found:
            study.found[key] = find(study, names)
        return list(study.found[key])

    def run(self, study: Study, table: Any, tell: Progress = quiet, **options: Any) -> Any:
        return self._load(self.find)(study, tell, **options)

    def page(self, study: Study, found: Any) -> Page:
        return self._load(self.draw)(study, found)

    def inputs(self, study: Study) -> Iterable[Path]:
        return () if self.find_inputs is None else self._load(self.find_inputs)(study)

    def _load(self, reference: str) -> Any:
        """Return what a reference names, imported now."""
        return load_reference(self.package, reference)


def take_recordings(procedure: Procedure, study: Study, tell: Progress = quiet) -> Study:
    """Return the study without recordings that a procedure excludes; refuse one that has a recording twice."""
    from ...files.duplicates import find_duplicates

    twice = find_duplicates(study.recordings(on_progress=tell))
    if twice:
        raise UnfitRecordingError("\n".join(fault.message for fault in twice))
    return procedure.taken(study)


def described_procedures() -> tuple[ProcedureEntry | ModuleType, ...]:
    """Return what describes each procedure, in the order in which a study is checked and its report drawn.

    Domains list entries in ``domain.py``. Another package names an entry, or a package with ``PROCEDURE_ORDER`` and a
    subclass of `Procedure` in its ``procedure.py``, as an entry point of ``pellucid.procedures``.
    """
    found = {entry: entry.order for domain in find_domains() for entry in getattr(domain, "PROCEDURE_ENTRIES", ())}
    for plugin in load_plugins("pellucid.procedures"):
        if isinstance(plugin.value, ProcedureEntry):
            found[plugin.value] = plugin.value.order
        else:
            require_attributes(plugin, "pellucid.procedures", "PROCEDURE_ORDER", "__path__")
            found[plugin.value] = plugin.value.PROCEDURE_ORDER
    return tuple(sorted(found, key=found.__getitem__))


def typed_command(name: str) -> str:
    """Return what is typed after ``pellucid`` for a command of procedures: "emg force" for "emg-force"."""
    return next((" ".join(command.words) for command in procedure_commands() if command.name == name), name)


def typed_commands(names: Iterable[str], folder: str | os.PathLike) -> str:
    """Return the commands of procedures on one folder as one line that a shell runs one after another."""
    return " && ".join(printed_command(typed_command(name), folder) for name in names)


def procedure_commands() -> tuple[Command, ...]:
    """Return the commands that procedures bring, in the order of the procedures."""
    described = described_procedures()
    brought = [
        each.brings if isinstance(each, ProcedureEntry) else getattr(each, "PROCEDURE_COMMAND", None)
        for each in described
    ]
    return tuple(command for command in brought if command is not None)
