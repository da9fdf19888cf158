"""Activations of all muscles, near their EMG, with which a measured torque follows; muscles without EMG filled in."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from pydantic import Field

from ...recordings.study import Study
from ...recordings.study_fields import ProcedureTable, Word
from ...recordings.study_file import StudyFile
from ..emg_torque.procedure import EmgTorqueTable
from ..procedure import Procedure, late


class ActivationsTable(ProcedureTable):
    """Activations of all muscles: ``[activations]``, beside ``[emg_torque]``, which says where EMG and torque are.

    Attributes
    ----------
    trust : float or None
        In EMG, against the torque; without it chosen within what may be fitted.
    effort : float or None
        What activity costs of a muscle without EMG; chosen with it.
    unrecorded : str
        Of muscles on which no electrode was: ``"neighbour"``, as one of their group, or ``"static"``, by static
        optimisation.
    lost : tuple of str
        Channels whose electrodes were lost in the recordings that judge: filled in from the others.
    fill : str
        How: ``"synergies"`` or ``"linear"``.
    """

    trust: float | None = Field(None, gt=0)
    effort: float | None = Field(None, gt=0)
    unrecorded: Literal["neighbour", "static"] = "neighbour"
    lost: tuple[Word, ...] = ()
    fill: Literal["synergies", "linear"] = "synergies"

    def require_in(self, config: StudyFile) -> None:
        """Muscles, EMG and torques are said elsewhere."""
        if config.find_table(EmgTorqueTable) is None:
            raise ValueError("[activations]: found no table [emg_torque], expected it to say where EMG and torque are")
        if (self.trust is None) != (self.effort is None):
            raise ValueError("[activations]: found one of trust and effort, expected both or neither")


class ActivationsProcedure(Procedure):
    """Activations of all muscles."""

    name, command = "activations", "activations"
    whole = True
    table = ActivationsTable
    faults = late("emg_torque.study_faults", "study_faults")
    run = late("activations.find_activations", "find_activations")
    page = late("activations.activations_page", "page")

    def inputs(self, study: Study) -> Iterable[Path]:
        """The muscles' constants."""
        constants = study.table(EmgTorqueTable).muscle_file
        if constants is not None:
            yield study.inside(constants, "[emg_torque] muscle_file")
