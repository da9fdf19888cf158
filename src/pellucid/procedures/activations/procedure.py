"""Procedure that finds activations near EMG that reproduce a measured torque, and fills in muscles without EMG."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from ...studies.study import Study
from ...studies.study_fields import ProcedureTable, Word
from ...studies.study_file import StudyFile
from ..emg_torque.procedure import EmgTorqueTable
from ..procedure import Procedure, Progress, quiet

if TYPE_CHECKING:
    from ...pages.page import Page
    from ...recordings.fault import Fault
    from .find_activations import ActivationsResult


class ActivationsTable(ProcedureTable):
    """Settings of activations: ``[activations]``, beside ``[emg_torque]``, which says where EMG and torque are.

    Attributes
    ----------
    trust : float or None
        Weight of the deviation from EMG, against the torque; by default chosen within the fitted recordings.
    effort : float or None
        Weight of the activity of a muscle without EMG; chosen together with `trust`.
    unrecorded : str
        Method for muscles that never had an electrode: ``"neighbour"``, the EMG of their group, or ``"static"``, static
        optimisation.
    lost : tuple of str
        Channels whose electrodes were lost in the test recordings, which are filled in from the others.
    fill : str
        Method that fills them in: ``"synergies"`` or ``"linear"``.
    """

    trust: float | None = Field(None, gt=0)
    effort: float | None = Field(None, gt=0)
    unrecorded: Literal["neighbour", "static"] = "neighbour"
    lost: tuple[Word, ...] = ()
    fill: Literal["synergies", "linear"] = "synergies"

    def require_in(self, config: StudyFile) -> None:
        """Require the table [emg_torque], and either both or none of `trust` and `effort`."""
        if config.find_table(EmgTorqueTable) is None:
            raise ValueError("[activations]: found no table [emg_torque], expected it to say where EMG and torque are")
        if (self.trust is None) != (self.effort is None):
            raise ValueError("[activations]: found one of trust and effort, expected both or neither")


class ActivationsProcedure(Procedure[ActivationsTable, "ActivationsResult"]):
    """Activations of all muscles."""

    name, command = "activations", "activations"
    whole = True
    table = ActivationsTable

    def faults(self, study: Study, table: ActivationsTable) -> list[Fault]:
        from ..emg_torque.study_faults import study_faults

        return study_faults(study)

    def run(self, study: Study, table: ActivationsTable, tell: Progress = quiet) -> ActivationsResult:
        from .find_activations import find_activations

        return find_activations(study, tell)

    def page(self, study: Study, found: ActivationsResult) -> Page:
        from .activations_page import page

        return page(study, found)

    def inputs(self, study: Study) -> Iterable[Path]:
        """Yield the file of the muscles' constants."""
        constants = study.table(EmgTorqueTable).muscle_file
        if constants is not None:
            yield study.inside(constants, "[emg_torque] muscle_file")
