"""What a procedure is: which table of study.toml asks for it, what it needs, how it runs, what it shows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from .._errors import RecordingError

if TYPE_CHECKING:
    from ..pages.page import Page
    from ..recordings.fault import Fault
    from ..recordings.study import Study
    from ..recordings.study_fields import ProcedureTable
    from .result import Result

Progress = Callable[[str, float], None]


def quiet(text: str, share: float) -> None:
    """Tell nobody."""


def late(module: str, function: str) -> Callable:
    """A method that is a function of a module below this folder, imported when it is called."""

    def call(self, study, *arguments, **options):
        return getattr(import_module(f".{module}", __package__), function)(study, *arguments, **options)

    return call


class Procedure(ABC):
    """Something that a study can be asked. One object each, listed in `procedures.registry`.

    What is heavy is imported when a method is called: a study is opened, and its table checked, without it.
    """

    name: ClassVar[str]
    """Of its folder, and of its table in study.toml."""

    command: ClassVar[str]
    """That runs it: ``"identify"``, ``"calibrate"`` or ``"assess"``."""

    table: ClassVar[type[ProcedureTable] | None] = None
    """What study.toml may say under its name; None where other tables ask for it."""

    whole: ClassVar[bool] = False
    """Whether it needs recordings without a break; those with a cut are left out, and named."""

    uses_limits: ClassVar[bool] = False
    """Whether its cards hold the limits of joints; those of others are a controller's, and may be set later."""

    def asked(self, study: Study) -> bool:
        """Whether this study asks for it; nobody else looks at that."""
        return self.table is not None and study.find_table(self.table) is not None

    @abstractmethod
    def faults(self, study: Study) -> list[Fault]:
        """What keeps recordings from being used, or is to be known of them; RecordingError if one is unreadable."""

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
    def run(self, study: Study, tell: Progress = quiet, **options) -> Result:
        """Everything that was found; a PellucidError where recordings cannot carry it."""

    @abstractmethod
    def page(self, study: Study, result: Result) -> Page:
        """What the report shows of a result."""

    def inputs(self, study: Study) -> Iterable[Path]:
        """Files that it reads beside study.toml and the recordings."""
        return ()
