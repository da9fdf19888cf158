"""What a procedure is: which table of study.toml asks for it, what it needs, how it runs, what it shows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, cast

from .._errors import RecordingError

if TYPE_CHECKING:
    from ..pages.page import Page
    from ..recordings.fault import Fault
    from ..recordings.study import Study
    from ..recordings.study_fields import ProcedureTable
    from .result import Result

Progress = Callable[[str, float], None]

Table = TypeVar("Table", bound="ProcedureTable | None")
"""The class of the table that asks for a procedure; None where other tables do."""

Found = TypeVar("Found", bound="Result")
"""The class of the result that a procedure returns, and that its page shows."""


def quiet(text: str, share: float) -> None:
    """Tell nobody."""


class Procedure(ABC, Generic[Table, Found]):
    """A question that a study can ask: the table that asks it, the faults that prevent it, its run and its page.

    `procedures.registry` finds each class in its folder and keeps one object of it. Methods import what is heavy when
    they are called, so that a study is opened and its table checked without it.
    """

    name: ClassVar[str]
    """Of its folder, and of its table in study.toml."""

    command: ClassVar[str]
    """That runs it: ``"identify"``, ``"calibrate"`` or ``"assess"``."""

    table: type[Table] | None = None
    """What study.toml may say under its name; None where other tables ask for it."""

    whole: ClassVar[bool] = False
    """Whether it needs recordings without a break; those with a cut are left out, and named."""

    uses_limits: ClassVar[bool] = False
    """Whether its cards hold the limits of joints; those of others are a controller's, and may be set later."""

    def asked(self, study: Study) -> bool:
        """Whether this study asks for it; nobody else looks at that."""
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
        """What of the recordings it leaves out, to be told beside what it found."""
        from ..recordings.quality import cut_faults

        faults = [fault for recording in study.recordings() for fault in cut_faults(recording)]
        return faults + list(self.unfit(study).values())

    def unfit(self, study: Study) -> dict[str, Fault]:
        """Recordings that are left out, by name: of which too much was cut, or anything where none may be."""
        from ..recordings.quality import left_out_fault

        told = {r.name: left_out_fault(r, study, self.whole) for r in study.recordings()}
        return {name: fault for name, fault in told.items() if fault is not None}

    def taken(self, study: Study) -> Study:
        """The study without recordings that are unfit; RecordingError where no other is left."""
        unfit = self.unfit(study)
        if unfit and len(unfit) == len(study.recordings()):
            raise RecordingError("\n".join(fault.message for fault in unfit.values()))
        return study.without(unfit) if unfit else study

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
        """Files that it reads beside study.toml and the recordings."""
        return ()
