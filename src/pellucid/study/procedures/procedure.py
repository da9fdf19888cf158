"""The base class of procedures: the table that asks for one, its faults, its run and its page."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, cast

from ..._errors import RecordingError

if TYPE_CHECKING:
    from ...files.fault import Fault
    from ..pages.page import Page
    from ..study import Study
    from ..study_fields import ProcedureTable
    from .result import Result

Progress = Callable[[str, float], None]
"""A function that is told what is done now, and the share of all work that is done."""

Table = TypeVar("Table", bound="ProcedureTable | None")
"""The class of the table that asks for a procedure; None where other tables do."""

Found = TypeVar("Found", bound="Result")
"""The class of the result that a procedure returns, and that its page shows."""


def quiet(text: str, share: float) -> None:
    """Ignore progress."""


class Procedure(ABC, Generic[Table, Found]):
    """A question that a study can ask: the table that asks it, the faults that prevent it, its run and its page.

    `procedures.registry` finds each class in its folder and keeps one object of it. Methods import what is heavy when
    they are called, so that a study is opened and its table checked without it.
    """

    name: ClassVar[str]
    """Name of its folder, and of its table in study.toml."""

    command: ClassVar[str]
    """Command that runs it, such as ``"identify"``; a command may run several procedures."""

    table: type[Table] | None = None
    """Class of its table in study.toml; None where other tables ask for it."""

    whole: ClassVar[bool] = False
    """Whether it needs recordings without a break. Recordings with a cut are then left out, and named."""

    shortest_piece: ClassVar[float | None] = None
    """With `whole`: recordings with cuts are taken as the pieces between them that are at least so long [s]. None: they
    are left out."""

    takes_families: ClassVar[bool] = False
    """Whether the caller may choose the friction families that it compares."""

    uses_limits: ClassVar[bool] = False
    """Whether its cards hold the limits of joints. For other procedures the limits belong to a controller, and may be
    set after an identification."""

    def asked(self, study: Study) -> bool:
        """Return whether a study asks for this procedure."""
        table = cast("type[ProcedureTable] | None", self.table)
        return table is not None and study.find_table(table) is not None

    def table_of(self, study: Study) -> Table:
        """Return the table of a study that asks for this procedure; None where other tables do."""
        table = cast("type[ProcedureTable] | None", self.table)
        return cast("Table", None if table is None else study.table(table))

    @abstractmethod
    def faults(self, study: Study, table: Table) -> list[Fault]:
        """Return the faults that keep recordings from being used, or that a user should know of.

        Raises
        ------
        RecordingError
            If a recording cannot be read.
        """

    def cut(self, study: Study) -> list[Fault]:
        """Return what is left out of the recordings, and what may be clipped, to be told beside the result."""
        from ..quality import clipped_effort_faults, cut_faults, sensor_range_faults, short_piece_fault

        faults: list[Fault] = []
        for recording in study.recordings():
            faults += cut_faults(recording)
            faults += sensor_range_faults(recording, study) + clipped_effort_faults(recording, study)
            short = None if self.shortest_piece is None else short_piece_fault(recording, self.shortest_piece)
            faults += [short] if short is not None else []
        return faults + list(self.unfit(study).values())

    def unfit(self, study: Study) -> dict[str, Fault]:
        """Return the fault of each recording that is left out, by its name: too much of it was cut, or, where none may
        be missing, anything."""
        from ..quality import left_out_fault

        faults = {r.name: left_out_fault(r, study, self.whole, self.shortest_piece) for r in study.recordings()}
        return {name: fault for name, fault in faults.items() if fault is not None}

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
        """Return the files that it reads beside study.toml and the recordings."""
        return ()
